"""Whether a point can be grasped and its part moved by it (paper, Section 5.3)."""

from __future__ import annotations

from torch import Tensor, nn

from icaf4_policy.heads.mlp import PointMLP


class AffordanceHead(nn.Module):
    """Two logits a point: no, yes."""

    def __init__(self, in_channels: int) -> None:
        super().__init__()
        self.mlp = PointMLP(in_channels, 64, 2)

    def forward(self, features: Tensor) -> Tensor:
        """Logits (B, N, 2) from features (B, N, C)."""
        return self.mlp(features)
