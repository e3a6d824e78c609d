"""Rays with the arguments and the arrays of `kgeo <https://github.com/achael/kgeo>`_.

Scripts that trace with kgeo change one import::

    from kerrlight.compat.kgeo import raytrace_ana   # was: from kgeo import raytrace_ana

What differs: ``plotdata`` is off by default and nothing is printed; nothing is drawn or saved; every spin in [-1, 1]
and every inclination is traced, those on the axis and in the equatorial plane included; and a ray within 1e-10 of the
critical curve is traced, not undefined.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, Sequence

import numpy as np
from numpy.typing import ArrayLike

from kerrlight import _core
from kerrlight._arrays import Floats, real, together
from kerrlight.rays import Kerr

__all__ = ["Geodesics", "raytrace_ana"]

SPIN = 0.94
INC = 20 * np.pi / 180.0
ROUT = 100000.0
NGEO = 250
NPIX = 1000


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
    ) -> None:
        self.a = a
        self.observer_coords = list(observer_coords)
        self.image_coords = list(image_coords)
        self.mino_times = mino_times
        self.geo_coords = geo_coords

    @cached_property
    def affine_times(self) -> Floats:
        """-∫Σ dτ (M), computed on first access."""
        place = (float(self.th_o), False, float(self.r_o), 0.0)
        ngeo = self.mino_times.shape[0]
        screen = (self.alpha, self.beta)
        lengths = _core.path_lengths(self.a, place, screen, ngeo)
        return -lengths.reshape(self.npix, ngeo).T

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
        return self.mino_times[-1]

    @property
    def affinesteps(self) -> Floats:
        """As :attr:`affine_times`."""
        return self.affine_times

    @property
    def sig_s(self) -> Floats:
        """As :attr:`affine_times`."""
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
        ``np.meshgrid(alpha, beta, indexing="ij")``; dimensions are alpha, beta and geo. Needs xarray.
        """
        import xarray as xr

        shape = (num_alpha, num_beta)
        if self.npix != num_alpha * num_beta:
            raise ValueError(f"{self.npix} rays are no screen of {num_alpha} x {num_beta}")

        def grid(column: Floats) -> Any:
            return (("alpha", "beta", "geo"), column.T.reshape(*shape, -1))

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
        screen = {name: (("alpha", "beta"), v.reshape(shape)) for name, v in (("lam", lam), ("eta", eta))}
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

    >>> geos = raytrace_ana(0.42, [0, 1000.0, np.pi / 3, 0], [-17.0, 0.0], ngeo=10000)
    >>> z = geos.r_s[:, 0] * np.cos(geos.th_s[:, 0])
    >>> k = int(np.argmax(z < 0))  # where it crosses the equatorial plane
    >>> bool(abs(geos.r_s[k, 0] * np.sin(geos.ph_s[k, 0]) + 16.0342) < 0.01)
    True
    """
    if savedata or plotdata:
        raise NotImplementedError("savedata and plotdata are not served: save or draw the arrays")
    if image_coords is None:
        image_coords = (np.linspace(-6.0, 6.0, NPIX), np.zeros(NPIX))
    alpha, beta = (np.atleast_1d(real(name, v)) for name, v in zip(("alpha", "beta"), image_coords))
    _, (alpha, beta) = together(alpha=alpha, beta=beta)
    hole = Kerr(a)
    observer = hole.observer(inclination_rad=observer_coords[2], radius=observer_coords[1])
    rays = observer.trace(
        alpha, beta, crossings=0, samples=int(ngeo), integrator="elliptic", tolerance=1e-10
    )
    points = rays.samples
    nothing = np.zeros_like(points.r)
    phi, delay = (points.phi, points.delay) if do_phi_and_t else (nothing, nothing)
    coords = [-delay.T, points.r.T, points.theta.T, phi.T]
    return Geodesics(hole.spin, observer_coords, [alpha, beta], points.mino.T, coords)
