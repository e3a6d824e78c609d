"""Rays with the arguments and the arrays of `kgeo <https://github.com/achael/kgeo>`_.

Scripts that trace with kgeo change one import::

    from kerrlight.compat.kgeo import raytrace_ana   # was: from kgeo import raytrace_ana

What differs: ``plotdata`` and ``savedata`` are refused and nothing is printed; every spin in [-1, 1] and every
inclination is traced, those on the axis and in the equatorial plane included; and a ray within 1e-10 of the
critical curve is traced, not undefined.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, Sequence

import numpy as np
from numpy.typing import ArrayLike

from kerrlight import _core
from kerrlight._arrays import Floats, column, flat, radians, together, whole
from kerrlight.rays import MOST_CROSSINGS, Kerr, Observer

__all__ = ["Geodesics", "r_equatorial", "raytrace_ana", "rho_of_req", "u_kep"]

SPIN = 0.94
INC = 20 * np.pi / 180.0
ROUT = 100000.0
NGEO = 250
NPIX = 1000
MAXTAUFRAC = 1.0 - 1e-10


class Geodesics:
    """Rays as kgeo holds them: arrays of shape (ngeo, npix), from the observer backward in time.

    Times and affine parameters are 0 at the observer and negative behind; azimuths are 0 at the observer.
    """

    def __init__(
        self,
        a: float,
        observer_coords: Sequence[float],
        image_coords: Sequence[Floats],
        mino_times: Floats,
        geo_coords: list[Floats],
        maxtaufrac: float = MAXTAUFRAC,
    ) -> None:
        self.a = a
        self.observer_coords = list(observer_coords)
        self.image_coords = list(image_coords)
        self.mino_times = mino_times
        self.geo_coords = geo_coords
        self.maxtaufrac = maxtaufrac

    @cached_property
    def affine_times(self) -> Floats:
        """-∫Σ dτ (M), computed on first access."""
        place = (float(self.th_o), False, float(self.r_o), 0.0)
        ngeo = self.mino_times.shape[0]
        screen = (self.alpha, self.beta)
        lengths = _core.path_lengths(self.a, place, screen, (ngeo, self._part))
        return -lengths.reshape(self.npix, ngeo).T

    @property
    def _part(self) -> float:
        return 1.0 if self.maxtaufrac >= MAXTAUFRAC else self.maxtaufrac

    @property
    def t_o(self) -> float:
        """Time of the observation (M)."""
        return self.observer_coords[0]

    @property
    def r_o(self) -> float:
        """Radius of the observer (M)."""
        return self.observer_coords[1]

    @property
    def th_o(self) -> float:
        """Inclination (radians)."""
        return self.observer_coords[2]

    @property
    def ph_o(self) -> float:
        """Azimuth of the observer (radians)."""
        return self.observer_coords[3]

    @property
    def alpha(self) -> Floats:
        """Horizontal screen coordinates (M)."""
        return self.image_coords[0]

    @property
    def beta(self) -> Floats:
        """Vertical screen coordinates (M)."""
        return self.image_coords[1]

    @property
    def npix(self) -> int:
        """Number of rays."""
        return len(self.alpha)

    @property
    def lam(self) -> Floats:
        """λ = L/E (M)."""
        return -self.alpha * np.sin(self.th_o)

    @property
    def eta(self) -> Floats:
        """η = Q/E² (M²)."""
        return (self.alpha**2 - self.a**2) * np.cos(self.th_o) ** 2 + self.beta**2

    @property
    def tausteps(self) -> Floats:
        """Mino times, growing backward (1/M)."""
        return self.mino_times

    @property
    def tautot(self) -> Floats:
        """Mino time of each whole ray (1/M)."""
        return self.mino_times[-1] / self._part

    @property
    def affinesteps(self) -> Floats:
        """The same as :attr:`affine_times`."""
        return self.affine_times

    @property
    def sig_s(self) -> Floats:
        """The same as :attr:`affine_times`."""
        return self.affine_times

    @property
    def t_s(self) -> Floats:
        """Times (M)."""
        return self.geo_coords[0]

    @property
    def r_s(self) -> Floats:
        """Radii (M)."""
        return self.geo_coords[1]

    @property
    def th_s(self) -> Floats:
        """Polar angles (radians)."""
        return self.geo_coords[2]

    @property
    def ph_s(self) -> Floats:
        """Azimuths (radians)."""
        return self.geo_coords[3]

    def get_dataset(self, num_alpha: int, num_beta: int, E: float = 1.0, M: float = 1.0) -> Any:
        """The rays of a screen as the ``xarray.Dataset`` that BH-NeRF computes with.

        The screen is one of ``num_alpha`` × ``num_beta`` rays in the order of
        ``np.meshgrid(alpha, beta, indexing="ij")``; dimensions are beta, alpha and geo, as kgeo has them. Needs xarray.
        """
        import xarray as xr

        shape = (num_alpha, num_beta)
        if self.npix != num_alpha * num_beta:
            raise ValueError(f"{self.npix} rays are no screen of {num_alpha} x {num_beta}")

        def grid(column: Floats) -> Any:
            return (("beta", "alpha", "geo"), column.T.reshape(*shape, -1).transpose(1, 0, 2))

        t, r, theta, phi = self.geo_coords
        a = self.a
        delta = r**2 - 2.0 * M * r + a**2
        sigma = r**2 + a**2 * np.cos(theta) ** 2
        lam, eta = self.lam, self.eta
        with np.errstate(divide="ignore", invalid="ignore"):
            polar = eta + a**2 * np.cos(theta) ** 2 - (lam / np.tan(theta)) ** 2
            radial = (r**2 + a**2 - a * lam) ** 2 - delta * (eta + (lam - a) ** 2)
        xi = (r**2 + a**2) ** 2 - a**2 * delta * np.sin(theta) ** 2
        columns = {
            "t": t,
            "r": r,
            "theta": theta,
            "phi": phi,
            "x": r * np.sin(theta) * np.cos(phi),
            "y": r * np.sin(theta) * np.sin(phi),
            "z": r * np.cos(theta),
            "mino": self.mino_times,
            "dtau": np.diff(self.mino_times, axis=0, prepend=0.0),
            "affine": self.affine_times,
            "Delta": delta,
            "Sigma": sigma,
            "Xi": xi,
            "R": radial,
            "Theta": polar,
            "omega": 2.0 * M * a * r / xi,
        }
        screen = {name: (("beta", "alpha"), v.reshape(shape).T) for name, v in (("lam", lam), ("eta", eta))}
        scalars = {"spin": a, "inc": self.th_o, "r_o": self.r_o, "E": E, "M": M}
        axes = {
            "alpha": self.alpha.reshape(shape)[:, 0],
            "beta": self.beta.reshape(shape)[0, :],
            "geo": np.arange(len(r)),
        }
        variables = {name: grid(column) for name, column in columns.items()}
        return xr.Dataset({**variables, **screen, **scalars}, coords=axes)


def raytrace_ana(
    a: float = SPIN,
    observer_coords: Sequence[float] = (0, ROUT, INC, 0),
    image_coords: Sequence[ArrayLike] | None = None,
    ngeo: int = NGEO,
    do_phi_and_t: bool = True,
    savedata: bool = False,
    plotdata: bool = False,
    verbose: bool = False,
    maxtaufrac: float = MAXTAUFRAC,
) -> Geodesics:
    """Traces rays at ``ngeo`` points equidistant in Mino time.

    :param a: spin.
    :param observer_coords: time, radius (M, above 2), inclination (radians) and azimuth of the observer, of which time
        and azimuth do not matter.
    :param image_coords: α and β of the rays (M), flat arrays of the same length.
    :param ngeo: points of a ray, from the observer to the horizon or back at the observer's radius.
    :param do_phi_and_t: whether azimuths and times are wanted; otherwise they are 0.
    :param savedata: not served: the arrays are there to be saved.
    :param plotdata: not served: the arrays are there to be drawn.
    :param verbose: without effect: nothing is printed.
    :param maxtaufrac: which part of a ray's Mino time its points cover, above 0 and up to 1; from 1 - 1e-10 on all of it,
        where the last point of a captured ray lies a relative 1e-8 outside the horizon.

    >>> geos = raytrace_ana(0.42, [0, 1000.0, np.pi / 3, 0], [-17.0, 0.0], ngeo=10000)
    >>> z = geos.r_s[:, 0] * np.cos(geos.th_s[:, 0])
    >>> k = int(np.argmax(z < 0))  # where it crosses the equatorial plane
    >>> bool(abs(geos.r_s[k, 0] * np.sin(geos.ph_s[k, 0]) + 16.0342) < 0.01)
    True
    """
    if savedata or plotdata:
        raise NotImplementedError("savedata and plotdata are not served: save or draw the arrays")
    if not 0.0 < maxtaufrac <= 1.0:
        raise ValueError(f"maxtaufrac = {maxtaufrac} is not allowed: above 0, up to 1")
    if image_coords is None:
        image_coords = (np.linspace(-6.0, 6.0, NPIX), np.zeros(NPIX))
    alpha, beta = _screen(image_coords)
    observer = _observer(a, observer_coords)
    ngeo = whole("ngeo", ngeo, 1, 10**6)
    if maxtaufrac < MAXTAUFRAC:
        spacing = (ngeo, float(maxtaufrac))
        rows = _core.path_points(observer.hole.spin, observer._place, (alpha, beta), spacing)
        mino, r, theta, phi, delay = np.moveaxis(rows.reshape(len(alpha), ngeo, 5), -1, 0)
    else:
        points = observer.trace(
            alpha, beta, crossings=0, samples=ngeo, integrator="elliptic", tolerance=1e-10
        ).samples
        mino, r, theta, phi, delay = points.mino, points.r, points.theta, points.phi, points.delay
    if do_phi_and_t:
        np.negative(delay, out=delay)
    else:
        phi = delay = np.zeros_like(r)
    coords = [delay.T, r.T, theta.T, phi.T]
    return Geodesics(observer.hole.spin, observer_coords, [alpha, beta], mino.T, coords, maxtaufrac)


def _screen(image_coords: Sequence[ArrayLike]) -> tuple[Floats, Floats]:
    """α and β as flat arrays of one length."""
    if len(image_coords) != 2:
        raise ValueError(f"image_coords has {len(image_coords)} arrays: alpha and beta are needed")
    alpha, beta = (column(name, value) for name, value in zip(("alpha", "beta"), image_coords))
    _, (alpha, beta) = together(alpha=alpha, beta=beta)
    return alpha, beta


def _observer(a: float, observer_coords: Sequence[float]) -> Observer:
    if len(observer_coords) != 4:
        raise ValueError(f"observer_coords has {len(observer_coords)} numbers: time, radius, inclination and azimuth")
    return Kerr(a).observer(inclination_rad=observer_coords[2], radius=observer_coords[1])


def r_equatorial(
    a: float, r_o: float, th_o: float, mbar: int, alpha: ArrayLike, beta: ArrayLike
) -> tuple[Floats, Floats, Floats, Floats]:
    """Crossings of the equatorial plane for the time number ``mbar``, counted from 0 backward from the observer.

    Returns the radius there (M; 0 without such a crossing), the Mino time to there (1/M; NaN without), that of the
    whole ray, and the number of the last crossing, -1 without any; arrays with the shape of ``alpha`` and ``beta`` (M).

    :param r_o: radius of the observer (M), above 2 or infinite.
    :param th_o: inclination (radians).

    >>> radius, mino, total, last = r_equatorial(0.94, 1e4, 0.3, 0, [6.0, 0.5], [1.0, 0.5])
    >>> bool(abs(radius[0] - 4.919) < 0.001), last.tolist()
    (True, [1.0, -1.0])
    """
    mbar = whole("mbar", mbar, 0, MOST_CROSSINGS - 1)
    rays = Kerr(a).observer(inclination_rad=th_o, radius=r_o).trace(
        alpha, beta, crossings=mbar + 1, integrator="elliptic", tolerance=1e-10
    )
    radius, mino = (values[..., mbar] for values in (rays.crossings.r, rays.crossings.mino))
    last = rays.crossing_count.astype(np.float64) - 1.0
    return np.where(np.isnan(radius), 0.0, radius), mino, rays.mino_total, last


def rho_of_req(
    a: float, th0: float, req: float, mbar: int = 0, varphis: ArrayLike | None = None
) -> tuple[Floats, Floats, Floats, Floats]:
    """The image of order ``mbar`` of the ring r = ``req`` (M) of the equatorial plane, for an observer at infinity.

    Returns the directions on the screen (radians; by default a degree apart from -180°), the distances from its centre
    (M), and the points (alpha, beta). NaN where the image has no point, or the centre lies outside of it.

    :param th0: inclination (radians).
    :param req: radius (M), from the horizon on, whose image is the edge of the inner shadow.

    >>> angles, rho, alpha, beta = rho_of_req(0.9, 0.3, 6.0, varphis=[0.0, 1.0])
    >>> bool(np.allclose(r_equatorial(0.9, np.inf, 0.3, 0, alpha, beta)[0], 6.0))
    True
    """
    mbar = whole("mbar", mbar, 0, MOST_CROSSINGS - 1)
    observer = Kerr(a).observer(inclination_rad=th0)
    if not observer.hole.horizon <= req < np.inf:
        raise ValueError(f"req = {req} is not allowed: {observer.hole.horizon} (the horizon) or above (M)")
    degrees = np.arange(-180.0, 180.0)
    angles = radians("varphis", np.radians(degrees) if varphis is None else column("varphis", varphis))
    cos, sin = np.cos(angles), np.sin(angles)
    curve = observer.critical_curve(angles=angles)
    critical = np.hypot(curve.alpha, curve.beta)

    def is_beyond(rho: Floats) -> Any:
        rays = observer.trace(
            rho * cos, rho * sin, crossings=mbar + 1, integrator="elliptic", tolerance=1e-10
        )
        radius = rays.crossings.r[..., mbar]
        return np.where(np.isnan(radius), rho > critical, radius > req)

    low, high = np.zeros_like(angles), critical + req + 10.0
    found = is_beyond(high) & ~is_beyond(low)
    for _ in range(60):
        middle = 0.5 * (low + high)
        beyond = is_beyond(middle)
        low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
    rho = np.where(found, 0.5 * (low + high), np.nan)
    return angles, rho, rho * cos, rho * sin


def u_kep(
    a: float, r: ArrayLike, retrograde: bool = False
) -> tuple[Floats, Floats, int, Floats]:
    """Boyer–Lindquist components (uᵗ, uʳ, u^θ, u^φ) of matter on circular orbits in the equatorial plane, which plunges
    inside of the innermost stable one with the energy and angular momentum that it had there (Cunningham 1975).

    ``r`` are radii (M); NaN at and inside the horizon. Matter turns with the hole, or against it if ``retrograde``.

    >>> time, inward, _, turn = u_kep(0.0, [6.0, 3.0])
    >>> print(f"{time[0]:.6f} {inward[1]:.6f}")
    1.414214 -0.333333
    """
    hole = Kerr(a)
    radius = column("r", r)
    spin = abs(hole.spin) * (-1.0 if retrograde else 1.0)
    sense = (-1.0 if hole.spin < 0.0 else 1.0) * (-1.0 if retrograde else 1.0)
    time, inward, _, turn = _core.velocity(spin, flat(radius)).reshape(-1, 4).T
    return time, inward, 0, sense * turn
