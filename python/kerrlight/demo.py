"""``python -m kerrlight.demo``: recovers a flare of Sgr A* from simulated visibilities and shows the report."""

from __future__ import annotations

import sys

from kerrlight.fit import Fit


def main() -> int:
    """Runs the built-in fit in a new folder; opens its report unless ``--no-browser`` is given."""
    fit = Fit()
    print(f"fitting in {fit.folder}", file=sys.stderr)
    fit.run()
    print(fit.verdict)
    report = fit.report()
    print(report.path)
    if "--no-browser" not in sys.argv[1:]:
        report.open()
    return 0


if __name__ == "__main__":
    sys.exit(main())
