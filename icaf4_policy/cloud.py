"""How an object's points are put before the network: level, centred, a fixed number."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]

Array = NDArray[np.floating]

#: What a normal is worked out from: of a longer cloud so many points, of these the nearest around
#: each, no farther than this, in sizes of the cloud.
_NORMAL_SUPPORT, _NORMAL_NEIGHBORS, _NORMAL_RADIUS = 4096, 16, 0.05


def level_points(points_camera: ArrayLike, R_level_camera: ArrayLike) -> tuple[Array, Array]:
    """Points (M, 3) turned into the level frame and centred, and the centre (3,) taken off.

    The centre is that of the box between the 1st and 99th percentile of each coordinate, which a
    few stray points cannot move.
    """
    points_level = (
        np.asarray(points_camera, dtype=float) @ np.asarray(R_level_camera, dtype=float).T
    )
    center_level = np.quantile(points_level, [0.01, 0.99], axis=0).mean(axis=0)
    return points_level - center_level, center_level


def choose_points(available: int, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Indices (count,) into ``available`` points, without repetition as far as they reach."""
    if available >= count:
        return rng.choice(available, count, replace=False)
    extra = rng.choice(available, count - available, replace=True)
    return np.concatenate([np.arange(available), extra])


class Surroundings(NamedTuple):
    """Points of a cloud and their neighbours.

    Attributes:
        support: (n, 3), points of the cloud, evenly in their order.
        index: (n, k) into ``support``, nearest first; n where there are fewer.
        distance: (n, k) to them, infinite there.
        size: of the cloud, in its unit.
    """

    support: Array
    index: NDArray[np.integer]
    distance: Array
    size: float

    @classmethod
    def of(cls, points: Array, most: int, count: int, radius: float) -> Surroundings:
        """The ``count`` nearest of at most ``most`` points around each of these.

        Args:
            points: (M, 3), M >= 1.
            most: of a longer cloud, this many points are taken.
            count: k.
            radius: beyond it no point is a neighbour, in sizes of the cloud.
        """
        total = len(points)
        keep = np.linspace(0, total - 1, min(total, most)).round().astype(int)
        support = points[keep]
        # Half of the size, which a few stray points cannot move.
        reach = np.quantile(np.linalg.norm(support - support.mean(axis=0), axis=1), 0.99)
        size = max(2.0 * float(reach), 1e-12)
        distance, index = cKDTree(support).query(
            support, k=np.arange(1, count + 1), distance_upper_bound=radius * size
        )
        return cls(support, index, distance, size)

    @property
    def found(self) -> NDArray[np.bool_]:
        """(n, k): where there is a neighbour."""
        return np.isfinite(self.distance)

    def nearest(self, points: Array) -> NDArray[np.integer]:
        """Which of ``support`` (m,) is nearest to each of the points (m, 3)."""
        found: NDArray[np.integer] = cKDTree(self.support).query(points)[1]
        return found


def plane_normals(
    points: Array, index: NDArray[np.integer], found: NDArray[np.bool_], viewpoint: ArrayLike
) -> Array:
    """Unit normals (n, 3) of planes through the neighbours (n, k) that were found of each point.

    They point to the side of the surface that the viewpoint (3,) is on.
    """
    around = points[np.where(found, index, 0)]  # (n, k, 3)
    weight = found[..., None].astype(float)
    mean = (weight * around).sum(axis=1, keepdims=True) / weight.sum(axis=1, keepdims=True)
    offset = weight * (around - mean)
    _, axes = np.linalg.eigh(np.swapaxes(offset, 1, 2) @ offset)
    normals: Array = axes[..., 0]
    towards = np.sum(normals * (np.asarray(viewpoint, dtype=float) - points), axis=1)
    return np.where(towards[:, None] < 0, -normals, normals)


def surface_normals(points: Array, at: NDArray[np.integer], viewpoint: ArrayLike) -> Array:
    """Unit normals (n, 3) of a cloud's surface at some of its points.

    Args:
        points: (M, 3) of one object, M >= 1, any unit.
        at: (n,), which of them.
        viewpoint: (3,), the camera: normals point to its side.
    """
    near = Surroundings.of(points, _NORMAL_SUPPORT, _NORMAL_NEIGHBORS, _NORMAL_RADIUS)
    normals = plane_normals(near.support, near.index, near.found, viewpoint)
    return normals[near.nearest(points[at])]
