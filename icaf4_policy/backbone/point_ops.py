"""Neighbourhood searches on point clouds, compiled: sampling, ball query, three nearest.

All of them depend on the geometry alone and not on the order of the points, so that a network
built on them is invariant to that order. They run on the CPU, in numpy, and carry no gradient.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numba
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from artgym.errors import InvalidArgumentError

#: Distances as plain float32 arithmetic gives them, without fused products: where two points are
#: all but equally far, their order is then the one that torch finds, on any processor.
_EXACT = {"nnan", "ninf", "nsz"}


@numba.njit(cache=True, fastmath=_EXACT)
def farthest_points(points: NDArray[np.float32], count: int) -> NDArray[np.int64]:
    """Indices (count,) of a farthest-point sample of ``points`` (n, 3).

    The first index is the point farthest from the centroid, so the sample is a function of the
    set. With fewer than ``count`` distinct points, some repeat.
    """
    n = points.shape[0]
    cx, cy, cz = np.float64(0.0), np.float64(0.0), np.float64(0.0)
    for i in range(n):
        cx += points[i, 0]
        cy += points[i, 1]
        cz += points[i, 2]
    x0, y0, z0 = np.float32(cx / n), np.float32(cy / n), np.float32(cz / n)
    # One contiguous array a coordinate: the loop over points then vectorises.
    xs, ys, zs = points[:, 0].copy(), points[:, 1].copy(), points[:, 2].copy()
    nearest = np.empty(n, np.float32)
    # Whole numbers in the same order as the squares, of which the largest is found faster.
    bits = nearest.view(np.int32)
    for i in range(n):
        nearest[i] = (xs[i] - x0) ** 2 + (ys[i] - y0) ** 2 + (zs[i] - z0) ** 2
    chosen = np.empty(count, np.int64)
    current = np.argmax(nearest)
    nearest[:] = np.float32(np.inf)
    for k in range(count):
        chosen[k] = current
        x, y, z = xs[current], ys[current], zs[current]
        for i in range(n):
            d = (xs[i] - x) ** 2 + (ys[i] - y) ** 2 + (zs[i] - z) ** 2
            nearest[i] = min(nearest[i], d)
        most = np.int32(-1)
        for i in range(n):
            most = max(most, bits[i])
        current = 0
        while bits[current] != most:
            current += 1
    return chosen


#: Cells of a grid along an axis at most; their width in terms of what holds the points asked for,
#: and points more than those, so that few are asked for in cells that are not too small.
_MOST_CELLS, _CELL_SHARE, _CELL_POINTS = 32, 0.3, 8
#: Farther than anything, and finite when squared.
_FAR = np.float32(1e18)


@numba.njit(cache=True, fastmath=_EXACT)
def _grid(  # type: ignore[no-untyped-def]
    points, count
):
    """The points in cells, of which those about a place hold ``count`` of them or somewhat more.

    Returns:
        The lowest corner (3,); a cell's width; the cells along each axis (3,); where each cell
        begins in the order of the cells, z fastest, (cells + 1,); and that order of points (n,).
    """
    n = points.shape[0]
    low, extent = np.empty(3, np.float32), np.empty(3, np.float32)
    for axis in range(3):
        least, most = points[0, axis], points[0, axis]
        for i in range(n):
            least, most = min(least, points[i, axis]), max(most, points[i, axis])
        low[axis], extent[axis] = least, most - least
    # As if the points lay on three sides of their box.
    area = extent[0] * extent[1] + extent[1] * extent[2] + extent[2] * extent[0]
    width = np.float32(_CELL_SHARE * np.sqrt(area * (count + _CELL_POINTS) / n))
    width = max(width, max(extent) / np.float32(_MOST_CELLS), np.float32(1e-12))
    cells = np.empty(3, np.int64)
    for axis in range(3):
        cells[axis] = min(_MOST_CELLS, int(extent[axis] / width) + 1)
    cell = np.empty(n, np.int64)
    starts = np.zeros(cells[0] * cells[1] * cells[2] + 1, np.int64)
    for i in range(n):
        c = 0
        for axis in range(3):
            c = c * cells[axis] + _cell_of(points[i, axis], low[axis], width, cells[axis])
        cell[i] = c
        starts[c + 1] += 1
    for c in range(len(starts) - 1):
        starts[c + 1] += starts[c]
    free, order = starts.copy(), np.empty(n, np.int64)
    for i in range(n):
        order[free[cell[i]]] = i
        free[cell[i]] += 1
    return low, width, cells, starts, order


@numba.njit(cache=True, fastmath=_EXACT)
def _cell_of(place, low, width, cells):  # type: ignore[no-untyped-def]
    """The cell along an axis that a coordinate lies in, or the last one on its side."""
    return min(max(int(np.floor((place - low) / width)), 0), cells - 1)


@numba.njit(cache=True, fastmath=_EXACT)
def _nearest(  # type: ignore[no-untyped-def]
    points, centers, radius, count
):
    """The ``count`` points nearest to each center, no farther than ``radius``, nearest first.

    Of equally far ones the first comes first. Cells are searched from the center's own outwards,
    until what is left is too far.

    Returns:
        Indices (m, count), squared distances (m, count), and how many were found (m,).
    """
    low, width, cells, starts, order = _grid(points, count)
    xs, ys, zs = points[order, 0], points[order, 1], points[order, 2]
    # Where a cell ends is known up to rounding.
    slack = np.float32(1e-5) * width * max(cells)
    m = centers.shape[0]
    found = np.zeros((m, count), np.int64)
    squares = np.empty((m, count), np.float32)
    numbers = np.empty(m, np.int64)
    own, first, last = np.empty(3, np.int64), np.empty(3, np.int64), np.empty(3, np.int64)
    for j in range(m):
        x, y, z = centers[j, 0], centers[j, 1], centers[j, 2]
        best, chosen = squares[j], found[j]
        limit = np.float32(radius * radius)
        held = 0
        for axis in range(3):
            own[axis] = _cell_of(centers[j, axis], low[axis], width, cells[axis])
        for ring in range(max(cells)):
            # What is not in cells up to this ring is farther than the nearest of its outer faces.
            gap = _FAR
            for axis in range(3):
                first[axis] = max(own[axis] - ring, 0)
                last[axis] = min(own[axis] + ring, cells[axis] - 1)
                place = centers[j, axis] - low[axis]
                if first[axis] > 0:
                    gap = min(gap, place - first[axis] * width)
                if last[axis] < cells[axis] - 1:
                    gap = min(gap, (last[axis] + 1) * width - place)
            for cx in range(first[0], last[0] + 1):
                for cy in range(first[1], last[1] + 1):
                    row = (cx * cells[1] + cy) * cells[2]
                    inner = abs(cx - own[0]) < ring and abs(cy - own[1]) < ring
                    # Of a row inside the ring its two ends, else all of it.
                    for end in range(2 if inner else 1):
                        start, stop = starts[row + first[2]], starts[row + last[2] + 1]
                        if inner:
                            cz = own[2] + (ring if end else -ring)
                            if not 0 <= cz < cells[2]:
                                continue
                            start, stop = starts[row + cz], starts[row + cz + 1]
                        for i in range(start, stop):
                            d = (xs[i] - x) ** 2 + (ys[i] - y) ** 2 + (zs[i] - z) ** 2
                            index = order[i]
                            if d > limit or (
                                d == limit and held == count and index > chosen[count - 1]
                            ):
                                continue
                            # Insertion into the short sorted list of the nearest so far.
                            slot = held if held < count else count - 1
                            while slot > 0 and (
                                best[slot - 1] > d
                                or (best[slot - 1] == d and chosen[slot - 1] > index)
                            ):
                                best[slot], chosen[slot] = best[slot - 1], chosen[slot - 1]
                                slot -= 1
                            best[slot], chosen[slot] = d, index
                            held = min(held + 1, count)
                            if held == count:
                                limit = min(limit, best[count - 1])
            gap -= slack
            if gap > 0 and gap * gap > limit:
                break
        numbers[j] = held
    return found, squares, numbers


@numba.njit(cache=True, fastmath=_EXACT)
def ball_query(
    points: NDArray[np.float32], centers: NDArray[np.float32], radius: float, count: int
) -> NDArray[np.int64]:
    """Indices (m, count) of the points (n, 3) nearest to each center (m, 3) within ``radius``.

    Nearest first; where fewer lie in the ball, the nearest repeats. A ball without any point
    gives the nearest point of all.
    """
    found, _, numbers = _nearest(points, centers, radius, count)
    for j in range(len(centers)):
        if numbers[j] == 0:
            found[j, 0] = np.argmin(((points - centers[j]) ** 2).sum(axis=1))
        for slot in range(max(numbers[j], 1), count):
            found[j, slot] = found[j, 0]
    return found


@numba.njit(cache=True, fastmath=_EXACT)
def three_nearest(
    points: NDArray[np.float32], centers: NDArray[np.float32]
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """The three centers (m, 3), m >= 3, nearest to each point (n, 3), and their weights.

    Returns:
        Indices (n, 3) and inverse-squared-distance weights (n, 3) that sum to one.
    """
    found, squares, _ = _nearest(centers, points, _FAR, 3)
    weights = np.empty((len(points), 3), np.float32)
    for i in range(len(points)):
        w0 = 1.0 / (squares[i, 0] + 1e-8)
        w1 = 1.0 / (squares[i, 1] + 1e-8)
        w2 = 1.0 / (squares[i, 2] + 1e-8)
        total = w0 + w1 + w2
        weights[i, 0], weights[i, 1], weights[i, 2] = w0 / total, w1 / total, w2 / total
    return found, weights


@dataclass(frozen=True, kw_only=True)
class Neighborhoods:
    """Who is near whom in a batch of B clouds of N points, at two levels of n1 > n2 centers.

    Indices count through the whole batch: point i of cloud b is ``b * N + i``.

    Attributes:
        centers1: int64 (B, n1) into the points; neighbors1: (B, n1, s1) into the points.
        centers2: int64 (B, n2) into the level-1 centers; neighbors2: (B, n2, s2), likewise.
        up1: int64 (B, P, 3) into the level-1 centers, and weights_up1 float32 (B, P, 3), of the
            first P points of each cloud.
        up2: int64 (B, n1, 3) into the level-2 centers, and weights_up2 float32 (B, n1, 3).
    """

    centers1: Tensor
    neighbors1: Tensor
    centers2: Tensor
    neighbors2: Tensor
    up1: Tensor
    weights_up1: Tensor
    up2: Tensor
    weights_up2: Tensor


def neighborhoods(
    points: Tensor,
    *,
    counts: tuple[int, int],
    radii: tuple[float, float],
    neighbors: int,
    asked: int | None = None,
) -> Neighborhoods:
    """Samples two levels of centers and finds every neighbour the backbone needs.

    The search runs on the CPU; its result lies where the points do.

    Args:
        points: float32 (B, N, 3), network units.
        counts: centers at each level, n1 > n2 >= 3.
        radii: radius of the balls at each level, network units.
        neighbors: neighbours of each center.
        asked: P; all points by default.
    """
    if points.ndim != 3 or points.shape[-1] != 3 or points.shape[1] < counts[0]:
        raise InvalidArgumentError(
            f"points must have shape (B, N >= {counts[0]}, 3), got {tuple(points.shape)}."
        )
    n1, n2 = counts
    num_points = points.shape[1]
    found: dict[str, list[NDArray[np.generic]]] = {f.name: [] for f in fields(Neighborhoods)}
    for b, cloud in enumerate(points.detach().cpu().numpy()):
        centers1 = farthest_points(cloud, n1)
        cloud1 = cloud[centers1]
        centers2 = farthest_points(cloud1, n2)
        cloud2 = cloud1[centers2]
        up1, weights_up1 = three_nearest(cloud[:asked], cloud1)
        up2, weights_up2 = three_nearest(cloud1, cloud2)
        neighbors1 = ball_query(cloud, cloud1, radii[0], neighbors)
        neighbors2 = ball_query(cloud1, cloud2, radii[1], neighbors)
        found["centers1"].append(centers1 + b * num_points)
        found["neighbors1"].append(neighbors1 + b * num_points)
        found["centers2"].append(centers2 + b * n1)
        found["neighbors2"].append(neighbors2 + b * n1)
        found["up1"].append(up1 + b * n1)
        found["weights_up1"].append(weights_up1)
        found["up2"].append(up2 + b * n2)
        found["weights_up2"].append(weights_up2)
    return Neighborhoods(
        **{name: torch.from_numpy(np.stack(v)).to(points.device) for name, v in found.items()}
    )
