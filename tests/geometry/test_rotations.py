"""Rotations between representations, their metric, and the symmetry of the jaws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from artgym.geometry.rotations import (
    JAW_SYMMETRY,
    axis_angle_from_matrix,
    cross,
    frame_from_z,
    geodesic_angle,
    grasp_angle,
    matrix_from_axis_angle,
    matrix_from_quaternion,
    quaternion_from_matrix,
    skew,
)
from tests.geometry.shapes import ANGLES, BATCH_SHAPES, random_rotvec

every_batch = pytest.mark.parametrize("batch", BATCH_SHAPES, ids=str)
every_angle = pytest.mark.parametrize("angle", ANGLES)


def assert_rotation(R):
    identity = np.broadcast_to(np.eye(3), R.shape)
    np.testing.assert_allclose(R @ np.swapaxes(R, -1, -2), identity, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=1e-12)


@every_batch
@every_angle
def test_axis_angle_round_trip(batch, angle):
    rotvec = random_rotvec(np.random.default_rng(0), batch, angle)
    R = matrix_from_axis_angle(rotvec)
    assert R.shape == (*batch, 3, 3)
    assert_rotation(R)
    np.testing.assert_allclose(axis_angle_from_matrix(R), rotvec, rtol=1e-6, atol=1e-15)
    expected = Rotation.from_rotvec(rotvec.reshape(-1, 3)).as_matrix().reshape(R.shape)
    np.testing.assert_allclose(R, expected, atol=1e-14)


def test_no_turn():
    np.testing.assert_array_equal(matrix_from_axis_angle(np.zeros(3)), np.eye(3))
    np.testing.assert_array_equal(axis_angle_from_matrix(np.eye(3)), np.zeros(3))
    np.testing.assert_array_equal(quaternion_from_matrix(np.eye(3)), [1, 0, 0, 0])


@every_batch
@every_angle
def test_quaternion_round_trip(batch, angle):
    R = matrix_from_axis_angle(random_rotvec(np.random.default_rng(1), batch, angle))
    q_wxyz = quaternion_from_matrix(R)
    assert q_wxyz.shape == (*batch, 4)
    assert np.all(q_wxyz[..., 0] >= 0)
    np.testing.assert_allclose(np.linalg.norm(q_wxyz, axis=-1), 1.0, atol=1e-15)
    np.testing.assert_allclose(matrix_from_quaternion(q_wxyz), R, atol=1e-14)
    np.testing.assert_allclose(matrix_from_quaternion(-3.0 * q_wxyz), R, atol=1e-14)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_half_turns(axis):
    R = -np.eye(3)
    R[axis, axis] = 1.0
    np.testing.assert_allclose(matrix_from_quaternion(quaternion_from_matrix(R)), R, atol=1e-15)
    rotvec = axis_angle_from_matrix(R)
    np.testing.assert_allclose(np.abs(rotvec), np.pi * np.eye(3)[axis], atol=1e-12)


def test_skew_is_the_cross_product():
    a, b = np.random.default_rng(0).normal(size=(2, 4, 3))
    np.testing.assert_allclose((skew(a) @ b[..., None])[..., 0], np.cross(a, b), atol=1e-15)


@every_angle
def test_geodesic_angle(angle):
    rng = np.random.default_rng(2)
    R = matrix_from_axis_angle(random_rotvec(rng, (5,), 2.0))
    turn = matrix_from_axis_angle(random_rotvec(rng, (5,), angle))
    # Near half a turn the chord is flat.
    tolerance = 1e-15 if angle < 2 else 1e-7
    np.testing.assert_allclose(geodesic_angle(R, R @ turn), angle, rtol=1e-3, atol=tolerance)
    np.testing.assert_array_equal(geodesic_angle(R, R), 0.0)
    np.testing.assert_allclose(geodesic_angle(R, R @ turn), geodesic_angle(R @ turn, R))


def test_jaw_symmetry_is_half_a_turn_about_the_approach():
    np.testing.assert_array_equal(JAW_SYMMETRY @ JAW_SYMMETRY, np.eye(3))
    np.testing.assert_array_equal(JAW_SYMMETRY @ [0, 0, 1], [0, 0, 1])
    assert_rotation(JAW_SYMMETRY)


@every_batch
def test_grasp_angle_is_blind_to_the_jaw_symmetry(batch):
    rng = np.random.default_rng(3)
    R1, R2 = (matrix_from_axis_angle(random_rotvec(rng, batch, a)) for a in (2.0, 1.1))
    expected = grasp_angle(R1, R2)
    for first in (R1, R1 @ JAW_SYMMETRY):
        for second in (R2, R2 @ JAW_SYMMETRY):
            np.testing.assert_allclose(grasp_angle(first, second), expected, atol=1e-7)
    np.testing.assert_allclose(grasp_angle(R1, R1 @ JAW_SYMMETRY), 0.0, atol=1e-7)
    assert np.all(expected <= geodesic_angle(R1, R2))
    # Turning the object turns both grasps: the angle stays.
    np.testing.assert_allclose(grasp_angle(R2 @ R1, R2 @ R2), expected, atol=1e-7)


def test_a_quarter_turn_of_the_jaws_is_another_grasp():
    quarter = matrix_from_axis_angle([0, 0, np.pi / 2])
    np.testing.assert_allclose(grasp_angle(np.eye(3), quarter), np.pi / 2, atol=1e-12)


@every_batch
def test_frame_from_z(batch):
    rng = np.random.default_rng(4)
    z, roll = 3.0 * rng.normal(size=(*batch, 3)), rng.uniform(-3, 3, batch)
    R = frame_from_z(z, roll)
    assert_rotation(R)
    np.testing.assert_allclose(R[..., 2], z / np.linalg.norm(z, axis=-1, keepdims=True))
    rolled = frame_from_z(z) @ matrix_from_axis_angle(np.asarray(roll)[..., None] * [0, 0, 1.0])
    np.testing.assert_allclose(R, rolled, atol=1e-12)


@pytest.mark.parametrize("z", np.concatenate([np.eye(3), -np.eye(3)]).tolist())
def test_frame_along_the_axes(z):
    assert_rotation(frame_from_z(z))


@pytest.mark.parametrize(
    ("a", "b"), [((3,), (3,)), ((7, 3), (7, 3)), ((3,), (5, 3)), ((2, 1, 3), (4, 3))]
)
def test_cross_is_numpys_to_the_bit(a, b):
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=a), rng.normal(size=b)
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))
