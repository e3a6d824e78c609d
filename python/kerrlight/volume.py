"""Emission on the nodes of a box, as fits and posteriors write it."""

from __future__ import annotations

import math
from os import PathLike
from typing import Any, Union

import numpy as np
from numpy.typing import NDArray

from kerrlight import _core
from kerrlight._arrays import Floats, degrees, flat, whole

__all__ = ["Volume"]


class Volume:
    """Emission on the nodes of a box."""

    def __init__(self, path: Union[str, PathLike[str]]) -> None:
        with np.load(path) as arrays:
            self.emission: NDArray[np.float32] = arrays["emission"]
            """Over (x, y, z)."""
            self.low: Floats = arrays["low"]
            """Coordinates of the first node (M)."""
            self.high: Floats = arrays["high"]
            """Coordinates of the last node (M)."""
            if self.emission.ndim != 3 or self.low.shape != (3,) or self.high.shape != (3,):
                shapes = [self.emission.shape, self.low.shape, self.high.shape]
                raise ValueError(f"{path}: emission, low and high have the shapes {shapes}, not (x, y, z), (3,) and (3,)")
            self.axis: Floats | None = arrays["axis"] if "axis" in arrays else None
            """Axis of the rotation, where the file tells."""

    def _nodes(self, k: int) -> Floats:
        return np.linspace(self.low[k], self.high[k], self.emission.shape[k])

    @property
    def x(self) -> Floats:
        """Coordinates of the nodes along x (M)."""
        return self._nodes(0)

    @property
    def y(self) -> Floats:
        """Coordinates of the nodes along y (M)."""
        return self._nodes(1)

    @property
    def z(self) -> Floats:
        """Coordinates of the nodes along z (M)."""
        return self._nodes(2)

    def to_xarray(self) -> Any:
        """Returns an ``xarray.DataArray`` with coordinates; needs xarray."""
        import xarray

        coordinates = {name: (name, getattr(self, name), {"units": "M"}) for name in "xyz"}
        attributes: dict[str, Any] = {"long_name": "emission"}
        if self.axis is not None:
            attributes["axis"] = self.axis.tolist()
        return xarray.DataArray(
            self.emission, coords=coordinates, dims=("x", "y", "z"), name="emission", attrs=attributes
        )

    def view(
        self,
        azimuth_deg: float = 0.0,
        elevation_deg: float = 20.0,
        *,
        pixels: int = 256,
        width: float | None = None,
        hole_radius: float = 0.0,
    ) -> NDArray[np.float32]:
        """A drawing in flat space, without lensing, delay or Doppler shift: ∫ e ds along parallel rays, rows from the
        top, in the unit of the emission times M.

        :param azimuth_deg: direction to the viewer around +z from +x.
        :param elevation_deg: the same above the plane z = 0.
        :param pixels: rows and columns.
        :param width: of the picture (M), whose centre is the origin; by default twice the largest coordinate of the box.
        :param hole_radius: radius (M) of a ball about the origin that hides what is behind it.
        """
        pixels = whole("pixels", pixels, 1, 8192)
        azimuth_deg = degrees("azimuth_deg", azimuth_deg)
        elevation_deg = degrees("elevation_deg", elevation_deg)
        farthest = np.abs([self.low, self.high]).max()
        side = 2.0 * float(farthest) if width is None else float(width)
        if not (side > 0 and math.isfinite(side)):
            raise ValueError(f"width = {width} is not allowed: above 0 (M)")
        numbers = (float(azimuth_deg), float(elevation_deg), float(hole_radius))
        if not all(map(math.isfinite, numbers)):
            raise ValueError(f"azimuth_deg, elevation_deg, hole_radius = {numbers} is not allowed: finite numbers")
        corners = (list(self.emission.shape), self.low.tolist(), self.high.tolist())
        emission = flat(np.asarray(self.emission, dtype=np.float32))
        image = _core.view(corners, emission, numbers[:2], (side, numbers[2]), int(pixels))
        return image.reshape(pixels, pixels)

    def __repr__(self) -> str:
        shape = " x ".join(map(str, self.emission.shape))
        return f"<Volume of {shape} nodes from {self.low.tolist()} to {self.high.tolist()} M>"
