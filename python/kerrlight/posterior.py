"""Posterior of a fit: the draws of :meth:`kerrlight.Fit.posterior`."""

from __future__ import annotations

import json
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, Iterator, Union

import numpy as np

from kerrlight import _program
from kerrlight._arrays import Floats, whole
from kerrlight.report import Report
from kerrlight.results import Feature, feature_of
from kerrlight.volume import Volume

__all__ = ["Posterior"]


class Posterior:
    """Draws around a finished fit, each a volume, and a geometry where that is not known.

    ``len(posterior)`` is their number, ``posterior[k]`` the volume of a draw.
    """

    def __init__(self, folder: Union[str, PathLike[str]]) -> None:
        self.folder = Path(folder)
        """The folder of the draws, ``posterior`` in that of the fit."""
        path = self.folder / "posterior.json"
        if not path.is_file():
            raise FileNotFoundError(f"{folder} holds no posterior: Fit.posterior(samples) draws one")
        self.summary: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        """All numbers of ``posterior.json``: ``geometry``, ``light_above_3_sigma`` and so on."""

    def __len__(self) -> int:
        return int(self.summary["samples"])

    def __getitem__(self, k: int) -> Volume:
        number = range(1, len(self) + 1)[k]
        return Volume(self.folder / f"sample_{number:04}.npz")

    def __iter__(self) -> Iterator[Volume]:
        return (self[k] for k in range(len(self)))

    @property
    def features(self) -> list[Feature]:
        """Bright places, the brightest first."""
        return [feature_of(found) for found in self.summary["features"]]

    @cached_property
    def mean(self) -> Volume:
        """Mean of the draws."""
        return Volume(self.folder / "mean.npz")

    @cached_property
    def deviation(self) -> Volume:
        """Their standard deviation."""
        return Volume(self.folder / "deviation.npz")

    @cached_property
    def geometries(self) -> dict[str, Floats]:
        """Each free parameter of the geometry in all draws; empty where the geometry is known."""
        path = self.folder / "geometries.csv"
        if not path.is_file():
            return {}
        table = np.genfromtxt(path, delimiter=",", names=True, comments="#", ndmin=1)
        names = [name for name in table.dtype.names or () if name in self.summary["geometry"]]
        return {name: np.ascontiguousarray(table[name]) for name in names}

    def interval(self, name: str, probability: float = 0.95) -> tuple[float, float]:
        """The central interval of a parameter of the geometry that holds so much of the draws."""
        if not 0 < probability < 1:
            raise ValueError(f"probability = {probability} is not allowed: between 0 and 1")
        if name not in self.geometries:
            known = ", ".join(self.geometries) or "none: the geometry is known"
            raise ValueError(f"{name} is no free parameter of the geometry, which are {known}")
        ends = np.quantile(self.geometries[name], [0.5 - 0.5 * probability, 0.5 + 0.5 * probability])
        return float(ends[0]), float(ends[1])

    def report(self) -> Report:
        """The page."""
        return Report(self.folder / "report.html")

    def __repr__(self) -> str:
        return f"<Posterior of {len(self)} draws in {self.folder}>"


def draw(folder: Path, samples: int, progress: bool, limits: list[str]) -> Posterior:
    """Draws around the fit in a folder."""
    samples = whole("samples", samples, 2, 100_000)
    with _program.Listener("draw", progress) as listener:
        _program.call(["posterior", str(folder), "--samples", str(samples), *limits], listener)
    return Posterior(folder / "posterior")
