"""Fits: emission in three dimensions from visibilities or movies, as ``kerrlight fit`` recovers it.

A fit runs in a process of its own with a folder of its own, so that it survives the notebook that started it and can
be resumed, by this class or by ``kerrlight fit --resume``.
"""

from __future__ import annotations

import json
import os
import subprocess
import tempfile
from functools import cached_property
from itertools import count
from os import PathLike, fspath
from pathlib import Path
from typing import Any, Callable, Iterator, Mapping, Union

import numpy as np
from numpy.typing import NDArray

from kerrlight import _core, _program
from kerrlight._program import FitError
from kerrlight.pictures import Settings, overrides_of, text_of
from kerrlight.posterior import Posterior, draw
from kerrlight.report import Report
from kerrlight.volume import Volume

__all__ = ["Fit", "FitError", "Posterior", "Report", "Volume"]

Callback = Callable[[Mapping[str, Any]], object]


class Fit:
    """A fit.

    :param config: settings as of a fit file: a dictionary, TOML text, the path of a file, or nothing for the built-in
        experiment, a flare of Sgr A* seen by the ngEHT.
    :param folder: the folder of the run, new or empty; by default ``kerrlight-fit``, or ``kerrlight-fit-2``, ….
    :param set: changes with dotted keys, such as ``{"training.steps": 500}``; None removes a key.
    :param base: where relative paths in the settings start from: by default the folder of their file, else the current
        one.
    :raises ValueError: for settings that the program refuses, with its words.

    ::

        fit = kerrlight.Fit(set={"training.steps": 500}).run()
        fit.results["psnr_db"], fit.volume, fit.report()
    """

    def __init__(
        self,
        config: Settings = None,
        folder: Union[None, str, PathLike[str]] = None,
        *,
        set: Mapping[str, Any] | None = None,
        base: Union[None, str, PathLike[str]] = None,
    ) -> None:
        self._text, self._base = text_of(config, base)
        self._set = overrides_of(set)
        self.folder = Path(fspath(folder)) if folder is not None else _free()
        """The folder of the run."""
        if not self._set and self._text is not None:
            _core.check_fit(self._text)
        self.settings = self._settings()
        """The settings as TOML, with all changes."""
        self._steps = _core.check_fit(self.settings)

    @staticmethod
    def open(folder: Union[str, PathLike[str]]) -> Fit:
        """A fit that was begun earlier, to look at or to resume."""
        fit = object.__new__(Fit)
        fit.folder = Path(fspath(folder))
        fit.settings = (fit.folder / "fit.toml").read_text(encoding="utf-8")
        fit._text, fit._base, fit._set = fit.settings, ".", []
        fit._steps = _core.check_fit(fit.settings)
        return fit

    def _file(self) -> Any:
        """A file of the settings for the program, beside what its paths start from."""
        file = tempfile.NamedTemporaryFile(
            "w", dir=self._base, prefix=".kerrlight-", suffix=".toml", encoding="utf-8"
        )
        file.write(self._text or "")
        file.flush()
        return file

    def _command(self, file: Any) -> list[str]:
        words = [*_program.LAUNCHER, "fit"]
        words += [file.name] if file is not None else []
        for change in self._set:
            words += ["--set", change]
        return words

    def _settings(self) -> str:
        if self._text is not None and not self._set:
            return self._text
        file = self._file() if self._text is not None else None
        try:
            command = [*self._command(file), "--print"]
            done = subprocess.run(command, capture_output=True, text=True, stdin=subprocess.DEVNULL)
        finally:
            if file is not None:
                file.close()
        if done.returncode != 0:
            raise ValueError(_program.said(done.stderr, file))
        return done.stdout

    def run(
        self,
        callback: Callback | None = None,
        *,
        progress: bool = True,
        threads: int | None = None,
        memory: str | None = None,
    ) -> Fit:
        """Runs the fit, or resumes it where its folder holds a part of it.

        :param callback: called with each line of the log that has a loss, a dictionary with ``step``, ``loss``, ``chi2_per_datum`` and,
            where the truth is known, ``psnr_db``. What it raises stops the fit after its step, and is raised.
        :param progress: whether to show a bar, if tqdm is installed.
        :param threads: how many threads to use, which changes no result.
        :param memory: a limit, such as ``"4GiB"``.
        :raises FitError: if the fit fails while it runs.

        Ctrl-C stops it after the step that is under way, and raises ``KeyboardInterrupt``; ``run`` again goes on.
        """
        is_begun = (self.folder / "fit.toml").is_file()
        if is_begun:
            self._check_same()
        if callback is not None and not callable(callback):
            raise TypeError(f"callback = {callback!r} is not allowed: a function")
        file = None if is_begun or self._text is None else self._file()
        try:
            command = self._command(file)
            if is_begun:
                command = [*command[:4], "--resume", os.fspath(self.folder)]
            else:
                command += ["-o", os.fspath(self.folder)]
            command += _program.limits(threads, memory)
            self._follow([*command, "--stop-with-input"], callback, progress, file)
        finally:
            if file is not None:
                file.close()
        self.__dict__.pop("results", None)
        return self

    def _check_same(self) -> None:
        kept = (self.folder / "fit.toml").read_text(encoding="utf-8")
        if not _core.same_toml(kept, self.settings):
            raise ValueError(
                f"{self.folder} holds a fit with other settings: give another folder, or Fit.open({str(self.folder)!r})"
            )

    def _follow(
        self, command: list[str], callback: Callback | None, progress: bool, file: Any
    ) -> None:
        seen = len(self.log)
        bar = _program.bar(self._steps, "step") if progress else None

        def tell() -> None:
            nonlocal seen
            lines = self._lines()[seen:]
            seen += len(lines)
            for line in lines:
                _show(bar, line)
                if callback is not None and "loss" in line:
                    callback(line)

        try:
            # The end of its input makes it save its state and stop.
            _program.follow(command, tell, lambda child: child.stdin.close(), file)
        finally:
            if bar is not None:
                bar.close()

    def _lines(self) -> list[dict[str, Any]]:
        try:
            text = (self.folder / "log.jsonl").read_text(encoding="utf-8")
        except FileNotFoundError:
            return []
        # The last line may be under way.
        return [json.loads(line) for line in text.split("\n")[:-1] if line]

    @property
    def log(self) -> list[dict[str, Any]]:
        """All lines of the log so far."""
        return self._lines()

    @cached_property
    def results(self) -> dict[str, Any]:
        """All numbers of ``results.json``: ``psnr_db``, ``chi2_per_datum``, ``verdict`` and so on."""
        path = self.folder / "results.json"
        if not path.is_file():
            raise FileNotFoundError(f"{self.folder} holds no results yet: run() it to its end")
        return json.loads(path.read_text(encoding="utf-8"))

    @property
    def verdict(self) -> str:
        """Whether the model explains its data, in words."""
        return self.results["verdict"]["text"]

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
    def movie(self) -> dict[str, NDArray[Any]]:
        """Images: ``recovered`` and ``data``, arrays over (t, y, x) in Jy/pixel, with ``time`` in M and, where mass and
        distance are known, ``hours`` and ``field_uas``."""
        with np.load(self._written("movie.npz")) as arrays:
            return {name: arrays[name] for name in arrays}

    @property
    def image(self) -> dict[str, NDArray[Any]]:
        """The static image of settings with a table ``[image]``: ``recovered`` over (1, y, x) in Jy/pixel, rows from the
        north, with ``field_uas``, and ``recovered_q`` and ``recovered_u`` where they were fitted."""
        with np.load(self._written("image.npz")) as arrays:
            return {name: arrays[name] for name in arrays}

    def posterior(
        self,
        samples: int,
        *,
        progress: bool = True,
        threads: int | None = None,
        memory: str | None = None,
    ) -> Posterior:
        """How sure the fit is: draws volumes, and worlds where the world is not known, that the data leave possible,
        as ``kerrlight posterior`` does.

        :param samples: number of draws, those of earlier calls included; each takes about as long as the fit.
        :raises ValueError: for fits around which nothing is drawn.

        Ctrl-C stops it; the draws that are complete are kept, and the next call continues.
        """
        self._written("results.json")
        return draw(self.folder, samples, progress, _program.limits(threads, memory))

    def report(self) -> Report:
        """The page of the fit."""
        path = self.folder / "report.html"
        if not path.is_file():
            raise FileNotFoundError(f"{self.folder} holds no report yet: run() it to its end")
        return Report(path)

    def __repr__(self) -> str:
        return f"<Fit in {self.folder}: {getattr(self, '_steps', '?')} steps>"


def _free() -> Path:
    names: Iterator[Path] = (
        Path("kerrlight-fit" if k == 1 else f"kerrlight-fit-{k}") for k in count(1)
    )
    return next(name for name in names if not name.exists())


def _show(bar: Any, line: Mapping[str, Any]) -> None:
    if bar is None or "step" not in line:
        return
    bar.update(line["step"] - bar.n)
    if "loss" in line:
        bar.set_postfix(loss=f"{line['loss']:.4g}")
