"""Scenes as objects, for editors that complete names: the tables of a scene file, key by key.

>>> from kerrlight import render
>>> from kerrlight.scene import Disc, Hole, Observer, Scene, Screen, Tracer
>>> scene = Scene(
...     hole=Hole(spin=0.9),
...     observer=Observer(inclination_deg=60.0),
...     screen=Screen(field_of_view_m=30.0, width=16),
...     tracer=Tracer(integrator="elliptic", tolerance=1e-6),
...     disc=Disc(outer_edge=12.0, peak_intensity=1.0, opaque=True),
... )
>>> render(scene).shape
(16, 16)

Keys, units, ranges and defaults are those of docs/reference/scene-file.md. A field that is None is left to the program,
which has its default or asks for it. Scenes are plain dataclasses: ``dataclasses.replace`` changes one, and a dictionary
or TOML text says the same.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from typing import Any, Literal, Mapping, Sequence, Union

from kerrlight import _core
from kerrlight._settings import plain, text_of
from kerrlight.flow import Infall, Keplerian, PowerLaw, Profile, Tabulated, Velocity

__all__ = [
    "Camera",
    "Catalogue",
    "Checker",
    "Disc",
    "Effects",
    "Gas",
    "Hole",
    "Key",
    "MagneticField",
    "Mesh",
    "Observer",
    "Plunging",
    "Scene",
    "Screen",
    "Sky",
    "SkyImage",
    "Spot",
    "Stars",
    "Tracer",
    "Volume",
]

Color = Sequence[float]
"""Linear R, G, B."""
Vector = Sequence[float]
Path = Union[str, "PathLike[str]"]
Motion = Literal["static", "zamo", "keplerian", "free-fall", "path"]
Rotation = Union[Literal["none", "keplerian"], Velocity, Mapping[str, Any]]


@dataclass(kw_only=True)
class Hole:
    """The black hole."""

    spin: float
    """a, along +z; negative: it rotates against +z."""
    mass_msun: float | None = None
    """Solar masses; required with µas, Jy, gas, or times in seconds."""
    distance_kpc: float | None = None
    """kpc; required with µas, Jy or gas."""

    @staticmethod
    def sgr_a_star(spin: float) -> Hole:
        """Sgr A* (GRAVITY Collaboration 2019, A&A 625, L10), of this spin.

        >>> Hole.sgr_a_star(0.5).mass_msun
        4154000.0
        """
        mass_msun, distance_kpc = _core.known_hole("Sgr A*")
        return Hole(spin=spin, mass_msun=mass_msun, distance_kpc=distance_kpc)

    @staticmethod
    def m87_star(spin: float) -> Hole:
        """M87* (Event Horizon Telescope Collaboration 2019, ApJL 875, L6), of this spin."""
        mass_msun, distance_kpc = _core.known_hole("M87*")
        return Hole(spin=spin, mass_msun=mass_msun, distance_kpc=distance_kpc)


@dataclass(kw_only=True)
class Observer:
    """Who looks, unless there is a camera."""

    inclination_deg: float | None = None
    """Angle between +z and the line of sight, 0 to 180."""
    azimuth_deg: float | None = None
    radius: float | None = None
    """Boyer–Lindquist radius (M); at infinity by default."""
    time: float | None = None
    """Time of observation (M); 0 by default."""


@dataclass(kw_only=True)
class Key:
    """A keyframe of a camera; None leaves a number as it is between its neighbours."""

    time: float
    """M."""
    radius: float | None = None
    theta_deg: float | None = None
    phi_deg: float | None = None
    field_of_view_deg: float | None = None
    yaw_deg: float | None = None
    pitch_deg: float | None = None
    roll_deg: float | None = None


@dataclass(kw_only=True)
class Camera:
    """A pinhole camera near the hole."""

    motion: Motion
    radius: float
    """Boyer–Lindquist radius (M)."""
    theta_deg: float
    phi_deg: float
    field_of_view_deg: float
    """Width of the field."""
    yaw_deg: float | None = None
    """To the right, from the direction of the hole."""
    pitch_deg: float | None = None
    """Then up."""
    roll_deg: float | None = None
    """Then clockwise."""
    key: list[Key] = field(default_factory=list)


@dataclass(kw_only=True)
class Screen:
    """The image plane and its pixels."""

    width: int
    """Pixels per row."""
    field_of_view_m: float | None = None
    """Width of the field (M); this or the next one, without a camera."""
    field_of_view_uas: float | None = None
    """Width of the field (µas)."""
    height: int | None = None
    samples_per_pixel: int | None = None
    """Rays per pixel: 1, 4, 9, …, 1024."""
    rings: Literal["resolved", "regular-grid"] | None = None
    """True if pixels near the critical curve get more rays."""
    image_error: float | None = None
    """Refine pixels until the relative error of the intensity is below this."""
    total_flux_jy: float | None = None
    """Scale the intensity to this flux."""
    channels: list[str] | None = None
    """Channels to keep; all by default."""


@dataclass(kw_only=True)
class Effects:
    """Effects on light; one that is off costs nothing."""

    lensing: bool | None = None
    redshift: bool | None = None
    spectral_index: float | None = None
    """α of the spectrum ν^(−α)."""
    redshift_power: float | None = None
    """2 + α, in place of the spectral index."""
    slow_light: bool | None = None
    absorption: bool | None = None
    half_orbits: int | None = None
    """Order of the last lensed image that is included."""
    polarization: bool | None = None
    circular_polarization_lorentz_factor: float | None = None
    ray_bundles: bool | None = None


@dataclass(kw_only=True)
class Tracer:
    """Tracer of rays."""

    integrator: Literal["elliptic", "taylor-mino", "dop853-mino", "rk45-mino"]
    tolerance: float
    """Local error of a step, and relative error of the light along a ray."""


@dataclass(kw_only=True)
class MagneticField:
    """Components in the frame of the gas."""

    vertical: float
    radial: float
    toroidal: float


@dataclass(kw_only=True)
class Gas:
    """Volumetric gas with an analytic density (Gold et al. 2020)."""

    profile: Union[Literal["gaussian"], Mapping[str, Any]]
    scale_radius: float
    """M."""
    flatness: float
    motion: Union[Literal["keplerian", "free-fall"], Mapping[str, Any]]
    emissivity: float
    """erg s⁻¹ cm⁻³ Hz⁻¹ sr⁻¹ at density 1."""
    outer_radius: float
    """M."""
    absorptivity: float | None = None
    color: Color | None = None


@dataclass(kw_only=True)
class Plunging:
    """Emission inside the innermost stable orbit."""

    intensity: float
    """At that orbit, in the gas frame."""
    exponent: float
    """Power of r/r_isco."""


@dataclass(kw_only=True)
class Disc:
    """A thin disc in the equatorial plane (Page & Thorne 1974)."""

    outer_edge: float
    """M."""
    peak_intensity: float
    opaque: bool
    inner_edge: float | None = None
    """M; the innermost stable orbit by default."""
    color: Color | None = None
    peak_temperature_k: float | None = None
    """Black-body colours with this temperature at the flux peak (K)."""
    plunging: Plunging | None = None


@dataclass(kw_only=True)
class Spot:
    """A Gaussian hot spot on a circular orbit."""

    radius: float
    """M."""
    phase_deg: float
    """Angle along the orbit at time 0."""
    sigma: float
    """Standard deviation (M)."""
    peak_emissivity: float
    axis: Vector | None = None
    sheared_since: float | None = None
    """Time (M) at which it lights up, and from which differential rotation shears it."""
    color: Color | None = None


@dataclass(kw_only=True)
class Volume:
    """Emission on the nodes of a box, carried along by matter."""

    path: Path
    factor: float
    """Emissivity where the file has 1."""
    rotation: Rotation
    low: Vector | None = None
    """Coordinates of the first node (M)."""
    high: Vector | None = None
    """Coordinates of the last node (M)."""
    axis: Vector | None = None
    reference_time: float | None = None
    """Time (M) at which the volume is as in the file."""
    injection_time: float | None = None
    """Dark before this time (M)."""
    region: Mapping[str, float] | None = None
    """``r_min``, ``r_max`` and ``z_width`` (M)."""
    color: Color | None = None


@dataclass(kw_only=True)
class Mesh:
    """A surface given as triangles."""

    path: Path
    scale: float
    """M per unit of the file."""
    opaque: bool
    brightness: float
    rotation_axis: Vector | None = None
    rotation_deg: float | None = None
    position: Vector | None = None
    """Position of the file's origin (M)."""
    color: Color | None = None
    velocity: Literal["static", "keplerian"] | None = None


@dataclass(kw_only=True)
class Checker:
    """A checkered sphere."""

    field_deg: float
    brightness: float


@dataclass(kw_only=True)
class Stars:
    """Random stars."""

    count: int
    radius_deg: float
    brightness: float
    seed: int


@dataclass(kw_only=True)
class SkyImage:
    """An equirectangular image."""

    path: Path
    brightness: float


@dataclass(kw_only=True)
class Catalogue:
    """Stars of a catalogue."""

    path: Path
    brightness: float
    psf_fwhm_pixels: float | None = None
    """Width of the point-spread function."""


@dataclass(kw_only=True)
class Sky:
    """Background: one of these."""

    checker: Checker | None = None
    stars: Stars | None = None
    image: SkyImage | None = None
    catalogue: Catalogue | None = None


@dataclass(kw_only=True)
class Scene:
    """A scene, for :func:`kerrlight.render`, :func:`kerrlight.movie` and everything else that takes one."""

    hole: Hole
    screen: Screen
    tracer: Tracer
    observer: Observer | None = None
    camera: Camera | None = None
    effects: Effects | None = None
    magnetic_field: MagneticField | None = None
    gas: Gas | None = None
    disc: Disc | None = None
    spot: list[Spot] = field(default_factory=list)
    volume: list[Volume] = field(default_factory=list)
    mesh: list[Mesh] = field(default_factory=list)
    sky: Sky | None = None

    def to_dict(self) -> dict[str, Any]:
        """The tables of a scene file."""
        return plain(self)

    def to_toml(self) -> str:
        """The text of a scene file."""
        return text_of(self, None)[0] or ""
