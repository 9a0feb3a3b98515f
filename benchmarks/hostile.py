"""What do files made to do harm achieve? `python -m benchmarks.hostile`, in a clone.

The corpus of ``tests/hostile`` goes through our importer and through the simulator's own URDF
loader, side by side. With ``--mutations N``, N random mutations of sound files are imported too:
each must end as an object that can be simulated, or as an ``AssetError``; meshes that would have to
be taken apart by CoACD are counted and left at that.
"""

from __future__ import annotations

import contextlib
import faulthandler
import importlib
import json
import os
import re
import select
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table
from tqdm import tqdm

from artgym.errors import AssetError, InvalidArgumentError, MissingDependencyError
from artgym.files import MANIFEST_NAME, Manifest, write_file_whole
from artgym.jobs import ShardsFailedError, ShardTask, run_shards
from artgym.objects.collision import CACHE_VARIABLE
from artgym.objects.description import JSON_NAME
from benchmarks import record
from benchmarks.command import run

_REPOSITORY = Path(__file__).resolve().parents[1]
#: Kinds of cases that the simulator's loader can be given: a URDF or what it names is at fault.
_URDF_KINDS = ("urdf", "mesh", "picture")
#: Mutations of one shard: what a crash costs is tried again one by one.
_SHARD = 50
_STEPS = 10
#: Seconds after which a mutation is given up, and after which its process is.
_GIVE_UP, _KILL = 20.0, 90.0
#: Seconds in which the simulator's loader must be ready.
_START = 120.0


@dataclass(frozen=True, kw_only=True)
class HostileConfig:
    """What is tried.

    Attributes:
        corpus: run the corpus.
        mutations: how many random mutations.
        first: number of the first one.
        seed: of all mutations.
        slow: processor seconds above which an import counts as hanging.
        patience: seconds after which the simulator's loader counts as hanging.
        workers: processes for the mutations.
        out: folder for ``hostile.json``.
    """

    corpus: bool = True
    mutations: int = 0
    first: int = 0
    seed: int = 0
    slow: float = 2.0
    patience: float = 10.0
    workers: int = 2
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        if min(self.mutations, self.first, self.seed) < 0:
            raise InvalidArgumentError("mutations, first and seed: expected 0 or more")
        if self.workers < 2:
            raise InvalidArgumentError(
                f"workers={self.workers}: expected 2 or more, so that a crash ends no more than one"
            )


def _hostile(module: str) -> Any:
    """A module of ``tests/hostile``, which only a clone has."""
    try:
        return importlib.import_module(f"tests.hostile.{module}")
    except ImportError:
        raise MissingDependencyError(
            "this benchmark needs the tests: run it in a clone of the repository, from its folder."
        ) from None


# --- Corpus --------------------------------------------------------------------------------------


def run_corpus(config: HostileConfig) -> list[dict[str, Any]]:
    """Gives every case to both importers; one record for each."""
    cases = _hostile("corpus").CASES
    watching = _hostile("watching")
    with tempfile.TemporaryDirectory(prefix="artgym-hostile-") as name:
        root = Path(name)
        ours = _our_outcomes(root)
        records = []
        with contextlib.closing(_SimulatorLoader(config.patience)) as loader:
            for case in tqdm(cases, desc="corpus", unit="file", file=sys.stderr):
                mine = ours[case.name]
                item = {
                    "name": case.name,
                    "kind": case.kind,
                    "what": case.what,
                    "ours": {
                        "outcome": _our_outcome(mine),
                        "seconds": mine["seconds"],
                        "outside": len(mine["outside"]) + len(mine["events"]),
                        "message": mine["message"].replace(name, ""),
                    },
                }
                path = _urdf_of(root / "cases" / case.name / "asset", case)
                if path is not None:
                    outside = root / "cases" / case.name / "outside"
                    with contextlib.closing(watching.OpenWatch([outside])) as watch:
                        answer = loader.outcome(path)
                        touched = watch.opened()
                    item["simulator"] = {
                        "outcome": _their_outcome(answer["outcome"]),
                        "outside": len(touched),
                        "message": answer["message"].replace(name, ""),
                    }
                records.append(item)
    return records


def _urdf_of(asset: Path, case: Any) -> Path | None:
    """The URDF of a case, for a loader that knows nothing else."""
    if case.kind not in _URDF_KINDS:
        return None
    return asset / case.entry


def _our_outcomes(root: Path) -> dict[str, dict[str, Any]]:
    process = subprocess.run(
        [sys.executable, "-m", "tests.hostile.traced", str(root), str(root / "seen.json")],
        cwd=_REPOSITORY,
        env={**os.environ, CACHE_VARIABLE: str(root / "cache")},
        check=True,
        timeout=540,
    )
    assert process.returncode == 0
    return json.loads((root / "seen.json").read_text())


def _our_outcome(seen: Mapping[str, Any]) -> str:
    if seen["outcome"] == AssetError.__name__:
        return "typed error"
    return "loads" if seen["outcome"] == "loaded" else "other exception"


def _their_outcome(outcome: str) -> str:
    known = {"loaded": "loads", "nothing": "loads", "state not finite": "state not finite"}
    if outcome in ("crash", "hang"):
        return outcome
    return known.get(outcome, "other exception")


class _SimulatorLoader:
    """The simulator's own loader in a process of its own, started again when it dies."""

    def __init__(self, patience: float) -> None:
        self._patience = patience
        self._process: subprocess.Popen[str] | None = None
        self._answers = -1

    def _start(self) -> subprocess.Popen[str]:
        reading, writing = os.pipe()
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.hostile.sapien_loading", str(writing)],
            cwd=_REPOSITORY,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            pass_fds=(writing,),
            text=True,
        )
        os.close(writing)
        self._answers = reading
        if self._line(_START) is None:
            raise MissingDependencyError(
                "the simulator's loader does not start here: `artgym doctor` says what is missing."
            )
        return self._process

    def outcome(self, path: Path) -> dict[str, str]:
        """What became of a file: what the process says, or "crash" or "hang"."""
        process = self._process or self._start()
        assert process.stdin is not None
        process.stdin.write(f"{path}\n")
        process.stdin.flush()
        try:
            answer = self._line(self._patience)
        except TimeoutError:
            self.close()
            return {"outcome": "hang", "message": f"more than {self._patience} s"}
        if answer is None:
            self.close()
            return {"outcome": "crash", "message": f"exit status {process.returncode}"}
        return json.loads(answer)

    def _line(self, patience: float) -> str | None:
        """The next line that the process says; None if it ended.

        Raises:
            TimeoutError: it says nothing.
        """
        line = b""
        end = time.monotonic() + patience
        while not line.endswith(b"\n"):
            left = max(0.0, end - time.monotonic())
            if not select.select([self._answers], [], [], left)[0]:
                raise TimeoutError
            data = os.read(self._answers, 65536)
            if not data:
                return None
            line += data
        return line.decode()

    def close(self) -> None:
        """Ends the process."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            os.close(self._answers)
            self._process = None


# --- Mutations -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class MutationsTask:
    """Some mutations in a row."""

    seed: int
    first: int
    count: int


class _GivenUpError(BaseException):
    """An import took too long; nothing on the way may catch this."""


def try_mutations(task: MutationsTask) -> list[dict[str, Any]]:
    """Imports and simulates some mutations; one record for each."""
    # As where CoACD is not installed: it is allowed minutes, in a process of its own.
    sys.modules["coacd"] = None  # type: ignore[assignment]
    with (
        tempfile.TemporaryDirectory(prefix="artgym-mutations-") as name,
        _environment(CACHE_VARIABLE, f"{name}/cache"),
    ):
        return [
            _try_mutation(task.seed, number, Path(name) / str(number))
            for number in range(task.first, task.first + task.count)
        ]


@contextlib.contextmanager
def _environment(variable: str, value: str) -> Iterator[None]:
    before = os.environ.get(variable)
    os.environ[variable] = value
    try:
        yield
    finally:
        del os.environ[variable]
        if before is not None:
            os.environ[variable] = before


def _try_mutation(seed: int, number: int, folder: Path) -> dict[str, Any]:
    name, files, entry = _hostile("mutations").mutation(seed, number)
    for path, content in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_bytes(content)
    found: dict[str, Any] = {"number": number, "object": name}
    # Native code that does not return hears no signal: then the whole process goes.
    faulthandler.dump_traceback_later(_KILL, exit=True)
    before = signal.signal(signal.SIGALRM, _give_up)
    signal.setitimer(signal.ITIMER_REAL, _GIVE_UP)
    start, cpu = time.perf_counter(), time.process_time()
    try:
        found |= _imported(folder, entry)
    except _GivenUpError:
        found |= {"outcome": "hang", "message": f"more than {_GIVE_UP} s"}
    except AssetError as error:
        found |= {"outcome": "typed error", "message": str(error)[:200]}
    except MissingDependencyError:
        found |= {"outcome": "needs CoACD", "message": ""}
    except Exception as error:
        frame = traceback.extract_tb(error.__traceback__)[-1]
        place = f"{Path(frame.filename).name}:{frame.lineno}"
        message = f"{type(error).__name__}: {error} ({place})"
        found |= {"outcome": "other exception", "message": message[:300]}
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
        faulthandler.cancel_dump_traceback_later()
    return found | {"seconds": time.perf_counter() - start, "cpu": time.process_time() - cpu}


def _give_up(*_: object) -> None:
    raise _GivenUpError


def _imported(folder: Path, entry: str) -> dict[str, Any]:
    """Imports one mutation and simulates what came of it."""
    from artgym.sim.scene import ManipulationScene

    load = _hostile("loading").load
    path = folder / entry if entry else folder
    try:
        obj = load(path)
    except AssetError as error:
        hashed = re.search(r"another hash, '([0-9a-f]{64})'", str(error))
        if hashed is None:
            raise
        # Whoever changes a description on purpose corrects its hash as well.
        for json_path in folder.rglob(JSON_NAME):
            content = json_path.read_bytes()
            old = rb'"content_hash": "[^"]*"'
            new = f'"content_hash": "{hashed[1]}"'.encode()
            json_path.write_bytes(re.sub(old, new, content))
        obj = load(path)
    for fraction in (0.0, 0.5):
        q = [joint.position(fraction) for joint in obj.joints]
        scene = ManipulationScene(obj, np.eye(4), q)
        try:
            scene.step(_STEPS)
            body = scene.body
            state = (body.positions(), body.velocities(), body.link_poses())
            if not all(np.all(np.isfinite(numbers)) for numbers in state):
                return {"outcome": "state not finite", "message": f"started at {q}"}
        finally:
            scene.close()
    return {"outcome": "simulated", "message": ""}


def _write_json(path: Path, content: Any) -> None:
    write_file_whole(path, json.dumps(content, allow_nan=True).encode())


def run_mutations(config: HostileConfig) -> list[dict[str, Any]]:
    """Tries all mutations in worker processes; a crash costs only itself."""
    starts = range(config.first, config.first + config.mutations, _SHARD)
    end = config.first + config.mutations
    tasks = [MutationsTask(config.seed, start, min(_SHARD, end - start)) for start in starts]
    records, lost = _in_workers(tasks, config, "mutations")
    singles = [
        MutationsTask(config.seed, number, 1)
        for task in lost
        for number in range(task.first, task.first + task.count)
    ]
    if singles:
        more, crashed = _in_workers(singles, config, "one by one")
        records += more
        records += [
            {
                "number": task.first,
                "object": _hostile("mutations").mutation(task.seed, task.first)[0],
                "outcome": "crash",
                "message": "its process died",
                "seconds": 0.0,
                "cpu": 0.0,
            }
            for task in crashed
        ]
    for item in records:
        if item["cpu"] > config.slow and item["outcome"] != "hang":
            item |= {"outcome": "hang", "message": f"{item['cpu']:.1f} s: {item['message']}"}
    return sorted(records, key=lambda item: item["number"])


def _in_workers(
    tasks: Sequence[MutationsTask], config: HostileConfig, description: str
) -> tuple[list[dict[str, Any]], list[MutationsTask]]:
    """Records of the tasks that ended well, and the tasks that did not."""
    shards = [ShardTask(f"{task.first:08d}-{task.count}.json", task) for task in tasks]
    with tempfile.TemporaryDirectory(prefix="artgym-shards-") as folder:
        try:
            run_shards(
                shards,
                try_mutations,
                folder,
                config={},
                write=_write_json,
                workers=config.workers,
                description=description,
            )
        except ShardsFailedError as error:
            tqdm.write(str(error), file=sys.stderr)
        assert (Path(folder) / MANIFEST_NAME).exists()
        done = {shard.name for shard in Manifest.read(folder).shards}
        records = [
            item for name in sorted(done) for item in json.loads((Path(folder) / name).read_bytes())
        ]
    return records, [shard.arguments for shard in shards if shard.name not in done]


# --- Report --------------------------------------------------------------------------------------

OUTCOMES = ("typed error", "loads", "state not finite", "other exception", "crash", "hang")


def corpus_table(records: Sequence[Mapping[str, Any]]) -> Table:
    """Cases by kind, ours beside the simulator's loader."""
    table = Table(title="hostile files: what becomes of them")
    table.add_column("kind", no_wrap=True)
    table.add_column("importer", no_wrap=True)
    for name in ("files", *OUTCOMES, "opened outside", "slowest, s"):
        table.add_column(name, justify="right")
    kinds = list(dict.fromkeys(item["kind"] for item in records))
    for kind in (*kinds, "all"):
        for who, label in (("ours", "artgym"), ("simulator", "SAPIEN")):
            rows = [r[who] for r in records if kind in (r["kind"], "all") and who in r]
            if not rows:
                continue
            counts = Counter(row["outcome"] for row in rows)
            slowest = max((row.get("seconds", 0.0) for row in rows), default=0.0)
            table.add_row(
                kind,
                label,
                str(len(rows)),
                *(str(counts[outcome]) for outcome in OUTCOMES),
                str(sum(row["outside"] > 0 for row in rows)),
                f"{slowest:.2f}" if who == "ours" else "",
            )
    return table


def mutations_table(records: Sequence[Mapping[str, Any]]) -> Table:
    """Mutations by the sound object they started from."""
    outcomes = ("simulated", "needs CoACD", *(o for o in OUTCOMES if o != "loads"))
    table = Table(title="random mutations of sound files: what becomes of them")
    table.add_column("object", no_wrap=True)
    for name in ("mutations", *outcomes, "median ms", "slowest, s"):
        table.add_column(name, justify="right")
    for name in (*sorted({r["object"] for r in records}), "all"):
        rows = [r for r in records if name in (r["object"], "all")]
        counts = Counter(r["outcome"] for r in rows)
        table.add_row(
            name,
            str(len(rows)),
            *(str(counts[outcome]) for outcome in outcomes),
            f"{1000 * float(np.median([r['seconds'] for r in rows])):.0f}",
            f"{max(r['seconds'] for r in rows):.1f}",
        )
    return table


def report(config: HostileConfig) -> list[Table]:
    """Tries everything, writes ``hostile.json`` and gives the tables."""
    tables = []
    result = {**record.provenance("benchmarks.hostile"), "config": asdict(config)}
    if config.corpus:
        result["corpus"] = run_corpus(config)
        tables.append(corpus_table(result["corpus"]))
    if config.mutations:
        records = run_mutations(config)
        counts = Counter(r["outcome"] for r in records)
        good = ("simulated", "needs CoACD", "typed error")
        result["mutations"] = {
            "counts": dict(counts),
            "by_object": {
                name: dict(Counter(r["outcome"] for r in records if r["object"] == name))
                for name in sorted({r["object"] for r in records})
            },
            "seconds": float(sum(r["seconds"] for r in records)),
            "bad": [r for r in records if r["outcome"] not in good],
        }
        tables.append(mutations_table(records))
    record.write_result(config.out / "hostile.json", result)
    return tables


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("hostile", HostileConfig, report, arguments)


if __name__ == "__main__":
    sys.exit(main())
