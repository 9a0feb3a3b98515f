"""Is a run of shards ever harmed by what happens to it? `python -m benchmarks.faults`.

One command makes shards, with each engine and number of workers: of random numbers, or small ones
of labels or of pictures as `artgym annotate` and `artgym generate` make them. First nothing happens
to it. Then the whole command is killed at random moments and started again, until it is done.
Then its workers are killed, stopped, crash or loop for ever. Each time the bytes are compared with
those of one process that nothing happened to, and processes that stay behind are counted.
"""

from __future__ import annotations

import ctypes
import importlib.util
import json
import os
import secrets
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, wait
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from itertools import cycle, pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from rich.table import Table
from tqdm import tqdm

from artgym.datasets.picture_files import read_pictures, write_pictures
from artgym.datasets.sample import Picture
from artgym.errors import ArtgymError, InvalidArgumentError, MissingDependencyError
from artgym.files import MANIFEST_NAME, Manifest, read_arrays, write_arrays
from artgym.jobs import ShardsFailedError, ShardTask, run_shards
from artgym.objects import catalog
from benchmarks import record
from benchmarks.command import run

Engine = Literal["loky", "dask", "ray"]
Work = Literal["numbers", "labels", "pictures"]
#: What the engines are installed as, and imported as.
_ENGINE_PACKAGES = {"loky": "joblib", "dask": "distributed", "ray": "ray"}

#: The category that labels and pictures are of.
_CATEGORY = "laptop"

#: What happens to a worker.
FAULTS = ("killed", "stopped", "segfault", "endless loop")
#: A fault comes so many seconds after its shard was begun, at most: within that shard, while its
#: file is written, in a later shard, or when the worker has nothing to do.
_LATEST_FAULT = 0.4
#: Seconds to end a worker and start another, on a busy machine.
_RESTART = 6.0
#: How long processes may outlive the command that started them, seconds: ray's agents, which make
#: no shards, take a minute to see that the rest of ray was killed.
_FAREWELL = 90.0
#: The next command does not wait longer than this for the last to be gone, seconds.
_SHORT_FAREWELL = 2.0
#: Inherited by every process of a command, whoever its parent is later.
_MARK = "ARTGYM_FAULTS_COMMAND"
#: What a command ends with that set shards aside.
_SET_ASIDE = 3


@dataclass(frozen=True, kw_only=True)
class FaultsConfig:
    """What is done to whom.

    Attributes:
        work: what the shards hold; a worker takes seconds to start where it is no random numbers.
        engines: engines.
        workers: worker processes; with loky, 1 works in the command's own process, and has no
            worker that could fail.
        kills: how many times the whole command is killed, over all engines and workers.
        faults: how many workers fail, of each kind in turn.
        shards: how many the command makes, at most 30 of pictures.
        draws: random numbers of a shard, in millions; 8 take about 0.1 s.
        timeout: seconds that a shard may take.
        seed: of the moments, and of the shards that fail.
        out: folder for ``faults.json``, or ``faults_labels.json``, ``faults_pictures.json``.
    """

    work: Work = "numbers"
    engines: tuple[Engine, ...] = ("loky", "dask", "ray")
    workers: tuple[int, ...] = (1, 2, 4)
    kills: int = 50
    faults: int = 100
    shards: int = 24
    draws: int = 8
    timeout: float = 4.0
    seed: int = 0
    out: Path = record.RESULTS_FOLDER

    @property
    def result_name(self) -> str:
        """What the result is called."""
        return "faults" if self.work == "numbers" else f"faults_{self.work}"

    def __post_init__(self) -> None:
        if not sys.platform.startswith("linux"):
            raise InvalidArgumentError("this benchmark reads /proc: it runs on Linux alone.")
        for name, least in (("kills", 0), ("faults", 0), ("shards", 1), ("draws", 1), ("seed", 0)):
            if getattr(self, name) < least:
                raise InvalidArgumentError(f"{name}={getattr(self, name)}: expected {least}+")
        if not self.engines or not self.workers or min(self.workers) < 1:
            raise InvalidArgumentError(
                f"engines={self.engines}, workers={self.workers}: expected one or more of each."
            )
        if not self.timeout > 0:
            raise InvalidArgumentError(f"timeout={self.timeout}: expected seconds above 0.")
        for engine in self.engines:
            if importlib.util.find_spec(_ENGINE_PACKAGES[engine]) is None:
                raise MissingDependencyError(
                    f"{engine} is not installed: pip install 'artgym[cluster]', or leave it out of "
                    "--engines."
                )


# --- The command ---------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Shard:
    """What determines a shard, and what happens to the first worker that makes it.

    Attributes:
        work: what it holds.
        seed: of its numbers, or which of the labelled objects it is about.
        draws: how many numbers, in millions.
        fault: one of ``FAULTS``, or none.
        delay: seconds from its start to the fault.
        scar: a file that exists once the fault has come.
    """

    work: Work
    seed: int
    draws: int
    fault: str | None = None
    delay: float = 0.0
    scar: str = ""


def make_shard(shard: Shard) -> dict[str, NDArray[Any]] | list[Picture]:
    """Labels or pictures of an object, or moments of random numbers and some of them."""
    if shard.fault is not None and not Path(shard.scar).exists():
        Path(shard.scar).touch()
        if shard.fault == "endless loop":
            _fail(shard.fault)
        threading.Timer(shard.delay, _fail, [shard.fault]).start()
    if shard.work != "numbers":
        return _labels(shard.seed) if shard.work == "labels" else _pictures(shard.seed)
    rng = np.random.default_rng(shard.seed)
    values = [rng.normal(size=1_000_000) for _ in range(shard.draws)]
    means = np.array([each.mean() for each in values])
    return {"means": means, "values": values[-1][:4000], "seed": np.array(shard.seed)}


def _labels(number: int) -> dict[str, NDArray[Any]]:
    """Labels of few points of an object."""
    # The simulator takes a second to import, which shards of numbers need not wait for.
    from artgym.annotation.annotate import AnnotationConfig, annotate

    config = AnnotationConfig(
        start_states=1, open_states=0, least_points=1, most_points=1, trials=1, views=2
    )
    return annotate(catalog.object_ids(_CATEGORY, "train", number + 1)[-1], config)


def _pictures(number: int) -> list[Picture]:
    """Small pictures of a labelled object."""
    from artgym.annotation.annotate import labelled_ids
    from artgym.datasets.generate import GenerationConfig, make_pictures

    config = GenerationConfig(views=1, camera_size=(160, 120), min_points=40)
    return make_pictures(labelled_ids(_CATEGORY, "train")[number], config)


def _fail(fault: str) -> None:
    match fault:
        case "killed":
            os.kill(os.getpid(), signal.SIGKILL)
        case "stopped":
            os.kill(os.getpid(), signal.SIGSTOP)
        case "segfault":
            ctypes.string_at(0)
        case _:
            while True:
                pass


def command(text: str) -> int:
    """What the processes that are tormented run; see ``_Command``."""
    given = json.loads(text)
    work = given.pop("work")
    shards = [ShardTask(f"{each['seed']:04d}.h5", Shard(**each)) for each in given.pop("shards")]
    try:
        write = write_pictures if work == "pictures" else write_arrays
        run_shards(shards, make_shard, config={}, write=write, progress=False, **given)
    except ShardsFailedError as error:
        print(error, file=sys.stderr)
        return _SET_ASIDE
    return 0


@dataclass
class _Command:
    """One start of the command.

    Attributes:
        engine: engine.
        workers: worker processes.
        folder: where the shards go.
        shards: what to make.
        timeout: seconds that a shard may take.
    """

    engine: str
    workers: int
    folder: Path
    shards: Sequence[Shard]
    timeout: float
    _mark: str = field(init=False, default_factory=lambda: secrets.token_hex(8))

    @contextmanager
    def started(self) -> Iterator[subprocess.Popen[str]]:
        """Starts it, in a session of its own, and kills it at the end."""
        given = {
            "folder": str(self.folder),
            "backend": self.engine,
            "workers": self.workers,
            "timeout": self.timeout,
            "work": self.shards[0].work,
            "shards": [asdict(each) for each in self.shards],
        }
        script = "import sys; from benchmarks.faults import command; sys.exit(command(sys.argv[1]))"
        # To a file: what stays behind would hold a pipe open.
        with self._log().open("w") as log:
            process = subprocess.Popen(
                [sys.executable, "-c", script, json.dumps(given)],
                cwd=Path(__file__).parents[1],
                env={**os.environ, _MARK: self._mark},
                stdout=subprocess.DEVNULL,
                stderr=log,
                text=True,
                start_new_session=True,
            )
        try:
            yield process
        finally:
            process.kill()
            process.wait()

    def _log(self) -> Path:
        return self.folder.with_name(f"{self.folder.name}.log")

    def errors(self) -> str:
        """The end of what it said on stderr."""
        return self._log().read_text(errors="replace")[-2000:]

    def processes(self) -> list[int]:
        """Its processes that are alive, by their number."""
        return [pid for pid in _pids() if _is_marked(pid, self._mark)]

    def farewell(self) -> tuple[float, list[str]]:
        """Seconds until its last process had ended, and those that had to be killed for it."""
        start = time.monotonic()
        while (left := self.processes()) and time.monotonic() - start < _FAREWELL:
            time.sleep(0.05 if time.monotonic() - start < _SHORT_FAREWELL else 1.0)
        seconds = time.monotonic() - start
        orphans = [_described(pid) for pid in left]
        for pid in left:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                continue
        return seconds, orphans


def _pids() -> Iterator[int]:
    return (int(path.name) for path in Path("/proc").iterdir() if path.name.isdigit())


def _is_marked(pid: int, mark: str) -> bool:
    """Whether a process that is no zombie has the mark in its environment."""
    folder = Path("/proc") / str(pid)
    try:
        # A zombie's environment is empty.
        return f"{_MARK}={mark}".encode() in (folder / "environ").read_bytes().split(b"\0")
    except OSError:
        return False


def _described(pid: int) -> str:
    """A process's state and command line, "T ray::_RayWorker.call"."""
    folder = Path("/proc") / str(pid)
    try:
        state = (folder / "stat").read_text().rpartition(") ")[2][:1]
        words = (folder / "cmdline").read_bytes().decode(errors="replace").replace("\0", " ")
    except OSError:
        return f"process {pid}, just ended"
    return f"{state} {words[:200]}"


# --- Measurements --------------------------------------------------------------------------------


class _Torment:
    """Runs the command for one engine and number of workers, and keeps account."""

    def __init__(self, config: FaultsConfig, engine: str, workers: int, scratch: Path) -> None:
        self.config = config
        self._farewells: list[Future[tuple[float, list[str]]]] = []
        self.engine, self.workers = engine, workers
        self.folder = scratch / f"{engine}-{workers}"
        self.seconds = 0.0
        self.counts: Counter[str] = Counter()
        self.kinds: Counter[str] = Counter()
        self.farewell = 0.0
        self.slowest = {"seconds": 0.0, "budget": 0.0}
        self.problems: list[str] = []

    @property
    def title(self) -> str:
        """Engine and workers."""
        return f"{self.engine}, {self.workers}"

    def plain(self) -> dict[str, bytes]:
        """What an undisturbed run makes."""
        start = time.monotonic()
        self._finish(self._command(), 600.0)
        self.seconds = time.monotonic() - start
        return _folder_bytes(self.folder)

    def kill_once(self, rng: np.random.Generator, expected: dict[str, bytes]) -> bool:
        """Starts the command and kills it; False if it was done before that."""
        each = self._command()
        with each.started() as process, suppress(subprocess.TimeoutExpired):
            process.wait(rng.uniform(0.0, self.seconds))
        is_killed = process.returncode == -signal.SIGKILL
        if not is_killed:
            self._check_end(each, process.returncode)
        self._say_farewell(each)
        for path in self.folder.glob("*"):
            if (problem := _unreadable(path, self.config.work)) is not None:
                self.counts["unreadable"] += 1
                self.problems.append(problem)
        if not is_killed:
            self._compare(expected)
        self.counts["kills" if is_killed else "finished"] += 1
        return is_killed

    def finish(self, expected: dict[str, bytes]) -> None:
        """Lets the command end after its kills."""
        self._finish(self._command(), 600.0)
        self._compare(expected)

    def fail_workers(
        self, faults: Sequence[str], rng: np.random.Generator, expected: dict[str, bytes]
    ) -> None:
        """Runs the command with so many shards whose first worker fails."""
        shutil.rmtree(self.folder, ignore_errors=True)
        chosen = rng.choice(self.config.shards, len(faults), replace=False)
        by_seed = dict(zip(chosen.tolist(), faults, strict=True))
        scars = self.folder.with_suffix(".scars")
        scars.mkdir()
        shards = [
            Shard(
                work=self.config.work,
                seed=seed,
                draws=self.config.draws,
                fault=by_seed.get(seed),
                delay=rng.uniform(0.0, _LATEST_FAULT),
                scar=str(scars / str(seed)),
            )
            for seed in range(self.config.shards)
        ]
        stuck = sum(fault in ("stopped", "endless loop") for fault in faults)
        # A worker that is stopped when it has nothing to do takes down a later shard.
        budget = 2 * self.seconds + stuck * self.config.timeout + len(faults) * _RESTART
        start = time.monotonic()
        while True:
            each = self._command(shards)
            if self._finish(each, budget - (time.monotonic() - start)) != _SET_ASIDE:
                break
            # Faults of others came upon one shard three times.
            self.counts["set_aside"] += 1
        seconds = time.monotonic() - start
        if seconds > self.slowest["seconds"]:
            self.slowest = {"seconds": round(seconds, 1), "budget": round(budget, 1)}
        self._compare(expected)
        self.kinds.update(by_seed[int(path.name)] for path in scars.iterdir())
        shutil.rmtree(scars)

    def row(self) -> dict[str, Any]:
        """The account, when all processes are gone."""
        for farewell in self._farewells:
            seconds, orphans = farewell.result()
            self.farewell = max(self.farewell, seconds)
            self.counts["orphans"] += len(orphans)
            self.problems += [f"{self.title}: stayed behind: {orphan}" for orphan in orphans]
        names = ("kills", "finished", "unreadable", "set_aside", "hangs", "failed", "orphans")
        return {
            "seconds": round(self.seconds, 2),
            **{name: self.counts[name] for name in names},
            "different": self.counts["different"],
            "compared": self.counts["compared"],
            "farewell": round(self.farewell, 2),
            "faults": {kind: self.kinds[kind] for kind in FAULTS},
            "slowest": self.slowest,
            "problems": self.problems,
        }

    def _command(self, shards: Sequence[Shard] | None = None) -> _Command:
        if shards is None:
            work, draws = self.config.work, self.config.draws
            seeds = range(self.config.shards)
            shards = [Shard(work=work, seed=seed, draws=draws) for seed in seeds]
        self.folder.parent.mkdir(parents=True, exist_ok=True)
        return _Command(self.engine, self.workers, self.folder, shards, self.config.timeout)

    def _finish(self, each: _Command, budget: float) -> int:
        with each.started() as process:
            try:
                self._check_end(each, process.wait(max(budget, 0.0)))
            except subprocess.TimeoutExpired:
                self.counts["hangs"] += 1
                self.problems.append(
                    f"{self.title}: not done after {budget:.0f} s: {each.errors()}"
                )
        self._say_farewell(each)
        return process.returncode

    def _check_end(self, each: _Command, code: int) -> None:
        if code not in (0, _SET_ASIDE):
            self.counts["failed"] += 1
            self.problems.append(f"{self.title}: ended with {code}: {each.errors()}")

    def _say_farewell(self, each: _Command) -> None:
        farewell: Future[tuple[float, list[str]]] = Future()
        threading.Thread(target=lambda: farewell.set_result(each.farewell()), daemon=True).start()
        wait([farewell], timeout=_SHORT_FAREWELL)
        self._farewells.append(farewell)

    def _compare(self, expected: dict[str, bytes]) -> None:
        """Compares with the undisturbed run, and makes way for the next."""
        self.counts["compared"] += 1
        found = _folder_bytes(self.folder)
        if found != expected:
            self.counts["different"] += 1
            names = sorted(n for n in found | expected if found.get(n) != expected.get(n))
            self.problems.append(
                f"{self.title}: other bytes than an undisturbed run in {', '.join(names)}"
            )
        shutil.rmtree(self.folder, ignore_errors=True)


def _folder_bytes(folder: Path) -> dict[str, bytes]:
    paths = folder.iterdir() if folder.exists() else ()
    return {path.name: path.read_bytes() for path in paths}


def _unreadable(path: Path, work: Work) -> str | None:
    """Why a file at its final path cannot be read, None where it can."""
    read = read_pictures if work == "pictures" else read_arrays
    try:
        if path.suffix == ".h5":
            read(path)
        elif path.name == MANIFEST_NAME:
            Manifest.read(path.parent)
    except ArtgymError as error:
        return str(error)
    return None


def measure(config: FaultsConfig) -> dict[str, Any]:
    """Torments the command; the content of ``faults.json``."""
    rng = np.random.default_rng(config.seed)
    start = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="artgym-faults-") as name:
        scratch = Path(name)
        expected = _Torment(config, "loky", 1, scratch / "expected").plain()
        torments = [
            _Torment(config, engine, workers, scratch)
            for engine in config.engines
            for workers in config.workers
        ]
        # In the command's own process nobody can tell a fault from a kill.
        with_workers = [t for t in torments if t.engine != "loky" or t.workers > 1]
        num_faults = config.faults if with_workers else 0
        total = len(torments) + config.kills + num_faults
        with tqdm(total=total, desc="faults", unit="event", file=sys.stderr) as bar:
            for torment in torments:
                if torment.plain() != expected:
                    torment.counts["different"] += 1
                    torment.problems.append(f"{torment.title}: other bytes than in one process")
                torment.counts["compared"] += 1
                shutil.rmtree(torment.folder)
                bar.update()
            turns = cycle(torments)
            num_kills = 0
            while num_kills < config.kills:
                is_killed = next(turns).kill_once(rng, expected)
                num_kills += is_killed
                bar.update(int(is_killed))
            for torment in torments:
                if torment.folder.exists():
                    torment.finish(expected)
            faults = [FAULTS[i % len(FAULTS)] for i in range(num_faults)]
            # In a row, so that each has every kind.
            ends = [len(faults) * i // len(with_workers) for i in range(len(with_workers) + 1)]
            for torment, (begin, end) in zip(with_workers, pairwise(ends), strict=True):
                portion = faults[begin:end]
                for first in range(0, len(portion), config.shards):
                    some = portion[first : first + config.shards]
                    torment.fail_workers(some, rng, expected)
                    bar.update(len(some))
    return {
        **record.provenance("benchmarks.faults"),
        "config": asdict(config),
        "seconds": round(time.monotonic() - start, 1),
        "engine_versions": {engine: version(_ENGINE_PACKAGES[engine]) for engine in config.engines},
        "rows": {torment.title: torment.row() for torment in torments},
    }


# --- Report --------------------------------------------------------------------------------------


def table_from_rows(rows: dict[str, dict[str, Any]]) -> Table:
    """A line for each engine and number of workers."""
    table = Table(title="the same command, killed and with workers that fail")
    table.add_column("engine, workers", no_wrap=True)
    for name in (
        "undisturbed, s",
        "kills",
        "unreadable files",
        *FAULTS,
        "slowest run / budget, s",
        "hangs",
        "set aside",
        "failed",
        "other bytes",
        "orphans",
        "last process after, s",
    ):
        table.add_column(name, justify="right")
    for title, row in rows.items():
        table.add_row(
            title,
            f"{row['seconds']:.1f}",
            str(row["kills"]),
            str(row["unreadable"]),
            *(str(row["faults"][kind]) for kind in FAULTS),
            f"{row['slowest']['seconds']:.0f} / {row['slowest']['budget']:.0f}",
            str(row["hangs"]),
            str(row["set_aside"]),
            str(row["failed"]),
            f"{row['different']} of {row['compared']}",
            str(row["orphans"]),
            f"{row['farewell']:.1f}",
        )
    return table


def report(config: FaultsConfig) -> list[Table]:
    """Measures, writes the result and gives the table."""
    result = measure(config)
    record.write_result(config.out / f"{config.result_name}.json", result)
    return [table_from_rows(result["rows"])]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("faults", FaultsConfig, report, arguments)


if __name__ == "__main__":
    sys.exit(main())
