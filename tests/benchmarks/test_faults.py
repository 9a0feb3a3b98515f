"""The benchmark that harms runs of shards."""

from __future__ import annotations

import json
import os
import subprocess
import sys

import pytest

from artgym.errors import InvalidArgumentError, MissingDependencyError
from benchmarks import faults
from benchmarks.faults import FaultsConfig


def test_a_small_run(tmp_path, capsys):
    sizes = {"workers": 2, "kills": 2, "faults": 4, "shards": 6, "draws": 2, "timeout": 3}
    arguments = [word for name, size in sizes.items() for word in (f"--{name}", str(size))]
    assert faults.main([*arguments, "--engines", "loky", "--out", str(tmp_path)]) == 0
    assert "loky, 2" in capsys.readouterr().out
    result = json.loads((tmp_path / "faults.json").read_text())
    row = result["rows"]["loky, 2"]
    assert row["problems"] == []
    assert row["kills"] == 2
    assert row["faults"] == dict.fromkeys(faults.FAULTS, 1)
    assert row["slowest"]["seconds"] >= 3
    for name in ("unreadable", "hangs", "failed", "different", "orphans"):
        assert row[name] == 0
    assert row["compared"] >= 3


@pytest.mark.parametrize("work", ["labels", "pictures"])
def test_real_shards(work, tmp_path):
    sizes = {"workers": 2, "kills": 1, "faults": 0, "shards": 3, "timeout": 120}
    arguments = [word for name, size in sizes.items() for word in (f"--{name}", str(size))]
    arguments += ["--work", work, "--engines", "loky", "--out", str(tmp_path)]
    assert faults.main(arguments) == 0
    row = json.loads((tmp_path / f"faults_{work}.json").read_text())["rows"]["loky, 2"]
    assert row["problems"] == []
    assert row["kills"] == 1
    assert row["different"] == 0
    assert row["compared"] >= 2


def test_what_stays_behind_is_found(monkeypatch):
    monkeypatch.setattr(faults, "_FAREWELL", 0.2)
    command = faults._Command("loky", 2, None, [], 1.0)
    script = "import subprocess, sys; subprocess.Popen([sys.executable, '-c', 'input()'])"
    reader, writer = os.pipe()
    env = {**os.environ, faults._MARK: command._mark}
    subprocess.run([sys.executable, "-c", script], stdin=reader, env=env, check=True)
    seconds, orphans = command.farewell()
    assert seconds >= 0.2
    assert [orphan.endswith("input() ") for orphan in orphans] == [True]
    assert command.farewell()[1] == []
    os.close(reader)
    os.close(writer)


@pytest.mark.parametrize(
    "changes", [{"kills": -1}, {"workers": (0,)}, {"engines": ()}, {"timeout": 0.0}]
)
def test_wrong_options(changes):
    with pytest.raises(InvalidArgumentError):
        FaultsConfig(**{"engines": ("loky",), **changes})


def test_an_engine_that_is_not_installed(monkeypatch):
    monkeypatch.setitem(faults._ENGINE_PACKAGES, "ray", "no_such_module")
    with pytest.raises(MissingDependencyError, match="ray is not installed"):
        FaultsConfig()
