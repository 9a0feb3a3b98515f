"""The network: one backbone, five heads, one forward pass (paper, Section 5)."""

from __future__ import annotations

from dataclasses import dataclass, field

import torch
from torch import Tensor, nn

from artgym.errors import InvalidArgumentError
from icaf4_policy.anchors import AnchorConfig, anchors_from_config
from icaf4_policy.backbone.pointnet2 import BackboneConfig, PointNet2
from icaf4_policy.heads.affordance import AffordanceHead
from icaf4_policy.heads.grasp import GraspHead
from icaf4_policy.heads.joint import JointHead
from icaf4_policy.heads.nocs import NocsHead
from icaf4_policy.heads.segmentation import SegmentationHead


@dataclass(frozen=True, kw_only=True)
class ModelConfig:
    """What a network is for and how large it is.

    Attributes:
        category: "laptop", ...
        num_parts: K, the base included.
        length_unit: metres of one network unit; half the size of a typical object.
        num_points: points of a cloud.
        anchors: what grasps are refined from.
        backbone: sizes of the backbone.
    """

    category: str
    num_parts: int
    length_unit: float
    num_points: int = 2048
    anchors: AnchorConfig = field(default_factory=AnchorConfig)
    backbone: BackboneConfig = field(default_factory=BackboneConfig)

    def __post_init__(self) -> None:
        if self.num_parts < 1:
            raise InvalidArgumentError(f"num_parts={self.num_parts} must be at least 1.")
        if not 0 < self.length_unit < float("inf"):
            raise InvalidArgumentError(f"length_unit={self.length_unit} must be positive, metres.")
        if self.num_points < self.backbone.centers[0]:
            raise InvalidArgumentError(
                f"num_points={self.num_points} must be at least {self.backbone.centers[0]}, the "
                "centers of the first abstraction."
            )


@dataclass(frozen=True, kw_only=True)
class Outputs:
    """What the heads say.

    B clouds, N points, K parts, S points asked for grasps, L anchors with residuals of r numbers.

    Attributes:
        segmentation: logits (B, N, K).
        npcs: (B, N, K, 3) and naocs: (B, N, K, 3), 0.5 at the box's centre.
        affordance: logits (B, N, 2).
        joint_type: logits (B, N, 3) of the codes of ``Sample.joint_type`` plus one.
        joint_axis: (B, N, 3), level frame, not normalised.
        joint_offset: (B, N, 3), network units, level frame: point to nearest point of the axis.
        grasp_points: int64 (B, S), the points that the two below are about.
        anchors: logits (B, S, L).
        residuals: (B, S, L, r), see ``Anchors``.
    """

    segmentation: Tensor
    npcs: Tensor
    naocs: Tensor
    affordance: Tensor
    joint_type: Tensor
    joint_axis: Tensor
    joint_offset: Tensor
    grasp_points: Tensor
    anchors: Tensor
    residuals: Tensor


class Icaf4(nn.Module):
    """Parts, poses, joints, affordance and grasps of one object's cloud."""

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        channels = config.backbone.width_out
        self.backbone = PointNet2(3, config.backbone)
        self.segmentation = SegmentationHead(channels, config.num_parts)
        self.nocs = NocsHead(channels, config.num_parts)
        self.affordance = AffordanceHead(channels)
        self.joint = JointHead(channels)
        anchors = anchors_from_config(config.anchors)
        self.grasp = GraspHead(channels, len(anchors), anchors.residual_size)

    def forward(
        self, points_level: Tensor, colors: Tensor, grasp_points: Tensor | int | None = None
    ) -> Outputs:
        """One pass over a batch of clouds.

        Args:
            points_level: float32 (B, N, 3), metres, level frame, centred on the cloud.
            colors: float32 (B, N, 3) in [0, 1].
            grasp_points: the points whose grasps are wanted: int64 (B, S), or how many of the
                points of highest affordance; all when left out.
        """
        # (B, N, C)
        features: Tensor = self.backbone(points_level / self.config.length_unit, colors - 0.5)
        affordance: Tensor = self.affordance(features)
        if grasp_points is None:
            grasp_points = features.shape[1]
        if isinstance(grasp_points, int):
            margin = affordance[..., 1] - affordance[..., 0]
            grasp_points = margin.topk(grasp_points, dim=1).indices
        anchors, residuals = self.grasp(
            torch.take_along_dim(features, grasp_points[..., None], dim=1)
        )
        npcs, naocs = self.nocs(features)
        joint_type, joint_axis, joint_offset = self.joint(features)
        return Outputs(
            segmentation=self.segmentation(features),
            npcs=npcs,
            naocs=naocs,
            affordance=affordance,
            joint_type=joint_type,
            joint_axis=joint_axis,
            joint_offset=joint_offset,
            grasp_points=grasp_points,
            anchors=anchors,
            residuals=residuals,
        )
