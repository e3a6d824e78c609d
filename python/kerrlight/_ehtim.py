"""Observations from and to eht-imaging."""

from __future__ import annotations

from typing import Any

import numpy as np

from kerrlight import _core
from kerrlight._stations import PRODUCTS, Station


CALIBRATIONS = ("ampcal", "phasecal", "opacitycal", "dcal", "frcal")
"""Calibration as an ``Obsdata`` states it."""


def _hours(obs: Any) -> Any:
    """Hours of UTC. Sidereal ones begin after their longest gap, on the day ``obs.mjd``, unless they span a day."""
    hours = np.array(obs.data["time"], dtype=np.float64)
    kind = getattr(obs, "timetype", "UTC")
    if kind == "UTC":
        return hours
    if kind != "GMST":
        raise ValueError(f'timetype = "{kind}" is not allowed: UTC or GMST')
    first = hours.min()
    if hours.max() - first < 24.0:
        clock = np.unique(hours % 24.0)
        first = clock[np.argmax((clock - np.roll(clock, 1)) % 24.0)] if len(clock) > 1 else clock[0]
        hours = first + (hours - first) % 24.0
    return _core.hours_utc_of_gmst(int(obs.mjd), hours, float(first))


def read(obs: Any) -> dict[str, Any]:
    """Returns the arguments of an ``Observation``, from an ``ehtim.obsdata.Obsdata``."""
    circular = {"stokes": False, "circ": True}.get(obs.polrep)
    if circular is None:
        raise ValueError(f'polrep = "{obs.polrep}" is not allowed: stokes or circ')
    data = obs.data
    names = PRODUCTS[circular]
    products = [np.asarray(data[f"{name}vis"], dtype=np.complex128) for name in names]
    sigmas = [np.asarray(data[f"{name}sigma"], dtype=np.float64) for name in names]
    # eht-imaging has NaN where there is no product.
    missing = [~np.isfinite(product) for product in products]
    for product, sigma, none in zip(products, sigmas, missing):
        product[none] = 0.0
        sigma[none] = np.nan
    array = tuple(
        Station(
            str(row["site"]),
            (float(row["x"]), float(row["y"]), float(row["z"])),
            (float(row["sefdr"]), float(row["sefdl"])),
            (float(row["fr_par"]), float(row["fr_elev"]), float(row["fr_off"])),
            (complex(row["dr"]), complex(row["dl"])),
        )
        for row in obs.tarr
    )
    for name in np.setdiff1d(np.union1d(data["t1"], data["t2"]), [station.name for station in array]):
        raise ValueError(f"station {name} of the data is not in tarr")
    return dict(
        time=_hours(obs),
        stations=np.stack([data["t1"], data["t2"]], axis=-1).astype(str),
        uv=np.stack([data["u"], data["v"]], axis=-1).astype(np.float64),
        products=np.stack(products, axis=-1),
        sigmas=np.stack(sigmas, axis=-1),
        circular=circular,
        integration=np.array(data["tint"], dtype=np.float64),
        opacity=np.stack([data["tau1"], data["tau2"]], axis=-1).astype(np.float64),
        array=array,
        source=str(obs.source),
        ra_hours=float(obs.ra),
        dec_deg=float(obs.dec),
        mjd=obs.mjd,
        frequency_hz=float(obs.rf),
        bandwidth_hz=float(obs.bw),
        history=("from eht-imaging", *(f"{name.upper()}: 0" for name in CALIBRATIONS if not getattr(obs, name, True))),
    )


def write(observation: Any) -> Any:
    """An ``ehtim.obsdata.Obsdata``."""
    import ehtim

    observation._check_known()
    names = PRODUCTS[observation.circular]
    kind = "DTPOL_CIRC" if observation.circular else "DTPOL_STOKES"
    data = np.zeros(len(observation), dtype=getattr(ehtim.const_def, kind))
    data["time"], data["tint"] = observation.time, observation.integration
    data["t1"], data["t2"] = observation.stations.T
    data["tau1"], data["tau2"] = np.asarray(observation.opacity).T
    data["u"], data["v"] = observation.uv.T
    for k, name in enumerate(names):
        sigma = observation.sigmas[:, k]
        data[f"{name}vis"] = np.where(np.isnan(sigma), np.nan, observation.products[:, k])
        data[f"{name}sigma"] = sigma
    tarr = np.zeros(len(observation.array), dtype=ehtim.const_def.DTARR)
    for row, station in zip(tarr, observation.array):
        row["site"] = station.name
        row["x"], row["y"], row["z"] = station.position or (0.0, 0.0, 0.0)
        row["sefdr"], row["sefdl"] = station.sefd
        row["fr_par"], row["fr_elev"], row["fr_off"] = station.feed_rotation
        row["dr"], row["dl"] = station.leakage
    return ehtim.obsdata.Obsdata(
        observation.ra_hours,
        observation.dec_deg,
        observation.frequency_hz,
        observation.bandwidth_hz,
        data,
        tarr,
        polrep="circ" if observation.circular else "stokes",
        source=observation.source,
        mjd=observation.mjd,
        **{name: f"{name.upper()}: 0" not in observation.history for name in CALIBRATIONS},
    )
