"""Numbers that fits find, as :class:`kerrlight.Fit` gives them."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Mapping, TypeVar

import numpy as np
from numpy.typing import NDArray

from kerrlight._arrays import Floats

__all__ = ["Feature", "Images", "Number", "Polarization", "Ring", "Step"]

Kind = TypeVar("Kind")


@dataclass(frozen=True)
class Step:
    """Line of the log for a step."""

    step: int
    loss: float
    chi2_per_datum: Mapping[str, float] = field(default_factory=dict)
    """χ² per datum of each kind of data."""
    psnr_db: float | None = None
    """Peak signal-to-noise ratio of the emission, where the truth is known; so are the next two."""
    nrmse: float | None = None
    correlation: float | None = None
    seconds: float | None = None
    """Since the fit began or was resumed."""


@dataclass(frozen=True)
class Number:
    """A number with its error."""

    value: float
    error: float | None
    """Standard deviation; None without draws (``image.draws``)."""

    def __float__(self) -> float:
        return self.value

    def __str__(self) -> str:
        return f"{self.value:.4g}" + (f" ± {self.error:.2g}" if self.error is not None else "")


@dataclass(frozen=True)
class Feature:
    """Bright emission that draws have in common, by its centroid; errors are standard deviations of the draws."""

    radius: Number
    """M."""
    azimuth_deg: Number
    height: Number
    """z (M)."""
    light: Number
    """M³ times the unit of emission."""
    peak: float
    """The largest emission of the mean of the draws."""


@dataclass(frozen=True)
class Ring:
    """The ring of a static image; docs/method/static-images.md defines its numbers."""

    diameter_uas: Number
    width_uas: Number
    position_angle_deg: Number
    """Brightest direction, east of north."""
    asymmetry: Number
    central_brightness: Number


@dataclass(frozen=True)
class Polarization:
    """Linear polarisation of a static image. Fractions are of Stokes I, angles east of north."""

    net_fraction: Number
    """Polarisation of all light together."""
    net_evpa_deg: Number
    mean_fraction: Number
    """Mean over the image as the beam sees it."""
    brightest_fraction: Number
    """Polarisation where polarised light is brightest."""
    brightest_deg: Number
    """Direction of that place from the centre."""
    beta2: Number
    """Modulus of β₂."""
    beta2_deg: Number
    """Argument of β₂."""


class Images:
    """Images over (t, y, x) in Jy/pixel, rows from the north; a static image is one."""

    def __init__(self, path: Path) -> None:
        with np.load(path) as arrays:
            found: dict[str, NDArray[Any]] = {name: arrays[name] for name in arrays}
        self.recovered: NDArray[np.float32] = found["recovered"]
        """Movie of the model."""
        self.recovered_q: NDArray[np.float32] | None = found.get("recovered_q")
        """Stokes Q of a static image, where it was fitted."""
        self.recovered_u: NDArray[np.float32] | None = found.get("recovered_u")
        self.data: NDArray[np.float32] | None = found.get("data")
        """Movie that was fitted, or simulated; None where no images are known."""
        self.time: Floats = found["time"]
        """M."""
        self.hours: Floats | None = found.get("hours")
        """Times in hours, where the mass is known."""
        self.field_uas: float | None = float(found["field_uas"][0]) if "field_uas" in found else None
        """Width, where mass and distance are known."""

    def __len__(self) -> int:
        return len(self.recovered)

    def __repr__(self) -> str:
        frames, rows, columns = self.recovered.shape
        return f"<Images: {frames} of {columns} x {rows} pixels>"


def step_of(line: str) -> Step | None:
    """The step of a line of the log, if it has a loss."""
    found = json.loads(line)
    if "step" not in found or "loss" not in found:
        return None
    return Step(**{name: found[name] for name in Step.__dataclass_fields__ if name in found})


def feature_of(found: Mapping[str, Any]) -> Feature:
    """A feature of ``posterior.json``."""
    given: dict[str, Any] = {name: Number(*of) if isinstance(of, list) else of for name, of in found.items()}
    return Feature(**given)


def numbers_of(kind: type[Kind], results: Mapping[str, Any], before: str) -> Kind | None:
    """Those of results whose keys begin so, if they are there."""
    names = list(kind.__annotations__)
    if any(before + name not in results for name in names):
        return None
    return kind(**{name: Number(results[before + name], results.get(f"{before}{name}_error")) for name in names})
