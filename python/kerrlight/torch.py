"""Forward models as functions of PyTorch, with their gradients.

>>> import torch
>>> import kerrlight, kerrlight.torch
>>> observer = kerrlight.Kerr(0.0).observer(inclination_deg=60)
>>> model = kerrlight.ForwardModel(observer, *kerrlight.screen(8, 20.0), r_min=3.0, r_max=9.0)
>>> emission = torch.ones(model.input_shape, dtype=torch.float64, requires_grad=True)
>>> kerrlight.torch.apply(model, emission).sum().backward()
>>> bool(torch.allclose(emission.grad, torch.from_numpy(model.weights)))
True
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch

__all__ = ["apply"]


def _array(tensor: Any) -> Any:
    return tensor.detach().resolve_conj().cpu().numpy()


class _Apply(torch.autograd.Function):  # type: ignore[misc, unused-ignore]
    @staticmethod
    def forward(ctx: Any, values: Any, operator: Any) -> Any:
        ctx.operator = operator
        ctx.like = values
        return torch.from_numpy(operator.apply(_array(values))).to(values.device)

    @staticmethod
    def backward(ctx: Any, cotangent: Any) -> Any:
        return _Adjoint.apply(cotangent, ctx.operator, ctx.like.dtype), None


class _Adjoint(torch.autograd.Function):  # type: ignore[misc, unused-ignore]
    @staticmethod
    def forward(ctx: Any, cotangent: Any, operator: Any, dtype: Any) -> Any:
        ctx.operator = operator
        values = np.ascontiguousarray(operator.vjp(_array(cotangent)))
        return torch.from_numpy(values).to(device=cotangent.device, dtype=dtype)

    @staticmethod
    def backward(ctx: Any, tangent: Any) -> Any:
        return _Apply.apply(tangent, ctx.operator), None, None


def apply(operator: Any, values: Any) -> Any:
    """``operator.apply(values)`` for a tensor, differentiable as often as one likes.

    ``operator`` is a :class:`kerrlight.ForwardModel`, what its ``voxels`` or ``at`` gives, or a
    :class:`kerrlight.Fourier`; tensors of other devices go through main memory.
    """
    return _Apply.apply(values, operator)
