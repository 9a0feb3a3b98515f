"""Heads beside each other learn what each would alone, and become networks like any other."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from artgym.errors import InvalidArgumentError
from benchmarks import grasp_heads
from benchmarks.grasp_heads import HeadKind, HeadTrainingConfig, head_path, train_heads
from icaf4_policy.anchors import AnchorConfig, anchors_from_config
from icaf4_policy.checkpoint import load_model
from icaf4_policy.inference import Perception
from icaf4_policy.model import Icaf4
from icaf4_policy.targets import DrawConfig, collate_grasps, draw_item, targets_from_sample
from tests.icaf4_policy.toy import toy_network, toy_sample

KINDS = {
    "direct": HeadKind(anchors=AnchorConfig(kind="direct")),
    "axis_45": HeadKind(anchors=AnchorConfig(kind="axis", step_deg=45)),
    "so3_20": HeadKind(anchors=AnchorConfig(kind="so3", count=20)),
    "released": HeadKind(
        anchors=AnchorConfig(kind="axis", step_deg=45),
        sign_blind=True,
        one_pose=True,
        softmax=True,
        all_residuals=True,
    ),
}
CONFIG = HeadTrainingConfig(samples=4, epochs=12, batch_size=2, num_grasp_points=48)


@pytest.fixture(scope="module")
def samples():
    return [toy_sample(i) for i in range(4)]


def trained(folder, samples, kinds=KINDS, config=CONFIG):
    return train_heads(toy_network(), samples, kinds, folder, config, samples_sha256="toy")


@pytest.fixture(scope="module")
def folder(tmp_path_factory, samples):
    folder = tmp_path_factory.mktemp("heads")
    paths = trained(folder, samples)
    assert paths == [head_path(folder, name, "toy") for name in KINDS]
    return folder


def description(folder, name):
    return json.loads(head_path(folder, name, "toy").with_suffix(".json").read_text())


@pytest.mark.parametrize("name", KINDS)
def test_a_head_is_part_of_a_whole_network(folder, samples, name):
    model, _ = load_model(head_path(folder, name, "toy"))
    assert model.config == replace(toy_network().config, anchors=KINDS[name].anchors)
    for key, tensor in toy_network().state_dict().items():
        if not key.startswith("grasp."):
            assert torch.equal(model.state_dict()[key], tensor), key
    perception = Perception.load(head_path(folder, name, "toy"))
    seen = samples[0].points_camera, samples[0].colors, samples[0].R_level_camera
    grasps = perception.point_grasps(*seen, top=3, rng=np.random.default_rng(0))
    of_each = 1 if name == "direct" else 3
    assert grasps.R_camera_grasp.shape == (512, of_each, 3, 3)
    assert np.isfinite(grasps.R_camera_grasp).all()


@pytest.mark.parametrize("name", KINDS)
def test_training_lowers_the_loss(folder, name):
    losses = description(folder, name)["training"]["loss"]
    assert len(losses) == CONFIG.epochs
    assert losses[-1] < 0.7 * losses[0]


def test_a_second_call_keeps_what_is_there(folder, samples, tmp_path, monkeypatch):
    paths = [head_path(folder, name, "toy") for name in KINDS]
    before = [path.stat().st_mtime_ns for path in paths]

    def refuse(*_):
        raise AssertionError("trained again")

    monkeypatch.setattr(grasp_heads, "_learn", refuse)
    assert trained(folder, samples) == paths
    assert [path.stat().st_mtime_ns for path in paths] == before
    for other in (replace(CONFIG, epochs=13), replace(CONFIG, seed=1)):
        with pytest.raises(AssertionError, match="trained again"):
            trained(folder, samples, config=other)


def test_a_head_is_the_same_whatever_is_trained_beside_it(folder, samples, tmp_path):
    path = head_path(tmp_path, "so3_20", "toy")
    path.parent.mkdir()
    path.write_bytes(b"cut short")
    trained(tmp_path, samples, {"so3_20": KINDS["so3_20"]})
    assert path.read_bytes() == head_path(folder, "so3_20", "toy").read_bytes()
    assert description(tmp_path, "so3_20") == description(folder, "so3_20")


@pytest.mark.parametrize("name", [name for name in KINDS if name != "released"])
def test_a_head_learns_its_own_anchors_at_points_drawn_once_for_all(samples, name):
    """What it is told is what targets made for its anchors alone say of the same draw."""
    model, facts = toy_network(), {}
    heads = [grasp_heads._Head(n, kind, model, CONFIG, facts) for n, kind in KINDS.items()]
    counts = [len(head.anchors) for head in heads]
    starts = [0, *np.cumsum(counts).tolist()]
    together = grasp_heads._targets(model, samples, heads, starts, CONFIG)[:2]
    order = np.random.default_rng((CONFIG.seed, 1)).permutation(len(samples))
    alone = [
        targets_from_sample(samples[i], ("toy",), anchors_from_config(KINDS[name].anchors), 3 * 512)
        for i in order[:2]
    ]
    h = list(KINDS).index(name)
    told = []
    for targets, count in ((together, starts[-1]), (alone, counts[h])):
        draw = DrawConfig(num_points=512, num_anchors=count, num_grasp_points=48)
        items = [draw_item(t, draw, np.random.default_rng(i)) for i, t in enumerate(targets)]
        told.append(collate_grasps(items, draw))
    part, whole = grasp_heads._part_of(told[0], starts[h], heads[h]), told[1]
    assert len(whole.match_index) > 0
    for field in ("grasp_weight", "anchor_mask", "match_index", "match_residual"):
        assert torch.equal(getattr(part, field), getattr(whole, field)), field


def test_departures_change_what_is_matched(samples):
    anchors = AnchorConfig(kind="axis", step_deg=45)

    def matches(**departures):
        kind = HeadKind(anchors=anchors, **departures)
        return grasp_heads._Head("any", kind, toy_network(), CONFIG, {}).matches(samples[0])

    row, anchor, residual = matches()
    single, _, _ = matches(one_pose=True)
    assert set(single) == set(row)
    assert len(single) == len(set(row)) < len(row)
    blind_row, blind_anchor, blind_residual = matches(sign_blind=True)
    assert set(blind_row) == set(row)
    pairs = list(zip(blind_row, blind_anchor, strict=True))
    assert len(pairs) == len(set(pairs))
    # Blind to equal grasps, the nearest anchor is farther off.
    ours, blind = (np.linalg.norm(r, axis=1).mean() for r in (residual, blind_residual))
    assert blind > ours + 0.02
    assert not np.array_equal(anchor, blind_anchor)


@pytest.mark.parametrize(
    "wrong",
    [
        {"softmax": True},
        {"all_residuals": True},
        {"sign_blind": True, "anchors": AnchorConfig(kind="so3")},
    ],
)
def test_departures_that_do_not_fit(wrong):
    with pytest.raises(InvalidArgumentError, match="take"):
        HeadKind(**{"anchors": AnchorConfig(kind="axis"), **wrong})


def test_direct_regression_learns_residuals_alone():
    heads = {
        name: grasp_heads._Head(name, kind, toy_network(), CONFIG, {})
        for name, kind in KINDS.items()
    }
    assert heads["direct"].weights.anchors == 0
    assert heads["axis_45"].weights.anchors == CONFIG.losses.anchors
    assert heads["so3_20"].weights.anchors == pytest.approx(CONFIG.losses.anchors * 20 / 72)


@pytest.mark.parametrize(
    "wrong", [{"samples": 0}, {"epochs": 0}, {"learning_rate": 0.0}, {"warmup_share": 1.0}]
)
def test_wrong_options(wrong):
    with pytest.raises(InvalidArgumentError, match=next(iter(wrong))):
        HeadTrainingConfig(**wrong)


def test_what_cannot_be_trained_is_refused(samples, tmp_path):
    with pytest.raises(InvalidArgumentError, match="kinds is empty"):
        trained(tmp_path, samples, {})
    with pytest.raises(InvalidArgumentError, match="num_grasp_points=600"):
        trained(tmp_path, samples, config=replace(CONFIG, num_grasp_points=600))
    nothing = [replace(s, grasp_bits=np.zeros_like(s.grasp_bits)) for s in samples]
    with pytest.raises(InvalidArgumentError, match="none of 4 samples"):
        trained(tmp_path, nothing)
    several = replace(toy_network().config, categories=("toy", "box"), length_units=(0.2, 0.2))
    with pytest.raises(InvalidArgumentError, match="single category"):
        train_heads(Icaf4(several), samples, KINDS, tmp_path, CONFIG, samples_sha256="toy")
    described = replace(toy_network().config, features="fpfh")
    with pytest.raises(InvalidArgumentError, match="no pictures"):
        train_heads(Icaf4(described), samples, KINDS, tmp_path, CONFIG, samples_sha256="toy")
