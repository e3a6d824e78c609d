"""Ten thousand calls of each function leave memory where it was."""

import gc
import os
import pathlib

import numpy as np
import pytest

from kerrlight import Fourier, ForwardModel, Kerr, Observation, render, screen
from kerrlight import _core
from kerrlight.compat.kgeo import raytrace_ana
from kerrlight.pictures import overrides_of

from laws import LAW

STATM = pathlib.Path("/proc/self/statm")
pytestmark = pytest.mark.skipif(not STATM.exists(), reason="no /proc")

OBSERVER = Kerr(0.9).observer(inclination_deg=60)
MODEL = ForwardModel(OBSERVER, *screen(6, 20.0), r_min=3.0, r_max=8.0, times=[0.0, 5.0])
POLARISED = ForwardModel(OBSERVER, *screen(6, 20.0), r_min=3.0, r_max=8.0, polarization=LAW)
LIGHT = np.ones(POLARISED.input_shape)
CORNERS = ([4, 4, 4], [-1.0] * 3, [1.0] * 3)
BOX = np.ones(64, np.float32)
VOXELS = MODEL.voxels(6, 8.0)
EMISSION, MOVIE, VOLUME = (np.ones(of) for of in (MODEL.input_shape, MODEL.output_shape, (6, 6, 6)))
UV = np.array([[1e9, 2e9], [3e9, -1e9], [2e9, -3e9]])
FOURIER = Fourier((8, 8), 100.0, UV)
IMAGE, DATA = np.ones((8, 8)), np.ones(3, complex)
NAMES = np.array([["AA", "LM"], ["AA", "PV"], ["LM", "PV"]])
ROWS = ([4.0] * 3, NAMES, UV, [1 + 1j, 0.5, -0.2j], [0.01] * 3)
OBSERVATION = Observation.of_stokes_i(*ROWS)
SCENE = {
    "hole": {"spin": 0.5},
    "observer": {"inclination_deg": 60.0},
    "screen": {"field_of_view_m": 30.0, "width": 4},
    "tracer": {"integrator": "elliptic", "tolerance": 1e-6},
    "disc": {"outer_edge": 12.0, "peak_intensity": 1.0, "opaque": True},
}


def refused():
    with pytest.raises(ValueError):
        Kerr(2.0)


CALLS = {
    "trace": lambda: OBSERVER.trace([1.0, 8.0], 1.0, samples=8, errors=True, momentum=True, weights=True),
    "derivatives": lambda: OBSERVER.trace([8.0], 1.0, samples=2, derivatives=True),
    "critical curve": lambda: OBSERVER.critical_curve(4),
    "band": lambda: OBSERVER.band(1, [0.1]),
    "redshift": lambda: OBSERVER.hole.keplerian_redshift([9.0, 10.0], 0.0),
    "kgeo": lambda: raytrace_ana(0.9, [0, 1000.0, 1.0, 0], [[1.0], [2.0]], 8).sig_s,
    "model": lambda: ForwardModel(OBSERVER, [4.0], [1.0], r_min=3.0, r_max=8.0),
    "coordinates": lambda: MODEL.coordinates(),
    "apply": lambda: MODEL.apply(EMISSION),
    "vjp": lambda: MODEL.vjp(MOVIE),
    "voxels": lambda: VOXELS.vjp(VOXELS.apply(VOLUME)),
    "stokes": lambda: POLARISED.vjp(POLARISED.apply(LIGHT)),
    "view": lambda: _core.view(CORNERS, BOX, (0.0, 20.0), (2.0, 0.0), 8),
    "overrides": lambda: overrides_of({"a": {"b": 1.0}, "c": None}),
    "transform": lambda: Fourier((8, 8), 100.0, UV),
    "visibilities": lambda: FOURIER.vjp(FOURIER.apply(IMAGE) + DATA),
    "observation": lambda: Observation.of_stokes_i(*ROWS).vis,
    "closures": lambda: OBSERVATION.closure_phases(),
    "encode": lambda: OBSERVATION._core.encode("csv"),
    "refused": refused,
    "render": lambda: render(SCENE)["intensity"],
}


def memory():
    gc.collect()
    return int(STATM.read_text().split()[1]) * os.sysconf("SC_PAGESIZE") // 1024


@pytest.mark.parametrize("name", CALLS)
def test_memory(name):
    call = CALLS[name]
    count = 1000 if name == "render" else 10_000
    for _ in range(count // 10):
        call()
    before = memory()
    for _ in range(count):
        call()
    grown = memory() - before
    assert grown < 1024, f"{grown} KiB more"
