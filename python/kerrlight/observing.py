"""Simulated observations: what an array of telescopes sees of images, as ``kerrlight observe`` makes them."""

from __future__ import annotations

from os import PathLike, fspath
from typing import Sequence, Union

import numpy as np
from numpy.typing import ArrayLike

from kerrlight import _core
from kerrlight._arrays import finite, real, whole
from kerrlight.interferometry import Observation, Station

__all__ = ["observe", "stations"]

Telescopes = Union[str, "PathLike[str]", Sequence[Station]]


def stations(name: Union[str, PathLike[str]]) -> tuple[Station, ...]:
    """The stations of a built-in array (``"EHT2017"`` or ``"ngEHT"``), or of a file in eht-imaging's format.

    >>> [station.name for station in stations("EHT2017")][:3]
    ['PV', 'SMT', 'SMA']
    """
    text = None
    try:
        found = _core.array(fspath(name), None)
    except ValueError as error:
        try:
            with open(name, encoding="utf-8") as file:
                text = file.read()
        except FileNotFoundError:
            raise error from None
        found = _core.array(fspath(name), text)
    return tuple(
        Station(name, position and tuple(position), tuple(sefd), tuple(feed), tuple(leakage))
        for name, position, sefd, feed, leakage in found
    )


def observe(
    images: ArrayLike,
    field_uas: float,
    array: Telescopes = "EHT2017",
    *,
    q: ArrayLike | None = None,
    u: ArrayLike | None = None,
    v: ArrayLike | None = None,
    source: str,
    mjd: int,
    utc: tuple[float, float] | None = None,
    gmst: tuple[float, float] | None = None,
    scans: int,
    integration: float = 60.0,
    frequency_hz: float = 226.1917890625e9,
    bandwidth_hz: float = 1.856e9,
    elevation_deg: tuple[float, float] = (10.0, 85.0),
    of_date: bool = False,
    ut1_utc: float | None = None,
    frame_hours: ArrayLike | None = None,
    pulse: str = "triangle",
    accuracy: float | None = None,
    scattering: bool = False,
    gain_constant: float = 0.0,
    gain_scan: float = 0.0,
    random_phases: bool = False,
    noise: bool = True,
    seed: int | None = None,
) -> Observation:
    """Visibilities of an image, or of a movie over (t, y, x), in Jy/pixel; rows from the north, each from the east.

    RL and LR are there if Stokes Q and U are given; otherwise they are not measured.

    :param images: the image, or the movie, of Stokes I.
    :param q: Stokes Q, of the shape of ``images``; together with ``u``.
    :param u: Stokes U.
    :param v: Stokes V; without it, RR and LL are I.
    :param field_uas: width of the field (µas).
    :param array: what :func:`stations` takes, or stations.
    :param source: ``"sgra"``, ``"m87"``, or right ascension in hours and declination in degrees: ``"12.5,-29.25"``.
    :param mjd: the day (modified Julian date) whose 0 h UTC hours count from.
    :param utc: hours of UTC from the first scan to where the one after the last would be.
    :param gmst: the same in hours of Greenwich mean sidereal time, in place of ``utc``.
    :param scans: how many scans.
    :param integration: of a scan, in seconds.
    :param elevation_deg: least and greatest elevation at which stations observe.
    :param of_date: whether the Earth's axis precesses; otherwise catalogue coordinates are taken as of date.
    :param ut1_utc: UT1 - UTC in seconds, in place of the built-in table's.
    :param noise: whether there is thermal noise, which needs a ``seed``.
    :param frame_hours: hours of UTC of the images of a movie, between which it is linear; by default those of the scans.
    :param pulse: shape of a pixel, as of :class:`kerrlight.Fourier`.
    :param accuracy: as of :class:`kerrlight.Fourier`.
    :param scattering: whether to blur by the scattering towards Sgr A*.
    :param gain_constant: standard deviation of the logarithm of station gains, constant in time.
    :param gain_scan: the same, another gain for every scan.
    :param random_phases: whether stations have random phases in every scan.
    :param seed: of noise and gains, without which they do not go.

    >>> import numpy as np
    >>> image = np.zeros((8, 8))
    >>> image[4, 4] = 1.0
    >>> when = {"source": "m87", "mjd": 57850, "utc": (0.0, 8.0), "scans": 3}
    >>> obs = observe(image, 100.0, **when, pulse="delta", noise=False)
    >>> bool(np.allclose(abs(obs.vis), 1.0)), obs.source
    (True, 'M87')
    """
    if not isinstance(array, (str, PathLike)) and hasattr(array, "tarr"):
        raise TypeError("array is eht-imaging's: give the path of its file, or kerrlight.Station objects")
    if hasattr(images, "imarr") or hasattr(images, "frames"):
        raise TypeError("images are eht-imaging's: give im.imarr(), or np.array([im.imarr() for im in movie.im_list()])")
    if not isinstance(source, str):
        raise TypeError(f'source = {source!r} is not allowed: "sgra", "m87", or text such as "12.5,-29.25"')
    movie = finite("images", images)
    mjd, scans = whole("mjd", mjd, -(10**9), 10**9), whole("scans", scans, -(10**9), 10**9)
    seed = None if seed is None else whole("seed", seed, 0, 2**64 - 1)
    if movie.ndim not in (2, 3):
        raise ValueError(f"images have the shape {movie.shape}: (y, x) or (t, y, x) are needed")
    polarized = [None if given is None else finite(name, given) for name, given in (("q", q), ("u", u), ("v", v))]
    for name, given in zip("quv", polarized):
        if given is not None and given.shape != movie.shape:
            raise ValueError(f"{name} has the shape {given.shape}, images {movie.shape}: they must be the same")
    if (q is None) != (u is None):
        raise ValueError("give q and u, or none of them: RL and LR are Q ± iU")
    if (utc is None) == (gmst is None):
        raise ValueError("give utc or gmst, one of them")
    is_random = noise or random_phases or gain_constant != 0 or gain_scan != 0
    if is_random and seed is None:
        raise ValueError("noise and gains need a seed, which makes them repeatable: give seed, or noise=False")
    for name, value in (("gain_constant", gain_constant), ("gain_scan", gain_scan)):
        if not 0 <= value <= 3:
            raise ValueError(f"{name} = {value} is not allowed: 0 to 3")
    hours = None
    if frame_hours is not None:
        times = real("frame_hours", frame_hours)
        frames = movie.shape[0] if movie.ndim == 3 else 1
        if times.shape != (frames,):
            raise ValueError(f"frame_hours has the shape {times.shape}, not ({frames},): an hour for every image")
        hours = times.tolist()
    for name, ends in (("utc", utc), ("gmst", gmst), ("elevation_deg", elevation_deg)):
        if ends is not None and np.shape(ends) != (2,):
            raise ValueError(f"{name} has the shape {np.shape(ends)}, not (2,): from and to")
    chosen = stations(array) if isinstance(array, (str, PathLike)) else tuple(array)
    plan = {
        "stations": [
            (s.name, s.position, s.sefd, s.feed_rotation, s.leakage)
            for s in chosen
        ],
        "source": source,
        "mjd": int(mjd),
        "hours": utc if utc is not None else gmst,
        "gmst": utc is None,
        "scans": int(scans),
        "integration": float(integration),
        "frequency_hz": float(frequency_hz),
        "bandwidth_hz": float(bandwidth_hz),
        "elevation_deg": [float(limit) for limit in elevation_deg],
        "of_date": of_date,
        "ut1_utc": ut1_utc,
        "frame_hours": hours,
        "pulse": pulse,
        "accuracy": accuracy,
        "scattering": scattering,
        "gains": (float(gain_constant), float(gain_scan), random_phases),
        "thermal": noise,
        "seed": 0 if seed is None else int(seed),
    }
    height, width = movie.shape[-2:]
    def flat(images: np.ndarray) -> np.ndarray:
        return np.require(images, requirements=["C", "A"]).reshape(-1)

    others = [None if given is None else flat(given) for given in polarized]
    return Observation._of(_core.observe(flat(movie), others, (width, height, float(field_uas)), plan))
