"""What is measured, in plain numpy: parts, poses, joints, affordance, grasps, and chance.

Grasp distances are geodesic angles, minimum over the jaw symmetry. A grasp error means little
without the chance rows and the label density beside it: where many tries succeed, approaching
along the normal is already close to one of them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.geometry.grasps import NUM_ROLLS, candidate_rotations
from artgym.geometry.rotations import frame_from_z, geodesic_angle, grasp_angle

Array = NDArray[np.floating]

#: Angles in degrees at which precision is reported.
PRECISION_DEG: tuple[int, ...] = (5, 10, 15, 20)
#: Angle in degrees within which a successful grasp counts as covered.
COVERAGE_DEG = 15


def class_ious(predicted: ArrayLike, truth: ArrayLike, num_classes: int) -> Array:
    """Intersection over union (num_classes,) of labels (n,); NaN for a class in neither."""
    predicted, truth = np.asarray(predicted), np.asarray(truth)
    ious = np.full(num_classes, np.nan)
    for c in range(num_classes):
        union = np.sum((predicted == c) | (truth == c))
        if union:
            ious[c] = np.sum((predicted == c) & (truth == c)) / union
    return ious


def pose_errors(T_a_predicted: ArrayLike, T_a_true: ArrayLike) -> tuple[Array, Array]:
    """Rotation error in radians and translation error in metres (...) of transforms (..., 4, 4)."""
    predicted, true = np.asarray(T_a_predicted), np.asarray(T_a_true)
    rotation = geodesic_angle(predicted[..., :3, :3], true[..., :3, :3])
    return rotation, np.linalg.norm(predicted[..., :3, 3] - true[..., :3, 3], axis=-1)


def axis_errors(
    axis: ArrayLike, pivot: ArrayLike, true_axis: ArrayLike, true_pivot: ArrayLike
) -> tuple[float, float]:
    """Angle in radians between directed unit axes (3,), and metres from pivot (3,) to true axis."""
    axis, true_axis = np.asarray(axis, dtype=float), np.asarray(true_axis, dtype=float)
    sine = np.linalg.norm(np.cross(axis, true_axis))
    offset = np.cross(np.asarray(pivot, dtype=float) - np.asarray(true_pivot), true_axis)
    return float(np.arctan2(sine, axis @ true_axis)), float(np.linalg.norm(offset))


def grasp_distances(R_proposals: ArrayLike, R_successes: ArrayLike) -> Array:
    """Grasp angles in radians (J, n) between proposals (J, 3, 3) and successes (n, 3, 3)."""
    proposals, successes = np.asarray(R_proposals), np.asarray(R_successes)
    return grasp_angle(proposals[:, None], successes[None])


def grasp_scores(distances: ArrayLike) -> dict[str, float]:
    """The grasp metrics of one point.

    Args:
        distances: (J >= 1, n >= 1) radians, proposals best first.

    Returns:
        "error_deg": top-scored proposal to nearest success; "precision@t": 1 if that is within t
        degrees; "coverage@15": share of successes within 15 degrees of any proposal.
    """
    degrees = np.degrees(np.asarray(distances, dtype=float))
    error = float(degrees[0].min())
    scores = {"error_deg": error}
    scores |= {f"precision@{t}": float(error <= t) for t in PRECISION_DEG}
    scores[f"coverage@{COVERAGE_DEG}"] = float((degrees.min(axis=0) <= COVERAGE_DEG).mean())
    return scores


def expected_iou(probability: ArrayLike, called: ArrayLike) -> Array:
    """The intersection over union (K,) that calls would have if the probabilities were right.

    The ratio of the expectations: what is called, weighed by its probability, over that and what
    was expected and not called. It needs no truth, and tells how sure a claim is.

    Args:
        probability: (N, K).
        called: bool (N, K); where nothing is, the ratio is 0.
    """
    probability, called = np.asarray(probability, dtype=float), np.asarray(called, dtype=bool)
    shared = (probability * called).sum(axis=0)
    either = called.sum(axis=0) + (probability * ~called).sum(axis=0)
    return shared / np.maximum(either, 1e-12)


#: The scores of a call where no try succeeded: no success to be near to.
MISS: dict[str, float] = {f"precision@{t}": 0.0 for t in PRECISION_DEG}


def normal_on_grid(normals: ArrayLike, count: int, rng: np.random.Generator) -> Array:
    """Chance: approach along the inward normal, rolls of the label grid.

    Args:
        normals: outward unit normals (n, 3).
        count: proposals a point, at most the rolls of the grid.
        rng: chooses the rolls.

    Returns:
        (n, count, 3, 3), as of the other chance rows.
    """
    # The first approach of the candidates is the inward normal itself.
    aligned = candidate_rotations(normals)[:, :NUM_ROLLS]
    rolls = np.stack([rng.permutation(NUM_ROLLS)[:count] for _ in range(len(aligned))])
    return np.take_along_axis(aligned, rolls[..., None, None], axis=1)


def normal_any_roll(normals: ArrayLike, count: int, rng: np.random.Generator) -> Array:
    """Chance: approach along the inward normal, any roll; arguments as of ``normal_on_grid``."""
    inward = -np.repeat(np.asarray(normals, dtype=float)[:, None], count, axis=1)
    return frame_from_z(inward, rng.uniform(0.0, np.pi, inward.shape[:2]))


def hemisphere(normals: ArrayLike, count: int, rng: np.random.Generator) -> Array:
    """Chance: any approach against the normal, any roll; arguments as of ``normal_on_grid``."""
    normals = np.asarray(normals, dtype=float)[:, None]
    directions = rng.normal(size=(len(normals), count, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    outward = (directions * normals).sum(axis=-1, keepdims=True) > 0
    return frame_from_z(
        np.where(outward, -directions, directions), rng.uniform(0.0, np.pi, directions.shape[:2])
    )


#: Proposals (n, count, 3, 3) from normals (n, 3), count and generator, see ``normal_on_grid``.
ChanceRow = Callable[[ArrayLike, int, np.random.Generator], Array]

#: Rows to print beside every grasp metric.
CHANCE_ROWS: dict[str, ChanceRow] = {
    "normal_grid_roll": normal_on_grid,
    "normal_random_roll": normal_any_roll,
    "random_hemisphere": hemisphere,
}


def label_density(successful_tries: ArrayLike) -> tuple[float, float]:
    """Share of tries (G, C) that succeed: over all points, and over those with any success."""
    tries = np.asarray(successful_tries, dtype=bool)
    graspable = tries[tries.any(axis=1)]
    within = float(graspable.mean()) if graspable.size else float("nan")
    return (float(tries.mean()) if tries.size else float("nan")), within


def interpolated_precision(scores: ArrayLike, hits: ArrayLike, count: int) -> float:
    """Average precision: the area under precision over recall, precision made to fall only.

    Args:
        scores: (n,), how sure each claim is.
        hits: bool (n,), whether it is right.
        count: how many hits would be complete.

    Returns:
        In [0, 1]; NaN where there is nothing to be found.
    """
    if not count:
        return float("nan")
    order = np.argsort(-np.asarray(scores, dtype=float), kind="stable")
    right = np.cumsum(np.asarray(hits, dtype=bool)[order])
    precision = right / np.arange(1, len(right) + 1)
    highest_beyond = np.maximum.accumulate(precision[::-1])[::-1]
    return float(np.sum(highest_beyond * np.diff(right, prepend=0)) / count)


def mean_rows(rows: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Mean of each entry over the rows that have it; NaN entries are left out."""
    values: dict[str, list[float]] = {}
    for row in rows:
        for name, value in row.items():
            values.setdefault(name, [])
            if not np.isnan(value):
                values[name].append(float(value))
    return {name: float(np.mean(v)) if v else float("nan") for name, v in values.items()}
