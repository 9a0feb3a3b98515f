"""What do the environments make of everything that a caller can do wrong, and do they leak?

Short episodes of odd arguments, options, actions and call orders, and of starts in penetration:
nothing non-finite may come out, every misuse must raise an ``ArtgymError`` and nothing else may
raise. And the memory that resets take. Run ``python -m benchmarks.fuzz --help``.
"""

from __future__ import annotations

import contextlib
import faulthandler
import functools
import gc
import json
import math
import os
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import load_env_creator
from numpy.typing import NDArray
from rich.table import Table

import artgym  # noqa: F401  registers the environments
from artgym.envs.articulated_env import RANDOMISED, ArticulatedEnv
from artgym.envs.observations import IMAGE_MODES
from artgym.envs.scene_env import ArtSceneEnv
from artgym.errors import ArtgymError, InvalidArgumentError, RendererUnavailableError
from artgym.geometry import transforms
from artgym.geometry.camera import look_at
from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.objects import catalog
from artgym.registration import environment_ids
from artgym.sim.conversion import pose_from_transform
from artgym.sim.renderer import find_device
from artgym.sim.scene import PlacedObject
from benchmarks import record
from benchmarks.command import run
from benchmarks.determinism import in_a_fresh_process
from benchmarks.parallel import results_in_order

Array = NDArray[np.floating]
Rng = np.random.Generator

NAN, INF = math.nan, math.inf

#: Episodes that one process runs, and seconds after which one of them counts as hanging.
_CHUNK, _PATIENCE = 200, 120.0
#: Violations that are kept whole, and calls before one that are kept with it.
_MOST_KEPT, _CALLS_KEPT = 200, 12
#: Observations of fuzz episodes are small: they are many.
_SMALL = {"camera_size": (48, 36), "num_points": 64}
_FLOATING = {"robot": "hand", "control_mode": "delta_pose"}
#: Observation modes and how often they come.
_MODES = {"state": 0.35, "state_dict": 0.25, "pointcloud": 0.25, "rgb": 0.075, "rgbd": 0.075}

#: What a reset says of an object whose part no arm can carry.
_OUT_OF_REACH = "out of an arm's reach"

#: Variables of the processes whose memory is measured.
ONE_HEAP: Mapping[str, str] = {"MALLOC_ARENA_MAX": "1"}
#: What a reset of the same object, and one to another, may add to memory in the long run, bytes.
RESET_BYTES, SWAP_BYTES = 512.0, 5120.0
#: Objects among which swaps go round: more than any cache keeps. Twice round, unmeasured, fills
#: caches and makes the allocator's pools as large as they get.
_ROUND = 320
_WARM_UP = 2 * _ROUND
_SAMPLES = 100
#: What is counted of the calls of fuzz episodes.
_COUNTED = ("valid", "misuse", "steps", "unstable", "out_of_reach")


@dataclass(frozen=True, kw_only=True)
class FuzzConfig:
    """What do the environments make of everything that a caller can do wrong, and do they leak?

    Attributes:
        episodes: of misuse.
        first: number of the first; an episode is determined by ``seed`` and its number.
        resets: of the same object, for the memory they take; 0 leaves them out.
        swaps: resets to another object, for the same; 0 leaves them out.
        memory_mode: modes of observation in which memory is measured; those that need a renderer
            are left out where there is none.
        seed: of everything random.
        workers: processes; what is found does not depend on it.
        out: folder for fuzz.json.
    """

    episodes: int = 10_000
    first: int = 0
    resets: int = 10_000
    swaps: int = 1_000
    memory_mode: tuple[str, ...] = ("state", "pointcloud", "rgbd")
    seed: int = 0
    workers: int = 2
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        for name in ("episodes", "first", "resets", "swaps", "seed"):
            if getattr(self, name) < 0:
                raise InvalidArgumentError(f"{name}={getattr(self, name)}: expected 0 or more.")
        for mode in self.memory_mode:
            if mode not in _MODES:
                raise InvalidArgumentError(f"memory_mode={mode!r}: expected {', '.join(_MODES)}.")


# --- What is tried -------------------------------------------------------------------------------


def _looking(eye: Sequence[float], target: Sequence[float]) -> Array:
    return look_at(np.array(eye, dtype=float), np.array(target, dtype=float))


_POSE = _looking((1.0, 0.2, 0.8), (0.0, 0.0, 0.1))
_MIRRORED = _POSE @ np.diag([-1.0, 1.0, 1.0, 1.0])

#: Values that an environment must refuse to be made with, one at a time.
WRONG_ARGUMENTS: Mapping[str, tuple[Any, ...]] = {
    "categories": (
        "labtop", ("laptop", "labtop"), 5, 3.5, (5,), ([],), (None,), ("",), (), b"laptop",
        ("train",), True,
    ),
    "split": ("training", "train ", "", 5, None, [], ["train"], True, ("train",)),
    "objects": (
        5, (5,), ([],), (None,), (), "laptop/9999", ("laptop/0001", "laptop"), "import/missing",
        "import/../x", "/", "laptop/-001", "laptop/00001", "laptop/\N{VULGAR FRACTION ONE HALF}",
        b"laptop/0001", {"laptop/0001": 1, 5: 2},
    ),
    "target_part": (0, -1, 99, 1.0, NAN, "1", None, True, [1], 10**30, np.array([1, 2])),
    "robot": ("pandas", "Hand", 5, None, [], np.array(["hand", "panda"]), ("hand",)),
    "control_mode": ("pose", 5, None, [], np.array(["delta_pose"] * 2)),
    "obs_mode": ("points", b"state", 5, None, [], {}, ("state",), np.array(["state", "rgb"])),
    "camera_size": (
        (0, 100), (10_000, 100), (-64, 48), "small", "64", ("64", "48"), 64, (64,), (64, 48, 3),
        (NAN, 48), (INF, 48), (64.5, 48), (True, 48), [[64, 48]], None, {}, (None, None),
    ),
    "num_points": (0, -1, 10.5, 64.0, NAN, INF, "64", None, True, [64], 10**9, 10**400),
    "num_cameras": (0, 17, 1.0, "1", None, True, [2]),
    "camera_poses": (
        "front", 5, [], [np.eye(3)], 2 * np.eye(4), np.zeros((4, 4)), np.full((4, 4), NAN),
        _MIRRORED, 1j * np.eye(4), [np.eye(4), None], transforms.translation([50.0, 0.0, 1.0]),
        [_POSE] * 20, {}, np.eye(4).astype(str),
    ),
    "segmentation": ("no", 2, None, [], np.array([1, 0])),
    "reward_mode": ("dens", 5, None, [], ("dense",)),
    "randomised": (("light",), "lights ", 5, None, ([],), (5,), {"table", "lamp"}, True),
    "horizon": (0, -5, 1.5, 300.0, NAN, INF, "300", None, True, 10**9, [300]),
    "render_mode": ("human", "rgb", 5, [], True, ("rgb_array",)),
    "num_objects": (
        (0, 3), (4, 2), (3, 99), 3, "many", "34", ("3", "4"), (2.5, 3.5), (NAN, 3), (INF, INF),
        (3,), (3, 4, 5), None, (True, 3),
    ),
    "object_ids": (("laptop/0001",),),
    "seed": (0,),
    "self_": (None,),
}  # fmt: skip

#: Arguments that are right by themselves and wrong together, at the latest at the first reset.
CONFLICTS: tuple[Mapping[str, Any], ...] = (
    {"categories": ("faucet",), "split": "train"},
    {"categories": ("laptop", "safe"), "split": "val"},
    {"categories": ("laptop",), "target_part": 2},
    {"categories": ("drawer",), "target_part": 5},
    {"objects": ("laptop/0000", "drawer/0004"), "target_part": 4},
    {"objects": "laptop/0000", "target_part": 2},
    {"robot": "hand", "control_mode": "delta_joint"},
)

#: Odd values that an environment must take.
ODD_ARGUMENTS: Mapping[str, tuple[Any, ...]] = {
    "split": ("test",),
    "objects": (
        "drawer/0004", ["laptop/0012", "scissors/0003"], ("stapler/1599",), np.array(["box/0001"]),
    ),
    "target_part": (np.int64(1),),
    "robot": ("panda",),
    "camera_size": ((16, 16), [40, 30], (np.int64(48), 36), (33, 17), np.array([48, 36])),
    "num_points": (1, 7, 300, np.int32(64)),
    "num_cameras": (2, 3),
    "camera_poses": (
        _POSE,
        _POSE.tolist(),
        [_POSE, _looking((0.8, -0.5, 0.5), (0.0, 0.0, 0.1))],
        # Away from everything; from below the table; from within the object.
        _looking((2.0, 0.0, 1.0), (4.0, 0.0, 3.0)),
        _looking((0.3, 0.0, -0.5), (0.0, 0.0, 0.1)),
        _looking((0.0, 0.0, 0.05), (1.0, 0.0, 0.2)),
    ),
    "segmentation": (True,),
    "reward_mode": ("sparse",),
    "randomised": ((), ["table"], "lights", RANDOMISED, frozenset({"hand"})),
    "horizon": (1, 3, np.int64(5), 1_000_000),
}  # fmt: skip

WRONG_SEEDS: tuple[Any, ...] = (-1, 1.5, NAN, "0", [1], True, np.array([1, 2]), 1j, b"")
ODD_SEEDS: tuple[Any, ...] = (None, 0, 2**31, 10**30, np.int64(3), np.uint8(4))

WRONG_OPTIONS: tuple[Any, ...] = (
    5, "open", b"", [], ["open_fraction"], [("open_fraction", 0.5)], True, 0.0,
    {"object": "laptop/0005"}, {5: 1}, {None: None}, {("a",): 1},
    *({"object_id": v} for v in ("laptop/5", "laptop", "", 5, [], {}, b"laptop/0005", True, ())),
    *(
        {"open_fraction": v}
        for v in (
            1.5, -1e-9, NAN, INF, -INF, 10**400, "half", "0.5", b"0.5", [], [0.5], (0.5,), {}, 1j,
            np.array([0.1, 0.2]), np.array(["a"]), True,
        )
    ),
)  # fmt: skip
ODD_OPTIONS: tuple[Any, ...] = (
    None, {}, {"object_id": None, "open_fraction": None}, {"open_fraction": 0},
    *({"open_fraction": v} for v in (0.0, 1.0, 1e-12, 1.0 - 1e-12, np.float32(0.5), np.int64(1))),
    {"object_id": "laptop/0005"}, {"object_id": "scissors/1300", "open_fraction": 1.0},
    {"object_id": np.str_("box/0007"), "open_fraction": 0.0},
)  # fmt: skip


def _with(value: float, at: int = 3) -> list[float]:
    return [value if i == at else 0.0 for i in range(7)]


WRONG_ACTIONS: tuple[Any, ...] = (
    _with(NAN), _with(INF), _with(-INF), np.full(7, np.nan, np.float32), _with(10**400),
    np.zeros(6), np.zeros(8), np.zeros((1, 7)), np.zeros((7, 1)), np.zeros(0), np.float32(0),
    0, None, True, [10**30] * 7, "open it", b"1234567", "1234567", ["0"] * 7, np.array(["0"] * 7),
    [None] * 7, [[1, 2], [3]], {}, {i: 0.0 for i in range(7)}, set(range(7)), 1j * np.ones(7),
    [1j] * 7, object(), [object()] * 7, lambda: 0, np.array([{}] * 7), np.zeros(7, "datetime64[s]"),
    (x for x in range(7)), np.ma.masked_all(7).astype(object), np.zeros(7, [("a", float)]),
)  # fmt: skip
ODD_ACTIONS: tuple[Any, ...] = (
    np.zeros(7, np.float32), np.ones(7, np.float32), -np.ones(7, np.float32), [0] * 7, (0.5,) * 7,
    np.full(7, 1e30), np.full(7, -1e300), np.full(7, 5e-324), np.full(7, -0.0), np.ones(7, int),
    np.ones(7, np.float16), np.ones(7, np.longdouble), np.ones(14)[::2], range(-3, 4),
    np.full(7, 3.0e38, np.float32), np.arange(7, dtype=np.uint8), 
    np.broadcast_to(np.float32(1.0), (7,)),
)  # fmt: skip

#: What copies must not be made with, and not be given to do.
WRONG_COPIES: Mapping[str, tuple[Any, ...]] = {
    "num_envs": (0, -1, 1.5, "2", 10**6, True),
    "workers": (-1, 1.5, None, "1", 10**6),
    "patience": (0, -1.0, NAN, INF, "1", None),
    "autoreset_mode": ("never", 5, None, [], "Disabled"),
    "max_episode_steps": (0, 1.5, "7"),
    "obs_mode": ("points", []),
}
WRONG_BATCHES: tuple[Any, ...] = (
    None, 5, "ab", [], np.zeros(7), np.zeros((3, 7)), np.zeros((2, 6)), np.full((2, 7), NAN),
    [np.zeros(7), None], {0: 1, 1: 2}, np.zeros((2, 7), complex), [[0.0] * 7, [INF] * 7],
)  # fmt: skip

#: Calls that need a running episode.
_NEED_AN_EPISODE: Mapping[str, Callable[[ArticulatedEnv], Any]] = {
    "step": lambda env: _idle(env),
    "get_state": lambda env: env.get_state(),
    "object": lambda env: env.object,
    "T_world_object": lambda env: env.T_world_object,
    "progress": lambda env: env.progress,
    "view": lambda env: env.view,
    "joint_positions": lambda env: env.joint_positions(),
    "arm_positions": lambda env: env.arm_positions(),
    "T_world_base": lambda env: env.T_world_base,
    "tcp_pose": lambda env: env.tcp_pose(),
    "jaw_width": lambda env: env.jaw_width(),
}


class TouchingEnv(ArtSceneEnv):
    """Several objects that stand in one another."""

    def _surroundings(self, target: PlacedObject, rng: Rng) -> Sequence[PlacedObject]:
        others = []
        for _ in range(int(rng.integers(1, 4))):
            obj = self._draw_object(rng)
            T = transforms.translation([*rng.uniform(-0.15, 0.15, 2), rng.uniform(-0.05, 0.1)])
            T[:3, :3] = matrix_from_axis_angle(rng.normal(0.0, 0.5, 3))
            q = np.array([j.position(rng.uniform()) for j in obj.joints])
            others.append(PlacedObject(model=obj, T_world_object=T, q=q))
        return others


# --- One episode ---------------------------------------------------------------------------------


def faults(
    space: spaces.Space[Any], observation: Any, info: Mapping[str, Any]
) -> list[tuple[str, str]]:
    """What is wrong with an observation and an info, each with the values that show it."""
    found: list[tuple[str, str]] = []
    named = space.spaces if isinstance(space, spaces.Dict) else {"observation": space}
    values = observation if isinstance(observation, dict) else {"observation": observation}
    if set(named) != set(values):
        found.append(("other fields than the space", f"{sorted(values)}, {sorted(named)}"))
    for name in set(named) & set(values):
        value = np.asarray(values[name])
        if not np.all(np.isfinite(value)):
            found.append((f"{name} is not finite", _short(value)))
        elif value.dtype != named[name].dtype or not named[name].contains(values[name]):
            worst = value.flat[np.argmax(np.abs(value.astype(float)))] if value.size else None
            shown = f"{value.dtype} {value.shape}, largest {worst}, in {named[name]}"
            found.append((f"{name} is not in its space", shown))
    found += [(f"info[{key}] is not finite", repr(value)) for key, value in _not_finite(info)]
    for key in ("travel", "engaged", "gripped"):
        if not 0.0 <= info[key] <= (INF if key == "travel" else 1.0):
            found.append((f"info[{key}] is out of range", repr(info[key])))
    return found


def _not_finite(info: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    found = []
    for key, value in info.items():
        if isinstance(value, Mapping):
            found += _not_finite(value, f"{prefix}{key}.")
        elif not isinstance(value, str) and not math.isfinite(value):
            found.append((f"{prefix}{key}", value))
    return found


@dataclass(kw_only=True)
class Episode:
    """Calls of one fuzz episode, and what came of them.

    Attributes:
        number: of the episode.
        rng: of everything in it.
        calls: made so far, as text.
        violations: what should not have come of them.
        counts: of calls by what was expected, of steps and of blow-ups.
    """

    number: int
    rng: Rng
    calls: list[str] = field(default_factory=list)
    violations: list[dict[str, Any]] = field(default_factory=list)
    counts: Counter[str] = field(default_factory=Counter)

    def choice(self, values: Sequence[Any]) -> Any:
        """One of the values."""
        return values[int(self.rng.integers(len(values)))]

    def valid(self, what: str, call: Callable[[], Any]) -> Any:
        """A call that must not raise; what it gives, None if it did."""
        self.counts["valid"] += 1
        self.calls.append(what)
        try:
            return call()
        except InvalidArgumentError as error:
            # What an arm can carry is known only when it is tried.
            if _OUT_OF_REACH in str(error):
                self.counts["out_of_reach"] += 1
            else:
                self.violate(f"valid use raised {_named(error)}", error=error)
            return None
        except Exception as error:
            self.violate(f"valid use raised {_named(error)}", error=error)
            return None

    def misuse(self, what: str, call: Callable[[], Any]) -> None:
        """A call that must raise an ``ArtgymError``."""
        self.counts["misuse"] += 1
        self.calls.append(f"wrong: {what}")
        try:
            call()
        except ArtgymError:
            return
        except Exception as error:
            self.violate(f"misuse raised {_named(error)}", error=error)
        else:
            self.violate("misuse was accepted")

    def violate(
        self, problem: str, detail: str = "", *, error: BaseException | None = None
    ) -> None:
        """Takes down what should not be, with the calls that led there."""
        lines = traceback.format_exception(error) if error is not None else []
        self.violations.append(
            {
                "episode": self.number,
                "problem": problem,
                "detail": detail,
                "calls": self.calls[-_CALLS_KEPT:],
                "traceback": "".join(lines)[-1500:],
            }
        )

    def reset(self, env: ArticulatedEnv, seed: Any = None, options: Any = None) -> bool:
        """A valid reset; whether it worked."""
        found = self.valid(
            f"reset(seed={_short(seed)}, options={_short(options)})",
            lambda: env.reset(seed=seed, options=options),
        )
        if found is None:
            return False
        for fault, detail in faults(env.observation_space, *found):
            self.violate(f"reset: {fault}", detail)
        return True

    def step(self, env: ArticulatedEnv, action: Any) -> bool:
        """A valid step; whether the episode goes on."""
        found = self.valid(f"step({_short(action)})", lambda: env.step(action))
        if found is None:
            return False
        self.counts["steps"] += 1
        observation, reward, terminated, truncated, info = found
        for fault, detail in faults(env.observation_space, observation, info):
            self.violate(f"step: {fault}", detail)
        if type(reward) is not float or not 0.0 <= reward <= 1.0:
            self.violate("step: reward is no float in [0, 1]", repr(reward))
        if type(terminated) is not bool or type(truncated) is not bool:
            self.violate("step: an end is no bool", f"{terminated!r}, {truncated!r}")
        if info["unstable"]:
            self.counts["unstable"] += 1
            if not truncated or reward != 0.0:
                self.violate("blow-up without its end", f"{reward!r}, {truncated!r}")
        return not (terminated or truncated)


def _named(error: BaseException) -> str:
    return f"{type(error).__name__}: {str(error)[:150]}"


def _short(value: Any) -> str:
    text = " ".join(repr(value).split())
    return text if len(text) <= 150 else text[:147] + "..."


# --- Kinds of episodes ---------------------------------------------------------------------------


def _entry_of(env_id: str) -> tuple[type[ArticulatedEnv], dict[str, Any]]:
    """An environment's class, without the wrappers of ``gymnasium.make``, and its arguments."""
    spec = gymnasium.spec(env_id)
    assert isinstance(spec.entry_point, str)
    env_class: Any = load_env_creator(spec.entry_point)
    return env_class, dict(spec.kwargs)


@functools.cache
def _has_renderer() -> bool:
    try:
        find_device()
    except RendererUnavailableError:
        return False
    return True


def _arguments(episode: Episode, env_id: str) -> dict[str, Any]:
    """Arguments that must do, some of them odd."""
    rng = episode.rng
    mode = str(rng.choice(list(_MODES), p=list(_MODES.values())))
    is_seen = rng.random() < 0.05
    found: dict[str, Any] = {**_entry_of(env_id)[1], **_SMALL, "obs_mode": mode}
    if mode in IMAGE_MODES and not _has_renderer():
        found["obs_mode"] = "pointcloud"
    if is_seen and _has_renderer():
        found["render_mode"] = "rgb_array"
    for _ in range(int(rng.integers(4))):
        name = episode.choice(tuple(ODD_ARGUMENTS))
        found[name] = episode.choice(ODD_ARGUMENTS[name])
    if found.get("robot") == "panda" and rng.random() < 0.5:
        found["control_mode"] = "delta_joint"
    return found


def _made(
    episode: Episode, env_class: type[ArticulatedEnv], arguments: Mapping[str, Any]
) -> ArticulatedEnv | None:
    """An environment made with arguments that must do."""
    return episode.valid(
        f"{env_class.__name__}(**{_short_arguments(arguments)})", lambda: env_class(**arguments)
    )


def _short_arguments(arguments: Mapping[str, Any]) -> str:
    return "{" + ", ".join(f"{n!r}: {_short(v)}" for n, v in arguments.items()) + "}"


def _good_action(episode: Episode, env: ArticulatedEnv) -> Any:
    action = episode.choice(ODD_ACTIONS)
    shape = env.action_space.shape
    assert shape is not None
    if episode.rng.random() < 0.7 or np.shape(action) != shape:
        return episode.rng.uniform(-1.0, 1.0, shape).astype(np.float32)
    return action


def _play(episode: Episode, env: ArticulatedEnv, steps: int, mistakes: float) -> None:
    """Steps, with wrong actions and wrong resets in between; goes on after an episode's end."""
    for _ in range(steps):
        if episode.rng.random() < mistakes:
            if episode.rng.random() < 0.7:
                _wrong_action(episode, env)
            else:
                _wrong_reset(episode, env)
        if not episode.step(env, _good_action(episode, env)):
            episode.misuse("step after the end", lambda: _idle(env))
            if not episode.reset(env):
                return


def _idle(env: ArticulatedEnv) -> Any:
    return env.step(np.zeros(env.action_space.shape or (), np.float32))


def _wrong_action(episode: Episode, env: ArticulatedEnv) -> None:
    action: Any = episode.choice(WRONG_ACTIONS)
    if isinstance(action, np.ndarray) and action.shape == env.action_space.shape == (8,):
        action = np.zeros(7)
    episode.misuse(f"step({_short(action)})", lambda: env.step(action))


def _wrong_reset(episode: Episode, env: ArticulatedEnv) -> None:
    if episode.rng.random() < 0.3:
        seed = episode.choice(WRONG_SEEDS)
        episode.misuse(f"reset(seed={_short(seed)})", lambda: env.reset(seed=seed))
    else:
        options = episode.choice(WRONG_OPTIONS)
        episode.misuse(f"reset(options={_short(options)})", lambda: env.reset(options=options))


def wrong_arguments(episode: Episode, env_id: str) -> None:
    """Environments that must not be made."""
    env_class, made_with = _entry_of(env_id)
    for _ in range(3):
        name = episode.choice(tuple(WRONG_ARGUMENTS))
        value = episode.choice(WRONG_ARGUMENTS[name])
        wrong = made_with | {name: value}
        what = f"{env_class.__name__}(**{_short_arguments(wrong)})"
        episode.misuse(what, lambda wrong=wrong: env_class(**wrong))
    conflict = made_with | dict(episode.choice(CONFLICTS))
    episode.misuse(
        f"{env_class.__name__}(**{_short_arguments(conflict)}).reset()",
        lambda: env_class(**conflict).reset(seed=0),
    )


def wrong_steps(episode: Episode, env_id: str) -> None:
    """Odd arguments, seeds, options and actions, right and wrong ones mixed."""
    env = _made(episode, _entry_of(env_id)[0], _arguments(episode, env_id))
    if env is None:
        return
    is_running = False
    for _ in range(2):
        if episode.reset(env, episode.choice(ODD_SEEDS), episode.choice(ODD_OPTIONS)):
            is_running = True
            _play(episode, env, int(episode.rng.integers(3, 12)), mistakes=0.4)
    if env.render_mode is None:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            if episode.valid("render() without a mode", lambda: (env.render(),)) != (None,):
                episode.violate("render() without a mode gives something")
    elif is_running and not env._blown_up:
        picture = episode.valid("render()", env.render)
        if picture is not None and (picture.shape, picture.dtype) != ((360, 480, 3), np.uint8):
            episode.violate("render() gives no picture", f"{picture.dtype} {picture.shape}")
    episode.valid("close()", env.close)


def wrong_order(episode: Episode, env_id: str) -> None:
    """Calls before the reset, after the end, after closing, and states of other environments."""
    env_class = _entry_of(env_id)[0]
    arguments = _arguments(episode, env_id)
    env, twin = (_made(episode, env_class, arguments) for _ in range(2))
    stranger = _made(episode, env_class, arguments | {"horizon": 77})
    if env is None or twin is None or stranger is None:
        return
    calls = dict(_NEED_AN_EPISODE)
    if env.render_mode is not None:
        calls["render"] = lambda env: env.render()
    name = episode.choice(tuple(calls))
    episode.misuse(f"{name} before reset", lambda: calls[name](env))
    if not episode.reset(env, int(episode.rng.integers(100))):
        return
    goes_on = True
    for _ in range(int(episode.rng.integers(8))):
        goes_on = goes_on and episode.step(env, _good_action(episode, env))
    wrong = episode.choice((None, "state", 5, {}, env, object()))
    episode.misuse(f"set_state({_short(wrong)})", lambda: env.set_state(wrong))
    state: Any = None
    if not env._blown_up:
        state = episode.valid("get_state()", env.get_state)
        episode.misuse("set_state of another's", lambda: stranger.set_state(state))
        for each in (twin, env):
            found = episode.valid("set_state()", lambda each=each: each.set_state(state))
            if found is None:
                continue
            for fault, detail in faults(env.observation_space, *found):
                episode.violate(f"set_state: {fault}", detail)
            if goes_on:
                episode.step(each, _good_action(episode, each))
            else:
                episode.misuse("step after the end", lambda each=each: _idle(each))
    for each in (env, twin, stranger):
        episode.valid("close()", each.close)
        episode.valid("close()", each.close)
    calls |= {
        "reset": lambda env: env.reset(seed=0),
        "set_state": lambda env: env.set_state(state),
    }
    for name in calls:
        episode.misuse(f"{name} after close", lambda name=name: calls[name](env))


def in_penetration(episode: Episode, env_id: str) -> None:
    """The hand begins within the object, the table or nowhere near."""
    rng = episode.rng
    arguments = _arguments(episode, env_id) | _FLOATING
    env = _made(episode, _entry_of(env_id)[0], arguments)
    if env is None:
        return
    for _ in range(2):
        fraction = episode.choice((None, 0.0, 1.0, float(rng.uniform())))
        if not episode.reset(env, int(rng.integers(2**31)), {"open_fraction": fraction}):
            break
        _put_hand_within(episode, env)
        _play(episode, env, int(rng.integers(5, 20)), mistakes=0.0)
    episode.valid("close()", env.close)


def _put_hand_within(episode: Episode, env: ArticulatedEnv) -> None:
    rng, scene = episode.rng, env._scene
    assert scene is not None
    assert scene.hand is not None
    part = int(rng.integers(env.object.num_parts))
    middle = env.object.links[part].bounds().mean(axis=0)
    place = transforms.apply(scene.body.link_poses()[part], middle[None])[0]
    place = place + rng.normal(0.0, episode.choice((0.0, 0.02, 0.1)), 3)
    T = transforms.transform_from(matrix_from_axis_angle(rng.normal(0.0, 2.0, 3)), place)
    width = float(rng.uniform(0.0, 0.08))
    episode.calls.append(f"hand put at {_short(T.tolist())} with jaws {width:.3f} m open")
    pose = pose_from_transform(T)
    articulation = scene.hand.links[0].articulation
    articulation.root_pose = pose
    articulation.qpos = np.full(2, 0.5 * width)
    scene.hand.pull_to(pose)
    # As if the episode had begun so.
    env._look()


def touching_objects(episode: Episode, env_id: str) -> None:
    """Objects that stand in one another."""
    del env_id
    arguments = _arguments(episode, "ArtScene-v0") | _FLOATING
    env = _made(episode, TouchingEnv, arguments)
    if env is None:
        return
    if episode.reset(env, int(episode.rng.integers(2**31))):
        _play(episode, env, int(episode.rng.integers(10, 30)), mistakes=0.0)
    episode.valid("close()", env.close)


def wrong_copies(episode: Episode, env_id: str) -> None:
    """Copies stepped together, wrongly and rightly."""
    made_with = _SMALL | {"obs_mode": episode.choice(("state", "state_dict", "pointcloud"))}

    def made(**options: Any) -> Any:
        return gymnasium.make_vec(env_id, **{"num_envs": 2, **made_with, **options})

    name = episode.choice(tuple(WRONG_COPIES))
    value = episode.choice(WRONG_COPIES[name])
    episode.misuse(f"make_vec({name}={_short(value)})", lambda: made(**{name: value}))
    envs = episode.valid("make_vec()", made)
    if envs is None:
        return
    good = episode.rng.uniform(-1.0, 1.0, (2, 7)).astype(np.float32)
    episode.misuse("step before reset", lambda: envs.step(good))
    found = episode.valid("reset()", lambda: envs.reset(seed=episode.choice((None, 3, [4, None]))))
    for _ in range(4 if found is not None else 0):
        actions = episode.choice(WRONG_BATCHES)
        episode.misuse(f"step({_short(actions)})", lambda actions=actions: envs.step(actions))
        found = episode.valid("step()", lambda: envs.step(good))
        if found is not None and not envs.observation_space.contains(found[0]):
            episode.violate("copies: observation not in its space")
    seed = episode.choice((*WRONG_SEEDS[:5], [1, 2, 3], [1, -1]))
    episode.misuse(f"reset(seed={_short(seed)})", lambda: envs.reset(seed=seed))
    episode.valid("close()", envs.close)
    episode.misuse("step after close", lambda: envs.step(good))


#: Kinds of episodes, and how often they come.
KINDS: Mapping[str, tuple[Callable[[Episode, str], None], float]] = {
    "arguments": (wrong_arguments, 0.2),
    "steps": (wrong_steps, 0.3),
    "copies": (wrong_copies, 0.05),
    "order": (wrong_order, 0.15),
    "penetration": (in_penetration, 0.2),
    "touching": (touching_objects, 0.1),
}


def fuzz_episode(seed: int, number: int) -> dict[str, Any]:
    """Runs an episode; what came of it."""
    episode = Episode(number=number, rng=np.random.default_rng([seed, number]))
    shares = [share for _, share in KINDS.values()]
    kind = str(episode.rng.choice(list(KINDS), p=shares))
    env_id = episode.choice(environment_ids())
    with warnings.catch_warnings():
        # Where numbers begin to be wrong numpy warns.
        warnings.simplefilter("error", RuntimeWarning)
        try:
            KINDS[kind][0](episode, env_id)
        except Exception as error:
            episode.violate(f"the benchmark itself raised {_named(error)}", error=error)
    return {
        "episode": number,
        "kind": kind,
        "env_id": env_id,
        "counts": dict(episode.counts),
        "violations": episode.violations,
    }


# --- Many episodes -------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Batch:
    """Episodes that one process runs, as long as it lives.

    Attributes:
        seed: of the benchmark.
        numbers: of the episodes.
        trail: file that gets a line of each that has ended.
    """

    seed: int
    numbers: tuple[int, ...]
    trail: str


def run_batch(batch: Batch) -> None:
    """Runs episodes and leaves a trail; a process that hangs ends itself."""
    with open(batch.trail, "a", encoding="utf-8") as trail:
        for number in batch.numbers:
            faulthandler.dump_traceback_later(_PATIENCE, exit=True)
            found = fuzz_episode(batch.seed, number)
            faulthandler.cancel_dump_traceback_later()
            print(json.dumps(found), file=trail, flush=True)


def surviving_episodes(
    seed: int, numbers: Sequence[int], run_them: Callable[[Batch], None] = run_batch
) -> list[dict[str, Any]]:
    """The episodes in processes of their own; one that takes its process down is a violation."""
    found: list[dict[str, Any]] = []
    remaining = list(numbers)
    while remaining:
        with tempfile.TemporaryDirectory() as folder:
            trail = Path(folder) / "trail"
            batch = Batch(seed=seed, numbers=tuple(remaining), trail=str(trail))
            with contextlib.suppress(BrokenProcessPool):
                in_a_fresh_process(run_them, batch)
            lines = trail.read_text(encoding="utf-8").splitlines() if trail.exists() else []
        found += [json.loads(line) for line in lines]
        remaining = remaining[len(lines) :]
        if remaining:
            found.append(_fatal(remaining.pop(0)))
    return found


def _fatal(number: int) -> dict[str, Any]:
    problem = f"the process died or hung for {_PATIENCE:.0f} s"
    episode = Episode(number=number, rng=np.random.default_rng(0))
    episode.violate(problem)
    return {
        "episode": number,
        "kind": "fatal",
        "env_id": "",
        "counts": {},
        "violations": episode.violations,
    }


def _survived(arguments: tuple[int, tuple[int, ...]]) -> list[dict[str, Any]]:
    return surviving_episodes(*arguments)


def fuzz(config: FuzzConfig) -> dict[str, Any]:
    """Runs all fuzz episodes: how many of what, and what should not have come of them."""
    numbers = range(config.first, config.first + config.episodes)
    chunks = [tuple(numbers[i : i + _CHUNK]) for i in range(0, len(numbers), _CHUNK)]
    batches = results_in_order(
        _survived,
        [(config.seed, chunk) for chunk in chunks],
        workers=config.workers,
        description="fuzz",
        unit="chunk",
    )
    episodes = [episode for batch in batches for episode in batch]
    violations = [v for episode in episodes for v in episode["violations"]]
    counts = sum((Counter(e["counts"]) for e in episodes), Counter())
    return {
        "episodes": len(episodes),
        "renderer": _has_renderer(),
        "kinds": dict(Counter(e["kind"] for e in episodes)),
        "environments": len({e["env_id"] for e in episodes}),
        "calls": {name: counts[name] for name in _COUNTED},
        "bad_episodes": sum(bool(e["violations"]) for e in episodes),
        "problems": dict(Counter(v["problem"] for v in violations).most_common()),
        "violations": violations[:_MOST_KEPT],
    }


# --- Memory --------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class MemoryTask:
    """Resets whose memory is measured.

    Attributes:
        obs_mode: of observation.
        kind: whether each is of the same object or goes on to the next.
        count: of resets.
        seed: of the first.
    """

    obs_mode: str
    kind: Literal["reset", "swap"]
    count: int
    seed: int

    def object_ids(self) -> list[str]:
        """What the resets go round."""
        if self.kind == "reset":
            return ["drawer/0004"]
        names = catalog.categories_with("train")
        each = -(-_ROUND // len(names))
        ids = [catalog.object_ids(name, "train", each) for name in names]
        # Neighbours are of different categories.
        return [i for several in zip(*ids, strict=True) for i in several][:_ROUND]


def memory_of(task: MemoryTask) -> dict[str, Any]:
    """Memory, open files and threads of this process over many resets, a step after each.

    As many resets come first, up to twice round all objects, which do not count.
    """
    env = gymnasium.make("ArtOpen-v0", obs_mode=task.obs_mode, **_SMALL)
    ids, action = task.object_ids(), np.zeros(7, np.float32)
    samples: list[list[int]] = []
    every = max(1, task.count // _SAMPLES)
    env.reset(seed=task.seed)
    for i in range(-min(_WARM_UP, task.count), task.count):
        if i == 0:
            began = time.perf_counter()
        env.reset(options={"object_id": ids[i % len(ids)]})
        env.step(action)
        if i >= 0 and (i + 1) % every == 0:
            gc.collect()
            samples.append([i + 1, *process_state()])
    seconds = time.perf_counter() - began
    env.close()
    return {
        "bytes_each": growth(samples),
        "target": RESET_BYTES if task.kind == "reset" else SWAP_BYTES,
        "files": _extremes(samples, 2),
        "threads": _extremes(samples, 3),
        "ms_each": round(1e3 * seconds / task.count, 3),
        "samples": samples,
    }


def process_state() -> tuple[int, int, int]:
    """Resident memory in bytes, open files and threads of this process.

    Raises:
        InvalidArgumentError: the system does not tell.
    """
    try:
        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
        # Less the one that lists them.
        files = len(os.listdir("/proc/self/fd")) - 1
        threads = len(os.listdir("/proc/self/task"))
    except OSError as error:
        raise InvalidArgumentError(
            f"memory is measured by /proc, which cannot be read here ({error}); "
            "give --resets 0 --swaps 0"
        ) from error
    return pages * os.sysconf("SC_PAGE_SIZE"), files, threads


def growth(samples: Sequence[Sequence[int]]) -> float:
    """Bytes a reset: slope of the line through the second half of samples (resets, bytes, ...).

    >>> growth([[1, 0], [2, 900], [3, 1000], [4, 1010], [5, 1020]])
    10.0
    """
    later = np.array(samples[len(samples) // 2 :], dtype=float)[:, :2]
    if len(later) < 2:
        return 0.0
    return round(float(np.polyfit(later[:, 0], later[:, 1], 1)[0]), 3)


def _extremes(samples: Sequence[Sequence[int]], column: int) -> list[int]:
    """Least and most in the second half."""
    later = [sample[column] for sample in samples[len(samples) // 2 :]]
    return [min(later), max(later)] if later else []


def _alone(task: MemoryTask) -> dict[str, Any]:
    # Threads of a software renderer free what others have allocated: which heap keeps how much of
    # it is chance, as large as what is looked for. With one heap there is none of it.
    os.environ.update(ONE_HEAP)
    return in_a_fresh_process(memory_of, task)


def measure_memory(config: FuzzConfig) -> dict[str, Any]:
    """Memory by mode and kind of reset, each in a process of its own."""
    modes = [m for m in config.memory_mode if m not in IMAGE_MODES or _has_renderer()]
    counts: dict[Literal["reset", "swap"], int] = {"reset": config.resets, "swap": config.swaps}
    tasks = [
        MemoryTask(obs_mode=mode, kind=kind, count=count, seed=config.seed)
        for mode in modes
        for kind, count in counts.items()
        if count
    ]
    rows = results_in_order(
        _alone, tasks, workers=config.workers, description="memory", unit="process"
    )
    return {
        f"{task.obs_mode}, {task.kind}": {"count": task.count, **row}
        for task, row in zip(tasks, rows, strict=True)
    }


# --- The benchmark -------------------------------------------------------------------------------


def measure(config: FuzzConfig) -> dict[str, Any]:
    """Fuzzes, then measures memory; a result for ``record.write_result``."""
    began = time.perf_counter()
    return {
        **record.provenance("benchmarks.fuzz"),
        "config": asdict(config),
        "fuzz": fuzz(config),
        "memory_environment": dict(ONE_HEAP),
        "memory": measure_memory(config),
        "seconds": round(time.perf_counter() - began, 1),
    }


def fuzz_table(row: Mapping[str, Any]) -> Table:
    """What was tried and what should not have come of it."""
    calls = row["calls"]
    table = Table(
        title=f"fuzz: {row['episodes']:,} episodes of {row['environments']} environments, "
        f"{calls['valid']:,} valid calls ({calls['steps']:,} steps, {calls['unstable']:,} "
        f"blow-ups), {calls['misuse']:,} misuses; {row['bad_episodes']:,} episodes with violations"
    )
    table.add_column("violation")
    table.add_column("times", justify="right")
    table.add_column("first in episode", justify="right")
    first: dict[str, int] = {}
    for violation in row["violations"]:
        first.setdefault(violation["problem"], violation["episode"])
    for problem, times in list(row["problems"].items())[:30]:
        table.add_row(problem, str(times), str(first.get(problem, "")))
    if not row["problems"]:
        table.add_row("none", "0", "")
    return table


def memory_table(rows: Mapping[str, Mapping[str, Any]]) -> Table:
    """What resets add to memory in the long run."""
    table = Table(title="memory: growth in the second half of many resets")
    for name in ("mode, resets", "count", "kB each", "target", "open files", "threads", "ms each"):
        table.add_column(name, justify="left" if name == "mode, resets" else "right")
    for name, row in rows.items():
        table.add_row(
            name,
            f"{row['count']:,}",
            f"{row['bytes_each'] / 1024:.3f}",
            f"{row['target'] / 1024:g}",
            "-".join(map(str, dict.fromkeys(row["files"]))),
            "-".join(map(str, dict.fromkeys(row["threads"]))),
            f"{row['ms_each']:.1f}",
        )
    return table


def report(config: FuzzConfig) -> list[Table]:
    """Measures, writes ``fuzz.json`` and gives the tables."""
    result = measure(config)
    record.write_result(config.out / "fuzz.json", result)
    return [fuzz_table(result["fuzz"]), memory_table(result["memory"])]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("fuzz", FuzzConfig, report, arguments)


if __name__ == "__main__":
    # Not this module's own: processes that are started find functions by the module's name.
    from benchmarks.fuzz import main as main_by_name

    sys.exit(main_by_name())
