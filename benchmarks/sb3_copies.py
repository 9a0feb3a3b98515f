"""Our vector environments as Stable-Baselines3 takes them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from artgym.envs.vector import ArticulatedVectorEnv


class Sb3Copies(VecEnv):
    """Copies of an environment, stepped together in a few processes.

    An episode that ends in success counts as cut off, not as over: what would have followed is as
    good, and a learner that takes it for nothing keeps from succeeding.

    Args:
        env_id: of the environment.
        count: copies.
        workers: processes; 0 steps them in this one.
        repeat: control steps for which an action is kept up.
        seed: of the first reset.
        made_with: arguments of the copies.
    """

    def __init__(
        self,
        env_id: str,
        count: int,
        workers: int,
        *,
        repeat: int = 1,
        seed: int = 0,
        **made_with: Any,
    ) -> None:
        self._envs = cast(
            ArticulatedVectorEnv,
            gymnasium.make_vec(
                env_id,
                num_envs=count,
                workers=workers,
                autoreset_mode=AutoresetMode.SAME_STEP,
                **made_with,
            ),
        )
        self._repeat = repeat
        self._first_seed: int | None = seed
        self._answer: tuple[Any, ...] = ()
        self._action: Any = None
        super().__init__(count, self._envs.single_observation_space, self._envs.single_action_space)

    def reset(self) -> Any:
        """First observations of all copies; later resets go on from the first one's seed."""
        observations, _ = self._envs.reset(seed=self._first_seed)
        self._first_seed = None
        return observations

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Keeps the actions for ``step_wait``."""
        self._action = actions

    def step_wait(self) -> tuple[Any, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Steps all copies; the infos hold what an episode's end was like, and nothing else."""
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        total = np.zeros(self.num_envs, dtype=np.float32)
        over = np.zeros(self.num_envs, dtype=np.bool_)
        for _ in range(self._repeat):
            # A new episode does not begin with the end of an old action.
            actions = np.where(over[:, None], np.float32(0.0), self._action)
            observations, rewards, terminated, truncated, info = self._envs.step(actions)
            total += np.where(over, 0.0, rewards)
            ended = (terminated | truncated) & ~over
            for i in np.flatnonzero(ended):
                infos[i] = {
                    **info["final_info"][i],
                    "terminal_observation": info["final_obs"][i],
                    "TimeLimit.truncated": True,
                }
            over |= ended
        return observations, total, over, infos

    def close(self) -> None:
        """Ends the workers."""
        self._envs.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of every copy."""
        if attr_name == "render_mode":
            return [self._envs.render_mode] * self.num_envs
        return list(self._envs.call(attr_name))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Refused: copies are what they were made with."""
        raise AttributeError(f"{attr_name}: make new environments with the arguments you want.")

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """What a method of every copy gives."""
        return list(self._envs.call(method_name, *method_args))

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> Sequence[bool]:
        """Never."""
        return [False] * self.num_envs
