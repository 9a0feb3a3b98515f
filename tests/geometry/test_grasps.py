"""The grasps tried at a surface point."""

from __future__ import annotations

import numpy as np
import pytest

from artgym.geometry.grasps import (
    GRASP_DEPTH,
    NUM_APPROACHES,
    NUM_CANDIDATES,
    NUM_ROLLS,
    T_GRASP_TCP,
    TIP_BEYOND_TCP,
    candidate_rotations,
)
from artgym.geometry.rotations import frame_from_z, grasp_angle
from tests.geometry.shapes import BATCH_SHAPES


def normals(batch):
    n = np.random.default_rng(0).normal(size=(*batch, 3))
    return n / np.linalg.norm(n, axis=-1, keepdims=True)


@pytest.mark.parametrize("batch", BATCH_SHAPES, ids=str)
def test_candidates_are_rotations_in_the_hemisphere_against_the_normal(batch):
    n = normals(batch)
    R = candidate_rotations(n)
    assert R.shape == (*batch, NUM_CANDIDATES, 3, 3)
    identity = np.broadcast_to(np.eye(3), R.shape)
    np.testing.assert_allclose(R @ np.swapaxes(R, -1, -2), identity, atol=1e-12)
    assert np.all(np.linalg.det(R) > 0)
    cosine = np.einsum("...j,...cj->...c", n, R[..., 2])
    assert np.all(cosine < -0.1)
    # The first ring is the inward normal itself.
    np.testing.assert_allclose(cosine[..., :NUM_ROLLS], -1.0, atol=1e-12)


def test_about_two_hundred_different_grasps():
    assert NUM_CANDIDATES == NUM_APPROACHES * NUM_ROLLS == 200
    R = candidate_rotations(np.array([0.0, 0.0, 1.0]))
    angle = grasp_angle(R[:, None], R[None])
    np.fill_diagonal(angle, np.inf)
    # Rolls stand half a turn / 8 apart, approaches farther.
    assert np.degrees(angle.min()) > 15.0


def test_no_grasp_of_the_hemisphere_is_far_from_a_candidate():
    rng = np.random.default_rng(1)
    z = rng.normal(size=(500, 3))
    z[:, 2] = -np.abs(z[:, 2])
    R = frame_from_z(z, rng.uniform(0, 2 * np.pi, 500))
    nearest = grasp_angle(R[:, None], candidate_rotations([0.0, 0.0, 1.0])).min(axis=1)
    assert np.degrees(nearest.max()) < 35.0


def test_index_is_approach_times_rolls_plus_roll():
    R = candidate_rotations(normals(())).reshape(NUM_APPROACHES, NUM_ROLLS, 3, 3)
    np.testing.assert_allclose(R[..., 2], np.broadcast_to(R[:, :1, :, 2], R[..., 2].shape))
    cosine = np.einsum("arj,aj->ar", R[..., 1], R[:, 0, :, 1])
    expected = np.cos(np.arange(NUM_ROLLS) * np.pi / NUM_ROLLS)
    np.testing.assert_allclose(cosine, np.broadcast_to(expected, cosine.shape), atol=1e-12)


def test_fingertips_go_beyond_the_point_by_the_grasp_depth():
    tip_tcp = np.array([0.0, 0.0, TIP_BEYOND_TCP, 1.0])
    np.testing.assert_allclose(T_GRASP_TCP @ tip_tcp, [0, 0, GRASP_DEPTH, 1])
