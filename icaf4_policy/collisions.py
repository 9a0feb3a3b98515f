"""Would the open hand, where a grasp wants it, be inside what is seen or inside the table?"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from artgym.geometry.hand import HAND_BOXES, open_hand_boxes

Array = NDArray[np.floating]

_BOX_R, _BOX_CENTER, _BOX_HALF = open_hand_boxes()
#: No point farther than this from the plane of the fingers is inside the hand.
_HALF_X = max(box.half_size[0] for box in HAND_BOXES)


@dataclass(frozen=True, kw_only=True)
class CollisionConfig:
    """When a hand counts as colliding.

    Attributes:
        penetration: how deep a point may lie inside the hand, or the hand in the table, metres.
        points: a hand with at least so many points inside collides; fewer are noise.
    """

    penetration: float = 0.005
    points: int = 4


def hand_is_free(
    points_camera: Array,
    R_camera_grasp: Array,
    point_camera: Array,
    up_camera: Array,
    table_camera: Array | None = None,
    config: CollisionConfig = CollisionConfig(),
) -> bool:
    """Whether the open hand fits at a grasp.

    Args:
        points_camera: float64 (N, 3), what is seen, metres.
        R_camera_grasp: (3, 3).
        point_camera: (3,), the grasp's surface point.
        up_camera: (3,), the table's upward unit normal.
        table_camera: (3,), a point of the table; without it the table is not minded.
        config: when a hand counts as colliding.
    """
    if table_camera is not None:
        up_grasp = up_camera @ R_camera_grasp
        middle = (point_camera - table_camera) @ up_camera + _BOX_CENTER @ up_grasp  # (b,)
        reach = np.abs(_BOX_HALF * (up_grasp @ _BOX_R)).sum(axis=1)
        if (middle - reach).min() < -config.penetration:
            return False
    inside = _points_inside(
        points_camera,
        np.ascontiguousarray(R_camera_grasp),
        point_camera,
        _BOX_R,
        _BOX_CENTER,
        _BOX_HALF - config.penetration,
        config.points,
    )
    return bool(inside < config.points)


@numba.njit(cache=True)
def _points_inside(  # type: ignore[no-untyped-def]
    points, R, origin, box_R, box_center, box_half, enough
):
    """How many points lie inside the boxes; counting stops at ``enough``."""
    count = 0
    for m in range(points.shape[0]):
        dx, dy, dz = points[m, 0] - origin[0], points[m, 1] - origin[1], points[m, 2] - origin[2]
        x = R[0, 0] * dx + R[1, 0] * dy + R[2, 0] * dz
        if abs(x) > _HALF_X:
            continue
        y = R[0, 1] * dx + R[1, 1] * dy + R[2, 1] * dz
        z = R[0, 2] * dx + R[1, 2] * dy + R[2, 2] * dz
        for b in range(box_half.shape[0]):
            ux, uy, uz = x - box_center[b, 0], y - box_center[b, 1], z - box_center[b, 2]
            inside = True
            for j in range(3):
                along = box_R[b, 0, j] * ux + box_R[b, 1, j] * uy + box_R[b, 2, j] * uz
                if abs(along) > box_half[b, j]:
                    inside = False
                    break
            if inside:
                count += 1
                if count >= enough:
                    return count
                break
    return count
