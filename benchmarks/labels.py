"""What do the grasp labels hold, and what does chance score on them?

Run ``python -m benchmarks.labels --help``.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table
from tqdm import tqdm

from artgym.annotation.annotate import (
    AnnotationConfig,
    Labels,
    labelled_categories,
    labelled_ids,
    positions_at,
    read_labels,
    try_point,
    visible_points,
)
from artgym.annotation.filter import Verdict
from artgym.annotation.trial import TRIAL_ENDS, try_grasp
from artgym.datasets.generate import GenerationConfig
from artgym.errors import InvalidArgumentError
from artgym.geometry import transforms
from artgym.geometry.grasps import APPROACH_RINGS, NUM_ROLLS
from artgym.objects import catalog
from benchmarks import record
from benchmarks.command import run
from icaf4_policy.metrics import CHANCE_ROWS, grasp_distances

#: Grasps that each chance row draws at a point: all rolls of the grid, or as many at random.
_DRAWS = NUM_ROLLS

#: Of so many points seen of a part one is taken that lies beside a labelled one.
_SEEN_POINTS = 4000


@dataclass(frozen=True, kw_only=True)
class LabelsConfig:
    """What do the grasp labels hold, and what does chance score on them?

    Attributes:
        category: categories of objects; by default those with shipped labels.
        split: splits; those without labels are left out.
        labels: folder with {category}/{split}, instead of the shipped labels.
        retried: tries of each category and split that are made once more, half of them successes:
            on another processor than the labels' the last digits differ, and now and then the end.
        beside: points of each category and split that are tried beside labelled ones, half of
            these with successes: a picture's points have the labels of such neighbours.
        seed: of the chance rows and of what is tried again.
        out: folder for labels.json.
    """

    category: tuple[str, ...] = field(default_factory=labelled_categories)
    split: tuple[catalog.Split, ...] = ("train", "val", "test")
    labels: Path | None = None
    retried: int = 100
    beside: int = 40
    seed: int = 0
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        for name in ("retried", "beside"):
            if getattr(self, name) < 0:
                raise InvalidArgumentError(f"{name}={getattr(self, name)}: expected 0 or more.")
        for category in self.category:
            catalog.category(category)


def measure(config: LabelsConfig) -> dict[str, Any]:
    """Reads all labels; a result for ``record.write_result``.

    Raises:
        InvalidArgumentError: there are no labels.
        DamagedFileError: a label file is damaged.
    """
    rows: dict[str, dict[str, Any]] = {}
    for category in config.category:
        for split in config.split:
            ids = labelled_ids(category, split, config.labels)
            if ids:
                bar = tqdm(ids, desc=f"labels {category}/{split}", unit="object", file=sys.stderr)
                labels = [read_labels(object_id, config.labels) for object_id in bar]
                rows.setdefault(category, {})[split] = statistics(
                    labels, config.seed, config.retried, config.beside
                )
    if not rows:
        raise InvalidArgumentError(
            f"no labels for {', '.join(config.category)}: run `artgym annotate` first."
        )
    return {
        **record.provenance("benchmarks.labels"),
        "config": asdict(config),
        "labels": rows,
    }


def statistics(
    labels: Sequence[Labels], seed: int, retried: int = 0, beside: int = 0
) -> dict[str, Any]:
    """The numbers of one category and split.

    Args:
        labels: of at least one object.
        seed: of the chance rows and of what is tried again.
        retried: how many tries are made once more.
        beside: how many points beside labelled ones are tried.
    """
    success = np.concatenate([one.success for one in labels])
    graspable = np.any(success, axis=1)
    verdicts = np.sum([one.verdicts.sum(axis=0) for one in labels], axis=0)
    ends = np.sum([one.ends.sum(axis=0) for one in labels], axis=0)
    return {
        "objects": len(labels),
        "objects_without_success": sum(not one.success.any() for one in labels),
        "states": sum(len(one.fractions) for one in labels),
        "points": len(success),
        "tries": success.size,
        "trials": int(ends.sum()),
        "verdicts": {
            verdict.name.lower().replace("_", " "): int(verdicts[verdict]) for verdict in Verdict
        },
        "trial_ends": {end: int(count) for end, count in zip(TRIAL_ENDS, ends, strict=True)},
        "successes": int(success.sum()),
        "density": _mean(success),
        "density_at_graspable_points": _mean(success[graspable]),
        "graspable_points": _mean(graspable),
        "rings": _ring_statistics(success, graspable),
        "chance_deg": _chance(labels, np.random.default_rng(seed)),
        "retried": _retried(labels, retried, np.random.default_rng((seed, 1))),
        "beside": _beside(labels, beside, np.random.default_rng((seed, 2))),
    }


def _retried(labels: Sequence[Labels], count: int, rng: np.random.Generator) -> dict[str, int]:
    """How many tries, half of them successes as far as there are any, end again as they did."""
    made = again = 0
    tries = [one.success for one in labels]
    for bit in (True, False):
        where = np.concatenate(
            [np.insert(np.argwhere(t == bit), 0, i, axis=1) for i, t in enumerate(tries)]
        )
        for index, row, candidate in rng.permutation(where)[: count // 2]:
            one = labels[index]
            obj = catalog.load(one.object_id)
            q, poses = one.tries(obj, row)
            trial = try_grasp(obj, q, int(one.part[row]), poses[candidate])
            made, again = made + 1, again + (trial.success == bit)
    return {"tries": made, "same": again}


def _beside(
    labels: Sequence[Labels], count: int, rng: np.random.Generator
) -> dict[str, dict[str, int]]:
    """How many points beside labelled ones, half of them graspable, are as graspable as these.

    Beside are the points that a picture of the default settings would give the label to.
    """
    found = {}
    graspable = [one.success.any(axis=1) for one in labels]
    for name, bit in (("graspable", True), ("not graspable", False)):
        where = np.concatenate(
            [np.insert(np.argwhere(g == bit), 0, i, axis=1) for i, g in enumerate(graspable)]
        )
        points = same = 0
        for index, row in rng.permutation(where):
            if points == count // 2:
                break
            success = _success_beside(labels[index], row, rng)
            if success is not None:
                points, same = points + 1, same + int(success == bit)
        found[name] = {"points": points, "same": same}
    return found


def _success_beside(one: Labels, row: int, rng: np.random.Generator) -> bool | None:
    """Whether any try succeeds at a point beside a labelled one; None if no camera sees one."""
    obj, part = catalog.load(one.object_id), int(one.part[row])
    q = positions_at(obj, one.fractions[one.state[row]])
    tried, pictured = AnnotationConfig(), GenerationConfig()
    seen = visible_points(obj, q, part, _SEEN_POINTS, tried.views, tried.yaw, rng)
    T_part_object = transforms.invert(obj.link_poses(q)[part])
    points, normals = (
        transforms.apply(T_part_object, seen[0]),
        transforms.rotate(T_part_object, seen[1]),
    )
    distance = np.linalg.norm(points - one.points_part[row], axis=1)
    near = (distance > 0) & (distance <= pictured.label_radius)
    near &= normals @ one.normals_part[row] > np.cos(pictured.label_angle)
    if not near.any():
        return None
    at = rng.choice(np.flatnonzero(near))
    return bool(try_point(obj, q, part, points[at], normals[at]).success.any())


def _ring_statistics(
    success: NDArray[np.bool_], graspable: NDArray[np.bool_]
) -> list[dict[str, float]]:
    """Density by the tilt of the approach from the inward normal."""
    rings, first = [], 0
    for tilt_deg, directions in APPROACH_RINGS:
        tries = success[:, first : first + directions * NUM_ROLLS]
        first += directions * NUM_ROLLS
        rings.append(
            {
                "tilt_deg": tilt_deg,
                "tries": tries.size,
                "density": _mean(tries),
                "density_at_graspable_points": _mean(tries[graspable]),
                "graspable_points": _mean(tries.any(axis=1)),
            }
        )
    return rings


def _chance(labels: Sequence[Labels], rng: np.random.Generator) -> dict[str, dict[str, float]]:
    """Angle from a grasp of each chance row to the nearest success, over all graspable points.

    Worked out in the object's frame, in which the tries were made.
    """
    angles: dict[str, list[float]] = {name: [] for name in CHANCE_ROWS}
    for one in labels:
        obj = catalog.load(one.object_id)
        tries = one.success
        for row in np.flatnonzero(tries.any(axis=1)):
            R_tries = one.tries(obj, int(row))[1][:, :3, :3]
            # The first try of all goes straight against the surface.
            normal = -R_tries[None, 0, :, 2]
            for name, draw in CHANCE_ROWS.items():
                nearest = grasp_distances(draw(normal, _DRAWS, rng)[0], R_tries[tries[row]])
                angles[name].append(float(np.degrees(nearest.min(axis=1)).mean()))
    return {
        name: {"mean": _mean(values), "median_of_points": _median(values)}
        for name, values in angles.items()
    }


def _mean(values: Any) -> float:
    """Their mean; NaN of none."""
    return round(float(np.mean(values)), 5) if np.size(values) else float("nan")


def _median(values: Any) -> float:
    """Their median; NaN of none."""
    return round(float(np.median(values)), 5) if np.size(values) else float("nan")


def statistics_table(labels: dict[str, dict[str, Any]]) -> Table:
    """All numbers, a column a category and split."""
    columns = [(c, s, numbers) for c, splits in labels.items() for s, numbers in splits.items()]
    table = Table(title="grasp labels")
    table.add_column("")
    for category, split, _ in columns:
        table.add_column(f"{category}/{split}", justify="right")
    for name in ("objects", "objects_without_success", "points", "tries", "trials", "successes"):
        table.add_row(name.replace("_", " "), *(f"{n[name]:,}" for _, _, n in columns))
    for verdict in columns[0][2]["verdicts"]:
        shares = (100 * n["verdicts"][verdict] / n["tries"] for _, _, n in columns)
        table.add_row(f"filter: {verdict}, %", *(f"{share:.1f}" for share in shares))
    for end in TRIAL_ENDS:
        counts = (n["trial_ends"][end] for _, _, n in columns)
        table.add_row(f"trials: {end}", *(f"{count:,}" for count in counts))
    for name in ("density", "density_at_graspable_points", "graspable_points"):
        shares = (100 * n[name] for _, _, n in columns)
        table.add_row(f"{name.replace('_', ' ')}, %", *(f"{share:.1f}" for share in shares))
    for ring, (tilt_deg, _) in enumerate(APPROACH_RINGS):
        shares = (100 * n["rings"][ring]["density_at_graspable_points"] for _, _, n in columns)
        table.add_row(f"  approach tilted {tilt_deg:.0f} deg, %", *(f"{s:.1f}" for s in shares))
    same = (f"{n['retried']['same']} of {n['retried']['tries']}" for _, _, n in columns)
    table.add_row("tried again, ended the same", *same)
    for name in columns[0][2]["beside"]:
        counts = (n["beside"][name] for _, _, n in columns)
        table.add_row(
            f"beside {name}, the same", *(f"{c['same']} of {c['points']}" for c in counts)
        )
    for name in CHANCE_ROWS:
        means = (n["chance_deg"][name]["mean"] for _, _, n in columns)
        table.add_row(f"chance {name}, deg", *(f"{mean:.1f}" for mean in means))
    return table


def report(config: LabelsConfig) -> list[Table]:
    """Measures, writes ``labels.json`` and gives the table."""
    result = measure(config)
    record.write_result(config.out / "labels.json", result)
    return [statistics_table(result["labels"])]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("labels", LabelsConfig, report, arguments)


if __name__ == "__main__":
    sys.exit(main())
