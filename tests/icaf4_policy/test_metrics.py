import dataclasses

import numpy as np
import pytest

from artgym.geometry.grasps import NUM_CANDIDATES, candidate_rotations
from artgym.geometry.rotations import JAW_SYMMETRY, grasp_angle, matrix_from_axis_angle
from artgym.geometry.transforms import apply, invert, transform_from
from icaf4_policy import metrics
from icaf4_policy.targets import true_object_boxes, true_part_boxes
from tests.icaf4_policy.toy import toy_sample


def normals(count=200):
    directions = np.random.default_rng(0).normal(size=(count, 3))
    return directions / np.linalg.norm(directions, axis=-1, keepdims=True)


def test_class_ious():
    ious = metrics.class_ious([0, 0, 1, 1], [0, 1, 1, 1], 3)
    np.testing.assert_allclose(ious, [1 / 2, 2 / 3, np.nan])


def test_the_expected_iou_is_what_calls_get_where_the_probabilities_are_right():
    rng = np.random.default_rng(0)
    probability = rng.uniform(size=(400, 2))
    called = probability > [0.5, 0.8]
    drawn = rng.uniform(size=(300, 400, 2)) < probability
    ious = (drawn & called).sum(axis=1) / (drawn | called).sum(axis=1)  # (300, 2)
    np.testing.assert_allclose(
        metrics.expected_iou(probability, called), ious.mean(axis=0), atol=0.005
    )
    np.testing.assert_array_equal(metrics.expected_iou(called, called), 1.0)
    np.testing.assert_array_equal(metrics.expected_iou(probability, called & False), 0.0)
    assert metrics.expected_iou(np.zeros((0, 2)), np.zeros((0, 2), bool)).tolist() == [0.0, 0.0]


def test_pose_errors():
    T = transform_from(matrix_from_axis_angle([0, 0, 0.1]), [0.3, 0, 0])
    rotation, translation = metrics.pose_errors(T, np.eye(4))
    assert rotation == pytest.approx(0.1)
    assert translation == pytest.approx(0.3)


def test_axis_errors():
    angle, distance = metrics.axis_errors([0, 0, 1], [0.1, 0, 5], [0, 0, 1], [0, 0, 0])
    assert (angle, distance) == (pytest.approx(0), pytest.approx(0.1))
    angle, _ = metrics.axis_errors([0, 0, -1], [0, 0, 0], [0, 0, 1], [0, 0, 0])
    assert angle == pytest.approx(np.pi)


def test_grasp_scores_of_a_perfect_proposal():
    R = candidate_rotations([0, 0, 1.0])[:3]
    scores = metrics.grasp_scores(metrics.grasp_distances(R @ JAW_SYMMETRY, R))
    assert scores["error_deg"] == pytest.approx(0, abs=1e-5)
    assert scores["precision@5"] == scores["coverage@15"] == 1


def test_grasp_scores_count_the_first_proposal_alone():
    success = np.eye(3)[None]
    wrong = matrix_from_axis_angle([np.radians(30), 0, 0])
    scores = metrics.grasp_scores(metrics.grasp_distances(np.stack([wrong, np.eye(3)]), success))
    assert scores["error_deg"] == pytest.approx(30)
    assert scores["precision@20"] == 0
    assert scores["coverage@15"] == 1


@pytest.mark.parametrize("name", list(metrics.CHANCE_ROWS))
def test_chance_rows_are_grasps_against_the_normal(name):
    R = metrics.CHANCE_ROWS[name](normals(), 5, np.random.default_rng(0))
    assert R.shape == (200, 5, 3, 3)
    np.testing.assert_allclose(np.linalg.det(R), 1.0)
    along = (R[..., 2] * -normals()[:, None]).sum(axis=-1)
    assert along.min() >= (0 if name == "random_hemisphere" else 1 - 1e-9)


def test_rolls_on_the_grid_are_tries_of_the_label_grid():
    R = metrics.normal_on_grid(normals(20), 3, np.random.default_rng(0))
    tries = candidate_rotations(normals(20))
    assert grasp_angle(R[:, :, None], tries[:, None]).min(axis=-1).max() < 1e-6


def test_label_density():
    tries = np.zeros((4, NUM_CANDIDATES), bool)
    tries[0, : NUM_CANDIDATES // 2] = True
    assert metrics.label_density(tries) == (0.125, 0.5)


def test_mean_rows_leaves_gaps_out():
    rows = [{"a": 1.0, "b": np.nan}, {"a": 3.0, "b": 5.0}, {"a": 2.0, "c": np.nan}]
    means = metrics.mean_rows(rows)
    assert (means["a"], means["b"]) == (2.0, 5.0)
    assert np.isnan(means["c"])


@pytest.mark.parametrize("turn", [[0.0, 0.0, 0.0], [0.3, -0.5, 1.0]])
def test_true_boxes_explain_the_normalised_coordinates(turn):
    R, sample = matrix_from_axis_angle(turn), toy_sample(0)
    # The same boxes' corners do not matter here: only their axes and centres.
    sample = dataclasses.replace(
        sample,
        R_object_canonical=R,
        npcs=(sample.npcs - 0.5) @ R + 0.5,
        naocs=(sample.naocs - 0.5) @ R + 0.5,
        part_centers=sample.part_centers @ R,
        object_center=sample.object_center @ R,
    )
    for boxes, coordinates, scales in (
        (true_part_boxes(sample), sample.npcs, sample.part_scales),
        (true_object_boxes(sample), sample.naocs, np.repeat(sample.object_scale, 2)),
    ):
        local = apply(invert(boxes)[sample.part], sample.points_camera[:, None])[:, 0]
        np.testing.assert_allclose(local / scales[sample.part, None] + 0.5, coordinates, atol=1e-4)
