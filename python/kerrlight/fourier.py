"""Transforms from images to visibilities, and back."""

from __future__ import annotations

from typing import Any, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kerrlight import _core
from kerrlight._arrays import Floats, complexes, finite, whole
from kerrlight.model import _Linear, precision

__all__ = ["Fourier"]


class Fourier(_Linear):
    """Transform from images in Jy/pixel to visibilities, with the adjoint.

    :param shape: rows and columns of an image; rows from the north, each from the east.
    :param field_uas: width of the field (µas).
    :param uv: (u, v) in wavelengths, shape (n, 2), that see one image; or a list of such arrays, one for each image
        of a movie.
    :param pulse: shape of a pixel: ``"triangle"``, ``"rectangle"`` or ``"delta"``.
    :param accuracy: largest error in units of the flux, for a fast transform where that is quicker; without it the sum
        is exact.

    >>> import numpy as np
    >>> fourier = Fourier((5, 5), 100.0, [[1e9, 0.0], [3e9, -4e9]], pulse="delta")
    >>> image = np.zeros((5, 5))
    >>> image[2, 2] = 0.6
    >>> bool(np.allclose(fourier.apply(image), 0.6))  # a point at the centre
    True
    """

    is_complex = True
    _again = _core.Fourier

    def __init__(
        self,
        shape: tuple[int, int],
        field_uas: float,
        uv: ArrayLike | Sequence[ArrayLike],
        *,
        pulse: str = "triangle",
        accuracy: float | None = None,
    ) -> None:
        if np.shape(shape) != (2,):
            raise ValueError(f"shape = {shape} is not allowed: (rows, columns)")
        height, width = (whole("shape", n, 1, 2**31) for n in shape)
        if len(uv) == 0:  # type: ignore[arg-type]
            raise ValueError("uv is empty: at least one (u, v), or the (u, v) of one image, is needed")
        alone = isinstance(uv, np.ndarray) or np.ndim(uv[0]) == 1  # type: ignore[index]
        lists: list[Any] = [uv] if alone else list(uv)  # type: ignore[arg-type]
        frames = [finite("uv", each) for each in lists]
        for k, frame in enumerate(frames):
            if frame.size > 0 and (frame.ndim != 2 or frame.shape[1] != 2):
                name = "uv" if alone else f"uv[{k}]"
                raise ValueError(
                    f"{name} has the shape {frame.shape}, not (n, 2): a row (u, v) for every visibility; "
                    "np.column_stack([u, v]) makes it of two lists"
                )
        counts = [frame.size // 2 for frame in frames]
        flat = np.concatenate([frame.ravel() for frame in frames])
        screen = (width, height, float(field_uas))
        self._made = (screen, pulse, flat, counts, accuracy)
        self._core = self._again(*self._made)
        self.input_shape = (height, width) if alone else (len(frames), height, width)
        self.output_shape = (sum(counts),)

    def apply(self, values: ArrayLike) -> NDArray[np.complex128]:
        """Visibilities (Jy) of an image or a movie, image after image."""
        movie = precision("image", values, self.input_shape)
        return self._core.apply(movie.astype(np.float64, copy=False))

    def vjp(self, cotangent: ArrayLike) -> Floats:
        """The adjoint under the inner product Re Σ x̄ y: from dL/dRe V + i dL/dIm V to dL/dpixel."""
        data = np.require(complexes("cotangent", cotangent), requirements=["C", "A"])
        if data.shape != self.output_shape:
            raise ValueError(f"cotangent has the shape {data.shape}, not {self.output_shape}")
        return self._core.vjp(data).reshape(self.input_shape)

    def __repr__(self) -> str:
        return f"<Fourier from {self.input_shape} to {self.output_shape[0]} visibilities, {self._core.describe()}>"
