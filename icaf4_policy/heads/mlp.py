"""The three-layer MLP at the end of the backbone (paper, Sections 5.1 to 5.3)."""

from __future__ import annotations

from torch import Tensor, nn

from icaf4_policy.backbone.exact_linear import ExactLinear


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
        return self.layers(features.flatten(0, -2)).unflatten(0, features.shape[:-1])
