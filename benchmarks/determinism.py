"""Does a seed give the same bytes, whatever came before it and wherever it runs?

The same seeds are rolled out in several conditions by a policy that touches a lot: everything that
the environment gives must be the same to the last bit. And episodes are brought back by
``set_state`` from the middle of a grasp: they must go on as they would have. Run
``python -m benchmarks.determinism --help``.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import gymnasium
import numpy as np
from numpy.typing import NDArray
from rich.table import Table

import artgym  # noqa: F401  registers the environments
from artgym.envs.arguments import require_known
from artgym.envs.articulated_env import ArticulatedEnv
from artgym.envs.observations import ObsMode
from artgym.envs.snapshot import Snapshot
from artgym.errors import InvalidArgumentError
from artgym.registration import environment_ids
from artgym.sim.robots import RobotName
from benchmarks import record
from benchmarks.command import run
from benchmarks.contact_policy import ContactPolicy
from benchmarks.parallel import results_in_order

Act = Callable[[Any], NDArray[np.float32]]
T = TypeVar("T")
R = TypeVar("R")

#: Seeds, and snapshots, that one task of a worker is about.
_SEEDS_A_TASK, _SNAPSHOTS_A_TASK = 10, 20
#: Steps of the episodes that come in between.
_OTHER_STEPS = 15
#: Steps after which a snapshot is taken whether or not the part is between the fingers, and steps
#: that it stays there first, at most.
_SNAPSHOT_PATIENCE, _MOST_HELD = 1500, 20
#: Steps that an episode brought back is followed for.
_FOLLOWED = 100
#: Hexadecimal digits of a digest that are kept of each step.
_DIGITS = 16


@dataclass(frozen=True, kw_only=True)
class DeterminismConfig:
    """Does a seed give the same bytes, whatever came before it and wherever it runs?

    Attributes:
        env_id: environments.
        obs_mode: of observation.
        robot: "hand" or "panda".
        seeds: how many, from ``seed`` on.
        steps: of control for each seed; an episode that ends on the way is followed by the next.
        horizon: of an episode, control steps.
        others: episodes that come in between in one of the conditions.
        snapshots: taken and brought back.
        fresh: how many of them are brought back in a process of their own too.
        seed: the first, and that of everything else.
        workers: processes; the numbers do not depend on it.
        out: folder for determinism.json.
    """

    env_id: tuple[str, ...] = ("ArtOpen-v0",)
    obs_mode: ObsMode = "state"
    robot: RobotName = "hand"
    seeds: int = 100
    steps: int = 500
    horizon: int = 500
    others: int = 50
    snapshots: int = 1000
    fresh: int = 50
    seed: int = 0
    workers: int = 2
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        least = {"seeds": 1, "steps": 1, "horizon": 1, "others": 1, "snapshots": 0, "fresh": 0}
        for name, value in least.items():
            if getattr(self, name) < value:
                raise InvalidArgumentError(
                    f"{name}={getattr(self, name)}: expected {value} or more."
                )
        for env_id in self.env_id:
            require_known("env_id", env_id, environment_ids())

    def made_with(self) -> dict[str, Any]:
        """Arguments of the environments."""
        return {"obs_mode": self.obs_mode, "robot": self.robot, "horizon": self.horizon}


# --- Digests -------------------------------------------------------------------------------------


def tokens(value: Any) -> Iterator[bytes]:
    """Everything in an observation or info, with types and shapes, as bytes."""
    if isinstance(value, dict):
        for key in sorted(value):
            yield key.encode()
            yield from tokens(value[key])
    elif isinstance(value, np.ndarray | np.generic):
        yield f"{value.dtype} {value.shape}".encode()
        yield value.tobytes()
    else:
        yield f"{type(value).__name__} {value!r}".encode()


class Digest:
    """A running SHA-256 of whatever an environment gives."""

    def __init__(self) -> None:
        self._found = hashlib.sha256()

    def add(self, *values: Any) -> None:
        """Adds observations, infos, numbers."""
        for value in values:
            for token in tokens(value):
                self._found.update(token + b"\0")

    def hex(self) -> str:
        """Of all that was added so far."""
        return self._found.hexdigest()


def digest_of(*values: Any) -> str:
    """SHA-256 of observations, infos, numbers: the same only if they are, to the last bit."""
    digest = Digest()
    digest.add(*values)
    return digest.hex()


# --- Rollouts ------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Rollout:
    """What is kept of the steps that followed a seed.

    Attributes:
        seed: of the reset.
        digests: after the reset and after each step, of everything up to there.
        object_ids: of its episodes.
        touched: steps in which the part moved in touch with the hand, or was between the fingers.
        pinched: steps at whose end the part was between the fingers.
        unstable: episodes that ended in a blow-up.
    """

    seed: int
    digests: tuple[str, ...]
    object_ids: tuple[str, ...]
    touched: int
    pinched: int
    unstable: int

    def first_difference(self, other: Rollout) -> int | None:
        """Number of the first step, 0 for the reset, that is not the same; None if all are."""
        pairs = zip(self.digests, other.digests, strict=True)
        return next((i for i, (a, b) in enumerate(pairs) if a != b), None)


class _Writer:
    """Takes down a rollout from what an environment gives."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._digest = Digest()
        self._digests: list[str] = []
        self._object_ids: list[str] = []
        self._touched = self._pinched = self._unstable = 0
        self._engaged = 0.0

    def reset(self, observation: Any, info: dict[str, Any]) -> None:
        """A reset, of itself or after an episode's end."""
        self._digest.add(observation, info)
        self._object_ids.append(info["object_id"])
        self._engaged = 0.0
        if not self._digests:
            self._digests.append(self._digest.hex()[:_DIGITS])

    def step(self, observation: Any, *rest: Any) -> None:
        """A step: observation, reward, terminated, truncated, info."""
        self._digest.add(observation, *rest)
        self._digests.append(self._digest.hex()[:_DIGITS])
        info = rest[-1]
        pinched = info["reward_terms"]["grip"] > 0.0
        self._pinched += pinched
        # The share rises only by motion in touch.
        self._touched += pinched or info["engaged"] > self._engaged
        self._engaged = info["engaged"]
        self._unstable += info["unstable"]

    def rollout(self) -> Rollout:
        return Rollout(
            seed=self._seed,
            digests=tuple(self._digests),
            object_ids=tuple(self._object_ids),
            touched=self._touched,
            pinched=self._pinched,
            unstable=self._unstable,
        )


def rollout(env: gymnasium.Env[Any, Any], seed: int, steps: int, act: Act) -> Rollout:
    """Resets with a seed and steps; where an episode ends, the next begins without a seed.

    Args:
        env: any of ours.
        seed: of the reset.
        steps: of control.
        act: gives the action for an observation.
    """
    writer = _Writer(seed)
    observation, info = env.reset(seed=seed)
    writer.reset(observation, info)
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(act(observation))
        writer.step(observation, reward, terminated, truncated, info)
        if terminated or truncated:
            observation, info = env.reset()
            writer.reset(observation, info)
    return writer.rollout()


def _actor(config: DeterminismConfig, env_id: str, seed: int) -> Act:
    """Chooses the actions of a seed, by what it observes where that is the state.

    Else it gives the actions that were chosen in an environment whose state is observed.
    """
    policy = ContactPolicy(np.random.default_rng(seed))
    if config.obs_mode in ("state", "state_dict"):
        return policy.act
    chosen: list[NDArray[np.float32]] = []

    def act(observation: Any) -> NDArray[np.float32]:
        chosen.append(policy.act(observation))
        return chosen[-1]

    scout: dict[str, Any] = config.made_with() | {"obs_mode": "state"}
    env: gymnasium.Env[Any, Any] = gymnasium.make(env_id, **scout)
    rollout(env, seed, config.steps, act)
    env.close()
    remaining = iter(chosen)
    return lambda _: next(remaining)


# --- Conditions ----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Seeds:
    """Seeds to be rolled out by one task of a worker.

    Attributes:
        config: of the benchmark.
        env_id: environment.
        condition: of ``CONDITIONS``.
        seeds: in the order in which they come.
    """

    config: DeterminismConfig
    env_id: str
    condition: str
    seeds: tuple[int, ...]

    def make(self) -> gymnasium.Env[Any, Any]:
        """An environment."""
        return gymnasium.make(self.env_id, **self.config.made_with())

    def roll_out(self, env: gymnasium.Env[Any, Any], seed: int) -> Rollout:
        """The steps of a seed."""
        return rollout(env, seed, self.config.steps, _actor(self.config, self.env_id, seed))


def in_one_environment(task: Seeds) -> list[Rollout]:
    """One seed after the other."""
    env = task.make()
    found = [task.roll_out(env, seed) for seed in task.seeds]
    env.close()
    return found


def again(task: Seeds) -> list[Rollout]:
    """Each seed twice; the second time counts."""
    twice = replace(task, seeds=tuple(np.repeat(task.seeds, 2).tolist()))
    return in_one_environment(twice)[1::2]


def in_fresh_environments(task: Seeds) -> list[Rollout]:
    """Each seed in an environment of its own."""
    return [r for seed in task.seeds for r in in_one_environment(replace(task, seeds=(seed,)))]


def in_fresh_processes(task: Seeds) -> list[Rollout]:
    """Each seed in a process of its own."""
    tasks = [replace(task, seeds=(seed,)) for seed in task.seeds]
    return [r for each in tasks for r in in_a_fresh_process(in_one_environment, each)]


def after_others(task: Seeds) -> list[Rollout]:
    """Each seed after many short episodes of other seeds in the same environment."""
    env, found = task.make(), []
    for seed in task.seeds:
        rng = np.random.default_rng([task.config.seed, seed])
        for other in rng.integers(10**6, 2**31, task.config.others).tolist():
            rollout(env, other, _OTHER_STEPS, lambda _, rng=rng: _any_action(rng))
        found.append(task.roll_out(env, seed))
    env.close()
    return found


def by_workers(task: Seeds) -> list[Rollout]:
    """All seeds at once, as copies that are stepped together by one process and by two."""
    return [r for workers in (1, 2) for r in _together(task, workers)]


def _together(task: Seeds, workers: int) -> list[Rollout]:
    config, count = task.config, len(task.seeds)
    _let_workers_spawn()
    envs: Any = gymnasium.make_vec(
        task.env_id,
        num_envs=count,
        workers=workers,
        patience=60.0,
        autoreset_mode="SameStep",
        **config.made_with(),
    )
    writers = [_Writer(seed) for seed in task.seeds]
    acts = [_actor(config, task.env_id, seed) for seed in task.seeds]
    observations, infos = envs.reset(seed=list(task.seeds))
    for i, writer in enumerate(writers):
        writer.reset(_of_copy(observations, i), _of_copy(infos, i, plain=True))
    for _ in range(config.steps):
        actions = [act(_of_copy(observations, i)) for i, act in enumerate(acts)]
        observations, rewards, terminated, truncated, infos = envs.step(np.stack(actions))
        for i, writer in enumerate(writers):
            now = _of_copy(observations, i), _of_copy(infos, i, plain=True)
            flags = float(rewards[i]), bool(terminated[i]), bool(truncated[i])
            if terminated[i] or truncated[i]:
                writer.step(infos["final_obs"][i], *flags, infos["final_info"][i])
                writer.reset(*now)
            else:
                writer.step(now[0], *flags, now[1])
    envs.close()
    return [writer.rollout() for writer in writers]


def _of_copy(batch: Any, i: int, *, plain: bool = False) -> Any:
    """Copy i's share of a batch: of observations, or of infos with ``plain`` numbers."""
    if isinstance(batch, Mapping):
        mine = {k: v for k, v in batch.items() if not (plain and k.startswith(("_", "final_")))}
        return {key: _of_copy(value, i, plain=plain) for key, value in mine.items()}
    value = batch[i]
    return value.item() if plain and isinstance(value, np.generic) else value


def _any_action(rng: np.random.Generator) -> NDArray[np.float32]:
    return rng.uniform(-1.0, 1.0, 7).astype(np.float32)


def in_a_fresh_process(function: Callable[[T], R], task: T) -> R:
    """What a function of a module gives in a process that has done nothing before."""
    _let_workers_spawn()
    # Not forked: that would inherit the simulator.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=context) as executor:
        return executor.submit(function, task).result()


def _let_workers_spawn() -> None:
    """Makes a worker of ``results_in_order`` able to start processes of Python's own."""
    # They would ask for the worker's default way of starting more, which is loky's and unknown.
    if multiprocessing.get_start_method(allow_none=True) == "loky":
        multiprocessing.set_start_method("spawn", force=True)


#: What must change nothing, beside the seeds one after the other in one environment.
CONDITIONS: Mapping[str, Callable[[Seeds], list[Rollout]]] = {
    "again in the same environment": again,
    "a fresh environment": in_fresh_environments,
    "a fresh process": in_fresh_processes,
    "after other episodes": after_others,
    "in shuffled order": in_one_environment,
    "copies by one and by two workers": by_workers,
}
_REFERENCE, _SHUFFLED = "one after the other", "in shuffled order"


def rollouts_of(task: Seeds) -> list[Rollout]:
    """The rollouts of a task, several of a seed where the condition has several."""
    return CONDITIONS.get(task.condition, in_one_environment)(task)


def compare_conditions(config: DeterminismConfig, env_id: str) -> dict[str, Any]:
    """Rolls all seeds out in every condition: what differs, and how much was touched."""
    seeds = list(range(config.seed, config.seed + config.seeds))
    shuffled = np.random.default_rng(config.seed).permutation(seeds).tolist()
    tasks = [
        Seeds(config=config, env_id=env_id, condition=condition, seeds=tuple(chunk))
        for condition in (_REFERENCE, *CONDITIONS)
        for chunk in _chunks(shuffled if condition == _SHUFFLED else seeds, _SEEDS_A_TASK)
    ]
    found = results_in_order(
        rollouts_of, tasks, workers=config.workers, description=env_id, unit="chunk"
    )
    by_condition: dict[str, list[Rollout]] = {}
    for task, rollouts in zip(tasks, found, strict=True):
        by_condition.setdefault(task.condition, []).extend(rollouts)
    reference = {r.seed: r for r in by_condition.pop(_REFERENCE)}
    ids = {i for r in reference.values() for i in r.object_ids}
    steps = config.steps * config.seeds
    return {
        "objects": len(ids),
        "categories": sorted({i.partition("/")[0] for i in ids}),
        "episodes": sum(len(r.object_ids) for r in reference.values()),
        "unstable": sum(r.unstable for r in reference.values()),
        "touched": sum(r.touched for r in reference.values()) / steps,
        "pinched": sum(r.pinched for r in reference.values()) / steps,
        "compared": config.seeds * len(CONDITIONS),
        "conditions": {
            condition: differences(rollouts, reference)
            for condition, rollouts in by_condition.items()
        },
    }


def differences(
    rollouts: Sequence[Rollout], reference: Mapping[int, Rollout]
) -> list[dict[str, int]]:
    """Seeds that are not as in the reference, with the first step that is not; each once."""
    found: dict[int, int] = {}
    for each in rollouts:
        step = each.first_difference(reference[each.seed])
        if step is not None:
            found[each.seed] = min(step, found.get(each.seed, step))
    return [{"seed": seed, "step": step} for seed, step in sorted(found.items())]


def _chunks(values: Sequence[int], size: int) -> list[Sequence[int]]:
    return [values[start : start + size] for start in range(0, len(values), size)]


# --- Snapshots -----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Snapshots:
    """Snapshots to be taken and brought back by one task of a worker.

    Attributes:
        config: of the benchmark.
        env_id: environment.
        numbers: which.
    """

    config: DeterminismConfig
    env_id: str
    numbers: tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class Resumption:
    """An episode to be brought back.

    Attributes:
        env_id: environment.
        made_with: its arguments.
        state: where the episode stood.
        actions: float32 (n, 7), what is done then.
    """

    env_id: str
    made_with: Mapping[str, Any]
    state: Snapshot
    actions: NDArray[np.float32]


def resume(task: Resumption, env: ArticulatedEnv | None = None) -> str:
    """Digest of an episode that is brought back and gone on with.

    Args:
        task: which.
        env: where; in an environment of its own by default.
    """
    mine = _make(task.env_id, task.made_with) if env is None else env
    digest = Digest()
    digest.add(*mine.set_state(task.state))
    _follow(mine, task.actions, digest)
    if env is None:
        mine.close()
    return digest.hex()


def snapshot_record(
    number: int,
    config: DeterminismConfig,
    env_id: str,
    scout: ArticulatedEnv,
    env: ArticulatedEnv,
    other: ArticulatedEnv,
) -> dict[str, Any]:
    """Takes a snapshot in ``env``, brings it back in ``other``, and says how that went."""
    rng = np.random.default_rng([config.seed, number])
    seed, way = way_to_grasp(scout, rng)
    observation, info = env.reset(seed=seed)
    for action in way:
        observation, *_, info = env.step(action)
    resumption = Resumption(
        env_id=env_id,
        made_with=config.made_with(),
        state=env.get_state(),
        actions=_pulls(rng, _FOLLOWED),
    )
    digest = Digest()
    digest.add(observation, info)
    pinched = _follow(env, resumption.actions, digest)
    # Evenly over all snapshots.
    is_fresh = (number + 1) * config.fresh // config.snapshots > (
        number * config.fresh // config.snapshots
    )
    return {
        "number": number,
        "object_id": info["object_id"],
        "elapsed_steps": info["elapsed_steps"],
        "pinching": info["reward_terms"]["grip"] > 0.0,
        "pinched_after": pinched,
        "same": resume(resumption, other) == digest.hex(),
        "same_in_a_fresh_process": (
            in_a_fresh_process(resume, resumption) == digest.hex() if is_fresh else None
        ),
    }


def snapshots_of(task: Snapshots) -> list[dict[str, Any]]:
    """Takes the snapshots of a task; see ``snapshot_record``."""
    made_with = task.config.made_with()
    scout = _make(task.env_id, made_with | {"obs_mode": "state"})
    env, other = _make(task.env_id, made_with), _make(task.env_id, made_with)
    found = [snapshot_record(n, task.config, task.env_id, scout, env, other) for n in task.numbers]
    for each in (scout, env, other):
        each.close()
    return found


def _make(env_id: str, made_with: Mapping[str, Any]) -> ArticulatedEnv:
    # Unwrapped: wrappers want to see a reset before a step, and see no ``set_state``.
    env = gymnasium.make(env_id, **made_with).unwrapped
    assert isinstance(env, ArticulatedEnv)
    return env


def way_to_grasp(
    scout: gymnasium.Env[Any, Any], rng: np.random.Generator
) -> tuple[int, NDArray[np.float32]]:
    """A seed, and actions (n, 7) after which the part has been between the fingers for a while.

    Args:
        scout: an environment in which they are found; the state is its observation.
        rng: of the seed and of what is tried.
    """
    act, most_held = ContactPolicy(rng).act, int(rng.integers(1, _MOST_HELD))
    actions: list[NDArray[np.float32]] = []
    seed, held, is_over = 0, 0, True
    for _ in range(_SNAPSHOT_PATIENCE):
        if is_over:
            seed, held, actions = int(rng.integers(2**31)), 0, []
            observation, _ = scout.reset(seed=seed)
        actions.append(act(observation))
        observation, _, terminated, truncated, info = scout.step(actions[-1])
        is_over = terminated or truncated
        held = held + 1 if info["reward_terms"]["grip"] > 0.0 else 0
        if not is_over and (held == most_held):
            break
    # An episode that is over cannot be gone on with.
    return seed, np.array(actions[:-1] if is_over else actions).reshape(-1, 7)


def _follow(env: ArticulatedEnv, actions: NDArray[np.float32], digest: Digest) -> int:
    """Does the actions; in how many steps the part was between the fingers."""
    pinched = 0
    for action in actions:
        observation, reward, terminated, truncated, info = env.step(action)
        digest.add(observation, reward, terminated, truncated, info)
        pinched += info["reward_terms"]["grip"] > 0.0
        if terminated or truncated:
            digest.add(*env.reset())
    return pinched


def _pulls(rng: np.random.Generator, steps: int) -> NDArray[np.float32]:
    """Actions (steps, 7) that pull this way and that, mostly with closed jaws."""
    held = 10
    pulls = rng.uniform(-1.0, 1.0, (-(-steps // held), 7)) * [0.3, 0.3, 0.3, 0.1, 0.1, 0.1, 0.0]
    pulls[:, 6] = np.where(rng.random(len(pulls)) < 0.1, 1.0, -1.0)
    return np.repeat(pulls, held, axis=0)[:steps].astype(np.float32)


def compare_snapshots(config: DeterminismConfig, env_id: str) -> dict[str, Any]:
    """Takes all snapshots and brings them back: what differs, and how many were in a grasp."""
    tasks = [
        Snapshots(config=config, env_id=env_id, numbers=tuple(chunk))
        for chunk in _chunks(range(config.snapshots), _SNAPSHOTS_A_TASK)
    ]
    chunks = results_in_order(
        snapshots_of,
        tasks,
        workers=config.workers,
        description=f"{env_id}: snapshots",
        unit="chunk",
    )
    records = [each for chunk in chunks for each in chunk]
    fresh = [r for r in records if r["same_in_a_fresh_process"] is not None]
    return {
        "snapshots": len(records),
        "objects": len({r["object_id"] for r in records}),
        "pinching": float(np.mean([r["pinching"] for r in records])),
        "pinched_after": float(np.mean([r["pinched_after"] for r in records])) / _FOLLOWED,
        "elapsed_steps": float(np.mean([r["elapsed_steps"] for r in records])),
        "differing": [r for r in records if not r["same"]],
        "in_a_fresh_process": len(fresh),
        "differing_in_a_fresh_process": [r for r in fresh if not r["same_in_a_fresh_process"]],
    }


# --- The benchmark -------------------------------------------------------------------------------


def measure(config: DeterminismConfig) -> dict[str, Any]:
    """Measures every environment; a result for ``record.write_result``."""
    began = time.perf_counter()
    rows = {}
    for env_id in config.env_id:
        rows[env_id] = {"rollouts": compare_conditions(config, env_id)}
        if config.snapshots:
            rows[env_id]["snapshots"] = compare_snapshots(config, env_id)
    return {
        **record.provenance("benchmarks.determinism"),
        "config": asdict(config),
        "seconds": round(time.perf_counter() - began, 1),
        "rows": rows,
    }


def table_from_rows(rows: Mapping[str, Mapping[str, Any]]) -> Table:
    """The table for a person to read."""
    table = Table(title="determinism: what is not the same to the last bit")
    for name in ("environment", "compared with seeds one after the other", "differ"):
        table.add_column(name, justify="right" if name == "differ" else "left")
    for env_id, row in rows.items():
        rollouts = row["rollouts"]
        each = rollouts["compared"] // len(rollouts["conditions"])
        for condition, differing in rollouts["conditions"].items():
            table.add_row(env_id, condition, f"{len(differing)} of {each}")
        table.add_row(
            env_id,
            f"all: {rollouts['objects']} objects of {len(rollouts['categories'])} categories, "
            f"{100 * rollouts['touched']:.0f} % of steps in touch, "
            f"{100 * rollouts['pinched']:.0f} % pinching",
            f"{sum(map(len, rollouts['conditions'].values()))} of {rollouts['compared']}",
            end_section=True,
        )
        if snapshots := row.get("snapshots"):
            table.add_row(
                env_id,
                f"snapshots brought back, {100 * snapshots['pinching']:.0f} % of them pinching",
                f"{len(snapshots['differing'])} of {snapshots['snapshots']}",
            )
            table.add_row(
                env_id,
                "snapshots brought back in a fresh process",
                f"{len(snapshots['differing_in_a_fresh_process'])} of "
                f"{snapshots['in_a_fresh_process']}",
                end_section=True,
            )
    return table


def report(config: DeterminismConfig) -> list[Table]:
    """Measures, writes ``determinism.json`` and gives the table."""
    result = measure(config)
    record.write_result(config.out / "determinism.json", result)
    return [table_from_rows(result["rows"])]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("determinism", DeterminismConfig, report, arguments)


if __name__ == "__main__":
    # Not this module's own: processes that are started find functions by the module's name.
    from benchmarks.determinism import main as main_by_name

    sys.exit(main_by_name())
