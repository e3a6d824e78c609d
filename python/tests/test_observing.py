"""Simulated observations: the program's visibilities, noise, gains and refusals."""

import subprocess
import sys

import numpy as np
import pytest

import kerrlight
from kerrlight import Observation, observe

RNG = np.random.default_rng(5)
MOVIE = RNG.random((4, 12, 12)) / 144
PLAN = {"source": "sgra", "mjd": 57850, "utc": (4.0, 14.0), "scans": 4}


def test_the_programs_visibilities(tmp_path):
    np.save(tmp_path / "movie.npy", MOVIE)
    words = ["observe", str(tmp_path / "movie.npy"), "--fov-uas", "120", "--array", "EHT2017", "--source", "sgra"]
    words += ["--mjd", "57850", "--utc", "4-14", "--frames", "4", "--tint", "60", "--frame-times", "scans"]
    words += ["--noise", "thermal", "--seed", "3", "--gain-scan", "0.1", "--transform", "direct"]
    command = [sys.executable, "-m", "kerrlight", *words, "-o", str(tmp_path / "data.csv"), "--comments"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    theirs = Observation.read(tmp_path / "data.csv")
    ours = observe(MOVIE, 120.0, "EHT2017", **PLAN, seed=3, gain_scan=0.1)
    np.testing.assert_array_equal(ours.vis, theirs.vis)
    np.testing.assert_array_equal(ours.uv, theirs.uv)
    np.testing.assert_array_equal(ours.sigma, theirs.sigma)


def test_without_noise_it_is_the_transform():
    obs = observe(MOVIE[0], 120.0, "ngEHT", **PLAN, noise=False)
    np.testing.assert_allclose(obs.fourier((12, 12), 120.0).apply(MOVIE[0]), obs.vis, atol=1e-13)
    noisy = observe(MOVIE[0], 120.0, kerrlight.stations("ngEHT"), **PLAN, seed=1)
    pull = (noisy.vis - obs.vis) / noisy.sigma
    assert 0.9 < pull.real.std() < 1.1 and 0.9 < pull.imag.std() < 1.1
    again = observe(MOVIE[0], 120.0, "ngEHT", **PLAN, seed=1)
    np.testing.assert_array_equal(again.vis, noisy.vis)


def test_all_stokes_parameters():
    q, u, v = (0.2 * RNG.normal(size=MOVIE.shape[1:]) / 144 for _ in range(3))
    plan = {**PLAN, "noise": False}
    i = observe(MOVIE[0], 120.0, **plan)
    assert np.isnan(i.sigmas[:, 2:]).all() and not np.isnan(i.sigmas[:, :2]).any()
    every = observe(MOVIE[0], 120.0, q=q, u=u, v=v, **plan)
    of = [i.fourier((12, 12), 120.0).apply(plane) for plane in (MOVIE[0], q, u, v)]
    right = [of[0] + of[3], of[0] - of[3], of[1] + 1j * of[2], of[1] - 1j * of[2]]
    np.testing.assert_allclose(every.products, np.transpose(right), atol=1e-13)
    assert not np.isnan(every.sigmas).any()
    for given, words in [({"q": q}, "q and u"), ({"q": q, "u": u[1:]}, "u has the shape")]:
        with pytest.raises(ValueError, match=words):
            observe(MOVIE[0], 120.0, **given, **plan)


def test_gains_leave_closures():
    plain = observe(MOVIE[0], 120.0, **PLAN, noise=False)
    spoiled = observe(MOVIE[0], 120.0, **PLAN, noise=False, random_phases=True, gain_scan=0.2, seed=2)
    assert not np.allclose(plain.vis, spoiled.vis)
    # The choice of quantities depends on their errors, and these on the gains: compare the sums themselves.
    chosen = plain.closure_phases()
    for obs in (plain, spoiled):
        total = (chosen.signs * np.angle(obs.vis)[chosen.rows]).sum(axis=1)
        np.testing.assert_allclose(np.exp(1j * total), np.exp(1j * chosen.value), atol=1e-9)


def test_refusals(tmp_path):
    for call, words in [
        (lambda: observe(MOVIE, 120.0, **PLAN), "give seed"),
        (lambda: observe(MOVIE[0, 0], 120.0, **PLAN, noise=False), "images have the shape"),
        (lambda: observe(MOVIE[:3], 120.0, **PLAN, noise=False), "number of images = 3"),
        (lambda: observe(MOVIE, 120.0, **PLAN, noise=False, frame_hours=[[4.0, 14.0]]), "frame_hours has the shape"),
        (lambda: observe(MOVIE, 120.0, **{**PLAN, "utc": (4.0, 9.0, 14.0)}, noise=False), "utc has the shape"),
        (lambda: observe(MOVIE, 120.0, "VLA", **PLAN, noise=False), "neither EHT2017 nor ngEHT"),
        (lambda: observe(MOVIE, 120.0, **{**PLAN, "source": "venus"}, noise=False), "expected sgra"),
        (lambda: observe(MOVIE, 120.0, **{**PLAN, "utc": None}, noise=False), "utc or gmst"),
        (lambda: observe(MOVIE, 120.0, **PLAN, gain_scan=9.0, seed=1), "gain_scan = 9"),
        (lambda: observe(MOVIE, 120.0, **{**PLAN, "scans": 0}, noise=False), "number of scans = 0"),
    ]:
        with pytest.raises(ValueError) as refused:
            call()
        assert words in str(refused.value), refused.value
