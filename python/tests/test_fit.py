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
    "observation.scans": 16,
    "training.start.linear.steps": 20,
}


def test_the_programs_results(tmp_path):
    lines = []
    fit = Fit(folder=tmp_path / "ours", set=QUICK).run(lines.append, progress=False)
    command = [sys.executable, "-m", "kerrlight", "fit", "-o", str(tmp_path / "theirs")]
    for key, value in QUICK.items():
        command += ["--set", f"{key}={value}"]
    subprocess.run(command, check=True, capture_output=True)
    theirs = Fit.open(tmp_path / "theirs")
    np.testing.assert_array_equal(fit.volume.emission, theirs.volume.emission)
    for name in ("psnr_db", "loss", "chi2_per_datum", "verdict"):
        assert fit.results[name] == theirs.results[name]
    steps = [line["step"] for line in lines if "loss" in line]
    assert steps == sorted(steps) and steps[-1] == 12
    assert lines == [line for line in fit.log if "loss" in line]
    assert all("psnr_db" in line for line in lines)
    assert fit.volume.emission.shape == (16, 16, 16) and fit.volume.x[0] == fit.volume.low[0]
    assert fit.truth.emission.max() > 0 and "model" in fit.verdict
    assert fit.movie["recovered"].shape == fit.movie["data"].shape
    assert "<iframe" in fit.report()._repr_html_() and fit.report().path.is_file()
    assert "12 steps" in repr(fit) and "16 x 16" in repr(fit.volume)


def test_xarray(tmp_path):
    pytest.importorskip("xarray")
    np.savez(tmp_path / "v.npz", emission=np.ones((2, 3, 4), "f4"), low=[-1.0] * 3, high=[1.0] * 3, axis=[0.0, 0, 1])
    from kerrlight.fit import Volume

    array = Volume(tmp_path / "v.npz").to_xarray()
    assert dict(array.sizes) == {"x": 2, "y": 3, "z": 4} and array.x.attrs["units"] == "M"


@pytest.mark.parametrize("how", ["callback", "signal"])
def test_stopped_and_resumed(tmp_path, how):
    whole = Fit(folder=tmp_path / "whole", set=QUICK).run(progress=False)
    fit = Fit(folder=tmp_path / "parts", set=QUICK)

    def stop(line):
        if line.get("step", 0) >= 4:
            if how == "callback":
                raise StopIteration("enough")
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(1)

    with pytest.raises((StopIteration, KeyboardInterrupt)):
        fit.run(stop, progress=False)
    if not (fit.folder / "results.json").exists():
        with pytest.raises(FileNotFoundError, match="no results yet"):
            fit.results
    again = Fit.open(fit.folder).run(progress=False)
    np.testing.assert_array_equal(again.volume.emission, whole.volume.emission)


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


def measured(path):
    x = np.arange(-8, 8) + 0.5
    image = np.exp(-(x**2 + x[:, None] ** 2) / 18)
    kerrlight.observe(
        image / image.sum(), 100.0, "EHT2017", source="m87", mjd=57850, utc=(0.0, 6.0), scans=4, integration=60, seed=1
    ).write(path)


def test_exact_images_and_relative_paths(tmp_path, monkeypatch):
    (tmp_path / "data").mkdir()
    measured(tmp_path / "data" / "data.uvfits")
    (tmp_path / "data" / "image.toml").write_text(IMAGE)
    monkeypatch.chdir(tmp_path)
    fit = Fit("data/image.toml", folder=tmp_path / "run").run(progress=False)
    assert fit.image["recovered"].shape == (1, 8, 8) and "model" in fit.verdict
    # From another folder, as one that was stopped.
    (fit.folder / "results.json").unlink()
    monkeypatch.chdir(tmp_path / "data")
    again = Fit.open(tmp_path / "run").run(progress=False)
    np.testing.assert_array_equal(again.image["recovered"], fit.image["recovered"])
    with pytest.raises(ValueError, match="data.uvfits is no text of settings.*--init"):
        Fit("data.uvfits")
    with pytest.raises(ValueError, match="pixels"):
        Fit(IMAGE.replace("pixels = 8", "pixels = 0"))
