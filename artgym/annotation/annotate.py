"""Labels of an object: which of ~200 grasps succeed at surface points, in several joint states.

A label set is one file an object; it holds one bit a try, since the poses tried are a function of
the point's normal (``geometry.grasps``).
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from artgym.annotation.filter import FilterConfig, Verdict, judge
from artgym.annotation.trial import TrialConfig, try_grasp
from artgym.errors import InvalidArgumentError
from artgym.files import Manifest, read_arrays, write_arrays
from artgym.geometry import transforms
from artgym.geometry.grasps import NUM_CANDIDATES, candidate_rotations
from artgym.jobs import ShardTask, run_shards
from artgym.objects import catalog
from artgym.objects.meshes import link_triangles
from artgym.objects.model import ArticulatedObject
from artgym.sim import rays
from artgym.sim.camera import ViewDistribution
from artgym.sim.setting import MAX_YAW

Array = NDArray[np.floating]

#: The part whose grasps are labelled and that moves in the tasks of one-jointed objects.
MOVABLE_PART = 1

_SHIPPED_LABELS = Path(__file__).parent / "labels"


@dataclass(frozen=True, kw_only=True)
class AnnotationConfig:
    """What is tried at an object.

    Attributes:
        start_states: joint states drawn from the category's start interval.
        later_states: joint states drawn from beyond it, up to ``latest``.
        latest: largest open fraction of a later state.
        points: surface points a state.
        views: cameras from which the points are seen; what no camera sees is not labelled.
        yaw: largest turn of the object against the cameras, radians.
        filter: geometric filter.
        trial: how an attempt is made.
        seed: of the points and the states.
    """

    start_states: int = 2
    later_states: int = 1
    latest: float = 0.3
    points: int = 48
    views: int = 8
    yaw: float = MAX_YAW
    filter: FilterConfig = field(default_factory=FilterConfig)
    trial: TrialConfig = field(default_factory=TrialConfig)
    seed: int = 0

    @property
    def states(self) -> int:
        """Joint states an object."""
        return self.start_states + self.later_states


@dataclass(frozen=True, kw_only=True, eq=False)
class Labels:
    """What was found at an object: S joint states, G points each, C tries a point.

    Attributes:
        object_id: catalogue id.
        fractions: (S,) open fraction of the movable part.
        points_part: (S, G, 3) surface points in the part's frame, metres.
        normals_part: (S, G, 3) outward unit normals, same frame.
        bits: (S, G, C / 8) uint8, success of each try, little bit order.
        verdicts: (S, 3) how many tries the filter called possible, empty and in collision.
        ends: (S, 4) how many trials ended ``TRIAL_ENDS``.
    """

    object_id: str
    fractions: Array
    points_part: Array
    normals_part: Array
    bits: NDArray[np.uint8]
    verdicts: NDArray[np.int32]
    ends: NDArray[np.int32]

    @property
    def success(self) -> NDArray[np.bool_]:
        """(S, G, C): whether each try succeeded."""
        return np.unpackbits(self.bits, axis=-1, count=NUM_CANDIDATES, bitorder="little").astype(
            bool
        )


TRIAL_ENDS = ("moved", "not moved", "blocked", "empty")

_ARRAYS = ("fractions", "points_part", "normals_part", "bits", "verdicts", "ends")


def annotate(
    object_id: str, config: AnnotationConfig = AnnotationConfig()
) -> dict[str, NDArray[Any]]:
    """Labels one object; the arrays of ``Labels`` by name, a function of id and config alone."""
    obj = catalog.load(object_id)
    category = catalog.category_of(obj)
    rng = np.random.default_rng([config.seed, zlib.crc32(object_id.encode())])
    latest_start = category.start_fraction[1]
    fractions = [rng.uniform(*category.start_fraction) for _ in range(config.start_states)]
    fractions += [rng.uniform(latest_start, config.latest) for _ in range(config.later_states)]
    rows = [_annotate_state(obj, fraction, config, rng) for fraction in fractions]
    stacked = [np.stack(column) for column in zip(*rows, strict=True)]
    return dict(zip(_ARRAYS, [np.asarray(fractions), *stacked], strict=True))


def _annotate_state(
    obj: ArticulatedObject, fraction: float, config: AnnotationConfig, rng: np.random.Generator
) -> tuple[NDArray[Any], ...]:
    part = MOVABLE_PART
    q = obj.positions_with(part, fraction)
    points, normals = visible_points(obj, q, part, config.points, config.views, config.yaw, rng)
    if not len(points):
        raise InvalidArgumentError(
            f"{obj.object_id}: no camera sees {obj.links[part].name!r}, so that it has no labels"
        )
    R_grasps = candidate_rotations(normals)
    verdicts = judge(obj, q, part, points, R_grasps, config.filter)
    success = np.zeros(verdicts.shape, dtype=bool)
    ends: dict[str, int] = dict.fromkeys(TRIAL_ENDS, 0)
    for i, c in np.argwhere(verdicts == Verdict.POSSIBLE):
        T_object_grasp = transforms.transform_from(R_grasps[i, c], points[i])
        trial = try_grasp(obj, q, part, T_object_grasp, config.trial)
        success[i, c] = trial.success
        ends[trial.end] += 1
    T_part_object = transforms.invert(obj.link_poses(q)[part])
    return (
        transforms.apply(T_part_object, points).astype(np.float32),
        transforms.rotate(T_part_object, normals).astype(np.float32),
        np.packbits(success, axis=-1, bitorder="little"),
        np.bincount(verdicts.ravel(), minlength=len(Verdict)).astype(np.int32),
        np.array(list(ends.values()), dtype=np.int32),
    )


def visible_points(
    obj: ArticulatedObject,
    q: Array,
    part: int,
    count: int,
    views: int,
    yaw: float,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """Surface points (count, 3) of a part that cameras can see, and normals, object frame.

    Of a part that no camera sees there are none. Small shapes, handles above all, get more points
    than their area: a shape's share goes with the square root of the area seen.
    """
    width, height = 160, 120
    Ts_object_link = obj.link_poses(q)
    bodies = [rays.link_body(link) for link in obj.links]
    _, shape_index = link_triangles(obj.links[part])
    triangle_normals = transforms.rotate(Ts_object_link[part], bodies[part].normals())
    points, normals, shapes = [], [], []
    cameras = ViewDistribution.around(obj)
    for _ in range(views):
        view = cameras.sample(rng, width, height)
        turn = rng.uniform(-yaw, yaw)
        c, s = np.cos(turn), np.sin(turn)
        T_object_world = transforms.transform_from([[c, s, 0], [-s, c, 0], [0, 0, 1]], np.zeros(3))
        T_object_camera = T_object_world @ view.T_world_camera
        directions = rays.camera_rays(view.intrinsics, width, height, T_object_camera)
        eye = T_object_camera[:3, 3]
        hits = rays.cast(bodies, Ts_object_link, eye, directions)
        seen = hits.body == part
        points.append(eye + hits.distance[seen, None] * directions[seen])
        normals.append(triangle_normals[hits.triangle[seen]])
        shapes.append(shape_index[hits.triangle[seen]])
    shape = np.concatenate(shapes)
    if not len(shape):
        return np.empty((0, 3)), np.empty((0, 3))
    weight = 1.0 / np.sqrt(np.bincount(shape))[shape]
    # A part of which little is seen gives the same points more than once.
    chosen = rng.choice(len(shape), count, replace=len(shape) < count, p=weight / weight.sum())
    return np.concatenate(points)[chosen], np.concatenate(normals)[chosen]


def annotate_split(
    category: str,
    split: catalog.Split,
    count: int,
    *,
    root: Path | None = None,
    config: AnnotationConfig = AnnotationConfig(),
    workers: int = 1,
    progress: bool = True,
) -> Manifest:
    """Labels the first ``count`` objects of a split, one file each; goes on where it stopped.

    Raises:
        UnknownNameError: unknown category or split.
        InvalidArgumentError: the folder holds labels made with another configuration.
    """
    tasks = [
        ShardTask(name=label_file_name(object_id), arguments=(object_id, config))
        for object_id in catalog.object_ids(category, split, count)
    ]
    return run_shards(
        tasks,
        _annotate_task,
        labels_folder(category, split, root),
        config={"annotation": asdict(config)},
        write=write_arrays,
        workers=workers,
        progress=progress,
        description=f"labels {category}/{split}",
    )


def _annotate_task(arguments: tuple[str, AnnotationConfig]) -> dict[str, NDArray[Any]]:
    return annotate(*arguments)


def label_file_name(object_id: str) -> str:
    """Name of the file with an object's labels: "drawer_0012.h5"."""
    return object_id.replace("/", "_") + ".h5"


def labels_folder(category: str, split: str, root: Path | None = None) -> Path:
    """Where the label files of a category's split lie; the shipped ones by default."""
    return (root or _SHIPPED_LABELS) / category / split


def read_labels(object_id: str, root: Path | None = None) -> Labels:
    """The labels of an object.

    Raises:
        DamagedFileError: the file is missing or damaged.
    """
    category, _, _ = object_id.partition("/")
    folder = labels_folder(category, catalog.split_of(object_id), root)
    arrays, _ = read_arrays(folder / label_file_name(object_id))
    return Labels(object_id=object_id, **arrays)


def labelled_categories(root: Path | None = None) -> tuple[str, ...]:
    """Categories that have labels; shipped ones by default."""
    folder = root or _SHIPPED_LABELS
    return tuple(sorted(path.name for path in folder.iterdir() if path.is_dir()))


def labelled_ids(category: str, split: str, root: Path | None = None) -> Sequence[str]:
    """Ids of the objects of a split that have labels, sorted."""
    files = sorted(labels_folder(category, split, root).glob(f"{category}_*.h5"))
    return [f"{category}/{f.stem.removeprefix(category + '_')}" for f in files]
