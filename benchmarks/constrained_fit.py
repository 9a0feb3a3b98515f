"""The pose fit that ours is compared with: an optimizer inside RANSAC, under a joint's constraint.

After the idea of ANCSH (Li et al., Category-Level Articulated Object Pose Estimation, CVPR 2020,
Section 4.3), in plain scipy: two parts and the joint between them at a time. Each hypothesis
takes a few points of both parts and minimises, by Levenberg-Marquardt over both poses and sizes,
what the points miss and what the joint misses; the one that most points agree with is minimised
again over all of these. The joint's type is given, as it is there. Nothing slows it down on
purpose: it starts from each part's own closed-form fit, its few points keep each solve small, and
its final solve is one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from artgym.errors import InvalidArgumentError
from artgym.geometry.rotations import axis_angle_from_matrix, matrix_from_axis_angle
from artgym.geometry.screw import JointType
from artgym.geometry.transforms import transform_from
from icaf4_policy.pose_fitting import PoseFit, umeyama

Array = NDArray[np.floating]


@dataclass(frozen=True, kw_only=True)
class ConstrainedFitConfig:
    """How hard it tries.

    Attributes:
        hypotheses: sets of points that are tried for each joint.
        sampled: points of each part in a set.
        tolerance: largest error of an inlier, in normalised units.
    """

    hypotheses: int = 200
    sampled: int = 5
    tolerance: float = 0.05


def fit_parts(
    nocs: Sequence[Array],
    points_camera: Sequence[Array],
    joint_types: Sequence[JointType],
    axes: Array,
    rng: np.random.Generator,
    config: ConstrainedFitConfig,
) -> tuple[PoseFit, ...]:
    """Fits all K parts, each with the base (part 0), whose pose is that of the first such pair.

    Args:
        nocs: of each part, (n, 3), 0.5 at the box's centre.
        points_camera: of each part, (n, 3), metres.
        joint_types: (K - 1,), of the joints between base and part.
        axes: (K - 1, 3), their unit axes in the frame of the base, and so of the part.
        rng: chooses the points.
        config: how hard it tries.

    Raises:
        InvalidArgumentError: there is but one part, or one has fewer points than are sampled.
    """
    counts = [len(part) for part in nocs]
    if len(counts) < 2 or min(counts) < config.sampled:
        raise InvalidArgumentError(
            f"parts of {counts} points: give two parts or more, each of {config.sampled} or more."
        )
    fits: list[PoseFit] = []
    for k, (joint_type, axis) in enumerate(zip(joint_types, axes, strict=True), start=1):
        sources, targets = [nocs[0] - 0.5, nocs[k] - 0.5], [points_camera[0], points_camera[k]]
        pair = _fit_pair(sources, targets, joint_type, axis, rng, config)
        fits += pair if k == 1 else pair[1:]
    return tuple(fits)


def _fit_pair(
    sources: list[Array],
    targets: list[Array],
    joint_type: JointType,
    axis: Array,
    rng: np.random.Generator,
    config: ConstrainedFitConfig,
) -> list[PoseFit]:
    """The poses of two parts with most inliers, solved again over these."""

    def inliers(poses: Array) -> list[NDArray[np.bool_]]:
        return [
            np.sum(_residuals(pose, x, y) ** 2, axis=-1) < config.tolerance**2
            for pose, x, y in zip(poses, sources, targets, strict=True)
        ]

    most, best = -1, np.zeros((2, 7))
    for _ in range(config.hypotheses):
        picks = [rng.choice(len(x), config.sampled, replace=False) for x in sources]
        poses = _minimise(
            [x[p] for x, p in zip(sources, picks, strict=True)],
            [y[p] for y, p in zip(targets, picks, strict=True)],
            joint_type,
            axis,
        )
        count = sum(int(agree.sum()) for agree in inliers(poses))
        if count > most:
            most, best = count, poses
    agree = inliers(best)
    if min(a.sum() for a in agree) >= config.sampled:
        best = _minimise(
            [x[a] for x, a in zip(sources, agree, strict=True)],
            [y[a] for y, a in zip(targets, agree, strict=True)],
            joint_type,
            axis,
        )
    return [
        PoseFit(
            T_camera_box=transform_from(matrix_from_axis_angle(pose[:3]), pose[3:6]),
            scale=float(np.exp(pose[6])),
            inlier_share=float(a.mean()),
        )
        for pose, a in zip(best, agree, strict=True)
    ]


def _residuals(pose: Array, source: Array, target: Array) -> Array:
    """(n, 3), in normalised units; a pose (7,) is rotation vector, centre and log of the scale."""
    R = matrix_from_axis_angle(pose[:3])
    return (target - pose[3:6]) @ R * np.exp(-pose[6]) - source


def _minimise(
    sources: list[Array], targets: list[Array], joint_type: JointType, axis: Array
) -> Array:
    """Poses (2, 7) of least error, from those that fit each part alone."""
    start = np.empty((2, 7))
    for pose, x, y in zip(start, sources, targets, strict=True):
        scale, R, center = umeyama(x, y, np.ones(len(x)))
        pose[:3], pose[3:6] = axis_angle_from_matrix(R), center
        pose[6] = np.log(max(scale, 1e-6))
    # The joint counts as much as the points together, whose spread is a third of a unit.
    weight = np.sqrt(sum(len(x) for x in sources)) / 3.0

    def errors(parameters: Array) -> Array:
        poses = parameters.reshape(2, 7)
        R_base, R_part = matrix_from_axis_angle(poses[:, :3])
        joint = R_base - R_part if joint_type == "prismatic" else (R_base - R_part) @ axis
        points = [_residuals(*part).ravel() for part in zip(poses, sources, targets, strict=True)]
        return np.concatenate([*points, weight * joint.ravel()])

    return least_squares(errors, start.ravel(), method="lm", ftol=1e-4).x.reshape(2, 7)
