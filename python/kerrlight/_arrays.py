"""What callers may give where an array is wanted."""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def real(name: str, value: Any) -> Floats:
    """``value`` as an array of real numbers; quantities of astropy must have no unit."""
    if hasattr(value, "to_value"):
        value = value.to_value("")
    if np.ma.is_masked(value):
        raise ValueError(f"{name} has masked elements: fill them, or leave them out")
    array = np.asarray(value)
    if array.dtype.kind not in "buif" and array.size > 0:
        raise TypeError(f"{name} has the type {array.dtype}: real numbers are needed")
    return np.asarray(array, dtype=np.float64)


def finite(name: str, value: Any) -> Floats:
    """The same without infinities and what is no number."""
    array = real(name, value)
    wrong = array[~np.isfinite(array)]
    if wrong.size:
        raise ValueError(f"{name} = {wrong.flat[0]} is not allowed: finite numbers")
    return array


def whole(name: str, value: Any, low: int, high: int) -> int:
    """``value`` as a whole number in a range."""
    try:
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"{name} = {value!r} is not allowed: a whole number") from None
    if not low <= number <= high:
        raise ValueError(f"{name} = {number} is not allowed: {low} to {high}")
    return number


def together(**values: Any) -> tuple[tuple[int, ...], list[Floats]]:
    """The common shape of arrays, and each of them with that shape as a contiguous column."""
    arrays = {name: real(name, value) for name, value in values.items()}
    try:
        broad = np.broadcast_arrays(*arrays.values())
    except ValueError:
        shapes = " and ".join(str(array.shape) for array in arrays.values())
        raise ValueError(f"{' and '.join(arrays)} have shapes {shapes}, which do not broadcast") from None
    return broad[0].shape, [np.ascontiguousarray(array).reshape(-1) for array in broad]
