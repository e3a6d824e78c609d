"""The program in this process: what it is told, what it says, and what it complains of as an exception."""

from __future__ import annotations

import json
import logging
import sys
from types import TracebackType
from typing import Any

from kerrlight import _core

LAUNCHER = [sys.executable, "-m", "kerrlight"]
"""Command that starts the program in a process of its own, as a comparison does for each fit."""

_LOG = logging.getLogger("kerrlight")


class FitError(RuntimeError):
    """A fit, a posterior or a comparison that failed while it ran; its settings made sense."""


class Busy(RuntimeError):
    """Another process runs the same case."""


class Listener:
    """Hears what the program says while it runs: words go to the logger ``kerrlight``, and a bar, where tqdm is installed,
    shows how much is done."""

    def __init__(self, unit: str = "", progress: bool = False) -> None:
        self._unit = unit
        self._bar: Any = None
        self._tqdm: Any = None
        if progress:
            try:
                from tqdm.auto import tqdm
            except ImportError:
                return
            self._tqdm = tqdm

    def words(self, text: str) -> None:
        """Words that the program writes to standard error."""
        _LOG.info("%s", text.rstrip("\n"))

    def line(self, json: str) -> None:
        """A line of the log of a run."""

    def done(self, count: int, of: int) -> None:
        """So much of so much is done."""
        if self._tqdm is None or of == 0:
            return
        if self._bar is None or self._bar.total != of:
            self.close()
            self._bar = self._tqdm(total=of, unit=self._unit)
        self._bar.update(count - self._bar.n)

    def close(self) -> None:
        """Ends the bar."""
        if self._bar is not None:
            self._bar.close()

    def __enter__(self) -> Listener:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def limits(threads: int | None, memory: str | None) -> list[str]:
    """Options of every command."""
    words = ["--threads", str(threads)] if threads is not None else []
    return [*words, "--memory", memory] if memory is not None else words


def call(
    words: list[str], listener: Listener | None = None, settings: tuple[str, str] | None = None
) -> tuple[str, dict[str, Any]]:
    """Does what a command line says, in this process; the interpreter is free meanwhile. Ctrl-C, and what the listener
    raises, stop it where it can be resumed, and are raised then.

    :param words: what follows ``kerrlight``.
    :param settings: of a fit: their text, and the folder that paths in it start from.
    :returns: its answer as text and as an object.
    """
    text, answer = _core.call(["kerrlight", *words], LAUNCHER, settings, listener or Listener())
    return text, json.loads(answer)
