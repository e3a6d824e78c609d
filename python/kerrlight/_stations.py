"""Stations, and the products of their feeds."""

from __future__ import annotations

from dataclasses import dataclass

PRODUCTS = {False: ("", "q", "u", "v"), True: ("rr", "ll", "rl", "lr")}


@dataclass(frozen=True)
class Station:
    """A telescope."""

    name: str
    position: tuple[float, float, float] | None = None
    """Geocentric x, y and z in metres, where known."""
    sefd: tuple[float, float] = (0.0, 0.0)
    """System equivalent flux densities of the R and L feeds (Jy)."""
    feed_rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Factors on parallactic angle and elevation, and a constant in degrees."""
    leakage: tuple[complex, complex] = (0j, 0j)
    """Leakage of the R and L feeds; carried along for files."""
