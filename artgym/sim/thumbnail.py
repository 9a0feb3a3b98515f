"""A picture of an object alone: filled by it, evenly lit, on a plain ground that fades out."""

from __future__ import annotations

import numpy as np
import sapien
from numpy.typing import NDArray

from artgym.geometry import transforms
from artgym.geometry.camera import look_at, points_from_depth, project
from artgym.objects.meshes import link_triangles
from artgym.objects.model import ArticulatedObject, Box, Material, Shape
from artgym.sim.camera import FAR, RenderedCamera, View
from artgym.sim.renderer import render_system
from artgym.sim.scene import ManipulationScene, visual_body

Array = NDArray[np.floating]

#: Where the camera looks from: azimuth from the object's front, height above the horizontal,
#: radians.
AZIMUTH, ELEVATION = 0.6, 0.46
#: Vertical fields of view, radians: the first with which all of the object is near enough.
_FOVS_Y = (0.5, 0.65, 0.85, 1.1)
#: Share of the picture's half width and height that the object may fill.
_FILL = 0.9
#: Pictures are rendered this many times larger and averaged, against jagged edges.
_OVERSAMPLING = 2

_GROUND = Material(color=(0.74, 0.75, 0.77), roughness=1.0)
#: Half the side of the ground, metres: it ends farther away than any camera sees.
_GROUND_HALF_SIZE = 3 * FAR
#: Depth comes in whole millimetres: so near to z = 0 a point is the ground's, metres.
_GROUND_TOLERANCE = 0.003


def thumbnail(
    obj: ArticulatedObject, size: tuple[int, int] = (240, 180), open_fraction: float = 0.3
) -> NDArray[np.uint8]:
    """A picture (h, w, 3) of the object, all its joints at one open fraction.

    Args:
        obj: the object.
        size: width and height, pixels.
        open_fraction: of every joint.

    Raises:
        RendererUnavailableError: no device here can render.
    """
    q = np.array([joint.position(open_fraction) for joint in obj.joints])
    width, height = (_OVERSAMPLING * pixels for pixels in size)
    points = seen_points(obj, q)
    for fov_y in _FOVS_Y:
        view = _framing(points, fov_y, width, height)
        if transforms.apply(transforms.invert(view.T_world_camera), points)[:, 2].max() < FAR:
            break
    scene = ManipulationScene(obj, np.eye(4), q, render_system=render_system())
    _add_ground(scene.sapien_scene)
    _add_lights(scene.sapien_scene, float(np.linalg.norm(np.ptp(obj.rest_bounds, axis=0))))
    rgb, depth = RenderedCamera(scene.sapien_scene, view, shader="shadows").take()
    scene.close()
    # Beyond the camera's range the ground goes on as bright as where nothing shades it.
    points_camera = points_from_depth(depth, view.intrinsics)
    height_world = points_camera @ view.T_world_camera[2, :3] + view.T_world_camera[2, 3]
    ground = (depth > 0.0) & (np.abs(height_world) < _GROUND_TOLERANCE)
    if ground.any():
        rgb[depth == 0.0] = np.median(rgb[ground], axis=0)
    blocks = rgb.reshape(size[1], _OVERSAMPLING, size[0], _OVERSAMPLING, 3)
    return blocks.mean(axis=(1, 3)).round().astype(np.uint8)


def seen_points(obj: ArticulatedObject, q: Array) -> Array:
    """Corners (n, 3) of all that is seen of an object at q, object frame."""
    return np.concatenate(
        [
            transforms.apply(T, link_triangles(link)[0].reshape(-1, 3))
            for T, link in zip(obj.link_poses(q), obj.links, strict=True)
        ]
    )


def _framing(points: Array, fov_y: float, width: int, height: int) -> View:
    """The camera whose picture the points (n, 3) just fill."""
    direction = np.array(
        [
            np.cos(ELEVATION) * np.cos(AZIMUTH),
            np.cos(ELEVATION) * np.sin(AZIMUTH),
            np.sin(ELEVATION),
        ]
    )
    target = (points.min(axis=0) + points.max(axis=0)) / 2
    distance = 3.0 * float(np.linalg.norm(np.ptp(points, axis=0)))
    half = np.array([width, height]) / 2
    for _ in range(8):
        view = View(
            T_world_camera=look_at(target + distance * direction, target),
            fov_y=fov_y,
            width=width,
            height=height,
        )
        pixels = project(
            transforms.apply(transforms.invert(view.T_world_camera), points), view.intrinsics
        )
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        # Moved sideways until the object is in the middle, and along until it fills the picture.
        right, down = view.T_world_camera[:3, 0], view.T_world_camera[:3, 1]
        aside = ((low + high) / 2 - half) * distance / view.intrinsics[0, 0]
        target = target + aside[0] * right + aside[1] * down
        distance *= float(np.max((high - low) / 2 / half)) / _FILL
    return view


def _add_ground(scene: sapien.Scene) -> None:
    thickness = 0.01
    half_size = (_GROUND_HALF_SIZE, _GROUND_HALF_SIZE, thickness)
    shape = Shape(geometry=Box(half_size=half_size), position=(0, 0, -thickness), material=_GROUND)
    entity = sapien.Entity()
    entity.add_component(visual_body((shape,)))
    scene.add_entity(entity)


def _add_lights(scene: sapien.Scene, extent: float) -> None:
    """A lamp that casts shadows, a weaker one from the other side, and light all round."""
    scene.set_ambient_light([0.32, 0.32, 0.33])
    direction = np.array([-0.5, 0.45, -1.0])
    scene.add_directional_light(
        direction.tolist(),
        [1.35, 1.32, 1.28],
        shadow=True,
        position=(-2.0 * extent * direction).tolist(),
        shadow_scale=2.0 * extent,
        shadow_near=0.01,
        shadow_far=6.0 * extent,
        shadow_map_size=2048,
    )
    scene.add_directional_light([-0.6, -0.8, -0.5], [0.45, 0.46, 0.5])
