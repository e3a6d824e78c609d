"""The program as a process of its own: started, followed, stopped, and what it complains of as an exception."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from typing import IO, Any, Callable

LAUNCHER = [sys.executable, "-m", "kerrlight"]
"""What starts it."""


class FitError(RuntimeError):
    """A fit, a posterior or a comparison that failed while it ran; its settings made sense."""


def limits(threads: int | None, memory: str | None) -> list[str]:
    """Options of every command."""
    words = ["--threads", str(threads)] if threads is not None else []
    return [*words, "--memory", memory] if memory is not None else words


def follow(
    command: list[str], tick: Callable[[], None], stop: Callable[[Any], object], file: Any = None
) -> None:
    """Runs it to its end. ``tick`` is called all the time; what it raises, or Ctrl-C, makes ``stop`` end the process.
    ``file`` are settings whose name nobody knows."""
    with tempfile.TemporaryFile("w+", encoding="utf-8") as heard:
        child = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=heard,
            start_new_session=True,
        )
        assert child.stdin is not None
        try:
            while child.poll() is None:
                tick()
                time.sleep(0.05)
            tick()
        except BaseException:
            stop(child)
            child.wait()
            raise
        finally:
            child.stdin.close()
        _check(child.returncode, heard, file)


def said(text: str, file: Any = None) -> str:
    """What the program complains of, without the name of a file that nobody knows."""
    lines = [line for line in text.splitlines() if line.strip()]
    at = next((k for k, line in enumerate(lines) if line.startswith("error: ")), 0)
    words = "\n".join(lines[at:]).removeprefix("error: ")
    return words.replace(f"{file.name}: ", "") if file is not None else words


def _check(code: int, heard: IO[str], file: Any) -> None:
    if code == 0:
        return
    heard.seek(0)
    words = said(heard.read(), file)
    if code == 2:
        raise ValueError(words)
    if code in (129, 130, 143):
        raise KeyboardInterrupt(words)
    raise FitError(words or f"the process ended with the code {code}")


def bar(total: int, unit: str) -> Any:
    """A bar, where tqdm is installed."""
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return None
    return tqdm(total=total, unit=unit)


class Counter:
    """Moves a bar on to a count that it asks for, once a second."""

    def __init__(self, total: int, unit: str, count: Callable[[], int], progress: bool) -> None:
        self._count = count
        self._bar: Any = bar(total, unit) if progress else None
        self._asked = time.monotonic()

    def __call__(self) -> None:
        if self._bar is not None and time.monotonic() - self._asked > 1.0:
            self._move()

    def _move(self) -> None:
        self._asked = time.monotonic()
        more = self._count() - self._bar.n
        if more > 0:
            self._bar.update(more)

    def close(self) -> None:
        """Moves it for the last time."""
        if self._bar is not None:
            self._move()
            self._bar.close()
