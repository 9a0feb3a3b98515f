"""Depth, part masks and surface normals by ray casting: no graphics driver needed."""

from __future__ import annotations

import functools
import typing
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene
from numpy.typing import NDArray

from artgym.geometry import transforms
from artgym.geometry.camera import pixel_rays
from artgym.geometry.rotations import JAW_SYMMETRY
from artgym.objects.meshes import link_triangles
from artgym.objects.model import Link
from artgym.sim.robots import FINGER_ORIGIN, panda_meshes

Array = NDArray[np.floating]

#: ``RayHits.body`` where a ray meets nothing, and where it meets the table.
NOTHING, TABLE = -1, -2


@dataclass(frozen=True, kw_only=True)
class RayHits:
    """What n rays meet first.

    Attributes:
        distance: (n,) in multiples of the ray's direction, inf where nothing is met.
        body: (n,) index into the bodies given, or ``NOTHING`` or ``TABLE``.
        triangle: (n,) index into that body's triangles, -1 elsewhere.
    """

    distance: Array
    body: NDArray[np.int32]
    triangle: NDArray[np.int32]


class RayBody:
    """A rigid body's triangles (n, 3, 3) in its own frame, ready for rays."""

    def __init__(self, triangles: Array) -> None:
        self.triangles = np.ascontiguousarray(triangles, dtype=np.float32)
        self._scene = EmbreeScene()
        TriangleMesh(self._scene, self.triangles)

    def hit(self, origins: Array, directions: Array) -> tuple[Array, NDArray[np.int32]]:
        """Distance (n,) and triangle (n,) of the first hit, in the body's own frame."""
        found = self._scene.run(
            np.ascontiguousarray(origins, dtype=np.float32),
            np.ascontiguousarray(directions, dtype=np.float32),
            query="INTERSECT",
            output=True,
        )
        missed = found["primID"] < 0
        return np.where(missed, np.inf, found["tfar"]), found["primID"]

    def normals(self) -> Array:
        """Outward unit normals (n, 3) of the triangles."""
        a, b, c = np.swapaxes(self.triangles, 0, 1).astype(float)
        normal = np.cross(b - a, c - a)
        return normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)


@functools.lru_cache(maxsize=128)
def link_body(link: Link) -> RayBody:
    """The ray body of an object's link; cached, since links are immutable."""
    triangles, _ = link_triangles(link)
    return RayBody(triangles)


@functools.cache
def hand_bodies() -> tuple[RayBody, RayBody, RayBody]:
    """Ray bodies of the Panda's hand, left and right finger, each in its link's frame."""
    hand = _mesh_triangles("hand.glb")
    finger = _mesh_triangles("finger.glb")
    return RayBody(hand), RayBody(finger), RayBody(finger @ JAW_SYMMETRY)


def _mesh_triangles(file: str) -> Array:
    mesh = typing.cast(trimesh.Trimesh, trimesh.load(panda_meshes() / file, force="mesh"))
    return np.asarray(mesh.triangles)


def hand_poses(T_world_hand: Array, width: float) -> Array:
    """``Ts_world_link`` (3, 4, 4) of the hand and its fingers at a jaw width in metres."""
    slides = np.array([[0, 0, 0], [0, width / 2, FINGER_ORIGIN], [0, -width / 2, FINGER_ORIGIN]])
    return T_world_hand @ transforms.translation(slides)


def cast(
    bodies: Sequence[RayBody],
    Ts_world_body: Array,
    origin_world: Array,
    directions_world: Array,
    *,
    table: bool = True,
) -> RayHits:
    """Casts rays from one point.

    Args:
        bodies: what can be met.
        Ts_world_body: their poses (b, 4, 4).
        origin_world: (3,), metres.
        directions_world: (n, 3), any length; distances come in multiples of it.
        table: whether the plane z = 0 is there.
    """
    count = len(directions_world)
    distance = np.full(count, np.inf)
    body_index = np.full(count, NOTHING, dtype=np.int32)
    triangle = np.full(count, -1, dtype=np.int32)
    if table:
        with np.errstate(divide="ignore"):
            fall = -origin_world[2] / directions_world[:, 2]
        down = fall > 0
        distance[down] = fall[down]
        body_index[down] = TABLE
    for i, (body, T_world_body) in enumerate(zip(bodies, Ts_world_body, strict=True)):
        T_body_world = transforms.invert(T_world_body)
        directions = transforms.rotate(T_body_world, directions_world)
        origin = transforms.apply(T_body_world, origin_world[None])
        found, primitive = body.hit(np.broadcast_to(origin, directions.shape), directions)
        nearer = found < distance
        distance[nearer] = found[nearer]
        body_index[nearer] = i
        triangle[nearer] = primitive[nearer]
    return RayHits(distance=distance, body=body_index, triangle=triangle)


def camera_rays(intrinsics: Array, width: int, height: int, T_world_camera: Array) -> Array:
    """World directions (height * width, 3) whose distances are depths, row by row."""
    rays = pixel_rays(intrinsics, width, height).reshape(-1, 3)
    return transforms.rotate(T_world_camera, rays)
