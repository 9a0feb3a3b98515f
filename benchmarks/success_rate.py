"""How often does each policy open an object that it has never seen?

Run ``python -m benchmarks.success_rate --help``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from rich.table import Table

from artgym.errors import InvalidArgumentError
from artgym.objects import catalog
from artgym.sim.renderer import find_device
from benchmarks import record
from benchmarks.command import require_positive, run
from benchmarks.episodes import EpisodeRecord, EpisodeTask, episode_tasks, outcomes, run_in_worker
from benchmarks.parallel import results_in_order
from benchmarks.pictures import PicturesTask, require_film_writer, take_pictures
from benchmarks.policies import POLICIES, load_perception, policy_entry
from benchmarks.rates import aggregate
from icaf4_policy.shipped import trained_categories


@dataclass(frozen=True, kw_only=True)
class SuccessRateConfig:
    """How often does each policy open an object that it has never seen?

    Attributes:
        policy: rows of the table: zero, random, surface_normal, icaf4, expert, or module:Class
            for one of your own with the methods reset(seed) and act(observation).
        category: categories of objects, a table each; by default those with shipped weights.
        split: of the objects; choose parameters on "val", never on "test".
        objects: how many, the first of the split.
        episodes: an object.
        seed: of the episodes.
        workers: processes; the numbers do not depend on it.
        weights: folder with {category}.safetensors, instead of the shipped weights.
        pictures: also write perception.png and episode.mp4, of episodes of icaf4.
        out: folder for success_rate.json and the pictures.
    """

    policy: tuple[str, ...] = tuple(POLICIES)
    category: tuple[str, ...] = field(default_factory=trained_categories)
    split: catalog.Split = "test"
    objects: int = 20
    episodes: int = 1
    seed: int = 0
    workers: int = 2
    weights: Path | None = None
    pictures: bool = True
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        for name in ("policy", "category"):
            values = getattr(self, name)
            if not values or len(set(values)) < len(values):
                raise InvalidArgumentError(f"{name}={values}: expected different names.")
        for category in self.category:
            catalog.object_ids(category, self.split, self.objects)
        require_positive(self, "episodes", "workers")
        if self.seed < 0:
            raise InvalidArgumentError(f"seed={self.seed}: expected 0 or more.")
        for policy in self.policy:
            policy_entry(policy)


def measure(config: SuccessRateConfig) -> dict[str, Any]:
    """Runs all episodes; a result for ``record.write_result``.

    Raises:
        RendererUnavailableError: a policy needs pictures and no device here can render.
        DamagedFileError: a policy needs weights that are missing or damaged.
        MissingDependencyError: a package is missing.
    """
    require_all(config)
    began = time.perf_counter()
    tasks = [
        task
        for category in config.category
        for policy in config.policy
        for task in episode_tasks(
            policy,
            category,
            config.split,
            config.objects,
            config.episodes,
            seed=config.seed,
            weights=config.weights and config.weights.absolute(),
        )
    ]
    records = results_in_order(
        run_in_worker, tasks, workers=config.workers, description="episodes", unit="episode"
    )
    result = {
        **record.provenance("benchmarks.success_rate"),
        "config": asdict(config),
        "objects": {
            c: list(catalog.object_ids(c, config.split, config.objects)) for c in config.category
        },
        "seconds": round(time.perf_counter() - began, 1),
        "rows": {
            category: {
                policy: aggregate(outcomes(records, policy, category)) for policy in config.policy
            }
            for category in config.category
        },
        "episodes": [asdict(r) for r in records],
    }
    if takes_pictures(config):
        result["shown"] = [asdict(task) for task in _shown_episodes(tasks, records)]
    return result


def show(config: SuccessRateConfig, shown: Sequence[EpisodeTask]) -> None:
    """Writes the pictures of some episodes beside the result."""
    pictures = PicturesTask(
        episodes=tuple(shown),
        picture=config.out.absolute() / "perception.png",
        film=config.out.absolute() / "episode.mp4",
    )
    results_in_order(take_pictures, [pictures], workers=1, description="pictures", unit="film")


def takes_pictures(config: SuccessRateConfig) -> bool:
    """Whether there are episodes of ICAF-4 to show."""
    return config.pictures and "icaf4" in config.policy


def require_all(config: SuccessRateConfig) -> None:
    """Fails at once where something that a policy needs is missing; errors as of ``measure``."""
    entries = [policy_entry(policy) for policy in config.policy]
    if any(entry.obs_mode == "rgbd" for entry in entries):
        find_device()
    if any(entry.perceives for entry in entries):
        for category in config.category:
            load_perception(category, config.weights)
    if takes_pictures(config):
        require_film_writer()


def _shown_episodes(
    tasks: Sequence[EpisodeTask], records: Sequence[EpisodeRecord]
) -> tuple[EpisodeTask, ...]:
    """An episode of ICAF-4 a category: its first success, or its first where there is none."""
    shown: dict[str, EpisodeTask] = {}
    succeeded = set()
    for task, episode in zip(tasks, records, strict=True):
        if task.policy != "icaf4" or task.category in succeeded:
            continue
        if episode.success_gripped:
            succeeded.add(task.category)
            shown[task.category] = task
        shown.setdefault(task.category, task)
    return tuple(shown.values())


def table_from_rows(category: str, rows: dict[str, dict[str, Any]]) -> Table:
    """The table of a category, for a person to read; rates in percent."""
    table = Table(title=f"{category}: rates at the end of the episode, %")
    table.add_column("policy", no_wrap=True)
    travels = next(iter(rows.values()))["success_at"]
    for name in (
        "episodes",
        "success",
        "Wilson 95 %",
        "gripped success",
        *(f"at {travel} %" for travel in travels),
        "once",
        "travel",
        "engaged share",
        "gripped share",
        "s/episode",
    ):
        table.add_column(name, justify="right")
    for policy, row in rows.items():
        low, high = row["success_interval"]
        table.add_row(
            policy,
            str(row["episodes"]),
            _percent(row["success"]),
            f"{_percent(low)}-{_percent(high)}",
            _percent(row["success_gripped"]),
            *(_percent(rate) for rate in row["success_at"].values()),
            _percent(row["success_once"]),
            _percent(row["travel"]),
            _percent(row["engaged"]),
            _percent(row["gripped"]),
            f"{row['seconds']:.1f}",
        )
    return table


def _percent(share: float) -> str:
    """A share in percent; a dash where there is none."""
    return f"{100 * share:.0f}" if share == share else "-"


def report(config: SuccessRateConfig) -> list[Table]:
    """Measures, writes ``success_rate.json``, takes the pictures and gives the tables."""
    result = measure(config)
    # First what took long: pictures can be made again.
    record.write_result(config.out / "success_rate.json", result)
    if takes_pictures(config):
        show(config, [EpisodeTask(**task) for task in result["shown"]])
    return [table_from_rows(category, rows) for category, rows in result["rows"].items()]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("success_rate", SuccessRateConfig, report, arguments)


if __name__ == "__main__":
    sys.exit(main())
