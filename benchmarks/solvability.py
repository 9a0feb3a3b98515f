"""Can every environment be solved, by either robot, and only by acting on purpose?

Run ``python -m benchmarks.solvability --help``.
"""

from __future__ import annotations

import functools
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.table import Table

from artgym.envs.arguments import require_known
from artgym.objects import catalog
from artgym.registration import environment_ids
from artgym.sim.robots import RobotName
from benchmarks import record
from benchmarks.command import require_positive, run
from benchmarks.episodes import episode_tasks, outcomes, run_in_worker
from benchmarks.parallel import results_in_order
from benchmarks.rates import aggregate

#: The expert must succeed, doing nothing never, acting at random hardly ever.
POLICIES = ("expert", "zero", "random")


@dataclass(frozen=True, kw_only=True)
class SolvabilityConfig:
    """Can every environment be solved, by either robot, and only by acting on purpose?

    Attributes:
        env_id: environments, of a single object.
        robot: robots.
        category: categories of objects; all by default.
        policy: of "expert", "zero", "random".
        objects: test objects a category, one episode each, the movable parts in turn.
        seed: of the episodes.
        resume: keep the rows that ``solvability.json`` holds already.
        workers: processes; the numbers do not depend on it.
        out: folder for solvability.json.
    """

    env_id: tuple[str, ...] = ("ArtOpen-v0",)
    robot: tuple[RobotName, ...] = ("hand", "panda")
    category: tuple[str, ...] = tuple(catalog.CATEGORIES)
    policy: tuple[str, ...] = POLICIES
    objects: int = 50
    seed: int = 0
    resume: bool = False
    workers: int = 2
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        require_positive(self, "objects", "workers")
        for category in self.category:
            catalog.object_ids(category, "test", self.objects)
        for env_id in self.env_id:
            require_known("env_id", env_id, environment_ids("any-category", "single-object"))
        for policy in self.policy:
            require_known("policy", policy, POLICIES)


def solved(
    policies: Sequence[str],
    category: str,
    objects: int,
    *,
    seed: int,
    workers: int,
    description: str,
    env_id: str = "ArtOpen-v0",
    robot: RobotName = "hand",
) -> tuple[dict[str, dict[str, Any]], list[dict[str, Any]]]:
    """Runs policies on test objects of a category, one episode each, the parts in turn.

    Returns:
        The rates of each policy, and the expert's episodes without success.
    """
    tasks = [
        task
        for policy in policies
        for task in episode_tasks(
            policy,
            category,
            "test",
            objects,
            1,
            seed=seed,
            parts="in turn",
            env_id=env_id,
            robot=robot,
        )
    ]
    episodes = results_in_order(
        run_in_worker, tasks, workers=workers, description=description, unit="episode"
    )
    unsolved = [
        {name: getattr(e, name) for name in ("object_id", "part", "seed", "travel", "engaged")}
        for e in outcomes(episodes, "expert", category)
        if not e.success
    ]
    return {p: aggregate(outcomes(episodes, p, category)) for p in policies}, unsolved


def measure_row(
    env_id: str, robot: RobotName, category: str, config: SolvabilityConfig
) -> dict[str, Any]:
    """The row of one environment, robot and category, with how it was made."""
    began = time.perf_counter()
    rates, unsolved = solved(
        config.policy,
        category,
        config.objects,
        seed=config.seed,
        workers=config.workers,
        description=f"{env_id}, {robot}, {category}",
        env_id=env_id,
        robot=robot,
    )
    return {
        **record.provenance("benchmarks.solvability"),
        "env_id": env_id,
        "robot": robot,
        "category": category,
        **rates,
        "not_solved": unsolved,
        "seconds": round(time.perf_counter() - began, 1),
    }


def measure(config: SolvabilityConfig) -> dict[str, Any]:
    """Measures row by row, and writes ``solvability.json`` after each.

    With ``resume``, rows measured before with the same options are kept.

    Raises:
        DamagedFileError: there is a ``solvability.json`` to resume that cannot be read.
    """
    return record.measure_rows(
        config.out / "solvability.json",
        {n: v for n, v in asdict(config).items() if n in ("objects", "seed", "policy")},
        {
            f"{env_id} {robot} {category}": functools.partial(
                measure_row, env_id, robot, category, config
            )
            for env_id in config.env_id
            for robot in config.robot
            for category in config.category
        },
        resume=config.resume,
    )


def table_from_rows(rows: dict[str, dict[str, Any]]) -> Table:
    """The table for a person to read."""
    table = Table(title="solvability: success, %, on test objects")
    for name in ("environment", "robot", "category", "expert", "Wilson 95 %", "gripped"):
        table.add_column(name, justify="right" if name == "expert" else "left")
    for name in ("zero action", "random"):
        table.add_column(name, justify="right")
    for row in rows.values():
        expert = ("-", "-", "-")
        if "expert" in row:
            low, high = row["expert"]["success_interval"]
            expert = (
                f"{100 * row['expert']['success']:.0f}",
                f"{100 * low:.0f}-{100 * high:.0f}",
                f"{100 * row['expert']['success_gripped']:.0f}",
            )
        idle = [f"{100 * row[p]['success']:.0f}" if p in row else "-" for p in ("zero", "random")]
        table.add_row(row["env_id"], row["robot"], row["category"], *expert, *idle)
    return table


def report(config: SolvabilityConfig) -> list[Table]:
    """Measures, writes ``solvability.json`` and gives the table."""
    return [table_from_rows(measure(config)["rows"])]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("solvability", SolvabilityConfig, report, arguments)


if __name__ == "__main__":
    sys.exit(main())
