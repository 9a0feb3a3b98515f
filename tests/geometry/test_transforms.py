"""Rigid transforms are a group, and act on points as one."""

from __future__ import annotations

import numpy as np
import pytest

from artgym.geometry import transforms
from artgym.geometry.rotations import matrix_from_axis_angle
from tests.geometry.shapes import ANGLES, BATCH_SHAPES, random_rotvec

every_batch = pytest.mark.parametrize("batch", BATCH_SHAPES, ids=str)
every_angle = pytest.mark.parametrize("angle", ANGLES)


def random_transform(rng, batch, angle):
    R = matrix_from_axis_angle(random_rotvec(rng, batch, angle))
    return transforms.transform_from(R, rng.normal(size=(*batch, 3)))


@every_batch
@every_angle
def test_group_axioms(batch, angle):
    rng = np.random.default_rng(0)
    T_a_b, T_b_c, T_c_d = (random_transform(rng, batch, angle) for _ in range(3))
    identity = np.broadcast_to(np.eye(4), (*batch, 4, 4))
    np.testing.assert_allclose(T_a_b @ transforms.invert(T_a_b), identity, atol=1e-12)
    np.testing.assert_allclose(transforms.invert(T_a_b) @ T_a_b, identity, atol=1e-12)
    np.testing.assert_allclose((T_a_b @ T_b_c) @ T_c_d, T_a_b @ (T_b_c @ T_c_d), atol=1e-12)
    np.testing.assert_allclose(
        transforms.invert(T_a_b @ T_b_c),
        transforms.invert(T_b_c) @ transforms.invert(T_a_b),
        atol=1e-12,
    )


@every_batch
@every_angle
def test_action_on_points(batch, angle):
    rng = np.random.default_rng(1)
    T_a_b, T_b_c = random_transform(rng, batch, angle), random_transform(rng, batch, angle)
    points_c = rng.normal(size=(*batch, 5, 3))
    points_a = transforms.apply(T_a_b @ T_b_c, points_c)
    assert points_a.shape == points_c.shape
    np.testing.assert_allclose(
        points_a, transforms.apply(T_a_b, transforms.apply(T_b_c, points_c)), atol=1e-12
    )
    back = transforms.apply(transforms.invert(T_a_b @ T_b_c), points_a)
    np.testing.assert_allclose(back, points_c, atol=1e-12)
    # Differences of points are directions.
    np.testing.assert_allclose(
        transforms.rotate(T_a_b, points_c[..., 1:, :] - points_c[..., :1, :]),
        transforms.apply(T_a_b, points_c)[..., 1:, :]
        - transforms.apply(T_a_b, points_c)[..., :1, :],
        atol=1e-12,
    )


@every_batch
def test_parts_come_back(batch):
    rng = np.random.default_rng(2)
    R = matrix_from_axis_angle(random_rotvec(rng, batch, 1.0))
    t = rng.normal(size=(*batch, 3))
    T = transforms.transform_from(R, t)
    np.testing.assert_array_equal(T[..., :3, :3], R)
    np.testing.assert_array_equal(T[..., :3, 3], t)
    np.testing.assert_array_equal(T[..., 3, :], np.broadcast_to([0, 0, 0, 1], (*batch, 4)))
    np.testing.assert_array_equal(
        transforms.translation(t), transforms.transform_from(np.eye(3), t)
    )


def test_rotation_and_translation_broadcast():
    T = transforms.transform_from(np.eye(3), np.arange(6.0).reshape(2, 3))
    assert T.shape == (2, 4, 4)
