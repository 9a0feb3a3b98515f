"""What points are given beside where they are: normals that are right, colours left or not."""

from __future__ import annotations

import numpy as np
import pytest

from artgym.datasets.picture_files import write_pictures
from artgym.errors import InvalidArgumentError
from artgym.files import Manifest, ShardEntry
from artgym.geometry.normals import surface_normals
from icaf4_policy import cli
from icaf4_policy.anchors import AnchorConfig, anchors_from_config
from icaf4_policy.checkpoint import load_model
from icaf4_policy.cloud import level_points
from icaf4_policy.features import CHANNELS, point_inputs, require_colors
from icaf4_policy.inference import Perception
from icaf4_policy.targets import DrawConfig, draw_item, targets_from_sample
from tests.icaf4_policy.toy import toy_picture, toy_sample


@pytest.mark.parametrize("features", ["none", "color", "normals", "color_normals"])
def test_inputs_are_colours_and_then_normals(features):
    sample = toy_sample(0, num_points=900)
    normals = sample.normals_camera.astype(float)
    given = point_inputs(sample.colors, normals, features)
    assert given.dtype == np.uint8
    assert given.shape == (900, CHANNELS[features])
    if features.startswith("color"):
        np.testing.assert_array_equal(given[:, :3], sample.colors)
    if features.endswith("normals"):
        decoded = (given[:, -3:].astype(float) - 128.0) / 127.0
        assert np.abs(decoded - normals).max() < 0.005


def test_training_sees_the_normals_that_prediction_does():
    sample = toy_sample(0, num_points=900)
    anchors = anchors_from_config(AnchorConfig())
    learnt = targets_from_sample(sample, ["toy"], anchors, 900, "normals").colors
    points, center = level_points(sample.points_camera, sample.R_level_camera)
    # The camera is at the level frame's origin, before centring.
    seen = point_inputs(sample.colors, surface_normals(points, np.arange(900), -center), "normals")
    # Where a point has hardly a neighbour, rounding or the frame may choose another plane.
    assert np.mean(np.abs(learnt.astype(int) - seen.astype(int)).max(axis=1) <= 1) > 0.95


def test_wrong_colours_are_refused():
    for features, wrong in (("normals", 6), ("color", 33), ("fpfh", 3)):
        colors = np.zeros((50, wrong), np.uint8)
        with pytest.raises(InvalidArgumentError, match=rf", {wrong}\): expected .*{features}"):
            require_colors(colors, 50, features)
    with pytest.raises(InvalidArgumentError, match="descriptors of features 'fpfh'"):
        targets_from_sample(
            toy_sample(0), ["toy"], anchors_from_config(AnchorConfig()), 512, "fpfh"
        )


def test_jitter_changes_colours_and_leaves_normals():
    anchors = anchors_from_config(AnchorConfig())
    targets = targets_from_sample(toy_sample(0), ["toy"], anchors, 512, "color_normals")
    items = [
        draw_item(
            targets,
            DrawConfig(num_points=64, num_anchors=len(anchors), color_jitter=jitter),
            np.random.default_rng(0),
        )
        for jitter in (0.0, 0.3)
    ]
    np.testing.assert_array_equal(items[0]["points_level"], items[1]["points_level"])
    np.testing.assert_array_equal(items[0]["colors"][:, 3:], items[1]["colors"][:, 3:])
    assert not np.array_equal(items[0]["colors"][:, :3], items[1]["colors"][:, :3])


@pytest.mark.parametrize("features", ["none", "color_normals"])
def test_train_and_predict(tmp_path, features):
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
    assert load_model(weights)[0].config.features == features

    perception, sample = Perception.load(weights), toy_sample(3)
    predictions = [
        perception.predict(
            sample.points_camera, colors, sample.R_level_camera, rng=np.random.default_rng(0)
        )
        for colors in (sample.colors, 255 - sample.colors)
    ]
    assert np.isfinite(predictions[0].npcs).all()
    same = np.array_equal(predictions[0].affordance, predictions[1].affordance)
    assert same == (features == "none")
