"""Normalised coordinates of each point, in its part's box and in the object's (Section 5.2)."""

from __future__ import annotations

from torch import Tensor, nn

from icaf4_policy.heads.mlp import PointMLP


class NocsHead(nn.Module):
    """NPCS and NAOCS, 3 K channels each: a point's own part selects its three."""

    def __init__(self, in_channels: int, num_parts: int) -> None:
        super().__init__()
        self.num_parts = num_parts
        self.mlp = PointMLP(in_channels, 96, 6 * num_parts)

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """NPCS and NAOCS, both (B, N, K, 3), 0.5 at the box's centre, from features (B, N, C)."""
        coordinates = self.mlp(features) + 0.5
        return coordinates.unflatten(-1, (2, self.num_parts, 3)).unbind(dim=-3)
