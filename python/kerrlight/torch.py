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

from functools import cached_property
from typing import Any

import numpy as np
import torch

import kerrlight.representation

__all__ = ["Representation", "apply"]


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


class Representation(kerrlight.representation.Representation):
    """Emission as a module of PyTorch, for fits and comparisons; derivatives are PyTorch's.

    ::

        class Plain(kerrlight.torch.Representation):
            def __init__(self, region, *, width):
                self.region, self.width = region, width

            def network(self):
                return torch.nn.Sequential(torch.nn.Linear(3, self.width), torch.nn.SiLU(),
                                           torch.nn.Linear(self.width, 1), torch.nn.Softplus())

            def emission(self, network, points):
                return network(points / self.region.r_max)[:, 0]
    """

    def network(self) -> Any:
        """A module with its parameters to start from."""
        raise NotImplementedError

    def emission(self, network: Any, points: Any) -> Any:
        """Emission at points of shape (points, dimension)."""
        raise NotImplementedError

    def _drawn(self, seed: int) -> Any:
        # Networks are made on the processor: torch.manual_seed would seed the generators of all devices.
        with torch.random.fork_rng(devices=[]):
            torch.default_generator.manual_seed(seed)
            return self.network()

    @cached_property
    def _network(self) -> Any:
        return self._drawn(0)

    @property
    def parameters(self) -> int:  # type: ignore[override]
        """Number of parameters."""
        return sum(part.numel() for part in self._network.parameters())

    def _with(self, parameters: Any) -> Any:
        flat = torch.from_numpy(np.array(parameters))
        torch.nn.utils.vector_to_parameters(flat, self._network.parameters())
        return self._network

    def initialise(self, seed: int) -> Any:
        parts = self._drawn(seed).parameters()
        return torch.nn.utils.parameters_to_vector(parts).detach().numpy()

    def eval(self, parameters: Any, points: Any) -> Any:
        with torch.no_grad():
            return self.emission(self._with(parameters), torch.from_numpy(points)).numpy()

    def vjp(self, parameters: Any, points: Any, cotangents: Any, wants_points: bool) -> Any:
        network, at = self._with(parameters), torch.from_numpy(points)
        at.requires_grad_(wants_points)
        parts = list(network.parameters())
        asked = [*parts, at] if wants_points else parts
        values = self.emission(network, at)
        found = torch.autograd.grad(values, asked, torch.from_numpy(cotangents))
        flat = torch.cat([part.reshape(-1) for part in found[: len(parts)]]).numpy()
        return flat, found[-1].numpy() if wants_points else None
