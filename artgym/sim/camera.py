"""Cameras: where they stand, and pictures by the renderer.

Pictures come in the OpenCV convention; depth is metres along z, 0 where nothing was seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import sapien
from numpy.typing import NDArray

from artgym.geometry.camera import intrinsics_from_fov, look_at
from artgym.objects.model import ArticulatedObject
from artgym.sim.conversion import R_SIMCAM_CAMERA, pose_from_transform
from artgym.sim.masks import NOTHING, TABLE
from artgym.sim.renderer import ShaderName, use_shader

Array = NDArray[np.floating]

#: Nothing nearer or farther is seen, metres.
NEAR, FAR = 0.05, 6.0


@dataclass(frozen=True, kw_only=True)
class View:
    """A camera in the world.

    Attributes:
        T_world_camera: its pose (4, 4), OpenCV axes.
        fov_y: vertical field of view, radians.
        width, height: of the picture, pixels.
    """

    T_world_camera: Array
    fov_y: float
    width: int
    height: int

    @property
    def intrinsics(self) -> Array:
        """(3, 3)."""
        return intrinsics_from_fov(self.width, self.height, self.fov_y)


@dataclass(frozen=True, kw_only=True)
class ViewDistribution:
    """Where cameras stand: in front of the table, looking down at the object.

    Attributes:
        azimuth: about z from the world's x axis, radians.
        elevation: above the horizontal, radians.
        distance: from the point looked at, metres.
        target: middle and half extent of the point looked at, metres.
        fov_y: vertical field of view, radians.
    """

    azimuth: tuple[float, float] = (-0.7, 0.7)
    elevation: tuple[float, float] = (0.45, 0.95)
    distance: tuple[float, float] = (0.8, 1.1)
    target: tuple[tuple[float, float, float], tuple[float, float, float]] = (
        (0.05, 0.0, 0.12),
        (0.04, 0.04, 0.03),
    )
    fov_y: tuple[float, float] = (0.55, 0.7)

    @classmethod
    def around(cls, obj: ArticulatedObject) -> ViewDistribution:
        """Cameras that see an object well: nearer to small ones, farther from large ones."""
        low, high = obj.body_bounds
        diagonal = float(np.linalg.norm(high - low))
        # Table-top objects of 0.25 to 0.75 m fill the picture from the standard distance; the top
        # of a tall one would be out of it.
        tall = high[2] > 0.42
        scale = np.clip(diagonal / np.clip(diagonal, 0.25, 0.6 if tall else 0.75), 0.55, 3.0)
        if scale == 1.0 and not tall:
            return cls()
        standard = cls()
        near, far = standard.distance
        (x, y, _), half = standard.target
        return cls(
            distance=(scale * near, scale * far),
            target=(
                (scale * x, y, float(low[2] + high[2]) / 2),
                (scale * half[0], scale * half[1], scale * half[2]),
            ),
        )

    def sample(self, rng: np.random.Generator, width: int, height: int) -> View:
        """Draws one camera."""
        azimuth, elevation = rng.uniform(*self.azimuth), rng.uniform(*self.elevation)
        direction = np.array(
            [
                np.cos(elevation) * np.cos(azimuth),
                np.cos(elevation) * np.sin(azimuth),
                np.sin(elevation),
            ]
        )
        middle, half = np.asarray(self.target)
        target = middle + half * rng.uniform(-1, 1, 3)
        return View(
            T_world_camera=look_at(target + rng.uniform(*self.distance) * direction, target),
            fov_y=rng.uniform(*self.fov_y),
            width=width,
            height=height,
        )


class RenderedCamera:
    """A camera in a scene that has a renderer.

    Args:
        scene: what it sees.
        view: where it is.
        shader: how it draws, see ``renderer.ShaderName``.
    """

    def __init__(self, scene: sapien.Scene, view: View, shader: ShaderName = "fast") -> None:
        self.view = view
        use_shader(shader)
        self._camera = sapien.render.RenderCameraComponent(view.width, view.height)
        self._camera.set_fovy(view.fov_y, compute_x=True)
        self._camera.near, self._camera.far = NEAR, FAR
        entity = sapien.Entity()
        entity.add_component(self._camera)
        entity.name = "camera"
        R_world_simcam = view.T_world_camera[:3, :3] @ R_SIMCAM_CAMERA.T
        T = view.T_world_camera.copy()
        T[:3, :3] = R_world_simcam
        entity.pose = pose_from_transform(T)
        scene.add_entity(entity)
        self._scene = scene

    def take(self) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """RGB (h, w, 3) and depth (h, w) of the scene as it stands."""
        rgb, depth, _ = self._shoot()
        return rgb, depth

    def take_with_bodies(
        self, bodies: Sequence[sapien.Component]
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.int32]]:
        """The same, and the body map (h, w) of that picture; see ``masks``.

        Args:
            bodies: links of the objects and of the robot, in the order of the map's indices. What
                is seen of anything else becomes ``TABLE``.
        """
        rgb, depth, entity = self._shoot()
        ids = np.array([body.entity.per_scene_id for body in bodies], dtype=np.intp)
        index = np.full(max(entity.max(), ids.max(initial=0)) + 1, TABLE, dtype=np.int32)
        index[ids] = np.arange(len(ids))
        return rgb, depth, np.where(depth > 0.0, index[entity], NOTHING)

    def _shoot(
        self,
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.integer]]:
        """RGB, depth, and ``per_scene_id`` (h, w) of the entity each pixel shows."""
        self._scene.update_render()
        self._camera.take_picture()
        rgba = self._camera.get_picture("Color")
        rgb = np.empty((*rgba.shape[:2], 3), dtype=np.uint8)
        # One after another takes a quarter of the time of all at once.
        for channel in range(3):
            rgb[..., channel] = rgba[..., channel]
        # Positions come in integer millimetres, the camera looking along -z; 0 of nothing.
        position_mm_entity = self._camera.get_picture("PositionSegmentation")
        depth = np.multiply(-position_mm_entity[..., 2], np.float32(1e-3), dtype=np.float32)
        return rgb, depth, position_mm_entity[..., 3]
