"""Triangle meshes of an object's links, for rays and for surface points."""

from __future__ import annotations

import functools

import numpy as np
import trimesh
from numpy.typing import NDArray

from artgym.geometry import transforms
from artgym.objects.model import Box, Cylinder, Link

Array = NDArray[np.floating]

_CYLINDER_SECTIONS = 32


@functools.lru_cache(maxsize=1024)
def primitive_mesh(geometry: Box | Cylinder) -> trimesh.Trimesh:
    """A closed mesh about the primitive's own centre."""
    if isinstance(geometry, Box):
        return trimesh.creation.box(2 * np.asarray(geometry.half_size))
    mesh = trimesh.creation.cylinder(
        geometry.radius, 2 * geometry.half_length, sections=_CYLINDER_SECTIONS
    )
    # trimesh's cylinder lies along z, ours along x.
    mesh.apply_transform(
        np.array([[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]], dtype=float)
    )
    return mesh


def link_triangles(link: Link) -> tuple[Array, NDArray[np.intp]]:
    """Triangles (n, 3, 3) of a link in its own frame, and the shape index (n,) of each."""
    triangles, shape_index = [], []
    for i, shape in enumerate(link.shapes):
        mesh = primitive_mesh(shape.geometry)
        corners = transforms.apply(shape.T_link_shape, mesh.triangles.reshape(-1, 3))
        triangles.append(corners.reshape(-1, 3, 3))
        shape_index.append(np.full(len(mesh.faces), i))
    return np.concatenate(triangles), np.concatenate(shape_index)
