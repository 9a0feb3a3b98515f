"""The network: one backbone, five heads, one forward pass (paper, Section 5)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from artgym.errors import InvalidArgumentError, UnknownNameError
from icaf4_policy.anchors import AnchorConfig, anchors_from_config
from icaf4_policy.backbone.classical import DESCRIPTOR_CHANNELS, PointwiseBackbone
from icaf4_policy.backbone.pointnet2 import BackboneConfig, PointNet2
from icaf4_policy.faces import FaceErrors
from icaf4_policy.features import CHANNELS, DEFAULT_FEATURES, Features
from icaf4_policy.heads.affordance import AffordanceHead
from icaf4_policy.heads.grasp import GraspHead
from icaf4_policy.heads.joint import JointHead
from icaf4_policy.heads.nocs import NocsHead
from icaf4_policy.heads.segmentation import SegmentationHead

#: What ``ModelConfig.scale`` may be.
Scale = Literal["category", "cloud"]

#: Half the size of a cloud, in terms of its points' root mean square distance to their mean.
_SIZE_OF_SPREAD = 1.5


@dataclass(frozen=True, kw_only=True)
class ModelConfig:
    """What a network is for and how large it is.

    Attributes:
        categories: ("laptop",), or several, which the network is told apart by.
        num_parts: K, the base included; the most of any category.
        length_units: half the size of a typical object of each category, metres.
        scale: what one network unit is: the "category"'s length unit; or of the "cloud", about
            half its size, and then how much that is of the category's is given to each point.
        num_points: points of a cloud.
        anchors: what grasps are refined from.
        backbone: sizes of the backbone.
        features: what is given of each point beside where it is, see ``features.Features``;
            descriptors go to the heads through a layer of ``backbone.width_out`` features.
        upright: whether the base's z axis points up in all that it was trained with, so that fitted
            boxes are made to stand as well.
        face_errors: of the faces of each category's parts along each axis of their boxes, radians,
            see ``faces``; empty where not known, so that faces are not looked at.
        graspable_from: the probability from which on a point is called graspable.
    """

    categories: tuple[str, ...]
    num_parts: int
    length_units: tuple[float, ...]
    scale: Scale = "category"
    num_points: int = 2048
    anchors: AnchorConfig = field(default_factory=AnchorConfig)
    backbone: BackboneConfig = field(default_factory=BackboneConfig)
    features: Features = DEFAULT_FEATURES
    upright: bool = False
    face_errors: tuple[FaceErrors, ...] = ()
    graspable_from: float = 0.5

    def __post_init__(self) -> None:
        if self.num_parts < 1:
            raise InvalidArgumentError(f"num_parts={self.num_parts} must be at least 1.")
        if not self.categories or len(self.categories) != len(self.length_units):
            raise InvalidArgumentError(
                f"categories={self.categories} and length_units={self.length_units}: expected as "
                "many of the one as of the other, one or more."
            )
        if not all(0 < unit < float("inf") for unit in self.length_units):
            raise InvalidArgumentError(
                f"length_units={self.length_units} must be positive, metres."
            )
        if self.scale not in get_args(Scale):
            raise UnknownNameError("scale", self.scale, get_args(Scale))
        if self.features not in CHANNELS:
            raise UnknownNameError("features", self.features, CHANNELS)
        shapes = [[len(errors) for errors in each] for each in self.face_errors]
        if self.face_errors and shapes != [[3] * self.num_parts] * len(self.categories):
            raise InvalidArgumentError(
                f"face_errors={self.face_errors} must be three of each of {self.num_parts} parts, "
                f"of {len(self.categories)} categories."
            )
        if not 0 < self.graspable_from < 1:
            raise InvalidArgumentError(
                f"graspable_from={self.graspable_from} must be a probability in (0, 1)."
            )
        if self.num_points < self.backbone.centers[0]:
            raise InvalidArgumentError(
                f"num_points={self.num_points} must be at least {self.backbone.centers[0]}, the "
                "centers of the first abstraction."
            )


@dataclass(frozen=True, kw_only=True)
class Outputs:
    """What the heads say.

    B clouds, N points that were asked about, K parts, S points asked for grasps, L anchors with
    residuals of r numbers.

    Attributes:
        unit: (B, 1, 1), metres of one network unit.
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

    unit: Tensor
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

    length_units: Tensor

    def __init__(self, config: ModelConfig) -> None:
        super().__init__()
        self.config = config
        channels = config.backbone.width_out
        # One category needs no telling.
        told = len(config.categories) if len(config.categories) > 1 else 0
        given = CHANNELS[config.features] + told + (config.scale == "cloud")
        self.backbone: PointNet2 | PointwiseBackbone = (
            PointwiseBackbone(given, channels)
            if config.features in DESCRIPTOR_CHANNELS
            else PointNet2(given, config.backbone)
        )
        self.register_buffer("length_units", torch.tensor(config.length_units), persistent=False)
        self.segmentation = SegmentationHead(channels, config.num_parts)
        self.nocs = NocsHead(channels, config.num_parts)
        self.affordance = AffordanceHead(channels)
        self.joint = JointHead(channels)
        anchors = anchors_from_config(config.anchors)
        self.grasp = GraspHead(channels, len(anchors), anchors.residual_size)

    def forward(
        self,
        points_level: Tensor,
        colors: Tensor,
        category: Tensor,
        grasp_points: Tensor | int | None = None,
        *,
        part: int | None = None,
        asked: int | None = None,
    ) -> Outputs:
        """One pass over a batch of clouds.

        Args:
            points_level: float32 (B, N, 3), metres, level frame, centred on the cloud.
            colors: float32 (B, N, C) in [0, 1], C of ``features.CHANNELS``.
            category: int64 (B,), into ``config.categories``.
            grasp_points: the points whose grasps are wanted: int64 (B, S), or how many of the
                points of highest affordance; all when left out.
            part: where it is given, those most likely to be of this part and graspable.
            asked: of each cloud the first so many points are asked about, the others being their
                surroundings; all when left out.
        """
        given = [colors - 0.5]
        if len(self.config.categories) > 1:
            told = F.one_hot(category, len(self.config.categories)).to(colors.dtype)  # (B, c)
            given.append(told[:, None].expand(-1, points_level.shape[1], -1))
        unit = self.length_units[category][:, None, None]  # (B, 1, 1)
        if self.config.scale == "cloud":
            own = _SIZE_OF_SPREAD * points_level.var(dim=1, correction=0).sum(dim=-1).sqrt()
            own = own[:, None, None]  # (B, 1, 1)
            given.append((own / unit).log().expand(-1, points_level.shape[1], -1))
            unit = own
        # (B, asked, C)
        features: Tensor = self.backbone(points_level / unit, torch.cat(given, dim=-1), asked=asked)
        affordance: Tensor = self.affordance(features)
        segmentation: Tensor = self.segmentation(features)
        if grasp_points is None:
            grasp_points = features.shape[1]
        if isinstance(grasp_points, int):
            worth = affordance[..., 1] - affordance[..., 0]
            if part is not None:
                worth = F.logsigmoid(worth) + segmentation.log_softmax(dim=-1)[..., part]
            grasp_points = worth.topk(grasp_points, dim=1).indices
        anchors, residuals = self.grasp(
            torch.take_along_dim(features, grasp_points[..., None], dim=1)
        )
        npcs, naocs = self.nocs(features)
        joint_type, joint_axis, joint_offset = self.joint(features)
        return Outputs(
            unit=unit,
            segmentation=segmentation,
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
