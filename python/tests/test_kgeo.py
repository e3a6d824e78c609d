"""The interface of kgeo: shapes, signs, and places that kgeo's own tests and ipole agree on."""

import numpy as np
import pytest

from kerrlight import Kerr
from kerrlight.compat.kgeo import r_equatorial, raytrace_ana, rho_of_req, u_kep

# (spin, inclination in degrees, alpha, beta): x and y where the ray first crosses the equatorial plane.
PUBLISHED = {
    (0.42, 60.0, -17.0, 0.0): (-0.0522336, -16.0342),
    (0.42, 60.0, -4.0, 0.0): (-0.308159, -3.20445),
    (0.42, 60.0, 8.0, 0.0): (0.129720, 6.94829),
    (0.9, 10.0, -12.0, 0.0): (-0.164094, -11.0082),
    (0.9, 10.0, -4.0, 0.0): (-0.655582, -2.99558),
    (0.73, 35.0, 0.0001, -10.0): (11.8258, -0.0858775),
}


@pytest.mark.parametrize("ray", PUBLISHED)
def test_published_places(ray):
    spin, inclination, alpha, beta = ray
    geos = raytrace_ana(spin, [0, 1000.0, np.radians(inclination), 0], [alpha, beta], ngeo=10000)
    r, theta, phi = (column[:, 0] for column in geos.geo_coords[1:])
    z = r * np.cos(theta)
    k = int(np.argmax(z < 0))
    share = z[k - 1] / (z[k - 1] - z[k])
    places = np.array([r * np.sin(theta) * np.cos(phi), r * np.sin(theta) * np.sin(phi)])
    found = places[:, k - 1] + share * (places[:, k] - places[:, k - 1])
    np.testing.assert_allclose(found, PUBLISHED[ray], rtol=2e-3, atol=1e-5)


def test_arrays():
    alpha, beta = np.linspace(-8, 8, 7), np.full(7, 0.5)
    geos = raytrace_ana(
        a=0.94, observer_coords=[0, 1000.0, 1.0, 0], image_coords=[alpha, beta], ngeo=60,
        do_phi_and_t=True, savedata=False, plotdata=False,
    )
    assert geos.npix == 7 and geos.r_s.shape == geos.t_s.shape == geos.sig_s.shape == (60, 7)
    np.testing.assert_allclose(geos.r_s[0], 1000.0, rtol=1e-12)
    np.testing.assert_allclose(geos.th_s[0], 1.0, rtol=1e-12)
    np.testing.assert_allclose(geos.t_s[0], 0.0, atol=1e-9)
    assert (np.diff(geos.tausteps, axis=0) > 0).all() and (np.diff(geos.t_s[:-1], axis=0) < 0).all()
    assert (geos.tautot == geos.mino_times[-1]).all() and (geos.tausteps[0] == 0).all()
    np.testing.assert_allclose(geos.lam, -alpha * np.sin(1.0))
    none = raytrace_ana(0.94, [0, 1000.0, 1.0, 0], [alpha, beta], 60, do_phi_and_t=False)
    assert not none.t_s.any() and (none.r_s == geos.r_s).all()
    with pytest.raises(NotImplementedError):
        raytrace_ana(plotdata=True)


@pytest.mark.parametrize("radius", [100.0, 1000.0, 1e5])
def test_affine_parameter(radius):
    coarse = raytrace_ana(0.9, [0, radius, 1.0, 0], [[1.0, 8.0], [0.0, 3.0]], ngeo=41)
    fine = raytrace_ana(0.9, [0, radius, 1.0, 0], [[1.0, 8.0], [0.0, 3.0]], ngeo=400_001)
    inside = (coarse.r_s < 30) & (np.arange(41) < 40)[:, None]
    sigma = fine.r_s**2 + 0.81 * np.cos(fine.th_s) ** 2
    pieces = 0.5 * (sigma[1:] + sigma[:-1]) * np.diff(fine.tausteps, axis=0)
    summed = -np.concatenate([np.zeros((1, 2)), np.cumsum(pieces, axis=0)])[::10_000]
    for ray in range(2):
        ours, theirs = coarse.sig_s[inside[:, ray], ray], summed[inside[:, ray], ray]
        np.testing.assert_allclose(ours - ours[0], theirs - theirs[0], rtol=1e-6, atol=1e-6)
    # Back at the observer's radius, the length is that of a straight line but for a few M.
    chord = 2 * np.sqrt(radius**2 - 73.0)
    assert abs(-coarse.sig_s[-1, 1] - chord) < 10


def test_dataset_of_bhnerf():
    pytest.importorskip("xarray")
    alpha, beta = np.meshgrid(np.linspace(-8, 8, 4), np.linspace(-6, 6, 3), indexing="ij")
    geos = raytrace_ana(0.5, [0, 1000.0, 1.0, 0], [alpha.ravel(), beta.ravel()], 20)
    data = geos.get_dataset(4, 3)
    assert dict(data.sizes) == {"alpha": 4, "beta": 3, "geo": 20}
    # BH-NeRF gives velocities these axes by name.
    assert data.r.dims == ("beta", "alpha", "geo") and data.lam.dims == data.eta.dims == ("beta", "alpha")
    assert float(data.r[1, 3, 7]) == geos.r_s[7, 3 * 3 + 1]
    assert float(data.eta[1, 3]) == geos.eta[3 * 3 + 1]
    np.testing.assert_array_equal(data.alpha, np.linspace(-8, 8, 4))
    # The momentum from R and Theta is null.
    k_r2, k_th2 = data.R / data.Delta**2, data.Theta
    inverse_phi = (data.Delta - data.spin**2 * np.sin(data.theta) ** 2) / (data.Delta * np.sin(data.theta) ** 2)
    norm = -data.Xi / data.Delta + data.Delta * k_r2 + k_th2 + inverse_phi * data.lam**2
    norm = norm + 4 * data.spin * data.r * data.lam / data.Delta
    scale = abs(data.Xi / data.Delta)
    assert float((abs(norm) / scale).isel(geo=slice(0, 15)).max()) < 1e-10


def test_paper_radii_of_crossings():
    for (spin, inclination, alpha, beta), (x, y) in PUBLISHED.items():
        radius, mino, total, last = r_equatorial(spin, 1000.0, np.radians(inclination), 0, alpha, beta)
        np.testing.assert_allclose(radius, np.hypot(x, y), rtol=1e-5)
        assert 0 < mino < total and last >= 0
    assert r_equatorial(0.9, np.inf, 1.0, 3, 10.0, 10.0)[0] == 0.0


@pytest.mark.parametrize("mbar, req", [(0, 6.0), (0, "horizon"), (1, 4.0)])
def test_exact_rings_are_seen_where_rays_cross(mbar, req):
    radius = Kerr(0.9).horizon if req == "horizon" else req
    angles, rho, alpha, beta = rho_of_req(0.9, 0.4, radius, mbar)
    assert len(angles) == 360 and np.isfinite(rho).all()
    np.testing.assert_allclose(np.hypot(alpha, beta), rho)
    if req != "horizon":
        np.testing.assert_allclose(r_equatorial(0.9, np.inf, 0.4, mbar, alpha, beta)[0], radius, rtol=1e-8)
    with pytest.raises(ValueError, match="horizon"):
        rho_of_req(0.9, 0.4, 1.0)


@pytest.mark.parametrize("spin, retrograde", [(0.0, False), (0.9, False), (0.9, True), (-0.7, False), (-0.7, True)])
def test_exact_orbits_keep_their_norm_and_plunges_their_energy(spin, retrograde):
    hole = Kerr(spin)
    against = -abs(spin) if retrograde else abs(spin)
    r = np.linspace(hole.horizon + 0.05, 14.0, 300)
    time, inward, still, turn = u_kep(spin, r, retrograde)
    tt, tp, pp = -(1 - 2 / r), -2 * spin / r, r**2 + spin**2 + 2 * spin**2 / r
    rr = r**2 / (r**2 - 2 * r + spin**2)
    norm = tt * time**2 + 2 * tp * time * turn + pp * turn**2 + rr * inward**2
    np.testing.assert_allclose(norm, -1.0, atol=1e-9)
    inside = r < Kerr(against).isco
    energy = -(tt * time + tp * turn)[inside]
    np.testing.assert_allclose(energy, np.sqrt(1 - 2 / (3 * Kerr(against).isco)), rtol=1e-9)
    assert still == 0 and (inward[inside] < 0).all() and (inward[~inside] == 0).all()
    assert (np.sign(turn[~inside]) == (1 if (spin >= 0) != retrograde else -1)).all()


def test_exact_a_part_of_a_ray_has_the_points_of_the_whole():
    screen = [np.array([-6.0, 0.5, 7.0]), np.array([2.0, 0.5, -3.0])]
    whole = raytrace_ana(0.9, [0, 1000.0, 1.0, 0], screen, ngeo=41)
    half = raytrace_ana(0.9, [0, 1000.0, 1.0, 0], screen, ngeo=21, maxtaufrac=0.5)
    # The whole of a captured ray ends a relative 1e-8 outside the horizon.
    escaping = [0, 2]
    for of, tolerance in ((escaping, 1e-9), (slice(None), 2e-8)):
        np.testing.assert_allclose(half.tautot[of], whole.tautot[of], rtol=tolerance)
        for name in ("r_s", "th_s", "ph_s", "t_s", "affinesteps"):
            part, all_ = getattr(half, name)[:, of], getattr(whole, name)[:21, of]
            np.testing.assert_allclose(part, all_, rtol=10 * tolerance, atol=tolerance)
    for wrong in (0.0, 1.1, np.nan):
        with pytest.raises(ValueError, match="maxtaufrac"):
            raytrace_ana(0.9, maxtaufrac=wrong)


def test_exact_screens_are_not_reshaped():
    for wrong in (np.zeros((5, 2)), np.zeros((2, 5, 5)), [[1.0]]):
        with pytest.raises(ValueError, match="alpha"):
            raytrace_ana(0.9, image_coords=wrong)
