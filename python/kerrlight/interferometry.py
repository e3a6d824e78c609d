"""Visibilities: files, columns, closure quantities, and eht-imaging's objects."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass, field, fields, replace
from os import PathLike, fspath
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kerrlight import _core, _ehtim, _pyuvdata
from kerrlight._arrays import Floats, complexes, real
from kerrlight._stations import PRODUCTS, Station
from kerrlight.fourier import Fourier

__all__ = ["Closures", "Observation", "Station"]

_ENDINGS = {".uvfits": "uvfits", ".fits": "uvfits", ".txt": "obs-text", ".csv": "csv"}
_FORMATS = ("uvfits", "obs-text", "csv", "eht-csv", "eht-txt")
_RANGES = {
    "time": (-1e6, 1e6),
    "uv": (-1e17, 1e17),
    "integration": (0.0, 1e9),
    "opacity": (0.0, 1e6),
    "mjd": (0, 1e6),
    "frequency_hz": (1e6, 1e15),
    "bandwidth_hz": (0.0, 1e15),
}


@dataclass(frozen=True, eq=False)
class Closures:
    """Independent closure quantities, a row each."""

    time: Floats
    """Hours of UTC."""
    value: Floats
    """Closure phases in radians, or logarithms of closure amplitudes."""
    sigma: Floats
    """Standard deviations for high signal to noise."""
    stations: NDArray[np.str_]
    """Names: triangles 1, 2, 3, or quadrangles 1, 2, 3, 4 of |V12 V34|/|V13 V24|."""
    rows: NDArray[np.int64]
    """Rows of the observation that each is made of."""
    signs: NDArray[np.int8]
    """Signs of their phases, or of the logarithms of their amplitudes."""

    def __len__(self) -> int:
        return len(self.value)


@dataclass(frozen=True, eq=False)
class Observation:
    """Observation of an array: columns with a row for each baseline and time.

    ``products`` are RR, LL, RL, LR if ``circular``, else I, Q, U, V, in Jy; ``sigmas`` are the standard deviations of
    their real and of their imaginary parts, NaN where there is no such product.

    >>> import numpy as np
    >>> names = np.array([["AA", "LM"], ["AA", "PV"], ["LM", "PV"]])
    >>> uv = np.array([[1e9, 2e9], [3e9, -1e9], [2e9, -3e9]])
    >>> obs = Observation.of_stokes_i([4.0, 4.0, 4.0], names, uv, [1 + 1j, 0.5, -0.2j], [0.01, 0.01, 0.02])
    >>> print(f"{obs.closure_phases().value[0]:.6f} rad")  # π/4 - π/2 - 0
    -0.785398 rad
    """

    time: Floats
    """Hours of UTC since 0 h of the day ``mjd``."""
    stations: NDArray[np.str_]
    """Names of the two stations of each row, shape (rows, 2)."""
    uv: Floats
    """(u, v) in wavelengths, shape (rows, 2)."""
    products: NDArray[np.complex128]
    """Shape (rows, 4)."""
    sigmas: Floats
    """Shape (rows, 4)."""
    circular: bool = False
    integration: Floats | None = None
    """Seconds; 0 where a file does not tell."""
    opacity: Floats | None = None
    """Zenith opacities at both stations, shape (rows, 2)."""
    channel: NDArray[np.int64] | None = None
    """Index in ``channels`` of each row."""
    array: tuple[Station, ...] = ()
    """The stations that rows name."""
    source: str = ""
    ra_hours: float | None = None
    dec_deg: float | None = None
    mjd: int | None = None
    frequency_hz: float | None = None
    bandwidth_hz: float | None = None
    channels: tuple[tuple[float, float], ...] = ()
    """Frequency and bandwidth (Hz) of spectral channels; none where all rows are of ``frequency_hz``."""
    history: tuple[str, ...] = ()
    """History of the data."""
    _core: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        count = len(np.atleast_1d(real("time", self.time)))
        names = np.asarray(self.stations, dtype=str)
        names = names.reshape(0, 2) if names.size == 0 else names
        if names.shape != (count, 2):
            raise ValueError(f"stations have the shape {names.shape}, not {(count, 2)}")
        known = {station.name for station in self.array}
        missing = [name for name in dict.fromkeys(names.ravel().tolist()) if name not in known]
        columns = {
            "time": _column("time", self.time, (count,)),
            "uv": _column("uv", self.uv, (count, 2)),
            "sigmas": _column("sigmas", self.sigmas, (count, 4)),
            "integration": _column("integration", _or_zero(self.integration, (count,)), (count,)),
            "opacity": _column("opacity", _or_zero(self.opacity, (count, 2)), (count, 2)),
        }
        if (columns["sigmas"] < 0).any():
            raise ValueError(f"sigmas = {columns['sigmas'].min()} is not allowed: 0 or above, or NaN")
        for name, (least, most) in _RANGES.items():
            _check_range(name, columns.get(name, getattr(self, name, None)), least, most)
        for frequency, bandwidth in self.channels:
            _check_range("channels: frequency", frequency, *_RANGES["frequency_hz"])
            _check_range("channels: bandwidth", bandwidth, *_RANGES["bandwidth_hz"])
        if self.mjd is not None and self.mjd != int(self.mjd):
            raise ValueError(f"mjd = {self.mjd} is not allowed: a whole number, as hours count from its 0 h UTC")
        for first in names[names[:, 0] == names[:, 1], 0]:
            raise ValueError(f"stations has a baseline of {first} with itself")
        for name, column in columns.items():
            object.__setattr__(self, name, _frozen(column))
        object.__setattr__(self, "stations", _frozen(names))
        object.__setattr__(self, "array", (*self.array, *map(Station, missing)))
        products = np.ascontiguousarray(complexes("products", self.products))
        if products.shape != (count, 4):
            raise ValueError(f"products have the shape {products.shape}, not {(count, 4)}")
        if not np.isfinite(products[~np.isnan(columns["sigmas"])]).all():
            raise ValueError("products has an element that is no finite number, though sigmas has one")
        object.__setattr__(self, "products", _frozen(products))
        channel = _column("channel", _or_zero(self.channel, (count,)), (count,))
        if (channel != np.floor(channel)).any():
            raise ValueError("channel has an element that is no whole number")
        object.__setattr__(self, "channel", _frozen(channel.astype(np.int64)))
        object.__setattr__(self, "_core", self._visibilities())

    def __reduce__(self) -> Any:
        given = {part.name: getattr(self, part.name) for part in fields(self) if part.init}
        return (_observation, (type(self), given))

    def _visibilities(self) -> Any:
        numbers = {station.name: k for k, station in enumerate(self.array)}
        if len(numbers) != len(self.array):
            raise ValueError("two stations of the array have the same name")
        pairs = np.array([numbers[name] for name in self.stations.ravel().tolist()], dtype=np.int64)
        position = None
        if self.ra_hours is not None and self.dec_deg is not None:
            position = (float(self.ra_hours), float(self.dec_deg))
        metadata = {
            "source": self.source,
            "position": position,
            "mjd": None if self.mjd is None else int(self.mjd),
            "frequency_hz": self.frequency_hz,
            "bandwidth_hz": self.bandwidth_hz,
            "channels": list(self.channels),
            "circular": self.circular,
            "stations": [
                (s.name, s.position, s.sefd, s.feed_rotation, s.leakage) for s in self.array
            ],
            "history": list(self.history),
        }
        columns = {
            "time": self.time,
            "integration": self.integration,
            "stations": pairs,
            "uv": self.uv.reshape(-1),
            "products": self.products.reshape(-1),
            "sigmas": self.sigmas.reshape(-1),
            "opacity": np.asarray(self.opacity).reshape(-1),
            "channel": self.channel,
        }
        return _core.Visibilities(metadata, columns)

    @staticmethod
    def _of(core: Any) -> Observation:
        metadata, columns = core.metadata(), core.columns()
        array = tuple(
            Station(name, position and tuple(position), tuple(sefd), tuple(feed), tuple(leakage))
            for name, position, sefd, feed, leakage in metadata["stations"]
        )
        names = np.array([station.name for station in array] or [""], dtype=str)
        ra, dec = metadata["position"] or (None, None)
        return Observation(
            time=columns["time"],
            stations=names[columns["stations"]].reshape(-1, 2),
            uv=columns["uv"].reshape(-1, 2),
            products=columns["products"].reshape(-1, 4),
            sigmas=columns["sigmas"].reshape(-1, 4),
            circular=metadata["circular"],
            integration=columns["integration"],
            opacity=columns["opacity"].reshape(-1, 2),
            channel=columns["channel"],
            array=array,
            source=metadata["source"],
            ra_hours=ra,
            dec_deg=dec,
            mjd=metadata["mjd"],
            frequency_hz=metadata["frequency_hz"],
            bandwidth_hz=metadata["bandwidth_hz"],
            channels=tuple(metadata["channels"]),
            history=tuple(metadata["history"]),
        )

    @staticmethod
    def of_stokes_i(
        time: ArrayLike, stations: ArrayLike, uv: ArrayLike, vis: ArrayLike, sigma: ArrayLike, **more: Any
    ) -> Observation:
        """An observation of Stokes I alone, from columns of its rows; ``more`` are other fields of the class."""
        values = np.atleast_1d(complexes("vis", vis))
        if values.ndim != 1:
            raise ValueError(f"vis has the shape {values.shape}, not (rows,)")
        products = np.zeros((len(values), 4), dtype=np.complex128)
        products[:, 0] = values
        sigmas = np.full((len(values), 4), np.nan)
        error = real("sigma", sigma)
        error = np.full(values.shape, error) if error.ndim == 0 else error
        sigmas[:, 0] = _column("sigma", error, values.shape)
        return Observation(
            np.atleast_1d(real("time", time)), np.asarray(stations), real("uv", uv), products, sigmas, **more
        )

    @staticmethod
    def read(path: Union[str, PathLike[str]]) -> Observation:
        """Reads a file: UVFITS, eht-imaging's text, the EHT's public csv and txt, or kerrlight's csv."""
        with open(path, "rb") as file:
            bytes_ = file.read()
        try:
            core, _ = _core.Visibilities.decode(bytes_)
        except ValueError as error:
            raise ValueError(f"{fspath(path)}: {error}") from None
        return Observation._of(core)

    def write(self, path: Union[str, PathLike[str]], format: str | None = None) -> None:
        """Writes a file. The ending tells the format: .uvfits, .fits, .txt (eht-imaging's) or .csv; ``format`` may
        also be ``"eht-csv"`` or ``"eht-txt"``, total intensity as the EHT publishes it.
        """
        ending = "." + fspath(path).rsplit(".", 1)[-1].lower()
        kind = format or _ENDINGS.get(ending)
        if kind not in _FORMATS:
            allowed = ", ".join(_ENDINGS) if format is None else ", ".join(_FORMATS)
            raise ValueError(f"{format or fspath(path)} is not allowed: one of {allowed}")
        data = self._core.encode(kind)
        with open(path, "wb") as file:
            file.write(data)

    def __len__(self) -> int:
        return len(self.time)

    @property
    def u(self) -> Floats:
        """u in wavelengths."""
        return self.uv[:, 0]

    @property
    def v(self) -> Floats:
        """v in wavelengths."""
        return self.uv[:, 1]

    @property
    def vis(self) -> NDArray[np.complex128]:
        """Stokes I (Jy): the mean of both parallel hands, or the one that there is; NaN where there is none."""
        return self._core.stokes_i()[0]

    @property
    def sigma(self) -> Floats:
        """Standard deviation of the real, and of the imaginary part of :attr:`vis` (Jy)."""
        return self._core.stokes_i()[1]

    def averaged(
        self, seconds: float | None = None, *, in_scans: bool = False, weighted: bool = True
    ) -> Observation:
        """Coherent averages of every baseline, one time for all baselines of an interval, so that closure quantities are
        kept.

        Intervals start at multiples of ``seconds`` since 0 h UTC. ``in_scans`` averages whole scans, which end where
        nothing was measured for a minute; with ``seconds``, pieces of at most that length from the start of each scan.

        ``weighted`` means count by 1/σ²; otherwise they are plain, with σ = √(Σσ²)/n, which is what eht-imaging's
        ``avg_coherent`` does. The time is the mean of those of the rows, where eht-imaging has the middle of the interval.

        Raises ``ValueError`` where ``seconds`` is neither in [1e-3, 1e9] nor left out with ``in_scans``.
        """
        if seconds is None:
            if not in_scans:
                raise ValueError("seconds is missing: give it, or in_scans=True for averages of whole scans")
            seconds = math.inf
        elif seconds == math.inf:
            raise ValueError("seconds = inf is not allowed: [1e-3, 1e9]")
        return Observation._of(self._core.averaged(float(seconds), bool(in_scans), bool(weighted)))

    def total_intensity(self) -> Observation:
        """The same data as Stokes I alone."""
        return Observation._of(self._core.total_intensity())

    def where(self, keep: ArrayLike) -> Observation:
        """The rows that ``keep``, a mask or an array of indices, selects."""
        rows = np.arange(len(self))[np.asarray(keep)]
        columns = ("time", "stations", "uv", "products", "sigmas", "integration", "opacity", "channel")
        return replace(self, **{name: getattr(self, name)[rows] for name in columns})

    def _closures(self, phases: bool, least_snr: float) -> Closures:
        found = self._core.closures(phases, float(least_snr))
        names = np.array([station.name for station in self.array] or [""], dtype=str)
        closures = Closures(**{**found, "stations": names[found["stations"]]})
        what = "closure phases" if phases else "closure amplitudes"
        repeats, of_scans = self._core.rows_that_do_not_close(phases)
        if repeats:
            text = f"{repeats} rows have the baseline, channel and time of another and make {what} of their own"
            warnings.warn(f"{text}: averaged() merges them", stacklevel=3)
        if of_scans is not None:
            text = f"{len(closures)} {what}, where averages of scans have {of_scans}: baselines have times of their own"
            warnings.warn(f"{text}, which averaged(in_scans=True) makes one", stacklevel=3)
        elif not len(closures):
            why = f"too few baselines are above {least_snr:g} sigma" if least_snr > 0 else "too few baselines share a time"
            warnings.warn(f"there are no {what}: {why}", stacklevel=3)
        return closures

    def closure_phases(self, least_snr: float = 0.0) -> Closures:
        """A largest set of independent closure phases of every scan, the least noisy first; baselines weaker than
        ``least_snr`` times their noise are left out.
        """
        return self._closures(True, least_snr)

    def log_closure_amplitudes(self, least_snr: float = 0.0) -> Closures:
        """A largest set of independent logarithms of closure amplitudes, as :meth:`closure_phases`."""
        return self._closures(False, least_snr)

    def fourier(
        self, shape: tuple[int, int], field_uas: float, *, pulse: str = "triangle", accuracy: float | None = None
    ) -> Fourier:
        """The transform from an image (rows from the north, each from the east) to the rows of this observation."""
        return Fourier(shape, field_uas, self.uv, pulse=pulse, accuracy=accuracy)

    @staticmethod
    def from_ehtim(obs: Any) -> Observation:
        """Converts an ``ehtim.obsdata.Obsdata``; its noise may not be in amplitude-only columns of other bases."""
        return Observation(**_ehtim.read(obs))

    def to_ehtim(self) -> Any:
        """An ``ehtim.obsdata.Obsdata``; needs eht-imaging, one spectral channel, and stations with positions."""
        return _ehtim.write(self)

    def _check_known(self) -> None:
        """Refuses data without what other packages want to know of them."""
        lacking = [
            name
            for name in ("ra_hours", "dec_deg", "mjd", "frequency_hz", "bandwidth_hz")
            if getattr(self, name) is None
        ]
        if lacking:
            raise ValueError(f"the data lack {', '.join(lacking)}: give it")
        if len(self.channels) > 1:
            raise ValueError(f"{len(self.channels)} spectral channels are not converted: average them first")

    @staticmethod
    def from_pyuvdata(data: Any, sigmas: ArrayLike | None = None) -> Observation:
        """Converts a ``pyuvdata.UVData`` in Jy with one phase centre.

        ``sigmas``, in the shape of its ``data_array``, are standard deviations of real and imaginary parts (Jy). Without
        them they are 1/√nsample: pyuvdata keeps the weights of a UVFITS file, which in EHT files are 1/σ², as numbers
        of samples. What is flagged counts as not measured.
        """
        return Observation(**_pyuvdata.read(data, sigmas))

    def to_pyuvdata(self) -> Any:
        """A ``pyuvdata.UVData``, with 1/σ² as numbers of samples, as :meth:`from_pyuvdata` reads it; needs pyuvdata, one
        spectral channel, and stations with positions."""
        return _pyuvdata.write(self)

    def __repr__(self) -> str:
        basis = "RR, LL, RL, LR" if self.circular else "I, Q, U, V"
        return f"<Observation of {self.source or 'no name'}: {len(self)} rows of {basis}, {len(self.array)} stations>"


def _observation(kind: type[Observation], given: dict[str, Any]) -> Observation:
    return kind(**given)


def _frozen(column: Any) -> Any:
    """A copy that cannot be written to: an observation does not change."""
    column = np.array(column, order="C")
    column.setflags(write=False)
    return column


def _check_range(name: str, values: Any, least: float, most: float) -> None:
    array = np.asarray([] if values is None else values, dtype=np.float64)
    outside = array[~((array >= least) & (array <= most))]
    if outside.size:
        raise ValueError(f"{name} = {outside.flat[0]:g} is not allowed: [{least:g}, {most:g}]")


def _or_zero(column: Any, shape: tuple[int, ...]) -> Any:
    return np.zeros(shape) if column is None else column


def _column(name: str, value: Any, shape: tuple[int, ...]) -> Floats:
    array = np.ascontiguousarray(np.atleast_1d(real(name, value)))
    if array.shape != shape:
        raise ValueError(f"{name} has the shape {array.shape}, not {shape}")
    return array
