"""Tables of traced rays."""

from __future__ import annotations

import math
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from kerrlight._arrays import Floats

__all__ = ["Outcome", "Points", "Rays"]

PARAMETERS = ("spin", "inclination", "alpha", "beta")
"""Parameters of derivatives, in the order of their last axis: per 1, per radian, per M and per M."""


class Outcome(IntEnum):
    """Outcome of a ray that was followed backward in time."""

    CAPTURED = 0
    """It reaches the outer horizon."""
    ESCAPED = 1
    """It returns to infinity."""
    PHOTON_ORBIT = 2
    """Unresolved: it lies on the critical curve within rounding."""
    STEP_LIMIT = 3
    """Unresolved: the limit on the number of steps was reached."""


class Points:
    """Points on rays: crossings of the equatorial plane, or samples.

    Every column has the shape of the rays and one axis more, along the ray from the observer on, filled up with NaN
    behind the last point of a ray. Columns that were not requested raise an ``AttributeError``.
    """

    def __init__(
        self,
        columns: dict[str, Any],
        shape: tuple[int, ...],
        width: int,
        derivatives: dict[str, Any] | None,
    ) -> None:
        self._columns = columns
        self._derivatives = derivatives
        self._shape = shape
        self._width = width
        self._filled: dict[str, Floats] = {}

    @cached_property
    def _counts(self) -> NDArray[np.int64]:
        return np.diff(self._columns["ends"], prepend=0)

    @property
    def count(self) -> NDArray[np.int64]:
        """Number of points of each ray."""
        return self._counts.reshape(self._shape)

    def __len__(self) -> int:
        return len(self._columns["r"])

    def __repr__(self) -> str:
        names = ", ".join(name for name in self._columns if name != "ends")
        return f"<Points of shape {(*self._shape, self._width)}: {names}>"

    def flat(self, name: str) -> Floats:
        """A column without its filling: the points of all rays, ray after ray (:attr:`count` says how many of each)."""
        if name == "ends" or name not in self._columns:
            raise AttributeError(f"{name} was not requested: {self!r}")
        column: Floats = self._columns[name]
        return column

    def _fill(self, flat: Floats) -> Floats:
        rows = math.prod(self._shape)
        tail = flat.shape[1:]
        if len(flat) != rows * self._width:
            whole = np.full((rows, self._width, *tail), np.nan)
            whole[np.arange(self._width) < self._counts[:, None]] = flat
            flat = whole
        return flat.reshape((*self._shape, self._width, *tail))

    def _get(self, name: str) -> Floats:
        if name not in self._filled:
            self._filled[name] = self._fill(self.flat(name))
        return self._filled[name]

    @property
    def mino(self) -> Floats:
        """Mino time since the observer, which grows backward in time (1/M)."""
        return self._get("mino")

    @property
    def r(self) -> Floats:
        """Boyer–Lindquist radius (M)."""
        return self._get("r")

    @property
    def theta(self) -> Floats:
        """Polar angle (radians)."""
        return self._get("theta")

    @property
    def phi(self) -> Floats:
        """Azimuth, continuous along the ray from the observer's on (radians)."""
        return self._get("phi")

    @property
    def delay(self) -> Floats:
        """t(observer) - t (M); for an observer at infinity its finite part."""
        return self._get("delay")

    @property
    def momentum(self) -> Floats:
        """Covariant momentum (p_t, p_r, p_theta, p_phi) for unit energy at infinity, on a last axis of four."""
        return self._get("momentum")

    @property
    def weight(self) -> Floats:
        """Weights of samples in an integral over the affine parameter s = ∫Σ dτ (M)."""
        return self._get("weight")

    @property
    def x(self) -> Floats:
        """r sin(theta) cos(phi) (M)."""
        return self.r * np.sin(self.theta) * np.cos(self.phi)

    @property
    def y(self) -> Floats:
        """r sin(theta) sin(phi) (M)."""
        return self.r * np.sin(self.theta) * np.sin(self.phi)

    @property
    def z(self) -> Floats:
        """r cos(theta) (M)."""
        return self.r * np.cos(self.theta)

    def derivative(self, name: str, by: str) -> Floats:
        """The derivative of a column with respect to ``"spin"``, ``"inclination"``, ``"alpha"`` or ``"beta"``.

        It follows the point, which stays a crossing, or stays at its fraction of the ray. Needs
        ``trace(..., derivatives=True)``.
        """
        return _derivative(self._derivatives, name, by, self._fill)


def _derivative(columns: dict[str, Any] | None, name: str, by: str, fill: Any) -> Floats:
    if columns is None:
        raise AttributeError("there are no derivatives: ask for them with derivatives=True")
    if by not in PARAMETERS:
        raise ValueError(f'by = "{by}" is not allowed: one of {", ".join(PARAMETERS)}')
    if name not in columns:
        raise AttributeError(f"{name} was not requested, or has no derivatives")
    derivative: Floats = fill(columns[name])[..., PARAMETERS.index(by)]
    return derivative


class Rays:
    """A table of traced rays: arrays with the shape of the screen coordinates."""

    def __init__(
        self, table: dict[str, Any], shape: tuple[int, ...], widths: tuple[int, int]
    ) -> None:
        by = table.get("derivatives")
        self.shape = shape
        """Shape of the screen coordinates, and of every column."""
        self.outcome: NDArray[np.int8] = table["outcome"].reshape(shape)
        """Outcome of each ray: the numbers of :class:`Outcome`."""
        self.mino_total: Floats = table["mino_total"].reshape(shape)
        """Mino time of each whole ray (1/M); NaN where unresolved."""
        self.turning_radius: Floats = table["turning_radius"].reshape(shape)
        """Smallest radius of each ray that turns (M); NaN of others."""
        self.crossing_count: NDArray[np.uint32] = table["crossing_count"].reshape(shape)
        """Number of times each ray crosses the equatorial plane."""
        self.crossings = Points(table["crossings"], shape, widths[0], by and by["crossings"])
        """The first crossings of the equatorial plane."""
        self.samples = Points(table["samples"], shape, widths[1], by and by["samples"])
        """The samples."""
        self._errors: dict[str, Floats] | None = table.get("errors")
        self._derivatives: dict[str, Any] | None = by

    @property
    def captured(self) -> NDArray[np.bool_]:
        """Mask of rays that reach the horizon."""
        return self.outcome == Outcome.CAPTURED

    @property
    def escaped(self) -> NDArray[np.bool_]:
        """Mask of rays that return to infinity."""
        return self.outcome == Outcome.ESCAPED

    @property
    def size(self) -> int:
        """Number of rays."""
        return self.outcome.size

    def error(self, name: str) -> Floats:
        """The largest estimated error on each ray of ``"r"`` (relative), ``"theta"``, ``"phi"`` or ``"delay"``.

        Needs ``trace(..., errors=True)``.
        """
        if self._errors is None:
            raise AttributeError("there are no errors: ask for them with errors=True")
        if name not in self._errors:
            raise ValueError(f'name = "{name}" is not allowed: one of {", ".join(self._errors)}')
        return self._errors[name].reshape(self.shape)

    def derivative(self, name: str, by: str) -> Floats:
        """The derivative of ``"mino_total"`` or ``"turning_radius"``, as :meth:`Points.derivative`."""
        return _derivative(self._derivatives, name, by, lambda rows: rows.reshape((*self.shape, 4)))

    def __repr__(self) -> str:
        return f"<Rays of shape {self.shape}: {int(self.captured.sum())} captured, {int(self.escaped.sum())} escaped>"
