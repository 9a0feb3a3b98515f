"""The comparison of rollouts and snapshots, from the command line to its file."""

from __future__ import annotations

import json
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from artgym.errors import InvalidArgumentError, UnknownNameError
from benchmarks import determinism
from benchmarks.contact_policy import ContactPolicy, fields_of
from benchmarks.determinism import DeterminismConfig, Rollout, Seeds


def test_a_small_run(tmp_path, capsys):
    sizes = {"seeds": 2, "steps": 25, "horizon": 20, "others": 2, "snapshots": 2, "fresh": 1}
    arguments = [word for name, size in sizes.items() for word in (f"--{name}", str(size))]
    assert determinism.main([*arguments, "--workers", "1", "--out", str(tmp_path)]) == 0
    assert "0 of 12" in capsys.readouterr().out
    row = json.loads((tmp_path / "determinism.json").read_text())["rows"]["ArtOpen-v0"]
    rollouts, snapshots = row["rollouts"], row["snapshots"]
    assert list(rollouts["conditions"]) == list(determinism.CONDITIONS)
    assert not any(rollouts["conditions"].values())
    # Each seed begins a second episode.
    assert rollouts["episodes"] >= 4
    assert snapshots["snapshots"] == 2
    assert snapshots["in_a_fresh_process"] == 1
    assert snapshots["differing"] == snapshots["differing_in_a_fresh_process"] == []


@pytest.mark.parametrize("obs_mode", ["state_dict", "pointcloud"])
def test_copies_are_taken_down_as_single_environments_are(obs_mode):
    config = DeterminismConfig(obs_mode=obs_mode, steps=12, horizon=5)
    task = Seeds(config=config, env_id="ArtClose-v0", condition="", seeds=(4, 5, 6))
    expected = determinism.in_one_environment(task)
    assert determinism._together(task, workers=0) == expected
    assert len({r.digests for r in expected}) == 3


def rollout_of(digests: str) -> Rollout:
    return Rollout(seed=3, digests=tuple(digests), object_ids=(), touched=0, pinched=0, unstable=0)


def test_a_difference_is_told_once_with_its_first_step():
    reference = {3: rollout_of("abcd")}
    assert determinism.differences([rollout_of("abcd")], reference) == []
    assert determinism.differences([rollout_of("abXX"), rollout_of("aXXX")], reference) == [
        {"seed": 3, "step": 1}
    ]


class Trembling(gymnasium.Wrapper):
    """Its rewards are not quite the same twice."""

    count = 0

    def step(self, action):
        self.count += 1
        observation, reward, *rest = super().step(action)
        return observation, float(np.nextafter(reward, self.count % 7)), *rest


def test_the_last_bit_counts():
    env = gymnasium.make("ArtOpen-v0", objects=("drawer/0004",))
    rng = np.random.default_rng(0)
    actions = [determinism._any_action(rng) for _ in range(12)]

    def rollout(made):
        remaining = iter(actions)
        return determinism.rollout(made, 1, 12, lambda _: next(remaining))

    first = rollout(env)
    assert first.first_difference(rollout(env)) is None
    assert first.first_difference(rollout(Trembling(env))) == 1
    env.close()


@pytest.mark.parametrize("value", [np.float32(1), 1.0, 1, True, np.ones(1), np.ones((1, 1)), "1"])
def test_digests_tell_types_and_shapes_apart(value):
    others = [np.float32(1), 1.0, 1, True, np.ones(1), np.ones((1, 1)), "1"]
    alike = [determinism.digest_of({"a": value}) == determinism.digest_of({"a": o}) for o in others]
    assert sum(alike) == 1


def test_the_policy_grips_and_lets_go():
    env = gymnasium.make("ArtOpen-v0", objects=("drawer/0004",), horizon=500)
    rollout = determinism.rollout(env, 0, 500, ContactPolicy(np.random.default_rng(0)).act)
    assert rollout.touched > rollout.pinched > 50
    assert rollout.touched < 450
    env.close()


def test_fields_are_the_same_in_both_state_modes():
    found = []
    for obs_mode in ("state", "state_dict"):
        env = gymnasium.make("ArtOpen-v0", obs_mode=obs_mode)
        found.append(fields_of(env.reset(seed=0)[0]))
        env.close()
    assert found[0].keys() == found[1].keys()
    for name, value in found[0].items():
        np.testing.assert_array_equal(value, found[1][name])


def test_a_snapshot_that_goes_on_otherwise_is_noticed(monkeypatch):
    config = DeterminismConfig(snapshots=1, fresh=0)
    task = determinism.Snapshots(config=config, env_id="ArtOpen-v0", numbers=(0,))
    (good,) = determinism.snapshots_of(task)
    assert good["same"]
    assert good["pinching"]
    assert good["same_in_a_fresh_process"] is None

    def less(resumption, env):
        state = resumption.state
        shorter = replace(state, actions=state.actions[:-1])
        return resume(replace(resumption, state=shorter), env)

    resume = determinism.resume
    monkeypatch.setattr(determinism, "resume", less)
    (bad,) = determinism.snapshots_of(task)
    assert not bad["same"]


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({"seeds": 0}, InvalidArgumentError),
        ({"snapshots": -1}, InvalidArgumentError),
        ({"env_id": ("ArtOpn-v0",)}, UnknownNameError),
    ],
)
def test_wrong_options(changes, error):
    with pytest.raises(error):
        DeterminismConfig(**changes)
