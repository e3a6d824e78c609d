"""Values that callers may give where an array is wanted."""

from __future__ import annotations

import math
import operator
import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def given(name: str, value: Any) -> NDArray[Any]:
    """``value`` as an array, none of whose elements is masked; quantities of astropy must have no unit."""
    if hasattr(value, "to_value"):
        value = value.to_value("")
    if np.ma.is_masked(value):
        raise ValueError(f"{name} has masked elements: fill them, or leave them out")
    return np.asarray(value)


def real(name: str, value: Any) -> Floats:
    """The same of real numbers."""
    array = given(name, value)
    if array.dtype.kind not in "buif" and array.size > 0:
        raise TypeError(f"{name} has the type {array.dtype}: real numbers are needed")
    return np.asarray(array, dtype=np.float64)


def complexes(name: str, value: Any) -> NDArray[np.complex128]:
    """The same of complex numbers."""
    array = given(name, value)
    if array.dtype.kind not in "buifc" and array.size > 0:
        raise TypeError(f"{name} has the type {array.dtype}: complex numbers are needed")
    return np.asarray(array, dtype=np.complex128)


def flat(array: NDArray[Any]) -> NDArray[Any]:
    """All elements as a column for the compiled half. Arrays of other processes may lie across words of memory."""
    return np.require(array, requirements=["C", "A"]).reshape(-1)


def finite(name: str, value: Any) -> Floats:
    """``value`` as an array of real numbers without infinities and what is no number."""
    array = real(name, value)
    wrong = array[~np.isfinite(array)]
    if wrong.size:
        raise ValueError(f"{name} = {wrong.flat[0]} is not allowed: finite numbers")
    return array


def degrees(name: str, value: Any) -> float:
    """``value`` in degrees; a warning where it is a round angle in radians, such as π/3 or 17π/180."""
    number = float(value)
    turned = math.degrees(number)
    is_round = abs(turned - round(turned)) < 1e-9 * abs(turned)
    if is_round and 0 < abs(number) <= 2 * math.pi and round(number, 6) != number:
        warnings.warn(
            f"{name} = {number} are {number} degrees, and would be {round(turned)} degrees in radians: did you mean these?",
            stacklevel=3,
        )
    return number


def radians(name: str, value: Any) -> Floats:
    """``value`` in radians, finite; a warning where it is more than two turns, as degrees are."""
    array = finite(name, value)
    most = float(np.abs(array).max(initial=0.0))
    if most > 4 * math.pi:
        warnings.warn(
            f"{name} goes to {most:g} radians, more than two turns: did you give degrees?", stacklevel=3
        )
    return array


def column(name: str, value: Any) -> Floats:
    """``value`` as a list of real numbers; one number is a list of one."""
    array = np.atleast_1d(real(name, value))
    if array.ndim != 1:
        raise ValueError(f"{name} has the shape {array.shape}: give a list of numbers")
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
    return broad[0].shape, [flat(array) for array in broad]
