import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from artgym.errors import InvalidArgumentError, UnknownNameError
from artgym.geometry.rotations import JAW_SYMMETRY, geodesic_angle, grasp_angle
from icaf4_policy.anchors import (
    AnchorConfig,
    anchors_from_config,
    axis_anchors,
    so3_anchors,
)

KINDS = [AnchorConfig(kind="axis"), AnchorConfig(kind="so3"), AnchorConfig(kind="direct")]
every_kind = pytest.mark.parametrize(
    "anchors", [anchors_from_config(config) for config in KINDS], ids=lambda a: a.kind
)


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


def degrees_to_nearest(anchors):
    distances = grasp_angle(random_rotations(2000)[:, None], anchors[None]).min(axis=1)
    return np.degrees(distances)


def test_anchors_cover_the_rotations():
    axis, so3 = degrees_to_nearest(axis_anchors(45)), degrees_to_nearest(so3_anchors(72))
    assert axis.max() < 45
    assert axis.mean() < 25
    assert so3.max() < 45
    assert so3.mean() < 23


def test_more_so3_anchors_lie_nearer():
    means = [degrees_to_nearest(so3_anchors(count)).mean() for count in (36, 72, 156, 444)]
    assert means == sorted(means, reverse=True)


@pytest.mark.parametrize("count", [1, 72, 156])
def test_so3_anchors_are_as_many_rotations(count):
    anchors = so3_anchors(count)
    eye = np.broadcast_to(np.eye(3), (count, 3, 3))
    np.testing.assert_allclose(anchors @ np.swapaxes(anchors, -1, -2), eye, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(anchors), 1.0)


def test_approaches_lie_on_the_three_great_circles():
    assert np.abs(axis_anchors(30)[:, :, 2]).min(axis=1).max() < 1e-9


def test_anchors_cannot_be_written_to():
    with pytest.raises(ValueError, match="read-only"):
        axis_anchors(45)[0] = 0


def test_no_two_so3_anchors_are_one_grasp():
    distances = grasp_angle(so3_anchors(72)[:, None], so3_anchors(72)[None])
    np.fill_diagonal(distances, np.inf)
    assert np.degrees(distances.min()) > 25


def test_a_frame_that_does_not_exist_is_named():
    with pytest.raises(UnknownNameError, match="level"):
        AnchorConfig(frame="camera")


@pytest.mark.parametrize("step_deg", [0, -45, 7, 180])
def test_step_must_divide_half_a_turn(step_deg):
    with pytest.raises(InvalidArgumentError, match=f"step_deg={step_deg}"):
        AnchorConfig(step_deg=step_deg)


def test_there_is_an_so3_anchor():
    with pytest.raises(InvalidArgumentError, match="count=0"):
        AnchorConfig(kind="so3", count=0)


@every_kind
def test_matched_anchor_is_the_nearest(anchors):
    R_grasps = random_rotations(300)
    matched, _ = anchors.match(R_grasps)
    np.testing.assert_array_equal(
        matched, grasp_angle(R_grasps[:, None], anchors.rotations[None]).argmin(axis=1)
    )


@every_kind
def test_matching_does_not_see_which_finger_is_which(anchors):
    R_grasps = random_rotations(300)
    matched, residual = anchors.match(R_grasps)
    swapped, swapped_residual = anchors.match(R_grasps @ JAW_SYMMETRY)
    np.testing.assert_array_equal(matched, swapped)
    np.testing.assert_allclose(residual, swapped_residual, atol=1e-12)


@every_kind
def test_residual_round_trip(anchors):
    R_grasps = random_rotations(300)
    matched, residual = anchors.match(R_grasps)
    assert residual.shape == (300, anchors.residual_size)
    assert grasp_angle(anchors.grasps(matched, residual), R_grasps).max() < 1e-7


@pytest.mark.parametrize(("kind", "longest"), [("axis", 0.4), ("so3", 1.0)])
def test_residuals_are_no_longer_than_the_way_to_the_anchor(kind, longest):
    _, residual = anchors_from_config(AnchorConfig(kind=kind)).match(random_rotations(300))
    assert np.linalg.norm(residual, axis=-1).max() < longest


def test_residual_of_so3_anchors_is_the_angle_to_them():
    R_grasps, anchors = random_rotations(300), anchors_from_config(AnchorConfig(kind="so3"))
    matched, residual = anchors.match(R_grasps)
    np.testing.assert_allclose(
        np.linalg.norm(residual, axis=-1), grasp_angle(R_grasps, anchors.rotations[matched])
    )


def test_residual_is_small_where_quaternions_change_sign():
    # Half a turn, a hair less and a hair more: w changes sign between the two.
    anchors = anchors_from_config(AnchorConfig())
    for angle in (np.pi - 1e-3, np.pi + 1e-3):
        R = anchors.rotations[5] @ Rotation.from_rotvec([0, angle, 0]).as_matrix()
        _, residual = anchors.match(R[None])
        assert np.linalg.norm(residual) < 0.4


@every_kind
def test_zero_residual_is_the_anchor(anchors):
    back = anchors.grasps(np.arange(len(anchors)), np.zeros((len(anchors), anchors.residual_size)))
    assert geodesic_angle(back, anchors.rotations).max() < 1e-7
