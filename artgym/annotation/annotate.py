"""Labels of an object: which of 200 grasps succeed at surface points, in several joint states.

A label set is one file an object; it holds one bit a try, since the poses tried are a function of
the point's normal (``geometry.grasps``).
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from artgym.annotation.filter import FilterConfig, Verdict, judge
from artgym.annotation.trial import TRIAL_ENDS, TrialConfig, try_grasp
from artgym.errors import DamagedFileError, InvalidArgumentError
from artgym.files import Manifest, read_arrays, write_arrays
from artgym.geometry import transforms
from artgym.geometry.grasps import NUM_CANDIDATES, candidates_of_part
from artgym.jobs import ShardTask, run_shards
from artgym.objects import catalog
from artgym.objects.meshes import link_triangles
from artgym.objects.model import ArticulatedObject
from artgym.sim import rays
from artgym.sim.camera import ViewDistribution
from artgym.sim.setting import MAX_YAW

Array = NDArray[np.floating]

_SHIPPED_LABELS = Path(__file__).parent / "labels"


@dataclass(frozen=True, kw_only=True)
class AnnotationConfig:
    """What is tried at an object.

    Attributes:
        start_states: joint states as an opening episode begins: every part's open fraction is
            drawn from the category's start interval.
        open_states: joint states in which every part's open fraction is drawn from all of [0, 1].
        least_points: surface points a state, taken from the movable parts in turn.
        most_points: of each part.
        trials: once so many grasps of a state were tried in physics, no further point is begun.
        views: cameras from which the points are seen; what no camera sees is not labelled.
        yaw: largest turn of the object against the cameras, radians.
        filter: geometric filter.
        trial: how an attempt is made.
        seed: of the points and the states.
    """

    start_states: int = 2
    open_states: int = 2
    least_points: int = 6
    most_points: int = 32
    trials: int = 400
    views: int = 8
    yaw: float = MAX_YAW
    filter: FilterConfig = field(default_factory=FilterConfig)
    trial: TrialConfig = field(default_factory=TrialConfig)
    seed: int = 0


@dataclass(frozen=True, kw_only=True, eq=False)
class Labels:
    """What was found at an object: S joint states, N points in all, C tries a point.

    Attributes:
        object_id: catalogue id.
        fractions: (S, K - 1) open fraction of each movable part.
        state: (N,) the joint state that a point was tried in, ascending.
        part: (N,) index of the part that a point lies on and that was moved.
        points_part: (N, 3) surface points in their part's frame, metres.
        normals_part: (N, 3) outward unit normals, same frame.
        bits: (N, C / 8) uint8, success of each try, little bit order.
        verdicts: (S, 3) how many tries the filter called possible, empty and in collision.
        ends: (S, 5) how many trials ended ``TRIAL_ENDS``.
    """

    object_id: str
    fractions: Array
    state: NDArray[np.uint8]
    part: NDArray[np.uint8]
    points_part: Array
    normals_part: Array
    bits: NDArray[np.uint8]
    verdicts: NDArray[np.int32]
    ends: NDArray[np.int32]

    @property
    def success(self) -> NDArray[np.bool_]:
        """(N, C): whether each try succeeded."""
        return np.unpackbits(self.bits, axis=-1, count=NUM_CANDIDATES, bitorder="little").astype(
            bool
        )

    def tries(self, obj: ArticulatedObject, row: int) -> tuple[Array, Array]:
        """Joint positions (K - 1,) and the poses (C, 4, 4) tried at a point, object frame.

        Just those that were tried, to the last bit.
        """
        q = positions_at(obj, self.fractions[self.state[row]])
        return q, tried_poses(
            obj, q, int(self.part[row]), self.points_part[row], self.normals_part[row]
        )


#: What a file holds of ``Labels``, in order.
_ARRAYS = tuple(f.name for f in fields(Labels) if f.name != "object_id")


def positions_at(obj: ArticulatedObject, fractions: Array) -> Array:
    """Joint positions (K - 1,) at the parts' open fractions (K - 1,)."""
    return np.array(
        [joint.position(float(f)) for joint, f in zip(obj.joints, fractions, strict=True)]
    )


def tried_poses(
    obj: ArticulatedObject, q: Array, part: int, point_part: Array, normal_part: Array
) -> Array:
    """``T_object_grasp`` (C, 4, 4) of the tries at a point (3,) of a part with a normal (3,)."""
    T_object_part = obj.link_poses(q)[part]
    poses = np.tile(np.eye(4), (NUM_CANDIDATES, 1, 1))
    poses[:, :3, :3] = candidates_of_part(normal_part, T_object_part[:3, :3])
    poses[:, :3, 3] = transforms.apply(T_object_part, np.asarray(point_part, dtype=float)[None])[0]
    return poses


def annotate(
    object_id: str, config: AnnotationConfig = AnnotationConfig()
) -> dict[str, NDArray[Any]]:
    """Labels one object; the arrays of ``Labels`` by name, a function of id and config alone.

    Raises:
        InvalidArgumentError: no camera sees a movable part in some joint state.
    """
    obj = catalog.load(object_id)
    rng = _generator(object_id, config)
    fractions = _joint_states(obj, config, rng)
    states = [
        _annotate_state(obj, state, positions_at(obj, each), config, rng)
        for state, each in enumerate(fractions)
    ]
    columns = [np.concatenate(column) for column in zip(*states, strict=True)]
    return dict(zip(_ARRAYS, [fractions, *columns], strict=True))


def joint_states(object_id: str, config: AnnotationConfig = AnnotationConfig()) -> Array:
    """Open fractions (S, K - 1) of an object's parts in the states that ``annotate`` labels."""
    return _joint_states(catalog.load(object_id), config, _generator(object_id, config))


def _generator(object_id: str, config: AnnotationConfig) -> np.random.Generator:
    return np.random.default_rng([config.seed, zlib.crc32(object_id.encode())])


def _joint_states(
    obj: ArticulatedObject, config: AnnotationConfig, rng: np.random.Generator
) -> Array:
    intervals = [catalog.category_of(obj).start_fraction] * config.start_states
    intervals += [(0.0, 1.0)] * config.open_states
    return np.array([rng.uniform(*each, len(obj.joints)) for each in intervals])


def _annotate_state(
    obj: ArticulatedObject,
    state: int,
    q: Array,
    config: AnnotationConfig,
    rng: np.random.Generator,
) -> tuple[NDArray[Any], ...]:
    """The arrays of one state, in the order of ``_ARRAYS`` behind the fractions."""
    Ts_part_object = transforms.invert(obj.link_poses(q))
    seen = {}
    for part in range(1, obj.num_parts):
        points, normals = visible_points(
            obj, q, part, config.most_points, config.views, config.yaw, rng
        )
        if len(points):
            # As they are kept: whoever reads the labels makes the same tries.
            T = Ts_part_object[part]
            seen[part] = (
                transforms.apply(T, points).astype(np.float32),
                transforms.rotate(T, normals).astype(np.float32),
            )
    if not seen:
        raise InvalidArgumentError(
            f"{obj.object_id}: no camera sees a movable part at joint positions "
            f"{q.round(3).tolist()}, so that there is nothing to label"
        )
    parts, chosen, normals_chosen, bits = [], [], [], []
    verdicts = np.zeros(len(Verdict), dtype=np.int32)
    ends = np.zeros(len(TRIAL_ENDS), dtype=np.int32)
    for index in range(config.most_points):
        if ends.sum() >= config.trials and len(parts) >= config.least_points:
            break
        for part, (points, normals) in seen.items():
            tried = try_point(obj, q, part, points[index], normals[index], config)
            verdicts += tried.verdicts
            ends += tried.ends
            parts.append(part)
            chosen.append(points[index])
            normals_chosen.append(normals[index])
            bits.append(np.packbits(tried.success, bitorder="little"))
    return (
        np.full(len(parts), state, dtype=np.uint8),
        np.array(parts, dtype=np.uint8),
        np.stack(chosen),
        np.stack(normals_chosen),
        np.stack(bits),
        verdicts[None],
        ends[None],
    )


class PointTries(NamedTuple):
    """What became of the C tries at a point.

    Attributes:
        success: (C,), whether each succeeded.
        verdicts: (3,), how many the filter called possible, empty and in collision.
        ends: (5,), how many trials ended ``TRIAL_ENDS``.
    """

    success: NDArray[np.bool_]
    verdicts: NDArray[np.int32]
    ends: NDArray[np.int32]


def try_point(
    obj: ArticulatedObject,
    q: Array,
    part: int,
    point_part: Array,
    normal_part: Array,
    config: AnnotationConfig = AnnotationConfig(),
) -> PointTries:
    """Tries every pose at a point (3,) of a part with a normal (3,), at joint positions q."""
    poses = tried_poses(obj, q, part, point_part, normal_part)
    judged = judge(obj, q, part, poses[:1, :3, 3], poses[None, :, :3, :3], config.filter)[0]
    success = np.zeros(NUM_CANDIDATES, dtype=bool)
    ends = np.zeros(len(TRIAL_ENDS), dtype=np.int32)
    for candidate in np.flatnonzero(judged == Verdict.POSSIBLE):
        trial = try_grasp(obj, q, part, poses[candidate], config.trial)
        success[candidate] = trial.success
        ends[TRIAL_ENDS.index(trial.end)] += 1
    verdicts = np.bincount(judged, minlength=len(Verdict)).astype(np.int32)
    return PointTries(success, verdicts, ends)


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
    backend: str = "loky",
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
        backend=backend,
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
    path = _label_path(object_id, root)
    arrays, _ = read_arrays(path)
    if set(arrays) != set(_ARRAYS):
        raise DamagedFileError(
            f"{path} holds {', '.join(sorted(arrays))}, and not {', '.join(_ARRAYS)}: it is no "
            "label file of this version. Make it again with `artgym annotate`."
        )
    return Labels(object_id=object_id, **arrays)


def is_labelled(object_id: str, root: Path | None = None) -> bool:
    """Whether an object has labels; shipped ones by default."""
    return _label_path(object_id, root).is_file()


def _label_path(object_id: str, root: Path | None) -> Path:
    category, _, _ = object_id.partition("/")
    folder = labels_folder(category, catalog.split_of(object_id), root)
    return folder / label_file_name(object_id)


def labelled_categories(root: Path | None = None) -> tuple[str, ...]:
    """Categories that have labels; shipped ones by default."""
    folder = root or _SHIPPED_LABELS
    return tuple(sorted(path.name for path in folder.iterdir() if path.is_dir()))


def labelled_ids(category: str, split: str, root: Path | None = None) -> Sequence[str]:
    """Ids of the objects of a split that have labels, sorted."""
    files = sorted(labels_folder(category, split, root).glob(f"{category}_*.h5"))
    return [f"{category}/{f.stem.removeprefix(category + '_')}" for f in files]
