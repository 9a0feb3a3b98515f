"""The benchmark of solvability, on one object a row."""

from __future__ import annotations

import json

import pytest

from artgym.errors import DamagedFileError, UnknownNameError
from benchmarks.solvability import SolvabilityConfig, measure, report


def config(tmp_path, **options):
    return SolvabilityConfig(
        **{"category": ("drawer",), "objects": 1, "workers": 1, "out": tmp_path, **options}
    )


def test_rows(tmp_path):
    (table,) = report(config(tmp_path, policy=("expert", "zero")))
    rows = json.loads((tmp_path / "solvability.json").read_text())["rows"]
    assert set(rows) == {"ArtOpen-v0 hand drawer", "ArtOpen-v0 panda drawer"}
    for row in rows.values():
        assert row["expert"]["success"] == 1.0
        assert row["zero"]["success"] == 0.0
        assert row["not_solved"] == []
    assert table.row_count == 2


def test_finished_rows_are_kept(tmp_path):
    options = {"policy": ("zero",), "robot": ("hand",)}
    first = measure(config(tmp_path, **options))
    again = measure(config(tmp_path, **options, resume=True, env_id=("ArtOpen-v0", "ArtClose-v0")))
    assert set(again["rows"]) == {"ArtOpen-v0 hand drawer", "ArtClose-v0 hand drawer"}
    name = "ArtOpen-v0 hand drawer"
    assert again["rows"][name]["date"] == first["rows"][name]["date"]
    (tmp_path / "solvability.json").write_text("{")
    with pytest.raises(DamagedFileError, match="without --resume"):
        measure(config(tmp_path, **options, resume=True))


def test_bad_options(tmp_path):
    for options, nearest in [
        ({"env_id": ("ArtOpen",)}, "ArtOpen-v0"),
        ({"policy": ("experts",)}, "expert"),
        ({"category": ("draw",)}, "drawer"),
    ]:
        with pytest.raises(UnknownNameError, match=nearest):
            config(tmp_path, **options)
