"""The three-layer MLP at the end of the backbone (paper, Sections 5.1 to 5.3)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, cast

from torch import Tensor, nn
from torch.nn import functional as F

from icaf4_policy.backbone.exact_linear import ExactLinear
from icaf4_policy.backbone.folding import normalized


class PointMLP(nn.Module):
    """Three linear layers over the last axis, the first two normalised and rectified."""

    def __init__(self, in_channels: int, hidden: int, out_channels: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Linear(in_channels, hidden, bias=False),
            nn.BatchNorm1d(hidden),
            nn.ReLU(inplace=True),
            nn.Linear(hidden, hidden, bias=False),
            nn.BatchNorm1d(hidden),
            nn.ReLU(inplace=True),
            ExactLinear(hidden, out_channels),
        )

    def forward(self, features: Tensor) -> Tensor:
        """(..., out_channels) from (..., in_channels)."""
        hidden = features.flatten(0, -2)
        if self.training:
            hidden = self.layers(hidden)
        else:
            first, norm1, _, second, norm2, _, last = cast(Iterable[Any], self.layers)
            hidden = F.relu(normalized(first, norm1, hidden), inplace=True)
            hidden = last(F.relu(normalized(second, norm2, hidden), inplace=True))
        return hidden.unflatten(0, features.shape[:-1])
