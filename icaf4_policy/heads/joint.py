"""The joint that moves the part a point lies on: its type, its direction, where it is."""

from __future__ import annotations

from torch import Tensor, nn

from icaf4_policy.heads.mlp import PointMLP

#: Classes of the type logits: the codes of ``Sample.joint_type`` plus one.
NUM_JOINT_TYPES = 3


class JointHead(nn.Module):
    """Type logits, axis direction, and the vector from the point to the nearest axis point."""

    def __init__(self, in_channels: int) -> None:
        super().__init__()
        self.mlp = PointMLP(in_channels, 64, NUM_JOINT_TYPES + 6)

    def forward(self, features: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Logits (B, N, 3), axis (B, N, 3) and offset (B, N, 3), from features (B, N, C).

        The axis is in the level frame and near unit length once trained; the offset is in network
        units, level frame.
        """
        return self.mlp(features).split((NUM_JOINT_TYPES, 3, 3), dim=-1)
