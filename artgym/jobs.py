"""Shards of work over local processes, or over a cluster (``artgym.engines``).

A shard's content depends on its arguments alone, so that any number of workers gives the same
bytes. The folder can be left at any moment, even by a power cut: the next call with the same
configuration makes what is missing.
"""

from __future__ import annotations

import os
import sys
import time
import traceback
from collections import Counter, deque
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from threadpoolctl import threadpool_limits
from tqdm import tqdm

from artgym.engines import WorkerDiedError, require_engine, started_engine
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
#: Seconds that a shard may take unless the caller says otherwise.
DEFAULT_TIMEOUT = 1800.0

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
    timeout: float | None = DEFAULT_TIMEOUT,
    progress: bool = True,
    description: str = "shards",
) -> Manifest:
    """Makes every shard that ``folder`` does not hold yet.

    A shard already there is kept if its checksum is right. A worker process that dies, or takes
    longer than ``timeout`` and is killed, costs its shard, which is tried again after the others;
    the last of ``MAX_DEATHS`` tries is made alone, then it is set aside. A shard whose ``make``
    raises is set aside at once, since it would raise again.

    Args:
        tasks: the shards, with unique names.
        make: gives a shard's content, a sized collection (pictures, or arrays by name), from its
            arguments alone. It runs with one BLAS and torch thread. The manifest is written after
            each shard, so let a shard take seconds or more.
        folder: where the shards and the manifest go; on a cluster, one that all machines share.
        config: JSON values that determine every task's arguments; a folder made with another
            configuration is refused.
        write: writes the content to a path, whole and deterministically (``write_pictures``,
            ``write_arrays``).
        workers: processes. 1 with "loky" works in this process, whose death ends the run and
            whose time is not limited.
        backend: "loky" for processes of this machine; "dask" or "ray" for the cluster that this
            process is connected to (``distributed.Client(...)``, ``ray.init(...)``), or, if it is
            connected to none, for one on this machine with so many workers, closed at the end.
            A script that calls this with "dask" needs ``if __name__ == "__main__":``.
        timeout: seconds that a shard may take, with the start of its worker; None for no limit.
            Time in the queue of a busy cluster does not count.
        progress: show a bar with rate and time left on stderr.
        description: the bar's label.

    Returns:
        The manifest of the finished folder.

    Raises:
        InvalidArgumentError: bad names, workers, backend or timeout, or the folder belongs to
            something else.
        MissingDependencyError: dask or ray is not installed.
        DamagedFileError: the folder's manifest cannot be read.
        FileNotWrittenError: the disk is full or the folder read-only; what was made is kept.
        ShardsFailedError: some shards could not be made; all others were.
        WorkerError: the cluster is gone, or does not let a worker that hangs be killed.
    """
    # Absolute, since workers keep the working directory in which they started.
    folder = Path(folder).absolute()
    if workers < 1:
        raise InvalidArgumentError(f"workers={workers}: expected 1 or more.")
    if timeout is not None and not timeout > 0:
        raise InvalidArgumentError(f"timeout={timeout}: expected seconds above 0, or None.")
    require_engine(backend)
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
        closing(_outcomes(missing, make, write, folder, workers, backend, timeout)) as outcomes,
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
    timeout: float | None,
) -> Generator[_Outcome, None, None]:
    """Works through ``tasks``, yielding as they finish."""
    if not tasks:
        return
    if workers == 1 and backend == "loky":
        for task in tasks:
            yield _finished_shard(task, make, write, folder)
        return

    with started_engine(backend, workers) as engine:
        waiting = deque(tasks)
        #: Tried alone when nothing else runs, so that it has all the memory there is.
        last_tries: deque[ShardTask[A]] = deque()
        losses: dict[str, list[str]] = {}
        running: dict[Future[_Outcome], _Try[A]] = {}
        while waiting or running or last_tries:
            while len(running) < workers and (waiting or (last_tries and not running)):
                task = waiting.popleft() if waiting else last_tries.popleft()
                future = engine.submit(_finished_shard, task, make, write, folder)
                running[future] = _Try(task, began=time.monotonic())

            lost: list[tuple[ShardTask[A], str]] = []
            for future in _done(running, timeout):
                task = running.pop(future).task
                try:
                    outcome = engine.result(future)
                except WorkerDiedError:
                    lost.append((task, "died"))
                else:
                    yield outcome
            for future in _overdue(running, timeout):
                if engine.end(future):
                    task = running.pop(future).task
                    lost.append((task, f"took longer than timeout={timeout:g} s"))
                else:
                    running[future].began = time.monotonic()

            for task, loss in lost:
                before = losses.setdefault(task.name, [])
                before.append(loss)
                if len(before) == MAX_DEATHS:
                    yield _Outcome(name=task.name, failure=_losses_message(before))
                else:
                    (last_tries if len(before) == MAX_DEATHS - 1 else waiting).append(task)


@dataclass
class _Try(Generic[A]):
    """A shard that a worker has, and since when by the monotonic clock."""

    task: ShardTask[A]
    began: float


def _done(
    running: Mapping[Future[_Outcome], _Try[A]], timeout: float | None
) -> list[Future[_Outcome]]:
    """Waits until something is done or overdue; what is done, in the order of its start."""
    patience = None
    if timeout is not None:
        first = min(each.began for each in running.values())
        patience = max(0.0, first + timeout - time.monotonic())
    done = wait(running, timeout=patience, return_when=FIRST_COMPLETED).done
    return [future for future in running if future in done]


def _overdue(
    running: Mapping[Future[_Outcome], _Try[A]], timeout: float | None
) -> list[Future[_Outcome]]:
    now = time.monotonic()
    return [
        future
        for future, each in running.items()
        if timeout is not None and now >= each.began + timeout and not future.done()
    ]


def _losses_message(losses: Sequence[str]) -> str:
    """Why a shard is set aside, "its worker died 2 times and took longer ... 1 times (...)"."""
    counted = " and ".join(f"{loss} {count} times" for loss, count in Counter(losses).items())
    reason = "killed by the system, often for want of memory, or crashed in native code"
    return f"its worker process {counted}" + (f" ({reason})" if "died" in losses else "")


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
