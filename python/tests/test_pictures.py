"""Pictures: the program's pixels, every way to give a scene, films, files, refusals and Ctrl-C."""

import json
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import kerrlight
from kerrlight import render

SCENE = {
    "hole": {"spin": 0.5, "mass_msun": 4.154e6, "distance_kpc": 8.178},
    "observer": {"inclination_deg": 60.0},
    "screen": {"field_of_view_m": 30.0, "width": 24, "height": 16},
    "tracer": {"integrator": "elliptic", "tolerance": 1e-6},
    "disc": {"outer_edge": 12.0, "peak_intensity": 1.0, "opaque": True},
    "spot": [{"radius": 8.0, "phase_deg": 0, "sigma": 0.7, "peak_emissivity": np.float64(0.7)}],
}
TEXT = """
hole = { spin = 0.5, mass_msun = 4.154e6, distance_kpc = 8.178 }
observer = { inclination_deg = 60.0 }
screen = { field_of_view_m = 30.0, width = 24, height = 16 }
tracer = { integrator = "elliptic", tolerance = 1e-6 }
disc = { outer_edge = 12.0, peak_intensity = 1.0, opaque = true }
[[spot]]
radius = 8.0
phase_deg = 0.0
sigma = 0.7
peak_emissivity = 0.7
"""


def test_every_way_to_give_a_scene(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(TEXT)
    pictures = [render(SCENE), render(TEXT), render(path), render(str(path))]
    assert pictures[0].shape == (16, 24)
    for picture in pictures[1:]:
        for name in pictures[0]:
            np.testing.assert_array_equal(picture[name], pictures[0][name])
    other = render(SCENE, set={"hole.spin": 0.9, "screen.channels": ["intensity"]})
    assert list(other) == ["intensity"]
    assert (other["intensity"] != pictures[0]["intensity"]).any()
    small = render(set={"screen.width": 8})
    assert small.shape == (8, 8) and small["intensity"].max() > 0


def test_the_programs_file(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(TEXT)
    command = [sys.executable, "-m", "kerrlight", "render", str(path), "-o", str(tmp_path / "theirs.exr")]
    subprocess.run([*command, "--preview", str(tmp_path / "theirs.png")], check=True, capture_output=True)
    picture = render(path)
    picture.to_exr(tmp_path / "ours.exr")
    picture.to_png(tmp_path / "ours.png")
    for ending in ("exr", "png"):
        ours, theirs = (tmp_path / f"{who}.{ending}" for who in ("ours", "theirs"))
        assert ours.read_bytes() == theirs.read_bytes(), ending


def test_what_a_picture_knows():
    picture = render(SCENE)
    assert picture.summary["rays"] >= 16 * 24 and picture.summary["flux"] > 0
    assert "spin = 0.5" in picture.attributes["scene_resolved"]
    assert picture.extent == (-15.0, 15.0, -10.0, 10.0)
    assert "data:image/png;base64," in picture._repr_html_()
    assert "<img" not in render(SCENE, set={"screen.channels": ["radius"]})._repr_html_()
    with pytest.raises(KeyError, match="no_such: the picture has"):
        picture["no_such"]
    assert "24 x 16" in repr(picture) and "intensity" in picture


def test_plot():
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    axes = render(SCENE).plot(vmin=0.0)
    assert axes.get_xlabel() == "α (M)" and len(axes.images) == 1


def test_movies():
    film = kerrlight.movie(SCENE, [0.0, 20.0, 40.0])
    assert film["intensity"].shape == (3, 16, 24) and len(film) == 3
    for frame, moment in zip(film.frames, film.times):
        alone = render(SCENE, set={"observer.time": float(moment)})
        np.testing.assert_array_equal(frame["intensity"], alone["intensity"])
    assert (film.flux > 0).all() and np.ptp(film.flux) > 0


def test_refusals(tmp_path):
    for call, words in [
        (lambda: render({**SCENE, "hole": {"spin": 1.5}}), "hole.spin"),
        (lambda: render({**SCENE, "disk": {}}), "unknown field `disk`"),
        (lambda: render(TEXT + "nonsense"), "line"),
        (lambda: render(SCENE, set={"hole.spin": 2}), "spin"),
        (lambda: render({**SCENE, "sky": {"image": {"path": "none.png", "brightness": 1.0}}}), "none.png"),
        (lambda: kerrlight.movie(SCENE, []), "times is empty"),
    ]:
        with pytest.raises(ValueError) as refused:
            call()
        assert words in str(refused.value), refused.value
    with pytest.raises(FileNotFoundError):
        render(tmp_path / "none.toml")
    with pytest.raises(TypeError, match="no setting"):
        render({**SCENE, "hole": {"spin": object()}})


def test_ctrl_c_stops_a_picture():
    def interrupt():
        time.sleep(0.5)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=interrupt).start()
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        render(set={"screen.width": 3072, "screen.samples_per_pixel": 64, "screen.channels": ["intensity"]})
    assert time.monotonic() - begun < 20


def test_settings_survive_json():
    from kerrlight._core import toml_of_json

    text = toml_of_json(json.dumps({"a": 1, "b": [1.5, 2], "c": {"d": True, "e": "x\ny"}}))
    assert "a = 1" in text and "[c]" in text


def test_keys_with_dots():
    from kerrlight.pictures import overrides_of, text_of

    text, _ = text_of({"a.b": 1, "a": {"c": 2, "d.e": [3.5], "no": None}}, None)
    assert tomllib_of(text) == {"a": {"b": 1, "c": 2, "d": {"e": [3.5]}}}
    assert overrides_of({"a": {"b": 1, "c": {"d": "x"}}, "e.f": None}) == ["a.b=1", 'a.c.d="x"', "e.f="]
    with pytest.raises(ValueError, match="a is a value"):
        text_of({"a": 1, "a.b": 2}, None)


def tomllib_of(text):
    tomllib = pytest.importorskip("tomllib")
    return tomllib.loads(text)


def test_rendered_again(tmp_path):
    scene = {
        "hole": {"spin": 0.5},
        "observer": {"inclination_deg": 60.0, "radius": float("inf")},
        "screen": {"field_of_view_m": 30.0, "width": 8},
        "tracer": {"integrator": "elliptic", "tolerance": 1e-6},
        "disc": {"outer_edge": 12.0, "peak_intensity": 1.0, "opaque": True},
    }
    picture = kerrlight.render(scene)
    picture.to_exr(tmp_path / "disc.exr")
    again = kerrlight.render(tmp_path / "disc.exr")
    np.testing.assert_array_equal(again["intensity"], picture["intensity"])
    with pytest.raises(ValueError, match="ends with .exr"):
        picture.to_exr(tmp_path / "disc.png")
    for wrong in (3, [1, 2]):
        with pytest.raises(TypeError, match="a dictionary, TOML text"):
            kerrlight.render(wrong)
    with pytest.raises(TypeError, match="set ="):
        kerrlight.render(scene, set=[("hole.spin", 0.5)])
    with pytest.raises(ValueError, match="times = nan"):
        kerrlight.movie(scene, times=[0.0, np.nan])
