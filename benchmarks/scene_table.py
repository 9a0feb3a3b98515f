"""Scenes of several objects, seen through the detector: the paper's Table 3.

Every column is a mean average precision over recall. A detection belongs to the object of its
category whose mask it overlaps by half or more, the surest first; its parts, its affordance and its
grasps are then entries of the columns, and hits where they are right. What belongs to no object is
an entry that misses. Entries are ranked by the detection's score times how sure the network itself
is of what it says. Of a box that is the same from behind, the front is the side that is seen, as in
``icaf4_policy.naming``. Run ``python -m benchmarks.perception table3 --help``.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]

from artgym.annotation.annotate import labelled_ids
from artgym.datasets.generate import GenerationConfig, make_scenes
from artgym.datasets.sample import AFFORDANCE_UNKNOWN, AFFORDANCE_YES, Picture, Sample
from artgym.datasets.sets import SETS
from artgym.geometry.camera import points_from_depth, project
from artgym.objects import catalog
from artgym.sim.renderer import find_device
from benchmarks import record
from benchmarks.command import require_positive, run
from benchmarks.paper import TABLE_3
from benchmarks.parallel import results_in_order

if TYPE_CHECKING:
    from icaf4_policy.detector.evaluation import Outline
    from icaf4_policy.scenes import ScenePerception, SeenObject

#: What each column counts, as it is printed.
COLUMNS: Mapping[str, str] = {
    "part_segmentation@75": "part segmentation, IoU 75",
    "part_pose@5deg5cm": "part pose, 5 deg 5 cm",
    "object_pose@5deg5cm": "object pose, 5 deg 5 cm",
    "affordance@75": "affordance, IoU 75",
    "affordance@95": "affordance, IoU 95",
    "affordance_miou@75": "affordance, mIoU 75",
    "affordance_miou@95": "affordance, mIoU 95",
    "grasp@5deg": "grasp, 5 deg",
    "grasp@10deg": "grasp, 10 deg",
}

#: What is promised of the mean over the categories, and of the detector.
TARGETS: Mapping[str, float] = {
    "part_segmentation@75": 0.9,
    "part_pose@5deg5cm": 0.8,
    "affordance@75": 0.85,
    "mask/map50": 0.9,
}

#: A part of which less is seen, as a share of its object's seen points, does not count.
_SEEN_SHARE = 0.01

#: Largest errors of a right pose.
_POSE_RAD, _POSE_M = float(np.radians(5.0)), 0.05


@dataclass(frozen=True, kw_only=True)
class SceneTableConfig:
    """How well are the objects of a scene seen, through the detector?

    Attributes:
        split: whose labelled objects stand in the scenes.
        scenes: how many.
        seed: of the scenes and the choice of points.
        workers: processes; the numbers do not depend on it.
        weights: folder with detector.safetensors and {category}.safetensors, instead of the
            shipped weights.
        out: folder for scene_table.json.
    """

    split: catalog.Split = "test"
    scenes: int = 96
    seed: int = 0
    workers: int = 2
    weights: Path | None = None
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        require_positive(self, "scenes", "workers")


@dataclass(frozen=True, kw_only=True)
class Entry:
    """Something that a detection claims.

    Attributes:
        column: of ``COLUMNS``.
        category: of the object.
        score: how sure of it.
        hit: whether it is right.
    """

    column: str
    category: str
    score: float
    hit: bool


@dataclass(frozen=True, kw_only=True)
class SceneScore:
    """What was found in one scene.

    Attributes:
        entries: what its detections claim.
        counts: how many hits would be complete, by column and category.
        truths, found: the outlines of what is there and what was detected.
        seconds: that looking took.
    """

    entries: list[Entry]
    counts: dict[tuple[str, str], int]
    truths: list[Outline]
    found: list[Outline]
    seconds: float


@dataclass(frozen=True, kw_only=True)
class SceneTask:
    """One scene: its number, the objects it is drawn from, and the rest of ``SceneTableConfig``."""

    number: int
    ids: tuple[str, ...]
    seed: int
    weights: Path | None


@functools.lru_cache(maxsize=1)
def _perception(weights: Path | None) -> ScenePerception:
    from icaf4_policy.scenes import ScenePerception

    return ScenePerception.load(weights)


def score_scene(task: SceneTask) -> SceneScore:
    """Makes a scene, looks at it, and compares."""
    from icaf4_policy.detector.evaluation import LOWEST_SCORE, outlines, true_detections
    from icaf4_policy.naming import picture_named_from_view

    config = GenerationConfig(seed=task.seed)
    picture = picture_named_from_view(make_scenes(task.ids, task.number, 1, config)[0])
    rng = np.random.default_rng([task.seed, task.number])
    perception = _perception(task.weights)
    began = time.perf_counter()
    seen = perception.look(
        picture.rgb, picture.depth, picture.intrinsics, min_score=LOWEST_SCORE, rng=rng
    )
    seconds = time.perf_counter() - began
    entries, counts = compared(picture, seen, perception, rng)
    return SceneScore(
        entries=entries,
        counts=counts,
        truths=outlines(true_detections(picture)),
        found=outlines(each.detection for each in seen),
        seconds=seconds,
    )


def compared(
    picture: Picture,
    seen: Sequence[SeenObject],
    perception: ScenePerception,
    rng: np.random.Generator,
) -> tuple[list[Entry], dict[tuple[str, str], int]]:
    """What the seen objects claim, and how many hits would be complete by column and category."""
    entries: list[Entry] = []
    counts: dict[tuple[str, str], int] = {}
    for index, sample in enumerate(picture.samples):
        for column, count in _complete(picture, index, sample).items():
            key = column, _category(sample)
            counts[key] = counts.get(key, 0) + count
    for each, owner in zip(seen, owners(picture, seen), strict=True):
        entries += _claims(picture, owner, each, perception, rng)
    return entries, counts


def _category(sample: Sample) -> str:
    return sample.object_id.partition("/")[0]


def owners(picture: Picture, seen: Sequence[SeenObject]) -> list[int | None]:
    """The object, an index into ``picture.samples``, that each detection belongs to, if any."""
    free = set(range(len(picture.samples)))
    owner: list[int | None] = [None] * len(seen)
    for i in sorted(range(len(seen)), key=lambda i: -seen[i].detection.score):
        found = seen[i].detection
        overlaps = {}
        for k in free:
            if _category(picture.samples[k]) == found.category:
                truth = picture.instance_mask == k + 1
                overlaps[k] = np.sum(truth & found.mask) / np.sum(truth | found.mask)
        best = max(overlaps, key=lambda k: overlaps[k], default=None)
        if best is not None and overlaps[best] >= 0.5:
            owner[i] = best
            free.remove(best)
    return owner


def _seen_parts(sample: Sample) -> NDArray[np.int64]:
    """The parts that count."""
    counts = np.bincount(sample.part, minlength=sample.num_parts)
    return np.flatnonzero(counts >= _SEEN_SHARE * len(sample.part))


def _complete(picture: Picture, index: int, sample: Sample) -> dict[str, int]:
    """How many hits of each column an object would give."""
    parts, labels = len(_seen_parts(sample)), _label_pixels(picture, sample)
    known = int(labels.graspable.any())
    return {
        "part_segmentation@75": parts,
        "part_pose@5deg5cm": parts,
        "object_pose@5deg5cm": parts,
        "affordance@75": known,
        "affordance@95": known,
        "affordance_miou@75": known,
        "affordance_miou@95": known,
        "grasp@5deg": known,
        "grasp@10deg": known,
    }


@dataclass(frozen=True, kw_only=True, eq=False)
class _LabelPixels:
    """Pixels of an object whose affordance is known: (n,) each."""

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    graspable: NDArray[np.bool_]


def _pixels(points: NDArray[np.floating], picture: Picture) -> NDArray[np.int64]:
    """Row and column (n, 2) of the pixels that points (n, 3), camera frame, come from."""
    column, row = np.floor(project(points, picture.intrinsics)).astype(np.int64).T
    height, width = picture.depth.shape
    return np.stack([row.clip(0, height - 1), column.clip(0, width - 1)], axis=-1)


def _label_pixels(picture: Picture, sample: Sample) -> _LabelPixels:
    known = sample.affordance != AFFORDANCE_UNKNOWN
    row, column = _pixels(sample.points_camera[known], picture).T
    graspable = sample.affordance[known] == AFFORDANCE_YES
    return _LabelPixels(row=row, column=column, graspable=graspable)


def _claims(
    picture: Picture,
    owner: int | None,
    seen: SeenObject,
    perception: ScenePerception,
    rng: np.random.Generator,
) -> Iterator[Entry]:
    """The entries of one detection."""
    from icaf4_policy.metrics import class_ious

    category, score = seen.detection.category, seen.detection.score

    def entry(column: str, hit: bool, confidence: float) -> Entry:
        return Entry(column=column, category=category, score=score * confidence, hit=bool(hit))

    sample = None if owner is None else picture.samples[owner]
    yield from (entry(*claim) for claim in _part_claims(picture, owner, seen))
    iou = mean_iou = 0.0
    if sample is not None:
        labels = _label_pixels(picture, sample)
        if not labels.graspable.any():
            return
        called = seen.graspable[labels.row, labels.column]
        # Of the points that cannot be grasped, and of those that can.
        ious = class_ious(called, labels.graspable, 2)
        iou, mean_iou = float(ious[1]), float(np.nanmean(ious))
    confidence = seen.prediction.affordance_confidence()
    yield entry("affordance@75", iou >= 0.75, confidence)
    yield entry("affordance@95", iou >= 0.95, confidence)
    yield entry("affordance_miou@75", mean_iou >= 0.75, confidence)
    yield entry("affordance_miou@95", mean_iou >= 0.95, confidence)
    error = np.inf if sample is None else _grasp_error(seen, sample, picture, perception, rng)
    yield entry("grasp@5deg", error <= np.radians(5.0), confidence)
    yield entry("grasp@10deg", error <= np.radians(10.0), confidence)


def _part_claims(
    picture: Picture, owner: int | None, seen: SeenObject
) -> Iterator[tuple[str, bool, float]]:
    """What a detection claims of each part that it says to see and that counts.

    Yields:
        The column, whether the claim is right, and how sure the network is of it.
    """
    from icaf4_policy.metrics import pose_errors
    from icaf4_policy.targets import true_object_boxes, true_part_boxes

    claimed = np.flatnonzero(np.bincount(seen.part_mask.ravel())[1:])
    confidences = seen.prediction.part_confidences()
    pose_confidences = seen.prediction.pose_confidences()
    fits = {
        "part_pose@5deg5cm": seen.prediction.part_boxes,
        "object_pose@5deg5cm": seen.prediction.object_boxes,
    }
    num_parts, counted = 0, np.zeros(0, dtype=np.int64)
    mine, truths = np.zeros_like(seen.part_mask, dtype=bool), {}
    if owner is not None:
        sample, mine = picture.samples[owner], picture.instance_mask == owner + 1
        num_parts, counted = sample.num_parts, _seen_parts(sample)
        truths = {
            "part_pose@5deg5cm": true_part_boxes(sample),
            "object_pose@5deg5cm": true_object_boxes(sample),
        }
    for k in claimed:
        if k < num_parts and k not in counted:
            continue
        there, said = mine & (picture.part_mask == k + 1), seen.part_mask == k + 1
        iou = np.sum(there & said) / np.sum(there | said)
        yield "part_segmentation@75", bool(iou >= 0.75), confidences[k]
        for column, found in fits.items():
            fit = found[k]
            if fit is None:
                continue
            right = False
            if k < num_parts:
                rotation, translation = pose_errors(fit.T_camera_box, truths[column][k])
                right = bool(rotation <= _POSE_RAD and translation <= _POSE_M)
            yield column, right, pose_confidences[k]


def _grasp_error(
    seen: SeenObject,
    sample: Sample,
    picture: Picture,
    perception: ScenePerception,
    rng: np.random.Generator,
) -> float:
    """Angle in radians of the best proposal at a labelled point to that point's nearest success.

    Infinite where nothing succeeded at that point, or no proposal is at a labelled one.
    """
    from icaf4_policy.metrics import grasp_distances

    mask = seen.part_mask > 0
    points_camera = points_from_depth(picture.depth, picture.intrinsics)
    points = perception.perceptions[seen.detection.category].point_grasps(
        points_camera[mask],
        picture.rgb[mask],
        seen.prediction.R_level_camera,
        top=1,
        rng=rng,
    )
    labelled = np.flatnonzero((sample.affordance != AFFORDANCE_UNKNOWN) & (sample.grasp_row >= 0))
    if not len(labelled):
        return float("inf")
    distance, nearest = cKDTree(sample.points_camera[labelled]).query(points.points_camera)
    at = np.flatnonzero(distance <= GenerationConfig().label_radius)
    if not len(at):
        return float("inf")
    best = at[np.argmax(points.affordance[at] * points.scores[at, 0])]
    row = sample.grasp_row[labelled[nearest[best]]]
    successes = sample.tried_rotations()[row, sample.successful_tries()[row]]
    if not len(successes):
        return float("inf")
    R_object_camera = sample.T_camera_object[:3, :3].astype(float).T
    return float(grasp_distances(R_object_camera @ points.R_camera_grasp[best], successes).min())


def measure(config: SceneTableConfig) -> dict[str, Any]:
    """Looks at all scenes; a result for ``record.write_result``.

    Raises:
        RendererUnavailableError: no device here can render.
        DamagedFileError: weights or labels are missing or damaged.
    """
    from icaf4_policy.detector.evaluation import average_precision

    began = time.perf_counter()
    find_device()
    weights = config.weights and config.weights.absolute()
    _perception(weights)
    categories = SETS["reartmix"]
    ids = tuple(i for category in categories for i in labelled_ids(category, config.split))
    tasks = [
        SceneTask(number=i, ids=ids, seed=config.seed, weights=weights)
        for i in range(config.scenes)
    ]
    scores = results_in_order(
        score_scene, tasks, workers=config.workers, description="scenes", unit="scene"
    )
    detection = average_precision([s.truths for s in scores], [s.found for s in scores])
    return {
        **record.provenance("benchmarks.perception"),
        "config": asdict(config),
        "seconds": round(time.perf_counter() - began, 1),
        "targets": dict(TARGETS),
        "objects": {c: sum(t.category == c for s in scores for t in s.truths) for c in categories},
        "look_ms": round(1000.0 * float(np.median([s.seconds for s in scores])), 1),
        "detector": {name: round(value, 5) for name, value in detection.items()},
        "rows": precision_rows(scores, categories),
        "paper": dict(TABLE_3),
    }


def precision_rows(
    scores: Iterable[SceneScore], categories: Sequence[str]
) -> dict[str, dict[str, float]]:
    """Mean average precision of every column, by category, and their mean as "mean"."""
    from icaf4_policy.metrics import interpolated_precision

    scores = list(scores)
    entries = [entry for score in scores for entry in score.entries]
    rows: dict[str, dict[str, float]] = {}
    for category in categories:
        rows[category] = {}
        for column in COLUMNS:
            mine = [e for e in entries if (e.column, e.category) == (column, category)]
            count = sum(score.counts.get((column, category), 0) for score in scores)
            rows[category][column] = round(
                interpolated_precision([e.score for e in mine], [e.hit for e in mine], count), 5
            )
    rows["mean"] = {
        column: round(float(np.nanmean([rows[c][column] for c in categories])), 5)
        for column in COLUMNS
    }
    return rows


def tables_from_result(result: Mapping[str, Any]) -> list[Table]:
    """The tables for a person to read."""
    table = Table(title="scenes through the detector, mAP; paper: ICAF-4 on ReArtMix")
    table.add_column("category")
    for label in COLUMNS.values():
        table.add_column(label, justify="right")
        table.add_column("paper", justify="right", style="dim")
    for category, row in result["rows"].items():
        paper = result["paper"].get(category, {})
        cells = []
        for column in COLUMNS:
            theirs = paper.get(column)
            cells += [f"{row[column]:.3f}", "" if theirs is None else f"{theirs:.2f}"]
        table.add_row(category, *cells)
    detector = Table(title="the detector alone, COCO's average precision")
    detector.add_column("category")
    shown = ("box/map50", "box/map75", "mask/map50", "mask/map75", "mask/map")
    for name in shown:
        detector.add_column(name.replace("/map", " mAP"), justify="right")
    for category in [*SETS["reartmix"], ""]:
        suffix = f"/{category}" if category else ""
        values = [result["detector"].get(name + suffix) for name in shown]
        cells = ["-" if value is None else f"{value:.3f}" for value in values]
        detector.add_row(category or "mean", *cells)
    return [table, detector]


def report(config: SceneTableConfig) -> list[Table]:
    """Measures, writes ``scene_table.json`` and gives the tables."""
    result = measure(config)
    record.write_result(config.out / "scene_table.json", result)
    return tables_from_result(result)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("scene_table", SceneTableConfig, report, arguments)
