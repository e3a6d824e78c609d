"""Lensed pictures and films of scenes, as ``kerrlight render`` and ``kerrlight movie`` make them."""

from __future__ import annotations

import base64
import json
import math
import os
from dataclasses import is_dataclass
from functools import cached_property
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any, Iterator, Mapping, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kerrlight import _core
from kerrlight._arrays import Floats, degrees, finite

if TYPE_CHECKING:
    from kerrlight.scene import Scene

__all__ = ["Movie", "Picture", "movie", "render"]

Settings = Union[None, str, "PathLike[str]", Mapping[str, Any], "Scene"]
"""A dictionary, TOML text, the path of a file, a scene as objects, or nothing: what is built in."""


def _plain(value: Any) -> Any:
    """Numbers and arrays of numpy for the encoder of JSON."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, PathLike):
        return fspath(value)
    raise TypeError(f"{value!r} is no setting")


INFINITE = "\0inf"
"""What stands for infinity in JSON, which has none."""


def _table(value: Any) -> Any:
    """Objects such as a ``Hole`` as tables."""
    if is_dataclass(value) and not isinstance(value, type):
        from kerrlight.scene import plain

        return plain(value)
    return value


def _without_none(value: Any, name: str = "") -> Any:
    """Tables without keys that are None; a key with dots leads through tables, as in TOML."""
    value = _table(value)
    if isinstance(value, Mapping):
        table: dict[str, Any] = {}
        for key, of in value.items():
            if of is not None:
                whole_name = f"{name}.{key}" if name else str(key)
                _put(table, str(key).split("."), _without_none(of, whole_name))
        return table
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_without_none(v, f"{name}.{k}") for k, v in enumerate(value)]
    if isinstance(value, (float, np.floating)) and not math.isfinite(value):
        if math.isnan(value):
            raise ValueError(f"{name} = nan is not allowed: a number")
        return INFINITE if value > 0 else f"-{INFINITE}"
    if isinstance(value, (int, float, np.number)) and name.endswith("_deg"):
        degrees(name, value)
    return value


def _put(table: dict[str, Any], keys: list[str], value: Any) -> None:
    for key in keys[:-1]:
        table = table.setdefault(key, {})
        if not isinstance(table, dict):
            raise ValueError(f"{'.'.join(keys)}: {key} is a value, not a table")
    here = table.get(keys[-1])
    if isinstance(here, dict) and isinstance(value, dict):
        for key, of in value.items():
            _put(here, [key], of)
    else:
        table[keys[-1]] = value


def text_of(settings: Settings, folder: Union[None, str, PathLike[str]]) -> tuple[str | None, str]:
    """The TOML text of settings, and the folder that relative paths in it start from."""
    if settings is not None and hasattr(settings, "to_dict"):
        settings = settings.to_dict()
    if isinstance(settings, Mapping):
        encoded = json.dumps(_without_none(settings), default=_plain)
        return _core.toml_of_json(encoded), fspath(folder or ".")
    if settings is None:
        return None, fspath(folder or ".")
    if not isinstance(settings, (str, PathLike)):
        kind = type(settings).__name__
        raise TypeError(f"settings are a dictionary, TOML text, the path of a file or a Scene, not {kind}")
    name = fspath(settings)
    if name.lower().endswith(".exr") and "\n" not in name:
        return _core.scene_of_exr(name), fspath(folder or os.path.dirname(name) or ".")
    if isinstance(settings, str) and ("\n" in name or "=" in name):
        return name, fspath(folder or ".")
    with open(name, "rb") as opened:
        data = opened.read()
    try:
        return data.decode("utf-8"), fspath(folder or os.path.dirname(name) or ".")
    except UnicodeDecodeError:
        words = "is no text of settings: give a TOML file, and name data in it"
        raise ValueError(f"{name} {words} (`kerrlight fit --init {name}` writes one for data)") from None


def _flat(changes: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted keys of all values in dictionaries of dictionaries."""
    for key, of in changes.items():
        value = _table(of)
        if isinstance(value, Mapping) and value:
            yield from _flat(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", value


def overrides_of(changes: Mapping[str, Any] | None) -> list[str]:
    """``key.path=value`` of each change, values as TOML writes them; a dictionary changes the keys that it has, and None
    removes a key."""

    if changes is not None and not isinstance(changes, Mapping):
        raise TypeError(f"set = {changes!r} is not allowed: a dictionary of changes")

    def value(key: str, of: Any) -> str:
        return _core.toml_value_of_json(json.dumps(_without_none(of, key), default=_plain))

    flat = _flat(changes or {})
    return [f"{key}=" if of is None else f"{key}={value(key, of)}" for key, of in flat]


class _Kept:
    """What a picture shows of itself, as it goes to another process."""

    def __init__(self, core: Any) -> None:
        names = core.names()
        self._channels = {name: core.channel(name) for name in names}
        self._facts = (core.shape(), core.summary(), core.attributes(), core.exr())
        try:
            self._png: bytes | str = core.png()
        except ValueError as error:  # its channels were left out
            self._png = str(error)

    def names(self) -> list[str]:
        return list(self._channels)

    def channel(self, name: str) -> NDArray[np.float32] | None:
        return self._channels.get(name)

    def shape(self) -> tuple[int, int]:
        return self._facts[0]

    def summary(self) -> dict[str, Any]:
        return dict(self._facts[1])

    def attributes(self) -> dict[str, str]:
        return dict(self._facts[2])

    def exr(self) -> bytes:
        return self._facts[3]

    def png(self) -> bytes:
        if isinstance(self._png, str):
            raise ValueError(self._png)
        return self._png


class Picture(Mapping[str, "NDArray[np.float32]"]):
    """A rendered picture: a mapping from names of channels to arrays, rows from the top.

    In a notebook it shows itself.
    """

    def __init__(self, core: Any) -> None:
        self._core = core
        self._names: list[str] = core.names()
        self._channels: dict[str, NDArray[np.float32]] = {}

    def __reduce__(self) -> Any:
        return (Picture, (self._core if isinstance(self._core, _Kept) else _Kept(self._core),))

    def __copy__(self) -> Picture:
        return Picture(self._core)

    def __deepcopy__(self, memo: Any) -> Picture:
        copied = Picture(self._core)
        copied._channels = {name: values.copy() for name, values in self._channels.items()}
        return copied

    def __getitem__(self, name: str) -> NDArray[np.float32]:
        if name not in self._names:
            raise KeyError(f"{name}: the picture has {', '.join(self._names)}")
        if name not in self._channels:
            self._channels[name] = self._core.channel(name)
        return self._channels[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self._core.shape()

    @cached_property
    def summary(self) -> dict[str, Any]:
        """``flux`` with ``flux_error`` and ``flux_unit``, ``intensity_unit``, ``image_error``, ``rays`` and
        ``unresolved_rays``."""
        return self._core.summary()

    @cached_property
    def attributes(self) -> dict[str, str]:
        """What an EXR file of it says: the scene, and every number that decided the picture."""
        return self._core.attributes()

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, bottom and top edge: in M, or on a camera's picture plane."""
        size = self.attributes.get("pixel_size_m") or self.attributes["pixel_size_plane"]
        rows, columns = self.shape
        x, y = 0.5 * columns * float(size), 0.5 * rows * float(size)
        return (-x, x, -y, y)

    def to_exr(self, path: Union[str, PathLike[str]]) -> None:
        """Writes an EXR file with all channels; :func:`render` and ``kerrlight render`` render it again."""
        _write(_ending(path, ".exr"), self._core.exr())

    def to_png(self, path: Union[str, PathLike[str]]) -> None:
        """Writes the PNG that ``kerrlight render`` writes by default."""
        _write(_ending(path, ".png"), self._core.png())

    def plot(self, channel: str = "intensity", ax: Any = None, **options: Any) -> Any:
        """Draws a channel with matplotlib, on ``ax`` or a new figure; ``options`` go to ``imshow``. Returns the axes."""
        import matplotlib.pyplot as plt

        if ax is None:
            ax = plt.subplots()[1]
        options.setdefault("cmap", "afmhot" if channel == "intensity" else "viridis")
        image = ax.imshow(self[channel], extent=self.extent, **options)
        unit = self.summary["intensity_unit"]
        label = f"intensity ({unit})" if channel == "intensity" else channel
        ax.figure.colorbar(image, ax=ax, label=label)
        in_m = "pixel_size_m" in self.attributes
        ax.set_xlabel("α (M)" if in_m else "x")
        ax.set_ylabel("β (M)" if in_m else "y")
        return ax

    def _repr_html_(self) -> str:
        rows, columns = self.shape
        names = ", ".join(self._names)
        try:
            data = base64.b64encode(self._core.png()).decode("ascii")
        except ValueError:  # its channels were left out
            return f"<p>{columns} × {rows} pixels: {names}</p>"
        width = min(columns, 512)
        style = "image-rendering: pixelated" if columns < 256 else ""
        picture = f'<img width="{max(width, 256)}" style="{style}" src="data:image/png;base64,{data}">'
        flux = f"flux {self.summary['flux']:.6g} {self.summary['flux_unit']}"
        return f"{picture}<p>{columns} × {rows} pixels, {flux}: {names}</p>"

    def __repr__(self) -> str:
        rows, columns = self.shape
        return f"<Picture of {columns} x {rows} pixels: {', '.join(self._names)}>"


class Movie:
    """Frames of a film that share one unit of intensity."""

    def __init__(self, frames: list[Picture], times: Floats) -> None:
        self.frames = frames
        """The pictures."""
        self.times = times
        """Times of observation (M)."""

    def __getitem__(self, channel: str) -> NDArray[np.float32]:
        """A channel of all frames, over (t, y, x)."""
        return np.stack([frame[channel] for frame in self.frames])

    @property
    def flux(self) -> Floats:
        """Flux of each frame, in the unit of ``frames[0].summary["flux_unit"]``."""
        return np.array([frame.summary["flux"] for frame in self.frames])

    def __len__(self) -> int:
        return len(self.frames)

    def __repr__(self) -> str:
        return f"<Movie of {len(self)} frames: {self.frames[0]!r}>"


def _ending(path: Union[str, PathLike[str]], wanted: str) -> Union[str, PathLike[str]]:
    if not fspath(path).lower().endswith(wanted):
        raise ValueError(f"{fspath(path)} is not allowed: a name that ends with {wanted}")
    return path


def _write(path: Union[str, PathLike[str]], data: bytes) -> None:
    with open(path, "wb") as file:
        file.write(data)


def render(
    scene: Settings = None,
    *,
    set: Mapping[str, Any] | None = None,
    folder: Union[None, str, PathLike[str]] = None,
) -> Picture:
    """Renders a scene.

    :param scene: a :class:`kerrlight.scene.Scene`, a dictionary with the tables of a scene file, its text, its path, an
        EXR that was rendered before, or nothing for the built-in scene.
    :param set: changes, with dotted keys: ``{"hole.spin": 0.5, "spot.0.phase_deg": 90}``.
    :param folder: where relative paths in the scene start from; by default the folder of its file, else the current one.
    :raises ValueError: for what the program refuses, with its words.

    Ctrl-C stops it within moments.

    >>> scene = {
    ...     "hole": {"spin": 0.0, "mass_msun": 6.5e9, "distance_kpc": 16800.0},
    ...     "observer": {"inclination_deg": 0.0},
    ...     "screen": {"field_of_view_m": 30.0, "width": 16, "total_flux_jy": 0.5},
    ...     "tracer": {"integrator": "elliptic", "tolerance": 1e-8},
    ...     "disc": {"outer_edge": 12.0, "peak_intensity": 1.0, "opaque": True},
    ... }
    >>> picture = render(scene)
    >>> picture["intensity"].shape, picture.summary["flux_unit"]
    ((16, 16), 'Jy')
    >>> bool(abs(picture.summary["flux"] - 0.5) < 1e-6)
    True
    """
    text, base = text_of(scene, folder)
    return Picture(_core.render(text, base, overrides_of(set)))


def movie(
    scene: Settings = None,
    times: ArrayLike = 0.0,
    *,
    set: Mapping[str, Any] | None = None,
    folder: Union[None, str, PathLike[str]] = None,
) -> Movie:
    """Renders a scene at ``times`` of observation (M), the rest as :func:`render`.

    Under a fixed camera a ray is traced once for many frames. If the scene asks for a flux, that is the first frame's.
    """
    text, base = text_of(scene, folder)
    moments = np.atleast_1d(finite("times", times)).copy()
    if moments.size == 0:
        raise ValueError("times is empty: give one or more")
    if moments.ndim != 1:
        raise ValueError(f"times have the shape {moments.shape}: give a list")
    frames: Sequence[Any] = _core.film(text, base, overrides_of(set), moments.tolist())
    return Movie([Picture(frame) for frame in frames], moments)
