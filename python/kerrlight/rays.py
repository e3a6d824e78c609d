"""Null geodesics of the Kerr spacetime, traced backward from an observer's screen.

A :class:`Kerr` hole has observers, an :class:`Observer` traces rays, and :class:`Rays` is a table of arrays with the
shape of the screen coordinates that were given.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kerrlight import _core
from kerrlight._arrays import Floats, real, together

__all__ = [
    "Curve",
    "GaussLegendre",
    "Kerr",
    "MinoTime",
    "Observer",
    "Outcome",
    "PathLength",
    "Points",
    "Rays",
]

PARAMETERS = ("spin", "inclination", "alpha", "beta")
"""What derivatives are taken with respect to, in the order of their last axis: per 1, per radian, per M and per M."""


class Outcome(IntEnum):
    """What became of a ray that was followed backward in time."""

    CAPTURED = 0
    """It reaches the outer horizon."""
    ESCAPED = 1
    """It returns to infinity."""
    PHOTON_ORBIT = 2
    """Unresolved: it lies on the critical curve within rounding."""
    STEP_LIMIT = 3
    """Unresolved: the limit on the number of steps was reached."""


@dataclass(frozen=True)
class MinoTime:
    """Samples equidistant in Mino time, from the observer to the ray's end.

    Ends at infinity are left out, the horizon and an observer at a finite radius are not.
    """

    points: int


@dataclass(frozen=True)
class PathLength:
    """Samples at the middles of pieces of equal length ∫Σ dτ inside a sphere of ``radius`` (M)."""

    points: int
    radius: float


@dataclass(frozen=True)
class GaussLegendre:
    """Nodes of the Gauss–Legendre rule in Mino time on each of the one or two pieces of a ray between two radii (M)."""

    points: int
    start: float
    stop: float


Placement = Union[int, MinoTime, PathLength, GaussLegendre]


def _placement(samples: Placement) -> tuple[tuple[str, int, float, float], int]:
    """A placement for the compiled half, and the most samples of a ray."""
    if isinstance(samples, MinoTime):
        samples = samples.points
    if isinstance(samples, PathLength):
        return ("path-length", samples.points, 0.0, float(samples.radius)), samples.points
    if isinstance(samples, GaussLegendre):
        kind = ("gauss-legendre", samples.points, float(samples.start), float(samples.stop))
        return kind, 2 * samples.points
    if samples < 0:
        raise ValueError(f"samples = {samples} is not allowed: 0 or above")
    return ("mino-time" if samples else "none", int(samples), 0.0, 0.0), int(samples)


@dataclass(frozen=True)
class Kerr:
    """A black hole of mass M with the dimensionless ``spin`` a in [-1, 1].

    >>> Kerr(0.0).isco
    6.0
    >>> Kerr(1.5)
    Traceback (most recent call last):
    ...
    ValueError: spin = 1.5 is not allowed: a number in [-1, 1]
    """

    spin: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "spin", float(self.spin))
        _core.radii(self.spin)

    @cached_property
    def _radii(self) -> dict[str, float]:
        return _core.radii(self.spin)

    @property
    def horizon(self) -> float:
        """Radius of the outer horizon (M)."""
        return self._radii["horizon"]

    @property
    def inner_horizon(self) -> float:
        """Radius of the inner horizon (M)."""
        return self._radii["inner_horizon"]

    @property
    def isco(self) -> float:
        """Radius of the innermost stable circular orbit that turns about +z (M)."""
        return self._radii["isco"]

    @property
    def photon_orbit(self) -> float:
        """Radius of the equatorial photon orbit that turns about +z (M)."""
        return self._radii["photon_orbit"]

    @property
    def counter_rotating_photon_orbit(self) -> float:
        """Radius of the equatorial photon orbit that turns about -z (M)."""
        return self._radii["counter_rotating_photon_orbit"]

    @property
    def polar_photon_orbit(self) -> float:
        """Radius of the photon orbit over the poles (M)."""
        return self._radii["polar_photon_orbit"]

    def keplerian_redshift(self, r: ArrayLike, lam: ArrayLike) -> Floats:
        """Redshift factor g = E(observed)/E(emitted) of matter on circular orbits in the equatorial plane.

        ``r`` is the radius (M), ``lam`` the photon's L/E (M); they broadcast. NaN where there is no such orbit.

        >>> float(Kerr(0.0).keplerian_redshift(6.0, 0.0).round(12)) == round(0.5**0.5, 12)
        True
        """
        shape, columns = together(r=r, lam=lam)
        return _core.keplerian_redshift(self.spin, *columns).reshape(shape)

    def observer(
        self,
        *,
        inclination_deg: float | None = None,
        inclination_rad: float | None = None,
        radius: float = math.inf,
        azimuth: float = 0.0,
    ) -> Observer:
        """An observer of this hole.

        The inclination, the angle between spin axis and line of sight, is given in degrees in [0, 180] (of which 0,
        90 and 180 are exact) or in radians. ``radius`` is infinite or above 2 (M); ``azimuth`` is in radians.
        """
        if (inclination_deg is None) == (inclination_rad is None):
            raise ValueError("give inclination_deg or inclination_rad, one of them")
        if inclination_deg is not None:
            return Observer(self, float(inclination_deg), True, float(radius), float(azimuth))
        assert inclination_rad is not None
        return Observer(self, float(inclination_rad), False, float(radius), float(azimuth))


class Points:
    """Points on rays: crossings of the equatorial plane, or samples.

    Every column has the shape of the rays and one axis more, along the ray from the observer on, filled up with NaN
    behind the last point of a ray. Columns that were not asked for are refused with an ``AttributeError``.
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
        """How many points each ray has."""
        return self._counts.reshape(self._shape)

    def __len__(self) -> int:
        return len(self._columns["r"])

    def __repr__(self) -> str:
        names = ", ".join(name for name in self._columns if name != "ends")
        return f"<Points of shape {(*self._shape, self._width)}: {names}>"

    def flat(self, name: str) -> Floats:
        """A column without its filling: the points of all rays, ray after ray (:attr:`count` says how many of each)."""
        if name == "ends" or name not in self._columns:
            raise AttributeError(f"{name} was not asked for: {self!r}")
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
        raise AttributeError(f"{name} was not asked for, or has no derivatives")
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
        """What became of each ray: the numbers of :class:`Outcome`."""
        self.mino_total: Floats = table["mino_total"].reshape(shape)
        """Mino time of each whole ray (1/M); NaN where unresolved."""
        self.turning_radius: Floats = table["turning_radius"].reshape(shape)
        """Smallest radius of each ray that turns (M); NaN of others."""
        self.crossing_count: NDArray[np.uint32] = table["crossing_count"].reshape(shape)
        """How many times each ray crosses the equatorial plane."""
        self.crossings = Points(table["crossings"], shape, widths[0], by and by["crossings"])
        """The first crossings of the equatorial plane."""
        self.samples = Points(table["samples"], shape, widths[1], by and by["samples"])
        """The samples."""
        self._errors: dict[str, Floats] | None = table.get("errors")
        self._derivatives: dict[str, Any] | None = by

    @property
    def captured(self) -> NDArray[np.bool_]:
        """Which rays reach the horizon."""
        return self.outcome == Outcome.CAPTURED

    @property
    def escaped(self) -> NDArray[np.bool_]:
        """Which rays return to infinity."""
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


@dataclass(frozen=True, eq=False)
class Curve:
    """Points of the critical curve, the edge of the shadow, with what half an orbit next to each does."""

    r: Floats
    """Radius of the spherical photon orbit (M)."""
    lam: Floats
    """λ = L/E (M)."""
    eta: Floats
    """η = Q/E² (M²)."""
    alpha: Floats
    """Horizontal screen coordinate (M)."""
    beta: Floats
    """Vertical screen coordinate (M)."""
    gamma: Floats
    """Lyapunov exponent: successive images are demagnified by e^-γ."""
    delta: Floats
    """Azimuth that half an orbit sweeps (radians)."""
    tau: Floats
    """Time that half an orbit takes (M)."""


@dataclass(frozen=True)
class Observer:
    """Who sees a hole; made by :meth:`Kerr.observer`.

    Screen coordinates are Bardeen's: α to the right (towards +φ), β upwards (towards the projected spin axis), in M.
    """

    hole: Kerr
    inclination: float
    """In degrees or radians, as it was given."""
    in_degrees: bool
    radius: float = math.inf
    """Boyer–Lindquist radius (M), or infinity."""
    azimuth: float = 0.0
    """In radians."""

    def __post_init__(self) -> None:
        nowhere = np.empty(0)
        wanted = _wanted(0, ("none", 0, 0.0, 0.0), {})
        _core.trace(self.hole.spin, self._place, (nowhere, nowhere), ("taylor-mino", 1e-8), wanted)

    @property
    def _place(self) -> tuple[float, bool, float, float]:
        return (self.inclination, self.in_degrees, self.radius, self.azimuth)

    def trace(
        self,
        alpha: ArrayLike,
        beta: ArrayLike,
        *,
        crossings: int = 3,
        samples: Placement = 0,
        momentum: bool = False,
        weights: bool = False,
        errors: bool = False,
        derivatives: bool = False,
        integrator: str = "taylor-mino",
        tolerance: float = 1e-12,
    ) -> Rays:
        """Traces the rays that arrive at (``alpha``, ``beta``), on all cores.

        :param alpha: screen coordinates in M; any shapes that broadcast together.
        :param beta: as ``alpha``.
        :param crossings: how many crossings of the equatorial plane to locate at most.
        :param samples: where else rays are sampled: a number of points equidistant in Mino time, or a
            :class:`PathLength` or :class:`GaussLegendre`.
        :param momentum: whether points come with covariant momenta.
        :param weights: whether samples come with weights of integrals along the ray.
        :param errors: whether :meth:`Rays.error` estimates errors.
        :param derivatives: whether :meth:`Points.derivative` has exact derivatives; with ``taylor-mino`` alone.
        :param integrator: ``"taylor-mino"``, ``"elliptic"`` (closed forms, the fastest by far for ``samples`` in
            Mino time), ``"dop853-mino"``, ``"rk45-mino"`` or ``"rk45-affine"``.
        :param tolerance: largest local error of a step, in [1e-14, 1e-2].
        :raises ValueError: if a number is out of its range; the message names it.

        >>> observer = Kerr(0.0).observer(inclination_deg=30)
        >>> alpha = np.linspace(0.0, 9.9, 100)
        >>> int(observer.trace(alpha, 0.0).captured.sum())  # α < √27
        52
        >>> rays = observer.trace(8.0, [0.0, 1.0], samples=100, errors=True)
        >>> rays.samples.r.shape, bool((rays.error("r") < 1e-9).all())
        ((2, 100), True)
        >>> rays = observer.trace(-6.0, 2.0, crossings=1, derivatives=True)
        >>> slope = rays.crossings.derivative("r", by="alpha")
        >>> there = observer.trace([-6.0 - 1e-6, -6.0 + 1e-6], 2.0, crossings=1).crossings.r[:, 0]
        >>> bool(abs((there[1] - there[0]) / 2e-6 - slope[0]) < 1e-6)
        True
        """
        shape, (a, b) = together(alpha=alpha, beta=beta)
        placed, width = _placement(samples)
        if crossings < 0:
            raise ValueError(f"crossings = {crossings} is not allowed: 0 or above")
        asked = {"momentum": momentum, "weight": weights, "errors": errors}
        wanted = _wanted(crossings, placed, asked)
        if not derivatives:
            table = _core.trace(self.hole.spin, self._place, (a, b), (integrator, tolerance), wanted)
        elif integrator == "taylor-mino":
            table = _core.differentiate(self.hole.spin, self._place, (a, b), tolerance, wanted)
        else:
            raise ValueError(f'integrator = "{integrator}" has no derivatives: use "taylor-mino"')
        return Rays(table, shape, (crossings, width))

    def critical_curve(self, points: int = 0, *, angles: ArrayLike | None = None) -> Curve:
        """The critical curve as seen from infinity: ``points`` at equal steps of the angle on the screen from +α
        towards +β, or those in the directions ``angles`` (radians).

        >>> curve = Kerr(0.0).observer(inclination_deg=17).critical_curve(4)
        >>> bool(np.allclose(np.hypot(curve.alpha, curve.beta), 27**0.5)), bool(np.allclose(curve.gamma, np.pi))
        (True, True)
        """
        if angles is None:
            if not 1 <= points <= 1_000_000:
                raise ValueError(f"points = {points} is not allowed: 1 to 1000000")
            return Curve(**_core.critical_curve(self.hole.spin, self._place, points))
        column = real("angles", angles)
        flat = np.ascontiguousarray(column).reshape(-1)
        columns = _core.critical_points(self.hole.spin, self._place, flat)
        return Curve(**{name: values.reshape(column.shape) for name, values in columns.items()})

    def band(self, order: int, angles: ArrayLike) -> tuple[Floats, Floats]:
        """Edges of the lensing band of ``order`` n as seen from infinity: rays between them cross the equatorial
        plane at least n + 1 times.

        Returns the inner and the outer edge, arrays with the shape of ``angles`` (radians on the screen) and a last
        axis (α, β); the outer one is NaN where there is none, as for n = 0.

        >>> inner, outer = Kerr(0.0).observer(inclination_deg=0).band(1, 0.0)
        >>> print(f"{inner[0]:.8f} {outer[0]:.8f}")
        5.01513549 6.16756676
        """
        if not 0 <= order <= 65535:
            raise ValueError(f"order = {order} is not allowed: 0 to 65535")
        column = real("angles", angles)
        flat = np.ascontiguousarray(column).reshape(-1)
        edges = _core.band(self.hole.spin, self._place, order, flat)

        def edge(name: str) -> Floats:
            pair = [edges[f"{name}_{axis}"].reshape(column.shape) for axis in ("alpha", "beta")]
            return np.stack(pair, axis=-1)

        return edge("inner"), edge("outer")


def _wanted(
    crossings: int, samples: tuple[str, int, float, float], asked: dict[str, bool]
) -> dict[str, Any]:
    """A request of the compiled half; what no point has is not integrated."""
    has_points = crossings > 0 or samples[1] > 0
    names = ("momentum", "weight", "errors")
    more = {name: bool(asked.get(name, False)) for name in names}
    return {
        "crossings": int(crossings),
        "samples": samples,
        "azimuth": has_points,
        "time": has_points,
        **more,
    }
