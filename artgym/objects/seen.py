"""Points on what is seen of a link: where a hand would go, since that is what a camera shows."""

from __future__ import annotations

import functools

import numpy as np
import trimesh
from numpy.typing import NDArray

from artgym.objects.meshes import link_triangles
from artgym.objects.model import Link

Array = NDArray[np.floating]

#: Rays start this far above their surface, metres.
_CLEARANCE = 1e-4


def surface_points(link: Link, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Points (count, 3) on what is seen of a link and outward normals, in the link's frame.

    A piece's share goes with the square root of its area: handles are small.
    """
    triangles, piece = link_triangles(link)
    a, b, c = np.swapaxes(triangles, 0, 1)
    doubled = np.cross(b - a, c - a)
    area = np.linalg.norm(doubled, axis=1) / 2
    weight = area / np.sqrt(np.bincount(piece, area))[piece]
    chosen = rng.choice(len(triangles), count, p=weight / weight.sum())
    u, v = rng.random((2, count, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    points = a[chosen] + u * (b - a)[chosen] + v * (c - a)[chosen]
    return points, (doubled / np.maximum(2 * area, 1e-12)[:, None])[chosen]


def uncovered_points(link: Link, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """As ``surface_points``, at most ``count``, without those inside another piece of the link."""
    points, normals = surface_points(link, count, rng)
    body = _mesh(link)
    starts = points + _CLEARANCE * normals
    face, ray = body.ray.intersects_id(starts, normals)[:2]
    # From inside a closed piece, a ray leaves one time more often than it enters.
    leaving = np.sign(np.einsum("ij,ij->i", body.face_normals[face], normals[ray]))
    outside = np.bincount(ray, leaving, len(points)) < 0.5
    return points[outside], normals[outside]


@functools.lru_cache(maxsize=32)
def _mesh(link: Link) -> trimesh.Trimesh:
    triangles, _ = link_triangles(link)
    return trimesh.Trimesh(
        triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3), process=False
    )
