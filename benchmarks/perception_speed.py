"""How fast is the network, and all that follows from a cloud?

Run ``python -m benchmarks.speed perception --help``. The poses of the parts are timed by
``benchmarks.speed poses``.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.table import Table
from tqdm import tqdm

from artgym.datasets.generate import GenerationConfig, make_pictures
from artgym.datasets.sample import Sample
from artgym.errors import InvalidArgumentError
from artgym.objects import catalog
from benchmarks import record
from benchmarks.command import run
from benchmarks.env_speed import interleaved, ratio_row
from benchmarks.plain_pointnet2 import plain_features
from benchmarks.policies import load_perception
from icaf4_policy.cloud import choose_points, level_points
from icaf4_policy.features import point_inputs
from icaf4_policy.inference import Perception
from icaf4_policy.shipped import trained_categories

#: What is promised: times plain torch, its largest difference, clouds a second, p99 over p50.
TARGETS = {"times_plain": 6.0, "difference": 1e-4, "clouds_a_second": 15.0, "p99_over_p50": 2.0}


@dataclass(frozen=True, kw_only=True)
class PerceptionSpeedConfig:
    """How fast is the network, and all that follows from a cloud?

    Attributes:
        category: whose weights and test objects.
        pairs: interleaved pairs of the backbone and its plain twin, a category.
        clouds: how many clouds are looked at from points to ranked grasps, a category.
        seed: of the choice of points and of the fits.
        weights: folder with {category}.safetensors, instead of the shipped weights.
        out: folder for perception_speed.json.
    """

    category: tuple[str, ...] = field(default_factory=trained_categories)
    pairs: int = 15
    clouds: int = 200
    seed: int = 0
    weights: Path | None = None
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        if self.pairs < 7 or self.clouds < 1:
            raise InvalidArgumentError(
                f"pairs={self.pairs}, clouds={self.clouds}: expected at least 7 and 1."
            )


def measure(config: PerceptionSpeedConfig) -> dict[str, Any]:
    """Times every category on one thread; writes ``perception_speed.json``."""
    torch.set_num_threads(1)
    rows = {}
    for category in config.category:
        perception = load_perception(category, config.weights)
        object_id = catalog.object_ids(category, "test", 1)[0]
        pictures = make_pictures(object_id, GenerationConfig(views=1, seed=config.seed))
        samples = [picture.samples[0] for picture in pictures]
        rows[category] = {
            "backbone": _backbone_row(perception, samples, config),
            "clouds": _cloud_row(perception, samples, config),
        }
    result = {
        **record.provenance("benchmarks.speed"),
        "config": {name: value for name, value in asdict(config).items() if name != "out"},
        "targets": TARGETS,
        "rows": rows,
    }
    record.write_result(config.out / "perception_speed.json", result)
    return result


def _network_input(
    perception: Perception, sample: Sample, rng: np.random.Generator
) -> tuple[torch.Tensor, torch.Tensor]:
    """Points (1, N, 3), network units, and their features (1, N, C) as the backbone gets them."""
    seen: dict[str, tuple[torch.Tensor, torch.Tensor]] = {}

    def catch(_: Any, inputs: tuple[torch.Tensor, torch.Tensor]) -> None:
        seen["input"] = inputs

    model = perception.model
    hook = model.backbone.register_forward_pre_hook(catch)
    points_level, _ = level_points(sample.points_camera, sample.R_level_camera)
    pick = choose_points(len(points_level), model.config.num_points, rng)
    features = model.config.features
    normals_level = sample.normals_camera[pick] @ sample.R_level_camera.T.astype(float)
    given = point_inputs(sample.colors[pick], normals_level, features)
    with torch.inference_mode():
        model(
            torch.from_numpy(points_level[pick][None].astype(np.float32)),
            torch.from_numpy(given[None].astype(np.float32) / 255.0),
            torch.tensor([model.config.categories.index(perception.category)]),
            1,
        )
    hook.remove()
    return seen["input"]


@torch.inference_mode()
def _backbone_row(
    perception: Perception, samples: Sequence[Sample], config: PerceptionSpeedConfig
) -> dict[str, Any]:
    """Ours and plain torch in turn, and the largest difference of their outputs."""
    rng = np.random.default_rng(config.seed)
    backbone = perception.model.backbone
    inputs = [_network_input(perception, sample, rng) for sample in samples]
    plains = [plain_features(backbone, *given, first_of_equals=True) for given in inputs]
    difference = max(
        float((backbone(*given) - plain).abs().max())
        for given, plain in zip(inputs, plains, strict=True)
    )

    def ours(i: int) -> tuple[float]:
        return (_seconds(lambda: backbone(*inputs[i % len(inputs)])),)

    def plain(i: int) -> tuple[float]:
        return (_seconds(lambda: plain_features(backbone, *inputs[i % len(inputs)])),)

    with tqdm(total=config.pairs + 1, desc=f"{perception.category}: backbone", unit="pair") as bar:
        (pairs,) = interleaved(ours, plain, config.pairs, bar)
    return {**ratio_row(pairs, TARGETS["times_plain"], config.seed), "difference": difference}


def _seconds(work: Callable[[], object]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def _cloud_row(
    perception: Perception, samples: Sequence[Sample], config: PerceptionSpeedConfig
) -> dict[str, float]:
    """From points to ranked grasps, again and again."""
    seconds = []
    for i in tqdm(range(-3, config.clouds), desc=f"{perception.category}: clouds", unit="cloud"):
        sample = samples[i % len(samples)]
        rng = np.random.default_rng([config.seed, i % 1000])
        seen = (sample.points_camera, sample.colors, sample.R_level_camera)
        spent = _seconds(lambda seen=seen, rng=rng: perception.predict(*seen, rng=rng))
        if i >= 0:
            seconds.append(spent)
    p50, p99 = np.percentile(seconds, [50, 99])
    return {
        "a_second": 1.0 / float(np.mean(seconds)),
        "p50_ms": 1000.0 * float(p50),
        "p99_ms": 1000.0 * float(p99),
    }


def table_from_rows(rows: Mapping[str, Mapping[str, Any]]) -> Table:
    """The table for a person to read."""
    table = Table(title="the network on one thread: 2,048 points to ranked grasps")
    columns = ("category", "backbone, ms", "plain torch, ms", "ratio (lower bound)", "difference")
    for name in (*columns, "clouds a second", "p50, ms", "p99, ms"):
        table.add_column(name, justify="left" if name == "category" else "right")
    for category, row in rows.items():
        backbone, clouds = row["backbone"], row["clouds"]
        table.add_row(
            category,
            f"{1000 * backbone['ours']:.1f}",
            f"{1000 * backbone['other']:.1f}",
            f"{backbone['ratio']:.1f} ({backbone['lower']:.1f})",
            f"{backbone['difference']:.1e}",
            f"{clouds['a_second']:.1f}",
            f"{clouds['p50_ms']:.1f}",
            f"{clouds['p99_ms']:.1f}",
        )
    return table


def report(config: PerceptionSpeedConfig) -> list[Table]:
    """Measures, writes ``perception_speed.json`` and gives the table."""
    return [table_from_rows(measure(config)["rows"])]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("perception_speed", PerceptionSpeedConfig, report, arguments)
