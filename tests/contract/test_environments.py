"""What every registered environment keeps, in every observation mode."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
import time
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import stable_baselines3.common.env_checker
from gymnasium import spaces
from gymnasium.envs.registration import load_env_creator
from gymnasium.utils.env_checker import check_env

from artgym.envs.articulated_env import HORIZON
from artgym.errors import InvalidArgumentError, NotReadyError, UnknownNameError
from artgym.registration import environment_ids
from benchmarks.determinism import digest_of
from tests.contract.rollout import CONTROLS, IMAGE_MODES, OBS_MODES, digest, make, random_action

ROOT = Path(__file__).resolve().parents[2]
HAND, *ARM = CONTROLS
CASES = [
    *((env_id, mode, HAND) for env_id in environment_ids("any-category") for mode in OBS_MODES),
    *(("ArtOpen-v0", mode, control) for mode in ("state", "pointcloud") for control in ARM),
]
#: Those of one category are the same classes with other arguments.
ALL_CASES = [
    (env_id, mode, control)
    for env_id in environment_ids()
    for mode in OBS_MODES
    for control in CONTROLS
]


def name_of(case) -> str:
    env_id, mode, control = case
    return "-".join((env_id, mode, *control))


INFO_KEYS = {
    "object_id", "success", "success_gripped", "success_once", "success_at", "success_maniskill",
    "success_where2act", "travel", "engaged", "gripped", "open_fraction", "reward_terms",
    "elapsed_steps", "unstable",
}  # fmt: skip


#: What may be the same at the start of two episodes.
ALIKE_AT_THE_START = {
    "target_part", "jaw_width", "intrinsics", "is_revolute", "joint_velocity", "tcp_z_axis",
    "tcp_linear_velocity", "tcp_angular_velocity", "arm_velocities",
}  # fmt: skip


@pytest.fixture(params=CASES, ids=name_of)
def case(request) -> tuple[str, str, tuple[str, str]]:
    if request.param[1] in IMAGE_MODES:
        request.getfixturevalue("render_system")
    return request.param


@pytest.fixture
def env(case):
    env = make(*case)
    yield env
    env.close()


def elements(observation) -> dict[str, np.ndarray]:
    return observation if isinstance(observation, dict) else {"": observation}


def random_steps(env, count, seed=0):
    rng = np.random.default_rng(seed)
    env.reset(seed=seed)
    for _ in range(count):
        step = env.step(random_action(env, rng))
        yield step
        if step[2] or step[3]:
            env.reset()


def assert_in_space(observation, space):
    assert space.contains(observation)
    named = space.spaces if isinstance(space, spaces.Dict) else {"": space}
    for name, value in elements(observation).items():
        assert np.asarray(value).dtype == named[name].dtype, name
        assert np.all(np.isfinite(value)), name


def test_observations_rewards_and_info(env):
    observation, info = env.reset(seed=3)
    assert_in_space(observation, env.observation_space)
    assert set(info) == INFO_KEYS
    for observation, reward, terminated, truncated, info in random_steps(env, 60):
        assert_in_space(observation, env.observation_space)
        assert type(reward) is float
        assert 0.0 <= reward <= 1.0
        assert type(terminated) is bool
        assert type(truncated) is bool
        assert set(info) == INFO_KEYS
        assert reward == pytest.approx(sum(info["reward_terms"].values()))


def test_action_space(case, env):
    size = {"delta_pose": 7, "delta_joint": 8}[case[2][1]]
    assert env.action_space == spaces.Box(-1.0, 1.0, (size,), np.float32)


def test_same_seed_same_rollout(case, env):
    first = digest(env, 7)
    assert digest(env, 7) == first
    fresh = make(*case)
    assert digest(fresh, 7) == first
    fresh.close()


def test_same_rollout_in_a_fresh_process(request):
    try:
        request.getfixturevalue("render_system")
        cases = CASES
    except pytest.skip.Exception:
        cases = [c for c in CASES if c[1] not in IMAGE_MODES]
    process = subprocess.run(
        [sys.executable, "-m", "tests.contract.rollout", json.dumps(cases)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(process.stdout.splitlines()[-1]) == [digest(make(*c), 7) for c in cases]


def test_two_resets_differ(env):
    first, second = env.reset(seed=0)[0], env.reset()[0]
    for name in set(elements(first)) - ALIKE_AT_THE_START:
        assert not np.array_equal(elements(first)[name], elements(second)[name]), name
    other = env.reset(seed=1)[0]
    assert digest_of(other) != digest_of(first)


def test_no_memory_is_shared_between_steps(env):
    kept = [env.reset(seed=0)[0]]
    copies = [{k: np.copy(v) for k, v in elements(kept[0]).items()}]
    for observation, *_ in random_steps(env, 5):
        kept.append(observation)
        copies.append({k: np.copy(v) for k, v in elements(observation).items()})
    for i, observation in enumerate(kept):
        for name, value in elements(observation).items():
            np.testing.assert_array_equal(value, copies[i][name])
            if isinstance(value, np.ndarray):
                others = [elements(o)[name] for o in kept[i + 1 :]]
                assert not any(np.shares_memory(value, other) for other in others), name


def test_no_element_of_the_observation_is_constant(env):
    seen: dict[str, set[bytes]] = {}
    for seed in range(3):
        env.reset(seed=seed)
        for observation, *_ in random_steps(env, 5, seed):
            for name, value in elements(observation).items():
                seen.setdefault(name, set()).add(np.asarray(value).tobytes())
    # The part to move is asked for; three objects may well have the same kind of joint.
    alike = {name for name, values in seen.items() if len(values) == 1}
    assert alike <= {"target_part", "is_revolute"}


def test_pickles(case, env):
    env.reset(seed=0)
    copy = pickle.loads(pickle.dumps(env))
    assert digest(copy, 5, steps=10) == digest(env, 5, steps=10)
    copy.close()


def test_closes_twice(env):
    env.reset(seed=0)
    env.close()
    env.close()


def test_before_reset_and_after_close(env):
    bare, action = env.unwrapped, np.zeros(env.action_space.shape, np.float32)
    with pytest.raises(NotReadyError, match=r"step before reset\(\)"):
        bare.step(action)
    with pytest.raises(NotReadyError, match=r"object before reset\(\)"):
        _ = bare.object
    bare.reset(seed=0)
    bare.close()
    with pytest.raises(NotReadyError, match=r"step after close\(\)"):
        bare.step(action)
    with pytest.raises(NotReadyError, match=r"close\(\): make a new environment"):
        bare.reset()


@pytest.mark.parametrize(
    ("bad", "mentioned"),
    [
        (lambda size: np.full(size, np.nan), "finite"),
        (lambda size: np.where(np.arange(size) == 3, np.inf, 0.0), "finite"),
        (lambda size: np.zeros(size - 1), r"shape \([67],\)"),
        (lambda size: np.zeros((1, size)), r"shape \(1, [78]\)"),
        (lambda size: "open it", "[78] numbers"),
        (lambda size: None, "action"),
        (lambda size: [[1, 2], [3]], "[78] numbers"),
    ],
)
def test_bad_actions(env, bad, mentioned):
    bare = env.unwrapped
    (size,) = env.action_space.shape
    action = bad(size)
    bare.reset(seed=0)
    before = bare.tcp_pose()
    with pytest.raises(InvalidArgumentError, match=mentioned):
        bare.step(action)
    # Nothing has moved, and the episode goes on.
    np.testing.assert_array_equal(bare.tcp_pose(), before)
    bare.step(np.zeros(size, np.float32))


def test_actions_beyond_the_space_are_clipped(case):
    poses = []
    for scale in (1.0, 1e6):
        env = make(*case).unwrapped
        env.reset(seed=0)
        for _ in range(3):
            env.step(scale * np.ones(env.action_space.shape, np.float32))
        poses.append(env.tcp_pose())
        env.close()
    np.testing.assert_array_equal(*poses)


def test_gymnasium_s_checker(case):
    env = make(*case)
    check_env(env.unwrapped, skip_render_check=True)
    env.close()


def test_gymnasium_s_checker_of_pictures(case, render_system):
    env = make(*case, render_mode="rgb_array")
    check_env(env.unwrapped)
    env.reset(seed=0)
    picture = env.render()
    assert picture.dtype == np.uint8
    assert picture.shape == (360, 480, 3)
    assert picture.std() > 5
    env.close()


def test_stable_baselines3_s_checker(case):
    env = make(*case)
    stable_baselines3.common.env_checker.check_env(env, warn=True, skip_render_check=True)
    env.close()


def test_vector_environments(case):
    env_id, mode, (robot, control_mode) = case
    envs = gymnasium.make_vec(
        env_id, num_envs=2, vectorization_mode="sync", obs_mode=mode, robot=robot,
        control_mode=control_mode, camera_size=(64, 48), num_points=256,
    )  # fmt: skip
    envs.reset(seed=0)
    observation, reward, *_ = envs.step(np.zeros(envs.action_space.shape, np.float32))
    assert envs.observation_space.contains(observation)
    assert reward.shape == (2,)
    envs.close()


@pytest.mark.slow
@pytest.mark.parametrize("case", ALL_CASES, ids=name_of)
@pytest.mark.filterwarnings("error")
def test_every_environment_passes_the_checkers(case, request):
    if case[1] in IMAGE_MODES:
        request.getfixturevalue("render_system")
    env = make(*case)
    check_env(env.unwrapped, skip_render_check=True)
    stable_baselines3.common.env_checker.check_env(env, warn=True, skip_render_check=True)
    copy = pickle.loads(pickle.dumps(env))
    env.reset(seed=0)
    copy.reset(seed=0)
    for each in (env, copy):
        each.close()
        each.close()


@pytest.mark.parametrize("mode", ["rgb", "rgbd", "pointcloud"])
@pytest.mark.parametrize("env_id", environment_ids("any-category"))
def test_segmentation(env_id, mode, request):
    if mode in IMAGE_MODES:
        request.getfixturevalue("render_system")
    env = make(env_id, mode, segmentation=True, **({"num_cameras": 2} if mode == "rgb" else {}))
    observation, _ = env.reset(seed=0)
    assert_in_space(observation, env.observation_space)
    # The object, and in a cloud not the table.
    assert (observation["segmentation"] == 1 + env.unwrapped.target_part).any()
    assert (observation["segmentation"] == 0).any() == (mode in IMAGE_MODES)
    if mode == "rgb":
        assert not np.array_equal(observation["T_world_camera"], observation["T_world_camera_1"])
    env.close()


@pytest.mark.parametrize("env_id", environment_ids("any-category"))
@pytest.mark.parametrize("horizon", [None, 7])
def test_the_horizon_truncates(env_id, horizon):
    env = gymnasium.make(env_id, **({} if horizon is None else {"horizon": horizon}))
    env.reset(seed=0)
    for i in range(horizon or HORIZON):
        _, _, terminated, truncated, info = env.step(np.zeros(7, np.float32))
        assert not terminated
        assert truncated == (i + 1 == (horizon or HORIZON))
        assert info["elapsed_steps"] == i + 1
    env.close()


@pytest.mark.parametrize("env_id", environment_ids("any-category"))
@pytest.mark.parametrize(
    ("arguments", "nearest"),
    [
        ({"categories": ("labtop",)}, "laptop"),
        ({"categories": "drawers"}, "drawer"),
        ({"obs_mode": "rgb-d"}, "rgbd"),
        ({"robot": "pandas"}, "panda"),
        ({"control_mode": "pose"}, "delta_pose"),
        ({"randomised": ("light",)}, "lights"),
        ({"category": ("laptop",)}, "categories"),
        ({"obs_mode": "points"}, "pointcloud"),
        ({"reward_mode": "dens"}, "dense"),
        ({"split": "training"}, "train"),
        ({"objects": ["drawer/12"]}, "drawer/0012"),
        ({"render_mode": "human"}, "rgb_array"),
    ],
)
def test_unknown_names_name_the_nearest(env_id, arguments, nearest):
    # Not through gymnasium.make, which has its own words for render modes.
    environment = load_env_creator(gymnasium.spec(env_id).entry_point)
    with pytest.raises(UnknownNameError, match=f"Nearest: '{nearest}'"):
        environment(**arguments)


@pytest.mark.parametrize("env_id", environment_ids("any-category"))
@pytest.mark.parametrize(
    ("arguments", "mentioned"),
    [
        ({"target_part": 0}, "target_part=0.*from 1"),
        ({"target_part": 9}, "target_part=9.*movable parts"),
        ({"camera_size": (0, 100)}, "camera_size"),
        ({"camera_size": (10_000, 100)}, "camera_size"),
        ({"camera_size": "small"}, "camera_size"),
        ({"num_points": 0}, "num_points"),
        ({"num_points": 10.5}, "num_points"),
        ({"num_cameras": 0}, "num_cameras"),
        ({"horizon": 0}, "horizon"),
        ({"target_part": "lid"}, "target_part"),
        ({"camera_poses": [np.eye(3)]}, "camera_poses"),
        ({"camera_poses": 2 * np.eye(4)}, "camera_poses"),
        ({"categories": ()}, "no objects"),
        ({"objects": []}, "no objects"),
    ],
)
def test_bad_arguments_are_named(env_id, arguments, mentioned):
    with pytest.raises(InvalidArgumentError, match=mentioned):
        gymnasium.make(env_id, **arguments)


@pytest.mark.parametrize("env_id", environment_ids("any-category"))
def test_reset_options(env_id):
    env = gymnasium.make(env_id).unwrapped
    _, info = env.reset(seed=0, options={"object_id": "laptop/0005", "open_fraction": 0.25})
    assert info["object_id"] == "laptop/0005"
    assert info["open_fraction"] == pytest.approx(0.25)
    for options, mentioned in [
        ({"object": "laptop/0005"}, "Nearest: 'object_id'"),
        ({"object_id": "laptop/5"}, "Nearest: 'laptop/0005'"),
        ({"open_fraction": 1.5}, "open_fraction"),
        ({"open_fraction": float("nan")}, "open_fraction"),
        ({"open_fraction": "half"}, "open_fraction"),
    ]:
        with pytest.raises(InvalidArgumentError, match=mentioned):
            env.reset(options=options)
        # The running episode is untouched.
        assert env.object.object_id == "laptop/0005"
    env.close()


def test_without_a_driver_only_pictures_are_missing():
    script = f"""
import json, time
from tests.contract.rollout import make
from artgym.errors import RendererUnavailableError
found = {{}}
for env_id in {environment_ids()!r}:
    for mode in ("state", "pointcloud"):
        env = make(env_id, mode)
        env.reset(seed=0)
        found[env_id, mode] = env.step(env.action_space.sample())[0]
    for arguments in ({{"obs_mode": "rgbd"}}, {{"obs_mode": "state", "render_mode": "rgb_array"}}):
        start = time.perf_counter()
        try:
            make(env_id, **arguments)
        except RendererUnavailableError as error:
            print(json.dumps({{"seconds": time.perf_counter() - start, "message": str(error)}}))
"""
    start = time.perf_counter()
    process = subprocess.run(
        [sys.executable, "-c", script],
        cwd=ROOT,
        env=os.environ | {"VK_ICD_FILENAMES": os.devnull, "VK_DRIVER_FILES": os.devnull},
        capture_output=True,
        text=True,
        check=False,
    )
    whole = time.perf_counter() - start
    assert process.returncode == 0, process.stderr
    refusals = [json.loads(line) for line in process.stdout.splitlines()]
    assert len(refusals) == 2 * len(environment_ids())
    for refusal in refusals:
        # Quickly: without the seconds that a first picture takes.
        assert refusal["seconds"] < max(3.0, 0.5 * whole)
        assert "To mend it: " in refusal["message"]
        assert "State and point-cloud observations work" in refusal["message"]
