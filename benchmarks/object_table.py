"""Single objects that no network has seen: the paper's Table 1, baselines and chance included.

Run ``python -m benchmarks.perception table1 --help``.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from rich.table import Table

from artgym.datasets.sets import SETS
from artgym.errors import InvalidArgumentError
from artgym.objects import catalog
from artgym.sim.renderer import find_device
from benchmarks import record
from benchmarks.baselines import BaselinesConfig, train_baselines
from benchmarks.command import cell, require_positive, run
from benchmarks.paper import METHOD_LABELS, TABLE_1
from benchmarks.parallel import results_in_order
from benchmarks.policies import load_perception
from benchmarks.views import score_views, views_tasks
from icaf4_policy.metrics import CHANCE_ROWS, COVERAGE_DEG, PRECISION_DEG, mean_rows
from icaf4_policy.shipped import trained_categories

#: Columns of the printed tables: metric, heading, decimals.
_COLUMNS = (
    ("part_miou", "part mIoU", 3),
    ("parts_found", "found", 3),
    ("part_rotation_deg", "deg", 1),
    ("part_translation_m", "m", 4),
    ("part_translation_percent", "%", 1),
    ("object_rotation_deg", "object: deg", 1),
    ("object_translation_m", "m", 4),
    ("object_translation_percent", "%", 1),
    ("affordance_iou", "graspable IoU", 3),
    ("affordance_miou", "mIoU", 3),
    ("grasp/network/error_deg", "grasp deg", 1),
    (f"grasp/network/coverage@{COVERAGE_DEG}", f"at {COVERAGE_DEG}", 2),
    ("executed", "executed", 2),
)

#: Metrics that say more about the network; kept beside the columns.
_MORE = (
    "joint_type_accuracy",
    "joint_axis_deg",
    "joint_pivot_m",
    "joint_pivot_percent",
    "grasp_points_called",
    "label_density",
    "label_density_graspable",
)

#: What is promised of the network, of every category and of their mean: least or most.
TARGETS: Mapping[str, tuple[str, float]] = {
    "part_miou": (">=", 0.95),
    "part_rotation_deg": ("<=", 3.0),
    "part_translation_m": ("<=", 0.03),
    "part_translation_percent": ("<=", 5.0),
    "object_rotation_deg": ("<=", 3.0),
    "object_translation_m": ("<=", 0.03),
    "object_translation_percent": ("<=", 5.0),
    "affordance_iou": (">=", 0.9),
    "grasp/network/error_deg": ("<=", 10.0),
    f"grasp/network/coverage@{COVERAGE_DEG}": (">=", 0.5),
    "executed": (">=", 0.75),
}

#: The row of the means over the categories of the paper's table.
MEAN = "mean of ArtImage"


@dataclass(frozen=True, kw_only=True)
class ObjectTableConfig:
    """How well are single objects seen that no network has seen before?

    Attributes:
        category: categories of objects; by default those with shipped weights.
        split: whose labelled objects are looked at; choose on "val", never on "test".
        objects: how many at most, the first that have labels; None for all.
        views: pictures of each labelled joint state.
        seed: of the views, the choice of points and the chance rows.
        workers: processes; the numbers do not depend on it.
        weights: folder with {category}.safetensors, instead of the shipped weights.
        another_seed: folder with {category}.safetensors of some categories, trained by the same
            command with another seed: what chance in training makes of the same.
        data: folder with {category}/train and val, made by `artgym generate artimage`, that the
            baselines are trained with; without one, only the network and chance are measured.
        work: folder for the baselines' networks; those that are there are not trained again.
        baselines: categories that baselines are trained for; those of the paper's table.
        labels: folder with {category}/{split}, instead of the shipped labels.
        depth_noise: give depth the errors of a real sensor, which no network has learnt from.
        out: folder for object_table.json, or object_table_noise.json.
    """

    category: tuple[str, ...] = field(default_factory=trained_categories)
    split: catalog.Split = "test"
    objects: int | None = None
    views: int = 2
    seed: int = 0
    workers: int = 2
    weights: Path | None = None
    another_seed: Path | None = None
    data: Path | None = None
    work: Path | None = None
    baselines: tuple[str, ...] = SETS["artimage"]
    labels: Path | None = None
    depth_noise: bool = False
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        require_positive(self, "objects", "views", "workers")
        for category in self.category:
            catalog.category(category)
        if (self.data is None) != (self.work is None):
            raise InvalidArgumentError(
                f"data={self.data} and work={self.work}: give both, to train the baselines, or "
                "neither."
            )

    @property
    def result_name(self) -> str:
        """What the result is called: pictures with and without noise have one each."""
        return "object_table_noise" if self.depth_noise else "object_table"

    def weights_of(self, category: str) -> dict[str, Path | None]:
        """The folder of each method's weights for a category; None for the shipped ones."""
        own = self.weights and self.weights.absolute()
        folders = {"icaf4": own, "no_faces": own}
        if self.another_seed and (self.another_seed / f"{category}.safetensors").exists():
            folders["another_seed"] = self.another_seed.absolute()
        if self.work and category in self.baselines:
            folders |= {m: self.work.absolute() / m for m in TABLE_1 if m not in folders}
        return folders


def measure(config: ObjectTableConfig) -> dict[str, Any]:
    """Looks at all objects; a result for ``record.write_result``.

    Raises:
        InvalidArgumentError: a category has no labelled objects.
        RendererUnavailableError: no device here can render.
        DamagedFileError: weights or labels are missing or damaged.
    """
    began = time.perf_counter()
    find_device()
    if config.data and config.work:
        for category in config.category:
            if category in config.baselines:
                train_baselines(
                    category, config.data, config.work, config.weights, BaselinesConfig()
                )
    tasks = []
    for category in config.category:
        methods = config.weights_of(category)
        for folder in methods.values():
            load_perception(category, folder)
        tasks += views_tasks(category, config, methods, depth_noise=config.depth_noise)
    rows = results_in_order(
        score_views, tasks, workers=config.workers, description="perception", unit="object"
    )
    scored = list(zip(tasks, rows, strict=True))
    metrics = {
        category: {
            method: _rounded(
                mean_rows(row for t, r in scored if t.category == category for row in r[method])
            )
            for method in config.weights_of(category)
        }
        for category in config.category
    }
    return {
        **record.provenance("benchmarks.perception"),
        # Where things lie does not change the numbers.
        "config": {k: v for k, v in asdict(config).items() if k not in ("data", "work", "out")},
        "seconds": round(time.perf_counter() - began, 1),
        "targets": dict(TARGETS),
        "views": {
            c: sum(len(r["icaf4"]) for t, r in scored if t.category == c) for c in config.category
        },
        "metrics": metrics | _means(metrics),
        "by_object": {
            task.object_id: {
                name: value
                for name, value in _rounded(mean_rows(row["icaf4"])).items()
                if name in _MORE or any(name == column for column, _, _ in _COLUMNS)
            }
            for task, row in scored
        },
        "paper": TABLE_1,
    }


def _means(
    metrics: Mapping[str, Mapping[str, Mapping[str, float]]],
) -> dict[str, dict[str, dict[str, float]]]:
    """The mean over the paper's categories, if all are there, of each method that has all."""
    if not set(SETS["artimage"]) <= set(metrics):
        return {}
    mine = [metrics[category] for category in SETS["artimage"]]
    shared = [method for method in mine[0] if all(method in row for row in mine)]
    return {MEAN: {m: _rounded(mean_rows(row[m] for row in mine)) for m in shared}}


def _rounded(row: Mapping[str, float]) -> dict[str, float]:
    return {name: round(value, 5) for name, value in row.items()}


def category_table(category: str, result: Mapping[str, Any]) -> Table:
    """All methods on one category, the paper's rows beneath ours, chance, and what is promised."""
    title = (
        f"{category}, unseen objects; poses in degrees, metres and % of the diameter; grasps: "
        f"best-match error, covered at {COVERAGE_DEG} deg, executed; paper: ArtImage"
    )
    table = Table(title=title)
    table.add_column("method")
    for _, heading, _ in _COLUMNS:
        table.add_column(heading, justify="right")
    for method, values in result["metrics"][category].items():
        table.add_row(METHOD_LABELS[method], *_cells(values))
        paper = result["paper"].get(method, {}).get(category)
        if paper:
            # The paper's translations are in another unit.
            table.add_row("  paper", *_cells(paper), style="dim")
    ours = result["metrics"][category]["icaf4"]
    for name in CHANCE_ROWS:
        row = {
            key.replace(f"/{name}/", "/network/"): value
            for key, value in ours.items()
            if key.startswith(f"grasp/{name}/")
        }
        table.add_row(name.replace("_", " "), *_cells(row))
    promised = [" ".join(map(str, TARGETS.get(name, ()))) for name, _, _ in _COLUMNS]
    table.add_row("promised", *promised, style="bold")
    return table


def _cells(values: Mapping[str, float]) -> list[str]:
    return [cell(values.get(name), decimals) for name, _, decimals in _COLUMNS]


def grasp_table(metrics: Mapping[str, Mapping[str, Mapping[str, float]]]) -> Table:
    """The network's grasps beside those of chance, at the points of ``evaluate_sample``."""
    table = Table(title="grasps of ICAF-4 at graspable points")
    for name in ("category", "points", "proposals from"):
        table.add_column(name)
    table.add_column("error, deg", justify="right")
    for degrees in PRECISION_DEG:
        table.add_column(f"within {degrees} deg", justify="right")
    table.add_column(f"covered at {COVERAGE_DEG} deg", justify="right")
    keys = ["error_deg", *(f"precision@{d}" for d in PRECISION_DEG), f"coverage@{COVERAGE_DEG}"]
    for category, methods in metrics.items():
        values = methods["icaf4"]
        for prefix, points in (("grasp", "graspable, called so"), ("grasp_calls", "all calls")):
            for source in ("network", *CHANCE_ROWS):
                row = {key: values.get(f"{prefix}/{source}/{key}") for key in keys}
                cells = [cell(value, 1 if key == "error_deg" else 3) for key, value in row.items()]
                table.add_row(category, points, source, *cells)
    return table


def tables_from_result(result: Mapping[str, Any]) -> Iterable[Table]:
    """The tables for a person to read."""
    metrics = result["metrics"]
    return [*(category_table(category, result) for category in metrics), grasp_table(metrics)]


def report(config: ObjectTableConfig) -> Iterable[Table]:
    """Measures, writes the result and gives the tables."""
    result = measure(config)
    record.write_result(config.out / f"{config.result_name}.json", result)
    return tables_from_result(result)


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("object_table", ObjectTableConfig, report, arguments)
