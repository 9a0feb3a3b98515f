"""Reading URDF.

``parse_urdf`` reads a file into a ``RawModel``, ``read_urdf`` makes an object of it. Whatever the
file holds, the result is an object or an ``AssetError`` that says where the file is wrong.

Taken from a URDF: links with <visual>, <collision> and <inertial>; joints of type revolute,
continuous, prismatic and fixed with <origin>, <axis>, <limit> and <dynamics>; materials. Boxes,
cylinders, spheres and meshes are known forms. Materials of a mesh file go before the URDF's.
"""

from __future__ import annotations

import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Unpack, cast

import numpy as np
from numpy.typing import NDArray

from artgym.errors import AssetError
from artgym.geometry import transforms
from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.objects.assembly import (
    MAX_GEOMETRIES,
    MAX_LINKS,
    MAX_TOTAL_FACES,
    Conversion,
    Ellipsoid,
    Imported,
    RawGeometry,
    RawInertial,
    RawJoint,
    RawJointType,
    RawLink,
    RawModel,
    RawShape,
    object_from_model,
)
from artgym.objects.asset_folder import AssetFolder, refuse_archive
from artgym.objects.asset_xml import XmlElement, parse_xml
from artgym.objects.mesh_files import MAX_COORDINATE, MIN_EXTENT, read_mesh, read_picture
from artgym.objects.model import Box, Cylinder, Material, Vector
from artgym.objects.urdf_export import matching_description

Array = NDArray[np.floating]

#: Range of a joint without limits, radians either way.
CONTINUOUS_LIMIT = math.pi

_ROBOT_CHILDREN = {
    "link",
    "joint",
    "material",
    "transmission",
    "gazebo",
    "mujoco",
    "sensor",
    "group",
}
_LINK_CHILDREN = {"inertial", "visual", "collision", "contact", "sensor", "gazebo"}
_PIECE_CHILDREN = {"origin", "geometry", "material", "verbose", "contact_coefficients"}
_JOINT_CHILDREN = {
    "origin",
    "parent",
    "child",
    "axis",
    "limit",
    "dynamics",
    "mimic",
    "calibration",
    "safety_controller",
    "hardwareInterface",
}
_SHAPES = ("box", "cylinder", "sphere", "mesh")
#: A cylinder of a URDF lies along z, ours along x.
_Z_FROM_X = transforms.transform_from(
    matrix_from_axis_angle([0.0, -math.pi / 2, 0.0]).round(), np.zeros(3)
)


#: A conversion that changes nothing but the object's name and category.
_AS_WRITTEN = Conversion(
    scale=1.0,
    turn=0.0,
    up="+z",
    closed=None,
    closed_rule="nearest",
    solid="collision",
    density=None,
    part_names=None,
)


def read_urdf(
    path: str | os.PathLike[str],
    *,
    root: str | os.PathLike[str] | None = None,
    **conversion: Unpack[Conversion],
) -> Imported:
    """Makes an object of a URDF file.

    A URDF that ``urdf_export.write_urdf`` wrote and nobody changed gives the object that was
    written, unless an argument asks for another one.

    Args:
        path: the file.
        root: the folder that all files must lie in; the URDF's own by default. ``package://``
            names are looked up here.
        **conversion: as for ``assembly.object_from_model``: scale, turn, category, ...

    Raises:
        AssetError: the file, or one that it names, cannot be used.
        InvalidArgumentError: an argument out of range.
        MissingDependencyError: defusedxml is not installed.
    """
    model = parse_urdf(path, root=root)
    if all(conversion.get(key, value) == value for key, value in _AS_WRITTEN.items()):
        exact = matching_description(model)
        if exact is not None:
            category = conversion.get("category", "other")
            return Imported(
                object=replace(
                    exact,
                    object_id=conversion.get("name") or model.name,
                    category=exact.category if category == "other" else category,
                ),
                notes=(*model.notes, "taken from the exact description beside the URDF"),
            )
    return object_from_model(model, **conversion)


def parse_urdf(
    path: str | os.PathLike[str], *, root: str | os.PathLike[str] | None = None
) -> RawModel:
    """Reads a URDF file and its meshes, as they are.

    Args:
        path: the file.
        root: as for ``read_urdf``.

    Raises:
        AssetError: the file, or one that it names, cannot be used.
        MissingDependencyError: defusedxml is not installed.
    """
    text = os.fspath(path)
    refuse_archive(text)
    folder = AssetFolder(Path(text).parent if root is None else root)
    if root is None:
        inner = folder.locate(Path(text).name)
    else:
        inner = folder.locate(os.path.relpath(os.path.realpath(text), folder.root))
    return _UrdfReader(folder, inner).model()


class _UrdfReader:
    """One URDF file on its way to a model."""

    def __init__(self, folder: AssetFolder, inner: str) -> None:
        self._folder, self._inner = folder, inner
        self._file = folder.label(inner)
        self._notes: list[str] = []
        self._materials: dict[str, Material | None] = {}
        self._joint_names: set[str] = set()
        self._faces = 0

    def model(self) -> RawModel:
        root = parse_xml(self._folder.read(self._inner, "xml"), self._file)
        if root.tag != "robot":
            raise AssetError(
                self._file,
                "not a URDF: its root is not <robot>",
                value=root.tag,
                remedy="Give a URDF; other formats have readers of their own.",
            )
        robot = XmlElement(root, self._file, "robot")
        if any("xacro" in item.tag for item in root.iter() if isinstance(item.tag, str)):
            robot.refuse("a xacro file", remedy="Run xacro on it first and give its output.")
        robot.only_children(_ROBOT_CHILDREN)
        links, joints = robot.children("link"), robot.children("joint")
        pieces = sum(1 for tag in ("visual", "collision") for _ in root.iter(tag))
        for count, limit, what in (
            (len(links), MAX_LINKS, "links"),
            (len(joints), MAX_LINKS, "joints"),
            (pieces, MAX_GEOMETRIES, "pieces of geometry"),
        ):
            if count > limit:
                robot.refuse(f"more than {limit} {what}", value=count, remedy="Simplify it.")
        self._joint_names = {j.element.get("name", "") for j in joints}
        # Joints first: they are checked at no cost, meshes take time.
        raw_joints = tuple(self._joint(j.named(f"joint {j.name()!r}")) for j in joints)
        for material in robot.children("material"):
            named = material.named(f"material {material.name()!r}")
            self._materials[material.name()] = self._material_of(named)
        return RawModel(
            name=robot.name() if "name" in root.attrib else Path(self._inner).stem,
            file=self._file,
            links=tuple(self._link(k.named(f"link {k.name()!r}")) for k in links),
            joints=raw_joints,
            notes=tuple(self._notes),
        )

    # -- joints --

    def _joint(self, item: XmlElement) -> RawJoint:
        item.only_children(_JOINT_CHILDREN)
        kind = item.text("type")
        if kind not in ("fixed", "revolute", "continuous", "prismatic"):
            item.refuse(
                "a joint type that is not supported",
                value=kind,
                remedy="Use revolute, continuous, prismatic or fixed.",
            )
        joint_type = cast(RawJointType, "revolute" if kind == "continuous" else kind)
        lower = upper = 0.0
        axis: Vector = (1.0, 0.0, 0.0)
        friction = damping = None
        if kind != "fixed":
            axis = self._axis(item)
            lower, upper = self._limits(item, kind)
            dynamics = item.child("dynamics")
            if dynamics is not None:
                friction, damping = (
                    dynamics.number(key) if key in dynamics.element.attrib else None
                    for key in ("friction", "damping")
                )
            if (mimic := item.child("mimic")) is not None:
                self._check_mimic(mimic, item.name())
        return RawJoint(
            name=item.name(),
            type=joint_type,
            parent=item.required_child("parent").name("link"),
            child=item.required_child("child").name("link"),
            T_parent_joint=_origin(item),
            axis=axis,
            lower=lower,
            upper=upper,
            friction=friction,
            damping=damping,
            element=item.place,
        )

    def _check_mimic(self, mimic: XmlElement, name: str) -> None:
        """Checks a <mimic> and notes that it has no effect."""
        leader = mimic.name("joint")
        if leader == name or leader not in self._joint_names:
            mimic.refuse(
                "follows no other joint of the model",
                value=leader,
                remedy="Name another joint, or remove <mimic>.",
            )
        mimic.number("multiplier", 1.0)
        mimic.number("offset", 0.0)
        self._notes.append(f"{mimic.place}: left out, the joint moves on its own")

    def _axis(self, item: XmlElement) -> Vector:
        element = item.child("axis")
        if element is None:
            self._notes.append(f"{item.place}: no <axis>, so 1 0 0 as URDF prescribes")
            return (1.0, 0.0, 0.0)
        axis = cast(Vector, element.numbers("xyz", 3))
        if not 1e-6 < math.hypot(*axis) < 1e6:
            element.refuse(
                "an axis without direction", value=axis, remedy="Give a direction, such as 0 0 1."
            )
        return axis

    def _limits(self, item: XmlElement, kind: str) -> tuple[float, float]:
        limit = item.child("limit")
        if kind == "continuous":
            self._notes.append(
                f"{item.place}: continuous, taken as -{CONTINUOUS_LIMIT:.4g} to "
                f"{CONTINUOUS_LIMIT:.4g} rad"
            )
            return -CONTINUOUS_LIMIT, CONTINUOUS_LIMIT
        if limit is None:
            item.refuse("no <limit>", remedy="Give <limit lower= upper=>.")
        given = [key for key in ("lower", "upper") if key in limit.element.attrib]
        if not given:
            limit.refuse(
                "neither lower= nor upper=",
                remedy="Give both, or the type continuous for a joint that turns freely.",
            )
        for key in {"lower", "upper"} - set(given):
            self._notes.append(f"{limit.place}: no {key}=, so 0 as URDF prescribes")
        return limit.number("lower", 0.0), limit.number("upper", 0.0)

    # -- links --

    def _link(self, item: XmlElement) -> RawLink:
        item.only_children(_LINK_CHILDREN)
        inertial = item.child("inertial")
        visuals = [self._piece(v, i) for i, v in enumerate(item.children("visual"))]
        collisions = [self._piece(c, i) for i, c in enumerate(item.children("collision"))]
        return RawLink(
            name=item.name(),
            visuals=tuple(v for v in visuals if v is not None),
            collisions=tuple(c for c in collisions if c is not None),
            inertial=None if inertial is None else _inertial(inertial),
            element=item.place,
        )

    def _piece(self, item: XmlElement, number: int) -> RawGeometry | None:
        """A <visual> or <collision>; None where nothing is to be seen of it."""
        item = item.named(f"{item.place} {number}")
        item.only_children(_PIECE_CHILDREN)
        looks = item.tag == "visual"
        material = None
        if looks and (element := item.child("material")) is not None:
            color = element.child("color")
            if color is not None and color.numbers("rgba", 4)[3] == 0:
                self._notes.append(f"{item.place}: left out, its colour is fully transparent")
                return None
            material = self._material(element)
        T_link_shape = _origin(item)
        geometry = item.required_child("geometry")
        shapes = geometry.children()
        if len(shapes) != 1 or shapes[0].tag not in _SHAPES:
            geometry.refuse(
                "not one known form",
                value=[s.tag for s in shapes[:4]],
                remedy=f"Give one of {', '.join(_SHAPES)}.",
            )
        form, shape = shapes[0], self._shape(shapes[0], looks)
        if form.tag == "cylinder":
            T_link_shape = T_link_shape @ _Z_FROM_X
        return RawGeometry(
            shape=shape, T_link_shape=T_link_shape, material=material, element=item.place
        )

    def _shape(self, form: XmlElement, looks: bool) -> RawShape:
        if form.tag == "box":
            x, y, z = _lengths(form, "size", 3)
            return Box(half_size=(x / 2, y / 2, z / 2))
        if form.tag == "cylinder":
            (radius,), (length,) = _lengths(form, "radius"), _lengths(form, "length")
            return Cylinder(radius=radius, half_length=length / 2)
        if form.tag == "sphere":
            (radius,) = _lengths(form, "radius")
            return Ellipsoid(half_size=(radius, radius, radius))
        pieces = read_mesh(
            self._folder,
            form.text("filename"),
            form.numbers("scale", 3, (1.0, 1.0, 1.0)),
            mentioned_in=self._inner,
            element=form.place,
            looks=looks,
        )
        self._faces += sum(len(p.mesh.faces) for p in pieces)
        if self._faces > MAX_TOTAL_FACES:
            form.refuse(
                f"more than {MAX_TOTAL_FACES} faces in all",
                value=self._faces,
                remedy="Simplify the meshes.",
            )
        return pieces

    # -- materials --

    def _material(self, item: XmlElement) -> Material | None:
        """A link's material: its own, or the robot's of that name."""
        if item.child("color") is not None or item.child("texture") is not None:
            material = self._material_of(item)
            name = item.element.get("name", "")
            # Some writers describe a material at its first use and name it afterwards.
            if name:
                self._materials.setdefault(name, material)
            return material
        name = item.name()
        if name not in self._materials:
            self._notes.append(f"{item.place}: {name!r} is described nowhere, so grey")
            self._materials[name] = None
        return self._materials[name]

    def _material_of(self, item: XmlElement) -> Material:
        item.only_children({"color", "texture"})
        rgb: Vector = (0.6, 0.6, 0.6)
        color, texture = item.child("color"), item.child("texture")
        if color is not None:
            rgba = color.numbers("rgba", 4)
            if min(rgba) < 0 or max(rgba) > 1:
                color.refuse("outside 0 to 1", value=rgba, remedy="Give numbers from 0 to 1.")
            rgb = cast(Vector, rgba[:3])
        picture = None
        if texture is not None and texture.element.get("filename", "").strip():
            picture = read_picture(
                self._folder,
                texture.text("filename"),
                mentioned_in=self._inner,
                element=texture.place,
            )
        return Material(color=rgb, texture=picture)


def _lengths(form: XmlElement, key: str, count: int = 1) -> tuple[float, ...]:
    """Lengths of a primitive, metres."""
    lengths = form.positive(key, count)
    if not MIN_EXTENT <= min(lengths) <= max(lengths) <= MAX_COORDINATE:
        form.refuse(
            f"{key}= is not within {MIN_EXTENT:g} to {MAX_COORDINATE:g} m",
            value=lengths,
            remedy="Give it in metres.",
        )
    return lengths


def _origin(item: XmlElement) -> Array:
    """The pose (4, 4) of an <origin>, identity without one."""
    origin = item.child("origin")
    if origin is None:
        return np.eye(4)
    xyz = origin.numbers("xyz", 3, (0.0, 0.0, 0.0))
    rpy = origin.numbers("rpy", 3, (0.0, 0.0, 0.0))
    if max(map(abs, rpy)) > 1e3 or max(map(abs, xyz)) > 1e6:
        origin.refuse(
            "far outside any sensible range", value=(*xyz, *rpy), remedy="Use metres and radians."
        )
    return transforms.transform_from(_rotation(rpy), xyz)


def _rotation(rpy: tuple[float, ...]) -> Array:
    """The rotation (3, 3) of roll, pitch, yaw: about the fixed axes x, y, z in this order."""
    roll, pitch, yaw = (matrix_from_axis_angle(a * e) for a, e in zip(rpy, np.eye(3), strict=True))
    return yaw @ pitch @ roll


def _inertial(item: XmlElement) -> RawInertial:
    item.only_children({"origin", "mass", "inertia"})
    (mass,) = item.required_child("mass").positive("value")
    T_link_inertia = _origin(item)
    element = item.child("inertia")
    inertia = None
    if element is not None:
        xx, yy, zz = (element.number(key) for key in ("ixx", "iyy", "izz"))
        xy, xz, yz = (element.number(key, 0.0) for key in ("ixy", "ixz", "iyz"))
        R = T_link_inertia[:3, :3]
        inertia = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
    return RawInertial(
        mass=mass,
        center_of_mass=T_link_inertia[:3, 3],
        inertia=inertia,
        element=item.place,
    )
