"""Worker processes of this machine (loky), of a dask or of a ray cluster, behind one interface.

Each call has a worker of its own, so that a worker that dies or is killed takes down one call,
and everyone can say which.
"""

from __future__ import annotations

import ctypes
import importlib
import logging
import os
import secrets
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future
from contextlib import contextmanager
from functools import partial
from typing import Any, Protocol

from joblib.externals.loky import ProcessPoolExecutor
from joblib.externals.loky.process_executor import BrokenProcessPool, TerminatedWorkerError

from artgym.errors import ArtgymError, MissingDependencyError, UnknownNameError, WorkerError
from artgym.threads import ONE_THREAD

#: How long a cluster may take to kill a worker and start another, seconds.
_RESTART_TIMEOUT = 60.0
#: Where dask's workers look how much to log.
_DASK_LOG = "DASK_LOGGING__DISTRIBUTED"


class WorkerDiedError(ArtgymError, RuntimeError):
    """The worker process of a call ended before the call did."""


class Engine(Protocol):
    """Workers, each with at most one call at a time."""

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Starts a call on a free worker; there must be one."""
        ...

    def result(self, future: Future[Any]) -> Any:
        """The result of a call that is done.

        Raises:
            WorkerDiedError: its worker died.
            WorkerError: the whole cluster is gone.
        """
        ...

    def end(self, future: Future[Any]) -> bool:
        """Kills the worker of a call, even a stopped one; its result no longer counts.

        Returns:
            False if nothing was ended, since a busy cluster has not begun the call yet.

        Raises:
            WorkerError: the cluster does not let its workers be killed.
        """
        ...

    def close(self) -> None:
        """Ends all processes that it started."""
        ...


@contextmanager
def started_engine(name: str, workers: int) -> Iterator[Engine]:
    """The engine ``name`` with so many workers, closed at the end.

    Args:
        name: "loky" for processes of this machine, "dask" or "ray" for the cluster that this
            process is connected to (``distributed.Client(...)``, ``ray.init(...)``), or for one of
            its own on this machine if it is connected to none.
        workers: how many.

    Raises:
        UnknownNameError: no such engine.
        MissingDependencyError: the engine's package is not installed.
    """
    require_engine(name)
    engine = _ENGINES[name](workers)
    try:
        yield engine
    finally:
        engine.close()


def require_engine(name: str) -> None:
    """Raises UnknownNameError unless there is an engine ``name``."""
    if name not in _ENGINES:
        raise UnknownNameError("backend", name, _ENGINES)


def _imported(module: str, engine: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise MissingDependencyError(
            f"backend={engine!r} needs {module} ({error}): pip install 'artgym[cluster]'"
        ) from error


def _kill_process(pid: int) -> None:
    """Ends a process of this machine, even a stopped one."""
    try:
        os.kill(pid, signal.SIGKILL)
    except ProcessLookupError:  # it has just died by itself
        return


# --- Processes of this machine -------------------------------------------------------------------


class _Loky:
    """Executors of one process each: in a shared one, a death takes down every call."""

    def __init__(self, workers: int) -> None:
        del workers
        self._idle: list[ProcessPoolExecutor] = []
        self._busy: dict[Future[Any], ProcessPoolExecutor] = {}

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        while self._idle:
            executor = self._idle.pop()
            try:
                future = executor.submit(function, *arguments)
            except BrokenProcessPool:  # it died while it had nothing to do
                executor.shutdown(kill_workers=True)
                continue
            self._busy[future] = executor
            return future
        executor = ProcessPoolExecutor(
            max_workers=1, initializer=_follow_parent, initargs=(os.getpid(),), env=dict(ONE_THREAD)
        )
        future = executor.submit(function, *arguments)
        self._busy[future] = executor
        return future

    def result(self, future: Future[Any]) -> Any:
        executor = self._busy.pop(future)
        try:
            value = future.result()
        except BaseException as error:
            executor.shutdown(kill_workers=True)
            if isinstance(error, TerminatedWorkerError):
                raise WorkerDiedError(str(error)) from error
            raise
        self._idle.append(executor)
        return value

    def end(self, future: Future[Any]) -> bool:
        self._busy.pop(future).shutdown(kill_workers=True)
        return True

    def close(self) -> None:
        executors = [*self._idle, *self._busy.values()]
        self._idle, self._busy = [], {}
        for executor in executors:
            executor.shutdown(kill_workers=True)


def _follow_parent(parent: int) -> None:
    """Makes a worker end when its parent does, and only then.

    The parent may have died before the worker came so far: it says itself who it is.
    """
    _ignore_interrupt()
    _ask_for_death_signal()
    threading.Thread(target=_end_with_parent, args=(parent,), daemon=True).start()


def _ignore_interrupt() -> None:
    """Ctrl-C reaches every process of the terminal; the parent ends its workers itself."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _ask_for_death_signal() -> None:
    """Has Linux kill this process with its parent, even when stopped or looping in native code."""
    if sys.platform == "linux":
        set_parent_death_signal = 1
        ctypes.CDLL(None).prctl(set_parent_death_signal, signal.SIGKILL)


def _end_with_parent(parent: int) -> None:
    """A killed parent says no goodbye, and loky's workers would linger with all their memory."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


# --- Dask ----------------------------------------------------------------------------------------


def _dask(workers: int) -> Engine:
    distributed = _imported("distributed", "dask")
    try:
        return _ConnectedDask(distributed, distributed.default_client())
    except ValueError:
        return _OwnDask(distributed, workers)


class _ConnectedDask:
    """The workers of the connected client; its scheduler says which of them does what."""

    def __init__(self, distributed: Any, client: Any) -> None:
        self._distributed, self._client = distributed, client
        self._tasks: dict[Future[Any], Any] = {}

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        future, task = _dask_call(self._client, function, *arguments)
        self._tasks[future] = task
        return future

    def result(self, future: Future[Any]) -> Any:
        del self._tasks[future]
        try:
            return future.result()
        except self._distributed.KilledWorker as error:
            raise WorkerDiedError(str(error)) from error
        except CancelledError as error:
            raise WorkerError(
                f"the dask cluster of {self._client} is gone. Start it and run the same command "
                "again: it goes on where this one stopped."
            ) from error

    def end(self, future: Future[Any]) -> bool:
        task = self._tasks[future]
        calls = self._client.processing()
        addresses = [address for address, keys in calls.items() if task.key in keys]
        if not addresses:
            return False
        del self._tasks[future]
        # First, or another worker would begin the same.
        task.cancel(force=True)
        try:
            self._client.restart_workers(addresses, timeout=_RESTART_TIMEOUT)
        except (TimeoutError, ValueError) as error:
            raise WorkerError(
                f"the dask worker {addresses[0]} hangs and cannot be started again ({error}). End "
                "it, start the cluster's workers with --nanny, and run the same command again."
            ) from error
        return True

    def close(self) -> None:
        for task in self._tasks.values():
            task.cancel(force=True)
        self._tasks = {}


class _OwnDask:
    """Clusters of one worker each on this machine.

    In a shared one, dask does not replace a worker that dies before its nanny has heard from it.
    """

    def __init__(self, distributed: Any, workers: int) -> None:
        del workers
        self._distributed = distributed
        # What dask logs of dying workers, the caller says in fewer words. (Its own silence_logs
        # is undone by the first of several clusters that ends.)
        self._log = logging.getLogger("distributed")
        self._log_before = (self._log.level, os.environ.get(_DASK_LOG))
        self._log.setLevel(logging.CRITICAL)
        os.environ[_DASK_LOG] = "critical"
        #: Clients with their clusters.
        self._idle: list[tuple[Any, Any]] = []
        self._busy: dict[Future[Any], tuple[Any, Any]] = {}

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        client, cluster = self._idle.pop() if self._idle else self._started()
        future, _ = _dask_call(client, function, *arguments)
        self._busy[future] = (client, cluster)
        return future

    def _started(self) -> tuple[Any, Any]:
        # The caller repeats a call whose worker died, and says when one has taken too long; the
        # system guards the memory, as it does of other processes.
        config = {
            "distributed.scheduler.allowed-failures": 0,
            "distributed.scheduler.worker-ttl": None,
        }
        with _imported("dask", "dask").config.set(config):
            cluster = self._distributed.LocalCluster(
                n_workers=0,
                threads_per_worker=1,
                processes=True,
                memory_limit=None,
                dashboard_address="127.0.0.1:0",
                silence_logs=False,
                env=dict(ONE_THREAD),
                preload=[__name__],
            )
        # Does not wait for it.
        cluster.scale(1)
        return self._distributed.Client(cluster, set_as_default=False), cluster

    def result(self, future: Future[Any]) -> Any:
        client, cluster = self._busy.pop(future)
        try:
            value = future.result()
        except BaseException as error:
            self._end(client, cluster)
            if isinstance(error, self._distributed.KilledWorker):
                raise WorkerDiedError(str(error)) from error
            raise
        self._idle.append((client, cluster))
        return value

    def end(self, future: Future[Any]) -> bool:
        self._end(*self._busy.pop(future))
        return True

    def _end(self, client: Any, cluster: Any) -> None:
        for nanny in list(cluster.workers.values()):
            if (pid := nanny.pid) is not None:
                _kill_process(pid)
        client.close()
        cluster.close()

    def close(self) -> None:
        pairs = [*self._idle, *self._busy.values()]
        self._idle, self._busy = [], {}
        for client, cluster in pairs:
            self._end(client, cluster)
        level, for_workers = self._log_before
        self._log.setLevel(level)
        if for_workers is None:
            del os.environ[_DASK_LOG]
        else:
            os.environ[_DASK_LOG] = for_workers


def _dask_call(
    client: Any, function: Callable[..., Any], *arguments: Any
) -> tuple[Future[Any], Any]:
    """A call's future, and dask's task for it."""
    key = f"artgym-{secrets.token_hex(8)}"
    task = client.submit(function, *arguments, key=key, pure=False, retries=0)
    future: Future[Any] = Future()
    task.add_done_callback(partial(_settle, future))
    return future, task


def dask_setup(worker: object) -> None:
    """What dask calls in each worker of its own cluster, before the first call."""
    del worker
    _ignore_interrupt()
    _ask_for_death_signal()


def _settle(future: Future[Any], task: Any) -> None:
    """Gives ``future`` what has become of a dask task."""
    try:
        value = task.result()
    except BaseException as error:
        future.set_exception(error)
    else:
        future.set_result(value)


# --- Ray -----------------------------------------------------------------------------------------


class _RayWorker:
    """What a process of ray's runs; it keeps what calls have loaded."""

    def place(self) -> tuple[str, int]:
        """The machine and the process."""
        return _imported("ray", "ray").get_runtime_context().get_node_id(), os.getpid()

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """The function's result."""
        return function(*arguments)


class _Ray:
    """Actors of the connected cluster, or of one of its own, with one core each."""

    def __init__(self, workers: int) -> None:
        self._ray = _imported("ray", "ray")
        errors = self._ray.exceptions
        self._death_errors = (
            errors.NodeDiedError,
            errors.OutOfMemoryError,
            errors.RayActorError,
            errors.WorkerCrashedError,
        )
        self._is_own = not self._ray.is_initialized()
        if self._is_own:
            # A cluster that nobody asked for tells nobody of itself.
            os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
            self._ray.init(
                address="local",
                num_cpus=workers,
                include_dashboard=False,
                log_to_driver=False,
                logging_level=logging.ERROR,
                _node_ip_address="127.0.0.1",
            )
        self._actor_class = self._ray.remote(num_cpus=1, max_restarts=0)(_RayWorker)
        #: Actors, with the answers to where they are.
        self._idle: list[tuple[Any, Any]] = []
        self._busy: dict[Future[Any], tuple[Any, Any]] = {}

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        if self._idle:
            actor, place = self._idle.pop()
        else:
            actor = self._actor_class.remote()
            place = actor.place.remote()
        future = actor.call.remote(function, *arguments).future()
        self._busy[future] = (actor, place)
        return future

    def result(self, future: Future[Any]) -> Any:
        worker = self._busy.pop(future)
        try:
            value = future.result()
        except self._death_errors as error:
            raise WorkerDiedError(str(error)) from error
        self._idle.append(worker)
        return value

    def end(self, future: Future[Any]) -> bool:
        actor, place = self._busy[future]
        is_placed = bool(self._ray.wait([place], timeout=0)[0])
        if not is_placed and not self._is_own:
            return False
        del self._busy[future]
        if is_placed:
            self._kill(*self._ray.get(place))
        self._ray.kill(actor)
        return True

    def _kill(self, node: str, pid: int) -> None:
        """Ray asks a process to end, which a stopped one does not hear; so this kills it there."""
        strategies = importlib.import_module("ray.util.scheduling_strategies")
        there = strategies.NodeAffinitySchedulingStrategy(node, soft=False)
        kill = self._ray.remote(num_cpus=0, scheduling_strategy=there)(_kill_process)
        try:
            self._ray.get(kill.remote(pid), timeout=_RESTART_TIMEOUT)
        except self._ray.exceptions.RayError as error:
            raise WorkerError(
                f"a ray worker, process {pid} of node {node}, hangs and cannot be killed: {error}"
            ) from error

    def close(self) -> None:
        for actor, _ in [*self._idle, *self._busy.values()]:
            self._ray.kill(actor)
        self._idle, self._busy = [], {}
        if self._is_own:
            self._ray.shutdown()


_ENGINES: dict[str, Callable[[int], Engine]] = {"dask": _dask, "loky": _Loky, "ray": _Ray}
