"""What the benchmark of imports finds below a folder, and that it names files relative to it."""

from __future__ import annotations

import pytest

from artgym.errors import InvalidArgumentError
from benchmarks.imports import (
    ImportsConfig,
    ImportTask,
    _without_folder,
    found_files,
    imported,
    table_from_objects,
)

URDF = """<robot name="drawer"><link name="case"><collision><geometry><box size="0.3 0.3 0.2"/>
</geometry></collision></link><link name="tray"><collision><origin xyz="0.19 0 0"/><geometry>
<box size="0.06 0.1 0.02"/></geometry></collision></link><joint name="slide" type="prismatic">
<parent link="case"/><child link="tray"/><axis xyz="1 0 0"/><limit lower="0" upper="0.2"/></joint>
</robot>"""


@pytest.fixture
def folder(tmp_path):
    for name, text in (("good", URDF), ("bad", "<robot>")):
        (tmp_path / "given" / name).mkdir(parents=True)
        (tmp_path / "given" / name / "thing.urdf").write_text(text)
    return tmp_path / "given"


def test_a_row_an_object(folder, tmp_path, monkeypatch):
    monkeypatch.setenv("ARTGYM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("ARTGYM_OBJECTS", str(tmp_path / "other"))
    files = found_files(folder)
    assert [f.relative_to(folder).as_posix() for f in files] == [
        "bad/thing.urdf",
        "good/thing.urdf",
    ]
    bad, good = (
        imported(ImportTask(file=file, name=f"object_{i}", keep=tmp_path / "kept"))
        for i, file in enumerate(files)
    )
    assert "not well-formed" in bad["error"]
    assert good["object_id"] == "import/object_1"
    assert good["category"] == "drawer"
    assert good["failed_rules"] == []
    assert good["scene_ms"] < 1000
    rows = _without_folder({"bad/thing.urdf": bad, "good/thing.urdf": good}, folder)
    assert str(folder) not in str(rows)
    assert rows["bad/thing.urdf"]["error"].startswith("bad/thing.urdf")
    for row in rows.values():
        row["opened"] = {"drawer_1": 3}
    assert table_from_objects(rows, 3).row_count == 2


def test_wrong_options(tmp_path):
    for options in ({"folder": tmp_path / "none"}, {"folder": tmp_path, "seeds": 0}):
        with pytest.raises(InvalidArgumentError):
            ImportsConfig(**options)
