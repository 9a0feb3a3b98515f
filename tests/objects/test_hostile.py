"""Files made to do harm: each gives one error that says where it is wrong, and nothing else."""

from __future__ import annotations

import contextlib
import fcntl
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from artgym.errors import MissingDependencyError
from artgym.objects.collision import CACHE_VARIABLE
from artgym.objects.importing import import_object
from tests.hostile.corpus import CASES, GOOD_OBJ, GOOD_URDF, HostileCase

ROOT = Path(__file__).resolve().parents[2]
#: Processor seconds in which a file must be refused.
MAX_SECONDS = 1.0

EVERY_CASE = pytest.mark.parametrize("case", CASES, ids=lambda c: c.name)


@pytest.fixture(scope="session")
def seen(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, dict[str, Any]]]:
    """What happened in a process that imported every case, and the folder it did so in."""
    pytest.importorskip("mujoco", reason="MJCF cases need mujoco")
    # Processes of one test run share what one of them has done.
    run = os.environ.get("PYTEST_XDIST_TESTRUNUID")
    if run is None:
        root = tmp_path_factory.mktemp("hostile")
        return root, _seen_below(root)
    root = tmp_path_factory.getbasetemp().parent / f"hostile-{run}"
    root.mkdir(exist_ok=True)
    with open(root / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        return root, _seen_below(root)


def _seen_below(root: Path) -> dict[str, dict[str, Any]]:
    if (root / "seen.json").exists():
        return json.loads((root / "seen.json").read_text())
    process = subprocess.run(
        [sys.executable, "-m", "tests.hostile.traced", str(root), str(root / "seen.json")],
        cwd=ROOT,
        env={**os.environ, CACHE_VARIABLE: str(root / "cache")},
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    assert process.returncode == 0, process.stderr[-2000:]
    return json.loads((root / "seen.json").read_text())


def test_there_are_many_cases_of_each_kind() -> None:
    kinds = {kind: sum(c.kind == kind for c in CASES) for kind in {c.kind for c in CASES}}
    assert len(CASES) >= 90
    assert len({c.name for c in CASES}) == len(CASES)
    assert min(kinds.values()) >= 5, kinds


@EVERY_CASE
def test_it_is_refused_with_a_reason(
    case: HostileCase, seen: tuple[Path, dict[str, dict[str, Any]]]
) -> None:
    record = seen[1][case.name]
    assert record["outcome"] == "AssetError", record["message"][:500]
    for word in case.words:
        assert word.lower() in record["message"].lower(), record["message"][:500]
    assert record["file"] in record["message"]
    assert record["remedy"]
    assert record["remedy"] in record["message"]
    assert len(record["message"]) < 1500 + len(record["file"])
    assert record["survives"]


@EVERY_CASE
def test_it_is_refused_at_once(
    case: HostileCase, seen: tuple[Path, dict[str, dict[str, Any]]]
) -> None:
    assert seen[1][case.name]["cpu_seconds"] < MAX_SECONDS


@EVERY_CASE
def test_nothing_outside_is_touched(
    case: HostileCase, seen: tuple[Path, dict[str, dict[str, Any]]]
) -> None:
    root, records = seen
    record = records[case.name]
    assert record["outside"] == []
    assert record["events"] == []
    asset = root / "cases" / case.name / "asset"
    # Our own cache of convex pieces is the one thing that may be written.
    allowed = (f"{asset}/", f"{root}/cache/")
    assert [path for path in record["opened"] if not path.startswith(allowed)] == []


@pytest.mark.parametrize(
    "spoilt",
    [
        # One corner pulled out: the extreme points of the hull lie in one plane.
        GOOD_OBJ.replace(b"v 0.0 0.3 0.3", b"v -1 0.3 0.3"),
        # Corners repeated before the others: every face has an edge with a third one.
        GOOD_OBJ.replace(
            b"v 0.02 0.0 0.0",
            b"v 0.0 0.3 0.0\nv 0.0 0.3 0.3\nv 0.02 0.0 0.0\n" * 2 + b"v 0.02 0.0 0.0",
            1,
        ),
    ],
    ids=["flat start", "crowded edges"],
)
def test_awkward_meshes_that_raised_something_else(
    spoilt: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))
    monkeypatch.setitem(sys.modules, "coacd", None)
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "door.obj").write_bytes(spoilt)
    (tmp_path / "object.urdf").write_text(GOOD_URDF)
    # Either there are pieces, or the mesh must be taken apart by what is not there.
    with contextlib.suppress(MissingDependencyError):
        assert import_object(tmp_path / "object.urdf").object.links[1].shapes
