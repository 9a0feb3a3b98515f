"""Which part each point lies on (paper, Section 5.1)."""

from __future__ import annotations

from torch import Tensor, nn

from icaf4_policy.heads.mlp import PointMLP


class SegmentationHead(nn.Module):
    """K logits a point."""

    def __init__(self, in_channels: int, num_parts: int) -> None:
        super().__init__()
        self.mlp = PointMLP(in_channels, 64, num_parts)

    def forward(self, features: Tensor) -> Tensor:
        """Logits (B, N, K) from features (B, N, C)."""
        return self.mlp(features)
