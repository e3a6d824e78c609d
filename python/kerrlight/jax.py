"""Forward models as functions of JAX, with their gradients.

>>> import jax, jax.numpy as jnp
>>> import kerrlight, kerrlight.jax
>>> observer = kerrlight.Kerr(0.0).observer(inclination_deg=60)
>>> model = kerrlight.ForwardModel(observer, *kerrlight.screen(8, 20.0), r_min=3.0, r_max=9.0)
>>> flux = jax.jit(lambda emission: kerrlight.jax.apply(model, emission).sum())
>>> slope = jax.grad(flux)(jnp.ones(model.input_shape))
>>> bool(jnp.allclose(slope[0], model.weights, rtol=1e-6))
True
"""

from __future__ import annotations

from functools import cached_property, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jax.flatten_util import ravel_pytree

import kerrlight.representation

__all__ = ["Representation", "apply"]


def _complex(dtype: Any) -> Any:
    return jnp.complex64 if dtype == jnp.float32 else jnp.complex128


def _call(function: Any, shape: tuple[int, ...], dtype: Any, values: Any) -> Any:
    result = jax.ShapeDtypeStruct(shape, dtype)

    def host(array: Any) -> Any:
        return np.asarray(function(np.asarray(array)), dtype=dtype)

    return jax.pure_callback(host, result, values, vmap_method="sequential")


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def apply(operator: Any, values: Any) -> Any:
    """``operator.apply(values)`` for an array of JAX, under ``jit``, ``grad`` and ``vmap``; there is no forward mode (``jvp``).

    ``operator`` is a :class:`kerrlight.ForwardModel`, what its ``voxels`` or ``at`` gives, or a
    :class:`kerrlight.Fourier`. The work is done on the host; results have the precision of ``values``.
    """
    values = jnp.asarray(values)
    if values.shape != tuple(operator.input_shape):
        raise ValueError(f"values have the shape {values.shape}, not {tuple(operator.input_shape)}")
    if values.dtype not in (jnp.float32, jnp.float64):
        raise TypeError(f"values have the type {values.dtype}: float32 or float64 are needed")
    dtype = _complex(values.dtype) if getattr(operator, "is_complex", False) else values.dtype
    return _call(operator.apply, operator.output_shape, dtype, values)


def _forward(operator: Any, values: Any) -> tuple[Any, Any]:
    return apply(operator, values), jnp.zeros(0, jnp.asarray(values).dtype)


def _backward(operator: Any, like: Any, cotangent: Any) -> tuple[Any]:
    # Cotangents of JAX are the conjugates of gradients.
    return (_call(operator.vjp, operator.input_shape, like.dtype, jnp.conj(cotangent)),)


apply.defvjp(_forward, _backward)


class Representation(kerrlight.representation.Representation):
    """Emission as a function of JAX, for fits and comparisons; derivatives are JAX's.

    ::

        class Blobs(kerrlight.jax.Representation):
            def __init__(self, region, *, count, sigma):
                self.region, self.count, self.sigma = region, count, sigma

            def initial(self, key):
                return {"center": self.region.r_max * jax.random.uniform(key, (self.count, 3), minval=-1),
                        "light": jnp.full(self.count, 0.1)}

            def emission(self, parameters, points):
                offset = points[:, None] - parameters["center"]
                return jnp.exp(-0.5 * (offset**2).sum(-1) / self.sigma**2) @ parameters["light"] ** 2
    """

    chunk: int = 16384
    """Points that are done at a time: functions are compiled once for this number."""

    def initial(self, key: Any) -> Any:
        """Parameters to start from: any tree of arrays."""
        raise NotImplementedError

    def emission(self, parameters: Any, points: Any) -> Any:
        """Emission at points of shape (points, dimension)."""
        raise NotImplementedError

    @cached_property
    def _tree(self) -> tuple[int, Any]:
        flat, unravel = ravel_pytree(self.initial(jax.random.key(0)))
        return len(flat), unravel

    @property
    def parameters(self) -> int:  # type: ignore[override]
        """Number of parameters."""
        return self._tree[0]

    @cached_property
    def _functions(self) -> tuple[Any, Any]:
        unravel = self._tree[1]

        def value(flat: Any, points: Any) -> Any:
            return self.emission(unravel(flat), points)

        def pull(flat: Any, points: Any, cotangents: Any) -> Any:
            return jax.vjp(value, flat, points)[1](cotangents)

        return jax.jit(value), jax.jit(pull)

    def _chunks(self, points: Any) -> Any:
        """Slices of the points, and what fills each up to a chunk: more of its first point."""
        for start in range(0, len(points), self.chunk):
            part = points[start : start + self.chunk]
            filling = np.broadcast_to(part[:1], (self.chunk - len(part), points.shape[1]))
            yield slice(start, start + len(part)), np.concatenate([part, filling])

    def initialise(self, seed: int) -> Any:
        # Seeds of draws have 64 bits, of which JAX takes 63, and without its x64 mode 32.
        key = jax.random.key((seed ^ (seed >> 32)) & 0xFFFFFFFF)
        return np.asarray(ravel_pytree(self.initial(key))[0])

    def eval(self, parameters: Any, points: Any) -> Any:
        values = np.empty(len(points), np.float32)
        for rows, part in self._chunks(points):
            values[rows] = self._functions[0](parameters, part)[: rows.stop - rows.start]
        return values

    def vjp(self, parameters: Any, points: Any, cotangents: Any, wants_points: bool) -> Any:
        total, of_points = np.zeros_like(parameters), np.zeros_like(points)
        for rows, part in self._chunks(points):
            padded = np.zeros(self.chunk, np.float32)
            padded[: rows.stop - rows.start] = cotangents[rows]
            first, second = self._functions[1](parameters, part, padded)
            total += np.asarray(first)
            if wants_points:
                of_points[rows] = second[: rows.stop - rows.start]
        return total, of_points if wants_points else None
