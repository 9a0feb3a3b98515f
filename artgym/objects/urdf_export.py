"""Objects written as URDF: for other simulators, and such that they come back unchanged.

What URDF can say, it says: links, joints, limits, masses, inertias, joint friction and damping,
colours, pictures on meshes that carry picture coordinates. What it cannot say, such as which end of
a range is closed, friction of surfaces, roles of pieces and patterns of textures, lies beside it in
``NAME.artgym``, the object's exact description. Patterns become plain colours in the URDF.

A link's frame lies at the pivot of its joint and is turned like the object's frame at rest; joint
values and limits are the same as the object's.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from artgym.errors import AssetError
from artgym.files import write_file_whole
from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.geometry.transforms import transform_from, translation
from artgym.objects.assembly import RawGeometry, RawInertial, RawJoint, RawLink, RawModel
from artgym.objects.contents import Image, TriangleMesh
from artgym.objects.description import read_description, write_description
from artgym.objects.mesh_files import MeshPiece
from artgym.objects.model import (
    ArticulatedObject,
    Box,
    Convex,
    Cylinder,
    Joint,
    Link,
    Material,
    Shape,
    Visual,
)
from artgym.objects.wavefront import convex_mesh, file_stem, number_text, write_obj

Array = NDArray[np.floating]

#: What follows the stem of a URDF file in the name of the folder with the exact description.
DESCRIPTION_SUFFIX = ".artgym"

#: Turns a cylinder along z, as URDF and MJCF have it, to one along x, as ours.
R_CYLINDER = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])

#: How far numbers of a URDF may lie from those that the description would have written.
TOLERANCE = 1e-9
#: Picture coordinates have single precision.
_UV_TOLERANCE = 1e-6
#: Triangles of a smaller area may be missing from a mesh that was written and read, m^2.
_NO_AREA = 1e-9

#: URDF demands both; N or N m, and m/s or rad/s.
_EFFORT, _VELOCITY = 1000.0, 100.0


def write_urdf(obj: ArticulatedObject, folder: str | os.PathLike[str]) -> Path:
    """Writes an object as URDF with its meshes and its exact description.

    Args:
        obj: the object.
        folder: made if missing; gets NAME.urdf, meshes/ and NAME.artgym/, where NAME is the object
            id with "_" for "/". Files of these names are replaced.

    Returns:
        The URDF file.

    Raises:
        InvalidArgumentError: the object holds something that is no plain number or text.
        FileNotWrittenError: the system refused.
    """
    folder = Path(folder)
    model = raw_model(obj)
    robot = ET.Element("robot", name=model.name)
    # MuJoCo would throw the folders of mesh names away and melt the fixed root into the world.
    compiler = {
        "strippath": "false",
        "meshdir": ".",
        "fusestatic": "false",
        "discardvisual": "true",
        "balanceinertia": "false",
    }
    ET.SubElement(ET.SubElement(robot, "mujoco"), "compiler", compiler)
    for i, link in enumerate(model.links):
        _add_link(robot, link, folder, f"{model.name}_{i}_{file_stem(link.name)}")
    for joint in model.joints:
        _add_joint(robot, joint)
    ET.indent(robot)
    path = folder / model.file
    write_description(obj, description_folder(path))
    text = ET.tostring(robot, encoding="unicode")
    write_file_whole(path, f'<?xml version="1.0" encoding="utf-8"?>\n{text}\n'.encode())
    return path


def description_folder(urdf: Path) -> Path:
    """Where the exact description of an exported URDF lies."""
    return urdf.with_name(f"{urdf.stem}{DESCRIPTION_SUFFIX}")


def matching_description(model: RawModel) -> ArticulatedObject | None:
    """The exact object of a URDF that ``write_urdf`` wrote and nobody changed.

    Args:
        model: what was read from the URDF; ``model.file`` is its path, free of links.

    Returns:
        The object of the description beside the URDF, if there is one and it would give a URDF
        whose numbers are equal within ``TOLERANCE`` and whose names are the same.

    Raises:
        AssetError: the description is there and damaged, or leads elsewhere.
    """
    folder = description_folder(Path(model.file))
    if folder.is_symlink():
        raise AssetError(folder, "is a link", remedy="Put the folder itself there, or remove it.")
    if not folder.is_dir():
        return None
    obj = read_description(folder)
    return obj if _agree(model, raw_model(obj)) else None


# --- Frames of a URDF ----------------------------------------------------------------------------


def raw_model(obj: ArticulatedObject) -> RawModel:
    """An object in the frames of a URDF, as ``write_urdf`` writes it."""
    name = file_stem(obj.object_id)
    origins = link_origins(obj)
    return RawModel(
        name=name,
        file=f"{name}.urdf",
        links=tuple(_raw_link(link, origins[link.name]) for link in obj.links),
        joints=tuple(
            _raw_joint(joint, origins[joint.child] - origins[joint.parent]) for joint in obj.joints
        ),
    )


def link_origins(obj: ArticulatedObject) -> dict[str, Array]:
    """Where the frame of each link's file lies, (3,) in the object's frame at rest.

    The pivot of the link's joint; the root's is the object's origin.
    """
    origins: dict[str, Array] = {obj.links[0].name: np.zeros(3)}
    origins.update({joint.child: np.asarray(joint.pivot, dtype=float) for joint in obj.joints})
    return origins


def _raw_link(link: Link, origin: Array) -> RawLink:
    T_file_link = translation(-origin)
    shapes = tuple(_raw_shape(shape, T_file_link) for shape in link.shapes)
    visuals = tuple(_raw_visual(visual, T_file_link) for visual in link.visuals)
    inertial = RawInertial(
        mass=link.mass, center_of_mass=link.center_of_mass - origin, inertia=link.inertia
    )
    return RawLink(name=link.name, visuals=visuals or shapes, collisions=shapes, inertial=inertial)


def _raw_shape(shape: Shape, T_file_link: Array) -> RawGeometry:
    return RawGeometry(
        shape=shape.geometry,
        T_link_shape=T_file_link @ shape.T_link_shape,
        material=Material(color=shape.material.color),
    )


def mesh_and_picture(visual: Visual) -> tuple[TriangleMesh, Image | None]:
    """What is written of a visual: its mesh, and its picture where it has coordinates for one."""
    mesh, texture = visual.mesh, visual.material.texture
    if isinstance(texture, Image) and mesh.uv is not None:
        return mesh, texture
    return TriangleMesh(mesh.vertices, mesh.faces), None


def _raw_visual(visual: Visual, T_file_link: Array) -> RawGeometry:
    mesh, picture = mesh_and_picture(visual)
    material, own = Material(color=visual.material.color), None
    if picture is not None:
        # The mesh file names the picture; a material in the URDF would hide it.
        material, own = None, Material(color=(1.0, 1.0, 1.0), texture=picture)
    piece = MeshPiece(mesh=mesh, material=own)
    return RawGeometry(shape=(piece,), T_link_shape=T_file_link, material=material)


def _raw_joint(joint: Joint, offset: Array) -> RawJoint:
    axis = np.asarray(joint.axis, dtype=float)
    # URDF has its rest at q = 0, ours is at q = closed.
    if joint.type == "prismatic":
        T_parent_joint = translation(offset - joint.closed * axis)
    else:
        T_parent_joint = transform_from(matrix_from_axis_angle(-joint.closed * axis), offset)
    lower, upper = sorted((joint.closed, joint.open))
    return RawJoint(
        name=joint.name,
        type=joint.type,
        parent=joint.parent,
        child=joint.child,
        T_parent_joint=T_parent_joint,
        axis=joint.axis,
        lower=lower,
        upper=upper,
        friction=joint.friction,
        damping=joint.damping,
    )


# --- XML -----------------------------------------------------------------------------------------


def _add_link(robot: ET.Element, link: RawLink, folder: Path, name: str) -> None:
    element = ET.SubElement(robot, "link", name=link.name)
    assert link.inertial is not None
    assert link.inertial.inertia is not None
    inertial = ET.SubElement(element, "inertial")
    _add_origin(inertial, translation(link.inertial.center_of_mass))
    ET.SubElement(inertial, "mass", value=number_text(link.inertial.mass))
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = link.inertial.inertia
    moments = {"ixx": xx, "ixy": xy, "ixz": xz, "iyy": yy, "iyz": yz, "izz": zz}
    ET.SubElement(inertial, "inertia", {k: number_text(v) for k, v in moments.items()})
    # Pieces that are seen and collide share their files.
    shared = link.visuals is link.collisions
    for i, visual in enumerate(link.visuals):
        piece = f"{name}_{i}" if shared else f"{name}_visual_{i}"
        item = ET.SubElement(element, "visual")
        _add_piece(item, visual, folder, piece, seen=True, write=True)
    for i, collision in enumerate(link.collisions):
        item, piece = ET.SubElement(element, "collision"), f"{name}_{i}"
        _add_piece(item, collision, folder, piece, seen=False, write=not shared)


def _add_piece(
    element: ET.Element, piece: RawGeometry, folder: Path, name: str, *, seen: bool, write: bool
) -> None:
    T_link_shape, form = piece.T_link_shape, piece.shape
    if isinstance(form, Cylinder):
        T_link_shape = T_link_shape @ transform_from(R_CYLINDER, np.zeros(3))
    _add_origin(element, T_link_shape)
    geometry = ET.SubElement(element, "geometry")
    if isinstance(form, Box):
        ET.SubElement(geometry, "box", size=number_text(*(2.0 * s for s in form.half_size)))
    elif isinstance(form, Cylinder):
        sizes = {"radius": form.radius, "length": 2.0 * form.half_length}
        ET.SubElement(geometry, "cylinder", {k: number_text(v) for k, v in sizes.items()})
    else:
        picture = None
        if isinstance(form, Convex):
            mesh = convex_mesh(form)
        else:
            assert isinstance(form, tuple)
            mesh, look = form[0].mesh, form[0].material
            if look is not None and isinstance(look.texture, Image):
                picture = look.texture
        file = f"meshes/{name}.obj"
        if write:
            write_obj(folder / file, mesh, picture)
        ET.SubElement(geometry, "mesh", filename=file)
    if seen and piece.material is not None:
        look = ET.SubElement(element, "material", name=name)
        ET.SubElement(look, "color", rgba=number_text(*piece.material.color, 1.0))


def _add_joint(robot: ET.Element, joint: RawJoint) -> None:
    element = ET.SubElement(robot, "joint", name=joint.name, type=joint.type)
    _add_origin(element, joint.T_parent_joint)
    ET.SubElement(element, "parent", link=joint.parent)
    ET.SubElement(element, "child", link=joint.child)
    ET.SubElement(element, "axis", xyz=number_text(*joint.axis))
    limit = {
        "lower": joint.lower,
        "upper": joint.upper,
        "effort": _EFFORT,
        "velocity": _VELOCITY,
    }
    ET.SubElement(element, "limit", {k: number_text(v) for k, v in limit.items()})
    assert joint.friction is not None
    assert joint.damping is not None
    dynamics = {"damping": joint.damping, "friction": joint.friction}
    ET.SubElement(element, "dynamics", {k: number_text(v) for k, v in dynamics.items()})


def _add_origin(element: ET.Element, T: Array) -> None:
    # Adding zero turns -0.0 into 0.0.
    xyz, rpy = T[:3, 3] + 0.0, np.asarray(rpy_from_matrix(T[:3, :3])) + 0.0
    ET.SubElement(element, "origin", xyz=number_text(*xyz), rpy=number_text(*rpy))


def rpy_from_matrix(R: Array) -> tuple[float, float, float]:
    """Angles of URDF, radians: R = Rz(yaw) Ry(pitch) Rx(roll); accurate at any pitch."""
    yaw = np.arctan2(R[1, 0], R[0, 0])
    c, s = np.cos(yaw), np.sin(yaw)
    # What is left after undoing the yaw: where the pitch is upright, yaw alone is ill-determined,
    # and the roll must make up for it.
    left = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ R
    pitch = np.arctan2(-left[2, 0], left[0, 0])
    roll = np.arctan2(-left[1, 2], left[1, 1])
    return float(roll), float(pitch), float(yaw)


# --- Comparison ----------------------------------------------------------------------------------


def _agree(one: RawModel, other: RawModel) -> bool:
    """Whether two models are equal but for rounding."""
    return (
        len(one.links) == len(other.links)
        and len(one.joints) == len(other.joints)
        and all(map(_links_agree, one.links, other.links))
        and all(map(_joints_agree, one.joints, other.joints))
    )


def _near(one: object, other: object, tolerance: float = TOLERANCE) -> bool:
    """Whether numbers are equal within a tolerance, absolute below 1 and relative above."""
    a, b = np.asarray(one, dtype=float), np.asarray(other, dtype=float)
    return a.shape == b.shape and np.allclose(a, b, rtol=tolerance, atol=tolerance)


def _joints_agree(one: RawJoint, other: RawJoint) -> bool:
    if None in (one.friction, one.damping):
        return False
    return (
        (one.name, one.type, one.parent, one.child)
        == (other.name, other.type, other.parent, other.child)
        and _near(one.T_parent_joint, other.T_parent_joint)
        and all(
            _near(getattr(one, name), getattr(other, name))
            for name in ("axis", "pivot", "lower", "upper", "friction", "damping")
        )
    )


def _links_agree(one: RawLink, other: RawLink) -> bool:
    if one.inertial is None or other.inertial is None or one.inertial.inertia is None:
        return False
    return (
        one.name == other.name
        and all(
            _near(getattr(one.inertial, name), getattr(other.inertial, name))
            for name in ("mass", "center_of_mass", "inertia")
        )
        and len(one.visuals) == len(other.visuals)
        and len(one.collisions) == len(other.collisions)
        and all(map(_forms_agree, one.collisions, other.collisions))
        and all(map(_forms_agree, one.visuals, other.visuals))
        and all(map(_looks_agree, one.visuals, other.visuals))
    )


def _forms_agree(one: RawGeometry, other: RawGeometry) -> bool:
    if not _near(one.T_link_shape, other.T_link_shape):
        return False
    match one.shape, other.shape:
        case (Box(half_size=a), Box(half_size=b)):
            return _near(a, b)
        case (Cylinder() as a, Cylinder() as b):
            return _near((a.radius, a.half_length), (b.radius, b.half_length))
        case ((MeshPiece() as a,), Convex() as b):
            return _meshes_agree(a.mesh, convex_mesh(b))
        case ((MeshPiece() as a,), (MeshPiece() as b,)):
            return _meshes_agree(a.mesh, b.mesh)
        case _:
            return False


def _meshes_agree(one: TriangleMesh, other: TriangleMesh) -> bool:
    """Whether ``one`` has the triangles of ``other`` in their order, but for some of no area."""
    missing = len(other.faces) - len(one.faces)
    if missing < 0:
        return False
    faces = other.faces
    if missing:
        a, b, c = other.vertices[faces].swapaxes(0, 1)
        areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
        order = np.argsort(areas, kind="stable")
        if areas[order[missing - 1]] > _NO_AREA:
            return False
        faces = faces[np.sort(order[missing:])]
    if not _near(one.vertices[one.faces], other.vertices[faces]):
        return False
    if one.uv is None or other.uv is None:
        return one.uv is other.uv
    return _near(one.uv[one.faces], other.uv[faces], _UV_TOLERANCE)


def _looks_agree(one: RawGeometry, other: RawGeometry) -> bool:
    a, b = (next(_materials(piece), None) for piece in (one, other))
    if a is None or b is None:
        return a is b
    return _near(a.color, b.color) and a.texture == b.texture


def _materials(piece: RawGeometry) -> Iterator[Material]:
    """How a piece looks: the mesh file's word goes first."""
    if isinstance(piece.shape, tuple) and piece.shape[0].material is not None:
        yield piece.shape[0].material
    if piece.material is not None:
        yield piece.material
