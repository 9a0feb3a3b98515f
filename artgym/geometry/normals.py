"""Normals of a surface of which only points are known, and what lies around each of them."""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.geometry.nearest import FAR, nearest_within

Array = NDArray[np.floating]

#: What a normal is worked out from: of a longer cloud so many points, of these the nearest around
#: each, no farther than this, in sizes of the cloud.
_NORMAL_SUPPORT, _NORMAL_NEIGHBORS, _NORMAL_RADIUS = 4096, 16, 0.05


class Surroundings(NamedTuple):
    """Points of a cloud and their neighbours.

    Attributes:
        support: (n, 3), points of the cloud, evenly in their order.
        index: (n, k) into ``support``, in no order; 0 where there are fewer.
        distance: (n, k) to them, infinite there.
        center: (3,), a place amid them.
        size: of the cloud, in its unit.
    """

    support: Array
    index: NDArray[np.integer]
    distance: Array
    center: Array
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
        center = support.mean(axis=0)
        # Half of the size, which a few stray points cannot move.
        reach = np.quantile(np.linalg.norm(support - center, axis=1), 0.99)
        size = max(2.0 * float(reach), 1e-12)
        around = (support - center).astype(np.float32)
        index, squares, _ = nearest_within(around, around, radius * size, count)
        return cls(support, index, np.sqrt(squares), center, size)

    @property
    def found(self) -> NDArray[np.bool_]:
        """(n, k): where there is a neighbour."""
        return np.isfinite(self.distance)

    def nearest_first(self) -> Surroundings:
        """The same, the neighbours of each point in order."""
        order = np.argsort(self.distance, axis=1, kind="stable")
        return self._replace(
            index=np.take_along_axis(self.index, order, axis=1),
            distance=np.take_along_axis(self.distance, order, axis=1),
        )

    def nearest(self, points: Array) -> NDArray[np.integer]:
        """Which of ``support`` (m,) is nearest to each of the points (m, 3)."""
        support, points = ((p - self.center).astype(np.float32) for p in (self.support, points))
        return nearest_within(support, points, FAR, 1)[0][:, 0]


def plane_normals(
    points: Array, index: NDArray[np.integer], found: NDArray[np.bool_], viewpoint: ArrayLike
) -> Array:
    """Unit normals (n, 3) of planes through the neighbours (n, k) that were found of each point.

    They point to the side of the surface that the viewpoint (3,) is on.
    """
    normals: Array = _plane_normals(points, index, found)
    towards = np.sum(normals * (np.asarray(viewpoint, dtype=float) - points), axis=1)
    return np.where(towards[:, None] < 0, -normals, normals)


@numba.njit(cache=True)
def _plane_normals(points, index, found):  # type: ignore[no-untyped-def]
    """Of ``plane_normals``, on either side."""
    n, k = index.shape
    normals = np.empty((n, 3))
    for i in range(n):
        # Relative to the point itself, so that little is lost by taking the mean off the squares.
        x, y, z = points[i]
        count, sx, sy, sz = 0, 0.0, 0.0, 0.0
        xx, xy, xz, yy, yz, zz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for slot in range(k):
            if found[i, slot]:
                j = index[i, slot]
                dx, dy, dz = points[j, 0] - x, points[j, 1] - y, points[j, 2] - z
                count += 1
                sx, sy, sz = sx + dx, sy + dy, sz + dz
                xx, xy, xz = xx + dx * dx, xy + dx * dy, xz + dx * dz
                yy, yz, zz = yy + dy * dy, yz + dy * dz, zz + dz * dz
        count = max(count, 1)
        mx, my, mz = sx / count, sy / count, sz / count
        normals[i] = _least_direction(
            xx - mx * sx, xy - mx * sy, xz - mx * sz, yy - my * sy, yz - my * sz, zz - mz * sz
        )
    return normals


@numba.njit(cache=True)
def _least_direction(xx, xy, xz, yy, yz, zz):  # type: ignore[no-untyped-def]
    """Unit eigenvector of a symmetric matrix with no negative eigenvalue, that of the least one.

    The eigenvalue in closed form (the roots of a cubic by cosines); the vector is across what the
    matrix less that eigenvalue spans.
    """
    mean = (xx + yy + zz) / 3.0
    a, b, c = xx - mean, yy - mean, zz - mean
    spread = np.sqrt((a * a + b * b + c * c + 2.0 * (xy * xy + xz * xz + yz * yz)) / 6.0)
    if not spread > 1e-14 * mean:  # alike in all directions, or a single point
        return 1.0, 0.0, 0.0
    determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * xz) + xz * (xy * yz - b * xz)
    turn = np.arccos(min(max(determinant / (2.0 * spread**3), -1.0), 1.0)) / 3.0
    least = 2.0 * spread * np.cos(turn + 2.0 * np.pi / 3.0)  # less the mean
    rows = ((a - least, xy, xz), (xy, b - least, yz), (xz, yz, c - least))
    best, x, y, z = 0.0, 0.0, 0.0, 0.0
    for i, j in ((0, 1), (0, 2), (1, 2)):
        u, v = rows[i], rows[j]
        cx, cy, cz = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
        square = cx * cx + cy * cy + cz * cz
        if square > best:
            best, x, y, z = square, cx, cy, cz
    if not best > (1e-12 * spread * spread) ** 2:
        # On a line: any direction across it.
        longest = rows[0]
        for row in rows[1:]:
            if _square(row) > _square(longest):
                longest = row
        u, v, w = longest
        if abs(u) <= min(abs(v), abs(w)):
            x, y, z = 0.0, w, -v
        elif abs(v) <= abs(w):
            x, y, z = -w, 0.0, u
        else:
            x, y, z = v, -u, 0.0
        best = x * x + y * y + z * z
    length = np.sqrt(best)
    return x / length, y / length, z / length


@numba.njit(cache=True)
def _square(v):  # type: ignore[no-untyped-def]
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]


def surface_normals(points: Array, at: NDArray[np.integer], viewpoint: ArrayLike) -> Array:
    """Unit normals (n, 3) of a cloud's surface at some of its points.

    Args:
        points: (M, 3) of one object, M >= 1, any unit.
        at: (n,), which of them.
        viewpoint: (3,), the camera: normals point to its side.
    """
    near = Surroundings.of(points, _NORMAL_SUPPORT, _NORMAL_NEIGHBORS, _NORMAL_RADIUS)
    normals = plane_normals(near.support, near.index, near.found, viewpoint)
    return normals[at if len(points) <= _NORMAL_SUPPORT else near.nearest(points[at])]
