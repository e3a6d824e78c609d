"""Scenes as objects: the documented keys, and the pictures of the dictionaries that they stand for."""

import dataclasses
import pathlib
import re

import numpy as np
import pytest

from kerrlight import Keplerian, PowerLaw, render, scene

PAGE = pathlib.Path(__file__).parents[2] / "docs" / "reference" / "scene-file.md"
CLASSES = {
    "hole": scene.Hole,
    "observer": scene.Observer,
    "camera": scene.Camera,
    "screen": scene.Screen,
    "effects": scene.Effects,
    "tracer": scene.Tracer,
    "magnetic_field": scene.MagneticField,
    "gas": scene.Gas,
    "disc": scene.Disc,
    "spot": scene.Spot,
    "volume": scene.Volume,
    "mesh": scene.Mesh,
    "sky": scene.Sky,
}


INNER = {
    "plunging": scene.Plunging,
    "checker": scene.Checker,
    "stars": scene.Stars,
    "image": scene.SkyImage,
    "catalogue": scene.Catalogue,
}


def keys(of, before=""):
    """Dotted keys of a class, with those of the tables inside."""
    for part in dataclasses.fields(of):
        if part.name in INNER:
            yield from keys(INNER[part.name], f"{before}{part.name}.")
        else:
            yield before + part.name


def documented():
    """Keys of each table of the page."""
    found, table = {}, None
    for line in PAGE.read_text(encoding="utf-8").splitlines():
        if heading := re.match(r"## \[+([a-z_]+)\]+$", line):
            table = heading[1]
        elif line.startswith("## "):
            table = None
        elif table and (name := re.match(r"\| `([^`]+)` \|", line)):
            found.setdefault(table, set()).add(name[1])
    return found


@pytest.mark.parametrize("table", CLASSES)
def test_every_documented_key_is_a_field(table):
    names = documented()[table]
    # Keys of tables that have no class of their own are not fields.
    expected = {name if name.split(".")[0] in INNER else name.split(".")[0] for name in names} - set(INNER)
    assert set(keys(CLASSES[table])) == expected


def test_every_table_is_there():
    assert {part.name for part in dataclasses.fields(scene.Scene)} == set(CLASSES) == set(documented())


def disc():
    return scene.Scene(
        hole=scene.Hole(spin=0.9),
        observer=scene.Observer(inclination_deg=60.0),
        screen=scene.Screen(field_of_view_m=30.0, width=12),
        tracer=scene.Tracer(integrator="elliptic", tolerance=1e-6),
        disc=scene.Disc(outer_edge=12.0, peak_intensity=1.0, opaque=True),
        spot=[scene.Spot(radius=8.0, phase_deg=0.0, sigma=1.0, peak_emissivity=1.0)],
    )


def test_the_same_picture():
    objects, tables = disc(), disc().to_dict()
    assert tables["spot"] == [{"radius": 8.0, "phase_deg": 0.0, "sigma": 1.0, "peak_emissivity": 1.0}]
    assert "camera" not in tables and "height" not in tables["screen"]
    np.testing.assert_array_equal(render(objects)["intensity"], render(tables)["intensity"])
    np.testing.assert_array_equal(render(objects.to_toml())["intensity"], render(tables)["intensity"])
    changed = dataclasses.replace(objects, spot=[])
    assert render(changed).summary["flux"] < render(objects).summary["flux"]


def test_laws_and_refusals():
    volume = scene.Volume(path="v.npz", factor=1.0, rotation=PowerLaw(6.0, 0.1))
    assert scene.plain(volume)["rotation"] == {"power-law": {"radius": 6.0, "rate": 0.1, "exponent": 1.5}}
    assert scene.plain(Keplerian()) == {"keplerian": {}} and scene.plain(Keplerian(0.5)) == {"keplerian": {"drag": 0.5}}
    with pytest.raises(TypeError):
        scene.Disc(outer_edge=3.0)
    numbers = disc()
    numbers.screen.width, numbers.disc.opaque = np.int64(12), np.True_
    numbers.spot[0].axis = np.array([0.0, 0.0, 1.0])
    numbers.observer.radius = np.inf
    np.testing.assert_array_equal(render(numbers)["intensity"], render(disc())["intensity"])
    numbers.hole.spin = np.nan
    with pytest.raises(ValueError, match="hole.spin = nan"):
        render(numbers)
    wrong = disc()
    wrong.hole.spin = 2.0
    with pytest.raises(ValueError, match=".hole.spin. = 2 is not allowed"):
        render(wrong)
