"""An episode brought back goes on as it would have, to the last bit."""

import numpy as np
import pytest

from artgym.envs.articulated_env import ArtCloseEnv, ArtOpenEnv
from artgym.envs.scene_env import ArtSceneEnv
from artgym.errors import InvalidArgumentError, NotReadyError
from artgym.experts.scripted import ScriptedExpert
from benchmarks.determinism import digest_of


def goes_on(env, steps, seed):
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(steps):
        step = env.step(rng.uniform(-1, 1, 7).astype(np.float32))
        found.append(digest_of(*step))
        if step[2] or step[3]:
            found.append(digest_of(*env.reset()))
    return found


def grasped(env, seed):
    """Brings an episode to where the expert has the part between the fingers."""
    expert = ScriptedExpert(env)
    observation, info = env.reset(seed=seed)
    expert.reset(seed)
    while info["reward_terms"]["grip"] == 0.0 or info["travel"] < 0.05:
        observation, _, terminated, truncated, info = env.step(expert.act(observation))
        assert not terminated
        assert not truncated
    return observation, info


@pytest.mark.parametrize("object_id", ["drawer/0003", "laptop/0003"])
@pytest.mark.parametrize("obs_mode", ["state", "pointcloud"])
def test_in_mid_grasp(object_id, obs_mode):
    arguments = {"objects": (object_id,), "obs_mode": obs_mode, "num_points": 64}
    env, other = ArtOpenEnv(**arguments), ArtOpenEnv(**arguments)
    before = grasped(env, 3)
    state = env.get_state()
    expected = goes_on(env, 100, seed=1)
    for each in (env, other):
        assert digest_of(*each.set_state(state)) == digest_of(*before)
        assert goes_on(each, 100, seed=1) == expected
        each.close()


@pytest.mark.parametrize("env_class", [ArtCloseEnv, ArtSceneEnv])
def test_later_episodes_are_the_same_too(env_class):
    env = env_class(horizon=20)
    env.reset(seed=0)
    goes_on(env, 30, seed=0)
    state = env.get_state()
    expected = goes_on(env, 50, seed=1)
    env.reset(seed=9)
    env.set_state(state)
    assert goes_on(env, 50, seed=1) == expected
    env.close()


def test_taking_one_changes_nothing():
    digests = []
    for takes in (False, True):
        env = ArtOpenEnv()
        env.reset(seed=0)
        goes_on(env, 10, seed=0)
        if takes:
            env.get_state()
        digests.append(goes_on(env, 20, seed=1))
        env.close()
    assert digests[0] == digests[1]


def test_misuse():
    env, other = ArtOpenEnv(), ArtOpenEnv(target_part=2)
    with pytest.raises(NotReadyError, match=r"get_state before reset\(\)"):
        env.get_state()
    env.reset(seed=0)
    state = env.get_state()
    for wrong in (None, "state", other):
        with pytest.raises(InvalidArgumentError, match="expected what get_state"):
            env.set_state(wrong)
    with pytest.raises(InvalidArgumentError, match="same arguments"):
        other.set_state(state)
    env.close()
    with pytest.raises(NotReadyError, match="after close"):
        env.set_state(state)
