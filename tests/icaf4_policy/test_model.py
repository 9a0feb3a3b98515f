import dataclasses
import re

import numpy as np
import pytest
import torch

from artgym.datasets.sample import AFFORDANCE_NO, AFFORDANCE_UNKNOWN
from artgym.errors import InvalidArgumentError
from icaf4_policy.anchors import AnchorConfig, anchors_from_config
from icaf4_policy.backbone.pointnet2 import BackboneConfig
from icaf4_policy.heads.mlp import PointMLP
from icaf4_policy.losses import LossWeights, loss_terms, total_loss
from icaf4_policy.model import Icaf4, ModelConfig
from icaf4_policy.targets import DrawConfig, collate_items, draw_item, targets_from_sample
from tests.icaf4_policy.toy import toy_sample

SMALL = ModelConfig(
    categories=("toy",),
    num_parts=2,
    length_units=(0.25,),
    num_points=256,
    backbone=BackboneConfig(centers=(64, 16), neighbors=8),
)
DRAW = DrawConfig(num_points=256, num_anchors=72, num_grasp_points=48)


def toy_batch(count=2):
    targets = [
        targets_from_sample(toy_sample(i), ["toy"], anchors_from_config(AnchorConfig()), 512)
        for i in range(count)
    ]
    items = [draw_item(t, DRAW, np.random.default_rng(i)) for i, t in enumerate(targets)]
    return collate_items(items, DRAW)


@pytest.fixture
def network():
    torch.manual_seed(0)
    return Icaf4(SMALL)


def tensors(record):
    return {f.name: getattr(record, f.name) for f in dataclasses.fields(record)}


@pytest.mark.parametrize("training", [False, True])
def test_residuals_at_matches_are_those_of_all(network, training):
    batch, head = toy_batch(), network.grasp.train(training)
    features = torch.rand(2, 48, SMALL.backbone.width_out)
    logits, residuals = head(features)
    at_matches = head.at_matches(features, batch.match_index)
    torch.testing.assert_close(at_matches[0], logits)
    torch.testing.assert_close(at_matches[1], residuals.flatten(0, 2)[batch.match_index])


def test_in_use_a_head_says_what_its_layers_say():
    torch.manual_seed(0)
    head = PointMLP(16, 24, 5)
    with torch.no_grad():
        for _ in range(3):
            head(2.0 * torch.randn(4, 50, 16) + 1.0)
    head.eval()
    features = torch.randn(2, 7, 16)
    told = head.layers(features.flatten(0, 1)).unflatten(0, (2, 7))
    torch.testing.assert_close(head(features), told, rtol=1e-5, atol=1e-6)


def test_shapes(network):
    batch = toy_batch()
    outputs = network(batch.points_level, batch.colors, batch.category, batch.grasp_points)
    shapes = {name: tuple(value.shape) for name, value in tensors(outputs).items()}
    assert shapes == {
        "unit": (2, 1, 1),
        "segmentation": (2, 256, 2),
        "npcs": (2, 256, 2, 3),
        "naocs": (2, 256, 2, 3),
        "affordance": (2, 256, 2),
        "joint_type": (2, 256, 3),
        "joint_axis": (2, 256, 3),
        "joint_offset": (2, 256, 3),
        "grasp_points": (2, 48),
        "anchors": (2, 48, 72),
        "residuals": (2, 48, 72, 4),
    }


@pytest.mark.parametrize(("kind", "shape"), [("so3", (72, 3)), ("direct", (1, 4))])
def test_residuals_are_those_of_the_anchors(kind, shape):
    network = Icaf4(dataclasses.replace(SMALL, anchors=AnchorConfig(kind=kind)))
    batch = toy_batch()
    outputs = network(batch.points_level, batch.colors, batch.category, batch.grasp_points)
    assert outputs.residuals.shape == (2, 48, *shape)


@torch.no_grad()
def test_a_cloud_is_its_own_measure(network):
    """Grown alike, it looks alike to the backbone, but for being told how large it is."""
    batch = toy_batch()
    torch.manual_seed(0)
    scaled = Icaf4(dataclasses.replace(SMALL, scale="cloud")).eval()
    seen = []
    scaled.backbone.register_forward_pre_hook(lambda _, given: seen.append(given))
    for factor in (1.0, 3.0):
        outputs = scaled(factor * batch.points_level, batch.colors, batch.category)
        spread = batch.points_level - batch.points_level.mean(dim=1, keepdim=True)
        half_size = spread.norm(dim=-1).amax()
        assert 0.5 < float(outputs.unit.max() / (factor * half_size)) < 1.5
    (points, told), (grown, told_grown) = seen
    torch.testing.assert_close(grown, points)
    torch.testing.assert_close(told_grown[..., :3], told[..., :3])
    torch.testing.assert_close(told_grown[..., 3] - told[..., 3], torch.full((2, 256), np.log(3)))


def test_the_first_points_can_be_asked_about_alone(network):
    batch = toy_batch()
    cloud = batch.points_level, batch.colors, batch.category
    whole, some = network.eval()(*cloud), network(*cloud, asked=100)
    for name, value in tensors(some).items():
        if name == "unit" or value.ndim < 3:
            continue
        if name in ("anchors", "residuals"):
            # Asked about at all points, in the order of their affordance.
            assert value.shape[1] == 100
            continue
        torch.testing.assert_close(value, getattr(whole, name)[:, :100], msg=name)


def test_learnt_points_come_first_and_keep_their_surroundings():
    targets = targets_from_sample(toy_sample(0), ["toy"], anchors_from_config(AnchorConfig()), 2048)
    draw = dataclasses.replace(DRAW, num_points=400, learn_points=120)
    item = draw_item(targets, draw, np.random.default_rng(0))
    assert item["points_level"].shape == (400, 3)
    assert len(np.unique(item["points_level"], axis=0)) == 400
    assert {len(item[n]) for n in ("part", "npcs", "affordance", "joint_offset")} == {120}
    known = item["affordance"] != AFFORDANCE_UNKNOWN
    assert known[:60].all()
    learnt = [
        np.flatnonzero((targets.points_level == point).all(axis=1))[0]
        for point in item["points_level"][:120]
    ]
    tried = targets.grasp_row[learnt] >= 0
    assert tried[: min(60, int((targets.grasp_row >= 0).sum()))].all()
    np.testing.assert_array_equal(item["part"], targets.part[learnt])
    np.testing.assert_array_equal(item["npcs"], targets.npcs[learnt].astype(np.float32))
    assert item["grasp_points"].max() < 120


def test_a_point_whose_grasps_are_unknown_is_no_negative_of_the_anchors():
    targets = targets_from_sample(toy_sample(0), ["toy"], anchors_from_config(AnchorConfig()), 2048)
    weights = draw_item(targets, DRAW, np.random.default_rng(0))["grasp_weight"]
    assert (weights == np.float32(DRAW.negative_weight)).any()
    failed = (targets.grasp_row >= 0) & (targets.affordance == AFFORDANCE_NO)
    doubted = dataclasses.replace(
        targets,
        affordance=np.where(failed, AFFORDANCE_UNKNOWN, targets.affordance).astype(np.uint8),
    )
    weights = draw_item(doubted, DRAW, np.random.default_rng(0))["grasp_weight"]
    assert not (weights == np.float32(DRAW.negative_weight)).any()


def test_order_of_points_does_not_matter(network):
    batch = toy_batch()
    network.eval()
    order = torch.randperm(256, generator=torch.Generator().manual_seed(1))
    everyone = torch.arange(256).expand(2, -1)
    straight = network(batch.points_level, batch.colors, batch.category, everyone)
    shuffled = network(
        batch.points_level[:, order], batch.colors[:, order], batch.category, everyone
    )
    for name, value in tensors(straight).items():
        if name not in ("unit", "grasp_points"):
            torch.testing.assert_close(
                value[:, order], getattr(shuffled, name), rtol=1e-4, atol=1e-5, msg=name
            )


@torch.no_grad()
def test_grasp_points_can_be_left_to_the_affordance(network):
    batch = toy_batch()
    network.eval()
    outputs = network(batch.points_level, batch.colors, batch.category, 16)
    margin = outputs.affordance[..., 1] - outputs.affordance[..., 0]
    threshold = margin.gather(1, outputs.grasp_points).amin(dim=1)
    assert ((margin > threshold[:, None]).sum(dim=1) < 16).all()
    same = network(batch.points_level, batch.colors, batch.category, outputs.grasp_points)
    torch.testing.assert_close(same.anchors, outputs.anchors)


def test_training_step_does_not_write_to_its_batch(network):
    batch = toy_batch()
    before = {name: value.clone() for name, value in tensors(batch).items()}
    outputs = network(batch.points_level, batch.colors, batch.category, batch.grasp_points)
    total_loss(loss_terms(outputs, batch), LossWeights()).backward()
    for name, value in tensors(batch).items():
        assert torch.equal(value, before[name]), name


def test_every_weight_receives_a_gradient(network):
    batch = toy_batch()
    outputs = network(batch.points_level, batch.colors, batch.category, batch.grasp_points)
    total_loss(loss_terms(outputs, batch), LossWeights()).backward()
    for name, weight in network.named_parameters():
        assert weight.grad is not None, name
        assert weight.grad.abs().sum() > 0, name


def test_overfits_one_sample(network):
    batch = toy_batch(1)
    optimizer = torch.optim.Adam(network.parameters(), lr=3e-3)
    history = []
    for _ in range(150):
        outputs = network(batch.points_level, batch.colors, batch.category, batch.grasp_points)
        terms = loss_terms(outputs, batch)
        loss = total_loss(terms, LossWeights())
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        history.append({name: term.item() for name, term in terms.items()})
    for name, first in history[0].items():
        assert history[-1][name] < 0.15 * first, name
    assert (outputs.segmentation.argmax(dim=-1) == batch.part).float().mean() > 0.99


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("num_parts", 0),
        ("length_units", (0.0,)),
        ("categories", ()),
        ("num_points", 32),
    ],
)
def test_impossible_configurations_are_refused(field, value):
    with pytest.raises(InvalidArgumentError, match=re.escape(f"{field}={value}")):
        dataclasses.replace(SMALL, **{field: value})


@pytest.mark.parametrize("errors", [((),), (((0.1, 0.1, 0.1),),), (((0.1, None),) * 2,)])
def test_face_errors_are_three_of_each_part(errors):
    with pytest.raises(InvalidArgumentError, match=r"face_errors=.* three of each of 2 parts"):
        dataclasses.replace(SMALL, face_errors=errors)
    dataclasses.replace(SMALL, face_errors=(((0.1, None, 0.2),) * 2,))
