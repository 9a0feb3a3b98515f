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
from artgym.geometry.nearest import EXACT, FAR, nearest_within


@numba.njit(cache=True, fastmath=EXACT)
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


@numba.njit(cache=True, fastmath=EXACT)
def ball_query(
    points: NDArray[np.float32], centers: NDArray[np.float32], radius: float, count: int
) -> NDArray[np.int64]:
    """Indices (m, count) of the points (n, 3) nearest to each center (m, 3) within ``radius``.

    The nearest comes first, the others in no order; where fewer lie in the ball, the nearest
    repeats. A ball without any point gives the nearest point of all.
    """
    found, squares, numbers = nearest_within(points, centers, radius, count)
    for j in range(len(centers)):
        if numbers[j] == 0:
            found[j, 0] = np.argmin(((points - centers[j]) ** 2).sum(axis=1))
        first = np.argmin(squares[j])
        found[j, 0], found[j, first] = found[j, first], found[j, 0]
        for slot in range(max(numbers[j], 1), count):
            found[j, slot] = found[j, 0]
    return found


@numba.njit(cache=True, fastmath=EXACT)
def three_nearest(
    points: NDArray[np.float32], centers: NDArray[np.float32]
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """The three centers (m, 3), m >= 3, nearest to each point (n, 3), and their weights.

    Returns:
        Indices (n, 3), nearest first, and inverse-squared-distance weights (n, 3) that sum to one.
    """
    found, squares, _ = nearest_within(centers, points, FAR, 3)
    weights = np.empty((len(points), 3), np.float32)
    for i in range(len(points)):
        for a, b in ((0, 1), (1, 2), (0, 1)):
            if squares[i, b] < squares[i, a] or (
                squares[i, b] == squares[i, a] and found[i, b] < found[i, a]
            ):
                squares[i, a], squares[i, b] = squares[i, b], squares[i, a]
                found[i, a], found[i, b] = found[i, b], found[i, a]
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
