"""One episode of one policy, and what is kept of it."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import gymnasium
import numpy as np
from numpy.typing import NDArray

import artgym  # noqa: F401  registers the environments
from artgym.objects import catalog
from artgym.sim.robots import RobotName
from benchmarks.policies import policy_entry

#: Which movable part an episode is about: the object's first, or all of them in turn.
PartChoice = Literal["first", "in turn"]


@dataclass(frozen=True, kw_only=True)
class EpisodeTask:
    """Which episode is to be run; determines its record but for the time it takes.

    Attributes:
        policy: name of a policy, or "module:Class".
        category: and ``split``: where the object is from.
        object_id: the object.
        part: index of the part to move.
        episode: number among those of this object.
        seed: of the environment.
        policy_seed: of the policy; another, lest its draws repeat the environment's.
        weights: folder with ``{category}.safetensors``; None for the shipped ones.
        env_id: of the environment.
        robot: that acts in it.
    """

    policy: str
    category: str
    split: catalog.Split
    object_id: str
    part: int
    episode: int
    seed: int
    policy_seed: int
    weights: Path | None = None
    env_id: str = "ArtOpen-v0"
    robot: RobotName = "hand"


@dataclass(frozen=True, kw_only=True)
class EpisodeRecord:
    """What is kept of an episode: its end, by the fields of the environment's ``info``.

    Attributes:
        policy, category, object_id, part, episode, seed: as of the task.
        success, success_gripped, success_once, success_at, success_maniskill,
            success_where2act: at the last step.
        travel, engaged, gripped, open_fraction: at the last step, shares.
        steps: control steps done.
        unstable: whether physics blew up.
        seconds: time taken, building the scene included.
    """

    policy: str
    category: str
    object_id: str
    part: int
    episode: int
    seed: int
    success: bool
    success_gripped: bool
    success_once: bool
    success_at: dict[str, bool]
    success_maniskill: bool
    success_where2act: bool
    travel: float
    engaged: float
    gripped: float
    open_fraction: float
    steps: int
    unstable: bool
    seconds: float


_FROM_INFO = (
    "success",
    "success_gripped",
    "success_once",
    "success_at",
    "success_maniskill",
    "success_where2act",
    "unstable",
)
_ROUNDED_FROM_INFO = ("travel", "engaged", "gripped", "open_fraction")


def episode_tasks(
    policy: str,
    category: str,
    split: catalog.Split,
    objects: int,
    episodes: int,
    *,
    seed: int,
    weights: Path | None = None,
    parts: PartChoice = "first",
    env_id: str = "ArtOpen-v0",
    robot: RobotName = "hand",
) -> list[EpisodeTask]:
    """The episodes of a row: every policy is given the same objects, parts and starts."""
    tasks = []
    for index, object_id in enumerate(catalog.object_ids(category, split, objects)):
        movable = catalog.load(object_id).num_parts - 1
        for episode in range(episodes):
            seeds = np.random.SeedSequence([seed, index, episode]).generate_state(2)
            tasks.append(
                EpisodeTask(
                    policy=policy,
                    category=category,
                    split=split,
                    object_id=object_id,
                    part=1 + (index + episode) % movable if parts == "in turn" else 1,
                    episode=episode,
                    # Below 2**31, which every consumer of a seed accepts.
                    seed=int(seeds[0] >> 1),
                    policy_seed=int(seeds[1] >> 1),
                    weights=weights,
                    env_id=env_id,
                    robot=robot,
                )
            )
    return tasks


def run_episode(
    task: EpisodeTask,
    *,
    render_mode: str | None = None,
    watch: Callable[[gymnasium.Env[Any, Any], Any, Any], None] | None = None,
) -> EpisodeRecord:
    """Runs an episode to its end.

    Args:
        task: which.
        render_mode: of the environment.
        watch: called after each decision with the environment, the policy and the observation
            that it decided on.
    """
    entry = policy_entry(task.policy)
    began = time.perf_counter()
    env = gymnasium.make(
        task.env_id,
        objects=(task.object_id,),
        robot=task.robot,
        target_part=task.part,
        obs_mode=entry.obs_mode,
        render_mode=render_mode,
        disable_env_checker=True,
    )
    try:
        policy = entry.make(env, task.category, task.weights)
        observation, info = env.reset(seed=task.seed)
        policy.reset(task.policy_seed)
        steps, over = 0, False
        while not over:
            action: NDArray[np.float32] = policy.act(observation)
            if watch is not None:
                watch(env, policy, observation)
            observation, _, terminated, truncated, info = env.step(action)
            over = terminated or truncated
            steps += 1
    finally:
        env.close()
    return EpisodeRecord(
        policy=task.policy,
        category=task.category,
        object_id=task.object_id,
        part=task.part,
        episode=task.episode,
        seed=task.seed,
        steps=steps,
        seconds=round(time.perf_counter() - began, 3),
        **{name: info[name] for name in _FROM_INFO},
        **{name: round(info[name], 6) for name in _ROUNDED_FROM_INFO},
    )


def run_in_worker(task: EpisodeTask) -> EpisodeRecord:
    """Runs an episode in a process whose network and renderer stay for the next."""
    if policy_entry(task.policy).perceives:
        # Loaded before the clock starts, once a process.
        from benchmarks.policies import load_perception

        load_perception(task.category, task.weights)
    return run_episode(task)


def outcomes(records: Sequence[EpisodeRecord], policy: str, category: str) -> list[EpisodeRecord]:
    """The records of one row."""
    return [r for r in records if r.policy == policy and r.category == category]
