"""The authors' released samples as targets to train on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from artgym.datasets.authors import AuthorsSample
from artgym.datasets.sample import (
    AFFORDANCE_UNKNOWN,
    AFFORDANCE_YES,
    JOINT_NONE,
    JOINT_REVOLUTE,
    level_from_camera,
)
from artgym.errors import DamagedFileError
from artgym.geometry.normals import surface_normals
from icaf4_policy.anchors import Anchors
from icaf4_policy.cloud import level_points
from icaf4_policy.features import DEFAULT_FEATURES, Features, has_normals, point_inputs
from icaf4_policy.pose_fitting import umeyama
from icaf4_policy.targets import Targets

Array = NDArray[np.floating]

#: ``AuthorsSample.joint_nearness`` falls to 0 at this distance from the axis, NAOCS units.
_JOINT_RADIUS = 0.2
#: The files do not tell where up is: the camera is taken to be level.
_R_LEVEL_CAMERA = level_from_camera([0.0, -1.0, 0.0])
#: Nor what colour a point has.
_GRAY = 128
#: That a pose is fitted to.
_FEWEST_POINTS = 4


def targets_from_authors(
    sample: AuthorsSample, anchors: Anchors, max_points: int, features: Features = DEFAULT_FEATURES
) -> Targets:
    """Works out the targets of one of the authors' samples, of the network's first category.

    Each graspable point has its one grasp as target; where anchors turn with the parts, a point on
    a part that is hardly seen is not known to be graspable. Joints are brought from normalised
    coordinates to metres by the pose that fits the points of the base.

    Args:
        sample: one view.
        anchors: what grasps are matched with.
        max_points: of a longer cloud, this many points are kept, evenly in their order.
        features: what the network is given of each point; no descriptors.

    Raises:
        DamagedFileError: too little is seen of the base to bring the joints to metres.
    """
    points_level, center_level = level_points(sample.points_camera, _R_LEVEL_CAMERA)
    total = len(points_level)
    keep = np.linspace(0, total - 1, min(total, max_points)).round().astype(int)
    affordance = sample.affordance[keep].copy()
    R_grasps = _R_LEVEL_CAMERA @ sample.R_camera_grasps[keep].astype(float)
    if anchors.frame == "part":
        for k in range(sample.num_parts):
            R_level_part = _part_rotation(sample, points_level, k)
            on_part = sample.part[keep] == k
            if R_level_part is None:
                affordance[on_part & (affordance == AFFORDANCE_YES)] = AFFORDANCE_UNKNOWN
            else:
                R_grasps[on_part] = R_level_part.T @ R_grasps[on_part]
    graspable = np.flatnonzero(affordance == AFFORDANCE_YES)
    matched, residual = anchors.match(R_grasps[graspable])
    axis_level, pivot_level = _joints(sample, points_level)
    gray = np.full((len(keep), 3), _GRAY, dtype=np.uint8)
    normals_level = (
        surface_normals(points_level, keep, -center_level) if has_normals(features) else None
    )
    return Targets(
        category=0,
        points_level=points_level[keep].astype(np.float32),
        colors=point_inputs(gray, normals_level, features),
        part=sample.part[keep],
        npcs=sample.npcs[keep].astype(np.float16),
        naocs=sample.naocs[keep].astype(np.float16),
        affordance=affordance,
        # Every point is its own labelled point.
        grasp_row=np.arange(len(keep), dtype=np.int32),
        joint_type=(sample.joint_type - JOINT_NONE).astype(np.uint8),
        axis_level=axis_level,
        pivot_level=pivot_level,
        match_start=np.searchsorted(graspable, np.arange(len(keep) + 1)).astype(np.int32),
        match_anchor=matched.astype(np.int16),
        match_residual=residual.astype(np.float16),
    )


def _part_rotation(sample: AuthorsSample, points_level: Array, k: int) -> Array | None:
    """``R_level_part`` (3, 3) that fits the points of a part, where there are enough of them."""
    on_part = sample.part == k
    if on_part.sum() < _FEWEST_POINTS:
        return None
    return umeyama(sample.npcs[on_part], points_level[on_part], np.ones(int(on_part.sum())))[1]


def _joints(
    sample: AuthorsSample, points_level: Array
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Axis (K, 3) and pivot (K, 3), metres, of each part's joint; zeros for the base."""
    axes, pivots = (np.zeros((sample.num_parts, 3), dtype=np.float32) for _ in range(2))
    base = sample.part == 0
    if base.sum() < _FEWEST_POINTS:
        raise DamagedFileError(
            f"{sample.image_id}: {int(base.sum())} points are on the base, and its joints cannot "
            f"be placed by fewer than {_FEWEST_POINTS}. Take it off the list."
        )
    scale, R_level_naocs, t = umeyama(
        sample.naocs[base], points_level[base], np.ones(int(base.sum()))
    )
    for k in range(1, sample.num_parts):
        near = sample.joint == k
        if not near.any():
            continue
        axis = R_level_naocs @ sample.joint_axis_naocs[near].astype(float).mean(axis=0)
        axes[k] = axis / max(np.linalg.norm(axis), 1e-9)
        if sample.joint_type[k] == JOINT_REVOLUTE:
            distance = _JOINT_RADIUS * (1.0 - sample.joint_nearness[near, None])
            on_axis = sample.naocs[near] + distance * sample.direction_to_joint_naocs[near]
            pivots[k] = scale * R_level_naocs @ np.median(on_axis, axis=0) + t
    return axes, pivots
