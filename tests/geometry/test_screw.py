"""The motion of a joint against what small steps of it compose to."""

from __future__ import annotations

import numpy as np
import pytest

from artgym.geometry import transforms
from artgym.geometry.screw import joint_motion
from tests.geometry.shapes import BATCH_SHAPES

every_type = pytest.mark.parametrize("joint_type", ["prismatic", "revolute"])
AXIS = np.array([2.0, -1.0, 2.0]) / 3.0
PIVOT = np.array([0.3, -0.2, 0.5])


@every_type
def test_steps_compose(joint_type):
    whole = joint_motion(joint_type, AXIS, PIVOT, 1.7)
    step = joint_motion(joint_type, AXIS, PIVOT, 1.7 / 1000)
    np.testing.assert_allclose(np.linalg.matrix_power(step, 1000), whole, atol=1e-10)
    back = joint_motion(joint_type, AXIS, PIVOT, -1.7)
    np.testing.assert_allclose(back, transforms.invert(whole), atol=1e-12)


@every_type
def test_velocity_is_the_joint_s(joint_type):
    point, h = np.array([[0.1, 0.2, 0.3]]), 1e-7
    moved = transforms.apply(joint_motion(joint_type, AXIS, PIVOT, h), point)
    velocity = AXIS if joint_type == "prismatic" else np.cross(AXIS, point[0] - PIVOT)
    np.testing.assert_allclose((moved - point)[0] / h, velocity, atol=1e-6)


def test_the_axis_stays():
    on_axis = PIVOT + np.linspace(-1, 1, 5)[:, None] * AXIS
    turned = transforms.apply(joint_motion("revolute", AXIS, PIVOT, 2.1), on_axis)
    np.testing.assert_allclose(turned, on_axis, atol=1e-12)


@every_type
@pytest.mark.parametrize("batch", BATCH_SHAPES, ids=str)
def test_batches(joint_type, batch):
    q = np.random.default_rng(0).normal(size=batch)
    T = joint_motion(joint_type, AXIS, PIVOT, q)
    assert T.shape == (*batch, 4, 4)
    for index in np.ndindex(batch):
        np.testing.assert_allclose(
            T[index], joint_motion(joint_type, AXIS, PIVOT, q[index]), atol=1e-14
        )


@every_type
@pytest.mark.parametrize("q", [0.0, 1e-12, -1e-9])
def test_near_the_identity(joint_type, q):
    T = joint_motion(joint_type, AXIS, PIVOT, q)
    np.testing.assert_allclose(T, np.eye(4), atol=2e-9)
    if q == 0.0:
        np.testing.assert_array_equal(T[:3, :3], np.eye(3))
