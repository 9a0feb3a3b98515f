"""Pinhole camera in the OpenCV convention: x right, y down, z forward, pixel centres at +0.5.

Depth is the z coordinate in metres, 0 where nothing was seen.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.geometry.transforms import transform_from

Array = NDArray[np.floating]


def intrinsics_from_fov(width: int, height: int, fov_y: float) -> Array:
    """The 3x3 matrix of a centred camera with square pixels; ``fov_y`` in radians."""
    focal = 0.5 * height / np.tan(0.5 * fov_y)
    return np.array([[focal, 0.0, 0.5 * width], [0.0, focal, 0.5 * height], [0.0, 0.0, 1.0]])


def pixel_rays(intrinsics: ArrayLike, width: int, height: int) -> Array:
    """Directions (height, width, 3) in the camera frame with z = 1, through pixel centres."""
    K = np.asarray(intrinsics, dtype=float)
    u, v = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones_like(u)], axis=-1)


def points_from_depth(depth: ArrayLike, intrinsics: ArrayLike) -> Array:
    """Back-projects depth (height, width) in metres to points (height, width, 3), camera frame.

    Pixels without depth give the camera's own origin; select with ``depth > 0``.
    """
    depth = np.asarray(depth)
    rays = pixel_rays(intrinsics, depth.shape[1], depth.shape[0])
    return rays * depth[..., None]


def project(points_camera: ArrayLike, intrinsics: ArrayLike) -> Array:
    """Pixel coordinates (..., 2) of points (..., 3) in the camera frame."""
    points = np.asarray(points_camera, dtype=float)
    K = np.asarray(intrinsics, dtype=float)
    return points[..., :2] / points[..., 2:] * K[[0, 1], [0, 1]] + K[:2, 2]


def look_at(
    eye_world: ArrayLike, target_world: ArrayLike, up_world: ArrayLike = (0, 0, 1)
) -> Array:
    """``T_world_camera`` of a camera at ``eye`` that looks at ``target``, image top towards up."""
    eye = np.asarray(eye_world, dtype=float)
    z = np.asarray(target_world, dtype=float) - eye
    z = z / np.linalg.norm(z)
    x = np.cross(z, np.asarray(up_world, dtype=float))
    x = x / np.linalg.norm(x)
    return transform_from(np.stack([x, np.cross(z, x), z], axis=-1), eye)
