"""The program ``kerrlight``: ``kerrlight ...`` and ``python -m kerrlight ...`` are the same."""

from __future__ import annotations

import sys

from kerrlight import _core


def main() -> int:
    """Runs the program on this process's arguments and returns its exit code."""
    launcher = [sys.executable, "-m", "kerrlight"]
    return _core.program(["kerrlight", *sys.argv[1:]], launcher)


if __name__ == "__main__":
    sys.exit(main())
