"""The forward model of a fit as a linear map on arrays: from emission to images, and back.

Light of an optically thin medium adds up along rays: a pixel is Σ weight · emission over the nodes of its ray. A
:class:`ForwardModel` has the nodes, where their matter was at the reference time, and the map with its adjoint, for
networks and optimisers of your own (:mod:`kerrlight.torch`, :mod:`kerrlight.jax`).
"""

from __future__ import annotations

import copy
import json
import math
from functools import cached_property
from typing import Any, Sequence

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from kerrlight import _core
from kerrlight._arrays import Floats, finite, flat, given, real, together, whole
from kerrlight.flow import Keplerian, Law, PolarizationLaw, Velocity
from kerrlight.rays import Observer

__all__ = [
    "ForwardModel",
    "VoxelModel",
    "screen",
]


def screen(pixels: int, width: float) -> tuple[Floats, Floats]:
    """(α, β) of the pixels of a square screen, rows from the top, each from the left; ``width`` (M) is that of the
    pixels' outer edges.

    >>> alpha, beta = screen(4, 8.0)
    >>> alpha[0].tolist(), beta[:, 0].tolist()
    ([-3.0, -1.0, 1.0, 3.0], [3.0, 1.0, -1.0, -3.0])
    """
    pixels = whole("pixels", pixels, 1, 16384)
    if not (width > 0 and math.isfinite(width)):
        raise ValueError(f"width = {width} is not allowed: above 0 (M)")
    at = (np.arange(pixels) - 0.5 * (pixels - 1)) * (width / pixels)
    alpha, beta = np.meshgrid(at, -at)
    return alpha, beta


def precision(name: str, value: Any, shape: tuple[int, ...]) -> NDArray[Any]:
    """``value`` as a contiguous column in single precision if it is in single precision, else in double."""
    array = given(name, value)
    if array.dtype != np.float32:
        array = real(name, array)
    if array.shape != shape:
        raise ValueError(f"{name} has the shape {array.shape}, not {shape}")
    return flat(array)


class _Linear:
    """A linear map of arrays with its adjoint."""

    input_shape: tuple[int, ...]
    """Shape of what it takes."""
    output_shape: tuple[int, ...]
    """Shape of what it gives."""

    _made: tuple[Any, ...]
    """Keyword arguments of its compiled half."""

    def __copy__(self) -> Any:
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__)
        return other

    def __deepcopy__(self, memo: Any) -> Any:
        # Its compiled half does not change.
        other = self.__copy__()
        kept = {key: value for key, value in self.__dict__.items() if key not in ("_core", "_made")}
        other.__dict__.update(copy.deepcopy(kept, memo))
        return other

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in self.__dict__.items() if key not in ("_core", "_columns")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        if "_made" in state:
            self._core = self._again(*state["_made"])

    @staticmethod
    def _again(*made: Any) -> Any:
        raise NotImplementedError

    def apply(self, values: ArrayLike) -> NDArray[Any]:
        """The map."""
        raise NotImplementedError

    def vjp(self, cotangent: ArrayLike) -> NDArray[Any]:
        """The adjoint."""
        raise NotImplementedError


class ForwardModel(_Linear):
    """Map from emission on the nodes of rays to a movie.

    :param observer: who sees which hole.
    :param alpha: screen coordinates of the pixels (M), as of :func:`screen`; their shape is that of an image.
    :param beta: as ``alpha``.
    :param r_min: least radius of the region that may shine (M).
    :param r_max: its largest radius (M).
    :param z_width: its largest |z| (M).
    :param order: nodes of a Gauss–Legendre panel, 1 to 16; weights are those of the integral over the affine parameter.
    :param split: into how many panels each of the coarsest ones is cut.
    :param per_ray: nodes equidistant in Mino time instead, with BH-NeRF's weights |x_i - x_{i-1}|; for observers at a
        finite radius.
    :param times: times of the frames (M): those of arrival, less r_o + 2 ln r_o of an observer at a finite radius r_o.
        Without ``slow_light`` those of emission.
    :param reference_time: time of the field of emission (M), on the clock of ``times``; matter turns from there to each
        frame.
    :param velocity: how matter moves: :class:`Keplerian`, :class:`PowerLaw`, :class:`Tabulated`, :class:`Infall` or
        :class:`Profile`.
    :param axis: what it turns about, right-handed.
    :param injection_time: when it begins to shine (M), on the clock of ``times``; always, without one.
    :param slow_light: whether light takes its time.
    :param redshift_power: emission goes like g to this power; without it there is no redshift.
    :param scale: flux of a pixel with an integral of 1.
    :param polarization: the gas's field and law of light; images are then of the parameters in ``stokes``, with the
        electric vector's angle counted from +β towards −α (from north to east, if the spin points north).
    :param stokes: which parameters, with ``polarization``: some of the letters of ``"IQU"``, all by default.

    A pixel is the light of the ray through its centre. Photon rings are thinner than coarse pixels: use many pixels, or
    regions and orders without them, where their light matters.

    >>> from kerrlight import Kerr
    >>> observer = Kerr(0.0).observer(inclination_deg=60)
    >>> model = ForwardModel(observer, *screen(16, 20.0), r_min=3.0, r_max=9.0, times=[0.0, 20.0])
    >>> x, y, z = np.moveaxis(model.coordinates(), -1, 0)
    >>> emission = np.exp(-0.5 * ((x - 6) ** 2 + y**2 + z**2))
    >>> movie = model.apply(emission)
    >>> movie.shape == model.output_shape == (2, 16, 16)
    True
    >>> back = model.vjp(movie)  # the adjoint: <A e, m> = <e, A* m>
    >>> bool(abs((movie**2).sum() / (emission * back).sum() - 1) < 1e-12)
    True
    """

    def __init__(
        self,
        observer: Observer,
        alpha: ArrayLike,
        beta: ArrayLike,
        *,
        r_min: float,
        r_max: float,
        z_width: float = math.inf,
        order: int = 8,
        split: int = 1,
        per_ray: int | None = None,
        times: ArrayLike = 0.0,
        reference_time: float = 0.0,
        velocity: Velocity = Keplerian(),
        axis: ArrayLike = (0.0, 0.0, 1.0),
        injection_time: float | None = None,
        slow_light: bool = False,
        redshift_power: float | None = None,
        scale: float = 1.0,
        polarization: PolarizationLaw | None = None,
        stokes: str | None = None,
    ) -> None:
        self.image_shape, columns = together(alpha=alpha, beta=beta)
        self.times = np.atleast_1d(finite("times", times)).copy()
        if self.times.ndim != 1 or self.times.size == 0:
            raise ValueError(f"times have the shape {self.times.shape}: give a list of one or more")
        if not isinstance(velocity, Law):
            allowed = "Keplerian, PowerLaw, Tabulated, Infall or Profile"
            raise TypeError(f"velocity = {velocity!r} is not allowed: {allowed}")
        direction = finite("axis", axis)
        if direction.shape != (3,):
            raise ValueError(f"axis has the shape {direction.shape}, not (3,)")
        order, split = whole("order", order, 1, 16), whole("split", split, 1, 4096)
        if per_ray is not None:
            per_ray = whole("per_ray", per_ray, 1, 10**6)
            if not math.isfinite(observer.radius):
                raise ValueError("per_ray needs an observer at a finite radius: hole.observer(…, radius=1000)")
        if not math.isfinite(scale):
            raise ValueError(f"scale = {scale} is not allowed: a finite number")
        if stokes is not None and polarization is None:
            raise ValueError(f'stokes = "{stokes}" needs polarization: a PolarizationLaw')
        stokes = "IQU" if stokes is None else stokes
        if not stokes or len(set(stokes)) < len(stokes):
            raise ValueError(f'stokes = "{stokes}" is not allowed: some of the letters of "IQU", each once')
        self.stokes = stokes if polarization is not None else ""
        """The Stokes parameters of its images, in order; empty without ``polarization``."""
        settings = {
            "region": (float(r_min), float(r_max), float(z_width)),
            "order": int(order),
            "split": int(split),
            "per_ray": per_ray,
            "slow_light": bool(slow_light),
            "redshift_power": redshift_power,
            "velocity": json.dumps(velocity.table()),
            "axis": direction.tolist(),
            "times": self.times.tolist(),
            "reference": float(reference_time),
            "injection": injection_time,
            "scale": float(scale),
            "polarization": (polarization._json(), list(stokes)) if polarization else None,
        }
        screen = (columns[0].copy(), columns[1].copy())
        self._made = (observer.hole.spin, observer._place, screen, settings)
        self._core = self._again(*self._made)
        self._frames = list(range(len(self.times)))

    _again = _core.Model

    @property
    def nodes(self) -> int:
        """Number of nodes of all rays."""
        return self._core.sizes()[1]

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self._frames)

    @property
    def input_shape(self) -> tuple[int, ...]:  # type: ignore[override]
        """(frames, nodes)."""
        return (self.frames, self.nodes)

    @property
    def output_shape(self) -> tuple[int, ...]:  # type: ignore[override]
        """(frames, ...) with the shape of an image; (frames, parameters, ...) with ``polarization``."""
        planes = (len(self.stokes),) if self.stokes else ()
        return (self.frames, *planes, *self.image_shape)

    @property
    def factors(self) -> Floats:
        """Factors of weights for each Stokes parameter, shape (parameters, nodes)."""
        return self._core.factors().reshape(-1, self.nodes)

    @cached_property
    def _columns(self) -> dict[str, Any]:
        return self._core.columns()

    @property
    def positions(self) -> Floats:
        """Points where light is emitted: x, y and z of each node (M), shape (nodes, 3)."""
        return self._columns["position"].reshape(-1, 3)

    @property
    def weights(self) -> Floats:
        """Weight of the emission of each node in its pixel."""
        return self._columns["weight"]

    @property
    def pixels(self) -> NDArray[np.uint32]:
        """The pixel of each node, counted row by row."""
        return self._columns["pixel"]

    @property
    def delays(self) -> Floats:
        """Time of flight of the light of each node (M), less r_o + 2 ln r_o of an observer at a finite radius r_o: so long
        before the frame's time it left. 0 without ``slow_light``."""
        delay: Floats = self._columns["delay"]
        return delay if len(delay) else np.zeros(self.nodes)

    def coordinates(self, dtype: DTypeLike = np.float64) -> NDArray[Any]:
        """Places of the matter of every node at the reference time: x, y and z (M), shape (frames, nodes, 3).

        A field of emission is evaluated here. ``dtype`` is float64 or float32.
        """
        kind = np.dtype(dtype)
        if kind not in (np.dtype(np.float64), np.dtype(np.float32)):
            raise TypeError(f"dtype = {kind} is not allowed: float64 or float32")
        places = self._core.coordinates(self._frames, kind == np.dtype(np.float32))
        return places.reshape(self.frames, self.nodes, 3)

    def at(self, frames: ArrayLike | slice) -> ForwardModel:
        """The same model with some of its frames alone, for a step of training; nothing is traced or copied.

        ``frames`` are numbers of frames, a slice or a mask.
        """
        chosen = self._chosen(frames)
        part = object.__new__(ForwardModel)
        part.__dict__.update({k: v for k, v in self.__dict__.items() if k != "_columns"})
        part._frames = [self._frames[frame] for frame in chosen]
        part.times = self.times[chosen]
        return part

    def _chosen(self, frames: Any) -> list[int]:
        if isinstance(frames, slice):
            return list(range(self.frames))[frames]
        array = np.atleast_1d(np.asarray(frames))
        if array.dtype == bool and array.shape == (self.frames,):
            return np.flatnonzero(array).tolist()
        if array.dtype.kind not in "iu" or array.ndim != 1 or array.size == 0:
            raise TypeError(f"frames = {frames!r} is not allowed: numbers of frames, a slice, or a mask of {self.frames}")
        if not ((-self.frames <= array) & (array < self.frames)).all():
            raise IndexError(f"frames = {array.tolist()} is not allowed: there are {self.frames}")
        return array.tolist()

    def apply(self, values: ArrayLike) -> NDArray[Any]:
        """The movie of emission on the nodes: (frames, nodes) to (frames, ...), in the precision of the emission."""
        emission = precision("emission", values, self.input_shape)
        return self._core.apply(emission, self._frames).reshape(self.output_shape)

    def vjp(self, cotangent: ArrayLike) -> NDArray[Any]:
        """The adjoint of :meth:`apply`: from the gradient with respect to the movie to that of the emission."""
        movie = precision("cotangent", cotangent, self.output_shape)
        return self._core.vjp(movie, self._frames).reshape(self.input_shape)

    def voxels(
        self, shape: int | Sequence[int], low: ArrayLike, high: ArrayLike | None = None
    ) -> VoxelModel:
        """The model for emission on voxels: ``shape`` nodes along x, y and z from ``low`` to ``high`` (M).

        A single number stands for all three axes, and without ``high`` the box is [-low, low]³.
        """
        nodes = [whole("shape", n, 2, 4096) for n in np.broadcast_to(np.asarray(shape), 3)]
        first = np.broadcast_to(real("low", low), 3)
        if high is None:
            if not (first > 0).all():
                raise ValueError(f"low = {first.tolist()} is not allowed without high: half the sides of a box, above 0")
            return VoxelModel(self, nodes, (-first).tolist(), first.tolist())
        last = np.broadcast_to(real("high", high), 3)
        return VoxelModel(self, nodes, first.tolist(), last.tolist())

    def __repr__(self) -> str:
        return f"<ForwardModel: {self.frames} frames of shape {self.image_shape}, {self.nodes} nodes>"


class VoxelModel(_Linear):
    """Map from emission on voxels, linear in between and dark outside, to a movie; made by :meth:`ForwardModel.voxels`.

    >>> from kerrlight import Kerr
    >>> observer = Kerr(0.5).observer(inclination_deg=30)
    >>> model = ForwardModel(observer, *screen(12, 20.0), r_min=3.0, r_max=8.0, times=[0.0, 10.0])
    >>> voxels = model.voxels(20, 8.0)
    >>> movie = voxels.apply(np.ones((20, 20, 20)))
    >>> bool(np.allclose(movie, model.apply(np.ones(model.input_shape))))
    True
    """

    def __init__(
        self, model: ForwardModel, nodes: list[int], low: list[float], high: list[float]
    ) -> None:
        _core.check_voxels((nodes, low, high))
        self.model = model
        self.input_shape = tuple(nodes)
        self.output_shape = model.output_shape
        self.low, self.high = low, high

    @property
    def _voxels(self) -> tuple[list[int], list[float], list[float]]:
        return (list(self.input_shape), self.low, self.high)

    def apply(self, values: ArrayLike) -> NDArray[Any]:
        """The movie of emission on voxels, an array over (x, y, z)."""
        volume = precision("volume", values, self.input_shape)
        movie = self.model._core.apply_voxels(self._voxels, volume, self.model._frames)
        return movie.reshape(self.output_shape)

    def vjp(self, cotangent: ArrayLike) -> NDArray[Any]:
        """The adjoint of :meth:`apply`."""
        movie = precision("cotangent", cotangent, self.output_shape)
        volume = self.model._core.vjp_voxels(self._voxels, movie, self.model._frames)
        return volume.reshape(self.input_shape)
