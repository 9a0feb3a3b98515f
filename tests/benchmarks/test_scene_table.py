"""The columns of scenes: the truth scores one, and each wrong claim costs its own column."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from artgym.datasets.sample import AFFORDANCE_YES
from benchmarks.scene_table import COLUMNS, SceneScore, _pixels, compared, owners, precision_rows
from icaf4_policy.detector.evaluation import true_detections
from icaf4_policy.metrics import interpolated_precision
from icaf4_policy.pose_fitting import PoseFit
from icaf4_policy.prediction import PointGrasps, Prediction
from icaf4_policy.scenes import ScenePerception, SeenObject
from icaf4_policy.targets import true_object_boxes, true_part_boxes
from tests.icaf4_policy.toy import toy_picture


@pytest.fixture(scope="module")
def picture():
    """Of the points that fall on one pixel, which are seen through each other, one is left."""
    whole = toy_picture(3, num_points=2500)
    (sample,) = whole.samples
    _, kept = np.unique(_pixels(sample.points_camera, whole), axis=0, return_index=True)
    names = ("points_camera", "colors", "part", "npcs", "naocs", "affordance", "grasp_row")
    thinned = {name: getattr(sample, name)[kept] for name in names}
    return dataclasses.replace(whole, samples=(dataclasses.replace(sample, **thinned),))


class TruthfulPerception:
    """Proposes, at every labelled point, a grasp that succeeds there."""

    def __init__(self, sample) -> None:
        self.sample = sample

    def point_grasps(self, points_camera, colors, R_level_camera, *, top, rng):
        sample = self.sample
        at = np.flatnonzero(sample.affordance == AFFORDANCE_YES)
        tries, rotations = sample.successful_tries(), sample.tried_rotations()
        rows = sample.grasp_row[at]
        R_camera_object = sample.T_camera_object[:3, :3].astype(float)
        first = [R_camera_object @ rotations[row][tries[row]][:1] for row in rows]
        return PointGrasps(
            points_camera=sample.points_camera[at].astype(float),
            point_index=at,
            affordance=np.ones(len(at)),
            graspable=np.ones(len(at), dtype=bool),
            R_camera_grasp=np.stack(first),
            scores=np.ones((len(at), 1)),
        )


def truth(picture) -> SeenObject:
    """What is there, as if it had been seen."""
    (sample,) = picture.samples
    (detection,) = true_detections(picture)

    def fits(boxes):
        return tuple(PoseFit(T_camera_box=T, scale=0.3, inlier_share=1.0) for T in boxes)

    affordance = np.zeros(picture.depth.shape, dtype=np.float32)
    graspable = sample.points_camera[sample.affordance == AFFORDANCE_YES]
    row, column = _pixels(graspable, picture).T
    affordance[row, column] = 1.0
    is_graspable = sample.affordance == AFFORDANCE_YES
    prediction = Prediction(
        points_camera=sample.points_camera.astype(float),
        point_index=np.arange(len(sample.part)),
        part=sample.part.astype(np.int64),
        part_probability=np.eye(sample.num_parts)[sample.part],
        npcs=sample.npcs.astype(float),
        naocs=sample.naocs.astype(float),
        affordance=is_graspable.astype(float),
        graspable=is_graspable,
        part_boxes=fits(true_part_boxes(sample)),
        object_boxes=fits(true_object_boxes(sample)),
        joints=(),
        grasps=None,
        R_level_camera=sample.R_level_camera.astype(float),
    )
    return SeenObject(
        detection=detection,
        prediction=prediction,
        part_mask=picture.part_mask,
        affordance=affordance,
        graspable=affordance > 0,
    )


def row(picture, seen) -> dict[str, float]:
    perception = ScenePerception(
        detector=None, perceptions={"toy": TruthfulPerception(picture.samples[0])}
    )
    entries, counts = compared(picture, seen, perception, np.random.default_rng(0))
    score = SceneScore(entries=entries, counts=counts, truths=[], found=[], seconds=0.0)
    return precision_rows([score], ["toy"])["toy"]


def test_the_truth_scores_one_in_every_column(picture):
    assert row(picture, [truth(picture)]) == dict.fromkeys(COLUMNS, 1.0)


def test_nothing_found_scores_zero(picture):
    assert row(picture, []) == dict.fromkeys(COLUMNS, 0.0)


def test_a_wrong_pose_costs_the_columns_of_poses_alone(picture):
    seen = truth(picture)
    moved = tuple(
        dataclasses.replace(fit, T_camera_box=fit.T_camera_box + 0.06 * np.eye(4, k=3))
        for fit in seen.prediction.part_boxes
    )
    prediction = dataclasses.replace(seen.prediction, part_boxes=moved)
    found = row(picture, [dataclasses.replace(seen, prediction=prediction)])
    assert found == {**dict.fromkeys(COLUMNS, 1.0), "part_pose@5deg5cm": 0.0}


def test_swapped_parts_and_an_empty_affordance_miss(picture):
    seen = truth(picture)
    swapped = np.choose(picture.part_mask, [0, 2, 1]).astype(np.uint8)
    nothing = np.zeros_like(seen.graspable)
    found = row(picture, [dataclasses.replace(seen, part_mask=swapped, graspable=nothing)])
    assert found["part_segmentation@75"] == found["affordance@75"] == found["affordance@95"] == 0.0
    # Half of the classes is half right at most.
    assert found["affordance_miou@75"] == 0.0
    assert found["part_pose@5deg5cm"] == 1.0


def test_a_detection_elsewhere_belongs_to_no_object_and_lowers_what_is_surer(picture):
    seen = truth(picture)
    rolled = np.roll(seen.detection.mask, 60, axis=1)
    strange = dataclasses.replace(
        seen,
        detection=dataclasses.replace(seen.detection, mask=rolled, score=1.0),
        part_mask=np.roll(seen.part_mask, 60, axis=1),
    )
    mine = dataclasses.replace(seen, detection=dataclasses.replace(seen.detection, score=0.9))
    assert owners(picture, [strange, mine]) == [None, 0]
    assert row(picture, [strange, mine]) == dict.fromkeys(COLUMNS, 0.5)


def test_what_the_network_is_unsure_of_ranks_behind_what_is_right(picture):
    seen = truth(picture)
    sure = seen.prediction
    guessed = dataclasses.replace(
        sure,
        part_probability=0.6 * sure.part_probability + 0.4 / 2,
        affordance=0.5 * sure.affordance,
    )
    rolled = np.roll(seen.detection.mask, 60, axis=1)
    strange = dataclasses.replace(
        seen,
        detection=dataclasses.replace(seen.detection, mask=rolled),
        part_mask=np.roll(seen.part_mask, 60, axis=1),
        prediction=guessed,
    )
    mine = dataclasses.replace(seen, detection=dataclasses.replace(seen.detection, score=0.9))
    assert row(picture, [strange, mine]) == dict.fromkeys(COLUMNS, 1.0)


def test_interpolated_precision_of_a_known_case():
    # Right, wrong, right of three: precision 1 to recall 1/3, then 2/3 to recall 2/3.
    value = interpolated_precision([0.9, 0.8, 0.7], [True, False, True], 3)
    assert value == pytest.approx((1.0 + 2.0 / 3.0) / 3.0)
    assert interpolated_precision([], [], 2) == 0.0
    assert np.isnan(interpolated_precision([], [], 0))
