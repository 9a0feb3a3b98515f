"""Runs an environment and tells its observations, rewards and infos apart to the last bit.

As a script it prints the digests of rollouts, for comparison with another process.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np

import artgym  # noqa: F401
from artgym.envs.observations import IMAGE_MODES, OBS_MODES
from artgym.sim.robots import CONTROL_MODES
from benchmarks.determinism import rollout

__all__ = ["CONTROLS", "IMAGE_MODES", "OBS_MODES", "digest", "make", "random_action"]

#: Robot and control mode.
CONTROLS = [(robot, mode) for robot, modes in CONTROL_MODES.items() for mode in modes]
#: Small pictures and clouds keep the tests fast. Stable-Baselines3 wants 36 pixels.
SMALL = {"camera_size": (64, 48), "num_points": 256}
STEPS = 200


def make(
    env_id: str, obs_mode: str, control: Sequence[str] = ("hand", "delta_pose"), **arguments: Any
) -> gymnasium.Env:
    """An environment with small observations."""
    robot, control_mode = control
    return gymnasium.make(
        env_id,
        obs_mode=obs_mode,
        robot=robot,
        control_mode=control_mode,
        **{**SMALL, **arguments},
    )


def random_action(env: gymnasium.Env, rng: np.random.Generator) -> np.ndarray:
    """Any action."""
    return rng.uniform(-1, 1, env.action_space.shape).astype(np.float32)


def digest(env: gymnasium.Env, seed: int, steps: int = STEPS) -> str:
    """Digest of everything an environment gives in random steps after one seeded reset."""
    rng = np.random.default_rng(seed)
    return rollout(env, seed, steps, lambda _: random_action(env, rng)).digests[-1]


if __name__ == "__main__":
    asked = json.loads(sys.argv[1])
    print(json.dumps([digest(make(*case), 7) for case in asked]))
