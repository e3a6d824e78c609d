"""Lensed pictures and films of scenes, as ``kerrlight render`` and ``kerrlight movie`` make them."""

from __future__ import annotations

import base64
from functools import cached_property
from os import PathLike, fspath
from typing import Any, Iterator, Mapping, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kerrlight import _core
from kerrlight._arrays import Floats, finite
from kerrlight._settings import Settings, overrides_of, text_of

__all__ = ["Movie", "Picture", "movie", "render"]

class _Kept:
    """Data of a picture, as they go to another process."""

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
        """Attributes of its EXR file: the scene, and every number that decided the picture."""
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
