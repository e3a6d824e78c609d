"""The program ``kerrlight``: ``kerrlight ...`` and ``python -m kerrlight ...`` are the same."""

from __future__ import annotations

import sys

from kerrlight import _core
from kerrlight._program import LAUNCHER


def main() -> int:
    """Runs the program on this process's arguments and returns its exit code."""
    return _core.program(["kerrlight", *sys.argv[1:]], LAUNCHER)


if __name__ == "__main__":
    sys.exit(main())
