"""A linear layer and the normalisation that follows it as one linear map, once both are fixed."""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F


def folded(linear: nn.Linear, norm: nn.BatchNorm1d) -> tuple[Tensor, Tensor]:
    """Weight (O, C) and bias (O,) of ``norm(linear(x))``, ``norm`` in evaluation mode."""
    if norm.running_mean is None or norm.running_var is None:
        raise ValueError("norm keeps no running statistics to be folded.")
    scale = norm.weight * torch.rsqrt(norm.running_var + norm.eps)
    mean = norm.running_mean if linear.bias is None else norm.running_mean - linear.bias
    return linear.weight * scale[:, None], norm.bias - mean * scale


def normalized(linear: nn.Linear, norm: nn.BatchNorm1d, x: Tensor) -> Tensor:
    """``norm(linear(x))`` (n, O) of x (n, C), in one product where ``norm`` is fixed."""
    if norm.training:
        return norm(linear(x))
    return F.linear(x, *folded(linear, norm))
