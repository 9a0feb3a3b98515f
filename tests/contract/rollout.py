"""Runs an environment and tells its observations, rewards and infos apart to the last bit.

As a script it prints the digests of rollouts, for comparison with another process.
"""

from __future__ import annotations

import hashlib
import json
import sys
from collections.abc import Iterator
from typing import Any

import gymnasium
import numpy as np

import artgym  # noqa: F401
from artgym.envs.observations import IMAGE_MODES, OBS_MODES

__all__ = ["IMAGE_MODES", "OBS_MODES", "digest", "make"]

#: Small pictures and clouds keep the tests fast. Stable-Baselines3 wants 36 pixels.
SMALL = {"camera_size": (64, 48), "num_points": 256}
STEPS = 200


def make(env_id: str, obs_mode: str, **arguments: Any) -> gymnasium.Env:
    """An environment with small observations."""
    return gymnasium.make(env_id, obs_mode=obs_mode, **{**SMALL, **arguments})


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


def digest(env: gymnasium.Env, seed: int, steps: int = STEPS) -> str:
    """SHA-256 of everything an environment gives in random steps after one seeded reset."""
    found = hashlib.sha256()

    def add(*values: Any) -> None:
        for value in values:
            for token in tokens(value):
                found.update(token + b"\0")

    rng = np.random.default_rng(seed)
    add(*env.reset(seed=seed))
    for _ in range(steps):
        observation, reward, terminated, truncated, info = env.step(
            rng.uniform(-1, 1, 7).astype(np.float32)
        )
        add(observation, reward, terminated, truncated, info)
        if terminated or truncated:
            add(*env.reset())
    return found.hexdigest()


if __name__ == "__main__":
    asked = json.loads(sys.argv[1])
    print(json.dumps([digest(make(env_id, mode), 7) for env_id, mode in asked]))
