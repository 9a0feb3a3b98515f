"""How many anchors, and which, do grasps need? The paper's Table 2.

Run ``python -m benchmarks.perception table2 --help``.

The paper trains a whole network for each anchor size. Here the networks of a category share all
but the grasp head: a trained backbone is kept as it is, and fresh heads are trained side by side
on its features (``benchmarks.grasp_heads``), on the same views, points and steps. What differs
between rows is then due to the anchors, for a small part of the computation; but the features were
learnt together with a head of the anchors of the network that is given, the affordance is the same
in every row, and a head that could shape the features may do better than any here.
"""

from __future__ import annotations

import time
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.table import Table

from artgym.datasets.generate import GenerationConfig, make_pictures
from artgym.datasets.picture_files import SampleFolder
from artgym.datasets.sets import SETS
from artgym.errors import UnknownNameError
from artgym.files import MANIFEST_NAME, file_sha256
from artgym.geometry.rotations import grasp_angle, matrix_from_quaternion
from artgym.objects import catalog
from artgym.sim.renderer import find_device
from benchmarks import record
from benchmarks.command import cell, require_positive, run
from benchmarks.grasp_heads import HeadKind, HeadTrainingConfig, train_heads
from benchmarks.paper import TABLE_2
from benchmarks.parallel import results_in_order
from benchmarks.policies import load_perception
from benchmarks.views import require_labelled
from icaf4_policy.anchors import (
    ANCHOR_STEPS_DEG,
    AnchorConfig,
    anchors_from_config,
    axis_anchors,
)
from icaf4_policy.checkpoint import load_model
from icaf4_policy.metrics import CHANCE_ROWS, COVERAGE_DEG, PRECISION_DEG, mean_rows

#: What is printed of a row's grasps, with decimals.
_PRINTED = {
    "error_deg": 1,
    **dict.fromkeys((f"precision@{degrees}" for degrees in PRECISION_DEG), 3),
    f"coverage@{COVERAGE_DEG}": 3,
}

#: Random grasps that tell how near the anchors lie.
_SPACING_GRASPS = 4000


@cache
def head_kinds() -> Mapping[str, HeadKind]:
    """The rows, by name.

    "direct" regression; "axis_10" to "axis_45", the paper's anchors every so many degrees; beside
    each as many so3 anchors, named by their number: "so3_1836" to "so3_72"; the last of them in
    the "part_frame"; and of "axis_45" what becomes of it with each thing that the released code
    does otherwise, and with all.
    """
    axis = {step: AnchorConfig(kind="axis", step_deg=step) for step in ANCHOR_STEPS_DEG}
    counts = [len(axis_anchors(step)) for step in ANCHOR_STEPS_DEG]
    anchors = {
        "direct": AnchorConfig(kind="direct"),
        **{f"axis_{step}": kind for step, kind in axis.items()},
        **{f"so3_{count}": AnchorConfig(kind="so3", count=count) for count in counts},
    }
    coarse = axis[ANCHOR_STEPS_DEG[-1]]
    return {
        **{name: HeadKind(anchors=kind) for name, kind in anchors.items()},
        "part_frame": HeadKind(
            anchors=AnchorConfig(kind="so3", count=counts[-1], frame="part"),
        ),
        "sign_blind": HeadKind(anchors=coarse, sign_blind=True),
        "one_pose": HeadKind(anchors=coarse, one_pose=True),
        "softmax": HeadKind(anchors=coarse, one_pose=True, softmax=True),
        "all_residuals": HeadKind(anchors=coarse, one_pose=True, all_residuals=True),
        "released": HeadKind(
            anchors=coarse, sign_blind=True, one_pose=True, softmax=True, all_residuals=True
        ),
    }


@dataclass(frozen=True, kw_only=True)
class AnchorTableConfig:
    """How many anchors, and which, do grasps need? The paper's Table 2, on frozen features.

    Attributes:
        data: folder with {category}/train, made by `artgym generate artimage`.
        work: folder for the networks with the trained heads; an interrupted run goes on with what
            is there.
        category: categories of objects; each needs a trained network of its own.
        rows: anchors to compare, by the names of the table; all of them by default.
        weights: folder with {category}.safetensors, instead of the shipped weights.
        samples: training views a category, each with a successful grasp.
        epochs: passes over them.
        split: whose labelled objects are looked at.
        objects: how many at most, the first that have labels; None for all.
        views: pictures of each labelled joint state.
        seed: of the training, the views, the choice of points and the chance rows.
        workers: processes that look at objects; the numbers do not depend on it.
        labels: folder with {category}/{split}, instead of the shipped labels.
        out: folder for anchor_table.json.
    """

    data: Path
    work: Path
    category: tuple[str, ...] = SETS["artimage"]
    rows: tuple[str, ...] = ()
    weights: Path | None = None
    samples: int = HeadTrainingConfig.samples
    epochs: int = HeadTrainingConfig.epochs
    split: catalog.Split = "test"
    objects: int | None = None
    views: int = 2
    seed: int = 0
    workers: int = 2
    labels: Path | None = None
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        require_positive(self, "samples", "epochs", "objects", "views", "workers")
        for category in self.category:
            catalog.category(category)
        for row in self.rows:
            if row not in head_kinds():
                raise UnknownNameError("row", row, head_kinds())

    @property
    def kinds(self) -> Mapping[str, HeadKind]:
        """The heads to compare, by name."""
        return {name: head_kinds()[name] for name in self.rows or head_kinds()}


@dataclass(frozen=True, kw_only=True)
class AnchorViewsTask:
    """Which object is looked at, from how many places, by which networks.

    Attributes:
        category: of the networks.
        object_id: a labelled object.
        views: pictures of each labelled joint state.
        seed: of the views, the choice of points and the chance rows.
        label_root: folder of labels; None for the shipped ones.
        work: folder with the networks, see ``benchmarks.grasp_heads.head_path``.
        rows: their names.
    """

    category: str
    object_id: str
    views: int
    seed: int
    label_root: Path | None
    work: Path
    rows: tuple[str, ...]


def score_rows(task: AnchorViewsTask) -> list[dict[str, dict[str, float]]]:
    """The metrics of ``evaluate_grasps``, by row, for each view.

    All rows have the same pictures and points; the first has the chance rows too.
    """
    from icaf4_policy.evaluation import evaluate_grasps

    config = GenerationConfig(views=task.views, seed=task.seed)
    pictures = make_pictures(task.object_id, config, task.label_root)
    samples = [sample for picture in pictures for sample in picture.samples]
    scores: list[dict[str, dict[str, float]]] = [{} for _ in samples]
    for row in task.rows:
        perception = load_perception(task.category, task.work / row)
        for number, sample in enumerate(samples):
            rng = np.random.default_rng([task.seed, zlib.crc32(task.object_id.encode()), number])
            scores[number][row] = evaluate_grasps(
                perception, sample, rng, chance=row == task.rows[0]
            )
    return scores


def anchor_spacing(kind: AnchorConfig) -> dict[str, float]:
    """How many anchors there are, and how far a random grasp is from the nearest, degrees.

    Returns:
        "anchors" (L), "mean_deg" and "covering_deg", the largest of some thousand.
    """
    anchors = anchors_from_config(kind)
    # Of a normal distribution in four dimensions all directions are equally likely.
    R = matrix_from_quaternion(np.random.default_rng(0).normal(size=(_SPACING_GRASPS, 4)))
    nearest, _ = anchors.match(R)
    degrees = np.degrees(grasp_angle(R, anchors.rotations[nearest]))
    return {
        "anchors": len(anchors),
        "mean_deg": round(float(degrees.mean()), 2),
        "covering_deg": round(float(degrees.max()), 2),
    }


def measure(config: AnchorTableConfig) -> dict[str, Any]:
    """Trains the heads and looks at all objects; a result for ``record.write_result``.

    Raises:
        InvalidArgumentError: a category has no labelled objects, or no training samples with
            grasps.
        RendererUnavailableError: no device here can render.
        DamagedFileError: weights, samples or labels are missing or damaged.
    """
    began = time.perf_counter()
    find_device()
    torch.set_num_threads(1)
    # All that may be missing is looked for before anything is trained.
    tasks = {category: _tasks(config, category) for category in config.category}
    folders = {c: SampleFolder(config.data / c / "train") for c in config.category}
    networks = {c: load_perception(c, config.weights).model for c in config.category}
    training = HeadTrainingConfig(samples=config.samples, epochs=config.epochs, seed=config.seed)
    facts = {}
    for category in config.category:
        manifest = folders[category].folder / MANIFEST_NAME
        first, *_ = train_heads(
            networks[category],
            folders[category],
            config.kinds,
            config.work,
            training,
            samples_sha256=file_sha256(manifest),
        )
        facts[category] = load_model(first)[1]["training"]
    trained = time.perf_counter()
    scores = results_in_order(
        score_rows,
        [task for category in config.category for task in tasks[category]],
        workers=config.workers,
        description="anchors",
        unit="object",
    )
    ended = time.perf_counter()
    scored = iter(scores)
    categories = {}
    for category in config.category:
        views = [view for _ in tasks[category] for view in next(scored)]
        categories[category] = {
            "network_anchors": asdict(networks[category].config.anchors),
            "network_sha256": facts[category]["network_sha256"],
            "training_samples": facts[category]["training_samples"],
            "objects": [task.object_id for task in tasks[category]],
            **category_result(views),
            "paper": TABLE_2.get(category, {}),
        }
    kinds = {k: v.anchors for k, v in config.kinds.items() if v.anchors.kind != "direct"}
    # Where things lie does not change the numbers.
    places = ("data", "work", "out")
    return {
        **record.provenance("benchmarks.perception"),
        "config": {k: v for k, v in asdict(config).items() if k not in places},
        "training": asdict(training),
        "seconds": {"training": round(trained - began, 1), "views": round(ended - trained, 1)},
        "anchors": {name: anchor_spacing(kind) for name, kind in kinds.items()},
        "categories": categories,
    }


def _tasks(config: AnchorTableConfig, category: str) -> list[AnchorViewsTask]:
    return [
        AnchorViewsTask(
            category=category,
            object_id=object_id,
            views=config.views,
            seed=config.seed,
            label_root=config.labels and config.labels.absolute(),
            work=config.work.absolute(),
            rows=tuple(config.kinds),
        )
        for object_id in require_labelled(category, config)
    ]


def category_result(views: Sequence[Mapping[str, Mapping[str, float]]]) -> dict[str, Any]:
    """What the views of a category say.

    Args:
        views: metrics of ``evaluate_grasps`` by row, the first row with the chance rows.

    Returns:
        "views"; "judged", those of them that show a graspable point which the network calls so;
        "affordance_iou" and "affordance_miou", which all rows share; "rows" and "chance": the
        grasp metrics by row, at graspable points that are called so, and as "calls" at all points
        that are called so.
    """
    first = next(iter(views[0]))
    shared = mean_rows(view[first] for view in views)
    key = "grasp/network/error_deg"
    return {
        "views": len(views),
        "judged": sum(not np.isnan(view[first].get(key, np.nan)) for view in views),
        **{name: round(shared[name], 5) for name in ("affordance_iou", "affordance_miou")},
        "rows": {
            row: _grasp_row(mean_rows(view[row] for view in views), "network") for row in views[0]
        },
        "chance": {source: _grasp_row(shared, source) for source in CHANCE_ROWS},
    }


def _grasp_row(metrics: Mapping[str, float], source: str) -> dict[str, Any]:
    nan = float("nan")
    return {
        **{key: round(metrics.get(f"grasp/{source}/{key}", nan), 5) for key in _PRINTED},
        "calls": {
            key: round(metrics.get(f"grasp_calls/{source}/{key}", nan), 5) for key in _PRINTED
        },
    }


def table_of(category: str, result: Mapping[str, Any], anchors: Mapping[str, Any]) -> Table:
    """The rows of a category, the chance rows and the paper's figures beside them."""
    table = Table(
        title=f"{category}: {len(result['objects'])} unseen objects, {result['judged']} of "
        f"{result['views']} views; affordance IoU {result['affordance_iou']:.3f}, mIoU "
        f"{result['affordance_miou']:.3f}; heads on a frozen backbone"
    )
    table.add_column("anchors")
    for name in ("L", "mean, deg", "covering, deg", "error, deg"):
        table.add_column(name, justify="right")
    for degrees in PRECISION_DEG:
        table.add_column(f"within {degrees} deg", justify="right")
    table.add_column(f"covered at {COVERAGE_DEG} deg", justify="right")
    for name in ("paper: affordance", "error, deg"):
        table.add_column(name, justify="right", style="dim")
    for name, row in (*result["rows"].items(), *result["chance"].items()):
        spacing, paper = anchors.get(name), result["paper"].get(name)
        table.add_row(
            name,
            *(("", "", "") if spacing is None else map(str, spacing.values())),
            *(cell(row[key], decimals) for key, decimals in _PRINTED.items()),
            *(("", "") if paper is None else map(str, paper)),
        )
    return table


def report(config: AnchorTableConfig) -> list[Table]:
    """Measures, writes ``anchor_table.json`` and gives the tables."""
    result = measure(config)
    record.write_result(config.out / "anchor_table.json", result)
    return [
        table_of(category, row, result["anchors"]) for category, row in result["categories"].items()
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("anchor_table", AnchorTableConfig, report, arguments)
