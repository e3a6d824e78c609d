"""Representations of emission that are written in Python, for fits and comparisons beside kerrlight's own.

A class in a module of yours, ``blobs.py``, ::

    class Blobs(kerrlight.Representation):
        def __init__(self, region, *, count):
            ...

has the name ``"blobs:Blobs"`` in fit files and experiments, with its keywords in ``representation.own.settings``::

    kerrlight.Fit(set={"representation.kind": "blobs:Blobs", "representation.own.settings": {"count": 64}})

:class:`kerrlight.jax.Representation` and :class:`kerrlight.torch.Representation` need the function alone: derivatives
are theirs.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import sys
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from kerrlight._arrays import flat
from kerrlight._settings import of_json

__all__ = ["Region", "Representation"]

Singles = NDArray[np.float32]


@dataclass(frozen=True)
class Region:
    """Region in which a fit recovers emission: radii and the largest absolute z, in M; ``z_width`` may be infinite."""

    r_min: float
    r_max: float
    z_width: float


class Representation(ABC):
    """Emission e(x; parameters) at batches of points.

    A fit makes one of the region and the keywords in ``representation.own.settings``. A value may not depend on the batch that
    its point is in, nor on chance: a fit that was stopped resumes to the same bytes.
    """

    dimension: int = 3
    """3: points (x, y, z) in M where matter was at the reference time. 4: (t, x, y, z) of the emission."""
    parameters: int
    """Number of parameters."""

    @abstractmethod
    def initialise(self, seed: int) -> ArrayLike:
        """Parameters to start from, the same for the same seed."""

    @abstractmethod
    def eval(self, parameters: Singles, points: Singles) -> ArrayLike:
        """Emission at each of the points, an array of shape (points, dimension)."""

    @abstractmethod
    def vjp(
        self, parameters: Singles, points: Singles, cotangents: Singles, wants_points: bool
    ) -> tuple[ArrayLike, Union[ArrayLike, None]]:
        """Σ cotangent · de/dparameter; and cotangent · de/dx of each point where ``wants_points`` is true, which is for
        fits that look for the axis of the motion."""

    def project(self, parameters: Singles) -> Union[ArrayLike, None]:
        """The nearest parameters that are allowed, after each step; nothing, if all are."""
        return None


class _Checked:
    """A representation whose results have the right shape and kind, or say what is wrong with them."""

    def __init__(self, name: str, own: Any) -> None:
        self._name, self._own = name, own
        self.dimension, self.parameters = int(own.dimension), int(own.parameters)
        if self.dimension not in (3, 4):
            raise ValueError(f"{name}.dimension = {self.dimension} is not allowed: 3 or 4")
        if self.parameters < 1:
            raise ValueError(f"{name}.parameters = {self.parameters} is not allowed: 1 or more")
        self.initialise(0)

    def _array(self, method: str, value: Any, shape: tuple[int, ...]) -> Singles:
        array = np.asarray(value)
        if array.dtype.kind not in "fiu":
            raise TypeError(f"{self._name}.{method} gives {array.dtype}, not real numbers")
        if array.shape != shape:
            raise ValueError(f"{self._name}.{method} gives the shape {array.shape}, not {shape}")
        return flat(np.asarray(array, dtype=np.float32))

    def initialise(self, seed: int) -> Singles:
        return self._array("initialise", self._own.initialise(seed), (self.parameters,))

    def project(self, parameters: Singles) -> Union[Singles, None]:
        found = self._own.project(parameters)
        return None if found is None else self._array("project", found, (self.parameters,))

    def eval(self, parameters: Singles, points: Singles) -> Singles:
        return self._array("eval", self._own.eval(parameters, points), (len(points),))

    def vjp(
        self, parameters: Singles, points: Singles, cotangents: Singles, wants_points: bool
    ) -> tuple[Singles, Union[Singles, None]]:
        pair = self._own.vjp(parameters, points, cotangents, wants_points)
        if not isinstance(pair, tuple) or len(pair) != 2:
            raise TypeError(f"{self._name}.vjp gives {type(pair).__name__}, not a pair")
        first = self._array("vjp", pair[0], (self.parameters,))
        return first, self._array("vjp", pair[1], points.shape) if wants_points else None


def _module(name: str) -> Any:
    """A module of Python's path or the current folder, or a file."""
    folder = os.getcwd()
    if not name.endswith(".py"):
        if folder not in sys.path and "" not in sys.path:
            sys.path.insert(0, folder)
        return importlib.import_module(name)
    known = os.path.splitext(os.path.basename(name))[0]
    spec = importlib.util.spec_from_file_location(known, name)
    if spec is None or spec.loader is None:
        raise ImportError(f"{name} is no module")
    module = importlib.util.module_from_spec(spec)
    sys.modules[known] = module
    spec.loader.exec_module(module)
    return module


def _load(kind: str, region: tuple[float, float, float], own: str) -> _Checked:
    """The representation that the program names."""
    module, _, name = kind.rpartition(":")
    if not module or not name:
        raise ValueError(f'representation.kind = "{kind}" is not allowed: "module:Class"')
    made = getattr(_module(module), name)(Region(*region), **of_json(json.loads(own)))
    missing = [part for part in ("dimension", "parameters") if not hasattr(made, part)]
    missing += [part for part in ("initialise", "eval", "vjp", "project") if not hasattr(made, part)]
    if missing:
        raise TypeError(f"{kind} has no {' and no '.join(missing)}: see kerrlight.Representation")
    return _Checked(name, made)
