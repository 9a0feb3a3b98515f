"""Which anchor grasps succeed at a point, and how to refine each (paper, Section 5.3)."""

from __future__ import annotations

from torch import Tensor, nn
from torch.nn import functional as F

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

    def at_matches(self, features: Tensor, index: Tensor) -> tuple[Tensor, Tensor]:
        """Logits (B, S, L), and the residuals that a loss asks for: (n, r) at ``index`` alone.

        What ``forward`` gives, without the other residuals, which cost r times what the logits do.

        Args:
            features: (B, S, C).
            index: int64 (n,), counted through (B, S, L).
        """
        num_anchors, _ = self.shape
        last = self.mlp.layers[-1]
        assert isinstance(last, nn.Linear)
        hidden = self.mlp.layers[:-1](features.flatten(0, -2))  # (B S, H)
        logits = F.linear(hidden, last.weight[:num_anchors], last.bias[:num_anchors])
        weight = last.weight[num_anchors:].unflatten(0, self.shape)  # (L, r, H)
        bias = last.bias[num_anchors:].unflatten(0, self.shape)  # (L, r)
        point, anchor = index // num_anchors, index % num_anchors
        # (n, r, H) @ (n, H, 1)
        residuals = (weight[anchor] @ hidden[point, :, None])[..., 0] + bias[anchor]
        return logits.unflatten(0, features.shape[:-1]), residuals
