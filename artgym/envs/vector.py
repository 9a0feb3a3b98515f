"""Many environments stepped together, in this process or in a few of them.

``gymnasium.make_vec("ArtOpen-v0", num_envs=8)`` comes here. Gymnasium's own modes "sync" and
"async" work too; but its "async" waits for ever for a worker that was killed or hangs.
"""

from __future__ import annotations

import multiprocessing
import multiprocessing.connection
import traceback
from collections.abc import Callable, Mapping, Sequence
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from numbers import Real
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space, concatenate, create_empty_array

from artgym.envs import arguments
from artgym.envs.articulated_env import ArtCloseEnv, ArticulatedEnv, ArtOpenEnv
from artgym.envs.scene_env import ArtSceneEnv
from artgym.errors import ArtgymError, InvalidArgumentError, NotReadyError, WorkerError
from artgym.sim.robots import ACTION_SIZES

#: Starting a process and its first picture take this many times as long as a step may.
_START_PATIENCE = 12.0
#: More patience than this many seconds would be none.
_MOST_PATIENCE = 86_400.0

#: What one copy answers to a step: observation, reward, terminated, truncated, info; and, where a
#: new episode was begun in the same step, the last observation and info of the one before.
_Step = tuple[Any, float, bool, bool, dict[str, Any], tuple[Any, dict[str, Any]] | None]


class _Copies:
    """Environments of one process, begun anew when their episodes end.

    Args:
        env_class: what they are.
        count: how many.
        at_once: whether a new episode begins in the step in which the last one ends, or in the
            one after.
        made_with: the arguments of each.
    """

    def __init__(
        self,
        env_class: type[ArticulatedEnv],
        count: int,
        at_once: bool,
        made_with: Mapping[str, Any],
    ) -> None:
        self.envs = [env_class(**made_with) for _ in range(count)]
        self._at_once = at_once
        self._over = [False] * count

    def reset(
        self, seeds: Sequence[int | None], options: Mapping[str, Any] | None
    ) -> list[tuple[Any, dict[str, Any]]]:
        self._over = [False] * len(self.envs)
        return [
            env.reset(seed=seed, options=options)
            for env, seed in zip(self.envs, seeds, strict=True)
        ]

    def step(self, actions: Sequence[Any]) -> list[_Step]:
        steps: list[_Step] = []
        for i, (env, action) in enumerate(zip(self.envs, actions, strict=True)):
            if self._over[i]:
                self._over[i] = False
                observation, info = env.reset()
                steps.append((observation, 0.0, False, False, info, None))
                continue
            observation, reward, terminated, truncated, info = env.step(action)
            final = None
            if (terminated or truncated) and self._at_once:
                final = observation, info
                observation, info = env.reset()
            elif terminated or truncated:
                self._over[i] = True
            steps.append((observation, reward, terminated, truncated, info, final))
        return steps

    def call(self, name: str, *values: Any) -> list[Any]:
        found = [getattr(env, name) for env in self.envs]
        return [f(*values) if callable(f) else f for f in found]

    def close(self) -> None:
        for env in self.envs:
            env.close()


def _serve(
    connection: Connection,
    env_class: type[ArticulatedEnv],
    count: int,
    at_once: bool,
    made_with: Mapping[str, Any],
) -> None:
    """A worker: answers (method, arguments) with (True, result) or (False, error)."""
    copies: _Copies | None = None
    while True:
        try:
            method, values = connection.recv()
        except (EOFError, OSError, KeyboardInterrupt):
            return
        try:
            if copies is None:
                copies = _Copies(env_class, count, at_once, made_with)
            answer: tuple[bool, Any] = True, getattr(copies, method)(*values)
        except ArtgymError as error:
            answer = False, error
        except Exception:
            answer = False, WorkerError(traceback.format_exc())
        connection.send(answer)


class _Worker:
    """A process with copies in it, which is never waited for without end."""

    def __init__(
        self,
        number: int,
        env_class: type[ArticulatedEnv],
        count: int,
        at_once: bool,
        made_with: Mapping[str, Any],
        patience: float,
    ) -> None:
        # A forked copy of a process that has a simulator in it hangs.
        context = multiprocessing.get_context("spawn")
        self.count = count
        self._number = number
        self._patience = patience
        self._connection, theirs = context.Pipe()
        self.process: SpawnProcess = context.Process(
            target=_serve,
            args=(theirs, env_class, count, at_once, dict(made_with)),
            name=f"artgym-{number}",
            daemon=True,
        )
        self.process.start()
        theirs.close()

    def ask(self, method: str, *values: Any) -> None:
        try:
            self._connection.send((method, values))
        except (BrokenPipeError, OSError) as error:
            raise self._lost() from error

    def answer(self, *, slow: bool = False) -> Any:
        patience = self._patience * (_START_PATIENCE if slow else 1.0)
        ready = multiprocessing.connection.wait(
            [self._connection, self.process.sentinel], timeout=patience
        )
        if not ready:
            raise WorkerError(
                f"worker {self._number} (process {self.process.pid}) has not answered for "
                f"{patience:.0f} s: it hangs, or patience={self._patience} is too short for it. "
                "Close these environments and make new ones."
            )
        try:
            if self._connection not in ready and not self._connection.poll():
                raise self._lost()
            done, result = self._connection.recv()
        except (EOFError, OSError) as error:
            raise self._lost() from error
        if not done:
            raise result
        return result

    def _lost(self) -> WorkerError:
        self.process.join(1.0)
        return WorkerError(
            f"worker {self._number} (process {self.process.pid}) has died with exit status "
            f"{self.process.exitcode}. Close these environments and make new ones."
        )

    def close(self) -> None:
        """Ends the process, whatever state it is in."""
        self._connection.close()
        self.process.join(0.2)
        if self.process.is_alive():
            self.process.kill()
            self.process.join(5.0)


class ArticulatedVectorEnv(VectorEnv[Any, Any, Any]):
    """Copies of an environment, stepped together.

    Copy i is reset with seed + i. A copy whose episode is over begins the next one by itself.
    Results do not depend on the number of workers.

    Args:
        env_class: class of the copies.
        num_envs: how many.
        workers: processes that step them; 0 steps them in this one, which is best for up to a
            handful of copies without pictures.
        patience: seconds a worker may take for a step before it counts as hung.
        autoreset_mode: when the next episode begins: NEXT_STEP, in which the action counts for
            nothing, or SAME_STEP, with the end of the last one in ``info["final_obs"]`` and
            ``info["final_info"]``, arrays of objects.
        max_episode_steps: another name for the copies' ``horizon``, which Gymnasium gives.
        made_with: arguments of the copies.

    Raises:
        InvalidArgumentError: an argument cannot be used; those of the copies included.
        WorkerError: a worker died or hangs, at once or after ``patience``; ``close`` still works.
    """

    def __init__(
        self,
        env_class: type[ArticulatedEnv],
        num_envs: int = 1,
        *,
        workers: int = 0,
        patience: float = 10.0,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        **made_with: Any,
    ) -> None:
        arguments.require_between("num_envs", num_envs, 1, 4096)
        arguments.require_between("workers", workers, 0, 256)
        if not (isinstance(patience, Real) and 0 < patience <= _MOST_PATIENCE):
            raise InvalidArgumentError(
                f"patience={patience!r}: expected seconds, more than 0 and at most {_MOST_PATIENCE}"
            )
        modes = (AutoresetMode.NEXT_STEP.value, AutoresetMode.SAME_STEP.value)
        mode = getattr(autoreset_mode, "value", autoreset_mode)
        arguments.require_known("autoreset_mode", mode, modes)
        autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**ArticulatedEnv.metadata, "autoreset_mode": autoreset_mode}
        at_once = autoreset_mode is AutoresetMode.SAME_STEP
        if max_episode_steps is not None:
            made_with["horizon"] = max_episode_steps
        self.num_envs = num_envs
        self.render_mode = made_with.get("render_mode")
        # Whatever is wrong with the arguments is said here and not by a worker.
        self._copies = _Copies(env_class, 1 if workers else num_envs, at_once, made_with)
        first = self._copies.envs[0]
        self.single_observation_space = first.observation_space
        self.single_action_space = first.action_space
        self._action_size = ACTION_SIZES[first.control_mode]
        self.observation_space = batch_space(first.observation_space, num_envs)
        self.action_space = batch_space(first.action_space, num_envs)
        self._workers: list[_Worker] = []
        self._closed = False
        if workers:
            self._copies.close()
            shares = np.array_split(np.arange(num_envs), min(workers, num_envs))
            for number, share in enumerate(shares):
                self._workers.append(
                    _Worker(number, env_class, len(share), at_once, made_with, float(patience))
                )

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Any, dict[str, Any]]:
        """Begins an episode in every copy; ``seed`` is the first copy's, or a list of all.

        Raises:
            NotReadyError: after ``close``.
        """
        seeds: list[int | None]
        if seed is None or arguments.is_whole(seed):
            first = arguments.require_seed(seed)
            seeds = [None if first is None else first + i for i in range(self.num_envs)]
        else:
            try:
                seeds = [arguments.require_seed(each) for each in seed]  # type: ignore[union-attr]
            except TypeError as error:
                raise InvalidArgumentError(
                    f"seed={seed!r}: expected a whole number, or one for each environment"
                ) from error
        if len(seeds) != self.num_envs:
            raise InvalidArgumentError(
                f"seed: {len(seeds)} seeds for {self.num_envs} environments; expected one each"
            )
        answers = self._all("reset", [seeds], options, slow=True)
        return self._batch([o for o, _ in answers]), _merged([info for _, info in answers])

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        """Steps every copy.

        Raises:
            InvalidArgumentError: actions of a wrong shape, or not finite.
            NotReadyError: before ``reset`` or after ``close``.
        """
        try:
            count = len(actions)
        except TypeError:
            count = -1
        if count != self.num_envs:
            raise InvalidArgumentError(
                f"actions: expected {self.num_envs} of them, one for each environment; got "
                f"{actions if count < 0 else count}"
            )
        for action in actions:
            # All or none: a wrong one is found before any copy has moved.
            arguments.read_action(action, self._action_size)
        observations, rewards, terminated, truncated, infos, finals = zip(
            *self._all("step", [actions]), strict=True
        )
        merged = _merged(infos)
        ended = np.array([final is not None for final in finals])
        if ended.any():
            for k, key in enumerate(("final_obs", "final_info")):
                merged[key] = np.full(self.num_envs, None, dtype=object)
                for i in np.flatnonzero(ended):
                    merged[key][i] = finals[i][k]
                merged[f"_{key}"] = ended.copy()
        return (
            self._batch(observations),
            np.array(rewards, dtype=np.float64),
            np.array(terminated, dtype=np.bool_),
            np.array(truncated, dtype=np.bool_),
            merged,
        )

    def render(self) -> tuple[Any, ...] | None:
        """A picture of each copy, as theirs."""
        return self.call("render")

    def call(self, name: str, *values: Any) -> tuple[Any, ...]:
        """What each copy's method gives, or its attribute is."""
        return tuple(self._all("call", [], name, *values))

    def close_extras(self, **kwargs: Any) -> None:
        """Frees everything, workers that hang or are dead included."""
        self._closed = True
        self._copies.close()
        for worker in self._workers:
            worker.close()

    def _all(
        self, method: str, shared_out: Sequence[Any], *values: Any, slow: bool = False
    ) -> list[Any]:
        """What a method of ``_Copies`` gives for every copy.

        Args:
            method: its name.
            shared_out: its first arguments, of which every copy gets its own element.
            values: its further arguments.
            slow: whether it may take long.
        """
        if self._closed:
            raise NotReadyError(f"{method} after close(): make new environments.")
        if not self._workers:
            return getattr(self._copies, method)(*shared_out, *values)
        start = 0
        for worker in self._workers:
            end = start + worker.count
            worker.ask(method, *(each[start:end] for each in shared_out), *values)
            start = end
        return [answer for worker in self._workers for answer in worker.answer(slow=slow)]

    def _batch(self, observations: Sequence[Any]) -> Any:
        empty = create_empty_array(self.single_observation_space, self.num_envs)
        return concatenate(self.single_observation_space, observations, empty)


def _merged(infos: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Infos of all copies as arrays by key; ``_key`` says whose they are, here everybody's."""
    merged: dict[str, Any] = {}
    everybody = np.ones(len(infos), dtype=np.bool_)
    for key, first in infos[0].items():
        values = [info[key] for info in infos]
        if isinstance(first, dict):
            merged[key] = _merged(values)
        else:
            merged[key] = np.array(values, dtype=object if isinstance(first, str) else None)
        merged[f"_{key}"] = everybody.copy()
    return merged


def _maker(env_class: type[ArticulatedEnv]) -> Callable[..., ArticulatedVectorEnv]:
    def make(num_envs: int = 1, **options: Any) -> ArticulatedVectorEnv:
        return ArticulatedVectorEnv(env_class, num_envs, **options)

    make.__doc__ = f"Copies of ``{env_class.__name__}``: see ``ArticulatedVectorEnv``."
    return make


make_open, make_close, make_scene = map(_maker, (ArtOpenEnv, ArtCloseEnv, ArtSceneEnv))
