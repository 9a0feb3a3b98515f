"""Can objects made by others be brought in, are they fit to simulate, and can they be opened?

Run ``python -m benchmarks.imports --help``.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro
from rich.table import Table

from artgym.annotation.filter import judge
from artgym.errors import ArtgymError, InvalidArgumentError
from artgym.objects import store
from artgym.objects.importing import import_object
from artgym.sim import soundness
from artgym.sim.scene import ManipulationScene
from benchmarks import record
from benchmarks.command import require_positive, run
from benchmarks.episodes import EpisodeTask, run_episode
from benchmarks.parallel import results_in_order
from benchmarks.rates import wilson_interval

#: What is taken for a description of an object.
_PATTERNS = ("*.urdf", "*.xml", "*.mjcf", "object.json")


@dataclass(frozen=True, kw_only=True)
class ImportsConfig:
    """Can objects made by others be brought in, are they fit to simulate, and can they be opened?

    Attributes:
        folder: every URDF, MJCF and PartNet-Mobility folder below it is imported.
        seeds: episodes of the expert for each movable part.
        workers: processes; but for the times the numbers do not depend on it.
        out: folder for imports.json.
    """

    folder: tyro.conf.Positional[Path]
    seeds: int = 3
    workers: int = 2
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        require_positive(self, "seeds", "workers")
        if not self.folder.is_dir():
            raise InvalidArgumentError(f"folder={self.folder}: no such folder.")


@dataclass(frozen=True, kw_only=True)
class ImportTask:
    """A file to import; ``keep`` is the folder of imported objects, ``name`` the object's there."""

    file: Path
    name: str
    keep: Path


@dataclass(frozen=True, kw_only=True)
class OpenTask:
    """An episode of the expert with an imported object."""

    keep: Path
    episode: EpisodeTask


def found_files(folder: Path) -> list[Path]:
    """The files below a folder that describe objects, sorted; of PartNet's, the URDF."""
    return sorted({file for pattern in _PATTERNS for file in folder.rglob(pattern)})


def imported(task: ImportTask) -> dict[str, Any]:
    """Imports a file, keeps the object, checks it; what there is to tell."""
    os.environ[store.FOLDER_VARIABLE] = str(task.keep)
    began = time.perf_counter()
    try:
        found = import_object(task.file)
    except ArtgymError as error:
        return {"error": str(error), "import_s": time.perf_counter() - began}
    import_s = time.perf_counter() - began
    obj = found.object
    object_id = store.save(obj, task.name)
    checked = soundness.check(obj, judge)
    return {
        "object_id": object_id,
        "category": obj.category,
        "parts": list(obj.part_names),
        "shapes": [len(link.shapes) for link in obj.links],
        "joints": [joint.type for joint in obj.joints],
        "notes": list(found.notes),
        "verdicts": {v.rule: round(v.value, 6) for v in checked.verdicts},
        "failures": [str(v) for v in checked.failures],
        "failed_rules": [v.rule for v in checked.failures],
        "import_s": round(import_s, 2),
        **_build_times(object_id),
    }


def _build_times(object_id: str) -> dict[str, float]:
    """Milliseconds to read a kept object, and to build its headless scene; medians of five."""
    obj = store.load(object_id)
    reading, building = [], []
    for _ in range(5):
        store.forget()
        began = time.perf_counter()
        obj = store.load(object_id)
        read = time.perf_counter()
        scene = ManipulationScene(obj, np.eye(4), obj.rest_positions)
        built = time.perf_counter()
        scene.close()
        reading.append(1e3 * (read - began))
        building.append(1e3 * (built - read))
    return {
        "read_ms": round(float(np.median(reading)), 2),
        "scene_ms": round(float(np.median(building)), 2),
    }


def opened(task: OpenTask) -> dict[str, Any]:
    """The record of an episode."""
    os.environ[store.FOLDER_VARIABLE] = str(task.keep)
    return asdict(run_episode(task.episode))


def _without_folder(value: Any, folder: Path) -> Any:
    """A result in which files are named relative to the folder that was given."""
    if isinstance(value, dict):
        return {key: _without_folder(item, folder) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_folder(item, folder) for item in value]
    if isinstance(value, str | Path):
        text = str(value)
        for name in {str(folder.resolve()), str(folder.absolute()), str(folder)}:
            text = re.sub(rf"{re.escape(name)}/?(?=\S)", "", text) if len(name) > 1 else text
        return text
    return value


def measure(config: ImportsConfig) -> dict[str, Any]:
    """Imports and opens all objects; a result for ``record.write_result``."""
    began = time.perf_counter()
    files = found_files(config.folder)
    if not files:
        raise InvalidArgumentError(f"folder={config.folder}: no URDF or MJCF file below it.")
    with tempfile.TemporaryDirectory(prefix="artgym-imports-") as kept:
        keep = Path(kept)
        rows = results_in_order(
            imported,
            [
                ImportTask(file=file.absolute(), name=f"object_{i}", keep=keep)
                for i, file in enumerate(files)
            ],
            workers=config.workers,
            description="imports",
            unit="object",
        )
        tasks = [
            OpenTask(
                keep=keep,
                episode=EpisodeTask(
                    policy="expert",
                    category=row["category"],
                    split="test",
                    object_id=row["object_id"],
                    part=part,
                    episode=seed,
                    seed=seed,
                    policy_seed=1000 + seed,
                ),
            )
            for row in rows
            if "error" not in row
            for part in range(1, len(row["parts"]))
            for seed in range(config.seeds)
        ]
        episodes = results_in_order(
            opened, tasks, workers=config.workers, description="episodes", unit="episode"
        )
    for row in rows:
        own = [e for e in episodes if e["object_id"] == row.get("object_id")]
        row["opened"] = {
            part: sum(e["success"] for e in own if e["part"] == i)
            for i, part in enumerate(row.get("parts", []))
            if i
        }
    successes = sum(e["success"] for e in episodes)
    result = {
        "config": {"folder": config.folder.name, "seeds": config.seeds, "workers": config.workers},
        "objects": {
            file.relative_to(config.folder).as_posix(): row
            for file, row in zip(files, rows, strict=True)
        },
        "imported": sum("error" not in row for row in rows),
        "sound": sum(row.get("failures") == [] for row in rows),
        "opened": successes,
        "opened_interval": wilson_interval(successes, len(episodes)) if episodes else None,
        "episodes": episodes,
    }
    provenance = record.provenance("benchmarks.imports")
    provenance["command"] = provenance["command"].replace(str(config.folder), "FOLDER")
    return {
        **provenance,
        "seconds": round(time.perf_counter() - began, 1),
        **_without_folder(result, config.folder),
    }


def table_from_objects(objects: dict[str, dict[str, Any]], seeds: int) -> Table:
    """The table for a person to read."""
    table = Table(title=f"imports: rules broken, and how often of {seeds} the expert opens a part")
    for name in ("file", "category", "links", "joints", "notes", "verdicts", "opened", "ms"):
        justify = "right" if name in ("links", "notes", "ms") else "left"
        table.add_column(name, justify=justify, overflow="fold")
    for file, row in objects.items():
        if "error" in row:
            table.add_row(file, "", "", "", "", row["error"], "", "")
            continue
        kinds = [("slide" if kind == "prismatic" else "hinge") for kind in row["joints"]]
        table.add_row(
            file,
            row["category"],
            str(len(row["parts"])),
            ", ".join(f"{kinds.count(k)} {k}" for k in ("hinge", "slide") if k in kinds),
            str(len(row["notes"])),
            ", ".join(row["failed_rules"]) or "sound",
            ", ".join(f"{part} {count}" for part, count in row["opened"].items()),
            f"{row['read_ms']:.1f} + {row['scene_ms']:.1f}",
        )
    table.caption = "ms: to read a kept object + to build its scene"
    return table


def report(config: ImportsConfig) -> list[Table]:
    """Measures, writes ``imports.json`` and gives the table."""
    result = measure(config)
    record.write_result(config.out / "imports.json", result)
    return [table_from_objects(result["objects"], config.seeds)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("imports", ImportsConfig, report, arguments)


if __name__ == "__main__":
    sys.exit(main())
