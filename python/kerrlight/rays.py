"""Null geodesics of the Kerr spacetime, traced backward from an observer's screen.

A :class:`Kerr` hole has observers, an :class:`Observer` traces rays, and :class:`Rays` is a table of arrays with the
shape of the screen coordinates that were given.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike

from kerrlight import _core
from kerrlight._arrays import Floats, degrees, flat, radians, together, whole
from kerrlight.table import Outcome, Points, Rays

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


MOST_CROSSINGS = 1000
"""The most crossings that can be asked for."""

Placement = Union[int, MinoTime, PathLength, GaussLegendre]


def _placement(samples: Placement) -> tuple[tuple[str, int, float, float], int]:
    """A placement for the compiled half, and the most samples of a ray."""
    if isinstance(samples, MinoTime):
        samples = samples.points
    if isinstance(samples, PathLength):
        points = whole("points", samples.points, 1, 10**9)
        return ("path-length", points, 0.0, float(samples.radius)), points
    if isinstance(samples, GaussLegendre):
        points = whole("points", samples.points, 1, 10**9)
        return ("gauss-legendre", points, float(samples.start), float(samples.stop)), 2 * points
    points = whole("samples", samples, 0, 10**9)
    return ("mino-time" if points else "none", points, 0.0, 0.0), points


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
        if isinstance(self.spin, (str, bytes)):
            raise TypeError(f"spin = {self.spin!r} is not allowed: a number in [-1, 1]")
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

    def keplerian_redshift(
        self, r: ArrayLike, lam: ArrayLike, p_r: ArrayLike | None = None
    ) -> Floats:
        """Redshift factor g = E(observed)/E(emitted) of matter in the equatorial plane that turns about +z.

        :param r: radius (M).
        :param lam: the photon's L/E (M).
        :param p_r: the photon's covariant radial momentum for unit energy at infinity,
            ``rays.crossings.momentum[..., 1]``. With it matter inside of the innermost stable orbit plunges, with the
            energy and angular momentum that it had there (Cunningham 1975). Without it all matter is on circular
            orbits, stable or not, down to the photon orbit: a warning says where these are not stable.

        The arguments broadcast. NaN where there is no such orbit, at and inside the horizon.

        >>> float(Kerr(0.0).keplerian_redshift(6.0, 0.0).round(12)) == round(0.5**0.5, 12)
        True
        """
        if p_r is None:
            shape, (radius, moment) = together(r=r, lam=lam)
            if ((radius > self.horizon) & (radius < self.isco)).any():
                words = f"r lies inside of the innermost stable orbit at {self.isco:.6g} M, where matter plunges"
                warnings.warn(f"{words}: give p_r, or leave these radii out", stacklevel=2)
            return _core.keplerian_redshift(self.spin, radius, moment).reshape(shape)
        shape, (radius, moment, radial) = together(r=r, lam=lam, p_r=p_r)
        time, inward, _, turn = _core.velocity(self.spin, radius).reshape(-1, 4).T
        return np.asarray(1.0 / (time - moment * turn - radial * inward)).reshape(shape)

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
        90 and 180 are exact) or in radians. ``radius`` is infinite or in (2, 1e30] (M); ``azimuth`` is in radians. Angles
        that look as if they were in the other unit, such as ``inclination_deg=np.pi / 3``, give a warning.
        """
        if (inclination_deg is None) == (inclination_rad is None):
            raise ValueError("give inclination_deg or inclination_rad, one of them")
        turned = float(radians("azimuth", azimuth))
        if inclination_deg is not None:
            angle = degrees("inclination_deg", inclination_deg)
            return Observer(self, angle, True, float(radius), turned)
        assert inclination_rad is not None
        return Observer(self, float(inclination_rad), False, float(radius), turned)


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
        crossings = whole("crossings", crossings, 0, MOST_CROSSINGS)
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
        column = radians("angles", angles)
        columns = _core.critical_points(self.hole.spin, self._place, flat(column))
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
        column = radians("angles", angles)
        edges = _core.band(self.hole.spin, self._place, order, flat(column))

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
