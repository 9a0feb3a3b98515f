"""How points are put before the network: level, centred, a fixed number."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.floating]


def level_points(points_camera: ArrayLike, R_level_camera: ArrayLike) -> tuple[Array, Array]:
    """Points (M, 3) turned into the level frame and centred, and the centre (3,) taken off.

    The centre is that of the box between the 1st and 99th percentile of each coordinate, which a
    few stray points cannot move.
    """
    points_level = (
        np.asarray(points_camera, dtype=float) @ np.asarray(R_level_camera, dtype=float).T
    )
    # Quantiles of what is in order already take half the time.
    in_order = np.sort(np.ascontiguousarray(points_level.T), axis=1)
    center_level = np.quantile(in_order, [0.01, 0.99], axis=1).mean(axis=0)
    return points_level - center_level, center_level


def choose_points(available: int, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Indices (count,) into ``available`` points, without repetition as far as they reach."""
    if available >= count:
        return rng.choice(available, count, replace=False)
    extra = rng.choice(available, count - available, replace=True)
    return np.concatenate([np.arange(available), extra])
