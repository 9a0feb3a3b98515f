import dataclasses
from typing import get_args

import numpy as np
import pytest
import torch
from torch.nn import functional as F

from artgym.errors import InvalidArgumentError
from artgym.geometry.rotations import grasp_angle
from icaf4_policy.anchors import AnchorConfig, AnchorFrame, anchors_from_config
from icaf4_policy.losses import LossWeights, loss_terms, total_loss
from icaf4_policy.metrics import class_ious
from icaf4_policy.model import Outputs
from icaf4_policy.targets import (
    DrawConfig,
    collate_items,
    draw_item,
    successful_grasps,
    targets_from_sample,
)
from tests.icaf4_policy.toy import toy_sample

UNIT = 0.25
SURE = 50.0


@pytest.fixture(params=["axis", "so3", "direct"])
def batch(request):
    anchors = anchors_from_config(AnchorConfig(kind=request.param))
    targets = [targets_from_sample(toy_sample(i), ["toy"], anchors, 512) for i in range(2)]
    draw = DrawConfig(num_points=256, num_anchors=len(anchors), num_grasp_points=48)
    items = [draw_item(t, draw, np.random.default_rng(i)) for i, t in enumerate(targets)]
    return collate_items(items, draw)


def truthful_outputs(batch):
    size = batch.match_residual.shape[-1]
    residuals = torch.zeros(*batch.anchor_mask.shape, size)
    residuals.view(-1, size)[batch.match_index] = batch.match_residual
    sure = {
        name: SURE * F.one_hot(getattr(batch, name).clamp(max=limit), limit + 1).float()
        for name, limit in (("part", 1), ("affordance", 1), ("joint_type", 2))
    }
    return Outputs(
        unit=torch.full((len(batch.part), 1, 1), UNIT),
        segmentation=sure["part"],
        npcs=batch.npcs[:, :, None].expand(-1, -1, 2, -1),
        naocs=batch.naocs[:, :, None].expand(-1, -1, 2, -1),
        affordance=sure["affordance"],
        joint_type=sure["joint_type"],
        joint_axis=batch.joint_axis,
        joint_offset=batch.joint_offset / UNIT,
        grasp_points=batch.grasp_points,
        anchors=SURE * (2 * batch.anchor_mask - 1),
        residuals=residuals,
    )


def test_every_loss_is_zero_at_the_truth(batch):
    terms = loss_terms(truthful_outputs(batch), batch)
    assert set(terms) == {f.name for f in dataclasses.fields(LossWeights)}
    for name, term in terms.items():
        assert term.item() == pytest.approx(0.0, abs=1e-6), name
    assert total_loss(terms, LossWeights()).item() == pytest.approx(0.0, abs=1e-5)
    soft = loss_terms(truthful_outputs(batch), batch, "soft_iou")
    assert soft["segmentation"].item() == pytest.approx(0.0, abs=1e-6)


def test_the_soft_iou_loss_of_sure_parts_is_one_minus_their_iou(batch):
    called = batch.part.clone()
    called[:, ::3] = 1 - called[:, ::3]
    sure = dataclasses.replace(
        truthful_outputs(batch), segmentation=SURE * F.one_hot(called, 2).float()
    )
    ious = [
        class_ious(mine.numpy(), truth.numpy(), 2)
        for mine, truth in zip(called, batch.part, strict=True)
    ]
    term = loss_terms(sure, batch, "soft_iou")["segmentation"]
    assert term.item() == pytest.approx(1.0 - np.mean(ious), abs=1e-5)


@pytest.mark.parametrize(
    ("output", "loss"),
    [
        ("segmentation", "segmentation"),
        ("npcs", "npcs"),
        ("naocs", "naocs"),
        ("affordance", "affordance"),
        ("joint_type", "joint_type"),
        ("joint_axis", "joint_axis"),
        ("joint_offset", "joint_offset"),
        ("anchors", "anchors"),
        ("residuals", "residuals"),
    ],
)
def test_a_wrong_output_raises_its_own_loss_alone(batch, output, loss):
    truth = truthful_outputs(batch)
    wrong = dataclasses.replace(truth, **{output: 0.3 - getattr(truth, output)})
    terms = loss_terms(wrong, batch)
    assert terms.pop(loss) > 0.05
    assert all(term < 1e-6 for term in terms.values())


def test_unknown_affordance_is_ignored(batch):
    unknown = dataclasses.replace(batch, affordance=torch.full_like(batch.affordance, 255))
    terms = loss_terms(truthful_outputs(batch), unknown)
    assert terms["affordance"] == 0


def test_other_parts_channels_and_unmatched_residuals_are_free(batch):
    truth = truthful_outputs(batch)
    other = F.one_hot(1 - batch.part, 2)[..., None]
    unmatched = (1 - batch.anchor_mask)[..., None]
    free = dataclasses.replace(
        truth, npcs=truth.npcs + other, residuals=truth.residuals + unmatched
    )
    assert total_loss(loss_terms(free, batch), LossWeights()) < 1e-5


def test_grasps_in_the_part_frame_are_those_of_the_level_frame():
    sample = toy_sample(0)
    row, R_level_grasps = successful_grasps(sample, "level")
    again, R_box_grasps = successful_grasps(sample, "part")
    np.testing.assert_array_equal(row, again)
    # The lid alone can be grasped, and its box has its axes.
    R_camera_lid = sample.T_camera_parts[1, :3, :3].astype(float)
    R_camera_grasps = sample.R_level_camera.T @ R_level_grasps
    np.testing.assert_allclose(R_camera_lid @ R_box_grasps, R_camera_grasps, atol=1e-6)


@pytest.mark.parametrize("kind", ["axis", "so3"])
@pytest.mark.parametrize("frame", get_args(AnchorFrame))
def test_targets_give_back_successful_grasps(kind, frame):
    sample = toy_sample(0)
    anchors = anchors_from_config(AnchorConfig(kind=kind, frame=frame))
    row, R_grasps = successful_grasps(sample, anchors.frame)
    targets = targets_from_sample(sample, ["toy"], anchors, 512)
    for g in range(len(sample.grasp_part)):
        block = slice(targets.match_start[g], targets.match_start[g + 1])
        matched = targets.match_anchor[block]
        assert len(set(matched)) == len(matched)
        if not (row == g).any():
            assert len(matched) == 0
            continue
        rebuilt = anchors.grasps(matched, targets.match_residual[block])
        distances = grasp_angle(rebuilt[:, None], R_grasps[row == g][None])
        assert distances.min(axis=1).max() < 0.005
        angles = grasp_angle(R_grasps[row == g][:, None], anchors.rotations[None])
        # Several anchors may be equally near.
        nearest = angles <= angles.min(axis=1, keepdims=True) + 1e-6
        assert nearest[:, matched].any(axis=0).all()
        assert nearest[:, matched].any(axis=1).all()


def test_direct_target_is_the_most_central_success():
    sample = toy_sample(0)
    anchors = anchors_from_config(AnchorConfig(kind="direct"))
    row, R_grasps = successful_grasps(sample, anchors.frame)
    targets = targets_from_sample(sample, ["toy"], anchors, 512)
    for g in np.unique(row):
        here = R_grasps[row == g]
        assert targets.match_start[g + 1] - targets.match_start[g] == 1
        kept = anchors.grasps(0, targets.match_residual[targets.match_start[g]])
        means = grasp_angle(here[:, None], here[None]).mean(axis=1)
        assert grasp_angle(kept[None], here).mean() < means.min() + 0.01


def test_joint_offsets_lead_to_the_axis(batch):
    revolute = batch.joint_type == 2
    target = batch.points_level + batch.joint_offset
    # All points of one lid name points of one line: they differ along the axis alone.
    reached, axis = target[0][revolute[0]], batch.joint_axis[0][revolute[0]][0]
    off_axis = torch.linalg.cross(reached - reached[0], axis.expand_as(reached))
    assert off_axis.norm(dim=-1).max() < 1e-5


def test_weights_must_be_finite():
    with pytest.raises(InvalidArgumentError, match="npcs=nan"):
        LossWeights(npcs=float("nan"))


def test_a_sample_without_any_success_can_be_trained_on():
    sample = toy_sample(0)
    hopeless = dataclasses.replace(
        sample,
        grasp_bits=np.zeros_like(sample.grasp_bits),
        affordance=np.zeros_like(sample.affordance),
        grasp_row=np.full_like(sample.grasp_row, -1),
    )
    draw = DrawConfig(num_points=256, num_anchors=72, num_grasp_points=48)
    targets = targets_from_sample(hopeless, ["toy"], anchors_from_config(AnchorConfig()), 512)
    batch = collate_items([draw_item(targets, draw, np.random.default_rng(0))], draw)
    terms = loss_terms(truthful_outputs(batch), batch)
    assert total_loss(terms, LossWeights()).item() == pytest.approx(0.0, abs=1e-5)
