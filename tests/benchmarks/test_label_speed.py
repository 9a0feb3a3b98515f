"""Verdicts counted, compared and timed, on very few of them."""

from __future__ import annotations

import dataclasses
import json

import numpy as np
import pytest

from artgym.errors import InvalidArgumentError
from artgym.geometry.grasps import NUM_CANDIDATES
from benchmarks import label_speed, speed
from benchmarks.label_speed import LabelSpeedConfig, kappa, point_tasks

TINY = LabelSpeedConfig(
    category=("drawer", "laptop"),
    objects=1,
    points=2,
    compared=12,
    rejected=20,
    protocol_trials=1,
    workers=1,
)


def protocol(task):
    """In place of a process of many seconds."""
    assert task.urdf.endswith(".urdf")
    return {"process": 8.0, "load": 1.0, "still": 1.0, "pictures": 2.0, "interaction": 1.0}


def test_kappa():
    assert kappa(np.array([[40, 10], [10, 40]])) == pytest.approx(0.6)
    assert kappa(np.array([[0, 5], [5, 0]])) == pytest.approx(-1.0)
    assert np.isnan(kappa(np.array([[9, 0], [0, 0]])))


def test_points_follow_from_the_seed_and_cover_the_parts():
    tasks = point_tasks(TINY)
    assert tasks == point_tasks(TINY)
    assert tasks != point_tasks(dataclasses.replace(TINY, seed=1))
    assert [task.category for task in tasks] == ["drawer"] * 2 + ["laptop"] * 2


def test_everything_is_counted(tmp_path, monkeypatch):
    monkeypatch.setattr(label_speed, "run_protocol", protocol)
    tables = label_speed.report(dataclasses.replace(TINY, out=tmp_path))
    assert [table.row_count for table in tables] == [3, 6]
    result = json.loads((tmp_path / "label_speed.json").read_text())
    assert result["verdicts"] == 4 * NUM_CANDIDATES
    assert result["agreement"]["all"]["compared"] == 12
    assert result["rejects"]["tried"] == 20
    assert result["all"]["verdicts"] == sum(r["verdicts"] for r in result["categories"].values())
    decided = 1 - sum(result["all"]["ends"].values()) / result["verdicts"]
    assert result["all"]["decided_by_filter"] == pytest.approx(decided)
    # Two seconds of the protocol's eight are pictures.
    assert result["times_where2act"] == pytest.approx(6.0 * result["verdicts_a_second"])


def test_bad_options():
    with pytest.raises(InvalidArgumentError, match="compared=0"):
        LabelSpeedConfig(compared=0)
    with pytest.raises(InvalidArgumentError, match="objects"):
        LabelSpeedConfig(objects=10_000)


def test_a_question_that_is_none_of_ours(capsys):
    assert speed.main(["label"]) == 2
    assert "labels" in capsys.readouterr().err
    assert speed.main([]) == 2
