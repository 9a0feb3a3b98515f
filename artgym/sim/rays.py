"""Depth, body maps, point clouds and surface normals by ray casting: no graphics driver needed.

``RayCamera`` and ``PointCloudCamera`` see what ``camera.RenderedCamera`` sees, the table as it is.
``cast`` is for labels: any rays, the triangles they meet, and an endless table.
"""

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

from artgym.errors import InvalidArgumentError
from artgym.geometry import transforms
from artgym.geometry.camera import pixel_rays
from artgym.geometry.hand import FINGER_ORIGIN
from artgym.geometry.rotations import JAW_SYMMETRY
from artgym.objects.meshes import link_triangles
from artgym.objects.model import Link
from artgym.sim.camera import FAR, NEAR, View
from artgym.sim.masks import NOTHING, TABLE
from artgym.sim.robots import RobotName, panda_meshes
from artgym.sim.scene import TABLE_HALF_SIZE

Array = NDArray[np.floating]

#: The table hides what reaches deeper than this below its top, metres: not what stands on it.
_SUNKEN = 1e-3
#: Share of pixels that are looked at beyond those that should suffice for a cloud.
_SPARE = 0.04
#: Pixels looked at first to see how many a cloud needs, as a multiple of its points.
_FIRST_LOOK = 1.5


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
        bounds = self.triangles.min(axis=(0, 1)), self.triangles.max(axis=(0, 1))
        #: Corners (8, 3) of the box around it, own frame.
        self.corners: Array = trimesh.bounds.corners(np.array(bounds, dtype=float))

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

    def shorten(self, origins: Array, directions: Array, distance: NDArray[np.float32]) -> None:
        """Shortens rays to where they meet the body.

        Args:
            origins: float32 (n, 3) where they start, in the body's own frame.
            directions: float32 (n, 3), same frame, any length.
            distance: float32 (n,) how far they go, in multiples of their directions; written to.
                Rays that go a negative distance meet nothing.
        """
        # Embree writes the distances into the array that it was given.
        self._scene.run(origins, directions, dists=distance, query="DISTANCE")

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


@functools.cache
def robot_bodies(robot: RobotName) -> tuple[RayBody, ...]:
    """Ray bodies of a robot's links, in the order of ``PandaHand.links``."""
    arm = [f"link{i}" for i in range(8)] if robot == "panda" else []
    return (*hand_bodies(), *(RayBody(_mesh_triangles(f"{name}.glb")) for name in arm))


@functools.cache
def table_body() -> RayBody:
    """The ray body of the table's top; its frame lies on it, z up."""
    x, y, z = TABLE_HALF_SIZE
    mesh = trimesh.creation.box((2 * x, 2 * y, 2 * z))
    return RayBody(np.asarray(mesh.triangles) - [0.0, 0.0, z])


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
        table: whether the plane z = 0 is there, without end.
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


class RayCamera:
    """A camera that needs no renderer: depth, and which body each pixel shows."""

    def __init__(self, view: View) -> None:
        self.view = view
        self._layers = _PixelLayers(view, stride=1)

    def take(
        self, bodies: Sequence[RayBody], Ts_world_body: Array
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Depth (h, w), metres along z with 0 where nothing is seen, and the body map (h, w).

        Args:
            bodies: what is seen beside the table; their order is that of the map's indices.
            Ts_world_body: their poses (b, 4, 4).
        """
        layers = self._layers
        depth, body = layers.distance.copy(), np.full(layers.distance.shape, NOTHING, np.int32)
        with_table = [*bodies, table_body()]
        poses = np.concatenate([np.reshape(Ts_world_body, (-1, 4, 4)), np.eye(4)[None]])
        numbers = [*range(len(bodies)), TABLE]
        for sight in layers.sights(with_table, poses, numbers):
            layers.look(sight, slice(0, 1), depth, body)
        depth += np.float32(NEAR)
        depth[body == NOTHING] = 0.0
        return depth[0], body[0]


class PointCloudCamera:
    """A camera that gives a fixed number of points of what it sees, the table left out.

    Points lie at centres of pixels. Only as many pixels are looked at as a cloud needs.

    Args:
        view: where it stands and how many pixels it has.
        num_points: of a cloud.

    Raises:
        InvalidArgumentError: no points are asked for.
    """

    def __init__(self, view: View, num_points: int) -> None:
        if num_points < 1:
            raise InvalidArgumentError(f"num_points={num_points}: expected 1 or more.")
        self.view = view
        self.num_points = num_points
        stride = 1
        while 2 * (view.width // (2 * stride)) * (view.height // (2 * stride)) >= num_points:
            stride *= 2
        self._layers = _PixelLayers(view, stride)
        # Room for what each pixel shows; overwritten from cloud to cloud.
        self._distance = self._layers.distance.copy()
        self._body = np.empty(self._distance.shape, dtype=np.int32)
        self._R_camera_world = view.T_world_camera[:3, :3].T.astype(np.float32)
        self._eye_world = view.T_world_camera[:3, 3].astype(np.float32)

    def cloud(
        self, bodies: Sequence[RayBody], Ts_world_body: Array, rng: np.random.Generator
    ) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Points (n, 3) of what is seen, world frame, and the body (n,) that each lies on.

        Each pixel gives one point, any as likely as another; where fewer are seen than points are
        asked for, all of them come equally often. A camera that sees no body gives its own place,
        with the body ``NOTHING``.

        Args:
            bodies: what can be seen.
            Ts_world_body: their poses (b, 4, 4).
            rng: chooses the pixels and the order of points.
        """
        layers, count = self._layers, self.num_points
        if not bodies:
            return self._nothing()
        sights = layers.sights(*self._before_table(bodies, Ts_world_body))
        pixels_of_layer = layers.distance[0].size
        body = self._body.reshape(-1)
        seen = np.empty(0, dtype=np.intp)
        looked, more = 0, int(np.ceil(_FIRST_LOOK * count / pixels_of_layer))
        while sights and len(seen) < count and looked < layers.count:
            if looked:
                # As many layers more as give the rest at the rate so far, and a few.
                rate = max(len(seen), 1) / looked
                more = int(np.ceil((1 + _SPARE) * count / rate)) - looked
            now = slice(looked, min(looked + max(more, 1), layers.count))
            self._distance[now] = layers.distance[now]
            self._body[now] = NOTHING
            for sight in sights:
                layers.look(sight, now, self._distance, self._body)
            looked = now.stop
            seen = np.flatnonzero(body[: looked * pixels_of_layer] >= 0)
        if not len(seen):
            return self._nothing()
        chosen = np.resize(rng.permutation(seen), count)
        depth = self._distance.reshape(-1)[chosen]
        depth += np.float32(NEAR)
        points = (layers.directions.reshape(-1, 3)[chosen] * depth[:, None]) @ self._R_camera_world
        points += self._eye_world
        return points.astype(np.float32, copy=False), body[chosen]

    def _before_table(
        self, bodies: Sequence[RayBody], Ts_world_body: Array
    ) -> tuple[Sequence[RayBody], Array, Sequence[int]]:
        """Bodies, poses and numbers, with the table's where it may hide something."""
        corners = np.stack([body.corners for body in bodies])
        lowest = transforms.apply(Ts_world_body, corners)[..., 2].min()
        numbers = range(len(bodies))
        if lowest > -_SUNKEN and self._eye_world[2] > 0:
            return bodies, Ts_world_body, numbers
        poses = np.concatenate([Ts_world_body, np.eye(4)[None]])
        return [*bodies, table_body()], poses, [*numbers, TABLE]

    def _nothing(self) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """The cloud of a camera that sees no body."""
        points = np.tile(self._eye_world, (self.num_points, 1))
        return points, np.full(self.num_points, NOTHING, dtype=np.int32)


@dataclass(frozen=True, kw_only=True)
class _Sight:
    """A body before a camera.

    Attributes:
        body: the body.
        number: what stands for it in body maps.
        R_camera_body: float32 (3, 3).
        eye_body: float32 (3,), the camera's place.
        rows, columns: of cells, outside which the body is not seen.
    """

    body: RayBody
    number: int
    R_camera_body: NDArray[np.float32]
    eye_body: NDArray[np.float32]
    rows: slice
    columns: slice


class _PixelLayers:
    """A picture's pixels, dealt out to layers that each cover the picture evenly.

    The picture is cut into square cells of ``stride`` pixels' side. A layer holds one pixel of each
    cell, the same in all. Any number of layers from the first on covers the picture as evenly as
    so many can.

    Attributes:
        count: of layers, ``stride`` squared.
        directions: float32 (layers, rows, columns, 3), through pixel centres, camera frame; z = 1,
            so that distances along them are depths.
        distance: float32 (layers, rows, columns), how far each ray goes from where it starts, the
            plane at ``NEAR``; negative for places beyond the picture's edge.
    """

    def __init__(self, view: View, stride: int) -> None:
        self._stride = stride
        self._T_camera_world = transforms.invert(view.T_world_camera)
        self._intrinsics = view.intrinsics
        self._size = np.array([view.width, view.height])
        rows, columns = -(-view.height // stride), -(-view.width // stride)
        # Columns, then rows: the order of pixel coordinates.
        self._shape = np.array([columns, rows])
        padded = columns * stride, rows * stride
        directions = pixel_rays(view.intrinsics, *padded).astype(np.float32)
        distance = np.full((*directions.shape[:2], 1), -1.0, dtype=np.float32)
        distance[: view.height, : view.width] = FAR - NEAR
        order = _dither_order(stride)
        self.count = len(order)
        self.directions, distance = (
            pixels.reshape(rows, stride, columns, stride, -1)
            .transpose(1, 3, 0, 2, 4)
            .reshape(self.count, rows, columns, -1)[order]
            for pixels in (directions, distance)
        )
        self.distance = distance[..., 0]

    def sights(
        self, bodies: Sequence[RayBody], Ts_world_body: Array, numbers: Sequence[int]
    ) -> list[_Sight]:
        """Bodies as the camera sees them, last first, without those that lie outside the picture.

        Robots come last and doors after what they close: looked at first, they end most rays soon.
        """
        Ts_camera_body = self._T_camera_world @ Ts_world_body
        Rs_camera_body = Ts_camera_body[:, :3, :3].astype(np.float32)
        eyes_body = transforms.invert(Ts_camera_body)[:, :3, 3].astype(np.float32)
        corners = transforms.apply(Ts_camera_body, np.stack([body.corners for body in bodies]))
        z = corners[..., 2:]
        # Pixel coordinates times z: they tell inside from outside behind the camera, too.
        scaled = corners[..., :2] * np.diag(self._intrinsics)[:2] + z * self._intrinsics[:2, 2]
        beside = np.all(scaled < 0, axis=1) | np.all(scaled > z * self._size, axis=1)
        outside = np.any(beside, axis=1) | np.all(z < NEAR, axis=(1, 2))
        pixels = scaled / np.maximum(z, NEAR)
        # Pixels whose centres lie between; a hundredth more for rounding.
        low = np.floor((pixels.min(axis=1) - 0.51) / self._stride)
        high = np.floor((pixels.max(axis=1) - 0.49) / self._stride) + 1
        # What reaches behind the camera may be seen anywhere.
        behind = np.any(z < NEAR, axis=(1, 2))
        low[behind], high[behind] = 0, self._shape
        low = np.maximum(low, 0).astype(int).tolist()
        high = np.minimum(high, self._shape).astype(int).tolist()
        found = []
        for i, (body, number) in enumerate(zip(bodies, numbers, strict=True)):
            (left, top), (right, bottom) = low[i], high[i]
            if left < right and top < bottom and not outside[i]:
                found.append(
                    _Sight(
                        body=body,
                        number=number,
                        R_camera_body=Rs_camera_body[i],
                        eye_body=eyes_body[i],
                        rows=slice(top, bottom),
                        columns=slice(left, right),
                    )
                )
        return found[::-1]

    def look(
        self,
        sight: _Sight,
        layers: slice,
        distance: NDArray[np.float32],
        body: NDArray[np.int32],
    ) -> None:
        """Enters a body into distances and body maps (layers, rows, columns) where it is first.

        Args:
            sight: the body.
            layers: which layers are looked at.
            distance: how far each ray goes until now; written to.
            body: the body it ends at until now; written to.
        """
        part = layers, sight.rows, sight.columns
        directions = self.directions[part].reshape(-1, 3) @ sight.R_camera_body
        starts = directions * np.float32(NEAR)
        starts += sight.eye_body
        before = distance[part]
        after = before.flatten()
        sight.body.shorten(starts, directions, after)
        after = after.reshape(before.shape)
        body[part][after < before] = sight.number
        before[...] = after


def _dither_order(stride: int) -> NDArray[np.intp]:
    """Pixels of a square, row by row, in an order in which any first few are spread evenly.

    Args:
        stride: side of the square, a power of two.
    """
    ranks = np.zeros((1, 1), dtype=int)
    while len(ranks) < stride:
        # Bayer's matrix.
        ranks = np.block([[4 * ranks, 4 * ranks + 2], [4 * ranks + 3, 4 * ranks + 1]])
    return np.argsort(ranks, axis=None)
