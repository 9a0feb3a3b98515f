"""Copies stepped together: the same results as alone, and no waiting for the dead."""

from __future__ import annotations

import os
import signal
import time

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.env_util import make_vec_env

from artgym.errors import InvalidArgumentError, NotReadyError, UnknownNameError, WorkerError
from artgym.registration import environment_ids

ENV_ID = "ArtOpenDrawer-v0"


def actions(count, steps, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, (steps, count, 7)).astype(np.float32)


def rollout(envs, steps=12):
    observations, _ = envs.reset(seed=5)
    found = [observations.copy()]
    for action in actions(envs.num_envs, steps):
        observations, rewards, terminated, truncated, infos = envs.step(action)
        found += [observations.copy(), rewards, terminated, truncated, infos["travel"]]
    return found


def assert_equal(first, second):
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a, b)


def test_as_gymnasium_s_own_and_whatever_the_workers():
    # Episodes of five steps end and begin anew on the way.
    reference = gymnasium.make_vec(ENV_ID, num_envs=3, vectorization_mode="sync", horizon=5)
    expected = rollout(reference)
    reference.close()
    for workers in (0, 1, 2):
        envs = gymnasium.make_vec(ENV_ID, num_envs=3, workers=workers, horizon=5)
        assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
        assert_equal(rollout(envs), expected)
        envs.close()


def test_resets_in_the_same_step():
    envs = gymnasium.make_vec(ENV_ID, num_envs=2, horizon=3, autoreset_mode="SameStep")
    envs.reset(seed=0)
    for i, action in enumerate(actions(2, 7), start=1):
        observations, _, _, truncated, infos = envs.step(action)
        assert truncated.tolist() == [i % 3 == 0] * 2
        assert ("final_obs" in infos) == (i % 3 == 0)
        if i % 3 == 0:
            assert infos["final_info"][0]["elapsed_steps"] == 3
            assert infos["elapsed_steps"].tolist() == [0, 0]
            assert not np.array_equal(infos["final_obs"][0], observations[0])
    envs.close()


@pytest.mark.parametrize("env_id", environment_ids("any-category"))
@pytest.mark.parametrize("obs_mode", ["state", "state_dict", "pointcloud"])
def test_every_environment(env_id, obs_mode):
    envs = gymnasium.make_vec(env_id, num_envs=2, obs_mode=obs_mode, num_points=64)
    observations, infos = envs.reset(seed=0)
    assert envs.observation_space.contains(observations)
    assert infos["object_id"].shape == (2,)
    observations, rewards, *_, infos = envs.step(np.zeros((2, 7), np.float32))
    assert envs.observation_space.contains(observations)
    assert rewards.shape == (2,)
    assert infos["success_at"]["50"].shape == (2,)
    assert envs.spec.id == env_id
    envs.close()


def test_pictures(render_system):
    envs = gymnasium.make_vec(ENV_ID, num_envs=2, obs_mode="rgb", camera_size=(40, 40),
                              render_mode="rgb_array")  # fmt: skip
    observations, _ = envs.reset(seed=0)
    assert observations["rgb"].shape == (2, 40, 40, 3)
    assert np.array(envs.render()).shape == (2, 360, 480, 3)
    envs.close()


@pytest.fixture
def two_workers():
    envs = gymnasium.make_vec(ENV_ID, num_envs=2, workers=2, patience=2.0)
    envs.reset(seed=0)
    yield envs
    began = time.perf_counter()
    envs.close()
    assert time.perf_counter() - began < 5.0


def test_a_killed_worker_is_reported(two_workers):
    os.kill(two_workers._workers[1].process.pid, signal.SIGKILL)
    began = time.perf_counter()
    with pytest.raises(WorkerError, match=r"worker 1 .* has died with exit status -9"):
        two_workers.step(np.zeros((2, 7), np.float32))
    assert time.perf_counter() - began < 5.0


def test_a_hanging_worker_is_reported(two_workers):
    os.kill(two_workers._workers[0].process.pid, signal.SIGSTOP)
    began = time.perf_counter()
    with pytest.raises(WorkerError, match="has not answered for 2 s"):
        two_workers.step(np.zeros((2, 7), np.float32))
    assert time.perf_counter() - began < 5.0


def test_errors_come_through_workers(two_workers):
    with pytest.raises(InvalidArgumentError, match="finite"):
        two_workers.step(np.full((2, 7), np.nan))


def test_bad_arguments():
    for options, mentioned in [
        ({"num_envs": 0}, "num_envs=0"),
        ({"num_envs": 2, "workers": -1}, "workers=-1"),
        ({"num_envs": 2, "patience": 0}, "patience=0"),
        ({"num_envs": 2, "obs_mode": "stat"}, "Nearest: 'state'"),
        ({"num_envs": 2, "autoreset_mode": "never"}, "autoreset_mode"),
    ]:
        with pytest.raises(InvalidArgumentError, match=mentioned):
            gymnasium.make_vec(ENV_ID, **options)
    assert issubclass(UnknownNameError, InvalidArgumentError)


def test_misuse():
    envs = gymnasium.make_vec(ENV_ID, num_envs=2)
    with pytest.raises(NotReadyError, match=r"step before reset\(\)"):
        envs.step(np.zeros((2, 7), np.float32))
    with pytest.raises(InvalidArgumentError, match="3 seeds for 2"):
        envs.reset(seed=[1, 2, 3])
    envs.reset(seed=0)
    with pytest.raises(InvalidArgumentError, match="finite"):
        envs.step([np.zeros(7), np.full(7, np.nan)])
    # No copy has moved.
    assert envs.step(np.zeros((2, 7), np.float32))[4]["elapsed_steps"].tolist() == [1, 1]
    with pytest.raises(InvalidArgumentError, match="expected 2 of them"):
        envs.step(np.zeros((3, 7), np.float32))
    envs.close()
    envs.close()
    with pytest.raises(NotReadyError, match="after close"):
        envs.step(np.zeros((2, 7), np.float32))


def test_stable_baselines3_s_own():
    envs = make_vec_env(ENV_ID, n_envs=2, seed=0, env_kwargs={"horizon": 3})
    envs.reset()
    for _ in range(4):
        observations, rewards, _, infos = envs.step(np.zeros((2, 7), np.float32))
    assert observations.shape[0] == rewards.shape[0] == len(infos) == 2
    envs.close()
