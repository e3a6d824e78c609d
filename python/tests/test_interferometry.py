"""Files, columns, closures, the transform and its adjoint, and eht-imaging's objects."""

import types
from dataclasses import replace

import numpy as np
import pytest

from kerrlight import Fourier, Observation, Station, observe

RNG = np.random.default_rng(3)
NAMES = ["AA", "LM", "PV", "SM"]


def observation(circular=False, times=(4.0, 5.0)):
    pairs = [(a, b) for i, a in enumerate(NAMES) for b in NAMES[i + 1 :]]
    count = len(pairs) * len(times)
    array = tuple(
        Station(name, (1e6 * k + 0.5, 2e6, -3e6 * k), (100.0 * k, 90.0), (1.0, -1.0, 30.0), (0.1j, 0.2 + 0j))
        for k, name in enumerate(NAMES)
    )
    products = RNG.normal(size=(count, 4)) + 1j * RNG.normal(size=(count, 4))
    return Observation(
        time=np.repeat(times, len(pairs)),
        stations=np.array(pairs * len(times)),
        uv=RNG.normal(size=(count, 2)) * 1e9,
        products=products,
        sigmas=0.01 + 0.01 * RNG.random((count, 4)),
        circular=circular,
        integration=np.full(count, 60.0),
        array=array,
        source="M87",
        ra_hours=12.5,
        dec_deg=12.4,
        mjd=57850,
        frequency_hz=2.3e11,
        bandwidth_hz=2e9,
    )


@pytest.mark.parametrize("ending", [".uvfits", ".txt", ".csv"])
def test_files(tmp_path, ending):
    before = observation(circular=ending == ".uvfits")
    path = tmp_path / f"data{ending}"
    before.write(path)
    after = Observation.read(path)
    assert len(after) == len(before) and after.source == "M87" and after.mjd == 57850
    assert after.frequency_hz == pytest.approx(2.3e11)
    np.testing.assert_allclose(np.sort(after.time), before.time, atol=1e-6)
    order = np.lexsort((after.v, after.u)), np.lexsort((before.v, before.u))
    np.testing.assert_allclose(after.uv[order[0]], before.uv[order[1]], rtol=1e-6)
    np.testing.assert_allclose(after.vis[order[0]], before.vis[order[1]], rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(after.sigma[order[0]], before.sigma[order[1]], rtol=1e-5, atol=1e-6)
    # Tables do not tell it.
    np.testing.assert_allclose(after.integration, 0.0 if ending == ".csv" else 60.0, rtol=1e-6)
    if ending == ".uvfits":
        assert {station.feed_rotation for station in after.array} == {(1.0, -1.0, 30.0)}


def test_feeds_without_a_code_are_refused(tmp_path):
    before = observation(circular=True)
    odd = replace(before, array=tuple(replace(s, feed_rotation=(1.0, 0.5, 45.0)) for s in before.array))
    with pytest.raises(ValueError, match="station AA: feeds that turn with 1 times the parallactic angle and 0.5"):
        odd.write(tmp_path / "data.uvfits")
    assert not (tmp_path / "data.uvfits").exists()


def test_what_is_not_a_file_of_visibilities(tmp_path):
    path = tmp_path / "picture.uvfits"
    path.write_bytes(b"\x89PNG\xff")
    with pytest.raises(ValueError, match="picture.uvfits: .*neither UVFITS"):
        Observation.read(path)
    with pytest.raises(FileNotFoundError):
        Observation.read(tmp_path / "none.uvfits")
    with pytest.raises(ValueError, match="is not allowed: one of .uvfits"):
        observation().write(tmp_path / "data.png")
    bare = Observation.of_stokes_i([1.0], [["A", "B"]], [[1.0, 2.0]], [1.0], [0.1])
    with pytest.raises(ValueError, match="the data lack"):
        bare.write(tmp_path / "data.uvfits")


def test_stokes_i_of_hands():
    of = observation(circular=True)
    np.testing.assert_allclose(of.vis, 0.5 * (of.products[:, 0] + of.products[:, 1]))
    np.testing.assert_allclose(of.sigma, 0.5 * np.hypot(of.sigmas[:, 0], of.sigmas[:, 1]))
    total = of.total_intensity()
    assert not total.circular and np.isnan(total.sigmas[:, 1:]).all()
    np.testing.assert_array_equal(total.vis, of.vis)


def test_selection_and_averages():
    of = observation()
    early = of.where(of.time < 4.5)
    assert len(early) == 6 and (early.time == 4.0).all() and early.array == of.array
    assert len(of.averaged(7200.0)) == 6
    with pytest.raises(ValueError, match="seconds"):
        of.averaged(0.0)


def test_closures_do_not_see_gains():
    of = observation()
    gains = {name: 1.3 * np.exp(2j * k) for k, name in enumerate(NAMES)}
    factor = np.array([gains[a] * np.conj(gains[b]) for a, b in of.stations])
    spoiled = Observation.of_stokes_i(of.time, of.stations, of.uv, of.vis * factor, of.sigma)
    plain = Observation.of_stokes_i(of.time, of.stations, of.uv, of.vis, of.sigma)
    phases, log_amplitudes = plain.closure_phases(), plain.log_closure_amplitudes()
    assert len(phases) == 6 and len(log_amplitudes) == 4
    turned = np.exp(1j * (phases.value - spoiled.closure_phases().value))
    np.testing.assert_allclose(turned, 1.0, atol=1e-12)
    np.testing.assert_allclose(log_amplitudes.value, spoiled.log_closure_amplitudes().value, atol=1e-12)
    by_hand = (phases.signs * np.angle(plain.vis)[phases.rows]).sum(axis=1)
    np.testing.assert_allclose(np.exp(1j * by_hand), np.exp(1j * phases.value), atol=1e-12)
    logs = (log_amplitudes.signs * np.log(np.abs(plain.vis))[log_amplitudes.rows]).sum(axis=1)
    np.testing.assert_allclose(logs, log_amplitudes.value, atol=1e-12)
    assert phases.stations.shape == (6, 3) and set(phases.stations.ravel()) <= set(NAMES)


@pytest.mark.parametrize("accuracy", [None, 1e-8])
@pytest.mark.parametrize("pulse", ["delta", "rectangle", "triangle"])
def test_fourier_adjoint(accuracy, pulse):
    lists = [RNG.normal(size=(n, 2)) * 2e9 for n in (40, 0, 25)]
    fourier = Fourier((24, 20), 150.0, lists, pulse=pulse, accuracy=accuracy)
    assert fourier.input_shape == (3, 24, 20) and fourier.output_shape == (65,)
    movie = RNG.normal(size=fourier.input_shape)
    data = RNG.normal(size=65) + 1j * RNG.normal(size=65)
    left = np.vdot(fourier.apply(movie), data).real
    right = (movie * fourier.vjp(data)).sum()
    assert abs(left - right) < 1e-10 * np.linalg.norm(movie) * np.linalg.norm(data)


def test_fourier_is_the_sum_over_pixels():
    uv = RNG.normal(size=(5, 2)) * 3e9
    pixel = 100.0 / 6 * np.pi / 180 / 3600 * 1e-6
    east = (2.5 - np.arange(6)) * pixel
    north = (1.5 - np.arange(4)) * pixel
    image = RNG.random((4, 6))
    fourier = Fourier((4, 6), 100.0, uv, pulse="delta")
    phase = uv[:, 0, None, None] * east + uv[:, 1, None, None] * north[:, None]
    signs = [np.exp(sign * 2j * np.pi * phase) for sign in (-1, 1)]
    errors = [abs((image * wave).sum(axis=(1, 2)) - fourier.apply(image)).max() for wave in signs]
    assert min(errors) < 1e-12


def test_refusals():
    hidden = np.ma.masked_array(np.ones((1, 4), complex), True)
    row = ([1.0], [["A", "B"]], [[1.0, 2.0]])
    for call, words in [
        (lambda: Fourier((4, 4), 100.0, [[1.0, 2.0]], pulse="round"), 'pulse = "round"'),
        (lambda: Fourier((4, 4), -1.0, [[1.0, 2.0]]), "field of view"),
        (lambda: Fourier((4, 4), 1.0, [[1.0, 2.0]]).apply(np.zeros((3, 3))), "image has the shape"),
        (lambda: Fourier((4, 4), 1.0, [np.zeros(3), np.ones(3)]), "uv has the shape (2, 3), not (n, 2)"),
        (lambda: Fourier((4, 4), 1.0, np.zeros((3, 5, 2))), "uv has the shape (3, 5, 2)"),
        (lambda: Fourier((4, 4), 1.0, np.zeros(4)), "uv has the shape (4,)"),
        (lambda: Fourier((4, 4), 1.0, [np.zeros((5, 2)), np.zeros((2, 5))]), "uv[1] has the shape (2, 5)"),
        (lambda: Fourier((4, 4), 1.0, []), "uv is empty"),
        (lambda: Fourier((4, 4, 4), 1.0, [[1.0, 2.0]]), "(rows, columns)"),
        (lambda: Observation.of_stokes_i([1.0], [["A", "B"]], [[1.0]], [1.0], [0.1]), "uv has the shape"),
        (lambda: Observation.of_stokes_i(*row, hidden[0, :1], [0.1]), "vis has masked elements"),
        (lambda: Observation(*row, hidden, np.ones((1, 4))), "products has masked elements"),
        (lambda: Fourier((4, 4), 1.0, [[1.0, 2.0]]).vjp(hidden[0, :1]), "cotangent has masked elements"),
    ]:
        with pytest.raises(ValueError) as refused:
            call()
        assert words in str(refused.value)


def fake_obsdata(of):
    """What an Obsdata has, without eht-imaging."""
    dtype = [("time", "f8"), ("tint", "f8"), ("t1", "U32"), ("t2", "U32"), ("tau1", "f8"), ("tau2", "f8"), ("u", "f8"), ("v", "f8")]
    dtype += [(f"{p}vis", "c16") for p in ("", "q", "u", "v")] + [(f"{p}sigma", "f8") for p in ("", "q", "u", "v")]
    data = np.zeros(len(of), dtype=dtype)
    data["time"], data["tint"], data["u"], data["v"] = of.time, 60.0, of.u, of.v
    data["t1"], data["t2"] = of.stations.T
    data["vis"], data["sigma"] = of.products[:, 0], of.sigmas[:, 0]
    data["qvis"] = np.nan
    site = [("site", "U32"), ("x", "f8"), ("y", "f8"), ("z", "f8"), ("sefdr", "f8"), ("sefdl", "f8")]
    site += [("dr", "c16"), ("dl", "c16"), ("fr_par", "f8"), ("fr_elev", "f8"), ("fr_off", "f8")]
    tarr = np.zeros(4, dtype=site)
    tarr["site"] = NAMES
    return types.SimpleNamespace(
        data=data, tarr=tarr, polrep="stokes", source="M87", ra=12.5, dec=12.4, mjd=57850, rf=2.3e11, bw=2e9
    )


def test_from_ehtim_by_its_columns():
    of = observation()
    found = Observation.from_ehtim(fake_obsdata(of))
    np.testing.assert_array_equal(found.vis, of.products[:, 0])
    np.testing.assert_array_equal(found.uv, of.uv)
    assert np.isnan(found.sigmas[:, 1]).all() and found.array[1].name == "LM"
    assert len(found.closure_phases()) == 6


@pytest.mark.parametrize(
    ("of", "value", "words"),
    [
        ("u", np.nan, "uv = nan"),
        ("time", 1e9, r"time = 1e\+09"),
        ("tint", -5.0, "integration = -5"),
        ("tau1", np.inf, "opacity = inf"),
        ("t1", "XX", "station XX of the data is not in tarr"),
        ("rf", 230.0, "frequency_hz = 230"),
        ("bw", -1.0, "bandwidth_hz = -1"),
        ("mjd", 57850.5, "mjd = 57850.5 is not allowed: a whole number"),
        ("mjd", 2457850, r"mjd = 2.45785e\+06"),
    ],
)
def test_implausible_fields_are_refused(of, value, words):
    obs = fake_obsdata(observation())
    if of in obs.data.dtype.names:
        obs.data[of][1] = value
    else:
        setattr(obs, of, value)
    with pytest.raises(ValueError, match=words):
        Observation.from_ehtim(obs)
    with pytest.raises(ValueError, match="baseline of A with itself"):
        Observation.of_stokes_i([1.0], [["A", "A"]], [[1.0, 2.0]], [1.0], [0.1])
    with pytest.raises(ValueError, match="products has an element"):
        Observation.of_stokes_i([1.0], [["A", "B"]], [[1.0, 2.0]], [np.nan], [0.1])


@pytest.mark.parametrize("circular", [False, True])
def test_to_ehtim_and_back(circular, tmp_path):
    ehtim = pytest.importorskip("ehtim")
    of = observation(circular)
    obs = of.to_ehtim()
    back = Observation.from_ehtim(obs)
    order = [np.lexsort((o.v, o.u)) for o in (of, back)]
    for name in ("uv", "products", "sigmas", "time", "stations"):
        np.testing.assert_array_equal(getattr(back, name)[order[1]], getattr(of, name)[order[0]])
    assert {s.name: s for s in back.array} == {s.name: s for s in of.array}
    of.write(tmp_path / "data.uvfits")
    theirs = ehtim.obsdata.load_uvfits(str(tmp_path / "data.uvfits"))
    assert len(theirs.data) == len(of)


def test_pyuvdata(tmp_path):
    """Files that pyuvdata reads and what kerrlight reads of them are the same, and so is the way back."""
    uvdata = pytest.importorskip("pyuvdata").UVData
    image = np.random.default_rng(1).random((16, 16)) / 256
    when = {"source": "sgra", "mjd": 57850, "utc": (4.0, 5.0), "scans": 2, "integration": 60}
    obs = observe(image, 100.0, "EHT2017", **when, seed=1)
    obs.write(tmp_path / "a.uvfits")
    obs = Observation.read(tmp_path / "a.uvfits")
    data = uvdata()
    data.read_uvfits(str(tmp_path / "a.uvfits"), run_check=False)
    for theirs in (Observation.from_pyuvdata(data), Observation.from_pyuvdata(obs.to_pyuvdata())):
        np.testing.assert_allclose(theirs.uv, obs.uv, rtol=1e-14)
        np.testing.assert_array_equal(theirs.stations, obs.stations)
        np.testing.assert_allclose(theirs.time, obs.time, atol=1e-7)
        is_there = ~np.isnan(theirs.sigmas)
        assert is_there[:, :2].all() and theirs.circular == obs.circular
        np.testing.assert_allclose(theirs.products[is_there], obs.products[is_there], rtol=1e-12)
        np.testing.assert_allclose(theirs.sigmas[is_there], obs.sigmas[is_there], rtol=1e-12)
        places = {station.name: station.position for station in theirs.array}
        np.testing.assert_allclose(
            [places[station.name] for station in obs.array], [s.position for s in obs.array], atol=1e-3
        )
        assert (theirs.source, theirs.mjd) == (obs.source, obs.mjd)
    halves = Observation.from_pyuvdata(data, sigmas=np.full(data.data_array.shape, 0.5))
    assert set(halves.sigmas[~np.isnan(halves.sigmas)].tolist()) == {0.5}
    with pytest.raises(ValueError, match="sigmas have the shape"):
        Observation.from_pyuvdata(data, sigmas=np.ones(3))
    data.vis_units = "K str"
    with pytest.raises(ValueError, match="vis_units"):
        Observation.from_pyuvdata(data)


def test_an_observation_does_not_change():
    obs = observation()
    for column in (obs.uv, obs.products, obs.sigmas, obs.time, obs.u):
        with pytest.raises(ValueError, match="read-only"):
            column[0] = 1
    for wrong in ({"sigmas": -obs.sigmas}, {"time": obs.time * np.nan}):
        with pytest.raises(ValueError, match="|".join(wrong)):
            replace(obs, **wrong)


def scans():
    """Three stations in two scans of three times 10 s, each baseline two seconds after the one before."""
    pairs = [("AA", "LM"), ("AA", "PV"), ("LM", "PV")]
    rows = [(4.0 + 0.5 * scan + (10 * k + 2 * b) / 3600, b) for scan in (0, 1) for k in range(3) for b in range(3)]
    time = [t for t, _ in rows]
    names = [pairs[b] for _, b in rows]
    uv = [[(1e9, 2e9), (3e9, -1e9), (2e9, -3e9)][b] for _, b in rows]
    sigma = np.where(np.arange(len(rows)) % 2 == 0, 0.01, 0.02)
    return Observation.of_stokes_i(time, names, uv, np.exp(1j * np.arange(len(rows))), sigma)


def test_averages_keep_closures():
    of = scans()
    with pytest.warns(UserWarning, match="0 closure phases, where averages of scans have 2"):
        assert len(of.closure_phases()) == 0
    for averaged in (of.averaged(3600.0), of.averaged(in_scans=True), of.averaged(1e5, in_scans=True)):
        count = 1 if averaged.history[-1].endswith("over 3600 s") else 2
        assert len(np.unique(averaged.time)) == len(averaged.closure_phases()) == count
    first = (of.time < 4.1) & (of.stations[:, 1] == "LM")
    plain = of.averaged(in_scans=True, weighted=False)
    weighted = of.averaged(in_scans=True)
    weights = of.sigma[first] ** -2
    np.testing.assert_allclose(plain.vis[0], of.vis[first].mean())
    np.testing.assert_allclose(plain.sigma[0], np.sqrt((of.sigma[first] ** 2).sum()) / first.sum())
    np.testing.assert_allclose(weighted.vis[0], (of.vis[first] * weights).sum() / weights.sum())
    for bad in (1e-9, np.inf, np.nan, -1.0):
        with pytest.raises(ValueError, match="seconds"):
            of.averaged(bad, in_scans=True)
    with pytest.raises(ValueError, match="in_scans=True"):
        of.averaged()


def test_repeated_rows_are_told():
    of = observation()
    twice = of.where(np.tile(np.arange(len(of)), 2))
    with pytest.warns(UserWarning, match=f"{len(of)} rows have the baseline, channel and time of another"):
        assert len(twice.closure_phases()) == 2 * len(of.closure_phases())
    np.testing.assert_array_equal(twice.averaged(1.0).sigma, of.averaged(1.0).sigma)


def test_sidereal_times_of_ehtim():
    """GMST was 13.0308 h at 0 h UTC of MJD 57850 (astropy); a sidereal hour is 0.99727 hours."""
    obs = fake_obsdata(observation(times=(23.9, 0.1, 12.9)))
    obs.timetype, obs.opacitycal = "GMST", False
    of = Observation.from_ehtim(obs)
    # The longest gap is that before 12.9 h, which is before midnight's sidereal time: 23.8 h UTC of the day.
    first = (12.9 - 13.0308) * 0.99727 + 23.93447
    expected = [first + 11.0 * 0.99727, first + 11.2 * 0.99727, first]
    np.testing.assert_allclose(of.time, np.repeat(expected, 6), atol=1e-4)
    assert of.history == ("from eht-imaging", "OPACITYCAL: 0")
    obs.timetype = "LST"
    with pytest.raises(ValueError, match='timetype = "LST" is not allowed'):
        Observation.from_ehtim(obs)


def test_other_frames_of_pyuvdata_are_refused():
    from kerrlight import _pyuvdata

    center = {"cat_name": "M87", "cat_lon": 0.0, "cat_lat": 0.0}
    for bad in ({"cat_type": "unprojected"}, {"cat_frame": "fk4"}, {"cat_frame": "fk5", "cat_epoch": 1975.0}):
        with pytest.raises(ValueError, match="is not allowed"):
            _pyuvdata._center(types.SimpleNamespace(phase_center_catalog={0: {**center, **bad}}))
    for good in ({}, {"cat_frame": "icrs"}, {"cat_frame": "fk5", "cat_epoch": 2000.0}):
        _pyuvdata._center(types.SimpleNamespace(phase_center_catalog={0: {**center, **good}}))


def test_pyuvdata_writes_uvfits(tmp_path):
    pytest.importorskip("pyuvdata")
    of = observation(circular=True)
    path = tmp_path / "a.uvfits"
    of.to_pyuvdata().write_uvfits(path)
    np.testing.assert_allclose(Observation.read(path).vis, of.vis, rtol=1e-6)


def test_exact_columns_are_not_reshaped():
    names = np.array([["AA", "LM"], ["AA", "PV"], ["LM", "PV"]])
    uv, vis = np.ones((3, 2)), np.ones(3)
    for wrong, words in [
        ((names.T, uv, vis, 0.1), "stations"),
        ((names, uv.T, vis, 0.1), "uv"),
        ((names, uv, vis[:, None], 0.1), "vis"),
        ((names, uv, vis, [0.1, 0.1]), "sigma"),
    ]:
        with pytest.raises(ValueError, match=f"{words} ha.* the shape"):
            Observation.of_stokes_i([4.0] * 3, *wrong)
    for channel in ([0, 0], [0, 0.5, 0]):
        with pytest.raises(ValueError, match="channel"):
            Observation.of_stokes_i([4.0] * 3, names, uv, vis, 0.1, channel=channel)
