"""MJCF: what is taken from it, what is refused, and that no file outside the folder is opened."""

from __future__ import annotations

import importlib.util
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from artgym.errors import AssetError, MissingDependencyError
from artgym.objects import catalog, mjcf
from artgym.objects.mjcf import parse_mjcf, read_mjcf
from artgym.objects.mjcf_export import write_mjcf
from artgym.objects.model import Box, Convex, Cylinder

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("mujoco") is None, reason="mujoco is not installed: artgym[mjcf]"
)

BASE = '<geom name="case" type="box" size="0.2 0.3 0.1" pos="0 0 0.1" rgba="1 0 0 1"/>'
DOOR = """<body name="door" pos="0.2 -0.3 0.1">
<joint name="hinge" type="hinge" axis="0 0 1" range="0 90" damping="0.2" frictionloss="0.4"/>
<geom name="panel" type="box" size="0.01 0.3 0.1" pos="0.012 0.3 0" mass="2"/></body>"""
TETRAHEDRON = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ARTGYM_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def write(tmp_path: Path):
    """Writes a model of a world's content and other sections; gives the file."""

    def written(world: str, sections: str = "", name: str = "thing.xml") -> Path:
        folder = tmp_path / "model"
        folder.mkdir(exist_ok=True)
        file = folder / name
        file.write_text(f'<mujoco model="thing">{sections}<worldbody>{world}</worldbody></mujoco>')
        return file

    return written


def body(*content: str) -> str:
    return f'<body name="case">{"".join(content)}</body>'


def test_a_door(write):
    imported = read_mjcf(write(body(BASE, DOOR)), category="microwave", name="x")
    obj = imported.object
    assert obj.object_id, obj.category == ("x", "microwave")
    assert obj.part_names == ("case", "door")
    (joint,) = obj.joints
    assert joint.type == "revolute"
    assert joint.axis == pytest.approx((0, 0, 1))
    assert (joint.closed, joint.open) == pytest.approx((0, math.pi / 2))
    assert (joint.friction, joint.damping) == (0.4, 0.2)
    # The origin is under the middle of case and door together.
    assert joint.pivot[:2] == pytest.approx((0.2 - 0.011, -0.3))
    assert obj.links[1].mass == pytest.approx(2.0)
    (panel,) = obj.links[1].shapes
    assert panel.geometry == Box(half_size=(0.01, 0.3, 0.1))
    assert obj.links[0].shapes[0].material.color == (1, 0, 0)
    assert obj.rest_bounds[:, 2] == pytest.approx((0, 0.2))


@pytest.mark.parametrize("object_id", ["drawer/0003", "laptop/0001", "microwave/0002"])
def test_what_was_exported_comes_back(object_id, tmp_path):
    obj = catalog.load(object_id)
    back = read_mjcf(write_mjcf(obj, tmp_path), category=obj.category).object
    assert back.part_names == obj.part_names
    for mine, theirs in zip(obj.joints, back.joints, strict=True):
        for name in ("type", "closed", "open", "friction", "damping"):
            assert getattr(theirs, name) == pytest.approx(getattr(mine, name)), name
        assert theirs.axis == pytest.approx(mine.axis, abs=1e-6)
    for mine, theirs in zip(obj.links, back.links, strict=True):
        assert theirs.mass == pytest.approx(mine.mass)
        assert np.allclose(theirs.inertia, mine.inertia, rtol=1e-3, atol=1e-6)
        assert np.ptp(theirs.bounds(), axis=0) == pytest.approx(
            np.ptp(mine.bounds(), axis=0), abs=1e-3
        )


@pytest.mark.parametrize(
    ("geom", "kind", "extents"),
    [
        ('type="sphere" size="0.05"', Convex, (0.1, 0.1, 0.1)),
        ('type="ellipsoid" size="0.05 0.03 0.02"', Convex, (0.1, 0.06, 0.04)),
        ('type="capsule" size="0.02 0.05" euler="0 90 0"', Convex, (0.14, 0.04, 0.04)),
        ('type="cylinder" size="0.02 0.05"', Cylinder, (0.04, 0.04, 0.1)),
        ('type="box" size="0.02 0.05 0.01" euler="0 0 90"', Box, (0.1, 0.04, 0.02)),
    ],
)
def test_kinds_of_geoms(write, geom, kind, extents):
    door = DOOR.replace('type="box" size="0.01 0.3 0.1"', geom)
    (shape,) = read_mjcf(write(body(BASE, door))).object.links[1].shapes
    assert isinstance(shape.geometry, kind)
    assert np.ptp(shape.corners_link(), axis=0) == pytest.approx(extents, rel=0.06)


def test_a_mesh_lies_where_the_file_has_it(write):
    sections = """<compiler meshdir="parts"/>
    <asset><mesh name="knob" file="knob.obj" scale="2 2 2" refpos="0.05 0 0"/></asset>"""
    knob = '<geom type="mesh" mesh="knob" pos="0 0 0.3" contype="0" conaffinity="0"/>'
    file = write(body(BASE, DOOR, knob), sections)
    (file.parent / "parts").mkdir()
    (file.parent / "parts" / "knob.obj").write_text(TETRAHEDRON)
    model = parse_mjcf(file)
    (piece,) = (g for link in model.links for g in link.visuals if isinstance(g.shape, tuple))
    assert isinstance(piece.shape, tuple)
    vertices = piece.shape[0].mesh.vertices
    points = vertices @ piece.T_link_shape[:3, :3].T + piece.T_link_shape[:3, 3]
    assert points.min(axis=0) == pytest.approx((-0.1, 0, 0.3), abs=1e-6)
    assert points.max(axis=0) == pytest.approx((0.1, 0.2, 0.5), abs=1e-6)


def test_what_is_seen_and_what_collides(write):
    seen = '<geom name="skin" type="box" size="0.1 0.1 0.1" contype="0" conaffinity="0" group="2"/>'
    model = parse_mjcf(write(body(BASE, DOOR, seen)))
    case = model.links[1]
    # The groups are apart: only what does not collide is seen.
    assert [g.element for g in case.visuals] == ["geom 'skin'"]
    assert [g.element for g in case.collisions] == ["geom 'case'"]
    model = parse_mjcf(write(body(BASE, DOOR, seen.replace('group="2"', ""))))
    assert len(model.links[1].visuals) == 2


def test_planes_free_joints_springs_and_the_rest_are_left_out(write):
    world = '<geom name="floor" type="plane" size="1 1 1"/>' + body(
        '<freejoint name="free"/>', BASE, DOOR.replace("damping", 'stiffness="3" damping')
    )
    sections = """<option timestep="0.1"/><size memory="1000G"/>
    <equality><joint joint1="hinge" polycoef="0 0 0 0 0"/></equality>
    <actuator><motor joint="hinge"/></actuator><sensor><jointpos joint="hinge"/></sensor>"""
    imported = read_mjcf(write(world, sections))
    notes = "\n".join(imported.notes)
    assert "floor': a plane" in notes
    assert "free': free" in notes
    assert "hinge': its spring" in notes
    assert "equality" in notes
    assert len(imported.object.joints) == 1


def test_defaults_and_includes(write):
    file = write(
        body(BASE, DOOR.replace("range", 'class="stiff" range')),
        '<include file="more/defaults.xml"/>',
    )
    (file.parent / "more").mkdir()
    (file.parent / "more" / "defaults.xml").write_text(
        '<mujocoinclude><default><default class="stiff"><joint armature="1" frictionloss="0.7"/>'
        "</default></default></mujocoinclude>"
    )
    obj = read_mjcf(file).object
    assert obj.joints[0].friction == 0.4


@pytest.mark.parametrize(
    ("world", "sections", "mentioned"),
    [
        (body(BASE), "", "nothing moves"),
        (body(BASE, DOOR.replace('type="hinge"', 'type="ball"')), "", "a ball joint"),
        (
            body(BASE, DOOR.replace('type="hinge"', 'type="slide"').replace('range="0 90"', "")),
            "",
            "a slide without limits",
        ),
        (body(BASE, DOOR.replace("mass", "weight")), "", "MuJoCo refuses it"),
        (body(BASE, DOOR.replace("0.01 0.3", "nan 0.3")), "", "thing"),
        (
            body(BASE, DOOR) + "<replicate count='1000000000'><geom size='1'/></replicate>",
            "",
            "replicate",
        ),
        (body(BASE, DOOR) + "<composite type='grid' count='9 9 9'/>", "", "composite"),
        (
            body(BASE, DOOR),
            "<asset><hfield name='h' nrow='9' ncol='9' size='1 1 1 1'/></asset>",
            "hfield 'h': not supported",
        ),
        (body(BASE, DOOR), "<include file='../other.xml'/>", "out of the folder"),
        (body(BASE, DOOR), "<include file='/etc/passwd'/>", "from outside the folder"),
        (body(BASE, DOOR), "<include file='thing.xml'/>", "included twice"),
        (body(BASE, DOOR), "<include file='none.xml'/>", "no such file"),
        (body(BASE, DOOR), "<asset><mesh file='../../x.obj'/></asset>", "out of the folder"),
        (
            body(BASE, DOOR),
            "<compiler meshdir='/usr'/><asset><mesh file='x.obj'/></asset>",
            "from outside the folder",
        ),
        (body(BASE, DOOR), "<asset><mesh name='m'/></asset>", "neither file= nor vertex="),
        (body(*["<geom size='1'/>"] * 2001), "", "more than 2000"),
        (body(*["<body>"] * 230, *["</body>"] * 230), "", "more than 200 elements"),
    ],
)
def test_refused(write, world, sections, mentioned):
    with pytest.raises(AssetError, match=mentioned) as caught:
        read_mjcf(write(world, sections))
    assert "thing.xml" in str(caught.value)


def test_textures_are_read_by_this_package_alone(write):
    sections = """<asset><texture name="t" type="2d" file="wood.png"/>
    <material name="wood" texture="t"/></asset>"""
    file = write(body(BASE, DOOR.replace('name="panel"', 'name="panel" material="wood"')), sections)
    (file.parent / "wood.png").write_bytes(b"\x89PNG no picture")
    with pytest.raises(AssetError, match=r"wood\.png"):
        read_mjcf(file)


def test_not_an_mjcf(tmp_path):
    (tmp_path / "thing.xml").write_text("<robot/>")
    with pytest.raises(AssetError, match="root element is <mujoco>"):
        read_mjcf(tmp_path / "thing.xml")


def test_no_file_of_mujoco_s_own_is_left_behind(write, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(AssetError):
        read_mjcf(write(body(BASE, DOOR.replace('pos="0.012', 'mesh="none" pos="0.012'))))
    assert not (tmp_path / "MUJOCO_LOG.TXT").exists()


def test_without_mujoco(write, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(MissingDependencyError, match=r"artgym\[mjcf\]"):
        read_mjcf(write(body(BASE, DOOR)))


def test_a_reference_position_shifts_the_range(write):
    moved = DOOR.replace('range="0 90"', 'range="10 100" ref="10"')
    (joint,) = read_mjcf(write(body(BASE, moved))).object.joints
    plain = read_mjcf(write(body(BASE, DOOR))).object.joints[0]
    assert replace(joint, name=plain.name).closed == pytest.approx(plain.closed)
    assert joint.open == pytest.approx(plain.open)


def test_an_unlimited_hinge(write):
    imported = read_mjcf(write(body(BASE, DOOR.replace('range="0 90"', ""))))
    assert imported.object.joints[0].range == pytest.approx(2 * mjcf.UNLIMITED)
    assert any("no limits" in note for note in imported.notes)
