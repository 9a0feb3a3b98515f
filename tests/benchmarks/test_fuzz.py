"""Everything that an environment must refuse, and the benchmark that tries it at random."""

from __future__ import annotations

import json
import os
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

from artgym.envs.articulated_env import ArtCloseEnv, ArtOpenEnv
from artgym.envs.scene_env import ArtSceneEnv
from artgym.errors import InvalidArgumentError, NotReadyError
from benchmarks import fuzz
from benchmarks.determinism import digest_of
from benchmarks.fuzz import Episode, FuzzConfig


def named(values):
    return [(name, value) for name, each in values.items() for value in each]


def refusals():
    return Episode(number=0, rng=np.random.default_rng(0))


@pytest.mark.parametrize("env_class", [ArtOpenEnv, ArtSceneEnv])
def test_every_wrong_argument_is_refused(env_class):
    episode = refusals()
    for name, value in named(fuzz.WRONG_ARGUMENTS):
        episode.misuse(f"{name}={value!r}", lambda wrong={name: value}: env_class(**wrong))
    assert episode.violations == []


@pytest.mark.parametrize("arguments", fuzz.CONFLICTS, ids=str)
def test_every_conflict_is_refused(arguments):
    with pytest.raises(InvalidArgumentError):
        ArtCloseEnv(**arguments)


def test_every_odd_argument_will_do():
    for name, value in named(fuzz.ODD_ARGUMENTS):
        env = ArtOpenEnv(**{name: value}, **({} if name == "objects" else {"objects": "box/0001"}))
        assert env.observation_space is not None
        env.close()


def make_mistakes(env):
    episode = refusals()
    for seed in fuzz.WRONG_SEEDS:
        episode.misuse(f"reset(seed={seed!r})", lambda seed=seed: env.reset(seed=seed))
    for options in fuzz.WRONG_OPTIONS:
        episode.misuse(f"reset({options!r})", lambda wrong=options: env.reset(options=wrong))
    for action in fuzz.WRONG_ACTIONS:
        episode.misuse(f"step({action!r})", lambda action=action: env.step(action))
    assert episode.violations == []


def test_every_wrong_reset_and_action_is_refused_and_leaves_no_trace():
    found = []
    for is_wronged in (False, True):
        env = ArtOpenEnv(objects=("drawer/0004",))
        env.reset(seed=0)
        if is_wronged:
            make_mistakes(env)
        state = env.get_state()
        found.append(digest_of(*env.step(np.full(7, 0.5))))
        # It can still be brought back.
        env.set_state(state)
        assert digest_of(*env.step(np.full(7, 0.5))) == found[-1]
        found.append(digest_of(*env.reset()))
        env.close()
    assert found[:2] == found[2:]


def test_a_refused_draw_leaves_the_running_episode_to_be_brought_back():
    # A door is too large for a table with other things, unless it is asked for.
    env = ArtSceneEnv(objects=("door/0001",), num_objects=(1, 1))
    env.reset(seed=0, options={"object_id": "laptop/0005"})
    with pytest.raises(InvalidArgumentError, match="long, wide and high"):
        env.reset()
    state = env.get_state()
    found = digest_of(*env.step(np.full(7, 0.5)))
    env.set_state(state)
    assert digest_of(*env.step(np.full(7, 0.5))) == found
    env.close()


def test_every_odd_reset_and_action_will_do():
    env = ArtOpenEnv()
    for seed in fuzz.ODD_SEEDS:
        env.reset(seed=seed)
    for options in fuzz.ODD_OPTIONS:
        env.reset(options=options)
    for action in fuzz.ODD_ACTIONS:
        assert env.observation_space.contains(env.step(action)[0])
    env.close()


@pytest.mark.parametrize(("name", "value"), named(fuzz.WRONG_COPIES), ids=str)
def test_every_wrong_argument_of_copies_is_refused(name, value):
    with pytest.raises(InvalidArgumentError):
        gymnasium.make_vec("ArtOpenBox-v0", **{"num_envs": 2, name: value})


def test_no_step_follows_the_end_of_an_episode():
    env, action = ArtOpenEnv(horizon=2), np.zeros(7, np.float32)
    env.reset(seed=0)
    env.step(action)
    before = env.get_state()
    assert env.step(action)[3]
    after = env.get_state()
    for each in (None, after):
        if each is not None:
            env.set_state(each)
        with pytest.raises(NotReadyError, match=r"the episode is over; call reset\(\)"):
            env.step(action)
        # It can still be looked at.
        assert env.progress.travel < 0.01
    env.set_state(before)
    assert env.step(action)[3]
    env.close()


def test_states_pass_between_environments_whose_arguments_mean_the_same():
    poses = np.array(fuzz._POSE)
    first, second = (
        ArtOpenEnv(objects=objects, camera_poses=given, obs_mode="pointcloud", num_points=16)
        for objects, given in ((["box/0001"], poses.copy()), (("box/0001",), poses.tolist()))
    )
    first.reset(seed=0)
    observation, _ = second.set_state(first.get_state())
    assert second.observation_space.contains(observation)
    first.close()
    second.close()


def test_a_small_run(tmp_path, capsys):
    sizes = {"episodes": 8, "resets": 4, "swaps": 4, "memory-mode": "state", "workers": 1}
    arguments = [word for name, size in sizes.items() for word in (f"--{name}", str(size))]
    assert fuzz.main([*arguments, "--out", str(tmp_path)]) == 0
    assert "8 episodes" in capsys.readouterr().out
    result = json.loads((tmp_path / "fuzz.json").read_text())
    assert sum(result["fuzz"]["kinds"].values()) == 8
    assert result["fuzz"]["problems"] == {}
    assert result["fuzz"]["calls"]["misuse"] > 0
    assert list(result["memory"]) == ["state, reset", "state, swap"]
    for row in result["memory"].values():
        assert len(row["samples"]) == 4
        assert row["files"][0] > 0
        assert row["threads"][0] >= 1


def test_an_episode_is_determined_by_its_number():
    first, second = (fuzz.fuzz_episode(0, 5) for _ in range(2))
    assert first == second
    assert first != fuzz.fuzz_episode(0, 6)


@pytest.mark.parametrize("kind", list(fuzz.KINDS))
def test_every_kind(kind, monkeypatch):
    monkeypatch.setattr(fuzz, "KINDS", {kind: (fuzz.KINDS[kind][0], 1.0)})
    found = fuzz.fuzz_episode(3, 0)
    assert found["kind"] == kind
    assert found["counts"]["valid" if kind != "arguments" else "misuse"] >= 3
    assert found["violations"] == []


def deadly(batch: fuzz.Batch) -> None:
    """Takes its process down in episode 1."""
    for number in batch.numbers:
        if number == 1:
            os._exit(3)
        with Path(batch.trail).open("a", encoding="utf-8") as trail:
            print(json.dumps({"episode": number}), file=trail)


def test_an_episode_that_kills_its_process_is_a_violation_and_the_next_goes_on():
    found = fuzz.surviving_episodes(0, (0, 1, 2), deadly)
    assert [each["episode"] for each in found] == [0, 1, 2]
    assert found[1]["kind"] == "fatal"
    assert "died" in found[1]["violations"][0]["problem"]


def raising(error):
    def call():
        raise error

    return call


def test_what_counts_as_a_violation():
    episode = Episode(number=7, rng=np.random.default_rng(0))
    episode.valid("fine", lambda: 1)
    episode.misuse("refused", raising(InvalidArgumentError("no")))
    assert episode.violations == []
    episode.valid("refused", raising(InvalidArgumentError("no")))
    episode.misuse("crash", raising(TypeError("what?")))
    episode.misuse("accepted", lambda: 1)
    assert [v["problem"] for v in episode.violations] == [
        "valid use raised InvalidArgumentError: no",
        "misuse raised TypeError: what?",
        "misuse was accepted",
    ]
    assert episode.violations[-1]["calls"][-1] == "wrong: accepted"
    assert episode.counts == {"valid": 2, "misuse": 3}


INFO = {"travel": 0.1, "engaged": 1.0, "gripped": 0.0, "object_id": "a", "at": {"50": True}}


@pytest.mark.parametrize(
    ("observation", "info", "fault"),
    [
        ({"a": np.zeros(2, np.float32)}, {}, None),
        ({"a": np.array([0, np.nan], np.float32)}, {}, "a is not finite"),
        ({"a": np.array([0, 2], np.float32)}, {}, "a is not in its space"),
        ({"a": np.zeros(2)}, {}, "a is not in its space"),
        ({"b": np.zeros(2, np.float32)}, {}, "other fields than the space"),
        (
            {"a": np.zeros(2, np.float32)},
            {"at": {"50": np.inf}},
            "info[at.50] is not finite",
        ),
        ({"a": np.zeros(2, np.float32)}, {"engaged": 1.1}, "info[engaged] is out of range"),
        ({"a": np.zeros(2, np.float32)}, {"travel": -0.1}, "info[travel] is out of range"),
    ],
)
def test_faults(observation, info, fault):
    space = spaces.Dict({"a": spaces.Box(-1, 1, (2,), np.float32)})
    found = fuzz.faults(space, observation, INFO | info)
    assert [each for each, _ in found] == ([] if fault is None else [fault])


def test_growth_is_of_the_second_half():
    assert fuzz.growth([[i, 1000 if i > 3 else 0] for i in range(10)]) == pytest.approx(0.0)
    assert fuzz.growth([[1, 5]]) == 0.0


@pytest.mark.parametrize("changes", [{"episodes": -1}, {"memory_mode": ("points",)}])
def test_wrong_options(changes):
    with pytest.raises(InvalidArgumentError):
        FuzzConfig(**changes)
