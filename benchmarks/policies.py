"""The policies that are compared, by name, and what a policy of your own must offer."""

from __future__ import annotations

import functools
import importlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, cast, get_args

import gymnasium
import numpy as np
from numpy.typing import NDArray

from artgym.envs.articulated_env import ArticulatedEnv
from artgym.envs.observations import ObsMode
from artgym.errors import InvalidArgumentError, MissingDependencyError, UnknownNameError
from artgym.experts.scripted import ScriptedExpert
from icaf4_policy.shipped import weights_path


class Policy(Protocol):
    """What is scored: ``--policy module:Class``, a class made without arguments.

    A class attribute ``obs_mode`` ("state", "rgbd" or "pointcloud") chooses what it is given;
    without one it is given "rgbd".
    """

    def reset(self, seed: int) -> None:
        """Starts an episode; nothing of the last one may remain."""

    def act(self, observation: Any) -> NDArray[np.float32]:
        """The action (7,) for an observation of ``ArtOpen-v0``."""
        ...


@dataclass(frozen=True, kw_only=True)
class PolicyEntry:
    """How a policy is made and what it sees.

    Attributes:
        obs_mode: of the environment it acts in.
        make: gives the policy for an environment, a category and a folder with weights (None for
            the shipped ones).
        perceives: whether it needs the trained network.
    """

    obs_mode: ObsMode
    make: Callable[[gymnasium.Env[Any, Any], str, Path | None], Policy]
    perceives: bool = False


class ZeroPolicy:
    """Does nothing: the floor."""

    def reset(self, seed: int) -> None:
        """Nothing to forget."""

    def act(self, observation: Any) -> NDArray[np.float32]:
        """Zeros."""
        return np.zeros(7, dtype=np.float32)


class RandomPolicy:
    """Draws every action evenly from the action space."""

    def reset(self, seed: int) -> None:
        """Starts the stream of an episode."""
        self._rng = np.random.default_rng(seed)

    def act(self, observation: Any) -> NDArray[np.float32]:
        """Seven numbers in [-1, 1]."""
        return self._rng.uniform(-1.0, 1.0, 7).astype(np.float32)


def _zero(env: gymnasium.Env[Any, Any], category: str, weights: Path | None) -> Policy:
    return ZeroPolicy()


def _random(env: gymnasium.Env[Any, Any], category: str, weights: Path | None) -> Policy:
    return RandomPolicy()


def _surface_normal(env: gymnasium.Env[Any, Any], category: str, weights: Path | None) -> Policy:
    from icaf4_policy.policy import SurfaceNormalPolicy

    return SurfaceNormalPolicy(load_perception(category, weights))


def _icaf4(env: gymnasium.Env[Any, Any], category: str, weights: Path | None) -> Policy:
    from icaf4_policy.policy import Icaf4Policy

    return Icaf4Policy(load_perception(category, weights))


def _expert(env: gymnasium.Env[Any, Any], category: str, weights: Path | None) -> Policy:
    return ScriptedExpert(cast(ArticulatedEnv, env.unwrapped))


#: In the order of the tables.
POLICIES: dict[str, PolicyEntry] = {
    "zero": PolicyEntry(obs_mode="state", make=_zero),
    "random": PolicyEntry(obs_mode="state", make=_random),
    "surface_normal": PolicyEntry(obs_mode="rgbd", make=_surface_normal, perceives=True),
    "icaf4": PolicyEntry(obs_mode="rgbd", make=_icaf4, perceives=True),
    "expert": PolicyEntry(obs_mode="state", make=_expert),
}


@functools.lru_cache(maxsize=4)
def load_perception(category: str, weights: Path | None) -> Any:
    """The trained network of a category, loaded once a process.

    Raises:
        DamagedFileError: the weights are missing or damaged.
        MissingDependencyError: torch or safetensors is not installed.
    """
    try:
        from icaf4_policy.inference import Perception
    except ModuleNotFoundError as error:
        raise MissingDependencyError(
            f"the network needs {error.name}: pip install 'artgym[train]'"
        ) from error
    return Perception.load(weights_path(category, weights), category)


def policy_entry(name: str) -> PolicyEntry:
    """The entry of a name of ``POLICIES`` or of a "module:Class".

    Raises:
        UnknownNameError: no such policy; names the nearest.
        InvalidArgumentError: the module or the class cannot be had.
    """
    if name in POLICIES:
        return POLICIES[name]
    if ":" not in name:
        raise UnknownNameError("policy", name, POLICIES)
    policy_class = _imported_class(name)
    obs_mode = getattr(policy_class, "obs_mode", "rgbd")
    if obs_mode not in get_args(ObsMode):
        raise UnknownNameError(f"obs_mode of policy {name}", obs_mode, get_args(ObsMode))
    return PolicyEntry(
        obs_mode=cast(ObsMode, obs_mode), make=lambda env, category, weights: _instance(name)
    )


@functools.lru_cache(maxsize=4)
def _instance(name: str) -> Policy:
    """The one policy of a process: making it may mean loading a network."""
    return _imported_class(name)()


def _imported_class(name: str) -> Callable[[], Policy]:
    module, _, class_name = name.partition(":")
    try:
        policy_class = getattr(importlib.import_module(module), class_name)
    except (ImportError, ValueError, TypeError, AttributeError) as error:
        raise InvalidArgumentError(
            f"policy={name!r} cannot be imported ({error}): expected 'module:Class', the module "
            "installed or in the folder where the command is given."
        ) from error
    for method in ("reset", "act"):
        if not callable(getattr(policy_class, method, None)):
            raise InvalidArgumentError(
                f"policy={name!r} has no method {method}(): expected reset(seed) and "
                "act(observation)."
            )
    return policy_class
