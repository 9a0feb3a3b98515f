"""How well does the network see objects that it has never seen?

Run ``python -m benchmarks.perception --help``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from rich.table import Table

from artgym.annotation.annotate import labelled_ids
from artgym.errors import InvalidArgumentError
from artgym.objects import catalog
from artgym.sim.renderer import find_device
from benchmarks import record
from benchmarks.command import run
from benchmarks.paper import TABLE_1
from benchmarks.parallel import results_in_order
from benchmarks.policies import load_perception, trained_categories
from benchmarks.views import ViewsTask, score_views
from icaf4_policy.metrics import CHANCE_ROWS, COVERAGE_DEG, PRECISION_DEG, mean_rows

#: Rows of the first table: metric, what is printed, decimals.
_PRINTED = (
    ("part_miou", "part segmentation, mIoU", 3),
    ("parts_found", "parts found, share", 3),
    ("part_rotation_deg", "part rotation error, deg", 1),
    ("part_translation_m", "part translation error, m", 4),
    ("part_translation_percent", "  in % of the object's diameter", 1),
    ("part_translation", "  in the paper's unit", 3),
    ("object_rotation_deg", "object rotation error, deg", 1),
    ("object_translation_m", "object translation error, m", 4),
    ("object_translation_percent", "  in % of the object's diameter", 1),
    ("object_translation", "  in the paper's unit", 3),
    ("affordance_iou", "affordance, IoU of graspable", 3),
    ("affordance_miou", "affordance, mIoU", 3),
    ("joint_type_accuracy", "joint type, accuracy", 3),
    ("joint_axis_deg", "joint axis error, deg", 1),
    ("joint_pivot_m", "joint pivot error, m", 4),
    ("joint_pivot_percent", "  in % of the object's diameter", 1),
    ("grasp/network/error_deg", "grasp best-match error, deg", 1),
    ("grasp_points_called", "graspable points called so, share", 3),
    ("executed", "best grasp succeeds in physics, share", 3),
    ("label_density", "tries that succeed, share", 3),
    ("label_density_graspable", "  at graspable points", 3),
)


@dataclass(frozen=True, kw_only=True)
class PerceptionConfig:
    """How well does the network see objects that it has never seen?

    Attributes:
        category: categories of objects; by default those with shipped weights.
        split: whose labelled objects are looked at.
        objects: how many at most, the first that have labels; None for all.
        views: pictures of each labelled joint state.
        seed: of the views, the choice of points and the chance rows.
        workers: processes; the numbers do not depend on it.
        weights: folder with {category}.safetensors, instead of the shipped weights.
        labels: folder with {category}/{split}, instead of the shipped labels.
        out: folder for perception.json.
    """

    category: tuple[str, ...] = field(default_factory=trained_categories)
    split: catalog.Split = "test"
    objects: int | None = None
    views: int = 4
    seed: int = 0
    workers: int = 2
    weights: Path | None = None
    labels: Path | None = None
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        for name in ("objects", "views", "workers"):
            value = getattr(self, name)
            if value is not None and value < 1:
                raise InvalidArgumentError(f"{name}={value}: expected 1 or more.")
        for category in self.category:
            catalog.category(category)


def measure(config: PerceptionConfig) -> dict[str, Any]:
    """Looks at all objects; a result for ``record.write_result``.

    Raises:
        InvalidArgumentError: a category has no labelled objects.
        RendererUnavailableError: no device here can render.
        DamagedFileError: weights or labels are missing or damaged.
    """
    began = time.perf_counter()
    find_device()
    weights = config.weights and config.weights.absolute()
    tasks = []
    for category in config.category:
        load_perception(category, weights)
        ids = labelled_ids(category, config.split, config.labels)[: config.objects]
        if not ids:
            raise InvalidArgumentError(
                f"no labels for {category}/{config.split}: run `artgym annotate --category "
                f"{category} --split {config.split}` first."
            )
        tasks += [
            ViewsTask(
                category=category,
                object_id=object_id,
                views=config.views,
                seed=config.seed,
                label_root=config.labels and config.labels.absolute(),
                weights=weights,
            )
            for object_id in ids
        ]
    rows = results_in_order(
        score_views, tasks, workers=config.workers, description="perception", unit="object"
    )
    scored = list(zip(tasks, rows, strict=True))
    return {
        **record.provenance("benchmarks.perception"),
        "config": asdict(config),
        "seconds": round(time.perf_counter() - began, 1),
        "objects": {
            category: [t.object_id for t in tasks if t.category == category]
            for category in config.category
        },
        "views": {c: sum(len(r) for t, r in scored if t.category == c) for c in config.category},
        "metrics": {
            category: _rounded(
                mean_rows(row for t, r in scored if t.category == category for row in r)
            )
            for category in config.category
        },
        "by_object": {
            task.object_id: _rounded(
                {name: value for name, value in mean_rows(row).items() if _is_main(name)}
            )
            for task, row in scored
        },
        "paper": {category: TABLE_1.get(category, {}) for category in config.category},
    }


def _is_main(name: str) -> bool:
    """Whether a metric is kept for each object."""
    return any(name == printed for printed, _, _ in _PRINTED)


def _rounded(row: Mapping[str, float]) -> dict[str, float]:
    return {name: round(value, 5) for name, value in row.items()}


def metrics_table(metrics: Mapping[str, Mapping[str, float]]) -> Table:
    """Metrics by category, the paper's numbers beside them."""
    table = Table(title="views of unseen objects; paper: ICAF-4 on ArtImage, other objects")
    table.add_column("metric")
    for category in metrics:
        table.add_column(category, justify="right")
        table.add_column("paper", justify="right", style="dim")
    for name, shown, decimals in _PRINTED:
        cells = []
        for category, values in metrics.items():
            for value in (values.get(name), TABLE_1.get(category, {}).get(name)):
                cells.append(_cell(value, decimals))
        table.add_row(shown, *cells)
    return table


def grasp_table(category: str, values: Mapping[str, float]) -> Table:
    """The network's grasps beside those of chance, at the points of ``evaluate_sample``."""
    table = Table(title=f"{category}: grasps at graspable points")
    table.add_column("points")
    table.add_column("proposals from")
    table.add_column("error, deg", justify="right")
    for degrees in PRECISION_DEG:
        table.add_column(f"within {degrees} deg", justify="right")
    table.add_column(f"covered at {COVERAGE_DEG} deg", justify="right")
    for prefix, points in (("grasp", "graspable, called so"), ("grasp_calls", "all calls")):
        for source in ("network", *CHANCE_ROWS):
            row = {key: values.get(f"{prefix}/{source}/{key}") for key in _grasp_keys()}
            cells = [_cell(value, 1 if key == "error_deg" else 3) for key, value in row.items()]
            table.add_row(points, source, *cells)
    return table


def _grasp_keys() -> list[str]:
    return ["error_deg", *(f"precision@{d}" for d in PRECISION_DEG), f"coverage@{COVERAGE_DEG}"]


def _cell(value: float | None, decimals: int) -> str:
    """A number; a dash where there is none."""
    return "-" if value is None or value != value else f"{value:.{decimals}f}"


def report(config: PerceptionConfig) -> list[Table]:
    """Measures, writes ``perception.json`` and gives the tables."""
    result = measure(config)
    record.write_result(config.out / "perception.json", result)
    metrics = result["metrics"]
    return [metrics_table(metrics), *(grasp_table(name, metrics[name]) for name in metrics)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("perception", PerceptionConfig, report, arguments)


if __name__ == "__main__":
    sys.exit(main())
