"""How fast are the environments, against the bare simulator and against ManiSkill?

Each figure is a ratio from interleaved pairs: what ours costs and what the other costs, one right
after the other, so that what else the machine does falls on both. Run
``python -m benchmarks.speed env --help``.
"""

from __future__ import annotations

import importlib.util
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table
from tqdm import tqdm

from artgym.errors import InvalidArgumentError, MissingDependencyError
from artgym.objects import catalog
from benchmarks import record, twin_asset
from benchmarks.command import run
from benchmarks.stopwatch import SETTINGS, Stopwatch, first_reset

#: Fewer pairs say nothing of a bound.
MIN_PAIRS = 7
CAMERA_SIZE = (320, 240)
#: Of the median's bootstrap distribution; 95 % of it lies above the lower bound.
_RESAMPLES, _LOWER = 10_000, 0.05


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A question that is answered by one ratio: cost of the other by cost of ours.

    Attributes:
        label: what is compared, for a person.
        unit: of a cost.
        target: least ratio we promise; None for what is only told.
    """

    label: str
    unit: str
    target: float | None = None


COMPARISONS: Mapping[str, Comparison] = {
    "bare": Comparison(label="state step / bare SAPIEN, both kept awake", unit="ms", target=0.8),
    "bare_asleep": Comparison(label="state step / bare SAPIEN, objects may sleep", unit="ms"),
    "state": Comparison(label="state step / ManiSkill", unit="ms", target=6.0),
    "state_joints": Comparison(label="state step / ManiSkill without IK", unit="ms"),
    "rgbd": Comparison(label="RGB-D step / ManiSkill", unit="ms", target=5.0),
    "pointcloud": Comparison(label="point-cloud step / our state step", unit="ms"),
    "reset": Comparison(label="reset, same object / ManiSkill", unit="ms", target=10.0),
    "swap": Comparison(label="reset to a new object / ManiSkill", unit="ms", target=20.0),
    "swap_back": Comparison(
        label="reset to an object seen before / ManiSkill", unit="ms", target=20.0
    ),
    "first_time": Comparison(label="import, make, reset / ManiSkill", unit="s", target=8.0),
    "first_memory": Comparison(label="peak memory of that / ManiSkill", unit="MiB", target=4.0),
}


@dataclass(frozen=True, kw_only=True)
class EnvSpeedConfig:
    """How fast are the environments, against the bare simulator and against ManiSkill?

    Attributes:
        category: categories of objects.
        pairs: of measurements for each ratio.
        steps: control steps a measurement in state mode; a quarter of them with pictures or
            points.
        resets: a measurement.
        seed: of actions, episodes and the bootstrap.
        out: folder for env_speed.json.
    """

    category: tuple[str, ...] = ("drawer", "laptop")
    pairs: int = MIN_PAIRS
    steps: int = 600
    resets: int = 10
    seed: int = 0
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        least = {"pairs": MIN_PAIRS, "steps": 4, "resets": 1}
        for name, value in least.items():
            if getattr(self, name) < value:
                raise InvalidArgumentError(
                    f"{name}={getattr(self, name)}: expected {value} or more."
                )
        if self.steps > 1200:
            # Pictures are compared from one camera, and an episode has 300 steps.
            raise InvalidArgumentError(f"steps={self.steps}: expected 1200 or fewer.")
        for category in self.category:
            catalog.object_ids(category, "train", self.objects_needed)

    @property
    def objects_needed(self) -> int:
        """Objects a category: one to step, and new ones for each swap, warming up included."""
        return 1 + self.resets * (self.pairs + 1)


Cost = Callable[[int], tuple[float, ...]]


def interleaved(ours: Cost, other: Cost, pairs: int, bar: tqdm[Any]) -> list[list[list[float]]]:
    """Costs in pairs, the one and the other going first by turns, after a pair that warms up.

    Args:
        ours: measures the one side of pair i; one call may tell several costs.
        other: measures the other side, the same costs.
        pairs: how many count.
        bar: is moved on by each pair.

    Returns:
        For each cost a list of pairs [ours, other].
    """
    measured = []
    for i in range(pairs + 1):
        if i % 2:
            theirs = other(i)
            mine = ours(i)
        else:
            mine = ours(i)
            theirs = other(i)
        measured.append(list(zip(mine, theirs, strict=True)))
        bar.update()
    return [[list(pair) for pair in costs] for costs in zip(*measured[1:], strict=True)]


def ratio_row(pairs: Sequence[Sequence[float]], target: float | None, seed: int) -> dict[str, Any]:
    """Median ratio of pairs [ours, other], its lower bound, and the pairs themselves.

    ``lower`` is the 5 % quantile of the medians of samples drawn from the ratios with repetition.

    >>> row = ratio_row([[1.0, 2.0]] * 7, 1.5, 0)
    >>> row["ratio"], row["lower"], row["holds"]
    (2.0, 2.0, True)
    """
    costs = np.asarray(pairs, dtype=float)
    ratios = costs[:, 1] / costs[:, 0]
    drawn = np.random.default_rng(seed).choice(ratios, (_RESAMPLES, len(ratios)))
    lower = float(np.quantile(np.median(drawn, axis=1), _LOWER))
    return {
        "ours": float(np.median(costs[:, 0])),
        "other": float(np.median(costs[:, 1])),
        "ratio": float(np.median(ratios)),
        "lower": lower,
        "target": target,
        "holds": None if target is None else lower >= target,
        "pairs": costs.tolist(),
    }


def measure_category(category: str, config: EnvSpeedConfig, folder: Path) -> dict[str, Any]:
    """The rows of one category, by the names of ``COMPARISONS``.

    Args:
        category: of the objects.
        config: see there.
        folder: for files that are of no use afterwards.
    """
    ids = catalog.object_ids(category, "train", config.objects_needed)
    first, fresh = ids[0], ids[1:]
    exported = tqdm(ids, desc=f"{category}: export", unit="object", file=sys.stderr, leave=False)
    assets = {i: str(twin_asset.write(i, folder)) for i in exported}
    bar = tqdm(
        total=(len(COMPARISONS) - 1) * (config.pairs + 1),
        desc=f"{category}: speed",
        unit="pair",
        file=sys.stderr,
    )
    rows: dict[str, Any] = {}
    with (
        bar,
        Stopwatch("ours", camera_size=CAMERA_SIZE) as ours,
        Stopwatch("maniskill", assets=assets) as maniskill,
    ):

        def compare(*names: str, ours: Cost, other: Cost) -> None:
            bar.set_postfix_str(names[0])
            costs = interleaved(ours, other, config.pairs, bar)
            for name, pairs in zip(names, costs, strict=True):
                rows[name] = ratio_row(pairs, COMPARISONS[name].target, config.seed)

        def asked(stopwatch: Stopwatch, call: str, **arguments: Any) -> tuple[float]:
            return (1e3 * stopwatch.ask(call, **arguments),)

        def step(stopwatch: Stopwatch, mode: str, **more: bool) -> Cost:
            few = mode in ("rgbd", "pointcloud")
            return lambda i: asked(
                stopwatch,
                "step",
                mode=mode,
                object_id=first,
                # One camera for both sides: with pictures, all pairs are the same episode.
                seed=config.seed + (0 if mode == "rgbd" else i),
                steps=config.steps // 4 if few else config.steps,
                **more,
            )

        def bare(*, awake: bool) -> Cost:
            return lambda i: asked(
                ours,
                "bare_step",
                object_id=first,
                seed=config.seed + i,
                steps=config.steps,
                awake=awake,
            )

        def reset(stopwatch: Stopwatch) -> Cost:
            return lambda i: asked(stopwatch, "reset", object_id=first, count=config.resets)

        def swap(stopwatch: Stopwatch, *, new: bool) -> Cost:
            def cost(i: int) -> tuple[float]:
                chosen = fresh[i * config.resets :][: config.resets]
                if not new:
                    chosen = [(fresh[0], first)[k % 2] for k in range(config.resets)]
                return asked(stopwatch, "swap", object_ids=[first, *chosen])

            return cost

        compare("bare", ours=step(ours, "state", awake=True), other=bare(awake=True))
        compare("bare_asleep", ours=step(ours, "state"), other=bare(awake=False))
        compare("state", ours=step(ours, "state"), other=step(maniskill, "state"))
        compare("state_joints", ours=step(ours, "state"), other=step(maniskill, "joints"))
        camera = ours.ask("camera", object_id=first, seed=config.seed)
        maniskill.ask("see", object_id=first, camera=camera)
        compare("rgbd", ours=step(ours, "rgbd"), other=step(maniskill, "rgbd"))
        compare("pointcloud", ours=step(ours, "pointcloud"), other=step(ours, "state"))
        compare("reset", ours=reset(ours), other=reset(maniskill))
        compare("swap", ours=swap(ours, new=True), other=swap(maniskill, new=True))
        compare("swap_back", ours=swap(ours, new=False), other=swap(maniskill, new=False))
        bytecode = folder / "bytecode"
        compare(
            "first_time",
            "first_memory",
            ours=lambda _: first_reset("ours", first, bytecode),
            other=lambda _: first_reset("maniskill", assets[first], bytecode),
        )
    return {"object_id": first, "renderer": camera["device"], "rows": rows}


def measure(config: EnvSpeedConfig) -> dict[str, Any]:
    """Measures every category and writes ``env_speed.json``.

    Raises:
        MissingDependencyError: there is no ManiSkill to compare with.
    """
    if importlib.util.find_spec("mani_skill") is None:
        raise MissingDependencyError(
            "the package mani_skill, which ours is compared with, is not installed; "
            "pip install mani-skill"
        )
    rows = {}
    for category in config.category:
        with tempfile.TemporaryDirectory() as folder:
            rows[category] = measure_category(category, config, Path(folder))
    result = {
        **record.provenance("benchmarks.speed"),
        "config": {name: value for name, value in asdict(config).items() if name != "out"},
        "camera_size": CAMERA_SIZE,
        "environment": dict(SETTINGS),
        "comparisons": {name: asdict(each) for name, each in COMPARISONS.items()},
        "rows": rows,
    }
    record.write_result(config.out / "env_speed.json", result)
    return result


def table_from_rows(rows: Mapping[str, Mapping[str, Any]]) -> Table:
    """The table for a person to read."""
    table = Table(title="speed: medians of costs, and how many times the other's cost is ours")
    for name in ("category", "ours / other", "ours", "other", "unit"):
        table.add_column(name, justify="right" if name in ("ours", "other") else "left")
    for name in ("ratio", "lower 95 %", "target", "holds"):
        table.add_column(name, justify="right")
    for category, measured in rows.items():
        for name, row in measured["rows"].items():
            comparison = COMPARISONS[name]
            table.add_row(
                category,
                comparison.label,
                f"{row['ours']:.3g}",
                f"{row['other']:.3g}",
                comparison.unit,
                f"{row['ratio']:.2f}",
                f"{row['lower']:.2f}",
                "" if row["target"] is None else f"{row['target']:g}",
                "" if row["holds"] is None else ("yes" if row["holds"] else "no"),
            )
    return table


def report(config: EnvSpeedConfig) -> list[Table]:
    """Measures, writes ``env_speed.json`` and gives the table."""
    return [table_from_rows(measure(config)["rows"])]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("env_speed", EnvSpeedConfig, report, arguments)
