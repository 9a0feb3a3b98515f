"""Thinning out grasps."""

import numpy as np

from icaf4_policy.proposals import ProposalConfig, diverse


def test_the_best_of_near_grasps_is_kept():
    points = np.array([[0, 0, 0], [0.001, 0, 0], [1, 0, 0]], dtype=float)
    rotations = np.stack([np.eye(3)] * 3)
    np.testing.assert_array_equal(diverse(points, rotations, ProposalConfig()), [0, 2])


def test_what_does_not_fit_is_passed_over():
    points = np.array([[0.0, 0, 0], [0.001, 0, 0], [0.3, 0, 0]])
    R_grasps = np.tile(np.eye(3), (3, 1, 1))
    chosen = diverse(points, R_grasps, ProposalConfig(), lambda index: index != 0)
    np.testing.assert_array_equal(chosen, [1, 2])
