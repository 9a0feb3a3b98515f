from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artgym.errors import AssetError
from artgym.objects.partnet import part_names, read_partnet, read_semantics


def box_mesh(low: tuple[float, ...], high: tuple[float, ...]) -> str:
    corners = [
        f"v {x} {y} {z}"
        for x in (low[0], high[0])
        for y in (low[1], high[1])
        for z in (low[2], high[2])
    ]
    faces = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    return "\n".join([*corners, *(f"f {face}" for face in faces)])


def piece(name: str, xyz: str) -> str:
    inner = f'<origin xyz="{xyz}"/><geometry><mesh filename="textured_objs/{name}.obj"/></geometry>'
    return f'<visual name="{name}">{inner}</visual><collision>{inner}</collision>'


# Meshes with y up, as the data have them: the joint of the base turns them.
URDF = """<?xml version="1.0" ?><robot name="partnet_0">
<link name="base"/>
<link name="link_1">{body}</link>
<link name="link_0">{door}</link>
<joint name="joint_1" type="fixed"><origin rpy="1.570796326794897 0 -1.570796326794897"/>
<child link="link_1"/><parent link="base"/></joint>
<joint name="joint_0" type="revolute"><origin xyz="-0.6 0 0.5"/><axis xyz="0 1 0"/>
<child link="link_0"/><parent link="link_1"/><limit lower="-1.5" upper="0.0"/></joint>
</robot>"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A microwave 1.2 wide, 0.8 high and 1 deep, its door towards z of the meshes."""
    monkeypatch.setenv("ARTGYM_CACHE", str(tmp_path / "cache"))
    root = tmp_path / "7119"
    (root / "textured_objs").mkdir(parents=True)
    body = box_mesh((-0.6, -0.4, -0.5), (0.6, 0.4, 0.49))
    (root / "textured_objs" / "body.obj").write_text("mtllib body.mtl\nusemtl m\n" + body)
    (root / "textured_objs" / "body.mtl").write_text("newmtl m\nKd 0.1 0.2 0.3\n")
    (root / "textured_objs" / "door.obj").write_text(box_mesh((-0.6, -0.4, 0.5), (0.6, 0.4, 0.54)))
    (root / "mobility.urdf").write_text(
        URDF.format(body=piece("body", "0 0 0"), door=piece("door", "0.6 0 -0.5"))
    )
    (root / "semantics.txt").write_text("link_0 hinge door\nlink_1 heavy body\n")
    (root / "meta.json").write_text(json.dumps({"model_cat": "Microwave", "anno_id": "7119"}))
    return root


def test_a_microwave(folder: Path) -> None:
    imported = read_partnet(folder)
    obj = imported.object
    assert (obj.object_id, obj.category) == ("7119", "microwave")
    assert obj.part_names == ("body", "door")
    extents = obj.rest_bounds[1] - obj.rest_bounds[0]
    np.testing.assert_allclose(extents, np.array([1.04, 1.2, 0.8]) * 0.5 / 1.2, atol=0.002)
    # The door is at the front, and opens towards it.
    door = obj.links[1]
    assert door.bounds()[0][0] > obj.links[0].bounds()[1][0] - 0.002
    (hinge,) = obj.joints
    assert (hinge.closed, hinge.open) == (0.0, -1.5)
    moved = obj.link_poses([hinge.open])[1] @ (*door.center_of_mass, 1)
    assert moved[0] > door.center_of_mass[0] + 0.1
    assert obj.links[0].visuals[0].material.color == (0.1, 0.2, 0.3)
    assert any("scaled by" in note for note in imported.notes)


def test_options_go_before_what_is_known_of_the_category(folder: Path) -> None:
    big = read_partnet(folder, extent=0.6, turn=0.0, closed={"joint_0": "lower"}).object
    door = big.links[1].bounds()
    assert door[0][0] < -0.2
    assert big.joints[0].closed == -1.5
    assert (big.rest_bounds[1] - big.rest_bounds[0]).max() == pytest.approx(0.6, abs=0.003)
    unscaled = read_partnet(folder, scale=1.0, category="safe", name="x").object
    assert unscaled.category == "safe"
    assert (unscaled.rest_bounds[1] - unscaled.rest_bounds[0]).max() == pytest.approx(1.2, abs=0.01)


def test_the_category_tells_which_end_is_closed(folder: Path) -> None:
    (folder / "meta.json").write_text('{"model_cat": "Box"}')
    text = (folder / "mobility.urdf").read_text()
    (folder / "mobility.urdf").write_text(text.replace('upper="0.0"', 'upper="1.0"'))
    assert read_partnet(folder, closed_rule="nearest").object.joints[0].closed == 1.0
    hinge = read_partnet(folder).object.joints[0]
    assert (hinge.closed, hinge.open) in ((-1.5, 1.0), (1.0, -1.5))


def test_files_that_are_absent_say_nothing(folder: Path) -> None:
    (folder / "semantics.txt").unlink()
    (folder / "meta.json").unlink()
    imported = read_partnet(folder)
    assert imported.object.category == "other"
    assert imported.object.part_names == ("link_1", "link_0")
    assert any("not known" in note for note in imported.notes)
    entries: list[dict[str, Any]] = [
        {"id": 0, "parent": 1, "joint": "hinge", "name": "door"},
        {"id": 1, "parent": -1, "joint": "heavy", "name": "body"},
    ]
    (folder / "mobility_v2.json").write_text(json.dumps(entries))
    assert read_partnet(folder).object.part_names == ("body", "door")
    assert read_semantics(folder).joints == {"link_0": "hinge", "link_1": "heavy"}


def test_part_names_differ() -> None:
    assert part_names({"a": "door", "b": "door", "c": "door_1"}) == {
        "a": "door_1",
        "b": "door_2",
        "c": "door_1_1",
    }
    assert part_names({"a": "b"}, taken={"b"}) == {"a": "b_1"}


@pytest.mark.parametrize(
    ("file", "content", "words"),
    [
        ("semantics.txt", "link_0 door", "semantics"),
        ("semantics.txt", "link_0 hinge ../../x", "line 1"),
        ("semantics.txt", "link_7 hinge door", "link_7"),
        ("semantics.txt", "../x hinge door", "line 1"),
        ("semantics.txt", b"\xff\xfe", "UTF-8"),
        ("meta.json", "{", "JSON"),
        ("meta.json", "[" * 10**5, "JSON"),
        ("meta.json", '{"model_cat": 7}', "model_cat"),
        ("meta.json", '{"model_cat": "../x"}', "model_cat"),
        ("mobility_v2.json", '{"id": 3}', "not a list"),
        ("mobility_v2.json", '[{"id": "x"}]', "entry"),
        ("mobility.urdf", "<robot", "well-formed"),
    ],
)
def test_damaged_files(folder: Path, file: str, content: str | bytes, words: str) -> None:
    if file == "mobility_v2.json":
        (folder / "semantics.txt").unlink()
    (folder / file).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(AssetError, match=words) as caught:
        read_partnet(folder)
    assert file in str(caught.value) or "link_7" in str(content)


def test_no_folder(tmp_path: Path) -> None:
    for name in ("missing", "7119.zip"):
        with pytest.raises(AssetError):
            read_partnet(tmp_path / name)
    (tmp_path / "empty").mkdir()
    with pytest.raises(AssetError, match=r"mobility\.urdf"):
        read_partnet(tmp_path / "empty")


def test_front_turn_is_half_a_turn(folder: Path) -> None:
    turned = read_partnet(folder).object
    assert turned.joints[0].pivot[1] == pytest.approx(
        -read_partnet(folder, turn=0.0).object.joints[0].pivot[1]
    )
    assert math.isclose(abs(turned.joints[0].axis[2]), 1.0)
