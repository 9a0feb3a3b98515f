"""What points are given beside where they are: normals that are right, colours left or not."""

from __future__ import annotations

import numpy as np
import pytest

from artgym.datasets.picture_files import write_pictures
from artgym.errors import InvalidArgumentError
from artgym.files import Manifest, ShardEntry
from artgym.geometry.rotations import matrix_from_axis_angle
from icaf4_policy import cli
from icaf4_policy.anchors import AnchorConfig, anchors_from_config
from icaf4_policy.checkpoint import load_model
from icaf4_policy.cloud import level_points, plane_normals, surface_normals
from icaf4_policy.features import CHANNELS, point_inputs
from icaf4_policy.inference import Perception
from icaf4_policy.targets import DrawConfig, draw_item, targets_from_sample
from tests.icaf4_policy.toy import toy_picture, toy_sample

CAMERA = np.array([0.4, -0.3, 1.0])


def seen_box(count=6000):
    """Points on the sides of a cube that a camera at ``CAMERA`` sees, and their normals."""
    rng = np.random.default_rng(0)
    axis = rng.integers(0, 3, count)
    normals = np.eye(3)[axis] * np.sign(CAMERA)[axis, None]
    points = rng.uniform(-0.1, 0.1, (count, 3))
    points[np.arange(count), axis] = 0.1 * np.sign(CAMERA)[axis]
    return points, normals


def test_normals_are_those_of_the_surface_on_the_cameras_side():
    points, normals = seen_box()
    at = np.arange(0, len(points), 3)
    found = surface_normals(points, at, CAMERA)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)
    inside = (np.sort(np.abs(points[at]), axis=1)[:, 1] < 0.08) & (np.abs(points[at]).max(1) > 0.09)
    assert inside.sum() > 500
    assert (np.sum(found * normals[at], axis=1)[inside] > 0.999).all()
    assert (np.sum(found * (CAMERA - points[at]), axis=1) >= 0).all()


def test_a_plane_is_the_one_from_which_its_points_are_least_far():
    rng = np.random.default_rng(3)
    turns = matrix_from_axis_angle(rng.normal(size=(60, 3)))
    for thick in ([1, 0.3, 0.01], [1, 1, 0], [1, 0.5, 0.49], [1, 1e-4, 1e-5], [1, 0, 0], [0] * 3):
        # As far away as a camera is, and as small as what is around a point.
        groups = 0.01 * (rng.normal(size=(60, 16, 3)) * thick) @ turns + 1.0
        found = rng.uniform(size=(60, 16)) < 0.8
        index = np.arange(60 * 16).reshape(60, 16)
        of_all = (np.repeat(a, 16, axis=0) for a in (index, found))
        normals = plane_normals(groups.reshape(-1, 3), *of_all, np.zeros(3))[::16]
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-9)
        for normal, group, used in zip(normals, groups, found, strict=True):
            offset = group[used] - group[used].mean(axis=0)
            values = np.linalg.eigvalsh(offset.T @ offset)
            least = normal @ offset.T @ offset @ normal
            assert least <= values[0] + 1e-7 * values[2] + 1e-20


def test_a_long_cloud_has_the_normals_of_some_of_its_points():
    points, _ = seen_box(9000)
    at = np.arange(9000)
    kept = np.linspace(0, 8999, 4096).round().astype(int)
    found = surface_normals(points, at, CAMERA)
    np.testing.assert_array_equal(
        found[kept], surface_normals(points[kept], np.arange(4096), CAMERA)
    )
    nearest = np.linalg.norm(points[:200, None] - points[kept], axis=-1).argmin(axis=1)
    np.testing.assert_array_equal(found[:200], found[kept[nearest]])


def test_normals_turn_with_the_cloud():
    points, _ = seen_box(1500)
    R, t = matrix_from_axis_angle([0.3, -0.8, 1.1]), np.array([0.2, 0.5, -3.0])
    here = surface_normals(points, np.arange(1500), CAMERA)
    there = surface_normals(points @ R.T + t, np.arange(1500), R @ CAMERA + t)
    # Where a plane is badly determined, rounding may choose another.
    assert np.quantile(np.linalg.norm(here @ R.T - there, axis=1), 0.99) < 1e-6


@pytest.mark.parametrize("features", ["none", "color", "normals", "color_normals"])
def test_inputs_are_colours_and_then_normals(features):
    sample = toy_sample(0, num_points=900)
    points, center = level_points(sample.points_camera, sample.R_level_camera)
    at = np.arange(5, 900, 7)
    given = point_inputs(points, sample.colors, center, features, at)
    assert given.dtype == np.uint8
    assert given.shape == (len(at), CHANNELS[features])
    if features.startswith("color"):
        np.testing.assert_array_equal(given[:, :3], sample.colors[at])
    if features.endswith("normals"):
        decoded = (given[:, -3:].astype(float) - 128.0) / 127.0
        # The camera is at the level frame's origin, before centring.
        expected = surface_normals(points + center, at, np.zeros(3))
        assert np.abs(decoded - expected).max() < 0.005


def test_wrong_colours_are_refused():
    sample = toy_sample(0)
    points, center = level_points(sample.points_camera, sample.R_level_camera)
    for features, wrong in (("normals", 6), ("color", 33), ("fpfh", 3)):
        colors = np.zeros((len(points), wrong), np.uint8)
        with pytest.raises(InvalidArgumentError, match=rf", {wrong}\): expected .*{features}"):
            point_inputs(points, colors, center, features, np.arange(3))


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
