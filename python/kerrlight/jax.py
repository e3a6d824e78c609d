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

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

__all__ = ["apply"]


def _complex(dtype: Any) -> Any:
    return jnp.complex64 if dtype == jnp.float32 else jnp.complex128


def _call(function: Any, shape: tuple[int, ...], dtype: Any, values: Any) -> Any:
    result = jax.ShapeDtypeStruct(shape, dtype)

    def host(array: Any) -> Any:
        return np.asarray(function(np.asarray(array)), dtype=dtype)

    return jax.pure_callback(host, result, values, vmap_method="sequential")


@partial(jax.custom_vjp, nondiff_argnums=(0,))
def apply(operator: Any, values: Any) -> Any:
    """``operator.apply(values)`` for an array of JAX, under ``jit``, ``grad`` and ``vmap``.

    ``operator`` is a :class:`kerrlight.ForwardModel`, what its ``voxels`` or ``at`` gives, or a
    :class:`kerrlight.Fourier`. The work is done on the host; results have the precision of ``values``.
    """
    values = jnp.asarray(values)
    dtype = _complex(values.dtype) if getattr(operator, "is_complex", False) else values.dtype
    return _call(operator.apply, operator.output_shape, dtype, values)


def _forward(operator: Any, values: Any) -> tuple[Any, Any]:
    return apply(operator, values), jnp.zeros(0, jnp.asarray(values).dtype)


def _backward(operator: Any, like: Any, cotangent: Any) -> tuple[Any]:
    # Cotangents of JAX are the conjugates of gradients.
    return (_call(operator.vjp, operator.input_shape, like.dtype, jnp.conj(cotangent)),)


apply.defvjp(_forward, _backward)
