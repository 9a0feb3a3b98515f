"""The losses of the five heads (paper, Section 5). All but the entropies are zero at the truth."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal

import torch
from torch import Tensor
from torch.nn import functional as F

from artgym.datasets.sample import AFFORDANCE_UNKNOWN, JOINT_NONE, JOINT_REVOLUTE
from artgym.errors import InvalidArgumentError
from icaf4_policy.model import Outputs
from icaf4_policy.targets import Batch, GraspTargets

#: Below this error, in NOCS and in network units, the smooth L1 losses are quadratic.
_SMOOTH = 0.05

#: What ``loss_terms`` may tell parts apart by.
SegmentationLoss = Literal["cross_entropy", "soft_iou"]


@dataclass(frozen=True, kw_only=True)
class LossWeights:
    """Weight of each loss in the sum; the names are those of the terms."""

    segmentation: float = 1.0
    npcs: float = 10.0
    naocs: float = 10.0
    affordance: float = 1.0
    joint_type: float = 0.5
    joint_axis: float = 1.0
    joint_offset: float = 5.0
    anchors: float = 5.0
    residuals: float = 5.0

    def __post_init__(self) -> None:
        for f in fields(self):
            if not 0 <= getattr(self, f.name) < float("inf"):
                raise InvalidArgumentError(
                    f"{f.name}={getattr(self, f.name)} must be a finite weight of at least 0."
                )


def _masked_mean(values: Tensor, mask: Tensor) -> Tensor:
    """Mean of ``values`` weighted by ``mask`` of the same shape; 0 where the mask is empty."""
    mask = mask.to(values.dtype)
    return (values * mask).sum() / mask.sum().clamp(min=1e-6)


def _coordinate_loss(predicted: Tensor, truth: Tensor, part: Tensor) -> Tensor:
    """Smooth L1 of the three channels (B, N, K, 3) that belong to each point's own part."""
    own = torch.take_along_dim(predicted, part[..., None, None], dim=2)[:, :, 0]  # (B, N, 3)
    return F.smooth_l1_loss(own, truth, beta=_SMOOTH)


def _soft_iou_loss(logits: Tensor, part: Tensor) -> Tensor:
    """One minus the intersection over union of probabilities (B, N, K) and parts (B, N).

    Mean over the parts that each cloud shows, and over clouds.
    """
    probability = logits.softmax(dim=-1)
    truth = F.one_hot(part, logits.shape[-1]).to(logits.dtype)
    shared = (probability * truth).sum(dim=1)  # (B, K)
    either = (probability + truth).sum(dim=1) - shared
    return 1.0 - _masked_mean(shared / either.clamp(min=1e-6), truth.sum(dim=1) > 0)


def loss_terms(
    outputs: Outputs, batch: Batch, segmentation: SegmentationLoss = "cross_entropy"
) -> dict[str, Tensor]:
    """Every loss, unweighted, by the names of ``LossWeights``.

    Args:
        outputs: of the network, at ``batch.grasp_points``.
        batch: the truth.
        segmentation: by what parts are told apart.
    """
    told = (
        _soft_iou_loss(outputs.segmentation, batch.part)
        if segmentation == "soft_iou"
        else F.cross_entropy(outputs.segmentation.transpose(1, 2), batch.part)
    )
    revolute = batch.joint_type == JOINT_REVOLUTE - JOINT_NONE  # (B, N)
    movable = batch.joint_type > 0
    axis_error = (outputs.joint_axis - batch.joint_axis).square().sum(dim=-1)
    offset_error = F.smooth_l1_loss(
        outputs.joint_offset, batch.joint_offset / outputs.unit, beta=_SMOOTH, reduction="none"
    ).sum(dim=-1)
    matched = outputs.residuals.flatten(0, 2)[batch.match_index]  # (n, r)
    known = batch.affordance != AFFORDANCE_UNKNOWN
    affordance_error = F.cross_entropy(
        outputs.affordance.transpose(1, 2),
        batch.affordance,
        ignore_index=AFFORDANCE_UNKNOWN,
        reduction="none",
    )
    return {
        "segmentation": told,
        "npcs": _coordinate_loss(outputs.npcs, batch.npcs, batch.part),
        "naocs": _coordinate_loss(outputs.naocs, batch.naocs, batch.part),
        "affordance": _masked_mean(affordance_error, known),
        "joint_type": F.cross_entropy(outputs.joint_type.transpose(1, 2), batch.joint_type),
        "joint_axis": _masked_mean(axis_error, movable),
        "joint_offset": _masked_mean(offset_error, revolute),
        **grasp_terms(outputs.anchors, matched, batch),
    }


def grasp_terms(logits: Tensor, matched: Tensor, truth: GraspTargets) -> dict[str, Tensor]:
    """The two losses of a grasp head, unweighted: "anchors" and "residuals" (Eqs. 2 to 4).

    Args:
        logits: of the anchors, (B, S, L).
        matched: residuals (n, r) at ``truth.match_index``.
        truth: of the same points.
    """
    anchor_error = F.binary_cross_entropy_with_logits(
        logits, truth.anchor_mask, reduction="none"
    ).mean(dim=-1)
    return {
        "anchors": _masked_mean(anchor_error, truth.grasp_weight),
        "residuals": (matched - truth.match_residual).square().sum() / max(len(matched), 1),
    }


def total_loss(terms: dict[str, Tensor], weights: LossWeights) -> Tensor:
    """The weighted sum of the terms."""
    return torch.stack([getattr(weights, name) * term for name, term in terms.items()]).sum(dim=0)
