"""Motion of gas around the hole, and polarisation of its light: laws of fits, scenes and forward models."""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Literal, Sequence, Union

import numpy as np

__all__ = ["Infall", "Keplerian", "PolarizationLaw", "PowerLaw", "Profile", "Tabulated", "Velocity"]


class Law:
    """A law of motion, with its name and keys in files."""

    _name: ClassVar[str]

    def table(self) -> dict[str, Any]:
        """The law as scene and fit files have it."""
        keys = {part.name: getattr(self, part.name) for part in fields(self)}  # type: ignore[arg-type]
        plain = {key: _numbers(value) for key, value in keys.items() if value is not None}
        return {self._name: plain}


def _numbers(value: Any) -> Any:
    if np.ndim(value) > 1:
        raise ValueError(f"an array of shape {np.shape(value)} is not allowed: a number or a list")
    return float(value) if np.ndim(value) == 0 else [float(x) for x in value]


@dataclass(frozen=True)
class Keplerian(Law):
    """Angular velocity 1/(r^{3/2} + drag); without ``drag`` the part of the spin along the axis."""

    _name = "keplerian"
    drag: float | None = None


@dataclass(frozen=True)
class PowerLaw(Law):
    """Angular velocity rate · (radius/r)^exponent, in radians per M; ``radius`` in M."""

    _name = "power-law"
    radius: float
    rate: float
    exponent: float = 1.5


@dataclass(frozen=True)
class Tabulated(Law):
    """Angular velocity linear between ``radii`` (M), held beyond the first and the last; ``rates`` in radians per M."""

    _name = "table"
    radii: Sequence[float]
    rates: Sequence[float]


@dataclass(frozen=True)
class Infall(Law):
    """The family between circular orbits and free fall (Cárdenas-Avendaño, Lupsasca & Zhu 2023): ``xi`` is the specific
    angular momentum over that of circular orbits, ``beta_r`` and ``beta_phi`` are 1 for the radial and angular velocity
    of these and 0 for those of free fall; without ``drag`` the flow sees the part of the spin along the axis.
    """

    _name = "infall"
    xi: float
    beta_r: float
    beta_phi: float
    drag: float | None = None


@dataclass(frozen=True)
class Profile(Law):
    """Monotone cubics through Ω (``angular``, radians per M) and dr/dt (``radial``) at ``radii`` (M), held beyond the
    first and the last; dr/dt has one sign.
    """

    _name = "profile"
    radii: Sequence[float]
    angular: Sequence[float]
    radial: Sequence[float]


Velocity = Union[Keplerian, PowerLaw, Tabulated, Infall, Profile]


@dataclass(frozen=True, kw_only=True)
class PolarizationLaw:
    """Light of gas in a magnetic field: I ∝ g^a |b|^c sin^s θ_B per unit of emission, of which ``fraction`` is linearly
    polarised along k × b. Keys, ranges and units are those of ``[polarization]`` in fit files; none has a default, as
    published programs differ.
    """

    vertical: float
    """Field along +z: B^r = radial sinⁿθ + vertical cos θ, B^θ = −vertical sin θ."""
    radial: float
    """Field away from the hole."""
    toroidal: float
    """B^φ."""
    radial_sine_power: float
    """n."""
    components: Literal["orthonormal", "coordinate"]
    """Frame of the components."""
    frame: Literal["gas", "ideal", "lowered"]
    """Whose they are."""
    redshift_power: float
    """a."""
    field_power: float
    """c."""
    sine_power: float
    """s."""
    fraction: float
    """Linearly polarised part, 0 to 1."""
    normalisation: Literal["mean-field", "none"]
    """Unit of |b|."""
    turn_deg: float
    """Added to all position angles, degrees east of north."""

    def _json(self) -> str:
        law: dict[str, Any] = {field.name: getattr(self, field.name) for field in fields(self)}
        parts = ("vertical", "radial", "toroidal", "radial_sine_power")
        law["field"] = {part: float(law.pop(part)) for part in parts}
        return json.dumps(law)
