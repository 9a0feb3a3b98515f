"""A trained network against a labelled sample: one flat row of metrics a view."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from artgym.datasets.sample import (
    AFFORDANCE_NO,
    AFFORDANCE_UNKNOWN,
    AFFORDANCE_YES,
    JOINT_NONE,
    Sample,
)
from icaf4_policy import metrics
from icaf4_policy.inference import MIN_PART_POINTS, Perception
from icaf4_policy.naming import named_from_view
from icaf4_policy.pose_fitting import PoseFit
from icaf4_policy.prediction import PointGrasps, Prediction
from icaf4_policy.targets import true_object_boxes, true_part_boxes

Array = NDArray[np.floating]


def evaluate_sample(
    perception: Perception,
    sample: Sample,
    rng: np.random.Generator,
    *,
    top: int = 10,
    refit: Callable[[Prediction], Prediction] | None = None,
) -> tuple[dict[str, float], Prediction]:
    """Every metric of one view, from the points of the sample's object.

    Which side of an object is its front is taken from the view where both look the same, see
    ``naming``.

    Args:
        perception: the network.
        sample: a labelled view.
        rng: for the choice of points, the fits and the chance rows.
        top: J, proposals a point that coverage counts.
        refit: what another way to fit poses makes of a prediction.

    Returns:
        A row for ``metrics.mean_rows``, and the prediction that it is of; NaN where a metric does
        not apply. Grasp metrics are over the points with successful tries that the network calls
        graspable (``grasp/network/...``), and over all its calls, where one at a point that offers
        nothing misses (``grasp_calls/network/...``), each beside its chance rows.
    """
    sample = named_from_view(sample)
    seen = (sample.points_camera, sample.colors, sample.R_level_camera)
    prediction = perception.predict(*seen, rng=rng)
    if refit is not None:
        prediction = refit(prediction)
    row = _part_metrics(prediction, sample) | _joint_metrics(prediction, sample)

    row |= _affordance_metrics(prediction, sample)
    row["label_density"], row["label_density_graspable"] = metrics.label_density(
        sample.successful_tries()
    )
    points = perception.point_grasps(*seen, top=top, rng=rng)
    return row | _grasp_metrics(points, sample, rng, top, metrics.CHANCE_ROWS), prediction


def evaluate_grasps(
    perception: Perception,
    sample: Sample,
    rng: np.random.Generator,
    *,
    top: int = 10,
    chance: bool = True,
) -> dict[str, float]:
    """The metrics of affordance and grasps of one view alone, as ``evaluate_sample`` has them.

    Networks that differ in their grasp heads alone are asked at the same points for the same
    ``rng``, and stand beside the same chance rows.

    Args:
        perception: the network.
        sample: a labelled view.
        rng: for the choice of points and the chance rows.
        top: J, proposals a point that coverage counts.
        chance: whether the chance rows are measured.
    """
    seen = (sample.points_camera, sample.colors, sample.R_level_camera)
    points = perception.point_grasps(*seen, top=top, rng=rng)
    sources = metrics.CHANCE_ROWS if chance else {}
    return _affordance_metrics(points, sample) | _grasp_metrics(points, sample, rng, top, sources)


def _affordance_metrics(seen: Prediction | PointGrasps, sample: Sample) -> dict[str, float]:
    truth = sample.affordance[seen.point_index]
    known = truth != AFFORDANCE_UNKNOWN
    called = seen.graspable
    ious = metrics.class_ious(called[known], truth[known] == AFFORDANCE_YES, 2)
    return {
        "affordance_iou": float(ious[1]),
        "affordance_miou": float(np.nanmean(ious)) if known.any() else float("nan"),
    }


def _part_metrics(prediction: Prediction, sample: Sample) -> dict[str, float]:
    true_part = sample.part[prediction.point_index]
    ious = metrics.class_ious(prediction.part, true_part, sample.num_parts)
    row = {"part_miou": float(np.nanmean(ious))}
    visible = np.bincount(true_part, minlength=sample.num_parts) >= MIN_PART_POINTS
    # Parts of an object that the network was not trained to tell apart count as not found.
    part_boxes = _boxes_of_parts(prediction.part_boxes, sample.num_parts)
    object_boxes = _boxes_of_parts(prediction.object_boxes, sample.num_parts)
    found = [box is not None for box in part_boxes]
    row["parts_found"] = float(np.mean(np.array(found)[visible])) if visible.any() else np.nan
    row |= _box_metrics("part", part_boxes, true_part_boxes(sample), visible)
    return row | _box_metrics("object", object_boxes, true_object_boxes(sample), visible)


def _boxes_of_parts(
    boxes: tuple[PoseFit | None, ...], num_parts: int
) -> tuple[PoseFit | None, ...]:
    """The boxes of a network of other parts, as those of an object of ``num_parts``."""
    return (*boxes, *(None,) * num_parts)[:num_parts]


def _box_metrics(
    name: str,
    fits: tuple[PoseFit | None, ...],
    T_camera_boxes: Array,
    visible: NDArray[np.bool_],
) -> dict[str, float]:
    rotations, translations = np.full(len(fits), np.nan), np.full(len(fits), np.nan)
    for k, fit in enumerate(fits):
        if fit is not None and visible[k]:
            rotation, translations[k] = metrics.pose_errors(fit.T_camera_box, T_camera_boxes[k])
            rotations[k] = np.degrees(rotation)
    row = {}
    for k in range(len(fits)):
        row[f"{name}_rotation_deg/{k}"] = float(rotations[k])
        row[f"{name}_translation_m/{k}"] = float(translations[k])
    any_fit = np.isfinite(rotations).any()
    row[f"{name}_rotation_deg"] = float(np.nanmean(rotations)) if any_fit else np.nan
    row[f"{name}_translation_m"] = float(np.nanmean(translations)) if any_fit else np.nan
    return row


def _joint_metrics(prediction: Prediction, sample: Sample) -> dict[str, float]:
    rows = []
    for k in np.flatnonzero(sample.joint_type != JOINT_NONE):
        if k >= len(prediction.joints) or prediction.part_boxes[k] is None:
            continue
        joint = prediction.joints[k]
        angle, distance = metrics.axis_errors(
            joint.axis_camera,
            joint.pivot_camera,
            sample.joint_axis_camera[k],
            sample.joint_pivot_camera[k],
        )
        right = joint.joint_type == sample.joint_type[k]
        revolute = right and joint.joint_type == 1
        rows.append(
            {
                "joint_type_accuracy": float(right),
                "joint_axis_deg": float(np.degrees(angle)) if right else np.nan,
                "joint_pivot_m": distance if revolute else np.nan,
            }
        )
    return metrics.mean_rows(rows)


def _grasp_metrics(
    points: PointGrasps,
    sample: Sample,
    rng: np.random.Generator,
    top: int,
    chance_rows: Mapping[str, metrics.ChanceRow],
) -> dict[str, float]:
    label = sample.grasp_row[points.point_index]
    tries = sample.successful_tries()
    # Points without a label, -1, find the last entry.
    graspable = np.append(np.any(tries, axis=1), False)[label]
    judged = np.flatnonzero(graspable)
    if not len(judged):
        return {}
    # All in the object's frame, in which the tries were made.
    R_object_tries = sample.tried_rotations()[label[judged]]
    # The first try of all goes straight against the surface.
    normals_object = -R_object_tries[:, 0, :, 2]
    R_object_camera = sample.T_camera_object[:3, :3].astype(float).T
    proposals = {"network": R_object_camera @ points.R_camera_grasp[judged]}
    for name, propose in chance_rows.items():
        proposals[name] = propose(normals_object, top, rng)
    called = points.graspable[judged]
    # A call at a point that offers nothing is a miss at any angle; where no label lies near,
    # nothing is known.
    offers_nothing = sample.affordance[points.point_index] == AFFORDANCE_NO
    wrong_calls = int(np.sum(points.graspable & offers_nothing))
    misses = [metrics.MISS] * wrong_calls
    row: dict[str, float] = {"grasp_points_called": float(called.mean())}
    for name, R_proposals in proposals.items():
        scores = []
        for i in range(len(judged)):
            R_successes = R_object_tries[i, tries[label[judged[i]]]]
            distances = metrics.grasp_distances(R_proposals[i], R_successes)
            scores.append(metrics.grasp_scores(distances))
        right_calls = [score for score, call in zip(scores, called, strict=True) if call]
        for prefix, counted in (("grasp", right_calls), ("grasp_calls", right_calls + misses)):
            means = metrics.mean_rows(counted)
            row |= {f"{prefix}/{name}/{key}": value for key, value in means.items()}
    return row
