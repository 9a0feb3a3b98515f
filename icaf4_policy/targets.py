"""What the network should say about a sample, worked out once, and batches of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from artgym.datasets.sample import (
    AFFORDANCE_NO,
    AFFORDANCE_UNKNOWN,
    AFFORDANCE_YES,
    JOINT_NONE,
    JOINT_REVOLUTE,
    Sample,
)
from artgym.errors import InvalidArgumentError
from artgym.geometry.rotations import grasp_angle
from artgym.geometry.transforms import invert, transform_from, translation
from icaf4_policy.anchors import AnchorFrame, Anchors
from icaf4_policy.cloud import choose_points, level_points
from icaf4_policy.features import DEFAULT_FEATURES, Features, point_inputs, require_colors
from icaf4_policy.naming import named_from_view


@dataclass(frozen=True, kw_only=True, eq=False)
class Targets:
    """One sample as the network sees it, kept small. M points, G labelled surface points.

    Attributes:
        category: index of the object's category.
        points_level: float32 (M, 3), metres, centred.
        colors: uint8 (M, C), what the network is given of each point, see ``features``.
        part: uint8 (M,).
        npcs: float16 (M, 3) and naocs: float16 (M, 3).
        affordance: uint8 (M,), codes of ``Sample.affordance``.
        grasp_row: int32 (M,), into the G labelled points, or -1.
        joint_type: uint8 (K,), code plus one; axis_level: float32 (K, 3), unit;
            pivot_level: float32 (K, 3), metres, centred like the points.
        match_start: int32 (G + 1,): the matches of labelled point g are
            ``match_start[g]:match_start[g + 1]`` of the next two.
        match_anchor: int16 (n,), matched anchors (the mask M of Eq. 3, sparse).
        match_residual: float16 (n, r), from the anchor to its nearest successful grasp (Eq. 4).
        tilt: radians, from the vertical to the z axis of the base's canonical box; infinite where
            not known.
    """

    category: int
    points_level: NDArray[np.float32]
    colors: NDArray[np.uint8]
    part: NDArray[np.uint8]
    npcs: NDArray[np.float16]
    naocs: NDArray[np.float16]
    affordance: NDArray[np.uint8]
    grasp_row: NDArray[np.int32]
    joint_type: NDArray[np.uint8]
    axis_level: NDArray[np.float32]
    pivot_level: NDArray[np.float32]
    match_start: NDArray[np.int32]
    match_anchor: NDArray[np.int16]
    match_residual: NDArray[np.float16]
    tilt: float = math.inf


def true_part_boxes(sample: Sample) -> NDArray[np.floating]:
    """``T_camera_box`` (K, 4, 4) of the parts' canonical boxes."""
    return sample.T_camera_parts @ _boxes(sample, sample.part_centers)


def true_object_boxes(sample: Sample) -> NDArray[np.floating]:
    """``T_camera_box`` (K, 4, 4) of the object's rest-state box as it moves with each part."""
    T_camera_rests = sample.T_camera_parts @ invert(sample.T_object_rest_parts)
    return T_camera_rests @ _boxes(sample, sample.object_center)


def _boxes(sample: Sample, centers: NDArray[np.floating]) -> NDArray[np.floating]:
    """Poses (..., 4, 4) of canonical boxes at rest by their centers (..., 3), object frame."""
    turn = transform_from(sample.R_object_canonical.astype(float), np.zeros(3))
    return turn @ translation(centers.astype(float))


def successful_grasps(
    sample: Sample, frame: AnchorFrame
) -> tuple[NDArray[np.int64], NDArray[np.floating]]:
    """All grasps of a sample that succeeded.

    Returns:
        The labelled point of each (n,), ascending, and ``R_frame_grasp`` (n, 3, 3).
    """
    row, attempt = np.nonzero(sample.successful_tries())
    R_camera_object = sample.T_camera_object[:3, :3].astype(float)
    if frame == "level":
        R_frame_object = sample.R_level_camera.astype(float) @ R_camera_object
    else:
        R_box_camera = np.swapaxes(true_part_boxes(sample)[:, :3, :3], -1, -2)
        R_frame_object = R_box_camera[sample.grasp_part[row]] @ R_camera_object
    points, which = np.unique(row, return_inverse=True)
    return row, R_frame_object @ sample.tried_rotations(points)[which, attempt]


def mean_angles(row: NDArray[np.int64], R_grasps: NDArray[np.floating]) -> NDArray[np.floating]:
    """Mean angle (n,) from each grasp (n, 3, 3) to the others of its point, ``row`` ascending."""
    angles = np.empty(len(row))
    if not len(row):
        return angles
    for group in np.split(np.arange(len(row)), np.flatnonzero(np.diff(row)) + 1):
        here = R_grasps[group]
        angles[group] = grasp_angle(here[:, None], here[None]).mean(axis=1)
    return angles


def grasp_matches(
    sample: Sample, anchors: Anchors
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.floating]]:
    """The matched anchors of every labelled point, one residual each (Eqs. 2 to 4).

    Of the grasps of one point that share an anchor, the nearest to it gives the residual; where
    one must speak for all ("direct"), it is the most central.

    Returns:
        The labelled point of each match (n,), ascending; its anchor (n,); its residual (n, r).
    """
    row, R_grasps = successful_grasps(sample, anchors.frame)
    matched, residual = anchors.match(R_grasps)
    if anchors.kind == "direct":
        rank = mean_angles(row, R_grasps)
    else:
        rank = np.sum(residual**2, axis=-1)
    order = np.lexsort((rank, matched, row))
    row, matched, residual = row[order], matched[order], residual[order]
    first = np.ones(len(row), dtype=bool)
    first[1:] = (np.diff(row) != 0) | (np.diff(matched) != 0)
    return row[first], matched[first], residual[first]


def targets_from_sample(
    sample: Sample,
    categories: Sequence[str],
    anchors: Anchors,
    max_points: int,
    features: Features = DEFAULT_FEATURES,
) -> Targets:
    """Works out the targets of a sample, named as ``naming.named_from_view`` has it.

    Args:
        sample: one view.
        categories: those that the network is for.
        anchors: what successful grasps are matched with.
        max_points: of a longer cloud, this many points are kept, evenly in their order.
        features: what the network is given of each point.

    Raises:
        InvalidArgumentError: the sample is of another category, or described otherwise.
    """
    sample = named_from_view(sample)
    category = sample.object_id.partition("/")[0]
    if category not in categories:
        raise InvalidArgumentError(
            f"a sample of {sample.object_id!r} among those of {', '.join(categories)}: train a "
            "network on the samples of its own categories."
        )
    require_colors(sample.colors, len(sample.points_camera), features)
    points_level, center_level = level_points(sample.points_camera, sample.R_level_camera)
    total = len(points_level)
    keep = slice(None)
    if total > max_points:
        keep = np.linspace(0, total - 1, max_points).round().astype(int)
    R_level_camera = sample.R_level_camera.astype(float)
    # Normals are kept in bytes: single precision is more than enough.
    normals_level = sample.normals_camera[keep].astype(np.float32) @ sample.R_level_camera.T

    row, matched, residual = grasp_matches(sample, anchors)
    up_canonical = R_level_camera[2] @ sample.T_camera_object[:3, :3] @ sample.R_object_canonical
    return Targets(
        category=list(categories).index(category),
        points_level=points_level[keep].astype(np.float32),
        colors=point_inputs(sample.colors[keep], normals_level, features),
        part=sample.part[keep],
        npcs=sample.npcs[keep].astype(np.float16),
        naocs=sample.naocs[keep].astype(np.float16),
        affordance=sample.affordance[keep],
        grasp_row=sample.grasp_row[keep].astype(np.int32),
        joint_type=(sample.joint_type - JOINT_NONE).astype(np.uint8),
        axis_level=(sample.joint_axis_camera @ R_level_camera.T).astype(np.float32),
        pivot_level=(sample.joint_pivot_camera @ R_level_camera.T - center_level).astype(
            np.float32
        ),
        match_start=np.searchsorted(row, np.arange(len(sample.grasp_part) + 1)).astype(np.int32),
        match_anchor=matched.astype(np.int16),
        match_residual=residual.astype(np.float16),
        tilt=math.acos(min(1.0, float(up_canonical[2]))),
    )


@dataclass(frozen=True, kw_only=True)
class GraspTargets:
    """What a grasp head should say at S points of each of B clouds.

    Attributes:
        grasp_weight: float32 (B, S): 1 at points with successful grasps, less at points known to
            have none, 0 at fillers.
        anchor_mask: float32 (B, S, L), the multi-hot mask of Eq. 3.
        match_index: int64 (n,), where the mask is one, counted through (B, S, L).
        match_residual: float32 (n, r), the residuals there.
    """

    grasp_weight: Tensor
    anchor_mask: Tensor
    match_index: Tensor
    match_residual: Tensor


@dataclass(frozen=True, kw_only=True)
class Batch(GraspTargets):
    """B clouds of N points with the targets of P of them; S of these carry grasp targets.

    Attributes:
        points_level: float32 (B, N, 3), metres, and colors: float32 (B, N, C) in [0, 1], what
            is given of each point beside it.
        category: int64 (B,).
        part: int64 (B, P), of the first P points, as all that follows.
        npcs: float32 (B, P, 3) and naocs: float32 (B, P, 3).
        affordance: int64 (B, P), 255 where unknown.
        joint_type: int64 (B, P), code plus one, of the joint that moves the point's part.
        joint_axis: float32 (B, P, 3), level frame, zeros without a joint.
        joint_offset: float32 (B, P, 3), metres, point to nearest axis point, zeros unless revolute.
        grasp_points: int64 (B, S).
    """

    points_level: Tensor
    colors: Tensor
    category: Tensor
    part: Tensor
    npcs: Tensor
    naocs: Tensor
    affordance: Tensor
    joint_type: Tensor
    joint_axis: Tensor
    joint_offset: Tensor
    grasp_points: Tensor

    def to(self, device: torch.device) -> Batch:
        """The same on a device."""
        return Batch(**{f.name: getattr(self, f.name).to(device) for f in fields(self)})


@dataclass(frozen=True, kw_only=True)
class DrawConfig:
    """How a batch is drawn from targets.

    Attributes:
        num_points: N.
        learn_points: P, the points of each cloud that are learnt, at most N: up to half those where
            grasps were tried or whose affordance is known all the same, in this order, and others;
            the rest are their surroundings. None for all.
        num_anchors: L.
        num_grasp_points: S.
        negative_share: share of S given to points where every try failed.
        negative_weight: their weight in the anchor loss.
        color_jitter: spread of random gain, offset and tint of the colours, the first three
            channels of what is given; 0 leaves them.
    """

    num_points: int
    num_anchors: int
    learn_points: int | None = None
    num_grasp_points: int = 384
    negative_share: float = 0.25
    negative_weight: float = 0.3
    color_jitter: float = 0.0


def _jittered(
    colors: NDArray[np.float32], strength: float, rng: np.random.Generator
) -> NDArray[np.float32]:
    gain = np.exp(strength * rng.normal()) * np.exp(0.5 * strength * rng.normal(size=3))
    shifted = (colors - 0.5) * gain + 0.5 + 0.5 * strength * rng.normal()
    gray_share = rng.uniform(0.0, 1.0) ** 2 if rng.uniform() < 0.5 else 0.0
    gray = shifted.mean(axis=-1, keepdims=True)
    return np.clip(shifted + gray_share * (gray - shifted), 0.0, 1.0).astype(np.float32)


#: What is drawn of one sample: the fields of ``Batch`` without B and ``anchor_mask``.
Item = dict[str, NDArray[Any]]


def draw_item(targets: Targets, config: DrawConfig, rng: np.random.Generator) -> Item:
    """A fresh choice of a sample's points, with all their targets."""
    pick = choose_points(len(targets.points_level), config.num_points, rng)
    if config.learn_points is not None and config.learn_points < len(pick):
        pick = _learnt_first(pick, targets, config.learn_points, rng)
    points = targets.points_level[pick]
    colors = targets.colors[pick].astype(np.float32) / 255.0
    if config.color_jitter > 0:
        colors[:, :3] = _jittered(colors[:, :3], config.color_jitter, rng)

    learnt = pick[: config.learn_points]
    part = targets.part[learnt]
    joint_type = targets.joint_type[part]
    axis = targets.axis_level[part]
    to_pivot = targets.pivot_level[part] - points[: len(learnt)]
    offset = to_pivot - np.sum(to_pivot * axis, axis=-1, keepdims=True) * axis
    offset[joint_type != JOINT_REVOLUTE - JOINT_NONE] = 0.0

    affordance, row = targets.affordance[learnt], targets.grasp_row[learnt]
    good = rng.permutation(np.flatnonzero((affordance == AFFORDANCE_YES) & (row >= 0)))
    bad = rng.permutation(np.flatnonzero((affordance == AFFORDANCE_NO) & (row >= 0)))
    bad = bad[: int(config.negative_share * config.num_grasp_points)]
    good = good[: config.num_grasp_points - len(bad)]
    known = np.concatenate([good, bad])
    grasp_points = np.zeros(config.num_grasp_points, np.int64)
    grasp_points[: len(known)] = known
    weight = np.zeros(config.num_grasp_points, np.float32)
    weight[: len(good)] = 1.0
    weight[len(good) : len(known)] = config.negative_weight

    start, stop = targets.match_start[row[good]], targets.match_start[row[good] + 1]
    lengths = stop - start
    slot = np.repeat(np.arange(len(good)), lengths)
    within = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    match = np.repeat(start, lengths) + within
    index = slot * config.num_anchors + targets.match_anchor[match]
    return {
        "points_level": points,
        "colors": colors,
        "category": np.array(targets.category, dtype=np.int64),
        "part": part.astype(np.int64),
        "npcs": targets.npcs[learnt].astype(np.float32),
        "naocs": targets.naocs[learnt].astype(np.float32),
        "affordance": affordance.astype(np.int64),
        "joint_type": joint_type.astype(np.int64),
        "joint_axis": axis,
        "joint_offset": offset,
        "grasp_points": grasp_points,
        "grasp_weight": weight,
        "match_index": index.astype(np.int64),
        "match_residual": targets.match_residual[match].astype(np.float32),
    }


def _learnt_first(
    pick: NDArray[np.int64], targets: Targets, count: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """The same points, those to be learnt first; see ``DrawConfig.learn_points``."""
    shuffled = rng.permutation(pick)
    tried = targets.grasp_row[shuffled] >= 0
    known = targets.affordance[shuffled] != AFFORDANCE_UNKNOWN
    # Few points of a movable part were tried, and all of the base are known to offer nothing.
    first = np.concatenate([np.flatnonzero(tried), np.flatnonzero(known & ~tried)])[: count // 2]
    return np.concatenate([shuffled[first], np.delete(shuffled, first)])


#: What of an item is about its grasps: the fields of ``GraspTargets`` without ``anchor_mask``.
GRASP_FIELDS = ("grasp_weight", "match_index", "match_residual")


def collate_grasps(items: Sequence[Item], config: DrawConfig) -> GraspTargets:
    """The grasps' targets of drawn items, of which only ``GRASP_FIELDS`` are read."""
    cells = config.num_grasp_points * config.num_anchors
    index = np.concatenate([item["match_index"] + b * cells for b, item in enumerate(items)])
    residual = np.concatenate([item["match_residual"] for item in items])
    mask = np.zeros((len(items), config.num_grasp_points, config.num_anchors), np.float32)
    mask.reshape(-1)[index] = 1.0
    return GraspTargets(
        grasp_weight=torch.from_numpy(np.stack([item["grasp_weight"] for item in items])),
        anchor_mask=torch.from_numpy(mask),
        match_index=torch.from_numpy(index),
        match_residual=torch.from_numpy(residual),
    )


def collate_items(items: Sequence[Item], config: DrawConfig) -> Batch:
    """A batch of drawn items."""
    stacked = {
        name: torch.from_numpy(np.stack([item[name] for item in items]))
        for name in items[0]
        if name not in GRASP_FIELDS
    }
    return Batch(**stacked, **vars(collate_grasps(items, config)))
