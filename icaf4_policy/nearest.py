"""The points of a cloud that are nearest to others, compiled.

Points are sorted into a grid of cells; around a place those of the nearest cells are looked at, and
of their distances the largest that still counts is found by halving, which takes a few passes of
plain comparisons: far less than keeping the nearest in order.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

#: Distances as plain float32 arithmetic gives them, without fused products: where two points are
#: all but equally far, their order is then the one that torch finds, on any processor.
EXACT = {"nnan", "ninf", "nsz"}
#: Farther than anything, and finite when squared.
FAR = 1e18

#: Cells of a grid along an axis at most; their width in terms of what holds the points asked for.
_MOST_CELLS, _CELL_SHARE = 32, 0.4
#: Loops over distances run over whole vectors of so many.
_LANES = 32
#: The limit is first guessed, as if squared distances were evenly spread, then halved.
_GUESSES = 6


@numba.njit(cache=True, fastmath=EXACT)
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
    width = np.float32(_CELL_SHARE * np.sqrt(area * count / n))
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


@numba.njit(cache=True, fastmath=EXACT)
def _cell_of(place, low, width, cells):  # type: ignore[no-untyped-def]
    """The cell along an axis that a coordinate lies in, or the last one on its side."""
    return min(max(int(np.floor((place - low) / width)), 0), cells - 1)


@numba.njit(cache=True)
def _count_up_to(bits, total, limit):  # type: ignore[no-untyped-def]
    """How many of the first ``total`` are no larger than ``limit``."""
    count = np.int32(0)
    for i in range(total):
        count += np.int32(bits[i] <= limit)
    return count


@numba.njit(cache=True)
def nearest_within(
    points: NDArray[np.float32], centers: NDArray[np.float32], radius: float, count: int
) -> tuple[NDArray[np.int64], NDArray[np.float32], NDArray[np.int64]]:
    """The ``count`` points nearest to each center, no farther than ``radius``, in no order.

    Of equally far ones the first of the cloud are taken.

    Args:
        points: (n, 3), n >= 1.
        centers: (m, 3), the same unit.
        radius: up to ``FAR``.
        count: k >= 1.

    Returns:
        Indices (m, k), 0 where there are fewer; squared distances (m, k), infinite there; and how
        many were found (m,).
    """
    low, width, cells, starts, order = _grid(points, count)
    xs, ys, zs = points[order, 0], points[order, 1], points[order, 2]
    # Where a cell ends is known up to rounding.
    slack = np.float32(1e-5) * width * max(cells)
    n, m = len(points), len(centers)
    found = np.zeros((m, count), np.int64)
    squares = np.full((m, count), np.float32(np.inf))
    numbers = np.empty(m, np.int64)
    own, first, last = np.empty(3, np.int64), np.empty(3, np.int64), np.empty(3, np.int64)
    # Squared distances of the points looked at, also as whole numbers, which are in the same order.
    apart = np.empty(n + _LANES, np.float32)
    bits = apart.view(np.int32)
    place = np.empty(n, np.int64)  # theirs in the order of the cells
    chosen = np.empty(count + 1, np.int64)
    value = np.empty(1, np.float32)
    value_bits = value.view(np.int32)
    farthest = np.float32(radius)
    reach = farthest * farthest
    for j in range(m):
        x, y, z = centers[j, 0], centers[j, 1], centers[j, 2]
        for axis in range(3):
            own[axis] = _cell_of(centers[j, axis], low[axis], width, cells[axis])
        ring = 0
        while True:
            ring += 1
            # What is not in cells up to this ring is farther than the nearest of its outer faces.
            gap = np.float32(FAR)
            for axis in range(3):
                first[axis] = max(own[axis] - ring, 0)
                last[axis] = min(own[axis] + ring, cells[axis] - 1)
                offset = centers[j, axis] - low[axis]
                if first[axis] > 0:
                    gap = min(gap, offset - first[axis] * width)
                if last[axis] < cells[axis] - 1:
                    gap = min(gap, (last[axis] + 1) * width - offset)
            total = 0
            for cx in range(first[0], last[0] + 1):
                for cy in range(first[1], last[1] + 1):
                    row = (cx * cells[1] + cy) * cells[2]
                    start, stop = starts[row + first[2]], starts[row + last[2] + 1]
                    for i in range(stop - start):
                        s = start + i
                        d = (xs[s] - x) ** 2 + (ys[s] - y) ** 2 + (zs[s] - z) ** 2
                        apart[total + i] = d
                    for i in range(stop - start):
                        place[total + i] = start + i
                    total += stop - start
            padded = (total + _LANES - 1) // _LANES * _LANES
            for i in range(total, padded):
                apart[i] = np.float32(np.inf)
            gap = max(gap - slack, np.float32(0.0))
            is_whole = gap >= farthest
            value[0] = reach if is_whole else gap * gap
            high = value_bits[0]
            inside = _count_up_to(bits, padded, high)
            if is_whole or inside >= count:
                break
        # Up to ``high`` there are ``inside`` points; up to ``low_bits`` fewer, ``below``.
        low_bits, below = np.int32(-1), np.int32(0)
        low_value, high_value = np.float32(0.0), value[0]
        tries = 0
        while inside > count and high - low_bits > 1:
            if tries < _GUESSES:
                share = np.float32(count + 0.5 - below) / np.float32(inside - below)
                value[0] = low_value + (high_value - low_value) * share
                middle = min(max(value_bits[0], low_bits + 1), high - 1)
            else:
                middle = low_bits + (high - low_bits) // 2
            tries += 1
            middle = np.int32(middle)
            value_bits[0] = middle
            here = _count_up_to(bits, padded, middle)
            if here >= count:
                high, inside, high_value = middle, here, value[0]
            else:
                low_bits, below, low_value = middle, here, value[0]
        held = 0
        if inside <= count:
            for i in range(total):
                chosen[held] = i
                held += bits[i] <= high
        else:
            for i in range(total):
                if bits[i] < high:
                    chosen[held] = i
                    held += 1
            # More are equally far than there is room for.
            before = -1
            while held < count:
                next_one, at = n, 0
                for i in range(total):
                    index = order[place[i]]
                    if bits[i] == high and before < index < next_one:
                        next_one, at = index, i
                before = next_one
                chosen[held] = at
                held += 1
        for slot in range(held):
            found[j, slot] = order[place[chosen[slot]]]
            squares[j, slot] = apart[chosen[slot]]
        numbers[j] = held
    return found, squares, numbers
