"""Shards of work over local processes, or over a cluster engine that joblib knows.

A shard's content depends on its arguments alone, so that any number of workers gives the same
bytes. The folder can be left at any moment, even by a power cut: the next call with the same
configuration makes what is missing.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky.process_executor import TerminatedWorkerError
from threadpoolctl import threadpool_limits
from tqdm import tqdm

from artgym.errors import ArtgymError, FileNotWrittenError, InvalidArgumentError
from artgym.files import (
    MANIFEST_NAME,
    Manifest,
    ShardEntry,
    remove_stale_temporaries,
    require_shard_name,
    write_arrays,
)

#: How many worker processes one shard may take down before it is set aside.
MAX_DEATHS = 3

A = TypeVar("A")


class ShardsFailedError(ArtgymError, RuntimeError):
    """Some shards could not be made; the message names them, all others are in the folder."""


@dataclass(frozen=True)
class ShardTask(Generic[A]):
    """One file to make.

    Attributes:
        name: its name in the folder.
        arguments: small and picklable; they determine the content.
    """

    name: str
    arguments: A


@dataclass(frozen=True, kw_only=True)
class _Outcome:
    """What became of one task: an entry, or the reason why there is none."""

    name: str
    entry: ShardEntry | None = None
    failure: str = ""
    #: The disk refused: trying the other shards is no use.
    unwritable: bool = False


def run_shards(
    tasks: Sequence[ShardTask[A]],
    make: Callable[[A], Any],
    folder: str | os.PathLike[str],
    *,
    config: Mapping[str, Any],
    write: Callable[[Path, Any], None] = write_arrays,
    workers: int = 1,
    backend: str = "loky",
    progress: bool = True,
    description: str = "shards",
) -> Manifest:
    """Makes every shard that ``folder`` does not hold yet.

    A shard already there is kept if its checksum is right. With several workers, a process that
    dies costs its shard, which is tried again alone; after ``MAX_DEATHS`` deaths it is set aside.
    A shard whose ``make`` raises is set aside at once, since it would raise again.

    Args:
        tasks: the shards, with unique names.
        make: gives a shard's content, a sized collection (samples, or arrays by name), from its
            arguments alone. It runs with one BLAS and torch thread. The manifest is written after
            each shard, so let a shard take seconds or more.
        folder: where the shards and the manifest go; on a cluster, one that all machines share.
        config: JSON values that determine every task's arguments; a folder made with another
            configuration is refused.
        write: writes the content to a path, whole and deterministically (``write_samples``,
            ``write_arrays``).
        workers: processes; 1 works in this one.
        backend: "loky" for processes of this machine, or a joblib backend connected to a cluster
            ("dask", "ray").
        progress: show a bar with rate and time left on stderr.
        description: the bar's label.

    Returns:
        The manifest of the finished folder.

    Raises:
        InvalidArgumentError: bad names or workers, or the folder belongs to something else.
        DamagedFileError: the folder's manifest cannot be read.
        FileNotWrittenError: the disk is full or the folder read-only; what was made is kept.
        ShardsFailedError: some shards could not be made; all others were.
    """
    # Absolute, since workers keep the working directory in which they started.
    folder = Path(folder).absolute()
    if workers < 1:
        raise InvalidArgumentError(f"workers={workers}: expected 1 or more.")
    names = [task.name for task in tasks]
    for name, count in Counter(names).items():
        require_shard_name(name)
        if count > 1:
            raise InvalidArgumentError(f"tasks: the name {name!r} occurs {count} times.")

    manifest = _resumed_manifest(folder, names, config)
    finished = {shard.name for shard in manifest.shards}
    missing = [task for task in tasks if task.name not in finished]
    failures: dict[str, str] = {}
    with (
        _swept(folder),
        tqdm(
            total=len(tasks),
            initial=len(finished),
            desc=description,
            unit="shard",
            file=sys.stderr,
            disable=not progress,
        ) as bar,
        closing(_outcomes(missing, make, write, folder, workers, backend)) as outcomes,
    ):
        for outcome in outcomes:
            if outcome.unwritable:
                raise FileNotWrittenError(outcome.failure)
            if outcome.entry is not None:
                manifest = manifest.with_shard(outcome.entry)
                manifest.write(folder)
            else:
                failures[outcome.name] = outcome.failure
                if progress:
                    bar.write(f"{outcome.name} set aside: {outcome.failure}", file=sys.stderr)
            bar.update()
    if failures:
        raise ShardsFailedError(_failures_message(folder, failures, len(manifest.shards)))
    return manifest


def _resumed_manifest(folder: Path, names: Sequence[str], config: Mapping[str, Any]) -> Manifest:
    """The manifest of what ``folder`` holds unharmed; written, so that the folder is claimed."""
    if (folder / MANIFEST_NAME).exists():
        before = Manifest.read(folder)
        before.require_config(folder, config)
        if foreign := sorted({shard.name for shard in before.shards} - set(names)):
            raise InvalidArgumentError(
                f"{folder} holds {len(foreign)} shards that are not among the tasks, such as "
                f"{foreign[0]!r}. Give an empty folder, or all the tasks it was made with."
            )
        unharmed = tuple(shard for shard in before.shards if shard.damage(folder) is None)
    else:
        unharmed = ()
        if taken := [name for name in names if (folder / name).exists()]:
            raise InvalidArgumentError(
                f"{folder} holds {taken[0]!r} but no {MANIFEST_NAME}, so that nobody knows how it "
                "was made. Give an empty folder, or delete that file."
            )
    manifest = Manifest(config=dict(config), planned=len(names), shards=unharmed)
    manifest.write(folder)
    return manifest


@contextmanager
def _swept(folder: Path) -> Iterator[None]:
    """Removes half-written files of killed processes, those of an earlier run and of this one."""
    remove_stale_temporaries(folder)
    try:
        yield
    finally:
        remove_stale_temporaries(folder)


def _failures_message(folder: Path, failures: Mapping[str, str], num_made: int) -> str:
    listed = sorted(failures.items())
    reasons = "".join(f"\n  {name}: {reason}" for name, reason in listed[:20])
    more = f"\n  and {len(listed) - 20} more" if len(listed) > 20 else ""
    return (
        f"{len(listed)} shards could not be made, {num_made} lie in {folder}:{reasons}{more}\n"
        "Repair the cause and run the same command again: it makes only these."
    )


def _outcomes(
    tasks: Sequence[ShardTask[A]],
    make: Callable[[A], Any],
    write: Callable[[Path, Any], None],
    folder: Path,
    workers: int,
    backend: str,
) -> Generator[_Outcome, None, None]:
    """Works through ``tasks``, yielding as they finish."""
    if workers == 1:
        for task in tasks:
            yield _finished_shard(task, make, write, folder)
        return

    deaths: Counter[str] = Counter()
    waiting = {task.name: task for task in tasks}
    suspects: list[ShardTask[A]] = []
    while waiting:
        # A death takes down all that runs at that time. Each of these is then tried alone, which
        # tells the shard that kills from those that were its neighbours.
        batch = [suspects.pop()] if suspects else list(waiting.values())
        started: dict[str, ShardTask[A]] = {}
        try:
            for outcome in _parallel_outcomes(
                _recorded(batch, started), make, write, folder, workers, backend
            ):
                del waiting[outcome.name]
                yield outcome
        except TerminatedWorkerError:
            lost = [task for name, task in started.items() if name in waiting]
            suspects.extend(lost)
            if len(lost) == 1:
                name = lost[0].name
                deaths[name] += 1
                if deaths[name] == MAX_DEATHS:
                    suspects.pop()
                    del waiting[name]
                    failure = (
                        f"its worker process died {MAX_DEATHS} times (killed by the system, "
                        "often for want of memory, or crashed in native code)"
                    )
                    yield _Outcome(name=name, failure=failure)


def _recorded(
    tasks: Iterable[ShardTask[A]], started: dict[str, ShardTask[A]]
) -> Iterator[ShardTask[A]]:
    for task in tasks:
        started[task.name] = task
        yield task


def _parallel_outcomes(
    tasks: Iterable[ShardTask[A]],
    make: Callable[[A], Any],
    write: Callable[[Path, Any], None],
    folder: Path,
    workers: int,
    backend: str,
) -> Generator[_Outcome, None, None]:
    """Outcomes in the order they come; no more than ``workers`` tasks are taken ahead."""
    # Threads are limited at start too: a library that a worker imports late is not seen otherwise.
    options: dict[str, Any] = {}
    if backend == "loky":
        options = {
            "inner_max_num_threads": 1,
            "initializer": _follow_parent,
            "initargs": (os.getpid(),),
        }
    with parallel_config(backend=backend, n_jobs=workers, **options):
        parallel = Parallel(
            return_as="generator_unordered",
            batch_size=1,  # pyright: ignore[reportArgumentType]
            pre_dispatch=workers,  # pyright: ignore[reportArgumentType]
            max_nbytes=None,
        )
        finished = parallel(delayed(_finished_shard)(task, make, write, folder) for task in tasks)
        with closing(cast(Generator[_Outcome, None, None], finished)) as outcomes:
            yield from outcomes


def _follow_parent(parent: int) -> None:
    """Makes a worker end when its parent does, and only then.

    The parent may have died before the worker came so far: it says itself who it is.
    """
    # Ctrl-C reaches every process of the terminal; the parent ends its workers itself.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, args=(parent,), daemon=True).start()


def _end_with_parent(parent: int) -> None:
    """A killed parent says no goodbye, and loky's workers would linger with all their memory."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


def _finished_shard(
    task: ShardTask[A],
    make: Callable[[A], Any],
    write: Callable[[Path, Any], None],
    folder: Path,
) -> _Outcome:
    """Makes and writes one shard, here or in a worker."""
    path = folder / task.name
    try:
        # One thread everywhere: sums over several round differently.
        with _one_thread():
            content = make(task.arguments)
        write(path, content)
        return _Outcome(name=task.name, entry=ShardEntry.of(path, len(content)))
    except FileNotWrittenError as error:
        return _Outcome(name=task.name, failure=str(error), unwritable=True)
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        failure = f"{type(error).__name__}: {error} ({place.filename}:{place.lineno})"
        return _Outcome(name=task.name, failure=failure)


@contextmanager
def _one_thread() -> Iterator[None]:
    """One thread for BLAS and OpenMP, and for torch where it is loaded."""
    torch = sys.modules.get("torch")
    before = torch.get_num_threads() if torch else None
    with threadpool_limits(1):
        if torch:
            torch.set_num_threads(1)
        try:
            yield
        finally:
            if torch:
                torch.set_num_threads(before)
