"""Observations from and to pyuvdata, whose baselines run the other way: its (u, v) and visibilities are -(u, v) and the
complex conjugates of those in UVFITS files, and of kerrlight's."""

from __future__ import annotations

import math
from typing import Any, Mapping

import numpy as np
from numpy.typing import ArrayLike

from kerrlight._stations import Station

LIGHT = 299792458.0
"""Metres per second."""
JULIAN = 2400000.5
"""The Julian date at which the modified one is 0."""
CODES = {True: (-1, -2, -3, -4), False: (1, 2, 3, 4)}
"""AIPS's numbers of RR, LL, RL, LR, and of I, Q, U, V."""


def _basis(codes: Any) -> tuple[bool, list[int | None]]:
    """Returns whether products are circular, and the place of each of the four in the data."""
    known = [int(code) for code in codes]
    for circular, wanted in CODES.items():
        if known and all(code in wanted for code in known):
            return circular, [known.index(code) if code in known else None for code in wanted]
    raise ValueError(f"polarization_array = {known} is not allowed: -1 to -4 (RR, LL, RL, LR) or 1 to 4 (I, Q, U, V)")


def _stations(telescope: Any) -> tuple[Station, ...]:
    center = telescope.location
    origin = np.array([part.to_value("m") for part in (center.x, center.y, center.z)])
    places = np.asarray(telescope.antenna_positions) + origin
    return tuple(
        Station(str(name).strip(), (float(x), float(y), float(z)))
        for name, (x, y, z) in zip(telescope.antenna_names, places)
    )


def _center(data: Any) -> Mapping[str, Any]:
    catalog = data.phase_center_catalog
    if len(catalog) != 1:
        raise ValueError(f"{len(catalog)} phase centres are not allowed: 1")
    (center,) = catalog.values()
    kind = center.get("cat_type", "sidereal")
    if kind != "sidereal":
        raise ValueError(f'cat_type = "{kind}" is not allowed: sidereal')
    frame, epoch = center.get("cat_frame") or "icrs", center.get("cat_epoch")
    if frame not in ("icrs", "fk5") or frame == "fk5" and epoch not in (None, 2000.0, "J2000", "J2000.0"):
        raise ValueError(f'cat_frame = "{frame}" with cat_epoch = {epoch} is not allowed: icrs, or fk5 of 2000.0')
    return center


def _columns(data: Any, sigmas: Any, circular: bool, places: list[int | None]) -> dict[str, Any]:
    """Visibilities and their errors, a row for each baseline, time and channel."""
    rows = data.Nblts * data.Nfreqs
    products = np.zeros((rows, 4), dtype=np.complex128)
    errors = np.full((rows, 4), np.nan)
    for k, place in enumerate(places):
        if place is None:
            continue
        is_good = ~data.flag_array[..., place].reshape(-1)
        error = sigmas[..., place].reshape(-1)
        is_good &= np.isfinite(error) & (error > 0)
        products[is_good, k] = np.conj(data.data_array[..., place].reshape(-1)[is_good])
        errors[is_good, k] = error[is_good]
    return {"products": products, "sigmas": errors, "circular": circular}


def read(data: Any, sigmas: ArrayLike | None) -> dict[str, Any]:
    """An observation of a ``UVData``."""
    if str(data.vis_units).lower() != "jy":
        raise ValueError(f'vis_units = "{data.vis_units}" is not allowed: Jy')
    if sigmas is None:
        with np.errstate(divide="ignore"):
            sigmas = 1.0 / np.sqrt(np.asarray(data.nsample_array, dtype=np.float64))
    errors = np.asarray(sigmas, dtype=np.float64)
    if errors.shape != data.data_array.shape:
        raise ValueError(f"sigmas have the shape {errors.shape}, not {data.data_array.shape}")
    circular, places = _basis(data.polarization_array)
    center, count = _center(data), data.Nfreqs
    days = np.asarray(data.time_array) - JULIAN
    mjd = int(math.floor(days.min()))
    numbers = {int(number): k for k, number in enumerate(data.telescope.antenna_numbers)}
    array = _stations(data.telescope)
    pairs = zip(data.ant_1_array, data.ant_2_array)
    names = np.array([[array[numbers[int(n)]].name for n in pair] for pair in pairs], dtype=str)
    frequencies = np.asarray(data.freq_array, dtype=np.float64).reshape(-1)
    widths = np.broadcast_to(np.asarray(data.channel_width, dtype=np.float64), count)
    uv = -np.asarray(data.uvw_array)[:, None, :2] * (frequencies[None, :, None] / LIGHT)
    return dict(
        time=np.repeat((days - mjd) * 24.0, count),
        stations=np.repeat(names, count, axis=0),
        uv=uv.reshape(-1, 2),
        **_columns(data, errors, circular, places),
        integration=np.repeat(np.asarray(data.integration_time, dtype=np.float64), count),
        channel=np.tile(np.arange(count), data.Nblts),
        array=array,
        source=str(center["cat_name"]),
        ra_hours=float(np.degrees(center["cat_lon"]) / 15.0),
        dec_deg=float(np.degrees(center["cat_lat"])),
        mjd=mjd,
        frequency_hz=float(frequencies.mean()),
        bandwidth_hz=float(widths.sum()),
        channels=tuple(zip(frequencies.tolist(), widths.tolist())) if count > 1 else (),
        history=("from pyuvdata",),
    )


def _telescope(obs: Any) -> Any:
    from astropy.coordinates import EarthLocation
    from pyuvdata import Telescope

    lacking = [station.name for station in obs.array if station.position is None]
    if lacking:
        raise ValueError(f"the positions of {', '.join(lacking)} are not known")
    places = np.array([station.position for station in obs.array])
    origin = EarthLocation.from_geocentric(*places[0], unit="m")
    return Telescope.new(
        name="VLBI",
        location=origin,
        antenna_positions=places - places[0],
        antenna_names=[station.name for station in obs.array],
        antenna_numbers=np.arange(1, len(obs.array) + 1),
        instrument="VLBI",
        mount_type="alt-az",
        feeds=["r", "l"] if obs.circular else ["x", "y"],
        x_orientation=None if obs.circular else "east",
    )


def write(obs: Any) -> Any:
    """A ``UVData`` of an observation."""
    from pyuvdata import UVData

    obs._check_known()
    telescope = _telescope(obs)
    numbers = {station.name: k + 1 for k, station in enumerate(obs.array)}
    catalog = {
        0: {
            "cat_name": obs.source or "source",
            "cat_type": "sidereal",
            "cat_lon": np.radians(15.0 * float(obs.ra_hours or 0.0)),
            "cat_lat": np.radians(float(obs.dec_deg or 0.0)),
            # Writers of files ask for an epoch, which icrs has none of.
            "cat_frame": "fk5",
            "cat_epoch": 2000.0,
        }
    }
    # Exactly 0 with an error of 0 stands for what was not measured.
    is_there = ~np.isnan(obs.sigmas) & ~((obs.sigmas == 0.0) & (obs.products == 0.0))
    samples = np.where(is_there, 1.0 / np.where(is_there, obs.sigmas, 1.0) ** 2, 0.0)
    metres = np.column_stack([-obs.uv * (LIGHT / float(obs.frequency_hz or 1.0)), np.zeros(len(obs))])
    return UVData.new(
        freq_array=np.array([float(obs.frequency_hz or 0.0)]),
        channel_width=np.array([float(obs.bandwidth_hz or 0.0)]),
        polarization_array=np.array(CODES[obs.circular]),
        times=obs.time / 24.0 + int(obs.mjd or 0) + JULIAN,
        antpairs=np.array([[numbers[name] for name in pair] for pair in obs.stations.tolist()]),
        do_blt_outer=False,
        integration_time=np.asarray(obs.integration),
        telescope=telescope,
        vis_units="Jy",
        phase_center_catalog=catalog,
        phase_center_id_array=np.zeros(len(obs), dtype=int),
        uvw_array=metres,
        data_array=np.conj(np.where(is_there, obs.products, 0.0))[:, None, :],
        flag_array=~is_there[:, None, :],
        nsample_array=samples[:, None, :],
        history="from kerrlight",
    )
