"""Result files."""

import json
from pathlib import Path

from benchmarks.record import RESULTS_FOLDER, provenance, write_result


def test_result_is_plain_json(tmp_path):
    path = tmp_path / "deep" / "result.json"
    write_result(
        path, {"nan": float("nan"), "pair": (1, 2), "path": Path("a/b"), "rows": [{"a": 1}] * 200}
    )
    result = json.loads(path.read_text())
    assert result["nan"] is None
    assert result["pair"] == [1, 2]
    assert result["path"] == "a/b"
    assert result["rows"] == [{"a": 1}] * 200
    # A row a line.
    assert path.read_text().count("\n") > 200


def test_paths_in_the_repository_are_told_from_its_root(tmp_path):
    write_result(tmp_path / "result.json", {"out": RESULTS_FOLDER, "elsewhere": tmp_path})
    result = json.loads((tmp_path / "result.json").read_text())
    assert result == {"out": "benchmarks/results", "elsewhere": tmp_path.as_posix()}


def test_provenance_names_command_and_commit(monkeypatch):
    monkeypatch.setattr("sys.argv", ["x.py", "--seed", "1"])
    found = provenance("benchmarks.success_rate")
    assert found["command"] == "python -m benchmarks.success_rate --seed 1"
    assert found["git"] is None or len(found["git"]["commit"]) == 40


def test_a_command_names_no_place_of_one_machine(monkeypatch, tmp_path):
    given = ["table1", "--data", str(tmp_path / "data"), f"--work={tmp_path / 'w'}", "--views", "2"]
    monkeypatch.setattr("sys.argv", ["x.py", *given])
    command = provenance("benchmarks.perception")["command"]
    assert command == "python -m benchmarks.perception table1 --data data --work=w --views 2"
