"""The ratios, the proofs that nothing sleeps, and a stopwatch that is asked over its pipe."""

from __future__ import annotations

import io
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from tqdm import tqdm

from artgym.errors import InvalidArgumentError, MissingDependencyError
from artgym.objects import catalog
from benchmarks import env_speed, stopwatch, twin_asset
from benchmarks.env_speed import EnvSpeedConfig
from benchmarks.stopwatch import OtherSceneError, StillSceneError, StopwatchError

OBJECT = "drawer/0004"


@pytest.fixture(scope="module")
def timings() -> stopwatch.OurTimings:
    return stopwatch.OurTimings(camera_size=(32, 24))


def test_the_median_ratio_has_a_bound_below_it() -> None:
    pairs = [[1.0, r] for r in (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)]
    row = env_speed.ratio_row(pairs, 4.0, seed=0)
    assert row["ratio"] == 4.0
    assert 1.0 <= row["lower"] < 4.0
    assert row["holds"] is False
    assert row == env_speed.ratio_row(pairs, 4.0, seed=0)
    assert env_speed.ratio_row(pairs, None, seed=0)["holds"] is None


def test_sides_take_turns_in_going_first() -> None:
    order: list[str] = []

    def side(name: str, cost: float) -> env_speed.Cost:
        def measured(i: int) -> tuple[float]:
            order.append(f"{name}{i}")
            return (cost,)

        return measured

    bar = tqdm(file=io.StringIO())
    (pairs,) = env_speed.interleaved(side("a", 1.0), side("b", 2.0), 3, bar)
    assert order == ["a0", "b0", "b1", "a1", "a2", "b2", "b3", "a3"]
    assert pairs == [[1.0, 2.0]] * 3


def test_bare_physics_goes_where_the_environment_goes(timings: stopwatch.OurTimings) -> None:
    steps = 40
    for awake in (True, False):
        arguments = {"mode": "state", "object_id": OBJECT, "seed": 1, "steps": steps}
        assert timings.step(**arguments, awake=awake) > 0
        assert timings.bare_step(object_id=OBJECT, seed=1, steps=steps, awake=awake) > 0


def test_a_scene_that_sleeps_or_goes_elsewhere_is_not_timed(
    timings: stopwatch.OurTimings,
) -> None:
    (drive,) = timings._drives_of(OBJECT, 1, 60)
    resting = replace(drive, targets=[drive.targets[0]] * 60, path=[drive.path[0]] * 60)
    with pytest.raises(StillSceneError, match=r"asleep|moves at"):
        stopwatch.require_same_motion(resting, awake=False)
    with pytest.raises(OtherSceneError, match="from the environment's"):
        stopwatch.require_same_motion(replace(drive, path=[p + 1.0 for p in drive.path]), True)
    with pytest.raises(StillSceneError, match="0 m/s"):
        stopwatch.require_moving(np.zeros(3), np.zeros(3), OBJECT)
    with pytest.raises(StillSceneError, match="nan"):
        stopwatch.require_moving([np.nan] * 3, [np.nan] * 3, OBJECT)


def test_a_stopwatch_answers_and_tells_errors() -> None:
    with stopwatch.Stopwatch("ours", camera_size=(32, 24)) as ours:
        assert 0 < ours.ask("reset", object_id=OBJECT, count=2) < 5
        assert 0 < ours.ask("swap", object_ids=[OBJECT, "laptop/0001"]) < 5
        with pytest.raises(StopwatchError, match="drawr"):
            ours.ask("reset", object_id="drawr/0004", count=1)
        assert ours.ask("step", mode="pointcloud", object_id=OBJECT, seed=0, steps=2) > 0
        ours._process.kill()
        with pytest.raises(StopwatchError, match="died"):
            ours.ask("reset", object_id=OBJECT, count=1)


def test_an_asset_of_the_twin_comes_back(tmp_path) -> None:
    asset = twin_asset.TwinAsset.load(twin_asset.write(OBJECT, tmp_path))
    joint = catalog.load(OBJECT).joint_of(1)
    assert (asset.object_id, asset.closed, asset.open) == (OBJECT, joint.closed, joint.open)
    assert asset.start[0] < asset.start[1]
    assert asset.is_revolute == (joint.type == "revolute")


def test_without_maniskill_the_error_says_what_to_install(monkeypatch, tmp_path) -> None:
    monkeypatch.setattr(
        env_speed, "importlib", SimpleNamespace(util=SimpleNamespace(find_spec=_none))
    )
    with pytest.raises(MissingDependencyError, match="pip install mani-skill"):
        env_speed.measure(EnvSpeedConfig(out=tmp_path))


def _none(name: str) -> None:
    """No package of this name."""


@pytest.mark.parametrize(
    ("option", "value"), [("pairs", 6), ("steps", 3), ("steps", 1300), ("resets", 0)]
)
def test_options_that_would_say_nothing_are_refused(option: str, value: int) -> None:
    with pytest.raises(InvalidArgumentError, match=option):
        EnvSpeedConfig(**{option: value})


@pytest.mark.slow
def test_the_twin_is_the_same_task(tmp_path) -> None:
    pytest.importorskip("mani_skill", reason="the twin is a ManiSkill environment")
    file = twin_asset.write(OBJECT, tmp_path)
    with stopwatch.Stopwatch("maniskill", assets={OBJECT: str(file)}) as maniskill:
        for mode in ("state", "joints"):
            assert maniskill.ask("step", mode=mode, object_id=OBJECT, seed=0, steps=20) > 0
        assert maniskill.ask("reset", object_id=OBJECT, count=2) > 0
        assert maniskill.ask("swap", object_ids=[OBJECT, OBJECT]) > 0
    seconds, memory = stopwatch.first_reset("maniskill", str(file), tmp_path / "bytecode")
    assert seconds > 0
    assert memory > 100
