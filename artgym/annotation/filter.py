"""Rejects grasps that geometry alone rules out, before any physics.

A grasp is rejected when the open hand would be inside the object or the table at the grasp pose,
or when nothing of the part lies between its fingers. Margins make both tests lenient: what is
doubtful is left to physics.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from artgym.geometry import transforms
from artgym.geometry.grasps import GRASP_DEPTH
from artgym.geometry.hand import FINGER_TRAVEL, HAND_BOXES, open_hand_boxes
from artgym.objects.model import ArticulatedObject
from artgym.objects.surface import grid_points

Array = NDArray[np.floating]


class Verdict(enum.IntEnum):
    """What geometry says of a grasp."""

    POSSIBLE = 0
    NOTHING_BETWEEN = 1
    COLLISION = 2


@dataclass(frozen=True, kw_only=True)
class FilterConfig:
    """How lenient the filter is; metres.

    Attributes:
        spacing: between the surface points that stand for the object.
        penetration: how deep a point may lie inside the hand.
        reach: how far outside the pads' sweep a point still counts as between the fingers.
    """

    spacing: float = 0.007
    penetration: float = 0.005
    reach: float = 0.004


_BOX_R, _BOX_CENTER, _BOX_HALF = open_hand_boxes()
#: No point farther than this from the grasp can be inside the hand.
_HAND_RADIUS = float(
    max(np.linalg.norm(c) + np.linalg.norm(h) for c, h in zip(_BOX_CENTER, _BOX_HALF, strict=True))
)
#: Nor any farther from the plane of the fingers than this.
_HAND_HALF_X = max(box.half_size[0] for box in HAND_BOXES)
_PAD = HAND_BOXES[4]
#: The pads' sweep in the grasp's frame: |x|, |y| and the interval of z.
_SWEEP_X, _SWEEP_Y = _PAD.half_size[0], FINGER_TRAVEL
_SWEEP_Z = (GRASP_DEPTH - 2 * _PAD.half_size[2], GRASP_DEPTH)


def judge(
    obj: ArticulatedObject,
    q: Array,
    part: int,
    points_object: Array,
    R_object_grasps: Array,
    config: FilterConfig = FilterConfig(),
) -> NDArray[np.int8]:
    """Verdicts (n, c) on c rotations (n, c, 3, 3) at n points (n, 3), object frame, at q."""
    clouds = [
        transforms.apply(T, grid_points(link, config.spacing))
        for T, link in zip(obj.link_poses(q), obj.links, strict=True)
    ]
    cloud = np.concatenate(clouds)
    on_part = np.concatenate([np.full(len(c), i == part) for i, c in enumerate(clouds)])
    # Most of a large object is out of the hand's reach.
    reached = np.all(
        (cloud > points_object.min(axis=0) - _HAND_RADIUS)
        & (cloud < points_object.max(axis=0) + _HAND_RADIUS),
        axis=1,
    )
    cloud, on_part = cloud[reached], on_part[reached]
    verdicts = np.empty(R_object_grasps.shape[:2], dtype=np.int8)
    for i, point in enumerate(points_object):
        offset = cloud - point
        squared = np.einsum("ij,ij->i", offset, offset)
        near = np.flatnonzero(squared < _HAND_RADIUS**2)
        # Nearest first: most collisions show at once.
        near = near[np.argsort(squared[near], kind="stable")]
        _judge_point(
            np.ascontiguousarray(offset[near]),
            on_part[near],
            float(point[2]),
            np.ascontiguousarray(R_object_grasps[i]),
            config.penetration,
            config.reach,
            _BOX_R,
            _BOX_CENTER,
            _BOX_HALF,
            verdicts[i],
        )
    return verdicts


@numba.njit(cache=True)
def _judge_point(  # type: ignore[no-untyped-def]
    offsets, on_part, height, rotations, penetration, reach, box_R, box_center, box_half, out
):
    """One point's candidates; ``offsets`` (m, 3) are the cloud relative to the point."""
    boxes = box_half.shape[0]
    for g in range(rotations.shape[0]):
        R = rotations[g]
        between = False
        collides = False
        for b in range(boxes):
            # The lowest corner of the box against the table at z = 0.
            low = height
            for k in range(3):
                low += R[2, k] * box_center[b, k]
            for j in range(3):
                slope = 0.0
                for k in range(3):
                    slope += R[2, k] * box_R[b, k, j]
                low -= abs(slope) * box_half[b, j]
            if low < -penetration:
                collides = True
                break
        if not collides:
            for m in range(offsets.shape[0]):
                dx, dy, dz = offsets[m, 0], offsets[m, 1], offsets[m, 2]
                x = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
                y = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
                z = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
                if z > GRASP_DEPTH:
                    continue
                if (
                    on_part[m]
                    and abs(x) < _SWEEP_X + reach
                    and abs(y) < _SWEEP_Y
                    and z > _SWEEP_Z[0] - reach
                ):
                    between = True
                if abs(x) > _HAND_HALF_X:
                    continue
                for b in range(boxes):
                    ux, uy, uz = x - box_center[b, 0], y - box_center[b, 1], z - box_center[b, 2]
                    inside = True
                    for j in range(3):
                        along = box_R[b, 0, j] * ux + box_R[b, 1, j] * uy + box_R[b, 2, j] * uz
                        if abs(along) > box_half[b, j] - penetration:
                            inside = False
                            break
                    if inside:
                        collides = True
                        break
                if collides:
                    break
        if collides:
            out[g] = 2
        elif not between:
            out[g] = 1
        else:
            out[g] = 0
