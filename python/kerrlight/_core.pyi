"""The compiled half of the package; its callers in this folder say what everything means."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

__version__: str

_Floats = NDArray[np.float64]
_Place = tuple[float, bool, float, float]

def program(arguments: list[str], launcher: list[str]) -> int: ...
def integrators() -> list[str]: ...
def trace(
    spin: float,
    place: _Place,
    screen: tuple[_Floats, _Floats],
    how: tuple[str, float],
    wanted: dict[str, Any],
) -> dict[str, Any]: ...
def differentiate(
    spin: float,
    place: _Place,
    screen: tuple[_Floats, _Floats],
    tolerance: float,
    wanted: dict[str, Any],
) -> dict[str, Any]: ...
def path_lengths(
    spin: float, place: _Place, screen: tuple[_Floats, _Floats], samples: int
) -> _Floats: ...
def radii(spin: float) -> dict[str, float]: ...
def keplerian_redshift(spin: float, r: _Floats, lam: _Floats) -> _Floats: ...
def critical_curve(spin: float, place: _Place, count: int) -> dict[str, _Floats]: ...
def critical_points(spin: float, place: _Place, angles: _Floats) -> dict[str, _Floats]: ...
def band(spin: float, place: _Place, order: int, angles: _Floats) -> dict[str, _Floats]: ...
