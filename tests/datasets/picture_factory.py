"""Pictures of random content for tests of files."""

from __future__ import annotations

import numpy as np

from artgym.datasets.sample import Picture, Sample
from artgym.geometry.grasps import NUM_CANDIDATES


def random_picture(
    seed: int,
    *,
    height: int = 24,
    width: int = 32,
    num_objects: int = 1,
    num_points: int = 50,
    num_parts: int = 3,
    num_grasp_points: int = 20,
) -> Picture:
    """A picture with the right shapes and dtypes, and no meaning."""
    rng = np.random.default_rng([seed, 1])
    image = (height, width)
    return Picture(
        rgb=rng.integers(0, 256, (*image, 3)).astype(np.uint8),
        depth=rng.normal(size=image).astype(np.float32),
        instance_mask=rng.integers(0, num_objects + 1, image).astype(np.uint8),
        part_mask=rng.integers(0, num_parts + 1, image).astype(np.uint8),
        intrinsics=rng.normal(size=(3, 3)).astype(np.float32),
        samples=tuple(
            random_sample(100 * k + seed, num_points, num_parts, num_grasp_points)
            for k in range(num_objects)
        ),
    )


def random_sample(
    seed: int, num_points: int = 50, num_parts: int = 3, num_grasp_points: int = 20
) -> Sample:
    """A sample with the right shapes and dtypes, and no meaning."""
    rng = np.random.default_rng(seed)

    def floats(*shape: int) -> np.ndarray:
        return np.asarray(rng.normal(size=shape), dtype=np.float32)

    def integers(low: int, high: int, shape: tuple[int, ...], dtype: type) -> np.ndarray:
        return rng.integers(low, high, shape).astype(dtype)

    points = (num_points,)
    return Sample(
        object_id=f"laptop/{seed:04d}",
        box=floats(4),
        R_level_camera=floats(3, 3),
        points_camera=floats(num_points, 3),
        normals_camera=floats(num_points, 3).astype(np.float16),
        colors=integers(0, 256, (num_points, 3), np.uint8),
        part=integers(0, num_parts, points, np.uint8),
        npcs=floats(num_points, 3),
        naocs=floats(num_points, 3),
        affordance=integers(0, 2, points, np.uint8),
        grasp_row=integers(-1, max(num_grasp_points, 1), points, np.int32),
        grasp_bits=integers(0, 256, (num_grasp_points, -(-NUM_CANDIDATES // 8)), np.uint8),
        grasp_points_part=floats(num_grasp_points, 3),
        grasp_normals_part=floats(num_grasp_points, 3),
        grasp_part=integers(0, num_parts, (num_grasp_points,), np.uint8),
        T_camera_parts=floats(num_parts, 4, 4),
        R_object_canonical=floats(3, 3),
        part_centers=floats(num_parts, 3),
        part_scales=floats(num_parts),
        T_camera_object=floats(4, 4),
        T_object_rest_parts=floats(num_parts, 4, 4),
        object_center=floats(3),
        object_scale=floats(),
        joint_type=integers(-1, 2, (num_parts,), np.int8),
        joint_axis_camera=floats(num_parts, 3),
        joint_pivot_camera=floats(num_parts, 3),
        open_fraction=floats(num_parts),
    )
