"""Fits: the program's results, callbacks, Ctrl-C and resuming, refusals."""

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import kerrlight
from kerrlight import Fit
from kerrlight.fit import FitError

QUICK = {
    "training.steps": 12,
    "training.log_every": 2,
    "output.nodes": 16,
    "screen.pixels": 16,
    "simulation.observation.scans": 16,
    "training.start.linear.steps": 20,
}


def program(*words):
    command = [sys.executable, "-m", "kerrlight", *map(str, words)]
    return subprocess.run(command, check=True, capture_output=True, text=True)


def same_files(one, other, *names):
    for name in names or ("fit.toml", "volume.npz", "movie.npz", "checkpoint.safetensors"):
        assert (one / name).read_bytes() == (other / name).read_bytes(), name


def test_the_programs_results(tmp_path):
    steps = []
    fit = Fit(folder=tmp_path / "ours", set=QUICK).run(steps.append, progress=False)
    changes = [word for key, value in QUICK.items() for word in ("--set", f"{key}={value}")]
    program("fit", "-o", tmp_path / "theirs", *changes)
    theirs = Fit.open(tmp_path / "theirs")
    same_files(fit.folder, theirs.folder)
    np.testing.assert_array_equal(fit.volume.emission, theirs.volume.emission)
    for name in ("psnr_db", "loss", "chi2_per_datum", "verdict"):
        assert fit.results[name] == theirs.results[name]
    assert [step.step for step in steps] == [2, 4, 6, 8, 10, 12] and steps == fit.log
    assert steps[-1].psnr_db == fit.psnr_db
    assert steps[-1].chi2_per_datum.keys() == fit.chi2_per_datum.keys() == {"visibilities"}
    assert fit.volume.emission.shape == (16, 16, 16) and fit.volume.x[0] == fit.volume.low[0]
    assert fit.truth.emission.max() > 0 and "model" in fit.verdict
    assert fit.movie.recovered.shape == fit.movie.data.shape
    assert "<iframe" in fit.report()._repr_html_() and fit.report().path.is_file()
    assert len(fit.movie) == 16 and fit.movie.hours is not None and fit.movie.field_uas > 0
    assert "12 steps" in repr(fit) and "16 x 16" in repr(fit.volume)


def test_xarray(tmp_path):
    pytest.importorskip("xarray")
    np.savez(tmp_path / "v.npz", emission=np.ones((2, 3, 4), "f4"), low=[-1.0] * 3, high=[1.0] * 3, axis=[0.0, 0, 1])
    from kerrlight.fit import Volume

    array = Volume(tmp_path / "v.npz").to_xarray()
    assert dict(array.sizes) == {"x": 2, "y": 3, "z": 4} and array.x.attrs["units"] == "M"


def test_a_view_holds_a_box_beside_the_hole(tmp_path):
    np.savez(tmp_path / "v.npz", emission=np.ones((4, 4, 4), "f4"), low=[2.0, -1.0, -1.0], high=[6.0, 1.0, 1.0])
    volume = kerrlight.Volume(tmp_path / "v.npz")
    light = volume.view(-90.0, 0.0, pixels=24).sum() * (12.0 / 24) ** 2
    assert light == pytest.approx(4.0 * 2.0 * 2.0, rel=0.1)
    np.testing.assert_array_equal(volume.view(), volume.view(width=12.0))


def stop_at(step, how):
    def stop(now):
        if now.step == step:
            if how == "callback":
                raise StopIteration("enough")
            signal.raise_signal(signal.SIGINT)

    return stop


@pytest.mark.parametrize("how", ["callback", "signal"])
def test_exact_stopped_after_its_step_and_resumed_by_the_program(tmp_path, how):
    whole = Fit(folder=tmp_path / "whole", set=QUICK).run(progress=False)
    fit = Fit(folder=tmp_path / "parts", set=QUICK)
    with pytest.raises(StopIteration if how == "callback" else KeyboardInterrupt):
        fit.run(stop_at(4, how), progress=False)
    assert fit.log[-1].step == 4 and (fit.folder / "checkpoint.safetensors").is_file()
    with pytest.raises(FileNotFoundError, match="run\\(\\) it to its end"):
        fit.results
    assert program("fit", "--resume", fit.folder).stdout.startswith(whole.verdict)
    same_files(fit.folder, whole.folder)
    assert [step.loss for step in fit.log] == [step.loss for step in whole.log]


def test_exact_a_fit_of_the_program_is_resumed_here(tmp_path):
    changes = [word for key, value in QUICK.items() for word in ("--set", f"{key}={value}")]
    command = [sys.executable, "-m", "kerrlight", "fit", "-o", str(tmp_path / "parts"), *changes]
    child = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    while child.poll() is None and not (tmp_path / "parts" / "checkpoint.safetensors").is_file():
        time.sleep(0.002)
    child.send_signal(signal.SIGINT)
    child.wait(60)
    fit = Fit.open(tmp_path / "parts").run(progress=False)
    same_files(fit.folder, Fit(folder=tmp_path / "whole", set=QUICK).run(progress=False).folder)


@pytest.mark.parametrize("after", [0.05, 0.5, 2.0])
def test_exact_ctrl_c_stops_within_a_second(tmp_path, after):
    fit = Fit(folder=tmp_path / "run", set={**QUICK, "training.steps": 100_000, "screen.pixels": 32})
    pressed = []

    def press():
        pressed.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(after, press)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        fit.run(progress=False)
    assert time.monotonic() - pressed[0] < 1.0


def test_exact_two_at_once_and_nothing_on_standard_error(tmp_path, capfd):
    alone = Fit(folder=tmp_path / "alone", set=QUICK).run(progress=False)
    fits = [Fit(folder=tmp_path / name, set=QUICK) for name in ("a", "b")]
    threads = [threading.Thread(target=fit.run, kwargs={"progress": False, "threads": 1}) for fit in fits]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for fit in fits:
        same_files(fit.folder, alone.folder)
    assert capfd.readouterr() == ("", "")


def test_one_folder_is_one_fits(tmp_path, caplog):
    fit = Fit(folder=tmp_path / "run", set=QUICK)
    refused = []

    def again(step):
        try:
            Fit.open(fit.folder).run(progress=False)
        except ValueError as error:
            refused.append(str(error))

    with caplog.at_level("INFO", "kerrlight"):
        fit.run(again, progress=False)
    assert len(refused) == 6 and "in use: another kerrlight fits in it" in refused[0]
    assert any("parameters" in record.message for record in caplog.records)


def test_dictionaries_and_texts(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = Fit(set=QUICK).settings
    fit = Fit(text)
    assert fit.settings == text and fit.folder.name == "kerrlight-fit"
    fit.folder.mkdir()
    assert Fit(text).folder.name == "kerrlight-fit-2"
    fit.run(progress=False)
    assert fit.results["steps"] == 12 and not list(tmp_path.glob(".kerrlight-*"))


def test_refusals(tmp_path):
    for call, words in [
        (lambda: Fit("title = 'x'\n"), "missing field"),
        (lambda: Fit(set={"hole.spin": 2.0}), "spin"),
        (lambda: Fit(set={"no.such": 1}), "no"),
        (lambda: Fit({"title": "x"}), "missing field"),
    ]:
        with pytest.raises(ValueError) as refused:
            call()
        assert words in str(refused.value), refused.value
        assert ".kerrlight-" not in str(refused.value)
    with pytest.raises(FileNotFoundError):
        Fit(tmp_path / "none.toml")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").touch()
    with pytest.raises(ValueError, match="not empty|empty folder"):
        Fit(folder=tmp_path / "full", set=QUICK).run(progress=False)
    with pytest.raises((ValueError, FitError), match="memory|16"):
        Fit(folder=tmp_path / "small", set=QUICK).run(progress=False, memory="1MB")


def test_a_folder_keeps_its_settings(tmp_path):
    fit = Fit(folder=tmp_path / "run", set=QUICK).run(progress=False)
    assert Fit(folder=tmp_path / "run", set=QUICK).run(progress=False).results == fit.results
    with pytest.raises(ValueError, match="holds a fit with other settings"):
        Fit(folder=tmp_path / "run", set={**QUICK, "hole.spin": 0.9}).run(progress=False)
    with pytest.raises(TypeError, match="callback"):
        fit.run(3)
    unfinished = Fit(folder=tmp_path / "none", set=QUICK)
    for read in (lambda: unfinished.volume, lambda: unfinished.movie, lambda: unfinished.posterior(2)):
        with pytest.raises(FileNotFoundError, match="run\\(\\) it to its end"):
            read()


def test_bar(tmp_path):
    pytest.importorskip("tqdm")
    assert Fit(folder=tmp_path / "run", set={**QUICK, "training.steps": 4}).run().results["steps"] == 4


IMAGE = """title = "an image"
seed = 1
[image]
pixels = 8
field_uas = 100.0
flux_jy = 1.0
flux_sigma_jy = 0.1
starts = [{ gaussian = { fwhm_uas = 40.0 } }]
iterations = 40
[data.visibilities]
path = "data.uvfits"
average_s = 60.0
systematic = 0.0
[[loss]]
data = "visibilities"
weight = 1.0
"""


def measured(path=None):
    """A ring of 44 µas, brighter in the south, or a Gaussian."""
    x = np.arange(-16, 16) + 0.5
    r, angle = 3.125 * np.hypot(x, x[:, None]), np.arctan2(-x, -x[:, None])
    image = np.exp(-((r - 22.0) ** 2) / 72) * (1 - 0.5 * np.cos(angle)) if path is None else np.exp(-(r**2) / 200)
    observation = kerrlight.observe(
        image / image.sum(), 100.0, "EHT2017", source="m87", mjd=57850, utc=(0.0, 6.0), scans=4, integration=60, seed=1
    )
    if path is not None:
        observation.write(path)
    return observation


def test_exact_images_and_relative_paths(tmp_path, monkeypatch):
    (tmp_path / "data").mkdir()
    measured(tmp_path / "data" / "data.uvfits")
    (tmp_path / "data" / "image.toml").write_text(IMAGE)
    monkeypatch.chdir(tmp_path)
    fit = Fit("data/image.toml", folder=tmp_path / "run").run(progress=False)
    assert fit.image.recovered.shape == (1, 8, 8) and "model" in fit.verdict
    assert fit.ring is None and fit.polarization is None and fit.beta2 is None and fit.psnr_db is None
    # From another folder, as one that was stopped.
    (fit.folder / "results.json").unlink()
    monkeypatch.chdir(tmp_path / "data")
    again = Fit.open(tmp_path / "run").run(progress=False)
    np.testing.assert_array_equal(again.image.recovered, fit.image.recovered)
    # The same words in another folder name other data.
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "image.toml").write_text(IMAGE)
    with pytest.raises(ValueError, match="holds a fit with other settings"):
        Fit("../other/image.toml", folder=tmp_path / "run").run(progress=False)
    same = Fit("../data/image.toml", folder=tmp_path / "run").run(progress=False)
    np.testing.assert_array_equal(same.image.recovered, fit.image.recovered)
    with pytest.raises(ValueError, match="data.uvfits is no text of settings.*--init"):
        Fit("data.uvfits")
    with pytest.raises(ValueError, match="pixels"):
        Fit(IMAGE.replace("pixels = 8", "pixels = 0"))


RING = {
    "image": {"pixels": 24, "draws": 3, "iterations": 200, "flux_jy": 1.0},
    "ring": {"least_radius_uas": 5.0, "most_radius_uas": 45.0},
    "image.starts": [{"ring": {"diameter_uas": 40.0, "width_uas": 20.0}}],
}


def test_exact_an_observation_gives_its_ring(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    fit = Fit(IMAGE, "run", data=measured(), set=RING).run(progress=False)
    assert abs(fit.ring.diameter_uas.value - 44.0) < 2.0 and 0 < fit.ring.diameter_uas.error < 2.0, fit.ring
    assert abs(abs(fit.ring.position_angle_deg.value) - 180.0) < 15.0, fit.ring
    assert str(fit.ring.diameter_uas) == f"{float(fit.ring.diameter_uas):.4g} ± {fit.ring.diameter_uas.error:.2g}"
    assert fit.ring_sentence.startswith("The image has a ring of ")
    # What it has read lies in its folder: the program makes the same.
    (fit.folder / "results.json").unlink()
    before = (fit.folder / "image.npz").read_bytes()
    monkeypatch.chdir("/")
    program("fit", "--resume", tmp_path / "run")
    assert (tmp_path / "run" / "image.npz").read_bytes() == before


def test_exact_an_observation_alone_is_guessed_as_its_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    observation = measured()
    observation.write("data.uvfits")
    fit = Fit(data=observation, folder="run", set={"image.pixels": 8})
    of_file = Fit(data="data.uvfits", set={"image.pixels": 8, "data.visibilities.path": "run/data.uvfits"})
    assert fit.settings == of_file.settings
    assert not (tmp_path / "run").exists() and any("M87" in said for said in fit.guessed), fit.guessed
    assert Fit.init("my_fit.toml", "data.uvfits").read_text().startswith("# Settings of a fit.")
    with pytest.raises(ValueError, match="my_fit.toml exists"):
        Fit.init("my_fit.toml", "data.uvfits")
    # Nothing is left of a fit that does not begin, and nothing is written over.
    with pytest.raises(ValueError, match="memory"):
        fit.run(progress=False, memory="1MB")
    assert not (tmp_path / "run").exists()
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "data.uvfits").write_text("mine")
    with pytest.raises(ValueError, match="not an empty folder"):
        fit.run(progress=False)
    assert (tmp_path / "run" / "data.uvfits").read_text() == "mine"


def test_exact_images_in_an_array(tmp_path):
    simulated = Fit(folder=tmp_path / "truth", set=QUICK).run(progress=False)
    movie, times = simulated.movie.recovered, simulated.movie.time
    with pytest.raises(ValueError) as refused:
        Fit(data=movie, times=times)
    for words in ('set={"hole.spin": 0.5}', "observer.inclination_deg", "region.r_max"):
        assert words in str(refused.value), refused.value
    assert "data.movie.from" not in str(refused.value)
    given = {
        "hole": kerrlight.Hole.sgr_a_star(0.2),
        "observer.inclination_deg": 60.0,
        "screen.width": 24.0,
        "region": {"r_min": 3.0, "r_max": 10.0},
        "motion": {"velocity": {"keplerian": {"drag": 0.2}}, "axis": [0.0, 0.0, 1.0]},
        "loss.0.sigma": 1e-3,
        "training": {"steps": 4, "log_every": 2, "start": "drawn"},
        "output.nodes": 12,
    }
    fit = Fit(folder=tmp_path / "run", data=movie, times=times, set=given).run(progress=False)
    np.testing.assert_allclose(fit.movie.data, movie, rtol=1e-6)
    np.testing.assert_allclose(fit.movie.time, times, atol=1e-6 * np.ptp(times))
    assert Fit.open(fit.folder).run(progress=False).psnr_db is None
    with pytest.raises(ValueError, match="holds a fit with other settings"):
        Fit(folder=tmp_path / "run", data=2 * movie, times=times, set=given).run(progress=False)
    for wrong, words in [
        ({"data": movie, "times": times**2}, "equal steps"),
        ({"data": movie[0, 0]}, "shape"),
        ({"data": np.full((2, 3, 3), np.nan)}, "nan"),
        ({"times": times}, "times go with images"),
        ({"model": "image"}, "model = 'image' goes with data"),
    ]:
        with pytest.raises(ValueError, match=words):
            Fit(**wrong)


def test_known_holes():
    assert kerrlight.Hole.sgr_a_star(0.5) == kerrlight.Hole(spin=0.5, mass_msun=4.154e6, distance_kpc=8.178)
    assert kerrlight.Hole.m87_star(0.9) == kerrlight.Hole(spin=0.9, mass_msun=6.5e9, distance_kpc=16800.0)
    assert "mass_msun = 6500000000.0" in Fit(set={"hole": kerrlight.Hole.m87_star(0.9)}).settings


def test_exact_an_observation_without_positions_is_a_table(tmp_path):
    names = [["AA", "LM"], ["AA", "PV"], ["LM", "PV"]]
    uv = [[1e9, 2e9], [3e9, -1e9], [2e9, -3e9]]
    observation = kerrlight.Observation.of_stokes_i([4.0] * 3, names, uv, [1 + 1j, 0.5, -0.2j], 0.01, source="M87")
    fit = Fit(folder=tmp_path / "run", data=observation, set={"image.pixels": 8})
    assert str(tmp_path / "run" / "data.csv") in fit.settings
