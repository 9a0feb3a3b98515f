"""Which anchor grasps succeed at a point, and how to refine each (paper, Section 5.3)."""

from __future__ import annotations

from torch import Tensor, nn

from icaf4_policy.heads.mlp import PointMLP


class GraspHead(nn.Module):
    """(1 + r) L channels: L anchor logits and L residuals of r numbers."""

    def __init__(self, in_channels: int, num_anchors: int, residual_size: int) -> None:
        super().__init__()
        self.shape = num_anchors, residual_size
        self.mlp = PointMLP(in_channels, 128, num_anchors * (1 + residual_size))

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (B, S, L) and residuals (B, S, L, r) from features (B, S, C)."""
        num_anchors, residual_size = self.shape
        channels = self.mlp(features)
        logits, residuals = channels.split((num_anchors, residual_size * num_anchors), dim=-1)
        return logits, residuals.unflatten(-1, self.shape)
