"""Triangle meshes of an object's links, for rays and for surface points."""

from __future__ import annotations

import functools

import numpy as np
import trimesh
from numpy.typing import NDArray

from artgym.geometry import transforms
from artgym.objects.model import Box, Convex, Geometry, Link

Array = NDArray[np.floating]

_CYLINDER_SECTIONS = 32


@functools.lru_cache(maxsize=1024)
def primitive_mesh(geometry: Geometry) -> trimesh.Trimesh:
    """A closed mesh about the primitive's own centre."""
    if isinstance(geometry, Box):
        return trimesh.creation.box(2 * np.asarray(geometry.half_size))
    if isinstance(geometry, Convex):
        return trimesh.Trimesh(geometry.corners(), geometry.triangles, process=False)
    mesh = trimesh.creation.cylinder(
        geometry.radius, 2 * geometry.half_length, sections=_CYLINDER_SECTIONS
    )
    # trimesh's cylinder lies along z, ours along x.
    mesh.apply_transform(
        np.array([[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]], dtype=float)
    )
    return mesh


def link_triangles(link: Link) -> tuple[Array, NDArray[np.intp]]:
    """Triangles (n, 3, 3) of what is seen of a link, in its frame, and which piece (n,) each is of.

    Pieces are the link's visuals where it has any, its shapes otherwise.
    """
    triangles, shape_index = [], []
    for i, visual in enumerate(link.visuals):
        triangles.append(visual.mesh.vertices[visual.mesh.faces])
        shape_index.append(np.full(len(visual.mesh.faces), i))
    if link.visuals:
        return np.concatenate(triangles), np.concatenate(shape_index)
    for i, shape in enumerate(link.shapes):
        mesh = primitive_mesh(shape.geometry)
        corners = transforms.apply(shape.T_link_shape, mesh.triangles.reshape(-1, 3))
        triangles.append(corners.reshape(-1, 3, 3))
        shape_index.append(np.full(len(mesh.faces), i))
    return np.concatenate(triangles), np.concatenate(shape_index)
