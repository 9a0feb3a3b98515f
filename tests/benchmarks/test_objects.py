"""The benchmark of the catalogue, from the command line to its file."""

import json

import pytest

from artgym.errors import InvalidArgumentError, UnknownNameError
from benchmarks import objects
from benchmarks.objects import ObjectsConfig


def test_a_small_run(tmp_path, capsys, monkeypatch):
    arguments = ["--category", "laptop", "--sound", "2", "--opened", "1", "--workers", "1"]
    assert objects.main([*arguments, "--out", str(tmp_path)]) == 0
    assert "2 of 2" in capsys.readouterr().out
    result = json.loads((tmp_path / "objects.json").read_text())
    row = result["rows"]["laptop"]
    assert row["sound"] == row["same_bytes"] == row["checked"] == 2
    assert row["expert"]["success"] == 1
    assert row["zero"]["success"] == 0
    assert 0 < row["build_ms"]["median"] <= row["build_ms"]["largest"]
    assert row["failures"] == {}
    assert row["git"] is None or len(row["git"]["commit"]) == 40
    # Resumed, what is there is kept and what is not is added.
    monkeypatch.setattr(objects, "measure_category", lambda category, config: row)
    more = ["--category", "drawer", *arguments[2:], "--resume", "--out", str(tmp_path)]
    assert objects.main(more) == 0
    assert list(json.loads((tmp_path / "objects.json").read_text())["rows"]) == ["drawer", "laptop"]


def test_a_broken_object_is_named(monkeypatch):
    monkeypatch.setattr(objects.soundness, "HAND_FORCE", 0.01)
    found = objects.checked("laptop/0000")
    assert [f.split()[1] for f in found["failures"]] == ["opens", "no"]
    assert found["verdicts"]["opens"] is not None


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({"category": ("laptops",)}, UnknownNameError),
        ({"sound": 0}, InvalidArgumentError),
        ({"sound": 1601}, InvalidArgumentError),
        ({"opened": 401, "category": ("laptop",)}, InvalidArgumentError),
    ],
)
def test_wrong_options(changes, error):
    with pytest.raises(error):
        ObjectsConfig(**changes)
