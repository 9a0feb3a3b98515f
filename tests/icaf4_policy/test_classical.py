"""FPFH and DAISY: what they do not depend on, what they are at known places, training with them."""

from __future__ import annotations

import dataclasses
import json
import sys

import numpy as np
import pytest
import torch

from artgym.datasets.picture_files import write_pictures
from artgym.errors import DamagedFileError, InvalidArgumentError, MissingDependencyError
from artgym.files import Manifest, ShardEntry
from artgym.geometry.rotations import matrix_from_axis_angle
from icaf4_policy import cli, commands
from icaf4_policy.backbone import classical
from icaf4_policy.backbone.classical import daisy, fpfh
from icaf4_policy.backbone.pointnet2 import BackboneConfig
from icaf4_policy.checkpoint import description_path, load_model, save_model
from icaf4_policy.features import CHANNELS, described
from icaf4_policy.inference import Perception
from icaf4_policy.model import Icaf4, ModelConfig
from icaf4_policy.training import TrainingConfig, train
from tests.icaf4_policy.toy import toy_picture, toy_sample

DESCRIPTORS = ("fpfh", "daisy")
#: Of the pictures of noise below.
INTRINSICS = np.array([[300.0, 0.0, 130.0], [0.0, 300.0, 110.0], [0.0, 0.0, 1.0]])


@pytest.fixture(scope="module")
def picture():
    return toy_picture(3, num_points=1500)


def noise(width, height, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3)).astype(np.uint8)


def points_at(columns, rows, intrinsics, depth=0.8):
    """Points (M, 3) that project to (column, row) in pixels."""
    x = (np.asarray(columns) - intrinsics[0, 2]) / intrinsics[0, 0]
    y = (np.asarray(rows) - intrinsics[1, 2]) / intrinsics[1, 1]
    return depth * np.stack([x, y, np.ones_like(x)], axis=-1)


def test_fpfh_does_not_depend_on_frame_or_unit(picture):
    points = picture.samples[0].points_camera.astype(float)
    R, t = matrix_from_axis_angle([0.7, -1.1, 0.4]), np.array([0.3, -2.0, 1.0])
    here, there = fpfh(points), fpfh(1000.0 * (points @ R.T + t), viewpoint=1000.0 * t)
    assert here.shape == (len(points), CHANNELS["fpfh"])
    assert here.dtype == np.uint8
    # On flat faces some neighbours lie equally far, and some angles between two bins.
    assert np.mean(np.abs(here.astype(int) - there) > 1) < 0.01


def test_fpfh_of_a_point_does_not_depend_on_the_others_order(picture):
    points = picture.samples[0].points_camera
    order = np.random.default_rng(0).permutation(len(points))
    apart = np.abs(fpfh(points)[order].astype(int) - fpfh(points[order]))
    assert np.mean(apart > 1) < 1e-3


def test_fpfh_of_a_plane_is_in_the_middle_bins():
    plane = np.random.default_rng(0).uniform(-1, 1, (800, 3)) * [1, 1, 0] + [0, 0, 3]
    found = fpfh(plane).reshape(-1, 3, 11)
    assert (found[..., 5] == 255).all()
    assert found.sum() == 255 * 3 * len(plane)


def test_fpfh_shares_of_each_angle_add_up(picture):
    sums = fpfh(picture.samples[0].points_camera).reshape(-1, 3, 11).sum(axis=-1, dtype=int)
    # Each of 11 bins is rounded.
    assert np.abs(sums - 255).max() <= 6


def test_angles_are_those_of_the_frame_of_the_pair():
    rng = np.random.default_rng(0)
    p, q, n_p, n_q = rng.normal(size=(4, 300, 3))
    n_p, n_q = (n / np.linalg.norm(n, axis=1, keepdims=True) for n in (n_p, n_q))
    for i, bins in enumerate(classical._angle_bins(p, q, n_p, n_q)):
        ends = [(p[i], n_p[i]), (q[i], n_q[i])]
        line = (q[i] - p[i]) / np.linalg.norm(q[i] - p[i])
        if abs(n_p[i] @ line) < abs(n_q[i] @ line):
            ends.reverse()
        (source, u), (target, n) = ends
        d = (target - source) / np.linalg.norm(target - source)
        v = np.cross(d, u) / np.linalg.norm(np.cross(d, u))
        w = np.cross(u, v)
        angles = (v @ n, -1, 1), (u @ d, -1, 1), (np.arctan2(w @ n, u @ n), -np.pi, np.pi)
        assert bins.tolist() == [int(11 * (x - low) / (high - low)) for x, low, high in angles]


def test_of_a_dense_cloud_some_points_speak_for_all(picture, monkeypatch):
    points = picture.samples[0].points_camera
    monkeypatch.setattr(classical, "_FEATURE_POINTS", 500)
    keep = np.linspace(0, len(points) - 1, 500).round().astype(int)
    everywhere = fpfh(points)
    np.testing.assert_array_equal(everywhere[keep], fpfh(points[keep]))
    assert everywhere.any(axis=1).mean() > 0.95


@pytest.mark.parametrize("count", [1, 2, 5])
def test_fpfh_of_hardly_any_points(count):
    assert fpfh(np.full((count, 3), 0.5)).tolist() == [[0] * CHANNELS["fpfh"]] * count


def test_fpfh_of_no_points_is_refused():
    with pytest.raises(InvalidArgumentError, match=r"points has shape \(0, 3\)"):
        fpfh(np.zeros((0, 3)))


def test_daisy_is_taken_at_the_points_pixels():
    from skimage.feature import daisy as dense_daisy

    rgb = noise(260, 220)
    columns, rows = np.random.default_rng(1).integers(60, 160, (2, 40))
    found = daisy(points_at(columns + 0.5, rows + 0.5, INTRINSICS), rgb, INTRINSICS)
    gray = (rgb / 255.0 @ [0.299, 0.587, 0.114]).astype(np.float32)
    dense = dense_daisy(gray, 1, 15, 2, 6, 8, "daisy")
    apart = np.abs(found - 255.0 * dense[rows - 15, columns - 15])
    assert found.shape == (40, CHANNELS["daisy"])
    assert apart.max() < 1.0


def test_daisy_moves_with_the_picture(picture):
    points = picture.samples[0].points_camera
    found = []
    for left, top in ((130, 140), (137, 151)):
        canvas = np.full((400, 420, 3), 90, np.uint8)
        canvas[top : top + 120, left : left + 160] = picture.rgb
        intrinsics = picture.intrinsics.astype(float)
        intrinsics[:2, 2] += left, top
        found.append(daisy(points, canvas, intrinsics))
    np.testing.assert_array_equal(*found)
    assert len(np.unique(found[0], axis=0)) > 500


def test_daisy_of_a_point_does_not_depend_on_the_other_points():
    rgb = noise(260, 220)
    columns, rows = np.random.default_rng(1).uniform(0, 220, (2, 60))
    points = points_at(columns, rows, INTRINSICS)
    some = daisy(points[:5], rgb, INTRINSICS).astype(int)
    assert np.abs(daisy(points, rgb, INTRINSICS)[:5] - some).max() <= 1


def test_daisy_shrinks_large_objects():
    rgb = noise(260, 220)
    columns, rows = (np.append(each, [0, 199]) for each in np.mgrid[20:180:40, 20:180:40])
    larger = INTRINSICS * [[2.0], [2.0], [1.0]]
    points = points_at(columns + 0.1, rows + 0.1, INTRINSICS)
    small = daisy(points, rgb, INTRINSICS).astype(int)
    large = daisy(points, rgb.repeat(2, axis=0).repeat(2, axis=1), larger)
    assert np.abs(large - small).max() <= 1


def test_daisy_says_what_to_install(monkeypatch, picture):
    for name in ("skimage", "skimage.feature"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(MissingDependencyError, match=r"pip install 'artgym\[baselines\]'"):
        described(picture, picture.samples[0], "daisy")


@pytest.mark.parametrize("features", DESCRIPTORS)
def test_described_samples_differ_in_their_features_alone(picture, features):
    sample = picture.samples[0]
    after = described(picture, sample, features)
    assert after.colors.shape == (len(sample.points_camera), CHANNELS[features])
    assert after.colors.dtype == np.uint8
    for field in dataclasses.fields(sample):
        if field.name != "colors":
            assert getattr(after, field.name) is getattr(sample, field.name)
    assert described(picture, sample, "color") is sample


@pytest.mark.parametrize("features", DESCRIPTORS)
def test_train_and_predict(tmp_path, picture, features):
    for split, seeds in (("train", range(3)), ("val", [100])):
        folder = tmp_path / "data" / "toy" / split
        write_pictures(folder / "0000.h5", [toy_picture(seed) for seed in seeds])
        shard = ShardEntry.of(folder / "0000.h5", len(seeds))
        Manifest(config={}, planned=1, shards=(shard,)).write(folder)
    weights = tmp_path / "toy.safetensors"
    arguments = ["train", "--category", "toy", "--data", str(tmp_path / "data")]
    arguments += ["--out", str(weights), "--epochs", "2", "--num-points", "512"]
    arguments += ["--num-grasp-points", "32", "--batch-size", "2", "--features", features]
    assert cli.main(arguments) == 0
    model, description = load_model(weights)
    assert model.config.features == features
    facts = description["training"]
    assert (facts["training_samples"], facts["validation_samples"]) == (3, 1)
    assert all(np.isfinite(entry["total"]) for entry in facts["validation"])

    perception, rng = Perception.load(weights), np.random.default_rng(0)
    sample = described(picture, picture.samples[0], features)
    prediction = perception.predict(
        sample.points_camera, sample.colors, sample.R_level_camera, rng=rng
    )
    assert np.isfinite(prediction.npcs).all()
    seen, _ = perception.perceive(picture.rgb, picture.depth, picture.intrinsics, rng=rng)
    assert np.isfinite(seen.affordance).all()
    with pytest.raises(InvalidArgumentError, match=rf"\(1500, 3\): expected .*{features}"):
        perception.predict(
            sample.points_camera, picture.samples[0].colors, sample.R_level_camera, rng=rng
        )


def test_samples_without_descriptors_are_refused(tmp_path):
    config = TrainingConfig(category=("toy",), features="fpfh")
    with pytest.raises(InvalidArgumentError, match=r"toy/0000: .* 3 channels, expected the 33"):
        train(config, [toy_sample(0)], [toy_sample(1)], tmp_path / "toy.safetensors")


def test_the_authors_data_has_no_pictures(tmp_path):
    (tmp_path / "drawer").mkdir()
    (tmp_path / "drawer" / "train.txt").write_text("0001\n")
    config = TrainingConfig(category=("drawer",), features="daisy")
    with pytest.raises(InvalidArgumentError, match=r"features='daisy': .* no pictures"):
        commands.train(config, data=tmp_path, out=tmp_path / "x.safetensors", device="cpu")


def test_unknown_features_are_refused():
    with pytest.raises(InvalidArgumentError, match=r"Nearest: 'fpfh'"):
        TrainingConfig(category=("toy",), features="pfh")  # pyright: ignore[reportArgumentType]


def small(**changes):
    backbone = BackboneConfig(centers=(64, 16), neighbors=8)
    config = {"categories": ("toy",), "num_parts": 2, "length_units": (0.25,), "num_points": 256}
    return Icaf4(ModelConfig(**config | {"backbone": backbone} | changes)).eval()


def test_a_network_of_descriptors_tells_categories_apart_and_sees_no_positions():
    model = small(categories=("toy", "box"), length_units=(0.25, 0.25), features="daisy")
    given = torch.rand(1, 256, CHANNELS["daisy"])
    everyone = torch.arange(256)[None]
    with torch.no_grad():
        outputs = [
            model(cloud, given, torch.tensor([category]), everyone).segmentation
            for cloud, category in ((torch.zeros(1, 256, 3), 0), (torch.rand(1, 256, 3), 0))
        ]
        other = model(torch.zeros(1, 256, 3), given, torch.tensor([1]), everyone).segmentation
    assert torch.equal(*outputs)
    assert not torch.allclose(outputs[0], other)


def test_descriptions_from_before_there_was_a_choice_are_of_colours(tmp_path):
    model, weights = small(features="color"), tmp_path / "toy.safetensors"
    save_model(weights, model, {})
    description = json.loads(description_path(weights).read_text())
    assert description["model"].pop("features") == "color"
    description_path(weights).write_text(json.dumps(description))
    assert load_model(weights)[0].config == model.config
    description["model"]["features"] = "sift"
    description_path(weights).write_text(json.dumps(description))
    with pytest.raises(DamagedFileError, match=r"unknown features 'sift'"):
        load_model(weights)
