"""A handful of many grasps that shows how far they reach."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from artgym.geometry.rotations import grasp_angle

Array = NDArray[np.floating]

#: A turn by so much counts as much as a metre, radians.
_RADIANS_A_METRE = 10.0


def spread_grasps(Ts_a_grasp: Array, count: int) -> NDArray[np.intp]:
    """Indices of up to ``count`` grasps (n, 4, 4), each as unlike those before it as can be.

    The first is the first given. Unlike is what lies far off, or is turned: 10 degrees count as
    much as 17 mm.
    """
    chosen: list[int] = []
    distance = np.full(len(Ts_a_grasp), np.inf)
    while len(chosen) < min(count, len(Ts_a_grasp)):
        new = int(np.argmax(distance)) if chosen else 0
        chosen.append(new)
        apart = np.linalg.norm(Ts_a_grasp[:, :3, 3] - Ts_a_grasp[new, :3, 3], axis=-1)
        turned = grasp_angle(Ts_a_grasp[:, :3, :3], Ts_a_grasp[new, :3, :3])
        distance = np.minimum(distance, apart + turned / _RADIANS_A_METRE)
        distance[new] = -1.0
    return np.array(chosen, dtype=np.intp)
