"""Forks, signals, and copies that go to other processes."""

import copy
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from kerrlight import ForwardModel, Fourier, Infall, Kerr, Observation, render, screen

OBSERVER = Kerr(0.9).observer(inclination_deg=60, radius=1000)
ALPHA = np.linspace(-8, 8, 3000)
SMALL = {"screen.width": 8, "screen.height": 8}


def work(beta):
    rays = OBSERVER.trace(ALPHA, beta, crossings=1)
    return float(np.nansum(rays.crossings.r)), float(render(set=SMALL)["intensity"].sum())


@pytest.mark.parametrize("how", ["fork", "spawn"])
def test_exact_other_processes_get_the_same_bits(how):
    if how not in multiprocessing.get_all_start_methods():
        pytest.skip(f"no {how}")
    expected = [work(beta) for beta in (0.5, 1.5)]  # the pool's threads run before the fork
    with multiprocessing.get_context(how).Pool(2) as pool:
        assert pool.map_async(work, [0.5, 1.5]).get(60) == expected


@pytest.mark.parametrize("kind", ["rays", "closed form", "derivatives", "model", "fall"])
def test_exact_ctrl_c_stops_long_calls_within_a_second(kind):
    alpha, beta = screen(1200, 20.0)
    region = {"r_min": 2.0, "r_max": 20.0, "order": 16, "split": 8}
    calls = {
        "rays": lambda: OBSERVER.trace(alpha, beta, samples=100),
        "closed form": lambda: OBSERVER.trace(alpha, beta, samples=200, integrator="elliptic"),
        "derivatives": lambda: OBSERVER.trace(alpha, beta, samples=20, derivatives=True),
        "model": lambda: ForwardModel(OBSERVER, alpha, beta, slow_light=True, **region),
        "fall": lambda: ForwardModel(OBSERVER, alpha, beta, velocity=Infall(0.9, 0.5, 0.5), **region),
    }
    pressed = []

    def press():
        pressed.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(0.2, press)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        calls[kind]()
    assert time.monotonic() - pressed[0] < 1.0
    assert OBSERVER.trace(8.0, 0.0).escaped  # and later calls go on


@pytest.mark.parametrize("how", [copy.copy, copy.deepcopy, lambda of: pickle.loads(pickle.dumps(of))])
def test_exact_copies_give_the_same_results(how):
    drawn = np.random.default_rng(1)
    model = ForwardModel(OBSERVER, *screen(8, 20.0), r_min=3.0, r_max=8.0, times=[0.0, 10.0])
    fourier = Fourier((8, 8), 100.0, [[1e9, 2e9], [3e9, -1e9]])
    for linear in (model, model.at([1]), model.voxels(6, 8.0), fourier):
        values = drawn.uniform(size=linear.input_shape)
        np.testing.assert_array_equal(how(linear).apply(values), linear.apply(values))
    names = [["AA", "LM"], ["AA", "PV"], ["LM", "PV"]]
    uv = [[1e9, 2e9], [3e9, -1e9], [2e9, -3e9]]
    obs = Observation.of_stokes_i([4.0] * 3, names, uv, [1 + 1j, 0.5, -0.2j], 0.01, mjd=57850)
    copied = how(obs)
    assert (copied.mjd, copied.array) == (obs.mjd, obs.array)
    np.testing.assert_array_equal(copied.products, obs.products)
    np.testing.assert_array_equal(copied.closure_phases().value, obs.closure_phases().value)
    picture = render(set=SMALL)
    copied = how(picture)
    assert list(copied) == list(picture) and copied.summary == picture.summary
    np.testing.assert_array_equal(copied["intensity"], picture["intensity"])
    assert copied._core.exr() == picture._core.exr() and copied._core.png() == picture._core.png()


@pytest.mark.skipif(sys.platform != "linux", reason="limits of Linux")
def test_regress_no_more_threads_is_an_error():
    code = "import kerrlight; kerrlight.Kerr(0.5).observer(inclination_deg=9).trace(list(range(99)), 1.0)"
    script = f'ulimit -v 3000000; RAYON_NUM_THREADS=1024 OPENBLAS_NUM_THREADS=1 exec "{sys.executable}" -c "{code}"'
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True)
    assert done.returncode == 1 and "ValueError: cannot start 1024 threads" in done.stderr, done.stderr
    assert "ulimit -u" in done.stderr and "panicked" not in done.stderr
