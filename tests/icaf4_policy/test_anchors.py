import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from artgym.errors import InvalidArgumentError
from artgym.geometry.rotations import JAW_SYMMETRY, geodesic_angle, grasp_angle
from icaf4_policy.anchors import axis_anchors, grasps_from_residuals, match_anchors


def random_rotations(count, seed=0):
    return Rotation.random(count, random_state=seed).as_matrix()


@pytest.mark.parametrize(("step_deg", "count"), [(10, 1836), (20, 486), (30, 180), (45, 72)])
def test_number_of_anchors(step_deg, count):
    assert len(axis_anchors(step_deg)) == count


@pytest.mark.parametrize("step_deg", [20, 30, 45])
def test_anchors_are_rotations_and_differ_under_the_jaw_symmetry(step_deg):
    anchors = axis_anchors(step_deg)
    np.testing.assert_allclose(
        anchors @ np.swapaxes(anchors, -1, -2),
        np.broadcast_to(np.eye(3), anchors.shape),
        atol=1e-12,
    )
    np.testing.assert_allclose(np.linalg.det(anchors), 1.0)
    distances = grasp_angle(anchors[:, None], anchors[None])
    np.fill_diagonal(distances, np.inf)
    assert np.degrees(distances.min()) > step_deg / 2


def test_anchors_cover_the_rotations():
    distances = grasp_angle(random_rotations(2000)[:, None], axis_anchors(45)[None]).min(axis=1)
    assert np.degrees(distances.max()) < 45
    assert np.degrees(distances.mean()) < 25


def test_approaches_lie_on_the_three_great_circles():
    assert np.abs(axis_anchors(30)[:, :, 2]).min(axis=1).max() < 1e-9


def test_anchors_cannot_be_written_to():
    with pytest.raises(ValueError, match="read-only"):
        axis_anchors(45)[0] = 0


@pytest.mark.parametrize("step_deg", [0, -45, 7, 180])
def test_step_must_divide_half_a_turn(step_deg):
    with pytest.raises(InvalidArgumentError, match=f"step_deg={step_deg}"):
        axis_anchors(step_deg)


def test_matched_anchor_is_the_nearest():
    R_grasps, anchors = random_rotations(300), axis_anchors(45)
    matched, _ = match_anchors(R_grasps, anchors)
    np.testing.assert_array_equal(
        matched, grasp_angle(R_grasps[:, None], anchors[None]).argmin(axis=1)
    )


def test_matching_does_not_see_which_finger_is_which():
    R_grasps, anchors = random_rotations(300), axis_anchors(45)
    matched, residual = match_anchors(R_grasps, anchors)
    swapped, swapped_residual = match_anchors(R_grasps @ JAW_SYMMETRY, anchors)
    np.testing.assert_array_equal(matched, swapped)
    np.testing.assert_allclose(residual, swapped_residual, atol=1e-12)


def test_residual_round_trip():
    R_grasps, anchors = random_rotations(300), axis_anchors(45)
    matched, residual = match_anchors(R_grasps, anchors)
    back = grasps_from_residuals(anchors[matched], residual)
    assert grasp_angle(back, R_grasps).max() < 1e-7
    assert np.linalg.norm(residual, axis=-1).max() < 0.4


def test_residual_is_small_where_quaternions_change_sign():
    # Half a turn, a hair less and a hair more: w changes sign between the two.
    anchors = axis_anchors(45)
    for angle in (np.pi - 1e-3, np.pi + 1e-3):
        R = anchors[5] @ Rotation.from_rotvec([0, angle, 0]).as_matrix()
        _, residual = match_anchors(R[None], anchors)
        assert np.linalg.norm(residual) < 0.4


def test_zero_residual_is_the_anchor():
    anchors = axis_anchors(45)
    back = grasps_from_residuals(anchors, np.zeros((len(anchors), 4)))
    assert geodesic_angle(back, anchors).max() < 1e-7
