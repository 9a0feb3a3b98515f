"""Pinhole cameras: pixels to points and back."""

from __future__ import annotations

import numpy as np
import pytest

from artgym.geometry import transforms
from artgym.geometry.camera import (
    intrinsics_from_fov,
    look_at,
    pixel_rays,
    points_from_depth,
    project,
)
from tests.geometry.shapes import BATCH_SHAPES

K = intrinsics_from_fov(64, 48, 0.8)


def test_back_projection_and_projection_are_inverse():
    depth = np.random.default_rng(0).uniform(0.3, 2.0, (48, 64))
    points = points_from_depth(depth, K)
    np.testing.assert_array_equal(points[..., 2], depth)
    u, v = np.meshgrid(np.arange(64) + 0.5, np.arange(48) + 0.5)
    np.testing.assert_allclose(project(points, K), np.stack([u, v], -1), atol=1e-10)


@pytest.mark.parametrize("batch", BATCH_SHAPES, ids=str)
def test_projection_keeps_the_batch(batch):
    points = np.random.default_rng(1).uniform(0.5, 1.0, (*batch, 3))
    assert project(points, K).shape == (*batch, 2)


def test_field_of_view():
    # The upper edge of the picture lies half the field of view above its middle.
    np.testing.assert_allclose(project([0, -np.tan(0.4), 1.0], K), [32, 0], atol=1e-12)
    np.testing.assert_allclose(project([0, 0, 1.0], K), [32, 24])
    assert K[0, 0] == K[1, 1]


def test_no_depth_is_the_camera_itself():
    np.testing.assert_array_equal(points_from_depth(np.zeros((2, 3)), K), 0.0)


def test_rays_have_unit_depth():
    np.testing.assert_array_equal(pixel_rays(K, 64, 48)[..., 2], 1.0)


def test_look_at():
    eye, target = np.array([1.0, 0.5, 0.8]), np.array([0.1, 0.0, 0.1])
    T_world_camera = look_at(eye, target)
    R = T_world_camera[:3, :3]
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(R) > 0
    target_camera = transforms.apply(transforms.invert(T_world_camera), target[None])[0]
    np.testing.assert_allclose(target_camera, [0, 0, np.linalg.norm(target - eye)], atol=1e-12)
    # y of the camera goes down, x lies level.
    assert R[2, 1] < 0
    assert abs(R[2, 0]) < 1e-12
