"""Scalar quaternions agree with the rotation matrices."""

import numpy as np
import pytest

from artgym.geometry import quaternions
from artgym.geometry.rotations import (
    matrix_from_axis_angle,
    matrix_from_quaternion,
    quaternion_from_matrix,
)

SCALES = (1.0, 1e-3, 1e-7, 0.0)


@pytest.fixture(params=range(8))
def rng(request):
    return np.random.default_rng(request.param)


@pytest.mark.parametrize("scale", SCALES)
def test_rotation_vector(rng, scale):
    v = scale * rng.normal(size=3)
    q = quaternions.quaternion_from_rotation_vector(*v)
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(matrix_from_quaternion(q), matrix_from_axis_angle(v), atol=1e-12)


def test_product_axes_and_rotation(rng):
    a, b = (quaternions.quaternion_from_rotation_vector(*rng.normal(size=3)) for _ in range(2))
    R_a, R_b = matrix_from_quaternion(a), matrix_from_quaternion(b)
    product = matrix_from_quaternion(quaternions.product(a, b))
    np.testing.assert_allclose(product, R_a @ R_b, atol=1e-12)
    np.testing.assert_allclose(quaternions.x_axis(a), R_a[:, 0], atol=1e-12)
    np.testing.assert_allclose(quaternions.y_axis(a), R_a[:, 1], atol=1e-12)
    np.testing.assert_allclose(quaternions.z_axis(a), R_a[:, 2], atol=1e-12)
    v = rng.normal(size=3)
    np.testing.assert_allclose(quaternions.rotate(a, v), R_a @ v, atol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1.0, np.pi - 1e-9, np.pi])
def test_matrices(rng, angle):
    axis = rng.normal(size=3)
    R = matrix_from_axis_angle(angle * axis / np.linalg.norm(axis))
    q = quaternions.quaternion_from_rows(R.tolist())
    np.testing.assert_allclose(q, quaternion_from_matrix(R), atol=1e-12)
    np.testing.assert_allclose(quaternions.rows_from_quaternion(q), R, atol=1e-12)
    double = [2.0 * each for each in q]
    np.testing.assert_allclose(quaternions.rows_from_quaternion(double), R, atol=1e-12)
