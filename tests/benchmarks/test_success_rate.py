"""The benchmark from the command line to its file."""

import json
from dataclasses import asdict

import imageio.v3 as iio
import numpy as np
import pytest

from artgym.errors import InvalidArgumentError, RendererUnavailableError
from benchmarks import success_rate
from benchmarks.episodes import episode_tasks, run_episode, run_in_worker
from benchmarks.parallel import results_in_order
from icaf4_policy.checkpoint import save_model
from icaf4_policy.model import Icaf4, ModelConfig

STILL_POLICY = """
import numpy as np

class Still:
    obs_mode = "state"
    def reset(self, seed): self.seed = seed
    def act(self, observation): return np.zeros(7, dtype=np.float32)
"""


def tasks(policy="zero", objects=2, seed=0):
    return episode_tasks(policy, "drawer", "test", objects, 1, seed=seed, weights=None)


def without_seconds(record):
    return {name: value for name, value in asdict(record).items() if name != "seconds"}


def arguments(tmp_path, *more):
    return [
        "--category",
        "drawer",
        "--objects",
        "1",
        "--workers",
        "1",
        "--out",
        str(tmp_path),
        *more,
    ]


def test_policies_share_episodes_but_not_random_numbers():
    zero, random = tasks("zero"), tasks("random")
    assert [(t.object_id, t.seed) for t in zero] == [(t.object_id, t.seed) for t in random]
    assert len({t.seed for t in zero} | {t.policy_seed for t in zero}) == 4
    assert tasks(seed=1)[0].seed != zero[0].seed


def test_zero_action_moves_nothing():
    record = run_episode(tasks(objects=1)[0])
    assert record.travel == pytest.approx(0, abs=0.01)
    assert not record.success
    assert record.steps == 300


def test_records_do_not_depend_on_the_number_of_workers():
    results = [
        results_in_order(run_in_worker, tasks("random"), workers=n, description="", unit="episode")
        for n in (1, 2)
    ]
    alone, together = ([without_seconds(r) for r in records] for records in results)
    assert alone == together
    assert [r["object_id"] for r in alone] == ["drawer/1200", "drawer/1201"]


def test_result_says_how_it_was_made(tmp_path, monkeypatch, capsys):
    (tmp_path / "still_policy.py").write_text(STILL_POLICY)
    monkeypatch.syspath_prepend(tmp_path)
    assert success_rate.main(arguments(tmp_path, "--policy", "zero", "still_policy:Still")) == 0
    assert "still_policy:Still" in capsys.readouterr().out
    result = json.loads((tmp_path / "success_rate.json").read_text())
    assert set(result) == {
        "command",
        "date",
        "git",
        "versions",
        "hardware",
        "config",
        "objects",
        "seconds",
        "rows",
        "episodes",
    }
    assert result["objects"] == {"drawer": ["drawer/1200"]}
    assert result["config"]["seed"] == 0
    assert set(result["hardware"]) == {"cpu", "cores", "memory_gib"}
    assert result["versions"]["numpy"] == np.__version__
    zero, still = result["episodes"]
    assert zero["seed"] == still["seed"]
    assert zero["travel"] == still["travel"]
    assert set(result["rows"]["drawer"]) == {"zero", "still_policy:Still"}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"policy": ("zeros",)}, "Nearest: 'zero'"),
        ({"policy": ("zero", "zero")}, "expected different names"),
        ({"episodes": 0}, "episodes=0"),
        ({"workers": 0}, "workers=0"),
        ({"seed": -1}, "seed=-1"),
        ({"objects": 4000}, "count=4000"),
        ({"category": ("lapto",)}, "Nearest: 'laptop'"),
    ],
)
def test_bad_arguments_are_named(changes, message):
    with pytest.raises(InvalidArgumentError, match=message):
        success_rate.SuccessRateConfig(**changes)


def test_bad_command_line_is_answered(tmp_path, capsys):
    with pytest.raises(SystemExit) as caught:
        success_rate.main(arguments(tmp_path, "--policy", "exprt"))
    assert caught.value.code == 2
    assert "Nearest: 'expert'" in capsys.readouterr().err


def test_without_a_renderer_nothing_runs(tmp_path, monkeypatch, capsys):
    def refuse():
        raise RendererUnavailableError("no device here can render")

    def fail(*_, **__):
        raise AssertionError("episodes were run")

    monkeypatch.setattr(success_rate, "find_device", refuse)
    monkeypatch.setattr(success_rate, "results_in_order", fail)
    assert success_rate.main(arguments(tmp_path, "--policy", "zero", "icaf4")) == 1
    assert "no device here can render" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_network_is_scored_shown_and_filmed(tmp_path, render_system):
    model = Icaf4(ModelConfig(categories=("drawer",), num_parts=2, length_units=(0.2,)))
    save_model(tmp_path / "drawer.safetensors", model, {})
    more = ("--policy", "icaf4", "--weights", str(tmp_path))
    assert success_rate.main(arguments(tmp_path, *more)) == 0
    assert (tmp_path / "perception.png").read_bytes().startswith(b"\x89PNG")
    assert iio.improps(tmp_path / "episode.mp4", plugin="FFMPEG").shape[1:] == (360, 480, 3)
    result = json.loads((tmp_path / "success_rate.json").read_text())
    assert [task["seed"] for task in result["shown"]] == [result["episodes"][0]["seed"]]
