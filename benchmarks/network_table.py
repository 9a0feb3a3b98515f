"""One network for all categories or one each, with colours or normals: what does a choice bring?

Run ``python -m benchmarks.perception networks --help``.

Every row trains networks anew with the same samples, steps and seed, differs from "one each" in
one choice, and is looked at on validation objects: choices are not made on test objects. Trainings
are shorter than those of the shipped networks, so that rows say what is better after little
training. "another seed" differs by chance alone: what differs no more than that says nothing.
"""

from __future__ import annotations

import contextlib
import io
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.table import Table

from artgym.datasets.picture_files import SampleFolder
from artgym.datasets.sample import Sample
from artgym.datasets.sets import SETS
from artgym.errors import InvalidArgumentError, UnknownNameError
from artgym.objects import catalog
from artgym.sim.renderer import find_device
from benchmarks import record
from benchmarks.command import cell, require_positive, run
from benchmarks.parallel import results_in_order
from benchmarks.views import score_views, views_tasks
from icaf4_policy.anchors import AnchorConfig
from icaf4_policy.checkpoint import description_path, load_model
from icaf4_policy.losses import LossWeights
from icaf4_policy.metrics import COVERAGE_DEG, mean_rows
from icaf4_policy.shipped import weights_path
from icaf4_policy.training import TrainingConfig, train

#: Of ``TrainingConfig``, what each row does otherwise than the first.
CHOICES: Mapping[str, Mapping[str, Any]] = {
    "one_each": {},
    "another_seed": {"seed": 1},
    "one_for_all": {},
    "no_color": {"features": "none"},
    "normals": {"features": "normals"},
    "color_normals": {"features": "color_normals"},
    "soft_iou": {"segmentation_loss": "soft_iou"},
}

#: The row with a single network, which is told the category.
_FOR_ALL = "one_for_all"

#: What is printed, with headings and decimals.
COLUMNS: Mapping[str, tuple[str, int]] = {
    "part_miou": ("parts, mIoU", 3),
    "part_rotation_deg": ("part, deg", 1),
    "part_translation_percent": ("% of diameter", 1),
    "object_rotation_deg": ("object, deg", 1),
    "joint_axis_deg": ("joint axis, deg", 1),
    "affordance_iou": ("affordance, IoU", 3),
    "affordance_miou": ("mIoU", 3),
    "grasp/network/error_deg": ("grasp error, deg", 1),
    f"grasp/network/coverage@{COVERAGE_DEG}": (f"covered at {COVERAGE_DEG} deg", 2),
    "executed": ("executed", 2),
}

#: The row of the means over the categories.
MEAN = "mean"


@dataclass(frozen=True, kw_only=True)
class NetworkTableConfig:
    """What does each choice of the network and its training bring, at the same training?

    Attributes:
        data: folder with {category}/train and {category}/val, made by `artgym generate artimage`.
        work: folder for the networks; those that are there are not trained again.
        category: categories of objects.
        rows: choices to compare, by the names of the table; all of them by default.
        samples: training views a category, evenly spaced; a quarter as many choose the epoch.
        epochs: passes over them.
        split: whose labelled objects are looked at.
        objects: how many at most, the first that have labels; None for all.
        views: pictures of each labelled joint state.
        seed: of the trainings, the views and the choice of points.
        workers: processes; the numbers do not depend on it.
        labels: folder with {category}/{split}, instead of the shipped labels.
        out: folder for network_table.json.
    """

    data: Path
    work: Path
    category: tuple[str, ...] = SETS["artimage"]
    rows: tuple[str, ...] = ()
    samples: int = 600
    epochs: int = 6
    split: catalog.Split = "val"
    objects: int | None = None
    views: int = 1
    seed: int = 0
    workers: int = 2
    labels: Path | None = None
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        require_positive(self, "samples", "epochs", "objects", "views", "workers")
        for category in self.category:
            catalog.category(category)
        for row in self.rows:
            if row not in CHOICES:
                raise UnknownNameError("row", row, CHOICES)

    def training(self, row: str, categories: tuple[str, ...]) -> TrainingConfig:
        """How a network of a row is trained."""
        changes = {"features": "color", **CHOICES[row]}
        seed = self.seed + changes.pop("seed", 0)
        return TrainingConfig(
            category=categories,
            epochs=self.epochs,
            num_grasp_points=192,
            anchors=AnchorConfig(kind="so3", count=144),
            losses=LossWeights(anchors=10.0),
            seed=seed,
            **changes,
        )


@dataclass(frozen=True, kw_only=True)
class TrainingTask:
    """A network to train.

    Attributes:
        training: how.
        data: folder with the samples.
        samples: of each category.
        folder: where its weights go, under the name of every category.
    """

    training: TrainingConfig
    data: Path
    samples: int
    folder: Path


def train_network(task: TrainingTask) -> float | None:
    """Trains a network where it is missing; the processor time of that in seconds.

    Raises:
        InvalidArgumentError: what is there was trained otherwise.
        DamagedFileError: samples or weights are missing or damaged.
    """
    torch.set_num_threads(1)
    paths = [weights_path(category, task.folder) for category in task.training.category]
    seconds = None
    if not all(path.exists() and description_path(path).exists() for path in paths):
        began = time.process_time()
        task.folder.mkdir(parents=True, exist_ok=True)
        # What it prints of each validation stands in the description too.
        with contextlib.redirect_stdout(io.StringIO()):
            train(
                task.training,
                _samples(task, "train", task.samples),
                _samples(task, "val", max(task.samples // 4, 1)),
                paths[0],
            )
        for path in paths[1:]:
            shutil.copyfile(paths[0], path)
            shutil.copyfile(description_path(paths[0]), description_path(path))
        seconds = time.process_time() - began
    for path in paths:
        found = load_model(path)[1]["training"]["config"]
        # As JSON has it.
        if _listed(found) != _listed(asdict(task.training)):
            raise InvalidArgumentError(
                f"{path} was trained otherwise; remove it, or choose another work folder."
            )
    return seconds


def _listed(config: Any) -> Any:
    """A configuration with lists in place of tuples."""
    if isinstance(config, Mapping):
        return {key: _listed(value) for key, value in config.items()}
    return [_listed(v) for v in config] if isinstance(config, (tuple, list)) else config


def _samples(task: TrainingTask, split: str, count: int) -> Iterator[Sample]:
    """Evenly spaced samples of every category."""
    for category in task.training.category:
        folder = SampleFolder(task.data / category / split)
        chosen = np.linspace(0, len(folder) - 1, min(count, len(folder))).round().astype(int)
        for i in chosen.tolist():
            yield folder[i]


def measure(config: NetworkTableConfig) -> dict[str, Any]:
    """Trains the networks and looks at all objects; a result for ``record.write_result``.

    Raises:
        InvalidArgumentError: a category has no labelled objects, or a network in the work folder
            was trained otherwise.
        RendererUnavailableError: no device here can render.
        DamagedFileError: samples, weights or labels are missing or damaged.
    """
    find_device()
    rows = config.rows or tuple(CHOICES)
    folders = {row: config.work.absolute() / row for row in rows}
    views = [task for c in config.category for task in views_tasks(c, config, folders)]
    trainings = {}
    for row in rows:
        groups = [config.category] if row == _FOR_ALL else [(c,) for c in config.category]
        for categories in groups:
            trainings[row, categories] = TrainingTask(
                training=config.training(row, categories),
                data=config.data.absolute(),
                samples=config.samples,
                folder=folders[row],
            )
    seconds = results_in_order(
        train_network,
        list(trainings.values()),
        workers=config.workers,
        description="networks",
        unit="network",
    )
    scores = results_in_order(
        score_views, views, workers=config.workers, description="views", unit="object"
    )
    metrics: dict[str, dict[str, dict[str, float]]] = {}
    for category in config.category:
        mine = [s for task, s in zip(views, scores, strict=True) if task.category == category]
        metrics[category] = {r: _printed(mean_rows(v for s in mine for v in s[r])) for r in rows}
    metrics[MEAN] = {r: _printed(mean_rows(metrics[c][r] for c in config.category)) for r in rows}
    places = ("data", "work", "out")
    return {
        **record.provenance("benchmarks.perception"),
        # Where things lie does not change the numbers.
        "config": {k: v for k, v in asdict(config).items() if k not in places},
        "choices": {row: dict(CHOICES[row]) for row in rows},
        "training_seconds": {
            row: _total(s for (r, _), s in zip(trainings, seconds, strict=True) if r == row)
            for row in rows
        },
        "views": {
            c: sum(
                len(s[rows[0]]) for task, s in zip(views, scores, strict=True) if task.category == c
            )
            for c in config.category
        },
        "columns": dict(COLUMNS),
        "metrics": metrics,
    }


def _printed(row: Mapping[str, float]) -> dict[str, float]:
    return {name: round(row.get(name, float("nan")), 5) for name in COLUMNS}


def _total(seconds: Iterator[float | None]) -> float | None:
    """Of a row's networks; None where one had been trained before."""
    found = list(seconds)
    return None if None in found else round(sum(s for s in found if s is not None), 1)


def table_of(category: str, rows: Mapping[str, Mapping[str, float]]) -> Table:
    """The rows of a category, or of the mean."""
    table = Table(title=f"{category}: networks after the same training, validation objects")
    table.add_column("choice")
    for heading, _ in COLUMNS.values():
        table.add_column(heading, justify="right")
    for row, values in rows.items():
        cells = [cell(values[name], decimals) for name, (_, decimals) in COLUMNS.items()]
        table.add_row(row.replace("_", " "), *cells)
    return table


def report(config: NetworkTableConfig) -> list[Table]:
    """Measures, writes ``network_table.json`` and gives the tables."""
    result = measure(config)
    record.write_result(config.out / "network_table.json", result)
    return [table_of(category, rows) for category, rows in result["metrics"].items()]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("network_table", NetworkTableConfig, report, arguments)
