"""Black holes from Python: rays, lensed pictures, visibilities, tomography and gradients.

>>> import kerrlight
>>> hole = kerrlight.Kerr(0.9)
>>> observer = hole.observer(inclination_deg=60)
>>> rays = observer.trace([-6.0, 0.5], [2.0, 0.5], crossings=1)
>>> rays.outcome.tolist() == [kerrlight.Outcome.ESCAPED, kerrlight.Outcome.CAPTURED]
True
>>> print(f"{rays.crossings.r[0, 0]:.6f} M")
5.244939 M

Rays are in :mod:`kerrlight.rays`, pictures in :mod:`kerrlight.pictures`, fits in :mod:`kerrlight.fit`, the forward model
with its gradients in :mod:`kerrlight.model` (:mod:`kerrlight.torch`, :mod:`kerrlight.jax`), visibilities in
:mod:`kerrlight.interferometry` and :mod:`kerrlight.observing`, and kgeo's interface in :mod:`kerrlight.compat.kgeo`.

Lengths and times are in units of M (G = c = 1), angles in radians where no name says otherwise. Importing the
package imports nothing but itself: numpy comes with the first name that needs it.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from kerrlight._core import __version__

if TYPE_CHECKING:
    from kerrlight.comparison import Comparison, compare
    from kerrlight.fit import Fit, FitError
    from kerrlight.flow import Infall, Keplerian, PolarizationLaw, PowerLaw, Profile, Tabulated
    from kerrlight.fourier import Fourier
    from kerrlight.interferometry import Closures, Observation, Station
    from kerrlight.model import ForwardModel, VoxelModel, screen
    from kerrlight.observing import observe, stations
    from kerrlight.pictures import Movie, Picture, movie, render
    from kerrlight.posterior import Posterior
    from kerrlight.rays import Curve, GaussLegendre, Kerr, MinoTime, Observer, PathLength
    from kerrlight.report import Report
    from kerrlight.representation import Region, Representation
    from kerrlight.scene import Hole
    from kerrlight.table import Outcome, Points, Rays
    from kerrlight.volume import Volume

# The module of each name.
_MODULES = {
    "Closures": "interferometry",
    "Comparison": "comparison",
    "Curve": "rays",
    "Fit": "fit",
    "FitError": "fit",
    "ForwardModel": "model",
    "Fourier": "fourier",
    "GaussLegendre": "rays",
    "Hole": "scene",
    "Infall": "flow",
    "Keplerian": "flow",
    "Kerr": "rays",
    "MinoTime": "rays",
    "Movie": "pictures",
    "Observation": "interferometry",
    "Observer": "rays",
    "Outcome": "table",
    "PathLength": "rays",
    "Picture": "pictures",
    "Points": "table",
    "PolarizationLaw": "flow",
    "Posterior": "posterior",
    "PowerLaw": "flow",
    "Profile": "flow",
    "Rays": "table",
    "Region": "representation",
    "Report": "report",
    "Representation": "representation",
    "Station": "interferometry",
    "Tabulated": "flow",
    "Volume": "volume",
    "VoxelModel": "model",
    "compare": "comparison",
    "movie": "pictures",
    "observe": "observing",
    "render": "pictures",
    "screen": "model",
    "stations": "observing",
}

__all__ = [
    "Closures",
    "Comparison",
    "Curve",
    "Fit",
    "FitError",
    "ForwardModel",
    "Fourier",
    "GaussLegendre",
    "Hole",
    "Infall",
    "Keplerian",
    "Kerr",
    "MinoTime",
    "Movie",
    "Observation",
    "Observer",
    "Outcome",
    "PathLength",
    "Picture",
    "Points",
    "PolarizationLaw",
    "Posterior",
    "PowerLaw",
    "Profile",
    "Rays",
    "Region",
    "Report",
    "Representation",
    "Station",
    "Tabulated",
    "Volume",
    "VoxelModel",
    "__version__",
    "compare",
    "movie",
    "observe",
    "render",
    "screen",
    "stations",
]


# Not seen by type checkers, which know the names above and refuse others.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        module = _MODULES.get(name)
        if module is None:
            raise AttributeError(f"module 'kerrlight' has no attribute {name!r}")
        value = getattr(import_module(f"kerrlight.{module}"), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(_MODULES))
