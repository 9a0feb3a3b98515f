"""Clouds whose truth is known, the optimizer on an easy one, and everything counted on few."""

from __future__ import annotations

import json

import numpy as np
import pytest

from artgym.errors import InvalidArgumentError
from artgym.geometry.transforms import apply
from benchmarks import pose_speed, speed
from benchmarks.constrained_fit import ConstrainedFitConfig, fit_parts
from benchmarks.pose_speed import PoseSpeedConfig, random_cloud
from benchmarks.report import pose_speed_block
from icaf4_policy.metrics import pose_errors


@pytest.fixture
def exact(monkeypatch):
    """Clouds without any error from here on."""
    for name in ("_NOISE", "_DISTORTION", "_MAX_OUTLIERS", "_AXIS_ERROR"):
        monkeypatch.setattr(pose_speed, name, 0.0)


@pytest.mark.parametrize("parts", [2, 4])
@pytest.mark.usefixtures("exact")
def test_a_cloud_agrees_with_its_truth(parts):
    cloud = random_cloud(parts, np.random.default_rng(0))
    assert sum(map(len, cloud.nocs)) == 2048
    R_relative = cloud.T_camera_boxes[1:, :3, :3] @ cloud.T_camera_boxes[0, :3, :3].T
    turned = R_relative @ cloud.axes_camera[..., None]
    np.testing.assert_allclose(turned[..., 0], cloud.axes_camera, atol=1e-12)
    for nocs, points, T in zip(cloud.nocs, cloud.points_camera, cloud.T_camera_boxes, strict=True):
        centred = points - apply(T, np.zeros((1, 3)))
        scales = np.linalg.norm(centred, axis=1) / np.linalg.norm(nocs - 0.5, axis=1)
        np.testing.assert_allclose(scales, scales[0])


@pytest.mark.usefixtures("exact")
def test_the_optimizer_finds_an_easy_pose():
    for seed in range(2):
        rng = np.random.default_rng(seed)
        cloud = random_cloud(2, rng)
        config = ConstrainedFitConfig(hypotheses=2)
        parts = (cloud.nocs, cloud.points_camera, cloud.joint_types, cloud.axes_base)
        fits = fit_parts(*parts, rng, config)
        errors = pose_errors(np.stack([f.T_camera_box for f in fits]), cloud.T_camera_boxes)
        assert np.max(errors) < 1e-4
        assert min(fit.inlier_share for fit in fits) == 1.0


def test_the_optimizer_says_what_it_needs():
    cloud = random_cloud(2, np.random.default_rng(0))
    few = [nocs[:3] for nocs in cloud.nocs]
    with pytest.raises(InvalidArgumentError, match=r"parts of \[3, 3\] points"):
        fit_parts(
            few,
            [points[:3] for points in cloud.points_camera],
            cloud.joint_types,
            cloud.axes_base,
            np.random.default_rng(0),
            ConstrainedFitConfig(),
        )


def test_everything_is_counted(tmp_path):
    config = PoseSpeedConfig(clouds=6, reference=3, hypotheses=2, out=tmp_path)
    tables = pose_speed.report(config)
    assert [table.row_count for table in tables] == [12, 4]
    result = json.loads((tmp_path / "pose_speed.json").read_text())
    assert [result["rows"][parts]["joints"]["clouds"] for parts in "234"] == [2, 2, 2]
    assert result["all"]["reference"]["clouds"] == 3
    assert result["all"]["reference"]["beside_reference"]["times"] == 1.0
    # Even two hypotheses of it take longer than all of ours.
    assert result["all"]["joints"]["beside_reference"]["times"] > 1
    assert result["all"]["joints"]["rotation_deg"] < 10
    assert pose_speed_block(result).count("\n| ") == 12
    again = pose_speed.measure(config)
    for way in pose_speed.WAYS:
        assert again["all"][way]["rotation_deg"] == result["all"][way]["rotation_deg"]


def test_bad_options(capsys):
    with pytest.raises(InvalidArgumentError, match="reference=2, clouds=300"):
        PoseSpeedConfig(reference=2)
    assert speed.main(["pose"]) == 2
    assert "'poses'" in capsys.readouterr().err
