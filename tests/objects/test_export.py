"""Objects that leave: other programs see what we see, and what comes back is what left."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from numpy.typing import NDArray

from artgym.cli import main
from artgym.errors import AssetError, InvalidArgumentError
from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.objects import catalog
from artgym.objects.contents import Image, TriangleMesh
from artgym.objects.mjcf_export import write_mjcf
from artgym.objects.model import ArticulatedObject, Box, Joint, Link, Material, Shape, Visual
from artgym.objects.urdf import read_urdf
from artgym.objects.urdf_export import (
    description_folder,
    link_origins,
    rpy_from_matrix,
    write_urdf,
)

Array = NDArray[np.floating]

CATEGORIES = list(catalog.CATEGORIES)
#: Metres, and entries of rotations: the two programs compute in double precision.
POSE_TOLERANCE = 1e-5


def awkward() -> ArticulatedObject:
    """What no generator makes: slanted axes, a chain, ends away from zero, a picture, a sheet."""
    grey = Material(color=(0.2, 0.4, 0.6), roughness=0.3, metallic=0.5)
    rng = np.random.default_rng(5)
    turned = tuple(map(tuple, matrix_from_axis_angle([0.3, np.pi / 2, -0.4]).tolist()))
    box = Shape(geometry=Box(half_size=(0.1, 0.06, 0.04)), position=(0.0, 0.0, 0.1), material=grey)
    slanted = replace(box, position=(0.05, 0.1, 0.2), rotation=turned, role="handle")
    sheet = TriangleMesh(
        [[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0.1, 0.1, 0]],
        [[0, 1, 2], [1, 3, 2]],
        [[0, 0], [1, 0], [0, 1], [1, 1]],
    )
    picture = Image(rng.integers(0, 256, (8, 6, 3)))
    visuals = (
        Visual(mesh=sheet, material=replace(grey, texture=picture)),
        Visual(mesh=TriangleMesh(sheet.vertices, sheet.faces), material=grey),
    )
    axis = np.array([0.2, -0.5, 0.7])
    axis = tuple((axis / np.linalg.norm(axis)).tolist())
    joint = Joint(
        name="turn", type="revolute", parent="base", child="arm", axis=axis,
        pivot=(0.03, 0.05, 0.11), closed=0.4, open=-1.1, friction=0.2, damping=0.03,
    )  # fmt: skip
    slide = Joint(
        name="slide", type="prismatic", parent="arm", child="tray", axis=(-1.0, 0.0, 0.0),
        pivot=(0.3, -0.2, 0.1), closed=-0.02, open=0.25, friction=1.0, damping=4.0,
    )  # fmt: skip
    return ArticulatedObject(
        object_id="odd/0001",
        category="other",
        links=(
            Link(name="base", shapes=(box,), visuals=visuals, friction=0.3),
            Link(name="arm", shapes=(slanted,), density=333.0),
            Link(name="tray", shapes=(box, slanted), density=250.0),
        ),
        joints=(joint, slide),
        attributes={"family": "odd", "handle": "bar", "size": 0.5},
    )


OBJECT_IDS = [f"{category}/{number:04d}" for category in CATEGORIES for number in (0, 7)]
OBJECTS = pytest.mark.parametrize("obj", [*OBJECT_IDS, "odd/0001"], indirect=True)


@pytest.fixture
def obj(request: pytest.FixtureRequest) -> ArticulatedObject:
    return awkward() if request.param.startswith("odd") else catalog.load(request.param)


def joint_states(obj: ArticulatedObject, count: int = 5) -> list[list[float]]:
    """Both ends, and positions between them."""
    rng = np.random.default_rng(3)
    inner = [[j.position(rng.random()) for j in obj.joints] for _ in range(count - 2)]
    return [[j.closed for j in obj.joints], [j.open for j in obj.joints], *inner]


def file_poses(obj: ArticulatedObject, q: list[float]) -> dict[str, Array]:
    """Where the frames of the file's links should be, by name."""
    poses = obj.link_poses(q)
    expected = {}
    for name, T, origin in zip(obj.part_names, poses, link_origins(obj).values(), strict=True):
        expected[name] = T.copy()
        expected[name][:3, 3] = T[:3, :3] @ origin + T[:3, 3]
    return expected


@OBJECTS
def test_yourdfpy_sees_the_same_object(obj: ArticulatedObject, tmp_path: Path) -> None:
    yourdfpy = pytest.importorskip("yourdfpy")
    robot = yourdfpy.URDF.load(str(write_urdf(obj, tmp_path)))
    assert list(robot.link_map) == list(obj.part_names)
    assert [(j.name, j.type, j.parent, j.child) for j in robot.robot.joints] == [
        (j.name, j.type, j.parent, j.child) for j in obj.joints
    ]
    for theirs, ours in zip(robot.robot.joints, obj.joints, strict=True):
        assert [theirs.limit.lower, theirs.limit.upper] == sorted((ours.closed, ours.open))
        assert float(theirs.dynamics.friction) == ours.friction
        assert float(theirs.dynamics.damping) == ours.damping
        np.testing.assert_array_equal(theirs.axis, ours.axis)
    for link in obj.links:
        inertial = robot.link_map[link.name].inertial
        assert inertial.mass == link.mass
        np.testing.assert_allclose(inertial.inertia, link.inertia, rtol=0, atol=1e-15)
        center = inertial.origin[:3, 3] + link_origins(obj)[link.name]
        np.testing.assert_allclose(center, link.center_of_mass, atol=1e-12)
    for q in joint_states(obj):
        robot.update_cfg({j.name: value for j, value in zip(obj.joints, q, strict=True)})
        for name, expected in file_poses(obj, q).items():
            np.testing.assert_allclose(robot.get_transform(name), expected, atol=POSE_TOLERANCE)


@OBJECTS
@pytest.mark.parametrize("write", [write_urdf, write_mjcf])
def test_mujoco_sees_the_same_object(
    obj: ArticulatedObject, write: Callable[..., Path], tmp_path: Path
) -> None:
    mujoco = pytest.importorskip("mujoco")
    model = mujoco.MjModel.from_xml_path(str(write(obj, tmp_path)))
    names = [model.body(i).name for i in range(model.nbody)]
    assert names[0] == "world"
    assert sorted(names[1:]) == sorted(obj.part_names)
    assert model.njnt == model.nv == len(obj.joints)
    kinds = {"prismatic": mujoco.mjtJoint.mjJNT_SLIDE, "revolute": mujoco.mjtJoint.mjJNT_HINGE}
    for joint in obj.joints:
        theirs = model.joint(joint.name)
        assert theirs.type[0] == kinds[joint.type]
        assert model.jnt_limited[theirs.id]
        assert theirs.range.tolist() == sorted((joint.closed, joint.open))
        assert model.body(theirs.bodyid[0]).name == joint.child
        dof = theirs.dofadr[0]
        assert (model.dof_frictionloss[dof], model.dof_damping[dof]) == (
            joint.friction,
            joint.damping,
        )
    for link in obj.links:
        body = model.body(link.name)
        np.testing.assert_allclose(body.mass, link.mass, rtol=1e-12)
        moments = np.linalg.eigvalsh(link.inertia)
        np.testing.assert_allclose(np.sort(body.inertia), moments, rtol=1e-6, atol=1e-12)
    data = mujoco.MjData(model)
    for q in joint_states(obj):
        for joint, value in zip(obj.joints, q, strict=True):
            data.joint(joint.name).qpos = value
        mujoco.mj_kinematics(model, data)
        for name, expected in file_poses(obj, q).items():
            body = data.body(name)
            np.testing.assert_allclose(body.xpos, expected[:3, 3], atol=POSE_TOLERANCE)
            R = body.xmat.reshape(3, 3)
            np.testing.assert_allclose(R, expected[:3, :3], atol=POSE_TOLERANCE)
        _check_geoms(mujoco, model, data, obj, q)


def _check_geoms(
    mujoco: Any, model: Any, data: Any, obj: ArticulatedObject, q: list[float]
) -> None:
    """The boxes around what collides, computed by MuJoCo from its own geoms, are ours."""
    poses = dict(zip(obj.part_names, obj.link_poses(q), strict=True))
    mujoco.mj_kinematics(model, data)
    for link in obj.links:
        points = []
        for i in range(model.ngeom):
            if model.geom_bodyid[i] != model.body(link.name).id or not model.geom_contype[i]:
                continue
            size, kind = model.geom_size[i], model.geom_type[i]
            if kind == mujoco.mjtGeom.mjGEOM_MESH:
                mesh = model.geom_dataid[i]
                start = model.mesh_vertadr[mesh]
                corners = model.mesh_vert[start : start + model.mesh_vertnum[mesh]]
            else:
                if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
                    size = np.array([size[0], size[0], size[1]])
                corners = Box(half_size=tuple(size)).corners()
            R = data.geom_xmat[i].reshape(3, 3)
            points.append(corners @ R.T + data.geom_xpos[i])
        found = np.concatenate(points)
        T = poses[link.name]
        ours = np.concatenate([s.corners_link() for s in link.shapes]) @ T[:3, :3].T + T[:3, 3]
        # MuJoCo keeps points of meshes in single precision.
        np.testing.assert_allclose(found.min(axis=0), ours.min(axis=0), atol=POSE_TOLERANCE)
        np.testing.assert_allclose(found.max(axis=0), ours.max(axis=0), atol=POSE_TOLERANCE)


@OBJECTS
def test_what_left_comes_back(obj: ArticulatedObject, tmp_path: Path) -> None:
    back = read_urdf(write_urdf(obj, tmp_path)).object
    assert replace(back, object_id=obj.object_id) == obj
    assert replace(back, object_id=obj.object_id).content_hash() == obj.content_hash()


@OBJECTS
def test_the_urdf_alone_comes_back_nearly(obj: ArticulatedObject, tmp_path: Path) -> None:
    """Without the exact description: joints, masses and poses, about the importer's own origin."""
    path = write_urdf(obj, tmp_path)
    shutil.rmtree(description_folder(path))
    ends = {j.name: "lower" if j.closed < j.open else "upper" for j in obj.joints}
    back = read_urdf(path, closed=ends).object
    assert back.part_names == obj.part_names
    shift = back.links[0].center_of_mass - obj.links[0].center_of_mass
    for ours, theirs in zip(obj.joints, back.joints, strict=True):
        assert (theirs.name, theirs.type, theirs.parent, theirs.child) == (
            ours.name,
            ours.type,
            ours.parent,
            ours.child,
        )
        for name in ("closed", "open", "friction", "damping"):
            assert getattr(theirs, name) == pytest.approx(getattr(ours, name), abs=1e-9)
        np.testing.assert_allclose(theirs.axis, ours.axis, atol=1e-9)
        # The pivot of a slide is without effect.
        if ours.type == "revolute":
            np.testing.assert_allclose(np.subtract(theirs.pivot, shift), ours.pivot, atol=1e-9)
    for ours, theirs in zip(obj.links, back.links, strict=True):
        assert theirs.mass == pytest.approx(ours.mass, rel=1e-9)
        np.testing.assert_allclose(theirs.center_of_mass - shift, ours.center_of_mass, atol=1e-9)


def test_an_edited_urdf_is_believed(tmp_path: Path) -> None:
    obj = catalog.load("laptop/0003")
    path = write_urdf(obj, tmp_path)
    tree = ET.parse(path)
    # Another layout of the same numbers is no edit.
    ET.indent(tree, space="\t")
    tree.write(path)
    assert replace(read_urdf(path).object, object_id=obj.object_id) == obj
    limit = next(tree.iter("limit"))
    limit.set("upper", "1.25")
    tree.write(path)
    back = read_urdf(path).object
    assert back.joints[0].open == 1.25
    assert back.attributes["family"] == "imported"


@pytest.mark.parametrize("element", ["mass", "inertia", "origin", "box", "color", "dynamics"])
def test_any_edit_is_noticed(element: str, tmp_path: Path) -> None:
    path = write_urdf(catalog.load("laptop/0003"), tmp_path)
    tree = ET.parse(path)
    item = [e for e in tree.iter(element)][-1]
    key = sorted(item.attrib)[0]
    first, *rest = item.attrib[key].split()
    item.set(key, " ".join([repr(float(first) * 1.01 + 1e-4), *rest]))
    tree.write(path)
    assert read_urdf(path).object.attributes["family"] == "imported"


def test_an_edited_mesh_is_noticed(tmp_path: Path) -> None:
    path = write_urdf(awkward(), tmp_path)
    assert read_urdf(path).object.attributes["family"] == "odd"
    mesh = next((tmp_path / "meshes").glob("*visual_1.obj"))
    mesh.write_text(mesh.read_text().replace("v 0.1 0.0 0.0", "v 0.1001 0.0 0.0"))
    assert read_urdf(path).object.attributes["family"] == "imported"


def test_a_damaged_description_is_an_error(tmp_path: Path) -> None:
    path = write_urdf(catalog.load("laptop/0003"), tmp_path)
    json = description_folder(path) / "object.json"
    json.write_text(json.read_text()[:-40])
    with pytest.raises(AssetError, match=r"object\.json"):
        read_urdf(path)


def test_a_description_elsewhere_is_not_followed(tmp_path: Path) -> None:
    path = write_urdf(catalog.load("laptop/0003"), tmp_path / "object")
    folder = description_folder(path)
    folder.rename(tmp_path / "outside")
    folder.symlink_to("../outside")
    with pytest.raises(AssetError, match="link"):
        read_urdf(path)


def test_export_twice_gives_the_same_files(tmp_path: Path) -> None:
    contents = []
    for name in ("a", "b"):
        write_urdf(awkward(), tmp_path / name)
        write_mjcf(awkward(), tmp_path / name)
        files = sorted(p for p in (tmp_path / name).rglob("*") if p.is_file())
        contents.append({str(p.relative_to(tmp_path / name)): p.read_bytes() for p in files})
    assert contents[0] == contents[1]


def test_both_formats_go_to_one_folder(tmp_path: Path) -> None:
    obj = awkward()
    path = write_urdf(obj, tmp_path)
    write_mjcf(obj, tmp_path)
    assert replace(read_urdf(path).object, object_id=obj.object_id) == obj
    write_urdf(obj, tmp_path)
    mujoco = pytest.importorskip("mujoco")
    assert mujoco.MjModel.from_xml_path(str(path.with_suffix(".xml"))).ntex == 1


def test_mjcf_refuses_a_link_named_world(tmp_path: Path) -> None:
    obj = awkward()
    links = (replace(obj.links[0], name="world"), *obj.links[1:])
    joints = (replace(obj.joints[0], parent="world"), obj.joints[1])
    with pytest.raises(InvalidArgumentError, match="world"):
        write_mjcf(replace(obj, links=links, joints=joints), tmp_path)


def test_angles_of_urdf_give_the_rotation_back() -> None:
    rng = np.random.default_rng(2)
    rotations = [matrix_from_axis_angle(v) for v in rng.normal(size=(200, 3)) * 2]
    for angle in (np.pi / 2, np.pi / 2 - 1e-9, -np.pi / 2 + 1e-12, -np.pi / 2):
        Ry = matrix_from_axis_angle([0.0, angle, 0.0])
        rotations += [matrix_from_axis_angle([0, 0, z]) @ Ry for z in (-3.0, 0.0, 0.7)]
        rotations += [Ry @ matrix_from_axis_angle([x, 0, 0]) for x in (-3.0, 0.1, 0.7)]
    for R in rotations:
        roll, pitch, yaw = np.eye(3) * np.array(rpy_from_matrix(R))[:, None]
        again = (
            matrix_from_axis_angle(yaw)
            @ matrix_from_axis_angle(pitch)
            @ matrix_from_axis_angle(roll)
        )
        np.testing.assert_allclose(again, R, atol=1e-12)


def test_the_command_line_exports(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", "laptop/0003", "--out", str(tmp_path)]) == 0
    path = Path(capsys.readouterr().out.strip())
    assert path == tmp_path / "laptop_0003.urdf"
    assert main(["export", str(path), "--out", str(tmp_path / "m"), "--format", "mjcf"]) == 0
    assert Path(capsys.readouterr().out.strip()).is_file()
    assert main(["export", "laptop/9999", "--out", str(tmp_path)]) == 1
    assert "laptop" in capsys.readouterr().err
