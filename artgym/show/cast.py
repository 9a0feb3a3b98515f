"""Drawings of an object by ray casting: flat colours, edges in black, no renderer needed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.geometry import transforms
from artgym.geometry.camera import intrinsics_from_fov, look_at, pixel_rays, project
from artgym.objects.meshes import link_triangles
from artgym.objects.model import ArticulatedObject
from artgym.show.colors import piece_colors
from artgym.sim import rays
from artgym.sim.camera import View
from artgym.sim.masks import NOTHING
from artgym.sim.thumbnail import AZIMUTH, ELEVATION, seen_points

Array = NDArray[np.floating]

#: Vertical field of view, radians.
_FOV_Y = 0.5
#: Share of the picture's width and height that the object may fill.
_FILL = 0.88
#: Drawn so many times larger and averaged, against jagged edges.
_OVERSAMPLING = 2
_PAPER = 246
#: Towards the lamp, object frame.
_LAMP = np.array([0.55, 0.25, 0.8]) / np.linalg.norm([0.55, 0.25, 0.8])
#: Neighbouring pixels whose normals agree less, or whose depths differ by more (share), part at an
#: edge.
_EDGE_COSINE, _EDGE_DEPTH = 0.8, 0.01
#: What hides a point lies nearer to the camera by more than this, metres.
_HIDDEN = 0.003


def viewing_direction() -> Array:
    """Unit vector (3,) from an object towards the camera of its pictures, object frame."""
    c = np.cos(ELEVATION)
    return np.array([c * np.cos(AZIMUTH), c * np.sin(AZIMUTH), np.sin(ELEVATION)])


def fitting_view(points_object: Array, size: tuple[int, int]) -> View:
    """The camera whose picture points (n, 3) just fill; its world is the object's frame.

    Args:
        points_object: what shall be seen, metres.
        size: width and height, pixels.
    """
    width, height = size
    T_world_camera = look_at(viewing_direction(), np.zeros(3))
    x, y, z = (points_object @ T_world_camera[:3, :3]).T
    K = intrinsics_from_fov(width, height, _FOV_Y)
    eye = np.zeros(3)
    depths = []
    for axis, (across, pixels) in enumerate(((x, width), (y, height))):
        # The two sides of the field of view each touch the points.
        slope = _FILL * 0.5 * pixels / K[axis, axis]
        low, high = np.max(across - slope * z), np.min(across + slope * z)
        eye[axis] = (low + high) / 2
        depths.append((high - low) / (2 * slope))
    eye[2] = min(depths)
    T_world_camera[:3, 3] = T_world_camera[:3, :3] @ eye
    return View(T_world_camera=T_world_camera, fov_y=_FOV_Y, width=width, height=height)


@dataclass(frozen=True, kw_only=True, eq=False)
class CastPicture:
    """A drawing of an object.

    Attributes:
        rgb: uint8 (h, w, 3).
        view: its camera; the world is the object's frame.
        body: int32 (h, w), the part that each pixel shows, ``masks.NOTHING`` beside the object.
    """

    rgb: NDArray[np.uint8]
    view: View
    body: NDArray[np.int32]

    def middle_of(self, part: int) -> tuple[float, float] | None:
        """A pixel of the part, (u, v), as much in its middle as can be; None if it is hidden."""
        rows, columns = np.nonzero(self.body == part)
        if not len(rows):
            return None
        off = (rows - rows.mean()) ** 2 + (columns - columns.mean()) ** 2
        nearest = int(np.argmin(off))
        return float(columns[nearest]) + 0.5, float(rows[nearest]) + 0.5


def cast_picture(
    obj: ArticulatedObject,
    q: ArrayLike,
    view: View,
    part_colors: Sequence[ArrayLike] | None = None,
) -> CastPicture:
    """Draws an object.

    Args:
        obj: the object.
        q: joint positions (K - 1,).
        view: the camera; its world is the object's frame.
        part_colors: an RGB colour a part, bytes; by default the colours of the object's materials.
    """
    poses = obj.link_poses(np.asarray(q, dtype=float))
    bodies = [rays.link_body(link) for link in obj.links]
    width, height = _OVERSAMPLING * view.width, _OVERSAMPLING * view.height
    K = intrinsics_from_fov(width, height, view.fov_y)
    T_camera_object = transforms.invert(view.T_world_camera)
    corners = project(transforms.apply(T_camera_object, seen_points(obj, np.asarray(q))), K)
    left, top = np.clip(np.floor(corners.min(axis=0)) - 1, 0, (width, height)).astype(int).tolist()
    right, bottom = np.clip(np.ceil(corners.max(axis=0)) + 1, 0, (width, height)).astype(int)
    part = slice(top, int(bottom)), slice(left, int(right))
    # Nothing is met outside the rectangle that holds the object.
    rays_camera = pixel_rays(K, width, height)[part]
    directions = transforms.rotate(view.T_world_camera, rays_camera.reshape(-1, 3))
    hits = rays.cast(bodies, poses, view.T_world_camera[:3, 3], directions, table=False)
    colors, normals = np.full((len(directions), 3), float(_PAPER)), np.zeros((len(directions), 3))
    for index, (link, body, T) in enumerate(zip(obj.links, bodies, poses, strict=True)):
        here = hits.body == index
        triangle = hits.triangle[here]
        normals[here] = transforms.rotate(T, body.normals())[triangle]
        own = piece_colors(link)[link_triangles(link)[1][triangle]]
        colors[here] = own if part_colors is None else np.asarray(part_colors[index])
    # A triangle is bright on the side that is seen, whichever side that is.
    facing = -np.sign(np.einsum("ij,ij->i", normals, directions))[:, None]
    light = 0.62 + 0.38 * (facing * normals) @ _LAMP
    colors = np.where((hits.body >= 0)[:, None], colors * light[:, None], colors)
    shape = rays_camera.shape[:2]
    image = np.full((height, width, 3), float(_PAPER))
    body_map = np.full((height, width), NOTHING, dtype=np.int32)
    image[part], body_map[part] = colors.reshape(*shape, 3), hits.body.reshape(shape)
    depth = np.where(hits.body >= 0, hits.distance, 0.0).reshape(shape)
    image[part][_edges(body_map[part], depth, normals.reshape(*shape, 3))] *= 0.35
    blocks = image.reshape(view.height, _OVERSAMPLING, view.width, _OVERSAMPLING, 3)
    rgb = np.clip(blocks.mean(axis=(1, 3)), 0, 255).round().astype(np.uint8)
    return CastPicture(rgb=rgb, view=view, body=body_map[::_OVERSAMPLING, ::_OVERSAMPLING])


def _edges(body: NDArray[np.int32], depth: Array, normals: Array) -> NDArray[np.bool_]:
    """Pixels (h, w) whose right or lower neighbour shows another part, or one at an angle."""
    edges = np.zeros(body.shape, dtype=bool)
    for here, there in (
        ((slice(None), slice(None, -1)), (slice(None), slice(1, None))),
        ((slice(None, -1), slice(None)), (slice(1, None), slice(None))),
    ):
        bent = np.einsum("ijk,ijk->ij", normals[here], normals[there]) < _EDGE_COSINE
        jump = np.abs(depth[here] - depth[there]) > _EDGE_DEPTH * depth[here]
        seen = (body[here] >= 0) & (body[there] >= 0)
        edges[here] |= (body[here] != body[there]) | (seen & (bent | jump))
    return edges


def visible(
    obj: ArticulatedObject, q: ArrayLike, view: View, points_object: Array
) -> NDArray[np.bool_]:
    """Whether a camera sees each of the points (n, 3) of an object's surface: bool (n,)."""
    eye = view.T_world_camera[:3, 3]
    bodies = [rays.link_body(link) for link in obj.links]
    towards = points_object - eye
    length = np.linalg.norm(towards, axis=-1)
    poses = obj.link_poses(np.asarray(q, dtype=float))
    hits = rays.cast(bodies, poses, eye, towards, table=False)
    return hits.distance * length > length - _HIDDEN
