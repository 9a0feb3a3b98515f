"""Points on the surfaces of an object's links."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from artgym.geometry import transforms
from artgym.objects.meshes import primitive_mesh
from artgym.objects.model import Link

Array = NDArray[np.floating]


@functools.lru_cache(maxsize=32)
def grid_points(link: Link, spacing: float) -> Array:
    """Points (n, 3) in the link's frame that cover its surface, at most ``spacing`` metres apart.

    Deterministic; every face of every shape has points, however thin. Cached, since links are
    immutable; so is the result.
    """
    points = np.concatenate(
        [
            transforms.apply(
                shape.T_link_shape, _cover(primitive_mesh(shape.geometry).triangles, spacing)
            )
            for shape in link.shapes
        ]
    )
    points.setflags(write=False)
    return points


def _cover(triangles: Array, spacing: float) -> Array:
    """Barycentric grids over triangles (n, 3, 3), fine enough for the longest edge of each."""
    points = []
    for a, b, c in triangles:
        along, across = b - a, c - a
        m = max(1, int(np.ceil(np.linalg.norm(along) / spacing)))
        n = max(1, int(np.ceil(np.linalg.norm(across) / spacing)))
        u, v = np.meshgrid(np.arange(m + 1) / m, np.arange(n + 1) / n, indexing="ij")
        inside = u + v <= 1.0 + 1e-9
        points.append(a + u[inside][:, None] * along + v[inside][:, None] * across)
    return np.concatenate(points).round(6)
