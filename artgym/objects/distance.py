"""How far points lie from convex pieces and from their union."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from artgym.geometry import transforms
from artgym.objects.model import Box, Convex, Cylinder, Geometry, Shape

Array = NDArray[np.floating]

#: Steps outwards, metres, by which the depth below the surface of a union is found.
_STEPS = np.concatenate([np.arange(1, 11) * 0.0005, 0.005 * 1.25 ** np.arange(1, 14)])


def box_distance(points: Array, half_size: Array) -> Array:
    """Distance (n,) of points (n, 3) from a box about the origin; negative inside, metres."""
    return _from_excess(np.abs(points) - half_size)


def cylinder_distance(points: Array, radius: float, half_length: float) -> Array:
    """Distance (n,) of points (n, 3) from a cylinder about x; negative inside, metres."""
    across = np.hypot(points[:, 1], points[:, 2])
    return _from_excess(np.stack([np.abs(points[:, 0]) - half_length, across - radius], axis=1))


def _from_excess(excess: Array) -> Array:
    outside = np.linalg.norm(np.maximum(excess, 0.0), axis=1)
    return outside + np.minimum(excess.max(axis=1), 0.0)


def hull_distance(points: Array, corners: Array) -> Array:
    """Height (n,) above the nearest face's plane of a convex hull; negative inside, metres.

    Exact inside and over a face; beyond an edge it is a lower bound.
    """
    return _height(points, ConvexHull(corners).equations)


def _height(points: Array, planes: Array) -> Array:
    return (points @ planes[:, :3].T + planes[:, 3]).max(axis=1)


@functools.lru_cache(maxsize=4096)
def _planes(convex: Convex) -> Array:
    """Planes (m, 4) of a convex piece's faces; of triangles, thin ones have no good plane."""
    return np.unique(ConvexHull(convex.corners()).equations.round(12), axis=0)


def geometry_distance(geometry: Geometry, points: Array) -> Array:
    """Distance (n,) of points (n, 3) in a primitive's frame from it; negative inside, metres."""
    if isinstance(geometry, Box):
        return box_distance(points, np.asarray(geometry.half_size))
    if isinstance(geometry, Convex):
        return _height(points, _planes(geometry))
    assert isinstance(geometry, Cylinder)
    return cylinder_distance(points, geometry.radius, geometry.half_length)


def union_distance(shapes: Sequence[Shape], points_link: Array) -> Array:
    """Distance (n,) of points (n, 3) from the union of a link's shapes, metres.

    Outside it is exact, edges of convex hulls apart; inside it is negative, and its size the depth
    in one shape: a lower bound.
    """
    distance = np.full(len(points_link), np.inf)
    for shape in shapes:
        points = transforms.apply(transforms.invert(shape.T_link_shape), points_link)
        np.minimum(distance, geometry_distance(shape.geometry, points), out=distance)
    return distance


def surface_distance(shapes: Sequence[Shape], points_link: Array, normals_link: Array) -> Array:
    """Distance (n,) of points (n, 3) from the surface of the union of a link's shapes, metres.

    Of points inside it is the way out along their normals (n, 3), at most 9 cm and rounded up by
    half a millimetre, or by a quarter beyond 5 mm.
    """
    distance = union_distance(shapes, points_link)
    inside = np.flatnonzero(distance < 0)
    gap = np.maximum(distance, 0.0)
    for step in _STEPS:
        if not len(inside):
            break
        gap[inside] = step
        moved = points_link[inside] + step * normals_link[inside]
        inside = inside[union_distance(shapes, moved) < 0]
    return gap
