"""Makes labelled RGB-D pictures: of one object, or of several on one table.

``artimage`` and ``reartmix`` are sets like the paper's ArtImage and ReArtMix (Section 5.1). Objects
stand in the joint states in which they were labelled, so that every picture has grasps; others can
be pictured without.
"""

from __future__ import annotations

import functools
import math
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]

from artgym.annotation.annotate import (
    is_labelled,
    joint_states,
    labelled_ids,
    positions_at,
    read_labels,
)
from artgym.annotation.filter import FilterConfig, Verdict, judge
from artgym.datasets.depth_noise import sensed_depth
from artgym.datasets.picture_files import PICTURES_VERSION, write_pictures
from artgym.datasets.sample import (
    AFFORDANCE_NO,
    AFFORDANCE_UNKNOWN,
    AFFORDANCE_YES,
    JOINT_NONE,
    JOINT_PRISMATIC,
    JOINT_REVOLUTE,
    Picture,
    Sample,
    level_from_camera,
)
from artgym.datasets.sets import SETS
from artgym.errors import InvalidArgumentError
from artgym.files import Manifest
from artgym.geometry import transforms
from artgym.geometry.camera import points_from_depth
from artgym.geometry.grasps import NUM_APPROACHES, NUM_CANDIDATES, NUM_ROLLS
from artgym.geometry.normals import surface_normals
from artgym.jobs import ShardTask, run_shards
from artgym.objects import catalog
from artgym.objects.model import ArticulatedObject, canonical_box
from artgym.sim import rays
from artgym.sim.camera import RenderedCamera, View, ViewDistribution
from artgym.sim.renderer import render_system
from artgym.sim.scene import ManipulationScene, PlacedObject
from artgym.sim.setting import add_clutter, add_lights, random_placement, random_table
from artgym.sim.tabletop import fits_among_others, footprint, random_place

Array = NDArray[np.floating]

#: Fewest and most objects of a scene, and how far from the table's middle they stand, metres.
_SCENE_OBJECTS, _SCENE_HALF_SIDE = (3, 5), 0.33
#: A scene's pictures are small parts of a shard.
_SCENES_A_SHARD = 16
#: Tries to draw a picture that shows enough of every object, and a place for one more object.
_TRIES = 40
#: Between the surface points that tell whether a hand is near anything, metres.
_MARGIN_SPACING = 0.004
#: A pixel whose depth differs by more from what a ray meets lies on an edge, metres.
_EDGE = 0.005


@dataclass(frozen=True, kw_only=True)
class GenerationConfig:
    """What is pictured and kept.

    Attributes:
        views: pictures of each labelled joint state of a single object.
        plain_views: pictures of each joint state of an object without labels.
        camera_size: (width, height), pixels.
        max_points: object points kept of a picture.
        min_points: a picture with fewer is drawn again.
        min_scene_points: the same for each object of a scene.
        clearance: points nearer to the table are left out, metres.
        label_radius: a labelled point farther from a seen one says nothing of it, metres.
        label_angle: nor does one whose normal differs by more, radians.
        label_margin: a success is carried to the points around only if the open hand, grown by
            this, touches nothing, metres, and if the rolls on either side of it succeed too: a
            grasp at its brink fails a few millimetres beside.
        brink_grasps: whether a part with successes of that kind alone is told them all the same, at
            each point the steady ones if there are any. Else its points count as unknown: labels
            are surer, and what can be grasped at the brink alone, as a knob close to its case,
            seems to offer nothing.
        depth_noise: whether depth has the errors of a real sensor (``datasets.depth_noise``).
        seed: of views, lights and placements.
    """

    views: int = 8
    plain_views: int = 1
    camera_size: tuple[int, int] = (640, 480)
    max_points: int = 4096
    min_points: int = 600
    min_scene_points: int = 150
    clearance: float = 0.004
    label_radius: float = 0.003
    label_angle: float = 0.7
    label_margin: float = 0.003
    brink_grasps: bool = False
    depth_noise: bool = False
    seed: int = 0

    def __post_init__(self) -> None:
        counts = {"camera_size": min(self.camera_size), "seed": self.seed + 1}
        for name in ("views", "plain_views", "max_points", "min_points", "min_scene_points"):
            counts[name] = getattr(self, name)
        for name, count in counts.items():
            if count < 1:
                least = 0 if name == "seed" else 1
                raise InvalidArgumentError(
                    f"{name}={getattr(self, name)}: expected {least} or more."
                )
        for name in ("clearance", "label_radius", "label_angle", "label_margin"):
            if not 0 <= getattr(self, name) < np.inf:
                raise InvalidArgumentError(
                    f"{name}={getattr(self, name)}: expected 0 or more, and finite."
                )


@dataclass(frozen=True, kw_only=True, eq=False)
class _CarriedLabels:
    """What the labels of one joint state say to the points around. G labelled points.

    Attributes:
        points_part, normals_part: (G, 3), as in ``Labels``.
        part: (G,), as in ``Labels``.
        bits: (G, C / 8) uint8, the successes that are not at their brink.
        affordance: (G,) what the seen points around are told.
    """

    points_part: Array
    normals_part: Array
    part: NDArray[np.uint8]
    bits: NDArray[np.uint8]
    affordance: NDArray[np.uint8]


#: Of an object without labels.
_NO_LABELS = _CarriedLabels(
    points_part=np.zeros((0, 3), dtype=np.float32),
    normals_part=np.zeros((0, 3), dtype=np.float32),
    part=np.zeros(0, dtype=np.uint8),
    bits=np.zeros((0, math.ceil(NUM_CANDIDATES / 8)), dtype=np.uint8),
    affordance=np.zeros(0, dtype=np.uint8),
)


@functools.lru_cache(maxsize=512)
def _states(object_id: str, label_root: Path | None) -> Array:
    """Open fractions (S, K - 1) of the states an object is pictured in: the labelled ones, if any.

    Without labels, they are those that would be labelled.
    """
    if is_labelled(object_id, label_root):
        return read_labels(object_id, label_root).fractions
    return joint_states(object_id)


@functools.lru_cache(maxsize=512)
def _carried_labels(
    object_id: str, state: int, config: GenerationConfig, label_root: Path | None
) -> _CarriedLabels:
    if not is_labelled(object_id, label_root):
        return _NO_LABELS
    obj, labels = catalog.load(object_id), read_labels(object_id, label_root)
    rows = np.flatnonzero(labels.state == state)
    success = labels.success[rows]
    carried = np.zeros_like(success)
    strict = FilterConfig(spacing=_MARGIN_SPACING, penetration=-config.label_margin)
    rolls = success.reshape(len(rows), NUM_APPROACHES, NUM_ROLLS)
    # The last roll and the first are neighbours: half a turn is the same grasp.
    beside = np.roll(rolls, 1, axis=2) & np.roll(rolls, -1, axis=2)
    steady = success & beside.reshape(success.shape)
    for i, row in enumerate(rows):
        tried = np.flatnonzero(steady[i])
        if len(tried):
            q, poses = labels.tries(obj, int(row))
            point, R = poses[:1, :3, 3], poses[None, tried, :3, :3]
            verdicts = judge(obj, q, int(labels.part[row]), point, R, strict)
            carried[i, tried] = verdicts[0] == Verdict.POSSIBLE
    if config.brink_grasps:
        brink = np.where(steady.any(axis=1, keepdims=True), steady, success)
        for part in np.unique(labels.part[rows]):
            here = labels.part[rows] == part
            if not carried[here].any():
                carried[here] = brink[here]
    affordance = np.where(success.any(axis=1), AFFORDANCE_UNKNOWN, AFFORDANCE_NO)
    return _CarriedLabels(
        points_part=labels.points_part[rows],
        normals_part=labels.normals_part[rows],
        part=labels.part[rows],
        bits=np.packbits(carried, axis=-1, bitorder="little"),
        affordance=np.where(carried.any(axis=1), AFFORDANCE_YES, affordance).astype(np.uint8),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class _LabelledObject:
    """An object in a joint state, somewhere in the world, and what its labels say there."""

    model: ArticulatedObject
    fractions: Array
    labels: _CarriedLabels
    T_world_object: Array

    @functools.cached_property
    def placed(self) -> PlacedObject:
        q = positions_at(self.model, self.fractions)
        return PlacedObject(model=self.model, T_world_object=self.T_world_object, q=q)

    @functools.cached_property
    def Ts_world_part(self) -> Array:
        return self.T_world_object @ self.model.link_poses(self.placed.q)


def _labelled_object(
    object_id: str,
    state: int,
    T_world_object: Array,
    config: GenerationConfig,
    label_root: Path | None,
) -> _LabelledObject:
    return _LabelledObject(
        model=catalog.load(object_id),
        fractions=_states(object_id, label_root)[state],
        labels=_carried_labels(object_id, state, config, label_root),
        T_world_object=T_world_object,
    )


# --- Pictures of one object ----------------------------------------------------------------------


def make_pictures(
    object_id: str, config: GenerationConfig = GenerationConfig(), label_root: Path | None = None
) -> list[Picture]:
    """All pictures of one object, a function of id, labels and config alone.

    Raises:
        DamagedFileError: the object's labels cannot be read.
        InvalidArgumentError: the pictures are too small to show enough of it.
        RendererUnavailableError: no device here can render.
    """
    views = config.views if is_labelled(object_id, label_root) else config.plain_views
    return [
        _object_picture(object_id, state, view, config, label_root)
        for state in range(len(_states(object_id, label_root)))
        for view in range(views)
    ]


def _object_picture(
    object_id: str, state: int, view: int, config: GenerationConfig, label_root: Path | None
) -> Picture:
    rng = np.random.default_rng([config.seed, zlib.crc32(object_id.encode()), state, view])
    for _ in range(_TRIES):
        shown = _labelled_object(object_id, state, random_placement(rng), config, label_root)
        camera = ViewDistribution.around(shown.model).sample(rng, *config.camera_size)
        picture = _picture([shown], camera, config, config.min_points, rng, clutter=False)
        if picture is not None:
            return picture
    raise InvalidArgumentError(
        f"{object_id}: {_TRIES} views in a row saw fewer than min_points={config.min_points} "
        f"points of it at camera_size={config.camera_size}; use a larger picture"
    )


# --- Pictures of several objects -----------------------------------------------------------------


def make_scenes(
    ids: Sequence[str],
    first: int,
    count: int,
    config: GenerationConfig = GenerationConfig(),
    label_root: Path | None = None,
) -> list[Picture]:
    """Scenes ``first`` to ``first + count - 1`` of a set whose objects are drawn from ``ids``.

    Raises:
        DamagedFileError: the labels of an object cannot be read.
        InvalidArgumentError: no scene could be drawn that shows enough of every object.
        RendererUnavailableError: no device here can render.
    """
    return [_scene_picture(ids, first + i, config, label_root) for i in range(count)]


def _scene_picture(
    ids: Sequence[str], number: int, config: GenerationConfig, label_root: Path | None
) -> Picture:
    rng = np.random.default_rng([config.seed, zlib.crc32(b"scene"), number])
    by_category: dict[str, list[str]] = {}
    for object_id in ids:
        by_category.setdefault(object_id.partition("/")[0], []).append(object_id)
    for _ in range(_TRIES):
        shown = list(_drawn_objects(by_category, config, label_root, rng))
        camera = ViewDistribution().sample(rng, *config.camera_size)
        picture = _picture(shown, camera, config, config.min_scene_points, rng, clutter=True)
        if picture is not None:
            return picture
    raise InvalidArgumentError(
        f"scene {number}: {_TRIES} views in a row saw fewer than "
        f"min_scene_points={config.min_scene_points} points of some object at "
        f"camera_size={config.camera_size}; use a larger picture"
    )


def _drawn_objects(
    by_category: Mapping[str, Sequence[str]],
    config: GenerationConfig,
    label_root: Path | None,
    rng: np.random.Generator,
) -> Iterator[_LabelledObject]:
    """Objects of a scene, clear of one another, each in one of its labelled states."""
    fewest, most = _SCENE_OBJECTS
    count, categories = int(rng.integers(fewest, most + 1)), sorted(by_category)
    taken = []
    for _ in range(_TRIES):
        if len(taken) == count:
            return
        object_id = str(rng.choice(by_category[str(rng.choice(categories))]))
        states = len(_states(object_id, label_root))
        shown = _labelled_object(
            object_id,
            int(rng.integers(states)),
            random_place(rng, _SCENE_HALF_SIDE),
            config,
            label_root,
        )
        place = footprint(shown.placed, swept=False)
        if fits_among_others(shown.model) and place.is_free(taken):
            taken.append(place)
            yield shown


# --- A picture and what is known of it -----------------------------------------------------------


def _picture(
    shown: Sequence[_LabelledObject],
    camera: View,
    config: GenerationConfig,
    min_points: int,
    rng: np.random.Generator,
    *,
    clutter: bool,
) -> Picture | None:
    """A picture of objects on a table, randomly lit; None if one shows too few points."""
    if not shown:
        return None
    rgb, depth, body = _rendered(shown, camera, rng, clutter=clutter)
    instance_mask, part_mask = (np.zeros(depth.shape, dtype=np.uint8) for _ in range(2))
    first = 0
    for index, each in enumerate(shown):
        here = (body >= first) & (body < first + each.model.num_parts)
        instance_mask[here] = index + 1
        part_mask[here] = (body[here] - first + 1).astype(np.uint8)
        first += each.model.num_parts
    sensed = sensed_depth(depth, camera.intrinsics, rng) if config.depth_noise else depth
    samples = []
    for index, each in enumerate(shown):
        mine = np.where(instance_mask == index + 1, part_mask, 0).astype(np.uint8)
        sample = _sample(each, camera, rgb, depth, sensed, mine, config, rng)
        if len(sample.points_camera) < min_points:
            return None
        samples.append(sample)
    return Picture(
        rgb=rgb,
        depth=sensed,
        instance_mask=instance_mask,
        part_mask=part_mask,
        intrinsics=camera.intrinsics.astype(np.float32),
        samples=tuple(samples),
    )


def _rendered(
    shown: Sequence[_LabelledObject], camera: View, rng: np.random.Generator, *, clutter: bool
) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.int32]]:
    """RGB, depth and body map, see ``sim.masks``."""
    first, *others = [each.placed for each in shown]
    scene = ManipulationScene(
        first.model,
        first.T_world_object,
        first.q,
        render_system=render_system(),
        table_material=random_table(rng),
        others=others,
    )
    add_lights(scene.sapien_scene, rng)
    if clutter:
        taken = [footprint(each.placed, swept=False) for each in shown]
        add_clutter(scene.sapien_scene, rng, taken)
    picture = RenderedCamera(scene.sapien_scene, camera).take_with_bodies(scene.links())
    scene.close()
    return picture


def _sample(
    shown: _LabelledObject,
    camera: View,
    rgb: NDArray[np.uint8],
    depth: NDArray[np.float32],
    sensed: NDArray[np.float32],
    part_mask: NDArray[np.uint8],
    config: GenerationConfig,
    rng: np.random.Generator,
) -> Sample:
    """What is known of one object, its parts' pixels being given."""
    obj, labels = shown.model, shown.labels
    T_camera_world = transforms.invert(camera.T_world_camera)
    T_camera_object = T_camera_world @ shown.T_world_object
    T_camera_parts = T_camera_world @ shown.Ts_world_part
    # The true points carry the labels; what the sensor says of them is what is kept.
    points_true = points_from_depth(depth, camera.intrinsics).reshape(-1, 3)
    kept = np.flatnonzero((part_mask.reshape(-1) > 0) & (sensed.reshape(-1) > 0))
    height = transforms.apply(camera.T_world_camera, points_true[kept])[:, 2]
    kept = kept[height > config.clearance]
    if len(kept) > config.max_points:
        kept = np.sort(rng.choice(kept, config.max_points, replace=False))
    kept, part, normals_part = _on_the_surface(shown, camera, depth, part_mask, kept)
    points_part = np.einsum(
        "nij,nj->ni",
        transforms.invert(T_camera_parts)[part],
        np.concatenate([points_true[kept], np.ones((len(kept), 1))], axis=1),
    )[:, :3]
    grasp_row, affordance = _nearest_labels(labels, part, points_part, normals_part, config)
    boxes = [canonical_box(bounds) for bounds in obj.canonical_bounds]
    centers, scales = np.stack([c for c, _ in boxes]), np.array([s for _, s in boxes])
    low, high = np.swapaxes(obj.canonical_bounds, 0, 1)
    object_center, object_scale = canonical_box(np.stack([low.min(axis=0), high.max(axis=0)]))
    R_object_canonical = np.asarray(obj.R_object_canonical, dtype=float)
    points_canonical = points_part @ R_object_canonical
    types, axes, pivots, fractions = _joints(obj, T_camera_object, shown.placed.q)
    points_camera = points_from_depth(sensed, camera.intrinsics).reshape(-1, 3)[kept]
    return Sample(
        object_id=obj.object_id,
        box=_box(part_mask),
        R_level_camera=level_from_camera(T_camera_world[:3, 2]).astype(np.float32),
        points_camera=points_camera.astype(np.float32),
        normals_camera=_normals(points_camera),
        colors=rgb.reshape(-1, 3)[kept],
        part=part.astype(np.uint8),
        npcs=((points_canonical - centers[part]) / scales[part, None] + 0.5).astype(np.float32),
        # Link frames coincide with the object's at rest: a part's point keeps its coordinates.
        naocs=((points_canonical - object_center) / object_scale + 0.5).astype(np.float32),
        affordance=affordance,
        grasp_row=grasp_row,
        grasp_bits=labels.bits,
        grasp_points_part=labels.points_part,
        grasp_normals_part=labels.normals_part,
        grasp_part=labels.part,
        T_camera_parts=T_camera_parts.astype(np.float32),
        R_object_canonical=R_object_canonical.astype(np.float32),
        part_centers=centers.astype(np.float32),
        part_scales=scales.astype(np.float32),
        T_camera_object=T_camera_object.astype(np.float32),
        T_object_rest_parts=obj.link_poses(obj.rest_positions).astype(np.float32),
        object_center=object_center.astype(np.float32),
        object_scale=np.asarray(object_scale, dtype=np.float32),
        joint_type=types,
        joint_axis_camera=axes.astype(np.float32),
        joint_pivot_camera=pivots.astype(np.float32),
        open_fraction=fractions.astype(np.float32),
    )


def _normals(points_camera: Array) -> NDArray[np.float16]:
    """Unit normals (n, 3) of the surface that points (n, 3) lie on, towards the camera."""
    if not len(points_camera):
        return np.empty((0, 3), np.float16)
    at = np.arange(len(points_camera))
    return surface_normals(points_camera, at, np.zeros(3)).astype(np.float16)


def _on_the_surface(
    shown: _LabelledObject,
    camera: View,
    depth: NDArray[np.float32],
    part_mask: NDArray[np.uint8],
    kept: NDArray[np.integer],
) -> tuple[NDArray[np.integer], NDArray[np.integer], Array]:
    """Those of the pixels that a ray confirms, their parts, and normals (n, 3) in part frames."""
    bodies = [rays.link_body(link) for link in shown.model.links]
    poses = shown.Ts_world_part
    directions = rays.camera_rays(
        camera.intrinsics, camera.width, camera.height, camera.T_world_camera
    )[kept]
    hits = rays.cast(bodies, poses, camera.T_world_camera[:3, 3], directions, table=False)
    part = part_mask.reshape(-1)[kept].astype(int) - 1
    agrees = (hits.body == part) & (np.abs(hits.distance - depth.reshape(-1)[kept]) < _EDGE)
    normals_part = np.zeros((len(kept), 3))
    for i, body in enumerate(bodies):
        here = agrees & (part == i)
        normals_part[here] = body.normals()[hits.triangle[here]]
    return kept[agrees], part[agrees], normals_part[agrees]


def _box(part_mask: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Left, top, width and height of what is not 0, in whole pixels; zeros where all is."""
    rows, columns = (np.flatnonzero(part_mask.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return np.zeros(4, dtype=np.float32)
    left, top = columns[0], rows[0]
    return np.array([left, top, columns[-1] + 1 - left, rows[-1] + 1 - top], dtype=np.float32)


def _nearest_labels(
    labels: _CarriedLabels,
    part: NDArray[np.integer],
    points_part: Array,
    normals_part: Array,
    config: GenerationConfig,
) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
    """Which labelled point speaks for each seen point, and its affordance.

    The base offers nothing; where no label of the same part lies near, nothing is known.
    """
    row = np.full(len(part), -1, dtype=np.int32)
    affordance = np.where(part == 0, AFFORDANCE_NO, AFFORDANCE_UNKNOWN).astype(np.uint8)
    for each in np.unique(labels.part):
        theirs, mine = np.flatnonzero(labels.part == each), np.flatnonzero(part == each)
        if not len(mine):
            continue
        tree = cKDTree(labels.points_part[theirs])
        distance, near = tree.query(
            points_part[mine], k=6, distance_upper_bound=config.label_radius
        )
        near = theirs[np.minimum(near, len(theirs) - 1)]
        facing = np.einsum("nkj,nj->nk", labels.normals_part[near], normals_part[mine])
        fits = np.isfinite(distance) & (facing > np.cos(config.label_angle))
        # Neighbours come nearest first: the first that fits speaks.
        best = np.argmax(fits, axis=1)
        found = fits[np.arange(len(mine)), best]
        row[mine[found]] = near[np.arange(len(mine)), best][found]
    known = row >= 0
    affordance[known] = labels.affordance[row[known]]
    return row, affordance


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


# --- Whole sets ----------------------------------------------------------------------------------


def generate_artimage(
    category: str,
    split: catalog.Split,
    folder: Path,
    *,
    objects: int | None = None,
    config: GenerationConfig = GenerationConfig(),
    label_root: Path | None = None,
    workers: int = 1,
    backend: str = "loky",
    progress: bool = True,
) -> Manifest:
    """Makes one shard for each object of a split; goes on where it stopped.

    Pictured are the labelled objects and, if there are less than ``objects``, as many of the first
    ones without labels: parts, poses and joints can be learnt from these too.

    Raises:
        InvalidArgumentError: no labels there, or the folder was made with another configuration.
        RendererUnavailableError: no device here can render.
    """
    tasks = [
        ShardTask(name=f"{i.replace('/', '_')}.h5", arguments=(i, config, label_root))
        for i in pictured_ids(category, split, objects, label_root)
    ]
    return run_shards(
        tasks,
        _pictures_task,
        folder,
        write=write_pictures,
        config={
            "generation": asdict(config),
            "pictures_version": PICTURES_VERSION,
            "category": category,
            "split": split,
        },
        workers=workers,
        backend=backend,
        progress=progress,
        description=f"artimage {category}/{split}",
    )


def generate_reartmix(
    split: catalog.Split,
    folder: Path,
    scenes: int,
    *,
    objects: int | None = None,
    config: GenerationConfig = GenerationConfig(),
    categories: Sequence[str] = SETS["reartmix"],
    label_root: Path | None = None,
    workers: int = 1,
    backend: str = "loky",
    progress: bool = True,
) -> Manifest:
    """Makes shards of scenes with the objects of a split; goes on where it stopped.

    They are those of ``generate_artimage``, of each category.

    Raises:
        InvalidArgumentError: no labels there, or the folder was made with another configuration.
        RendererUnavailableError: no device here can render.
    """
    ids = [i for category in categories for i in pictured_ids(category, split, objects, label_root)]
    tasks = [
        ShardTask(
            name=f"scenes_{first:06d}.h5",
            arguments=(ids, first, min(_SCENES_A_SHARD, scenes - first), config, label_root),
        )
        for first in range(0, scenes, _SCENES_A_SHARD)
    ]
    return run_shards(
        tasks,
        _scenes_task,
        folder,
        write=write_pictures,
        config={
            "generation": asdict(config),
            "pictures_version": PICTURES_VERSION,
            "categories": list(categories),
            "objects": ids,
            "split": split,
        },
        workers=workers,
        backend=backend,
        progress=progress,
        description=f"reartmix {split}",
    )


def pictured_ids(
    category: str, split: catalog.Split, objects: int | None, label_root: Path | None
) -> Sequence[str]:
    """Ids of the objects of a split that are pictured, at least one.

    Args:
        category: of the objects.
        split: theirs.
        objects: how many at least; None for the labelled ones.
        label_root: folder with {category}/{split}, instead of the shipped labels.

    Raises:
        InvalidArgumentError: no labels there, or not as many objects.
    """
    labelled = labelled_ids(category, split, label_root)
    if objects is None:
        if not labelled:
            raise InvalidArgumentError(
                f"no labels for {category}/{split}: run `artgym annotate --category {category} "
                f"--split {split}` first, or say how many objects to picture without"
            )
        return labelled
    if objects < 1:
        raise InvalidArgumentError(f"objects={objects}: expected 1 or more.")
    first = catalog.object_ids(category, split, objects)
    others = [object_id for object_id in first if object_id not in set(labelled)]
    return [*labelled, *others[: max(0, objects - len(labelled))]]


def _pictures_task(arguments: tuple[str, GenerationConfig, Path | None]) -> list[Picture]:
    return make_pictures(*arguments)


def _scenes_task(
    arguments: tuple[Sequence[str], int, int, GenerationConfig, Path | None],
) -> list[Picture]:
    return make_scenes(*arguments)
