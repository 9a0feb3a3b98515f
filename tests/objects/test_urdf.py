from __future__ import annotations

import math
import pickle
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from artgym.errors import AssetError, InvalidArgumentError, UnknownNameError
from artgym.objects.assembly import (
    Capsule,
    Ellipsoid,
    Imported,
    RawGeometry,
    RawJoint,
    RawLink,
    RawModel,
    object_from_model,
    rest_extent,
)
from artgym.objects.model import Box, Convex, Cylinder
from artgym.objects.urdf import parse_urdf, read_urdf

# A cabinet of 0.4 x 0.6 x 0.8 m about the origin, its front towards -y, with a drawer.
BODY = """<link name="body"><inertial><mass value="12"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="0.8" iyz="0" izz="0.6"/></inertial>
<visual><geometry><box size="0.6 0.4 0.8"/></geometry>
<material name="red"/></visual>
<collision><geometry><box size="0.6 0.4 0.8"/></geometry></collision></link>"""
DRAWER = """<link name="tray"><inertial><origin xyz="0 0.1 0" rpy="0 0 1.5707963267948966"/>
<mass value="2"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.035"/></inertial>
<visual><origin xyz="0 0.1 0"/><geometry><box size="0.5 0.2 0.1"/></geometry></visual>
<collision><origin xyz="0 0.1 0"/><geometry><box size="0.5 0.2 0.1"/></geometry></collision>
</link>"""
SLIDE = """<joint name="slide" type="prismatic"><parent link="body"/><child link="tray"/>
<origin xyz="0 -0.2 0.3"/><axis xyz="0 -2 0"/><limit lower="0" upper="0.3"/></joint>"""
MATERIALS = '<material name="red"><color rgba="1 0 0 1"/></material>'


def robot(*parts: str) -> str:
    return "\n".join(['<robot name="cabinet">', *parts, "</robot>"])


CABINET = robot(MATERIALS, BODY, DRAWER, SLIDE)


def link(name: str, xyz: str = "0 0 0", size: str = "1 1 1") -> str:
    piece = f'<origin xyz="{xyz}"/><geometry><box size="{size}"/></geometry>'
    return f'<link name="{name}"><collision>{piece}</collision></link>'


def joint(
    name: str,
    parent: str,
    child: str,
    kind: str = "revolute",
    more: str = '<axis xyz="0 0 1"/><limit lower="0" upper="1.5"/>',
) -> str:
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{more}</joint>'


Read = Callable[..., Imported]


@pytest.fixture
def read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Read:
    monkeypatch.setenv("ARTGYM_CACHE", str(tmp_path / "cache"))

    def write_and_read(text: str | bytes, **options: Any) -> Imported:
        path = tmp_path / "asset" / "x.urdf"
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return read_urdf(path, **options)

    return write_and_read


def test_a_cabinet(read: Read) -> None:
    imported = read(CABINET, turn=math.pi / 2, category="drawer", name="mine/0001")
    obj = imported.object
    assert (obj.object_id, obj.category) == ("mine/0001", "drawer")
    assert obj.part_names == ("body", "tray")
    np.testing.assert_allclose(obj.rest_bounds, [[-0.2, -0.3, 0.0], [0.2, 0.3, 0.8]], atol=1e-12)
    (slide,) = obj.joints
    assert slide.type == "prismatic"
    np.testing.assert_allclose(slide.axis, (1, 0, 0), atol=1e-12)
    assert (slide.closed, slide.open) == (0.0, 0.3)
    body, tray = obj.links
    assert body.visuals == tray.visuals == ()
    assert body.shapes[0].material.color == (1.0, 0.0, 0.0)
    np.testing.assert_allclose(tray.bounds(), [[0.0, -0.25, 0.65], [0.2, 0.25, 0.75]], atol=1e-12)
    assert tray.mass == 2.0
    np.testing.assert_allclose(tray.center_of_mass, (0.1, 0, 0.7), atol=1e-12)
    # A quarter turn of the inertia's own frame and one of the object.
    np.testing.assert_allclose(tray.inertia, np.diag([0.01, 0.03, 0.035]), atol=1e-12)
    assert any("no friction" in note for note in imported.notes)
    assert (
        obj.content_hash()
        == read(
            CABINET, turn=math.pi / 2, category="drawer", name="mine/0001"
        ).object.content_hash()
    )
    pickle.loads(pickle.dumps(obj))


def test_scale(read: Read) -> None:
    one, half = read(CABINET).object, read(CABINET, scale=0.5).object
    np.testing.assert_allclose(half.rest_bounds, one.rest_bounds / 2, atol=1e-12)
    assert half.joints[0].open == pytest.approx(0.15)
    assert half.links[1].mass == 2.0
    np.testing.assert_allclose(half.links[1].inertia, one.links[1].inertia / 4, atol=1e-12)
    np.testing.assert_allclose(half.joints[0].pivot, np.divide(one.joints[0].pivot, 2), atol=1e-12)


def test_up_and_density(read: Read) -> None:
    obj = read(CABINET, up="-y", density=100.0).object
    extents = obj.rest_bounds[1] - obj.rest_bounds[0]
    np.testing.assert_allclose(extents, (0.6, 0.8, 0.4), atol=1e-12)
    np.testing.assert_allclose(obj.joints[0].axis, (0, 0, 1), atol=1e-12)
    assert obj.links[0].mass == pytest.approx(19.2)


@pytest.mark.parametrize("up", ["+x", "-x", "+y", "-y", "+z", "-z"])
def test_every_axis_can_point_up(read: Read, up: Any) -> None:
    obj = read(
        robot(
            link("a"),
            link("b"),
            joint(
                "j",
                "a",
                "b",
                "prismatic",
                f'<axis xyz="{"1 0 0" if "x" in up else "0 1 0" if "y" in up else "0 0 1"}"/>'
                '<limit lower="0" upper="1"/>',
            ),
        ),
        up=up,
    ).object
    np.testing.assert_allclose(obj.joints[0].axis, (0, 0, -1 if "-" in up else 1), atol=1e-12)


def test_fixed_links_merge_and_masses_add(read: Read) -> None:
    handle = """<link name="handle"><inertial><mass value="2"/><inertia ixx="1e-4" iyy="1e-4"
    izz="1e-4"/></inertial><collision><geometry><sphere radius="0.02"/></geometry></collision>
    </link>"""
    fix = joint("fix", "tray", "handle", "fixed", '<origin xyz="0 -0.02 0"/>')
    world = '<link name="world"/>' + joint("base", "world", "body", "fixed", "")
    imported = read(robot(MATERIALS, world, BODY, DRAWER, SLIDE, handle, fix))
    obj = imported.object
    assert obj.part_names == ("body", "tray")
    tray = obj.links[1]
    assert tray.mass == 4.0
    assert len(tray.shapes) == 2
    # Masses at y = -0.1 and y = -0.22, of 2 kg each; the object's middle is moved by the ball.
    moved = obj.joints[0].pivot[1] + 0.2
    np.testing.assert_allclose(tray.center_of_mass[1] - moved, -0.16, atol=1e-9)
    np.testing.assert_allclose(tray.inertia[2, 2], 0.035 + 1e-4 + 4 * 0.06**2, atol=1e-9)
    assert any("merged: handle" in note for note in imported.notes)
    assert any("merged: world" in note for note in imported.notes)


def test_the_file_and_the_object_move_alike(read: Read) -> None:
    """A chain with turned joint frames, against its forward kinematics."""
    text = robot(
        link("a", "0.1 0.2 0.3", "0.5 0.4 0.3"),
        link("b", "0.4 0 0", "0.6 0.1 0.1"),
        link("c", "0 0.3 0.1", "0.1 0.5 0.1"),
        joint(
            "j",
            "a",
            "b",
            more='<origin xyz="0.3 0 0.2" rpy="0.3 -0.5 1.2"/>'
            '<axis xyz="1 2 -1"/><limit lower="-1.2" upper="-0.2"/>',
        ),
        joint(
            "k",
            "b",
            "c",
            "prismatic",
            '<origin xyz="0.2 0.1 0" rpy="-1 0.4 0.3"/>'
            '<axis xyz="0 1 1"/><limit lower="-0.1" upper="0.5"/>',
        ),
    )
    obj = read(text, closed={"k": "upper"}).object
    j, k = obj.joints
    assert (j.closed, j.open, k.closed, k.open) == (-0.2, -1.2, 0.5, -0.1)

    def rotation(axis: Any, angle: float) -> np.ndarray:
        x, y, z = np.asarray(axis) / np.linalg.norm(axis)
        K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K

    def origin(xyz: Any, rpy: Any) -> np.ndarray:
        T = np.eye(4)
        T[:3, :3] = (
            rotation((0, 0, 1), rpy[2]) @ rotation((0, 1, 0), rpy[1]) @ rotation((1, 0, 0), rpy[0])
        )
        T[:3, 3] = xyz
        return T

    def links_root(q_j: float, q_k: float) -> tuple[np.ndarray, np.ndarray]:
        turn, slide = np.eye(4), np.eye(4)
        turn[:3, :3] = rotation((1, 2, -1), q_j)
        slide[:3, 3] = np.array([0, 1, 1]) / math.sqrt(2) * q_k
        T_a_b = origin((0.3, 0, 0.2), (0.3, -0.5, 1.2)) @ turn
        return T_a_b, T_a_b @ origin((0.2, 0.1, 0), (-1, 0.4, 0.3)) @ slide

    # Where the middle of each link's box goes, up to one shift that is the same for all.
    shift = obj.links[0].bounds().mean(axis=0) - (0.1, 0.2, 0.3)
    for q in ((-0.2, 0.5), (-0.7, 0.1), (-1.2, -0.1)):
        poses = obj.link_poses(list(q))
        for T, shape, middle in zip(
            links_root(*q),
            (obj.links[1].shapes[0], obj.links[2].shapes[0]),
            ((0.4, 0, 0), (0, 0.3, 0.1)),
            strict=True,
        ):
            wanted = (T @ (*middle, 1))[:3] + shift
            part = 1 if shape is obj.links[1].shapes[0] else 2
            found = poses[part] @ (*shape.position, 1)
            np.testing.assert_allclose(found[:3], wanted, atol=1e-9)
    low, high = obj.rest_bounds
    np.testing.assert_allclose((low[0] + high[0], low[1] + high[1], low[2]), 0, atol=1e-9)


@pytest.mark.parametrize(
    ("lower", "upper", "option", "closed", "opened"),
    [
        (0.0, 1.5, None, 0.0, 1.5),
        (-1.5, 0.0, None, 0.0, -1.5),
        (-1.0, 1.0, None, -1.0, 1.0),
        (-0.2, 1.0, None, -0.2, 1.0),
        (-1.0, 0.2, None, 0.2, -1.0),
        (0.5, 1.0, None, 0.5, 1.0),
        (-1.0, -0.5, None, -0.5, -1.0),
        (0.0, 1.5, "upper", 1.5, 0.0),
        (-1.5, 0.0, "lower", -1.5, 0.0),
        (-1.0, 1.0, 0.25, 0.25, -1.0),
    ],
)
def test_closed_and_open(
    read: Read, lower: float, upper: float, option: Any, closed: float, opened: float
) -> None:
    limits = f'<axis xyz="0 0 1"/><limit lower="{lower}" upper="{upper}"/>'
    text = robot(link("a"), link("b", "1 0 0"), joint("j", "a", "b", more=limits))
    imported = read(text, closed=None if option is None else {"j": option})
    (found,) = imported.object.joints
    assert (found.closed, found.open) == (closed, opened)
    assert found.open_fraction(closed) == 0
    noted = any("closed taken" in note for note in imported.notes)
    assert noted == (option is None and closed != 0)


def test_closed_is_where_the_object_is_smallest(read: Read) -> None:
    temples = robot(
        link("frame", size="0.02 0.14 0.04"),
        link("left", "-0.07 0 0", "0.14 0.01 0.01"),
        joint(
            "j",
            "frame",
            "left",
            more='<origin xyz="-0.02 0.07 0"/><axis xyz="0 0 1"/><limit lower="0" upper="1.5708"/>',
        ),
    )
    assert read(temples).object.joints[0].closed == 0
    imported = read(temples, closed_rule="smallest")
    assert imported.object.joints[0].closed == pytest.approx(1.5708)
    assert imported.object.joints[0].open == 0
    assert any("closed taken" in note for note in imported.notes)


def test_rest_extent(read: Read, tmp_path: Path) -> None:
    read(CABINET)
    model = parse_urdf(tmp_path / "asset" / "x.urdf")
    np.testing.assert_allclose(rest_extent(model), (0.6, 0.4, 0.8))


def test_continuous_mimic_and_equal_limits(read: Read) -> None:
    text = robot(
        link("a"),
        link("b", "2 0 0"),
        link("c", "0 2 0"),
        link("d", "0 0 1"),
        joint("j", "a", "b", "continuous", '<axis xyz="0 0 1"/>'),
        joint("k", "a", "c", more='<limit lower="0" upper="1"/><mimic joint="j"/>'),
        joint("l", "a", "d", more='<axis xyz="0 0 1"/><limit lower="0.5" upper="0.5"/>'),
    )
    imported = read(text)
    j, k = imported.object.joints
    assert (j.closed, j.open) == (-math.pi, math.pi)
    assert k.axis == (1, 0, 0)
    notes = " ".join(imported.notes)
    for words in ("continuous", "mimic: left out", "no <axis>", "taken as fixed"):
        assert words in notes


def test_friction_holds_what_gravity_pulls(read: Read) -> None:
    lid = robot(
        link("a", "0 0 -0.2", "0.4 0.4 0.1"),
        link("lid", "0.2 0 0", "0.4 0.4 0.02"),
        joint(
            "j",
            "a",
            "lid",
            more='<origin xyz="-0.2 0 0"/><axis xyz="0 -1 0"/><limit lower="0" upper="2"/>',
        ),
    )
    obj = read(lid).object
    assert obj.joints[0].friction > 1.4 * obj.links[1].mass * 9.81 * 0.2
    given = lid.replace("<limit", '<dynamics damping="0.25" friction="0"/><limit')
    stated = read(given).object.joints[0]
    assert (stated.friction, stated.damping) == (0.0, 0.25)
    shelf = lid.replace('"revolute"', '"prismatic"').replace('"0 -1 0"', '"0 0 1"')
    obj = read(shelf).object
    assert obj.joints[0].friction > 1.4 * obj.links[1].mass * 9.81


def test_inertia_that_no_body_of_this_size_has(read: Read) -> None:
    imported = read(CABINET.replace('ixx="1"', 'ixx="900"').replace('iyy="0.8"', 'iyy="900"'))
    assert imported.object.links[0].inertia[0, 0] == pytest.approx(12 * (0.16 + 0.64) / 12)
    assert any("computed from the shapes" in note for note in imported.notes)


def test_inertia_slightly_off_is_accepted(read: Read) -> None:
    text = CABINET.replace('izz="0.035"', 'izz="0.04001"')
    moments = np.linalg.eigvalsh(read(text).object.links[1].inertia)
    assert moments[2] <= moments[0] + moments[1]


def test_forms(read: Read, tmp_path: Path) -> None:
    (tmp_path / "asset").mkdir()
    corners = [f"v {x} {y} {z}" for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    faces = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    mesh = "\n".join([*corners, *(f"f {face}" for face in faces)])
    (tmp_path / "asset" / "cube.obj").write_text(mesh)

    def piece(form: str, x: int) -> str:
        inner = f'<origin xyz="{x} 0 0"/><geometry>{form}</geometry>'
        return f"<visual>{inner}</visual><collision>{inner}</collision>"

    forms = piece('<cylinder radius="0.1" length="0.8"/>', 1)
    forms += piece('<sphere radius="0.2"/>', 2)
    forms += piece('<mesh filename="package://me/cube.obj" scale="0.2 0.3 -0.4"/>', 3)
    obj = read(robot(f'<link name="a">{forms}</link>', link("b"), joint("j", "a", "b"))).object
    cylinder, ball, cube = (s.geometry for s in obj.links[0].shapes)
    assert isinstance(cylinder, Cylinder)
    axis = np.asarray(obj.links[0].shapes[0].rotation)[:, 0]
    np.testing.assert_allclose(np.abs(axis), (0, 0, 1))
    assert (cylinder.radius, cylinder.half_length) == (0.1, 0.4)
    assert isinstance(ball, Convex)
    assert ball.volume == pytest.approx(4 / 3 * math.pi * 0.2**3, rel=0.05)
    assert isinstance(cube, Convex)
    assert cube.volume == pytest.approx(0.2 * 0.3 * 0.4, rel=0.02)
    # One look for all three, with the outside outside.
    (visual,) = obj.links[0].visuals
    a, b, c = visual.mesh.vertices[visual.mesh.faces].swapaxes(0, 1)
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    assert volume == pytest.approx(0.024 + 0.8 * math.pi * 0.01 + ball.volume, rel=0.02)


def test_what_is_only_seen_can_collide(read: Read) -> None:
    knob = """<visual><origin xyz="0 -0.03 0"/><geometry><box size="0.03 0.04 0.03"/></geometry>
    </visual></link>"""
    text = robot(MATERIALS, BODY, DRAWER.replace("</link>", knob), SLIDE)
    imported = read(text)
    assert len(imported.object.links[1].shapes) == 1
    assert len(imported.object.links[1].visuals) == 1
    assert any('solid="visual"' in note for note in imported.notes)
    solid = read(text, solid="visual")
    assert len(solid.object.links[1].shapes) == 2
    assert solid.object.links[1].visuals == ()
    bare = robot(BODY.replace("collision>", "visual>"), DRAWER, SLIDE)
    assert any("what is seen collides" in note for note in read(bare).notes)


def test_elements_of_other_namespaces_are_passed_over(read: Read) -> None:
    text = CABINET.replace("<robot", '<robot xmlns:drake="http://drake.mit.edu"')
    text = text.replace("</collision>", "<drake:proximity_properties/></collision>")
    assert read(text).object == read(CABINET).object


def test_links_that_nobody_sees(read: Read) -> None:
    frame = '<link name="frame"/>' + joint("k", "tray", "frame")
    imported = read(robot(BODY, DRAWER, SLIDE, frame))
    assert imported.object.part_names == ("body", "tray")
    assert any("dropped" in note for note in imported.notes)


def test_a_transparent_piece_is_left_out(read: Read) -> None:
    glass = '<material name="g"><color rgba="0 0 0 0"/></material></visual>'
    text = robot(BODY, DRAWER.replace("</visual>", glass), SLIDE)
    assert any("transparent" in note for note in read(text).notes)


def test_a_model_built_by_hand() -> None:
    ball = RawGeometry(shape=Ellipsoid(half_size=(0.1, 0.2, 0.3)), element="geom 0")
    rod = RawGeometry(shape=Capsule(radius=0.05, half_length=0.2), element="geom 1", role="handle")
    box = RawGeometry(shape=Box(half_size=(0.5, 0.5, 0.5)), element="geom 2")
    model = RawModel(
        name="hand-made",
        file="nowhere.xml",
        links=(RawLink(name="a", collisions=(box,)), RawLink(name="b", collisions=(ball, rod))),
        joints=(
            RawJoint(
                name="j",
                type="revolute",
                parent="a",
                child="b",
                pivot=(0.0, 1.0, 0.0),
                axis=(0.0, 0.0, 1.0),
                upper=1.0,
            ),
        ),
    )
    obj = object_from_model(model).object
    volumes = [s.geometry.volume for s in obj.links[1].shapes]
    assert volumes[0] == pytest.approx(4 / 3 * math.pi * 0.006, rel=0.05)
    capsule = math.pi * 0.05**2 * 0.4 + 4 / 3 * math.pi * 0.05**3
    assert volumes[1] == pytest.approx(capsule, rel=0.08)
    assert obj.links[1].shapes[1].role == "handle"
    assert obj.joints[0].pivot[1] - obj.links[0].bounds().mean(axis=0)[1] == pytest.approx(1.0)


def test_arguments_out_of_range(read: Read) -> None:
    for options in (
        {"scale": 0.0},
        {"scale": math.nan},
        {"scale": -1.0},
        {"turn": math.inf},
        {"density": 0.0},
        {"closed_rule": "farthest"},
        {"solid": "none"},
        {"up": "z"},
        {"closed": {"slide": 0.5}},
        {"closed": {"slide": math.nan}},
        {"part_names": {"tray": "body"}},
    ):
        with pytest.raises(InvalidArgumentError, match=next(iter(options))):
            read(CABINET, **options)
    for options in (
        {"closed": {"hinge": "upper"}},
        {"closed": {"slide": "ajar"}},
        {"part_names": {"lid": "x"}},
    ):
        with pytest.raises(UnknownNameError):
            read(CABINET, **options)


# (what the cabinet becomes, words of the message)
_MASS = 'mass value="2"'
_DEEP = "<link>" * 5000
_BOMB = "<!DOCTYPE a [<!ENTITY b0 'x'>" + "".join(
    f"<!ENTITY b{i + 1} '&b{i};&b{i};&b{i};&b{i};&b{i};&b{i};&b{i};&b{i};&b{i};&b{i};'>"
    for i in range(12)
)
HOSTILE: list[tuple[str, str | bytes, str]] = [
    ("empty", b" ", "not well-formed"),
    ("not xml", b"\x7fELF" * 100, "not"),
    ("truncated", CABINET[: len(CABINET) // 2], "not well-formed"),
    ("latin 1", CABINET.replace("cabinet", "cof\xe9").encode("latin-1"), "not UTF-8"),
    ("utf 16", CABINET.encode("utf-16"), "not UTF-8"),
    ("utf 16 without a mark", CABINET.encode("utf-16-le"), "other than UTF-8"),
    ("declared latin 1", '<?xml version="1.0" encoding="latin-1"?>' + CABINET, "UTF-8"),
    ("declared utf 7", "<?xml version='1.0' encoding='utf-7'?>" + CABINET, "UTF-8"),
    ("bomb", _BOMB + "]><robot>&b12;</robot>", "document type"),
    ("entity", '<!DOCTYPE r [<!ENTITY e SYSTEM "file:///etc/passwd">]><robot>&e;</robot>', "type"),
    ("dtd", '<!DOCTYPE robot SYSTEM "http://example.org/x.dtd">' + CABINET, "document type"),
    ("deep", "<robot>" + _DEEP, "levels of elements"),
    ("many", "<robot>" + "<a/>" * 200_000 + "</robot>", "elements"),
    ("twice", CABINET.replace(_MASS, _MASS + ' value="3"'), "duplicate attribute"),
    ("sdf", "<sdf/>", "root is not <robot>"),
    (
        "xacro",
        CABINET.replace("<robot", '<robot xmlns:xacro="http://ros.org/wiki/xacro"').replace(
            "</robot>", '<xacro:macro name="x"/></robot>'
        ),
        "Run xacro",
    ),
    ("misspelt", CABINET.replace("collision>", "kollision>"), "unknown element <kollision>"),
    ("nothing", robot(), "no links"),
    ("mass nan", CABINET.replace(_MASS, 'mass value="nan"'), "link 'tray' inertial mass"),
    ("mass zero", CABINET.replace(_MASS, 'mass value="0"'), "not above zero"),
    ("mass negative", CABINET.replace(_MASS, 'mass value="-1"'), "not above zero"),
    ("mass inf", CABINET.replace(_MASS, 'mass value="1e999"'), "not a finite number"),
    ("mass huge", CABINET.replace(_MASS, 'mass value="1e30"'), "100000 kg"),
    ("mass missing", CABINET.replace(f"<{_MASS}/>", ""), "no <mass>"),
    ("mass word", CABINET.replace(_MASS, 'mass value="two"'), "not a finite number"),
    ("mass comma", CABINET.replace(_MASS, 'mass value="2,5"'), "not a finite number"),
    ("mass underscore", CABINET.replace(_MASS, 'mass value="2_5"'), "not a finite number"),
    ("mass long", CABINET.replace(_MASS, f'mass value="{"9" * 10**6}"'), "not a finite number"),
    ("inertia nan", CABINET.replace('ixx="0.01"', 'ixx="nan"'), "not a finite number"),
    ("inertia negative", CABINET.replace('ixx="0.01"', 'ixx="-1"'), "not positive"),
    (
        "inertia zero",
        CABINET.replace('ixx="0.01"', 'ixx="0"')
        .replace('iyy="0.03"', 'iyy="0"')
        .replace('izz="0.035"', 'izz="0"'),
        "not positive",
    ),
    ("inertia triangle", CABINET.replace('izz="0.035"', 'izz="0.05"'), "exceeds the sum"),
    ("inertia missing", CABINET.replace('ixx="0.01"', ""), "no attribute 'ixx'"),
    ("axis zero", CABINET.replace("0 -2 0", "0 0 0"), "without direction"),
    ("axis nan", CABINET.replace("0 -2 0", "nan 0 0"), "not 3 finite numbers"),
    ("axis short", CABINET.replace("0 -2 0", "0 1"), "not 3 finite numbers"),
    ("axis long", CABINET.replace("0 -2 0", "0 1 0 0"), "not 3 finite numbers"),
    ("limit nan", CABINET.replace('upper="0.3"', 'upper="nan"'), "joint 'slide' limit"),
    ("limit swapped", CABINET.replace('upper="0.3"', 'upper="-0.3"'), "lower limit above"),
    ("limit missing", CABINET.replace('<limit lower="0" upper="0.3"/>', ""), "no <limit>"),
    ("limit empty", CABINET.replace('lower="0" upper="0.3"', ""), "neither lower"),
    (
        "limit turns",
        robot(link("a"), link("b"), joint("j", "a", "b", more='<limit lower="0" upper="90"/>')),
        "beyond two turns",
    ),
    (
        "friction negative",
        CABINET.replace("<limit", '<dynamics friction="-1"/><limit'),
        "friction that is negative",
    ),
    ("damping nan", CABINET.replace("<limit", '<dynamics damping="nan"/><limit'), "finite"),
    ("limit far", CABINET.replace('upper="0.3"', 'upper="1e5"'), "a slide of more than"),
    (
        "mimic nobody",
        CABINET.replace("<limit", '<mimic joint="hinge"/><limit'),
        "follows no other joint",
    ),
    ("mimic itself", CABINET.replace("<limit", '<mimic joint="slide"/><limit'), "follows no other"),
    ("floating", CABINET.replace('type="prismatic"', 'type="floating"'), "type.*floating"),
    ("planar", CABINET.replace('type="prismatic"', 'type="planar"'), "planar"),
    ("no type", CABINET.replace('type="prismatic"', ""), "no attribute 'type'"),
    ("no child", CABINET.replace('<child link="tray"/>', ""), "no <child>"),
    ("unknown child", CABINET.replace('child link="tray"', 'child link="lid"'), "no link"),
    ("size zero", CABINET.replace("0.5 0.2 0.1", "0.5 0 0.1"), "not above zero"),
    ("size negative", CABINET.replace("0.5 0.2 0.1", "0.5 -1 0.1"), "not above zero"),
    ("size tiny", CABINET.replace("0.5 0.2 0.1", "0.5 1e-9 0.1"), "within"),
    ("size huge", CABINET.replace("0.5 0.2 0.1", "0.5 1e9 0.1"), "within"),
    ("large", CABINET.replace("0.5 0.2 0.1", "0.5 900 0.1"), "largest extent"),
    ("origin nan", CABINET.replace('xyz="0 0.1 0"', 'xyz="nan 0 0"'), "finite"),
    ("origin far", CABINET.replace('xyz="0 -0.2 0.3"', 'xyz="1e12 0 0"'), "far outside"),
    ("rpy inf", CABINET.replace('xyz="0 -0.2 0.3"', 'rpy="inf 0 0"'), "finite"),
    (
        "two origins",
        CABINET.replace("<collision>", '<collision><origin xyz="0 0 0"/><origin/>'),
        "elements <origin>",
    ),
    (
        "two forms",
        CABINET.replace("<geometry>", '<geometry><sphere radius="1"/>'),
        "not one known form",
    ),
    ("no form", CABINET.replace('<box size="0.5 0.2 0.1"/>', ""), "not one known form"),
    ("colour", CABINET.replace('rgba="1 0 0 1"', 'rgba="255 0 0 1"'), "outside 0 to 1"),
    ("robot name", CABINET.replace('name="cabinet"', f'name="{"x" * 1000}"'), "no name"),
    ("names", CABINET.replace('"tray"', '"body"'), "same name|already"),
    ("name missing", CABINET.replace('<link name="tray">', "<link>"), "no attribute 'name'"),
    ("name odd", CABINET.replace('"tray"', '"tr&#10;ay"'), "no name"),
    (
        "joint names",
        robot(link("a"), link("b"), link("c"), joint("j", "a", "b"), joint("j", "a", "c")),
        "two joints have the same name",
    ),
    ("two roots", CABINET.replace("</robot>", '<link name="other"/></robot>'), "more than one"),
    ("ring", robot(link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "a")), "no root"),
    (
        "ring aside",
        robot(link("r"), link("a"), link("b"), joint("j", "a", "b"), joint("k", "b", "a")),
        "ring",
    ),
    ("self", robot(link("r"), link("a"), joint("j", "a", "a")), "ring"),
    (
        "two parents",
        robot(
            link("a"),
            link("b"),
            link("c"),
            joint("j", "a", "c"),
            joint("k", "b", "c"),
            joint("l", "a", "b"),
        ),
        "already hangs",
    ),
    ("still", robot(link("a"), link("b"), joint("j", "a", "b", "fixed", "")), "nothing moves"),
    ("empty base", robot('<link name="w"/>', link("b"), joint("j", "w", "b")), "base has no"),
    (
        "series",
        robot(link("a"), '<link name="x"/>', link("b"), joint("j", "a", "x"), joint("k", "x", "b")),
        "nothing lies between it and joint 'k'",
    ),
    ("many links", robot(*(link(f"l{i}") for i in range(201))), "more than 200 links"),
    (
        "many pieces",
        robot(
            '<link name="a">',
            '<visual><geometry><sphere radius="1"/></geometry></visual>' * 2001,
            "</link>",
        ),
        "more than 2000",
    ),
    (
        "mesh outside",
        CABINET.replace('<box size="0.5 0.2 0.1"/>', '<mesh filename="../a.obj"/>'),
        "leads out",
    ),
    (
        "mesh missing",
        CABINET.replace('<box size="0.5 0.2 0.1"/>', '<mesh filename="a.obj"/>'),
        "no such file",
    ),
    (
        "mesh scale",
        CABINET.replace('<box size="0.5 0.2 0.1"/>', '<mesh filename="x.urdf" scale="0 1 1"/>'),
        "zero",
    ),
    (
        "mesh kind",
        CABINET.replace('<box size="0.5 0.2 0.1"/>', '<mesh filename="x.urdf"/>'),
        "not a mesh format",
    ),
    (
        "picture outside",
        CABINET.replace('<color rgba="1 0 0 1"/>', '<texture filename="/etc/passwd"/>'),
        "outside",
    ),
]


@pytest.mark.parametrize(
    ("text", "words"), [case[1:] for case in HOSTILE], ids=[case[0] for case in HOSTILE]
)
def test_hostile_files_are_refused_quickly(read: Read, text: str | bytes, words: str) -> None:
    assert text != CABINET
    start = time.monotonic()
    with pytest.raises(AssetError, match=f"(?s){words}") as caught:
        read(text)
    assert time.monotonic() - start < 2
    assert caught.value.remedy
    assert "x.urdf" in str(caught.value) or "/asset" in str(caught.value)


def test_an_archive_is_named(tmp_path: Path) -> None:
    with pytest.raises(AssetError, match="Unpack it first"):
        read_urdf(tmp_path / "object.zip")
    with pytest.raises(AssetError, match="Unpack it first"):
        read_urdf(tmp_path / "object.zip" / "x.urdf")


def test_a_package_reaches_meshes_beside_the_urdf(tmp_path: Path) -> None:
    (tmp_path / "urdf").mkdir()
    (tmp_path / "urdf" / "x.urdf").write_text(
        CABINET.replace('<box size="0.5 0.2 0.1"/>', '<mesh filename="package://me/meshes/t.obj"/>')
    )
    with pytest.raises(AssetError, match="no such file"):
        parse_urdf(tmp_path / "urdf" / "x.urdf")
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "t.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3 4\n")
    model = parse_urdf(tmp_path / "urdf" / "x.urdf", root=tmp_path)
    assert isinstance(model.links[1].visuals[0].shape, tuple)
    with pytest.raises(AssetError, match="leads out"):
        parse_urdf(tmp_path / "urdf" / "x.urdf", root=tmp_path / "meshes")
