"""Rays: the numbers of the program, shapes, refusals and threads."""

import csv
import io
import math
import subprocess
import sys
import threading
import warnings

import numpy as np
import pytest

import kerrlight
from kerrlight import GaussLegendre, Kerr, MinoTime, Outcome, PathLength

RAYS = [(0.9, 60.0, -6.0, 2.0), (0.0, 17.0, 3.1, -4.2), (-0.5, 90.0, 5.19, 0.01), (0.998, 163.0, 0.3, 0.2)]


def program(*words, text=""):
    command = [sys.executable, "-m", "kerrlight", *words]
    return subprocess.run(command, input=text, capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize("integrator", ["taylor-mino", "elliptic", "dop853-mino", "rk45-mino"])
def test_same_numbers_as_the_program(integrator):
    rows = "\n".join(",".join(map(str, ray)) for ray in RAYS)
    table = program(
        *("trace", "--rays", "-", "-o", "-", "--samples", "7", "--errors", "--crossings", "2"),
        *("--integrator", integrator),
        text=f"spin,inclination_deg,alpha,beta\n{rows}\n",
    )
    assert table.returncode == 0, table.stderr
    lines = list(csv.DictReader(io.StringIO(table.stdout)))
    assert len(lines) == len(RAYS)
    for line, (spin, inclination, alpha, beta) in zip(lines, RAYS):
        observer = Kerr(spin).observer(inclination_deg=inclination)
        rays = observer.trace(
            alpha, beta, crossings=2, samples=7, errors=True, integrator=integrator
        )
        assert Outcome(int(rays.outcome)).name.lower() == line["outcome"]
        assert float(rays.mino_total) == float(line["mino_total"])
        for column in ("r", "theta", "phi", "delay"):
            ours = getattr(rays.samples, column)
            theirs = [float(line[f"sample_{column}_{k + 1}"] or "nan") for k in range(7)]
            np.testing.assert_array_equal(ours, theirs)
        for name in ("r", "theta", "phi", "delay"):
            assert float(rays.error(name)) == float(line[f"error_{name}"])


def test_shapes_broadcast():
    observer = Kerr(0.5).observer(inclination_deg=30)
    rays = observer.trace(np.linspace(-8, 8, 5)[:, None], np.arange(3), crossings=2, samples=4)
    assert rays.shape == (5, 3) and rays.outcome.shape == (5, 3)
    assert rays.crossings.r.shape == (5, 3, 2) and rays.samples.theta.shape == (5, 3, 4)
    assert observer.trace(1.0, 2.0).crossings.r.shape == (3,)
    empty = observer.trace(np.zeros((0, 4)), 1.0, samples=3, derivatives=True)
    assert empty.size == 0 and empty.samples.phi.shape == (0, 4, 3)
    assert empty.samples.derivative("delay", "spin").shape == (0, 4, 3)


def test_whatever_holds_numbers():
    observer = Kerr(0.5).observer(inclination_deg=30)
    alpha = np.linspace(-8, 8, 6)
    expected = observer.trace(alpha, 1.0).crossings.r
    read_only = alpha.copy()
    read_only.flags.writeable = False
    for same in (list(alpha), read_only, np.repeat(alpha, 2)[::2], alpha[::-1][::-1]):
        np.testing.assert_array_equal(observer.trace(same, 1).crossings.r, expected)
    half = observer.trace(alpha.astype(np.float32), np.array([1], dtype=np.int8))
    np.testing.assert_allclose(half.crossings.r, expected, rtol=1e-5)


def test_filling_is_behind_the_points():
    rays = Kerr(0.9).observer(inclination_deg=60).trace([-6.0, 0.5, 30.0], [2.0, 0.5, 9.0])
    assert (rays.crossings.count == np.minimum(rays.crossing_count, 3)).all()
    there = np.arange(3) < rays.crossings.count[:, None]
    assert (np.isfinite(rays.crossings.r) == there).all()
    np.testing.assert_array_equal(rays.crossings.r[there], rays.crossings.flat("r"))


def test_captured_rays_without_crossings_have_columns():
    rays = Kerr(0.73).observer(inclination_deg=35, radius=1000).trace(1e-4, 3.0)
    assert rays.captured and np.isnan(rays.crossings.phi).all()


def test_placements():
    observer = Kerr(0.9).observer(inclination_deg=60)
    assert observer.trace(5.0, 1.0, samples=MinoTime(9)).samples.r.shape == (9,)
    inside = observer.trace(5.0, 1.0, samples=PathLength(50, 10.0), weights=True).samples
    assert inside.r.max() < 10 and np.ptp(inside.weight) < 1e-9 * inside.weight.max()
    nodes = observer.trace(8.0, 1.0, samples=GaussLegendre(6, 8.0, 12.0), momentum=True).samples
    assert nodes.r.shape == (12,) and nodes.momentum.shape == (12, 4)
    np.testing.assert_array_equal(nodes.momentum[:, 0], -1.0)


@pytest.mark.parametrize("by", ["spin", "inclination", "alpha", "beta"])
def test_derivatives_are_slopes(by):
    values = {"spin": 0.7, "inclination": 1.0, "alpha": -6.0, "beta": 2.0}

    def at(step):
        moved = {**values, by: values[by] + step}
        observer = Kerr(moved["spin"]).observer(inclination_rad=moved["inclination"])
        return observer.trace(moved["alpha"], moved["beta"], samples=5, derivatives=True)

    low, high, here = at(-1e-5), at(1e-5), at(0.0)
    for name in ("r", "theta", "phi", "delay", "mino"):
        slope = (getattr(high.samples, name) - getattr(low.samples, name)) / 2e-5
        np.testing.assert_allclose(here.samples.derivative(name, by), slope, rtol=1e-6, atol=1e-7)
    slope = (high.mino_total - low.mino_total) / 2e-5
    assert math.isclose(here.derivative("mino_total", by), slope, rel_tol=1e-6, abs_tol=1e-9)


def test_critical_curve_and_bands():
    observer = Kerr(0.94).observer(inclination_deg=60)
    curve = observer.critical_curve(12)
    again = observer.critical_curve(angles=np.arctan2(curve.beta, curve.alpha))
    np.testing.assert_allclose(again.alpha, curve.alpha, rtol=1e-12, atol=1e-12)
    inner, outer = observer.band(1, [0.3, 2.0])
    between = 0.5 * (inner + outer)
    for edge, crosses in ((inner * 0.99, False), (between, True), (outer * 1.01, False)):
        rays = observer.trace(edge[:, 0], edge[:, 1], crossings=0)
        assert ((rays.crossing_count >= 2) == crosses).all()
    assert np.isnan(observer.band(0, 0.1)[1]).all()


def test_refusals_have_the_programs_words():
    observer = Kerr(0.5).observer(inclination_deg=60)
    said = program("trace", "--rays", "-", text="spin,inclination_deg,alpha,beta\n1.5,60,1,1\n").stderr
    with pytest.raises(ValueError, match="spin = 1.5 is not allowed") as refused:
        Kerr(1.5)
    assert str(refused.value) in said
    for call, words in [
        (lambda: Kerr(0.5).observer(inclination_deg=200), "inclination = 200 is not allowed"),
        (lambda: Kerr(0.5).observer(inclination_deg=20, radius=1.0), "observer radius = 1 is not"),
        (lambda: Kerr(0.5).observer(), "inclination_deg or inclination_rad"),
        (lambda: observer.trace(np.nan, 0.0), "alpha = NaN is not allowed"),
        (lambda: observer.trace([1.0, 2.0], [1.0, 2.0, 3.0]), "do not broadcast"),
        (lambda: observer.trace(1.0, 2.0, tolerance=1.0), "tolerance = 1 is not allowed"),
        (lambda: observer.trace(1.0, 2.0, integrator="euler"), 'integrator = "euler"'),
        (lambda: observer.trace(1.0, 2.0, samples=-1), "samples = -1"),
        (lambda: observer.trace(1.0, 2.0, crossings=-1), "crossings = -1"),
        (lambda: observer.critical_curve(0), "points = 0"),
        (lambda: observer.band(-1, 0.0), "order = -1"),
    ]:
        with pytest.raises(ValueError) as refused:
            call()
        assert words in str(refused.value)
    with pytest.raises(TypeError, match="real numbers"):
        observer.trace(1j, 0.0)
    with pytest.raises(TypeError, match="real numbers"):
        observer.trace("one", 0.0)
    with pytest.raises(AttributeError, match="derivatives=True"):
        observer.trace(1.0, 0.0).crossings.derivative("r", "spin")
    with pytest.raises(AttributeError, match="errors=True"):
        observer.trace(1.0, 0.0).error("r")
    with pytest.raises(AttributeError, match="momentum was not requested"):
        observer.trace(1.0, 9.0).crossings.momentum


def test_threads_get_the_same_bits():
    observer = Kerr(0.9).observer(inclination_deg=60)
    alpha = np.linspace(-8, 8, 500)
    expected = observer.trace(alpha, 1.0, samples=20).samples.r
    found = [None] * 4

    def work(k):
        found[k] = observer.trace(alpha, 1.0, samples=20).samples.r

    threads = [threading.Thread(target=work, args=(k,)) for k in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for column in found:
        np.testing.assert_array_equal(column, expected)


def test_hole_and_observer_are_values():
    import copy
    import pickle

    observer = Kerr(0.9).observer(inclination_deg=60, radius=1000)
    assert pickle.loads(pickle.dumps(observer)) == observer == copy.deepcopy(observer)
    assert hash(Kerr(0.9)) == hash(Kerr(0.9)) and Kerr(0.9) != Kerr(0.8)
    assert "0.9" in repr(observer)
    assert abs(Kerr(0.0).photon_orbit - 3) < 1e-12 and Kerr(1.0).horizon == 1.0
    assert kerrlight.Kerr is Kerr


def test_angles_are_finite_and_numbers_whole():
    observer = kerrlight.Kerr(0.9).observer(inclination_deg=60)
    for call in (lambda: observer.band(1, [np.nan]), lambda: observer.critical_curve(angles=[np.inf])):
        with pytest.raises(ValueError, match="angles"):
            call()
    for call in (lambda: observer.trace(1.0, 1.0, samples=2.5), lambda: kerrlight.Kerr("0.5")):
        with pytest.raises(TypeError, match="not allowed"):
            call()
    with pytest.raises(ValueError, match="masked"):
        observer.trace(np.ma.masked_array([1.0, 2.0], [0, 1]), 1.0)


def test_exact_matter_plunges_inside_of_the_innermost_stable_orbit():
    # Light straight away from matter that falls from 6 M of a hole without spin.
    r = np.linspace(2.2, 6.0, 20)
    falling = (6 / r - 1) ** 1.5 / 3
    expected = (1 - 2 / r) / (np.sqrt(8 / 9) + falling)
    found = Kerr(0.0).keplerian_redshift(r, 0.0, p_r=1 / (1 - 2 / r))
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    with pytest.warns(UserWarning, match="innermost stable orbit at 6 M"):
        Kerr(0.0).keplerian_redshift([5.0, 9.0], 1.0)


def test_exact_angles_in_the_other_unit_are_told():
    hole = Kerr(0.5)
    for degrees in (60, 17, 90):
        with pytest.warns(UserWarning, match=f"{degrees} degrees in radians"):
            hole.observer(inclination_deg=np.radians(degrees))
    with pytest.warns(UserWarning, match="two turns"):
        hole.observer(inclination_deg=30, azimuth=90)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for plausible in (0, 0.5, 1, 3.14, 17.5, 180):
            hole.observer(inclination_deg=plausible, azimuth=-np.pi)


def test_exact_crossings_are_checked():
    with pytest.raises(ValueError, match="crossings = 1000000000"):
        Kerr(0.5).observer(inclination_deg=30).trace(1.0, 1.0, crossings=10**9)


def test_exact_arrays_that_lie_across_words_are_taken():
    # As dask hands over what came from another process.
    alpha = np.frombuffer(b"\0" + np.linspace(-8, 8, 5).tobytes(), offset=1)
    assert not alpha.flags.aligned
    observer = Kerr(0.5).observer(inclination_deg=30)
    np.testing.assert_array_equal(observer.trace(alpha, 1.0).outcome, observer.trace(alpha.copy(), 1.0).outcome)
    observer.critical_curve(angles=alpha), observer.band(1, alpha)
