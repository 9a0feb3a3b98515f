"""Joints from the votes of points."""

import numpy as np

from artgym.datasets.sample import JOINT_NONE
from icaf4_policy.joint_votes import joint_from_votes


def test_joint_votes_survive_outliers():
    generator = np.random.default_rng(0)
    axis, pivot = np.array([0, 0.6, 0.8]), np.array([0.1, 0.2, 0.5])
    axes = np.tile(axis, (100, 1))
    pivots = pivot + generator.normal(scale=0.02, size=(100, 1)) * axis
    axes[:30], pivots[:30] = generator.normal(size=(30, 3)), generator.normal(size=(30, 3))
    type_log = np.log(np.tile([0.1, 0.1, 0.8], (100, 1)))
    joint = joint_from_votes(type_log, axes, pivots, pivots, np.ones(100), moves=False)
    assert joint.joint_type == 1
    assert np.degrees(np.arccos(min(joint.axis_camera @ axis, 1.0))) < 3
    assert np.linalg.norm(np.cross(joint.pivot_camera - pivot, axis)) < 0.02
    votes = (type_log[:, ::-1], axes, pivots, pivots, np.ones(100))
    assert joint_from_votes(*votes, moves=False).joint_type == JOINT_NONE
    assert joint_from_votes(*votes, moves=True).joint_type != JOINT_NONE
