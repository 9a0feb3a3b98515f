"""The points of a cloud that are nearest to others, compiled.

Points are sorted into a grid of cells. Those of the cells about a place are laid side by side,
once for all who ask from there, and of their distances the largest that still counts is found by
halving: a few passes over whole vectors, which take far less than keeping the nearest in order.
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
#: Loops over distances run over whole vectors of so many; what fills the last is beyond ``FAR``.
_LANES, _FILLER = 32, np.float32(1e19)
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
    starts, order, _ = _sorted_into(points, low, width, cells)
    return low, width, cells, starts, order


@numba.njit(cache=True, fastmath=EXACT)
def _cell_of(place, low, width, cells):  # type: ignore[no-untyped-def]
    """The cell along an axis that a coordinate lies in, or the last one on its side."""
    return min(max(int(np.floor((place - low) / width)), 0), cells - 1)


@numba.njit(cache=True, fastmath=EXACT)
def _sorted_into(points, low, width, cells):  # type: ignore[no-untyped-def]
    """Where each cell begins in the order of the cells (cells + 1,), that order, and the cells."""
    n = len(points)
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
    return starts, order, cell


@numba.njit(cache=True)
def _count_up_to(bits, total, limit):  # type: ignore[no-untyped-def]
    """How many of the first ``total`` are no larger than ``limit``."""
    count = np.int32(0)
    for i in range(total):
        count += np.int32(bits[i] <= limit)
    return count


@numba.njit(cache=True)
def _halved(bits, total, high, inside, count, value):  # type: ignore[no-untyped-def]
    """The limit up to which there are ``count``, or the least up to which there are more.

    Args:
        bits: the numbers, read as whole ones; those in ``total`` count.
        total: of them.
        high: a limit up to which there are more than ``count``: ``inside``.
        inside: see there.
        count: how many are asked for.
        value: (1,), float32, to read a whole number as what it stands for.

    Returns:
        The limit, and how many there are up to it.
    """
    value_bits = value.view(np.int32)
    value_bits[0] = high
    # Up to ``low`` there are ``below``, fewer than asked for.
    low, below, low_value, high_value = np.int32(-1), np.int32(0), np.float32(0.0), value[0]
    tries = 0
    while inside != count and high - low > 1:
        if tries < _GUESSES:
            share = np.float32(count + 0.5 - below) / np.float32(inside - below)
            value[0] = low_value + (high_value - low_value) * share
            middle = np.int32(min(max(value_bits[0], low + 1), high - 1))
        else:
            middle = np.int32(low + (high - low) // 2)
        tries += 1
        value_bits[0] = middle
        here = _count_up_to(bits, total, middle)
        if here >= count:
            high, inside, high_value = middle, here, value[0]
        else:
            low, below, low_value = middle, here, value[0]
    return high, inside


@numba.njit(cache=True)
def _first_chosen(bits, total, high, place, order, count, chosen):  # type: ignore[no-untyped-def]
    """Chooses all below ``high``, and of those at it as many as there is room for, in order."""
    held = 0
    for i in range(total):
        if bits[i] < high:
            chosen[held] = i
            held += 1
    before = -1
    while held < count:
        index, at = len(order), 0
        for i in range(total):
            if bits[i] == high and before < order[place[i]] < index:
                index, at = order[place[i]], i
        before = index
        chosen[held] = at
        held += 1
    return held


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
    # The points looked at, and their places in the order of the cells.
    block = np.empty((3, n + _LANES), np.float32)
    bx, by, bz = block
    place = np.empty(n, np.int64)
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    total, padded, block_cell, block_ring = 0, 0, -1, 0
    # Their squared distances, also as whole numbers, which are in the same order.
    apart = np.empty(n + _LANES, np.float32)
    bits = apart.view(np.int32)
    value = np.empty(1, np.float32)
    chosen = np.empty(count + 1, np.int64)
    farthest = np.float32(radius)
    reach = farthest * farthest
    _, sequence, own = _sorted_into(centers, low, width, cells)
    for j in sequence:
        x, y, z = centers[j, 0], centers[j, 1], centers[j, 2]
        ring = 0
        while True:
            ring += 1
            if own[j] != block_cell or ring != block_ring:
                block_cell, block_ring, rest = own[j], ring, own[j]
                for axis in (2, 1, 0):
                    rest, along = divmod(rest, cells[axis])
                    first[axis] = max(along - ring, 0)
                    last[axis] = min(along + ring, cells[axis] - 1)
                total = 0
                for cx in range(first[0], last[0] + 1):
                    for cy in range(first[1], last[1] + 1):
                        row = (cx * cells[1] + cy) * cells[2]
                        for s in range(starts[row + first[2]], starts[row + last[2] + 1]):
                            bx[total], by[total], bz[total], place[total] = xs[s], ys[s], zs[s], s
                            total += 1
                padded = (total + _LANES - 1) // _LANES * _LANES
                block[:, total:padded] = _FILLER
            # What is not in cells up to this ring is farther than the nearest of its outer faces.
            gap = np.float32(FAR)
            for axis in range(3):
                offset = centers[j, axis] - low[axis]
                if first[axis] > 0:
                    gap = min(gap, offset - first[axis] * width)
                if last[axis] < cells[axis] - 1:
                    gap = min(gap, (last[axis] + 1) * width - offset)
            for i in range(padded):
                apart[i] = (bx[i] - x) ** 2 + (by[i] - y) ** 2 + (bz[i] - z) ** 2
            gap = max(gap - slack, np.float32(0.0))
            is_whole = gap >= farthest
            value[0] = reach if is_whole else gap * gap
            high = value.view(np.int32)[0]
            inside = _count_up_to(bits, padded, high)
            if is_whole or inside >= count:
                break
        if inside > count:
            high, inside = _halved(bits, padded, high, inside, count, value)
        held = 0
        if inside <= count:
            for i in range(total):
                chosen[held] = i
                held += bits[i] <= high
        else:
            held = _first_chosen(bits, total, high, place, order, count, chosen)
        for slot in range(held):
            found[j, slot] = order[place[chosen[slot]]]
            squares[j, slot] = apart[chosen[slot]]
        numbers[j] = held
    return found, squares, numbers
