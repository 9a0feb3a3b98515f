"""The same function over many tasks in worker processes, with a bar on stderr."""

from __future__ import annotations

import signal
import sys
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from typing import TypeVar

from joblib.externals.loky import get_reusable_executor
from joblib.externals.loky.process_executor import TerminatedWorkerError
from tqdm import tqdm

from artgym.errors import InvalidArgumentError, WorkerError
from artgym.threads import ONE_THREAD

T = TypeVar("T")
R = TypeVar("R")


def results_in_order(
    function: Callable[[T], R],
    tasks: Sequence[T],
    *,
    workers: int,
    description: str,
    unit: str,
) -> list[R]:
    """``function`` of each task, in the tasks' order, whatever the number of workers.

    Even one worker is a process of its own, so that it has one thread and the same start as any
    other. Interrupted, or when a task raises, the workers end at once.

    Args:
        function: importable from a module; what it keeps in a cache, a worker keeps.
        tasks: small and picklable.
        workers: processes.
        description: the bar's label.
        unit: what a task is.

    Raises:
        InvalidArgumentError: fewer than one worker.
        WorkerError: a worker was killed or crashed.
    """
    if workers < 1:
        raise InvalidArgumentError(f"workers={workers}: expected 1 or more.")
    results: dict[int, R] = {}
    executor = get_reusable_executor(
        max_workers=min(workers, max(len(tasks), 1)),
        reuse=False,  # pyright: ignore[reportArgumentType]
        initializer=_ignore_interrupt,
        env=dict(ONE_THREAD),
    )
    try:
        numbers = {executor.submit(function, task): i for i, task in enumerate(tasks)}
        bar = tqdm(total=len(tasks), desc=description, unit=unit, file=sys.stderr)
        with bar, warnings.catch_warnings():
            # Loky takes the memory of a renderer and a network for a leak, and replaces the
            # worker between two tasks: nothing is lost.
            warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
            for future in as_completed(numbers):
                results[numbers[future]] = future.result()
                bar.update()
    except TerminatedWorkerError as error:
        raise WorkerError(
            "a worker process died (killed by the system, often for want of memory, or crashed in "
            "native code). Repeat the command with fewer --workers."
        ) from error
    finally:
        executor.shutdown(wait=True, kill_workers=True)
    return [results[i] for i in range(len(tasks))]


def _ignore_interrupt() -> None:
    # Ctrl-C reaches every process of the terminal; the parent ends its workers itself.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
