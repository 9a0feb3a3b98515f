"""Bars, arrows, hands and boxes as triangles and lines: what marks places in a 3D page."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.datasets.drawing import hand_lines
from artgym.geometry import transforms
from artgym.geometry.rotations import frame_from_z

Array = NDArray[np.floating]
#: Vertices (n, 3) and triangles (m, 3), indices of them.
Solid = tuple[Array, NDArray[np.integer]]

#: Pairs of corners of a box that share an edge; corners count in binary, x first.
_BOX_EDGES = np.array([(i, i | bit) for bit in (1, 2, 4) for i in range(8) if not i & bit])
_HEAD_LENGTH, _HEAD_WIDTH = 6.0, 3.5


def joined(solids: Iterable[Solid]) -> Solid:
    """One solid of several; of none it is empty."""
    vertices: list[Array] = [np.empty((0, 3))]
    faces: list[NDArray[np.integer]] = [np.empty((0, 3), dtype=int)]
    count = 0
    for points, triangles in solids:
        vertices.append(points)
        faces.append(triangles + count)
        count += len(points)
    return np.concatenate(vertices), np.concatenate(faces)


def bar(start: ArrayLike, end: ArrayLike, width: float, end_width: float | None = None) -> Solid:
    """A square bar from one point (3,) to another; with ``end_width`` 0 a pyramid. Metres."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    if np.allclose(start, end):
        return joined([])
    across = frame_from_z(end - start)[:, :2].T
    around = np.array([across[0], across[1], -across[0], -across[1]]) / np.sqrt(2)
    far = width if end_width is None else end_width
    vertices = np.concatenate([start + width * around, end + far * around])
    sides = [(i, (i + 1) % 4, i + 4) for i in range(4)]
    sides += [((i + 1) % 4, (i + 1) % 4 + 4, i + 4) for i in range(4)]
    ends = [(0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7)]
    return vertices, np.array(sides + ends)


def arrow(start: ArrayLike, end: ArrayLike, width: float) -> Solid:
    """A bar with a head that ends at ``end``, metres."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    length = float(np.linalg.norm(end - start))
    head = min(_HEAD_LENGTH * width, 0.5 * length)
    neck = end - (end - start) * (head / length if length else 0.0)
    return joined([bar(start, neck, width), bar(neck, end, _HEAD_WIDTH * width, 0.0)])


def polyline(points: ArrayLike, width: float) -> Solid:
    """Bars through points (n, 3), metres."""
    points = np.asarray(points, dtype=float)
    return joined(bar(a, b, width) for a, b in pairwise(points))


def hand(T_a_grasp: ArrayLike, width: float = 0.003) -> Solid:
    """An open hand at a grasp, frame a."""
    return joined(polyline(line, width) for line in hand_lines(T_a_grasp))


def box_edges(bounds: ArrayLike, T_a_box: ArrayLike) -> Array:
    """The edges (24, 3) of a box (2, 3), min and max, as pairs of points in frame a."""
    low, high = np.asarray(bounds, dtype=float)
    bits = (np.arange(8)[:, None] >> np.arange(3)) & 1
    return transforms.apply(T_a_box, low + bits * (high - low))[_BOX_EDGES].reshape(-1, 3)
