"""The comparison of exported objects with ours, on one of them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from benchmarks import exports
from benchmarks.exports import ExportsConfig, ExportTask


def test_one_object_is_the_same_everywhere(tmp_path: Path) -> None:
    pytest.importorskip("mujoco", reason="the benchmark compares with mujoco")
    pytest.importorskip("yourdfpy", reason="the benchmark compares with yourdfpy")
    config = ExportsConfig(category=("laptop",), objects=1, workers=1, out=tmp_path)
    (table,) = exports.report(config)
    assert table.row_count == 2
    (row,) = json.loads((tmp_path / "exports.json").read_text())["rows"].values()
    assert row["comes_back"] == 1
    for loader in row["loaders"].values():
        assert loader["same"] == 1
        assert loader["poses"] < 1e-9
    assert row["alone_joints"] < exports.SAME


def test_a_difference_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco", reason="the benchmark compares with mujoco")
    pytest.importorskip("yourdfpy", reason="the benchmark compares with yourdfpy")
    wrong = exports.link_origins
    monkeypatch.setattr(
        exports, "link_origins", lambda obj: {k: v + 0.01 for k, v in wrong(obj).items()}
    )
    found = exports.examine(ExportTask("laptop/0000", 2))
    assert all(loader.poses > 0.005 for loader in found.loaders.values())
