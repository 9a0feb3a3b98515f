"""Triangles as the renderer wants them: corners, normals that round what is round, and uv.

Pictures are laid over a piece from six sides (box projection), in metres by the picture's size.
Their rows run along the piece's longest side, so that wood has its grain there.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from artgym.geometry.rotations import cross
from artgym.objects.model import Box, Convex, Cylinder, Geometry

Array = NDArray[np.floating]

_CYLINDER_SIDES = 32
#: Faces that meet at less than this angle belong to one rounded surface.
_CREASE = np.radians(40.0)


@dataclass(frozen=True)
class Surface:
    """Triangles in a piece's own frame, each with three corners of its own.

    Attributes:
        vertices: corners (3 n, 3), counter-clockwise from outside, metres.
        normals: (3 n, 3), unit, outwards.
        sides: (3 n,) axis along which a corner is projected: 0, 1, 2, or 3 where it is rolled
            off a cylinder.
        longest: axis along which the piece is longest.
        roll: (3 n,) metres around a cylinder about x, 0 elsewhere; and the circumference.
    """

    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]
    sides: NDArray[np.intp]
    longest: int
    roll: Array
    circumference: float = 0.0

    @functools.cached_property
    def _columns(self) -> NDArray[np.intp]:
        """Axes (3 n, 2) that become u and v: the longest's first where it lies in the side."""
        return _UV_AXES[self.longest][np.minimum(self.sides, 2)]

    @functools.cached_property
    def _places(self) -> Array:
        """Coordinates (3 n, 2) along these axes, metres."""
        return np.take_along_axis(self.vertices, self._columns, axis=1)

    def uv(self, offset: Array, tile: float) -> Array:
        """Picture coordinates (3 n, 2) of the corners.

        Args:
            offset: added to the corners, (3,), metres; it says where the picture begins.
            tile: side of the picture, metres.
        """
        uv = (self._places + offset[self._columns]) / tile
        if self.circumference:
            around = self.sides == 3
            # A whole number of pictures around, so that the last one meets the first.
            tiles = max(1.0, np.round(self.circumference / tile))
            uv[around, 0] = (self.vertices[around, 0] + offset[0]) / tile
            uv[around, 1] = self.roll[around] / self.circumference * tiles
        return uv


def _uv_axes() -> NDArray[np.intp]:
    """[longest, side]: the axes that become u and v."""
    table = np.empty((3, 3, 2), dtype=np.intp)
    for longest in range(3):
        for side in range(3):
            table[longest, side] = sorted(
                (axis for axis in range(3) if axis != side), key=lambda axis: axis != longest
            )
    return table


_UV_AXES = _uv_axes()


@functools.lru_cache(maxsize=1024)
def piece_surface(geometry: Geometry) -> Surface:
    """The surface of a convex piece about its own origin; shared, so not to be written to."""
    if isinstance(geometry, Box):
        corners = geometry.corners()
        return flat_surface(corners[_BOX_TRIANGLES])
    if isinstance(geometry, Cylinder):
        return _cylinder_surface(geometry)
    return _rounded_surface(geometry)


#: Corners of ``Box.corners`` of each triangle, counter-clockwise from outside.
_BOX_TRIANGLES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def flat_surface(triangles: Array) -> Surface:
    """Triangles (n, 3, 3) with a normal each."""
    weighted = _area_normals(triangles)
    return _surface(triangles, weighted, np.repeat(_unit(weighted), 3, axis=0))


def _rounded_surface(convex: Convex) -> Surface:
    """A polyhedron whose faces shade into each other where they meet at a small angle."""
    faces = convex.triangles
    triangles = convex.corners()[faces]
    weighted = _area_normals(triangles)
    unit = _unit(weighted)
    near = unit @ unit.T > np.cos(_CREASE)
    # A corner's normal: the mean of the faces about that point that are near to its own face's.
    holds = np.zeros((len(convex.points), len(faces)))
    holds[faces, np.arange(len(faces))[:, None]] = 1.0
    mixed = (holds[faces] * near[:, None]) @ weighted
    return _surface(triangles, weighted, _unit(mixed.reshape(-1, 3)))


def _cylinder_surface(cylinder: Cylinder) -> Surface:
    """Rolled side and two caps, axis along x."""
    turn = np.arange(_CYLINDER_SIDES + 1) * 2 * np.pi / _CYLINDER_SIDES
    ring = np.stack([np.zeros_like(turn), np.cos(turn), np.sin(turn)], axis=1)
    length = np.array([cylinder.half_length, 0.0, 0.0])
    low, high = cylinder.radius * ring - length, cylinder.radius * ring + length
    a, b = slice(None, -1), slice(1, None)
    side = [low[a], high[b], high[a], low[a], low[b], high[b]]
    side_normals = [ring[a], ring[b], ring[a], ring[a], ring[b], ring[b]]
    side_turn = [turn[a], turn[b], turn[a], turn[a], turn[b], turn[b]]
    count = _CYLINDER_SIDES
    caps = [
        np.broadcast_to(length, (count, 3)), high[a], high[b],
        np.broadcast_to(-length, (count, 3)), low[b], low[a],
    ]  # fmt: skip
    vertices = np.concatenate([np.stack(side, 1).reshape(-1, 3), np.stack(caps, 1).reshape(-1, 3)])
    x = np.array([1.0, 0.0, 0.0])
    cap_normals = np.broadcast_to(np.stack([x, x, x, -x, -x, -x]), (count, 6, 3)).reshape(-1, 3)
    normals = np.concatenate([np.stack(side_normals, 1).reshape(-1, 3), cap_normals])
    angles = np.stack(side_turn, 1).ravel()
    return Surface(
        vertices=vertices.astype(np.float32),
        normals=normals.astype(np.float32),
        sides=np.repeat([3, 0], len(angles)),
        longest=0,
        roll=np.concatenate([cylinder.radius * angles, np.zeros(len(angles))]),
        circumference=2 * np.pi * cylinder.radius,
    )


def _surface(triangles: Array, weighted: Array, normals: Array) -> Surface:
    """From triangles (n, 3, 3), their area normals (n, 3) and the normals (3 n, 3) of corners."""
    vertices = triangles.reshape(-1, 3)
    sides = np.abs(weighted).argmax(axis=1)
    return Surface(
        vertices=vertices.astype(np.float32),
        normals=normals.astype(np.float32),
        sides=np.repeat(sides, 3),
        longest=int(np.argmax(np.ptp(vertices, axis=0))),
        roll=np.zeros(len(vertices)),
    )


def _area_normals(triangles: Array) -> Array:
    """Outward normals (n, 3) of triangles (n, 3, 3), as long as twice their area."""
    return cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def _unit(vectors: Array) -> Array:
    length = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
    return vectors / np.maximum(length, 1e-12)[:, None]
