"""Which anchor grasps succeed at a point, and how to refine each (paper, Section 5.3)."""

from __future__ import annotations

from torch import Tensor, nn

from icaf4_policy.heads.mlp import PointMLP


class GraspHead(nn.Module):
    """5 L channels: L anchor logits and L quaternion residuals."""

    def __init__(self, in_channels: int, num_anchors: int) -> None:
        super().__init__()
        self.num_anchors = num_anchors
        self.mlp = PointMLP(in_channels, 128, 5 * num_anchors)

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (B, S, L) and residuals (B, S, L, 4), wxyz, from features (B, S, C)."""
        channels = self.mlp(features)
        logits, residuals = channels.split((self.num_anchors, 4 * self.num_anchors), dim=-1)
        return logits, residuals.unflatten(-1, (self.num_anchors, 4))
