"""Are the labels of pictures right when looked at?

Pictures of both sets are made anew; what is written beside them is projected back into them and
compared with masks and depth, and carried grasps are tried again in physics. Run
``python -m benchmarks.datasets --help``.
"""

from __future__ import annotations

import sys
import zlib
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from artgym.annotation.annotate import labelled_ids, positions_at, read_labels
from artgym.annotation.trial import try_grasp
from artgym.datasets.generate import GenerationConfig, make_pictures, make_scenes
from artgym.datasets.sample import AFFORDANCE_YES, Picture, Sample
from artgym.datasets.sets import SETS, SetName
from artgym.errors import InvalidArgumentError
from artgym.geometry import transforms
from artgym.geometry.camera import pixel_rays, project
from artgym.objects import catalog
from artgym.sim import rays
from benchmarks import record
from benchmarks.command import require_positive, run
from benchmarks.parallel import results_in_order
from benchmarks.rates import wilson_interval

#: What is promised: metres, and the share of carried grasps that succeed again.
TARGETS = {"depth_error": 0.002, "grasps_again": 0.95}


@dataclass(frozen=True, kw_only=True)
class DatasetsConfig:
    """Are the labels of pictures right when looked at?

    Attributes:
        set: artimage, reartmix.
        split: whose objects.
        pictures: of each set, drawn at random.
        grasps: tried again for each object seen in them.
        labels: folder with {category}/{split}, instead of the shipped labels.
        seed: of the pictures and the grasps.
        workers: processes; the numbers do not depend on it.
        out: folder for datasets.json.
    """

    set: tuple[SetName, ...] = ("artimage", "reartmix")
    split: catalog.Split = "test"
    pictures: int = 50
    grasps: int = 8
    labels: Path | None = None
    seed: int = 0
    workers: int = 2
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        require_positive(self, "pictures", "grasps", "workers")


@dataclass(frozen=True, kw_only=True)
class PictureTask:
    """One picture.

    Attributes:
        set: which it is of.
        number: of the picture among those drawn.
        ids: labelled objects of the set's categories.
        grasps, labels, seed: as in ``DatasetsConfig``.
    """

    set: SetName
    number: int
    ids: tuple[str, ...]
    grasps: int
    labels: Path | None
    seed: int


def check_picture(task: PictureTask) -> list[dict[str, Any]]:
    """What was found of every object in a picture."""
    rng = np.random.default_rng([task.seed, zlib.crc32(task.set.encode()), task.number])
    config = GenerationConfig(views=1, seed=int(rng.integers(2**31)))
    if task.set == "artimage":
        object_id = str(rng.choice(task.ids))
        pictures = make_pictures(object_id, config, task.labels)
        picture = pictures[int(rng.integers(len(pictures)))]
    else:
        picture = make_scenes(task.ids, task.number, 1, config, task.labels)[0]
    return [_check_sample(picture, k, task.grasps, rng) for k in range(len(picture.samples))]


def _check_sample(
    picture: Picture, index: int, grasps: int, rng: np.random.Generator
) -> dict[str, Any]:
    sample = picture.samples[index]
    obj = catalog.load(sample.object_id)
    q = positions_at(obj, sample.open_fraction[1:].astype(float))
    mask = np.where(picture.instance_mask == index + 1, picture.part_mask, 0)
    T_camera_object = sample.T_camera_object.astype(float)
    return {
        "object_id": sample.object_id,
        "box_iou": _box_iou(sample.box, mask > 0),
        "part_iou": _part_iou(obj, q, T_camera_object, picture, index),
        "depth_error": _depth_errors(sample, picture, mask),
        "pose_error": float(
            np.abs(T_camera_object @ obj.link_poses(q) - sample.T_camera_parts).max()
        ),
        "axis_error": _axis_error(sample, obj, q),
        "grasps": _grasps_again(sample, obj, q, grasps, rng),
    }


def _box_iou(box: NDArray[np.floating], mask: NDArray[np.bool_]) -> float:
    """Of the box with that around the mask's pixels."""
    rows, columns = np.nonzero(mask)
    low, high = np.array([columns.min(), rows.min()]), np.array([columns.max(), rows.max()]) + 1
    size = np.minimum(box[:2] + box[2:], high) - np.maximum(box[:2], low)
    common = float(np.prod(np.maximum(size, 0.0)))
    return common / (float(np.prod(box[2:])) + float(np.prod(high - low)) - common)


def _part_iou(
    obj: Any, q: NDArray[np.floating], T_camera_object: Any, picture: Picture, index: int
) -> float:
    """Mean IoU of the parts' masks with what rays say, where the object is not hidden."""
    height, width = picture.depth.shape
    pixels = pixel_rays(picture.intrinsics.astype(float), width, height).reshape(-1, 3)
    bodies = [rays.link_body(link) for link in obj.links]
    poses = T_camera_object @ obj.link_poses(q)
    hits = rays.cast(bodies, poses, np.zeros(3), pixels, table=False)
    cast = (hits.body + 1).reshape(height, width)
    mine = picture.instance_mask == index + 1
    # What stands in front of it is none of its own.
    hidden = ~mine & (picture.depth < hits.distance.reshape(height, width) - 0.005)
    ious = []
    for part in np.unique(picture.part_mask[mine]):
        seen, told = (cast == part) & ~hidden, mine & (picture.part_mask == part)
        ious.append(np.sum(seen & told) / np.sum(seen | told))
    return float(np.mean(ious))


def _depth_errors(sample: Sample, picture: Picture, mask: NDArray[np.integer]) -> list[float]:
    """At labelled points that the picture shows: their depth against the picture's, metres."""
    T = sample.T_camera_parts.astype(float)[sample.grasp_part]
    points = transforms.apply(T, sample.grasp_points_part[:, None].astype(float))[:, 0]
    normals = np.einsum("nij,nj->ni", T[:, :3, :3], sample.grasp_normals_part)
    column, row = np.floor(project(points, picture.intrinsics)).astype(int).T
    height, width = mask.shape
    inside = (row >= 0) & (row < height) & (column >= 0) & (column < width)
    faces = np.einsum("ni,ni->n", normals, points) < 0
    kept = np.flatnonzero(inside & faces)
    kept = kept[mask[row[kept], column[kept]] == sample.grasp_part[kept] + 1]
    return np.abs(picture.depth[row[kept], column[kept]] - points[kept, 2]).tolist()


def _axis_error(sample: Sample, obj: Any, q: NDArray[np.floating]) -> float:
    """How far, at most, a part is from where its joint's axis in the camera would move it, metres.

    The part's own corners, moved from rest about the axis that the sample tells.
    """
    T_camera_object = sample.T_camera_object.astype(float)
    worst = 0.0
    for part, joint in enumerate(obj.joints, start=1):
        if joint.parent != obj.part_names[0]:
            continue
        axis = sample.joint_axis_camera[part].astype(float)
        pivot = sample.joint_pivot_camera[part].astype(float)
        amount = abs(float(q[part - 1]) - joint.closed)
        corners = np.concatenate([s.corners_link() for s in obj.links[part].shapes])
        rest = transforms.apply(T_camera_object, corners)
        if joint.type == "prismatic":
            moved = rest + amount * axis
        else:
            offset = rest - pivot
            along = (offset @ axis)[:, None] * axis
            across = offset - along
            moved = pivot + along + np.cos(amount) * across
            moved += np.sin(amount) * np.cross(axis, across)
        told = transforms.apply(sample.T_camera_parts[part].astype(float), corners)
        worst = max(worst, float(np.linalg.norm(moved - told, axis=1).max()))
    return worst


def _grasps_again(
    sample: Sample, obj: Any, q: NDArray[np.floating], count: int, rng: np.random.Generator
) -> list[bool]:
    """Carried grasps tried once more, the seen point in place of the labelled one."""
    told = np.flatnonzero((sample.affordance == AFFORDANCE_YES) & (sample.grasp_row >= 0))
    if not len(told):
        return []
    success, rotations = sample.successful_tries(), sample.tried_rotations()
    T_object_camera = transforms.invert(sample.T_camera_object.astype(float))
    outcomes = []
    for i in rng.choice(told, count):
        row = int(sample.grasp_row[i])
        candidate = int(rng.choice(np.flatnonzero(success[row])))
        point = transforms.apply(T_object_camera, sample.points_camera[i].astype(float)[None])[0]
        T_object_grasp = transforms.transform_from(rotations[row, candidate], point)
        part = int(sample.grasp_part[row])
        outcomes.append(try_grasp(obj, q, part, T_object_grasp).success)
    return outcomes


def measure(config: DatasetsConfig) -> dict[str, Any]:
    """Checks all pictures; a result for ``record.write_result``.

    Raises:
        InvalidArgumentError: a set's categories have no labels.
        RendererUnavailableError: no device here can render.
    """
    rows = {}
    for name in config.set:
        ids = tuple(
            i
            for category in SETS[name]
            for i in labelled_ids(category, config.split, config.labels)
        )
        if not ids:
            raise InvalidArgumentError(f"no labels of {name}'s categories: `artgym annotate` first")
        for object_id in ids:
            read_labels(object_id, config.labels)
        tasks = [
            PictureTask(
                set=name,
                number=number,
                ids=ids,
                grasps=config.grasps,
                labels=config.labels and config.labels.absolute(),
                seed=config.seed,
            )
            for number in range(config.pictures)
        ]
        found = results_in_order(
            check_picture, tasks, workers=config.workers, description=name, unit="picture"
        )
        rows[name] = _row([each for picture in found for each in picture], len(tasks))
    return {
        **record.provenance("benchmarks.datasets"),
        "config": asdict(config),
        "targets": TARGETS,
        "rows": rows,
    }


def _row(found: Sequence[dict[str, Any]], pictures: int) -> dict[str, Any]:
    depth = np.array([e for each in found for e in each["depth_error"]])
    again = [success for each in found for success in each["grasps"]]
    return {
        "pictures": pictures,
        "objects": len(found),
        "box_iou_least": min(each["box_iou"] for each in found),
        "part_iou_mean": float(np.mean([each["part_iou"] for each in found])),
        "part_iou_least": min(each["part_iou"] for each in found),
        "depth_error_points": len(depth),
        "depth_error_median": float(np.median(depth)),
        "depth_error_95": float(np.quantile(depth, 0.95)),
        "pose_error": max(each["pose_error"] for each in found),
        "axis_error": max(each["axis_error"] for each in found),
        "grasps": len(again),
        "grasps_again": float(np.mean(again)),
        "grasps_again_interval": wilson_interval(sum(again), len(again)),
    }


def table_from_rows(rows: dict[str, dict[str, Any]]) -> Table:
    """The table for a person to read."""
    table = Table(title="labels projected back into pictures, and grasps tried again")
    for name in ("", *rows):
        table.add_column(name, justify="right" if name else "left")
    for label, name, form in (
        ("pictures", "pictures", "{:,}"),
        ("objects seen", "objects", "{:,}"),
        ("box IoU, least", "box_iou_least", "{:.4f}"),
        ("part mask IoU with rays, mean", "part_iou_mean", "{:.4f}"),
        ("  least", "part_iou_least", "{:.4f}"),
        ("labelled points seen", "depth_error_points", "{:,}"),
        ("  depth error, median, m", "depth_error_median", "{:.5f}"),
        ("  95 %", "depth_error_95", "{:.5f}"),
        ("part pose error, largest", "pose_error", "{:.1e}"),
        ("joint axis error, largest, m", "axis_error", "{:.1e}"),
        ("carried grasps tried again", "grasps", "{:,}"),
        ("  succeed", "grasps_again", "{:.3f}"),
    ):
        table.add_row(label, *(form.format(row[name]) for row in rows.values()))
    return table


def report(config: DatasetsConfig) -> list[Table]:
    """Measures, writes ``datasets.json`` and gives the table."""
    result = measure(config)
    record.write_result(config.out / "datasets.json", result)
    return [table_from_rows(result["rows"])]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("datasets", DatasetsConfig, report, arguments)


if __name__ == "__main__":
    sys.exit(main())
