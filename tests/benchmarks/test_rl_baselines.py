"""The benchmark of learning, on a few steps; and copies as the learner takes them."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from artgym.errors import InvalidArgumentError
from benchmarks.rl_baselines import RlConfig, measure, report
from benchmarks.sb3_copies import Sb3Copies


def test_learns_scores_and_draws(tmp_path):
    config = RlConfig(
        seeds=(0,), steps=320, copies=4, rollout=20, batch=40, epochs=1, layers=(8,), episodes=2,
        workers=0, out=tmp_path,
    )  # fmt: skip
    (table,) = report(config)
    rows = json.loads((tmp_path / "rl_baselines.json").read_text())["rows"]
    row = rows["seed 0"]
    assert row["episodes"] == 2
    assert 0.0 <= row["success"] <= 1.0
    assert (tmp_path / "rl_baselines.png").read_bytes().startswith(b"\x89PNG")
    assert table.row_count == 1
    assert measure(replace(config, resume=True))["rows"] == rows


def test_an_action_is_kept_up_and_an_end_cuts_off():
    copies = Sb3Copies("ArtOpenDrawer-v0", 2, 0, repeat=3, horizon=7)
    copies.reset()
    found = []
    for _ in range(4):
        copies.step_async(np.zeros((2, 7), np.float32))
        _, rewards, over, infos = copies.step_wait()
        found.append(over.tolist())
        assert rewards.shape == (2,)
    # Step 7 is the first of the third action: what follows belongs to the next episode.
    assert found == [[False] * 2, [False] * 2, [True] * 2, [False] * 2]
    assert infos == [{}, {}]
    copies.close()


@pytest.mark.parametrize("options", [{"steps": 0}, {"seeds": ()}, {"repeat": 0}])
def test_bad_options(options):
    with pytest.raises(InvalidArgumentError):
        RlConfig(**options)
