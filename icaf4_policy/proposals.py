"""How grasps are ranked and thinned out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from artgym.geometry.rotations import grasp_angle
from icaf4_policy.collisions import CollisionConfig

Array = NDArray[np.floating]


@dataclass(frozen=True, kw_only=True)
class ProposalConfig:
    """How grasps are ranked and thinned out.

    Attributes:
        points: of the cloud, this many of highest affordance are asked for grasps.
        count: J, the most proposals to return.
        distance: metres, and
        angle: radians; a proposal nearer than both to a better one is dropped.
        collisions: when the open hand would be inside what is seen, the proposal is dropped; None
            keeps it.
    """

    points: int = 384
    count: int = 64
    distance: float = 0.02
    angle: float = float(np.radians(25.0))
    collisions: CollisionConfig | None = field(default_factory=CollisionConfig)


def diverse(
    points: Array,
    R_grasps: Array,
    config: ProposalConfig,
    fits: Callable[[int], bool] = lambda _: True,
) -> NDArray[np.int64]:
    """Indices of grasps, best first, none near a better one (non-maximum suppression).

    Args:
        points: (n, 3), metres, best first.
        R_grasps: (n, 3, 3).
        config: how near is near, and how many to keep.
        fits: whether the grasp of an index may be kept at all.
    """
    alive = np.ones(len(points), dtype=bool)
    chosen = []
    while alive.any() and len(chosen) < config.count:
        best = int(np.argmax(alive))
        alive[best] = False
        if not fits(best):
            continue
        chosen.append(best)
        near = np.flatnonzero(alive)
        near = near[((points[near] - points[best]) ** 2).sum(axis=-1) < config.distance**2]
        alive[near[grasp_angle(R_grasps[best], R_grasps[near]) < config.angle]] = False
    return np.array(chosen, dtype=np.int64)
