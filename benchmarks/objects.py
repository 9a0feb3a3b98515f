"""Are the objects of the catalogue fit to simulate, and can they be opened?

Run ``python -m benchmarks.objects --help``.
"""

from __future__ import annotations

import functools
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from artgym.annotation.filter import judge
from artgym.objects import catalog
from artgym.sim import soundness
from artgym.sim.scene import ManipulationScene
from benchmarks import record
from benchmarks.command import require_positive, run
from benchmarks.parallel import results_in_order
from benchmarks.solvability import solved

#: Policies whose episodes are run: the expert must open, doing nothing must not.
_POLICIES = ("expert", "zero")
#: Objects whose building is timed, a category.
_TIMED = 20


@dataclass(frozen=True, kw_only=True)
class ObjectsConfig:
    """Are the objects of the catalogue fit to simulate, and can they be opened?

    Attributes:
        category: categories of objects; all by default.
        sound: objects a category that are checked for soundness, the catalogue's first.
        opened: test objects a category that the expert opens, one episode each, the movable parts
            in turn.
        seed: of the episodes.
        resume: keep the categories that ``objects.json`` holds already.
        workers: processes; but for the times the numbers do not depend on it.
        out: folder for objects.json.
    """

    category: tuple[str, ...] = tuple(catalog.CATEGORIES)
    sound: int = 200
    opened: int = 50
    seed: int = 0
    resume: bool = False
    workers: int = 2
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        require_positive(self, "sound", "opened", "workers")
        for category in self.category:
            catalog.object_ids(category, "test", self.opened)
            catalog.all_ids(category, self.sound)


def checked(object_id: str) -> dict[str, Any]:
    """The verdicts on an object, which of them fail, and the hash of what it is."""
    obj = catalog.load(object_id)
    found = soundness.check(obj, judge)
    return {
        "object_id": object_id,
        "hash": obj.content_hash(),
        "verdicts": {v.rule: round(v.value, 6) for v in found.verdicts},
        "failures": [str(v) for v in found.failures],
    }


def build_seconds(object_id: str) -> float:
    """Seconds from an id to its object in a headless scene, nothing of it cached."""
    began = time.perf_counter()
    obj = catalog.build(object_id)
    scene = ManipulationScene(obj, np.eye(4), obj.rest_positions)
    seconds = time.perf_counter() - began
    scene.close()
    return seconds


def _hashes(object_ids: Sequence[str]) -> list[str]:
    return [catalog.load(i).content_hash() for i in object_ids]


def _build_times(category: str) -> list[float]:
    """Milliseconds to build test objects of a category, sorted.

    Others are built before, since what a process loads at its first hull or scene is no object's.
    """
    ids = catalog.object_ids(category, "test", 2 * _TIMED)
    for object_id in ids[_TIMED:]:
        build_seconds(object_id)
    return sorted(round(1e3 * build_seconds(i), 3) for i in ids[:_TIMED])


def measure_category(category: str, config: ObjectsConfig) -> dict[str, Any]:
    """Checks and opens the objects of one category: its row, with how it was made."""
    began = time.perf_counter()
    ids = catalog.all_ids(category, config.sound)
    verdicts = results_in_order(
        checked, ids, workers=config.workers, description=f"{category}: soundness", unit="object"
    )
    # Once more in a single fresh process and the other way round.
    (hashes,) = results_in_order(
        _hashes, [ids[::-1]], workers=1, description=f"{category}: same bytes", unit="process"
    )
    rates, unsolved = solved(
        _POLICIES,
        category,
        config.opened,
        seed=config.seed,
        workers=config.workers,
        description=f"{category}: episodes",
    )
    (times,) = results_in_order(
        _build_times, [category], workers=1, description=f"{category}: build times", unit="process"
    )
    return {
        **record.provenance("benchmarks.objects"),
        "checked": len(ids),
        "sound": sum(not v["failures"] for v in verdicts),
        "same_bytes": sum(
            v["hash"] == again for v, again in zip(verdicts, hashes[::-1], strict=True)
        ),
        **rates,
        "build_ms": {"median": float(np.median(times)), "largest": times[-1]},
        "failures": {v["object_id"]: v["failures"] for v in verdicts if v["failures"]},
        "not_opened": unsolved,
        "seconds": round(time.perf_counter() - began, 1),
    }


def measure(config: ObjectsConfig) -> dict[str, Any]:
    """Measures category by category, and writes ``objects.json`` after each.

    With ``resume``, categories measured before with the same options are kept.

    Raises:
        DamagedFileError: there is an ``objects.json`` to resume that cannot be read.
    """
    return record.measure_rows(
        config.out / "objects.json",
        {n: v for n, v in asdict(config).items() if n in ("sound", "opened", "seed")},
        {c: functools.partial(measure_category, c, config) for c in config.category},
        resume=config.resume,
    )


def table_from_rows(rows: dict[str, dict[str, Any]]) -> Table:
    """The table for a person to read."""
    table = Table(title="objects: sound, opened by the expert, time from id to scene")
    for name in (
        "category",
        "sound",
        "same bytes",
        "expert, %",
        "Wilson 95 %",
        "gripped, %",
        "zero action, %",
        "build ms, median",
        "largest",
    ):
        table.add_column(name, justify="left" if name == "category" else "right")
    for category, row in rows.items():
        low, high = row["expert"]["success_interval"]
        table.add_row(
            category,
            f"{row['sound']} of {row['checked']}",
            f"{row['same_bytes']} of {row['checked']}",
            f"{100 * row['expert']['success']:.0f}",
            f"{100 * low:.0f}-{100 * high:.0f}",
            f"{100 * row['expert']['success_gripped']:.0f}",
            f"{100 * row['zero']['success']:.0f}",
            f"{row['build_ms']['median']:.1f}",
            f"{row['build_ms']['largest']:.1f}",
        )
    return table


def report(config: ObjectsConfig) -> list[Table]:
    """Measures, writes ``objects.json`` and gives the table."""
    return [table_from_rows(measure(config)["rows"])]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("objects", ObjectsConfig, report, arguments)


if __name__ == "__main__":
    sys.exit(main())
