"""The joint of a part from what each of its points says of it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from artgym.datasets.sample import JOINT_NONE, JOINT_REVOLUTE
from icaf4_policy.prediction import NO_JOINT, JointEstimate

Array = NDArray[np.floating]


def _weighted_median(values: Array, weights: Array) -> Array:
    """Weighted median of each column of ``values`` (n, d)."""
    order = np.argsort(values, axis=0)
    share = np.cumsum(weights[order], axis=0)
    middle = np.argmax(share >= 0.5 * share[-1], axis=0)
    return np.take_along_axis(values, np.take_along_axis(order, middle[None], axis=0), axis=0)[0]


def joint_from_votes(
    type_log: Array, axes: Array, pivots: Array, points: Array, weights: Array, *, moves: bool
) -> JointEstimate:
    """One joint from the votes of a part's points.

    The type has the largest mean log-probability; the axis is the mean direction of the votes
    within 30 degrees of their component-wise median, and the pivot the median of theirs.

    Args:
        type_log: (n, 3), log-probabilities of the codes of ``Sample.joint_type`` plus one.
        axes: (n, 3), camera frame.
        pivots: (n, 3), nearest points of the axis, camera frame, metres.
        points: (n, 3), camera frame, metres.
        weights: (n,), probability that each point is on the part.
        moves: whether the part is known to have a joint.
    """
    votes = (weights[:, None] * type_log).sum(axis=0)
    if moves:
        votes[0] = -np.inf
    joint_type = int(np.argmax(votes)) + JOINT_NONE
    if joint_type == JOINT_NONE:
        return NO_JOINT
    units = axes / np.maximum(np.linalg.norm(axes, axis=-1, keepdims=True), 1e-9)
    middle = _weighted_median(units, weights)
    middle = middle / max(np.linalg.norm(middle), 1e-9)
    agrees = units @ middle > np.cos(np.radians(30.0))
    mean = (weights * agrees) @ units if agrees.any() else middle
    located = pivots if joint_type == JOINT_REVOLUTE else points
    return JointEstimate(
        joint_type=joint_type,
        axis_camera=mean / max(np.linalg.norm(mean), 1e-9),
        pivot_camera=_weighted_median(located, weights),
    )
