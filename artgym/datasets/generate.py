"""Makes labelled RGB-D samples: one labelled object, many views of each of its joint states."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]

from artgym.annotation.annotate import MOVABLE_PART, Labels, labelled_ids, read_labels
from artgym.datasets.sample import (
    AFFORDANCE_NO,
    AFFORDANCE_UNKNOWN,
    AFFORDANCE_YES,
    JOINT_NONE,
    JOINT_PRISMATIC,
    JOINT_REVOLUTE,
    Sample,
    level_from_camera,
)
from artgym.datasets.sample_files import write_samples
from artgym.errors import InvalidArgumentError
from artgym.files import Manifest
from artgym.geometry import transforms
from artgym.geometry.camera import points_from_depth
from artgym.jobs import ShardTask, run_shards
from artgym.objects import catalog
from artgym.objects.model import ArticulatedObject, canonical_box
from artgym.sim import rays
from artgym.sim.camera import RenderedCamera, View, ViewDistribution
from artgym.sim.renderer import render_system
from artgym.sim.scene import ManipulationScene
from artgym.sim.setting import add_lights, random_placement, random_table

Array = NDArray[np.floating]


@dataclass(frozen=True, kw_only=True)
class GenerationConfig:
    """What is pictured and kept.

    Attributes:
        views: pictures of each labelled joint state.
        camera_size: (width, height), pixels.
        max_points: object points kept of a picture.
        min_points: a picture with fewer is drawn again.
        clearance: points nearer to the table are left out, metres.
        label_radius: a labelled point farther from a seen one says nothing of it, metres.
        label_angle: nor does one whose normal differs by more, radians.
        seed: of views, lights and placements.
    """

    views: int = 16
    camera_size: tuple[int, int] = (320, 240)
    max_points: int = 4096
    min_points: int = 600
    clearance: float = 0.004
    label_radius: float = 0.012
    label_angle: float = 0.7
    seed: int = 0


def make_samples(
    object_id: str, config: GenerationConfig = GenerationConfig(), label_root: Path | None = None
) -> list[Sample]:
    """All samples of one labelled object, a function of id, labels and config alone.

    Raises:
        DamagedFileError: the object has no readable labels.
        RendererUnavailableError: no device here can render.
    """
    obj, labels = catalog.load(object_id), read_labels(object_id, label_root)
    samples = []
    for state in range(len(labels.fractions)):
        for view in range(config.views):
            rng = np.random.default_rng([config.seed, zlib.crc32(object_id.encode()), state, view])
            samples.append(_make_sample(obj, labels, state, config, rng))
    return samples


def _make_sample(
    obj: ArticulatedObject,
    labels: Labels,
    state: int,
    config: GenerationConfig,
    rng: np.random.Generator,
) -> Sample:
    q = obj.positions_with(MOVABLE_PART, float(labels.fractions[state]))
    for _ in range(20):
        T_world_object = random_placement(rng)
        view = ViewDistribution.around(obj).sample(rng, *config.camera_size)
        rgb, depth = _picture(obj, T_world_object, q, view, rng)
        part_mask, normals_world = _part_mask(obj, T_world_object, q, view, depth)
        points_camera = points_from_depth(depth, view.intrinsics)
        height = transforms.apply(view.T_world_camera, points_camera.reshape(-1, 3))[:, 2]
        kept = np.flatnonzero((part_mask.reshape(-1) > 0) & (height > config.clearance))
        if len(kept) >= config.min_points:
            break
    else:
        raise InvalidArgumentError(
            f"{obj.object_id}: 20 views in a row saw fewer than min_points={config.min_points} "
            f"points of it at camera_size={config.camera_size}; use a larger picture"
        )
    if len(kept) > config.max_points:
        kept = np.sort(rng.choice(kept, config.max_points, replace=False))
    points = points_camera.reshape(-1, 3)[kept]
    part = part_mask.reshape(-1)[kept] - 1
    T_camera_world = transforms.invert(view.T_world_camera)
    T_camera_parts = T_camera_world @ T_world_object @ obj.link_poses(q)
    points_part = np.einsum(
        "nij,nj->ni",
        transforms.invert(T_camera_parts)[part],
        np.concatenate([points, np.ones((len(points), 1))], axis=1),
    )[:, :3]
    normals_part = np.einsum(
        "nji,nj->ni",
        (T_world_object @ obj.link_poses(q))[part][:, :3, :3],
        normals_world.reshape(-1, 3)[kept],
    )
    grasp_row, affordance = _nearest_labels(labels, state, part, points_part, normals_part, config)
    boxes = [canonical_box(link.bounds()) for link in obj.links]
    centers, scales = np.stack([c for c, _ in boxes]), np.array([s for _, s in boxes])
    object_center, object_scale = canonical_box(obj.rest_bounds)
    # Link frames coincide with the object's at rest, so a part's point keeps its coordinates.
    T_object_rest_parts = obj.link_poses(obj.rest_positions)
    types, axes, pivots, fractions = _joints(obj, T_camera_world @ T_world_object, q)
    up_camera = T_camera_world[:3, 2]
    return Sample(
        object_id=obj.object_id,
        rgb=rgb,
        depth=depth,
        part_mask=part_mask,
        intrinsics=view.intrinsics.astype(np.float32),
        R_level_camera=level_from_camera(up_camera).astype(np.float32),
        points_camera=points.astype(np.float32),
        colors=rgb.reshape(-1, 3)[kept],
        part=part.astype(np.uint8),
        npcs=((points_part - centers[part]) / scales[part, None] + 0.5).astype(np.float32),
        naocs=((points_part - object_center) / object_scale + 0.5).astype(np.float32),
        affordance=affordance,
        grasp_row=grasp_row,
        grasp_bits=labels.bits[state],
        grasp_points_part=labels.points_part[state],
        grasp_normals_part=labels.normals_part[state],
        grasp_part=np.full(len(labels.bits[state]), MOVABLE_PART, dtype=np.uint8),
        T_camera_parts=T_camera_parts.astype(np.float32),
        part_centers=centers.astype(np.float32),
        part_scales=scales.astype(np.float32),
        T_camera_object=(T_camera_world @ T_world_object).astype(np.float32),
        T_object_rest_parts=T_object_rest_parts.astype(np.float32),
        object_center=object_center.astype(np.float32),
        object_scale=np.asarray(object_scale, dtype=np.float32),
        joint_type=types,
        joint_axis_camera=axes.astype(np.float32),
        joint_pivot_camera=pivots.astype(np.float32),
        open_fraction=fractions.astype(np.float32),
    )


def _picture(
    obj: ArticulatedObject,
    T_world_object: Array,
    q: Array,
    view: View,
    rng: np.random.Generator,
) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
    """RGB and depth of the object alone on a table, randomly lit."""
    table = random_table(rng)
    scene = ManipulationScene(
        obj, T_world_object, q, render_system=render_system(), table_material=table
    )
    add_lights(scene.sapien_scene, rng)
    picture = RenderedCamera(scene.sapien_scene, view).take()
    scene.close()
    return picture


def _part_mask(
    obj: ArticulatedObject, T_world_object: Array, q: Array, view: View, depth: Array
) -> tuple[NDArray[np.uint8], Array]:
    """Part index + 1 (h, w) and outward world normals (h, w, 3), by rays.

    A pixel whose depth in the picture differs by more than 5 mm lies on an edge: it stays 0.
    """
    bodies = [rays.link_body(link) for link in obj.links]
    poses = T_world_object @ obj.link_poses(q)
    directions = rays.camera_rays(view.intrinsics, view.width, view.height, view.T_world_camera)
    hits = rays.cast(bodies, poses, view.T_world_camera[:3, 3], directions)
    agrees = np.abs(hits.distance - depth.reshape(-1)) < 0.005
    on_object = (hits.body >= 0) & agrees
    normals = np.zeros((depth.size, 3))
    for i, (body, pose) in enumerate(zip(bodies, poses, strict=True)):
        here = on_object & (hits.body == i)
        normals[here] = transforms.rotate(pose, body.normals()[hits.triangle[here]])
    mask = np.where(on_object, hits.body + 1, 0).astype(np.uint8)
    return mask.reshape(depth.shape), normals.reshape(*depth.shape, 3)


def _nearest_labels(
    labels: Labels,
    state: int,
    part: NDArray[np.integer],
    points_part: Array,
    normals_part: Array,
    config: GenerationConfig,
) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
    """Row of the labelled point that speaks for each seen point, and its affordance.

    Points of parts that do not move offer nothing; where no label lies near, nothing is known.
    """
    rows = np.full(len(part), -1, dtype=np.int32)
    affordance = np.where(part == MOVABLE_PART, AFFORDANCE_UNKNOWN, AFFORDANCE_NO).astype(np.uint8)
    mine = np.flatnonzero(part == MOVABLE_PART)
    if not len(mine):
        return rows, affordance
    tree = cKDTree(labels.points_part[state])
    distance, near = tree.query(points_part[mine], k=6, distance_upper_bound=config.label_radius)
    near = np.minimum(near, len(labels.points_part[state]) - 1)
    facing = np.einsum("nkj,nj->nk", labels.normals_part[state][near], normals_part[mine])
    fits = np.isfinite(distance) & (facing > np.cos(config.label_angle))
    # Neighbours come nearest first: the first that fits speaks.
    best = np.argmax(fits, axis=1)
    found = fits[np.arange(len(mine)), best]
    rows[mine[found]] = near[np.arange(len(mine)), best][found]
    graspable = labels.success[state].any(axis=1)
    affordance[mine[found]] = np.where(graspable[rows[mine[found]]], AFFORDANCE_YES, AFFORDANCE_NO)
    return rows, affordance


def _joints(
    obj: ArticulatedObject, T_camera_object: Array, q: Array
) -> tuple[NDArray[np.int8], Array, Array, Array]:
    """Type (K,), axis (K, 3), pivot (K, 3) and open fraction (K,) of each part's joint."""
    num_parts = obj.num_parts
    types = np.full(num_parts, JOINT_NONE, dtype=np.int8)
    axes, pivots, fractions = (
        np.zeros((num_parts, 3)),
        np.zeros((num_parts, 3)),
        np.zeros(num_parts),
    )
    for k, joint in enumerate(obj.joints, start=1):
        types[k] = JOINT_PRISMATIC if joint.type == "prismatic" else JOINT_REVOLUTE
        axes[k] = T_camera_object[:3, :3] @ (np.asarray(joint.axis) * np.sign(joint.range))
        pivots[k] = transforms.apply(T_camera_object, np.asarray(joint.pivot)[None])[0]
        fractions[k] = joint.open_fraction(q[k - 1])
    return types, axes, pivots, fractions


def generate_split(
    category: str,
    split: catalog.Split,
    folder: Path,
    *,
    config: GenerationConfig = GenerationConfig(),
    label_root: Path | None = None,
    workers: int = 1,
    progress: bool = True,
) -> Manifest:
    """Makes one shard for each labelled object of a split; goes on where it stopped.

    Raises:
        InvalidArgumentError: no labels there, or the folder was made with another configuration.
        RendererUnavailableError: no device here can render.
    """
    ids: Sequence[str] = labelled_ids(category, split, label_root)
    if not ids:
        raise InvalidArgumentError(
            f"no labels for {category}/{split}: run `artgym annotate --category {category} "
            f"--split {split}` first"
        )
    tasks = [
        ShardTask(name=f"{i.replace('/', '_')}.h5", arguments=(i, config, label_root)) for i in ids
    ]
    return run_shards(
        tasks,
        _samples_task,
        folder,
        write=write_samples,
        config={"generation": asdict(config), "category": category, "split": split},
        workers=workers,
        progress=progress,
        description=f"samples {category}/{split}",
    )


def _samples_task(arguments: tuple[str, GenerationConfig, Path | None]) -> list[Sample]:
    return make_samples(*arguments)
