"""Fits: emission in three dimensions from visibilities or movies, and static images, as ``kerrlight fit`` makes them.

A fit runs in this process and keeps itself in a folder, so that another process can resume it, with this class or with
``kerrlight fit --resume``.
"""

from __future__ import annotations

import json
import os
import re
import tempfile
from functools import cached_property
from itertools import count
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Callable, Iterator, Literal, Mapping, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kerrlight import _core, _program
from kerrlight._arrays import column, finite
from kerrlight._program import FitError
from kerrlight.interferometry import Observation
from kerrlight._settings import Settings, overrides_of, text_of
from kerrlight.posterior import Posterior, draw
from kerrlight.report import Report
from kerrlight.results import Images, Number, Polarization, Ring, Step, numbers_of, step_of
from kerrlight.volume import Volume

__all__ = ["Fit", "FitError", "Images", "Number", "Polarization", "Posterior", "Report", "Ring", "Step", "Volume"]

Data = Union[None, str, "PathLike[str]", Observation, ArrayLike]
"""A file of visibilities, images or a light curve; an observation; images in Jy/pixel over (t, y, x)."""
Model = Literal["image", "volume"]


class Fit:
    """A fit.

    :param config: settings as of a fit file: a dictionary, TOML text or the path of a file. Without settings and
        ``data``, the built-in experiment, a flare of Sgr A* seen by the ngEHT.
    :param folder: the folder of the run, new or empty; by default ``kerrlight-fit``, or ``kerrlight-fit-2``, ….
    :param data: what is fitted: the path of a file of visibilities, images or a light curve, a
        :class:`kerrlight.Observation`, or images in Jy/pixel over (t, y, x), rows from the north. With ``config`` they take
        the place of the file that it names; without, settings are guessed as by ``kerrlight fit --data``, and ``guessed``
        says how.
    :param times: of the images of an array (M), at equal steps.
    :param model: with ``data`` alone: ``"image"`` for a static image, ``"volume"`` for emission around a hole.
    :param set: changes with dotted keys, such as ``{"training.steps": 500}`` or
        ``{"hole": kerrlight.Hole.m87_star(0.9)}``; None removes a key.
    :param base: where relative paths in the settings start from: by default the folder of their file, else the current
        one.
    :raises ValueError: for settings that the program refuses, and for what it cannot guess, with its words.

    ::

        fit = kerrlight.Fit(set={"training.steps": 500}).run()
        fit.psnr_db, fit.verdict, fit.volume, fit.report()
    """

    def __init__(
        self,
        config: Settings = None,
        folder: Union[None, str, PathLike[str]] = None,
        *,
        data: Data = None,
        times: ArrayLike | None = None,
        model: Model | None = None,
        set: Mapping[str, Any] | None = None,
        base: Union[None, str, PathLike[str]] = None,
    ) -> None:
        text, base = text_of(config, base)
        # What is built in or guessed has no folder of its own, as in the program.
        self._base = os.path.abspath(base) if text is not None else base
        self.folder = Path(fspath(folder)) if folder is not None else _free()
        """The folder of the run."""
        self._given, changes = _in_memory(data, times)
        """Data in memory: the name of their file in the folder, and its bytes."""
        if self._given is not None:
            self.folder = self.folder.absolute()
        changes += overrides_of(set)
        if text is None and data is not None:
            self._guess(data, model, changes)
            return
        if model is not None:
            raise ValueError(f"model = {model!r} goes with data alone: the settings say what is fitted")
        if text is not None and data is not None:
            changes = [*self._named(text, data), *changes]
        self._check(["fit", *_set(changes)], text)

    @staticmethod
    def open(folder: Union[str, PathLike[str]]) -> Fit:
        """A fit that was begun earlier, to look at or to resume."""
        fit = object.__new__(Fit)
        fit.folder = Path(fspath(folder))
        fit._given, fit._base = None, os.path.abspath(".")
        fit._check(["fit"], (fit.folder / "fit.toml").read_text(encoding="utf-8"))
        return fit

    @staticmethod
    def init(
        path: Union[str, PathLike[str]],
        data: Union[None, str, PathLike[str]] = None,
        model: Model | None = None,
    ) -> Path:
        """Writes a fit file to start from, with a comment at every key, as ``kerrlight fit --init`` does.

        :param path: the new file.
        :param data: the file of data that it is for; without one, the built-in experiment.
        """
        words = ["fit", "--init", *([fspath(data)] if data is not None else []), "-o", fspath(path)]
        _program.call([*words, *(["--model", model] if model is not None else [])])
        return Path(path)

    def _check(self, words: list[str], text: str | None) -> None:
        """Settings with their changes; refused if they make no sense."""
        given = None if text is None else (text, self._base)
        self.settings, answer = _program.call([*words, "--print"], settings=given)
        """The settings as TOML, with all changes."""
        self.guessed: list[str] = answer["guessed"]
        """Settings that were read from the data, and those that were assumed because they do not tell."""
        tables = answer["settings"]
        self._steps: int = tables["training"]["steps"] if "training" in tables else tables["image"]["iterations"]

    def _guess(self, data: Any, model: Model | None, changes: list[str]) -> None:
        words = [*(["--model", model] if model is not None else []), *_set(changes)]
        with tempfile.TemporaryDirectory(prefix="kerrlight-") as made:
            path = os.path.abspath(fspath(data)) if self._given is None else self._write(Path(made))
            try:
                self._check(["fit", "--data", path, *words], None)
            except ValueError as error:
                words_of_python = re.sub(r"--set '([\w.]+)=(.*)'", r'set={"\1": \2}', str(error))
                raise ValueError(words_of_python.replace(path, os.path.basename(path))) from None
        if self._given is not None:
            guessed = self.guessed
            self._check(["fit", *_set(self._named(self.settings, data))], self.settings)
            self.guessed = guessed

    def _named(self, text: str, data: Any) -> list[str]:
        """The change that has settings name the file of data."""
        if self._given is None:
            return overrides_of({_core.data_key(text): os.path.abspath(fspath(data))})
        kind = "visibilities" if isinstance(data, Observation) else "movie"
        return overrides_of({f"data.{kind}.path": self._place})

    @property
    def _place(self) -> str:
        """Path for data in memory."""
        assert self._given is not None
        return os.path.abspath(self.folder / self._given[0])

    def _write(self, folder: Path) -> str:
        assert self._given is not None
        name, content = self._given
        (folder / name).write_bytes(content)
        return os.path.abspath(folder / name)

    def run(
        self,
        callback: Callable[[Step], object] | None = None,
        *,
        progress: bool = True,
        threads: int | None = None,
        memory: str | None = None,
    ) -> Fit:
        """Runs the fit, or resumes it where its folder holds a part of it.

        :param callback: called on this thread with each :class:`Step` of the log, for which the fit waits. What it raises
            stops the fit after the step, and is raised. A static image has no steps.
        :param progress: whether to show a bar, if tqdm is installed.
        :param threads: how many threads to use, which changes no result.
        :param memory: a limit, such as ``"4GiB"``.
        :raises FitError: if the fit fails while it runs.

        Ctrl-C stops it after the step that is under way, and raises ``KeyboardInterrupt``; ``run`` again goes on. What the
        program says meanwhile goes to the logger ``kerrlight`` of :mod:`logging`. Other threads of Python go on, and may
        run fits of their own.
        """
        if callback is not None and not callable(callback):
            raise TypeError(f"callback = {callback!r} is not allowed: a function")
        is_begun = (self.folder / "fit.toml").is_file()
        if is_begun:
            self._check_same()
        words = ["fit", "--resume" if is_begun else "-o", fspath(self.folder), *_program.limits(threads, memory)]
        made = [] if is_begun or self._given is None else self._bring()
        try:
            with _Steps(callback, progress) as listener:
                _program.call(words, listener, None if is_begun else (self.settings, self._base))
        finally:
            if made and not (self.folder / "fit.toml").is_file():
                _remove(made)
        self.__dict__.pop("results", None)
        return self

    def _bring(self) -> list[Path]:
        """Writes data in memory into a folder that is new or empty; what it makes, if that is to be removed again."""
        # What a run has left that was cut off before it had settings is nothing.
        name, content = self._given or ("", b"")
        left = {"lock", "inputs.json"}

        def is_left(of: Path) -> bool:
            same = of.name == name and of.is_file() and of.read_bytes() == content
            return of.name in left or of.name.startswith(".kerrlight-") or same

        if self.folder.exists() and not all(is_left(of) for of in self.folder.iterdir()):
            raise ValueError(f"{self.folder} exists and is not an empty folder: give another one")
        made = [] if self.folder.exists() else [self.folder]
        self.folder.mkdir(parents=True, exist_ok=True)
        return [*made, Path(self._write(self.folder))]

    def _check_same(self) -> None:
        kept = (self.folder / "fit.toml").read_text(encoding="utf-8")
        name, content = self._given or ("", b"")
        is_same = _core.is_same_fit(kept, self.settings, self._base)
        if not is_same or name and (self.folder / name).read_bytes() != content:
            raise ValueError(
                f"{self.folder} holds a fit with other settings: give another folder, or Fit.open({str(self.folder)!r})"
            )

    @property
    def log(self) -> list[Step]:
        """All steps that the log tells of so far; ``training.log_every`` sets how often."""
        try:
            text = (self.folder / "log.jsonl").read_text(encoding="utf-8")
        except FileNotFoundError:
            return []
        # The last line may be under way.
        steps = (step_of(line) for line in text.split("\n")[:-1] if line)
        return [step for step in steps if step is not None]

    @cached_property
    def results(self) -> dict[str, Any]:
        """All numbers of ``results.json``."""
        return json.loads(self._written("results.json").read_text(encoding="utf-8"))

    @property
    def verdict(self) -> str:
        """Verdict: whether the model explains its data, in words."""
        return self.results["verdict"]["text"]

    @property
    def loss(self) -> float:
        """At the end."""
        return self.results["loss"]

    @property
    def chi2_per_datum(self) -> dict[str, float]:
        """χ² per datum of each kind of data."""
        return self.results["chi2_per_datum"]

    @property
    def psnr_db(self) -> float | None:
        """Peak signal-to-noise ratio of the emission; None where the truth is not known."""
        return self.results.get("psnr_db")

    @property
    def ring(self) -> Ring | None:
        """The ring of a static image; None if none is claimed: ``ring_sentence`` says why."""
        return numbers_of(Ring, self.results, "ring_")

    @property
    def ring_sentence(self) -> str | None:
        """The ring in words, or why none is claimed; None if the image has none."""
        return self.results.get("ring_sentence")

    @property
    def polarization(self) -> Polarization | None:
        """Numbers of the linear polarisation of a static image, where it was fitted (``[polarization]``)."""
        return numbers_of(Polarization, self.results, "polarization_")

    @property
    def beta2(self) -> complex | None:
        """β₂ = ∫ P e^(−2iφ)/∫ I (Palumbo, Wong & Prather 2020), where polarisation was fitted; ``polarization`` has errors."""
        found = self.polarization
        if found is None:
            return None
        angle = np.radians(found.beta2_deg.value)
        return complex(found.beta2.value * np.cos(angle), found.beta2.value * np.sin(angle))

    def _written(self, name: str) -> Path:
        path = self.folder / name
        if not path.is_file():
            raise FileNotFoundError(f"{self.folder} holds no {name} yet: run() it to its end")
        return path

    @property
    def volume(self) -> Volume:
        """The recovered emission."""
        return Volume(self._written("volume.npz"))

    @property
    def truth(self) -> Volume:
        """The true emission, where it is known."""
        return Volume(self._written("truth.npz"))

    @property
    def movie(self) -> Images:
        """The images of the recovered emission."""
        return Images(self._written("movie.npz"))

    @property
    def image(self) -> Images:
        """The static image of settings with a table ``[image]``."""
        return Images(self._written("image.npz"))

    def posterior(
        self,
        samples: int,
        *,
        progress: bool = True,
        threads: int | None = None,
        memory: str | None = None,
    ) -> Posterior:
        """Draws from the posterior: volumes, and geometries where the geometry is not known, that the data leave possible,
        as ``kerrlight posterior`` does.

        :param samples: number of draws, those of earlier calls included; each takes about as long as the fit.
        :raises ValueError: for fits around which nothing is drawn.

        Ctrl-C stops it; the draws that are complete are kept, and the next call continues.
        """
        self._written("results.json")
        return draw(self.folder, samples, progress, _program.limits(threads, memory))

    def report(self) -> Report:
        """The page of the fit."""
        return Report(self._written("report.html"))

    def __repr__(self) -> str:
        return f"<Fit in {self.folder}: {self._steps} steps>"


class _Steps(_program.Listener):
    """Hands steps to a callback."""

    def __init__(self, callback: Callable[[Step], object] | None, progress: bool) -> None:
        super().__init__("step", progress)
        self._callback = callback

    def line(self, json: str) -> None:
        step = step_of(json) if self._callback is not None else None
        if step is not None and self._callback is not None:
            self._callback(step)


def _set(changes: list[str]) -> list[str]:
    return [word for change in changes for word in ("--set", change)]


def _in_memory(data: Data, times: ArrayLike | None) -> tuple[tuple[str, bytes] | None, list[str]]:
    """The file of data in memory, its name and bytes, and what it settles beside."""
    if data is None or isinstance(data, (str, PathLike, Observation)):
        if times is not None:
            raise ValueError("times go with images in an array: files and observations have their own")
        return _file_of(data) if isinstance(data, Observation) else None, []
    images = finite("data", data)
    if images.ndim not in (2, 3) or images.size == 0:
        raise ValueError(f"data have the shape {images.shape}: give images over (t, y, x)")
    changes: list[str] = []
    if times is not None:
        moments = column("times", finite("times", times))
        frames = len(images) if images.ndim == 3 else 1
        even = np.linspace(moments[0], moments[-1], frames) if len(moments) == frames else None
        if even is None or not np.allclose(moments, even, rtol=0, atol=1e-6 * (even[-1] - even[0])):
            raise ValueError(f"times are not allowed: {frames} at equal steps, one for each image")
        changes = overrides_of({"data.movie.from": float(moments[0]), "data.movie.to": float(moments[-1])})
    return ("data.npy", _npy(images)), changes


def _file_of(observation: Observation) -> tuple[str, bytes]:
    """A file that holds all of an observation: UVFITS, or a table where stations have no positions."""
    try:
        return "data.uvfits", observation._core.encode("uvfits")
    except ValueError:
        if np.any(observation.sigmas[:, 2:] > 0):  # a table has no polarisation
            raise
        return "data.csv", observation._core.encode("csv")


def _npy(array: NDArray[Any]) -> bytes:
    from io import BytesIO

    content = BytesIO()
    np.save(content, np.ascontiguousarray(array))
    return content.getvalue()


def _remove(made: list[Path]) -> None:
    """Files and then folders that hold nothing else but a lock."""
    for path in reversed(made):
        if path.is_dir():
            (path / "lock").unlink(missing_ok=True)
            path.rmdir()
        else:
            path.unlink()


def _free() -> Path:
    names: Iterator[Path] = (
        Path("kerrlight-fit" if k == 1 else f"kerrlight-fit-{k}") for k in count(1)
    )
    return next(name for name in names if not name.exists())
