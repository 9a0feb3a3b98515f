"""A two-box object, lid hinged on a base, seen from above: a small sample with exact labels."""

from __future__ import annotations

import numpy as np
import torch

from artgym.datasets.sample import (
    JOINT_NONE,
    JOINT_REVOLUTE,
    Picture,
    Sample,
    level_from_camera,
)
from artgym.geometry.camera import intrinsics_from_fov, look_at, project
from artgym.geometry.grasps import candidates_of_part
from artgym.geometry.normals import surface_normals
from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.geometry.screw import joint_motion
from artgym.geometry.transforms import apply, invert, transform_from, translation
from icaf4_policy.backbone.pointnet2 import BackboneConfig
from icaf4_policy.features import DEFAULT_FEATURES, Features
from icaf4_policy.model import Icaf4, ModelConfig

WIDTH, HEIGHT = 160, 120
SIZES = np.array([[0.30, 0.20, 0.04], [0.30, 0.20, 0.02]])  # base, lid; metres


def _box_surface(size: np.ndarray, count: int, rng: np.random.Generator):
    """Points (count, 3) on a box centred at the origin, and their outward normals."""
    axis = rng.choice(3, count, p=[0.15, 0.15, 0.7])
    sign = rng.choice([-1.0, 1.0], count)
    normals = np.eye(3)[axis] * sign[:, None]
    points = rng.uniform(-0.5, 0.5, (count, 3))
    points[np.arange(count), axis] = 0.5 * sign
    return points * size, normals


def toy_network(features: Features = DEFAULT_FEATURES) -> Icaf4:
    """A small network of the object, not trained, the same each time."""
    torch.manual_seed(0)
    config = ModelConfig(
        categories=("toy",),
        num_parts=2,
        length_units=(0.25,),
        num_points=512,
        features=features,
        backbone=BackboneConfig(centers=(64, 16), neighbors=8),
    )
    return Icaf4(config).eval()


def toy_sample(seed: int = 0, num_points: int = 700) -> Sample:
    """The object in ``toy_picture``."""
    return toy_picture(seed, num_points).samples[0]


def toy_picture(seed: int = 0, num_points: int = 700) -> Picture:
    """One view of the object: both boxes, as if seen through, on a table at height 0."""
    rng = np.random.default_rng(seed)
    angle = rng.uniform(0.3, 1.4)
    pivot_object = np.array([-0.15, 0.0, 0.04])
    axis_object = np.array([0.0, -1.0, 0.0])
    T_object_rest_parts = np.stack([translation([0, 0, 0.02]), translation([0, 0, 0.05])])
    T_object_parts = T_object_rest_parts.copy()
    T_object_parts[1] = (
        joint_motion("revolute", axis_object, pivot_object, angle) @ (T_object_rest_parts[1])
    )
    yaw = matrix_from_axis_angle([0, 0, rng.uniform(-0.6, 0.6)])
    T_world_object = transform_from(yaw, [rng.uniform(-0.05, 0.05), 0, 0])
    T_world_camera = look_at([-0.8, rng.uniform(-0.2, 0.2), 0.6], [0, 0, 0.05])
    T_camera_object = invert(T_world_camera) @ T_world_object
    T_camera_parts = T_camera_object @ T_object_parts
    scales = np.linalg.norm(SIZES, axis=-1)
    object_scale, object_center = np.linalg.norm([0.30, 0.20, 0.06]), np.array([0, 0, 0.03])

    part = rng.integers(0, 2, num_points)
    surfaces = [_box_surface(size, num_points, rng)[0] for size in SIZES]
    points_part = np.stack(surfaces)[part, np.arange(num_points)]
    points_camera = apply(T_camera_parts[part], points_part[:, None])[:, 0]
    rest = apply(T_object_rest_parts[part], points_part[:, None])[:, 0]

    num_labels = 60
    grasp_part = np.repeat([0, 1], num_labels // 2)
    labels = [_box_surface(size, num_labels // 2, rng) for size in SIZES]
    grasp_points_part = np.concatenate([points for points, _ in labels])
    grasp_normals_part = np.concatenate([normals for _, normals in labels])
    # The lid's free half can be held from that side, the jaws closing across its thickness.
    R_object_part = T_object_parts[grasp_part, :3, :3]
    R_object_grasp = candidates_of_part(grasp_normals_part, R_object_part)
    R_part_grasp = np.swapaxes(R_object_part, -1, -2)[:, None] @ R_object_grasp
    tries = (np.abs(R_part_grasp[..., 2, 1]) > 0.8) & (R_part_grasp[..., 0, 2] < -0.3)
    tries[(grasp_part == 0) | (grasp_points_part[:, 0] < 0)] = False
    squares = ((points_part[:, None] - grasp_points_part) ** 2).sum(-1)
    grasp_row = np.where(part[:, None] == grasp_part, squares, np.inf).argmin(axis=1)
    affordance = tries.any(axis=1)[grasp_row]

    intrinsics = intrinsics_from_fov(WIDTH, HEIGHT, np.radians(45))
    depth, mask, rgb = draw_scene(points_camera, part, T_world_camera, intrinsics)
    colors = np.where(part[:, None] == 0, [200, 60, 60], [60, 60, 200])
    rows, columns = np.nonzero(mask)
    left, top = columns.min(), rows.min()
    sample = Sample(
        object_id=f"toy/{seed:04d}",
        box=np.array([left, top, columns.max() + 1 - left, rows.max() + 1 - top], np.float32),
        R_level_camera=level_from_camera(T_world_camera[2, :3]).astype(np.float32),
        points_camera=points_camera.astype(np.float32),
        normals_camera=surface_normals(points_camera, np.arange(num_points), np.zeros(3)).astype(
            np.float16
        ),
        colors=colors.astype(np.uint8),
        part=part.astype(np.uint8),
        npcs=(points_part / scales[part, None] + 0.5).astype(np.float32),
        naocs=((rest - object_center) / object_scale + 0.5).astype(np.float32),
        affordance=affordance.astype(np.uint8),
        grasp_row=grasp_row.astype(np.int32),
        grasp_bits=np.packbits(tries, axis=1, bitorder="little"),
        grasp_points_part=grasp_points_part.astype(np.float32),
        grasp_normals_part=grasp_normals_part.astype(np.float32),
        grasp_part=grasp_part.astype(np.uint8),
        T_camera_parts=T_camera_parts.astype(np.float32),
        R_object_canonical=np.eye(3, dtype=np.float32),
        part_centers=np.zeros((2, 3), np.float32),
        part_scales=scales.astype(np.float32),
        T_camera_object=T_camera_object.astype(np.float32),
        T_object_rest_parts=T_object_rest_parts.astype(np.float32),
        object_center=object_center.astype(np.float32),
        object_scale=np.float32(object_scale)[()].reshape(()),
        joint_type=np.array([JOINT_NONE, JOINT_REVOLUTE], np.int8),
        joint_axis_camera=np.stack([np.zeros(3), T_camera_object[:3, :3] @ axis_object]).astype(
            np.float32
        ),
        joint_pivot_camera=np.stack(
            [np.zeros(3), apply(T_camera_object, pivot_object[None])[0]]
        ).astype(np.float32),
        open_fraction=np.array([0.0, angle / 2.0], np.float32),
    )
    return Picture(
        rgb=rgb,
        depth=depth,
        instance_mask=(mask > 0).astype(np.uint8),
        part_mask=mask,
        intrinsics=intrinsics.astype(np.float32),
        samples=(sample,),
    )


def draw_scene(points_camera, part, T_world_camera, intrinsics):
    """Depth, part mask and colours of the points as small squares over a table at height 0."""
    v, u = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    focal, center = intrinsics[0, 0], intrinsics[:2, 2]
    rays = np.stack([(u - center[0]) / focal, (v - center[1]) / focal, np.ones_like(u)], axis=-1)
    depth = -T_world_camera[2, 3] / (rays @ T_world_camera[2, :3])
    depth[(depth < 0) | (depth > 3)] = 0.0
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    column, row = np.floor(project(points_camera, intrinsics)).astype(int).T
    for i in np.argsort(-points_camera[:, 2]):
        square = (slice(row[i] - 1, row[i] + 2), slice(column[i] - 1, column[i] + 2))
        depth[square] = points_camera[i, 2]
        mask[square] = part[i] + 1
    palette = np.array([[120, 120, 120], [200, 60, 60], [60, 60, 200]], np.uint8)
    return depth.astype(np.float32), mask, palette[mask]
