"""Reading MJCF, MuJoCo's own format.

``parse_mjcf`` reads a file into a ``RawModel``, ``read_mjcf`` makes an object of it. MuJoCo itself
compiles the model, since only it knows MJCF's defaults; but it opens no file: every file is read
and checked here, meshes are given to it anew, and what cannot matter to an object is taken out
first.

Taken from an MJCF: bodies, geoms of type box, sphere, capsule, cylinder, ellipsoid and mesh, hinges
and slides, inertias, colours and pictures of materials. Left out, with a note where it matters:
planes, the free joint of the root, springs, equality constraints and tendons, sensors, actuators.
"""

from __future__ import annotations

import importlib
import math
import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any, Literal, NoReturn, Unpack
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from artgym.errors import AssetError, MissingDependencyError
from artgym.geometry import transforms
from artgym.geometry.rotations import matrix_from_axis_angle, matrix_from_quaternion
from artgym.objects.assembly import (
    MAX_GEOMETRIES,
    MAX_LINKS,
    Capsule,
    Conversion,
    Ellipsoid,
    Imported,
    RawGeometry,
    RawInertial,
    RawJoint,
    RawLink,
    RawModel,
    RawShape,
    object_from_model,
)
from artgym.objects.asset_folder import AssetFolder, refuse_archive
from artgym.objects.asset_xml import XmlElement, parse_xml
from artgym.objects.contents import Image, TriangleMesh
from artgym.objects.mesh_files import MeshPiece, read_mesh, read_picture
from artgym.objects.model import Box, Cylinder, Material, Vector

Array = NDArray[np.floating]

#: Range of a hinge without limits, radians either way.
UNLIMITED = math.pi
#: Files that a file may include, itself counted.
MAX_INCLUDES = 64
#: Geoms of a higher group are hidden in MuJoCo's viewer: by custom they only collide.
LAST_SEEN_GROUP = 2

_KEPT_SECTIONS = ("compiler", "default", "asset", "worldbody")
_NOTED_SECTIONS = {
    "equality": "equality constraints were left out: each joint moves for itself",
    "tendon": "tendons were left out",
}
_DEFAULTS = ("default", "geom", "joint", "mesh", "material")
_BODY_CHILDREN = ("body", "frame", "geom", "joint", "freejoint", "inertial")
_DROPPED_FROM_BODIES = ("site", "camera", "light")
_MESH_ATTRIBUTES = ("name", "class", "scale", "refpos", "refquat", "inertia")
_COMPILER_ATTRIBUTES = (
    "angle",
    "autolimits",
    "balanceinertia",
    "boundinertia",
    "boundmass",
    "coordinate",
    "eulerseq",
    "inertiafromgeom",
    "inertiagrouprange",
    "settotalmass",
)
#: Attributes of bodies and what they hold that must be finite numbers.
_NUMBERS = {
    "armature",
    "axis",
    "axisangle",
    "damping",
    "density",
    "diaginertia",
    "euler",
    "frictionloss",
    "fromto",
    "fullinertia",
    "mass",
    "pos",
    "quat",
    "range",
    "ref",
    "rgba",
    "scale",
    "size",
    "xyaxes",
    "zaxis",
}
#: Attributes that ask for memory or for code, or that nothing here reads.
_DROPPED_ATTRIBUTES = ("user", "plugin", "hfield", "sleep")
#: A cylinder of an MJCF lies along z, ours along x.
_Z_FROM_X = transforms.transform_from(
    matrix_from_axis_angle([0.0, -math.pi / 2, 0.0]).round(), np.zeros(3)
)
_DEFAULT_RGBA = (0.5, 0.5, 0.5, 1.0)


def read_mjcf(
    path: str | os.PathLike[str],
    *,
    root: str | os.PathLike[str] | None = None,
    **conversion: Unpack[Conversion],
) -> Imported:
    """Makes an object of an MJCF file.

    Args:
        path: the file.
        root: the folder that all files must lie in; the MJCF's own by default.
        **conversion: as for ``assembly.object_from_model``: scale, turn, category, ...

    Raises:
        AssetError: the file, or one that it names, cannot be used.
        InvalidArgumentError: an argument out of range.
        MissingDependencyError: mujoco is not installed.
    """
    return object_from_model(parse_mjcf(path, root=root), **conversion)


def parse_mjcf(
    path: str | os.PathLike[str], *, root: str | os.PathLike[str] | None = None
) -> RawModel:
    """Reads an MJCF file and all files that it names.

    Args:
        path: the file.
        root: as for ``read_mjcf``.

    Raises:
        AssetError: the file, or one that it names, cannot be used.
        MissingDependencyError: mujoco is not installed.
    """
    try:
        # Its compiled module has no types.
        mujoco: Any = importlib.import_module("mujoco")
    except ImportError:
        raise MissingDependencyError(
            "reading MJCF needs mujoco: pip install 'artgym[mjcf]'"
        ) from None
    refuse_archive(os.fspath(path))
    folder = AssetFolder(Path(path).parent if root is None else root)
    inner = Path(path).name
    if root is not None:
        inner = os.path.relpath(os.path.realpath(path), folder.root)
    source = _Source(folder, folder.locate(inner))
    text = ET.tostring(source.tree, encoding="unicode")
    # Without these MuJoCo writes its warnings to a file in the working folder.
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        model = mujoco.MjModel.from_xml_string(text, source.files)
    except (ValueError, RuntimeError, MemoryError, mujoco.FatalError) as error:
        said = " ".join(str(error).split())
        raise AssetError(
            source.file,
            "MuJoCo refuses it",
            value=said,
            remedy="Correct the file until MuJoCo's own viewer loads it.",
        ) from None
    finally:
        mujoco.set_mju_user_warning(None)
    return _Compiled(mujoco, model, source).raw_model()


# -- before MuJoCo -----------------------------------------------------------------------------


class _Source:
    """A model with includes put in place, reduced to what an object needs, and its files.

    Attributes:
        folder: where all files lie.
        file: what the model is called in messages.
        tree: the reduced model.
        files: what MuJoCo is given in place of mesh files, by name.
        meshes: pieces of each mesh, by the mesh's name.
        pictures: picture of each material that has one, by the material's name.
        notes: what was left out.
    """

    def __init__(self, folder: AssetFolder, inner: str) -> None:
        self.folder, self._inner = folder, inner
        self.file = folder.label(inner)
        self.files: dict[str, bytes] = {}
        self.meshes: dict[str, tuple[MeshPiece, ...]] = {}
        self.pictures: dict[str, Image] = {}
        self.notes: list[str] = []
        self._included: set[str] = set()
        self.tree = self._read(inner)
        if self.tree.tag != "mujoco":
            self._refuse(
                "not an MJCF model",
                element=f"<{self.tree.tag}>",
                remedy="Give the file whose root element is <mujoco>.",
            )
        self._compiler = self._reduce_compiler()
        for section in list(self.tree):
            if section.tag in _NOTED_SECTIONS and len(section):
                self.notes.append(_NOTED_SECTIONS[section.tag])
            if section.tag not in _KEPT_SECTIONS:
                self.tree.remove(section)
        self.tree.attrib = {"model": self.tree.get("model", Path(inner).stem)}
        for section in self.tree.findall("default"):
            _keep_children(section, _DEFAULTS)
        self._reduce_assets()
        for section in self.tree.findall("worldbody"):
            self._reduce_bodies(section)
        for element in self.tree.iter():
            for attribute in _DROPPED_ATTRIBUTES:
                element.attrib.pop(attribute, None)
        for parent in self.tree.iter():
            for element in parent:
                self._check_numbers(element, parent)
        for tag, most in (("body", MAX_LINKS), ("geom", MAX_GEOMETRIES), ("joint", MAX_LINKS)):
            count = sum(1 for _ in self.tree.iter(tag))
            if count > most:
                self._refuse(
                    f"more than {most} elements <{tag}>", value=count, remedy="Simplify it."
                )

    def _refuse(
        self, problem: str, *, element: str = "", value: object = None, remedy: str
    ) -> NoReturn:
        raise AssetError(self.file, problem, element=element, value=value, remedy=remedy)

    def _read(self, inner: str, mentioned_in: str = "", element: str = "") -> ET.Element:
        """A file's root element, with the files that it includes in place."""
        inner = self.folder.locate(inner, mentioned_in=mentioned_in, element=element)
        if inner in self._included or len(self._included) >= MAX_INCLUDES:
            self._refuse(
                f"included twice, or more than {MAX_INCLUDES} files",
                element=element,
                value=inner,
                remedy="Include each file once.",
            )
        self._included.add(inner)
        data = self.folder.read(inner, "xml", element=element)
        tree = parse_xml(data, self.folder.label(inner))
        for parent in list(tree.iter()):
            for place, child in reversed(list(enumerate(parent))):
                if child.tag == "include":
                    name = XmlElement(child, self.folder.label(inner), "include").text("file")
                    # MuJoCo looks for every include beside the main file.
                    found = self._read(name, self._inner, f"include {name!r}")
                    parent[place : place + 1] = list(found)
        return tree

    def _reduce_compiler(self) -> dict[str, str]:
        """All settings of the compiler; leaves those that matter here."""
        settings: dict[str, str] = {}
        for section in self.tree.findall("compiler"):
            settings.update(section.attrib)
            section.attrib = {k: v for k, v in section.attrib.items() if k in _COMPILER_ATTRIBUTES}
            for child in list(section):
                section.remove(child)
        ET.SubElement(self.tree, "compiler", discardvisual="false", fusestatic="false")
        return settings

    def _path(self, name: str, kind: Literal["mesh", "texture"]) -> str:
        """The path, relative to the model's file, of a mesh or a picture."""
        base = self._compiler.get(f"{kind}dir", self._compiler.get("assetdir", ""))
        if self._compiler.get("strippath") == "true":
            name = PurePosixPath(name.replace("\\", "/")).name
        if not base or PurePosixPath(name).is_absolute():
            return name
        return f"{base.rstrip('/')}/{name}"

    def _reduce_assets(self) -> None:
        """Reads meshes and pictures and takes their files out of the model."""
        pictures: dict[str, str] = {}
        for section in self.tree.findall("asset"):
            for item in list(section):
                element = XmlElement(item, self.file, f"{item.tag} {item.get('name', '')!r}")
                if item.tag == "mesh":
                    self._reduce_mesh(element)
                    continue
                if item.tag == "texture" and "file" in item.attrib and "name" in item.attrib:
                    pictures[element.text("name")] = self._path(element.text("file"), "texture")
                elif item.tag in ("model", "hfield"):
                    element.refuse(
                        "not supported", remedy="Use meshes, and bodies in the model itself."
                    )
                if item.tag != "material":
                    section.remove(item)
        for section in self.tree.findall("asset"):
            for item in section.findall("material"):
                self._reduce_material(item, pictures)
        for section in self.tree.iter("default"):
            for item in section.findall("material"):
                self._reduce_material(item, {})
            for item in section.findall("mesh"):
                item.attrib = {k: v for k, v in item.attrib.items() if k in _MESH_ATTRIBUTES}

    def _reduce_mesh(self, element: XmlElement) -> None:
        item = element.element
        if "file" in item.attrib:
            name = element.text("file")
            pieces = read_mesh(
                self.folder,
                self._path(name, "mesh"),
                mentioned_in=self._inner,
                element=element.place,
            )
            known = item.get("name", PurePosixPath(name.replace("\\", "/")).stem)
        elif "vertex" in item.attrib:
            pieces = (MeshPiece(mesh=self._inline_mesh(element), material=None),)
            known = element.text("name")
        else:
            element.refuse("neither file= nor vertex=", remedy="Give the mesh a file.")
        if known in self.meshes:
            element.refuse("a second mesh of this name", remedy="Give each its own name.")
        file = f"mesh{len(self.meshes)}.obj"
        self.meshes[known] = pieces
        self.files[file] = _obj_bytes(pieces)
        item.attrib = {k: v for k, v in item.attrib.items() if k in _MESH_ATTRIBUTES}
        item.attrib.update(name=known, file=file)
        for child in list(item):
            item.remove(child)

    def _inline_mesh(self, element: XmlElement) -> TriangleMesh:
        """A mesh written into the model; its hull where no faces are given."""
        from scipy.spatial import ConvexHull, QhullError

        def numbers(key: str) -> Array:
            count = len(element.text(key).split())
            if not count or count % 3:
                element.refuse(f"{key}= is not a list of triples", remedy="Give triples.")
            return np.array(element.numbers(key, count)).reshape(-1, 3)

        vertices = numbers("vertex")
        if "face" in element.element.attrib:
            faces = numbers("face")
            if not (
                np.array_equal(faces, faces.round())
                and faces.min() >= 0
                and faces.max() < len(vertices)
            ):
                element.refuse("face= names vertices that are not there", remedy="Correct it.")
            return TriangleMesh(vertices, faces)
        try:
            return TriangleMesh(vertices, ConvexHull(vertices).simplices)
        except QhullError:
            element.refuse("its vertices lie in one plane", remedy="Give faces as well.")

    def _reduce_material(self, item: ET.Element, pictures: Mapping[str, str]) -> None:
        texture = item.attrib.pop("texture", None)
        for child in list(item):
            if child.tag == "layer" and child.get("role") == "rgb":
                texture = texture or child.get("texture")
            item.remove(child)
        if texture is not None and texture in pictures and "name" in item.attrib:
            self.pictures[item.attrib["name"]] = read_picture(
                self.folder,
                pictures[texture],
                mentioned_in=self._inner,
                element=f"texture {texture!r}",
            )

    def _check_numbers(self, element: ET.Element, parent: ET.Element) -> None:
        """Refuses what MuJoCo would pass over in silence: it drops what it cannot use."""
        place = f"{element.tag} {element.get('name')!r}"
        if "name" not in element.attrib:
            place = f"{parent.tag} {parent.get('name', '')!r} {element.tag}"
        item = XmlElement(element, self.file, place)
        for key in sorted(_NUMBERS):
            if (text := element.get(key)) is not None:
                item.numbers(key, len(text.split()) or 1)
        if element.tag == "joint" and element.get("limited") != "false":
            lower, upper = item.numbers("range", 2, (0.0, 0.0))
            if lower > upper:
                item.refuse(
                    "its range ends before it begins",
                    value=element.get("range"),
                    remedy="Exchange the two ends.",
                )
        if element.tag == "inertial":
            item.positive("mass")
            if "diaginertia" in element.attrib:
                item.positive("diaginertia", 3)

    def _reduce_bodies(self, body: ET.Element) -> None:
        for child in list(body):
            if child.tag in _DROPPED_FROM_BODIES:
                body.remove(child)
            elif child.tag not in _BODY_CHILDREN:
                self._refuse(
                    f"<{child.tag}> is not supported",
                    element=f"body {body.get('name', '')!r}",
                    remedy=f"Write it out in {', '.join(_BODY_CHILDREN)}.",
                )
            else:
                self._reduce_bodies(child)


def _keep_children(element: ET.Element, tags: tuple[str, ...]) -> None:
    for child in list(element):
        if child.tag in tags:
            _keep_children(child, tags)
        else:
            element.remove(child)


def _obj_bytes(pieces: tuple[MeshPiece, ...]) -> bytes:
    """All pieces as one OBJ of vertices and faces, in their order."""
    lines, offset = [], 1
    for piece in pieces:
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in piece.mesh.vertices.tolist()]
        lines += [
            f"f {a + offset} {b + offset} {c + offset}" for a, b, c in piece.mesh.faces.tolist()
        ]
        offset += len(piece.mesh.vertices)
    return ("\n".join(lines) + "\n").encode()


# -- after MuJoCo ------------------------------------------------------------------------------


class _Compiled:
    """A compiled model on its way to a ``RawModel``."""

    def __init__(self, mujoco: Any, model: Any, source: _Source) -> None:
        self._mujoco, self._model, self._source = mujoco, model, source
        self._notes = list(source.notes)
        self._meshes: dict[int, tuple[MeshPiece, ...]] = {}
        groups_of_visuals = {
            int(model.geom_group[g]) for g in range(model.ngeom) if not self._collides(g)
        }
        groups_of_collisions = {
            int(model.geom_group[g]) for g in range(model.ngeom) if self._collides(g)
        }
        # Where a model keeps what is seen and what collides in groups of their own, what collides
        # is not seen.
        self._apart = bool(groups_of_visuals) and not (groups_of_visuals & groups_of_collisions)

    def raw_model(self) -> RawModel:
        """The model as the package's other readers give theirs."""
        model = self._model
        links, joints = [], []
        names = [self._name("mjOBJ_BODY", i) or f"body_{i}" for i in range(model.nbody)]
        for i in range(model.nbody):
            visuals, collisions = self._geometry(i)
            links.append(
                RawLink(
                    name=names[i],
                    visuals=visuals,
                    collisions=collisions,
                    inertial=self._inertial(i, names[i]),
                    element=f"body {names[i]!r}",
                )
            )
            if i == 0:
                continue
            T_parent_body = _transform(model.body_pos[i], model.body_quat[i])
            holder = names[int(model.body_parentid[i])]
            found = self._joints(i, names[i])
            for k, joint in enumerate(found):
                last = k == len(found) - 1
                child = names[i] if last else f"{names[i]} before joint {k + 2}"
                if not last:
                    links.append(RawLink(name=child, element=f"body {names[i]!r}"))
                joints.append(
                    replace(joint, parent=holder, child=child, T_parent_joint=T_parent_body)
                )
                holder, T_parent_body = child, np.eye(4)
        return RawModel(
            name=self._source.tree.get("model", "model"),
            file=self._source.file,
            links=tuple(links),
            joints=tuple(joints),
            notes=tuple(dict.fromkeys(self._notes)),
        )

    def _refuse(self, problem: str, *, element: str, value: object = None, remedy: str) -> NoReturn:
        raise AssetError(self._source.file, problem, element=element, value=value, remedy=remedy)

    def _name(self, kind: str, index: int) -> str:
        mujoco = self._mujoco
        return mujoco.mj_id2name(self._model, getattr(mujoco.mjtObj, kind), index) or ""

    def _collides(self, geom: int) -> bool:
        return bool(self._model.geom_contype[geom] or self._model.geom_conaffinity[geom])

    # -- geometry --

    def _geometry(self, body: int) -> tuple[tuple[RawGeometry, ...], tuple[RawGeometry, ...]]:
        """What is seen of a body, and what collides."""
        model = self._model
        visuals, collisions = [], []
        first = int(model.body_geomadr[body])
        for geom in range(first, first + int(model.body_geomnum[body])):
            element = f"geom {self._name('mjOBJ_GEOM', geom) or geom!r}"
            shape, T_geom_shape = self._shape(geom, element)
            if shape is None:
                continue
            rgba = self._rgba(geom)
            piece = RawGeometry(
                shape=shape,
                T_link_shape=_transform(model.geom_pos[geom], model.geom_quat[geom]) @ T_geom_shape,
                material=Material(color=rgba[:3]),
                element=element,
            )
            collides = self._collides(geom)
            hidden = int(model.geom_group[geom]) > LAST_SEEN_GROUP or rgba[3] == 0.0
            if not (hidden or (collides and self._apart)):
                visuals.append(piece)
            if collides:
                collisions.append(piece)
        return tuple(visuals), tuple(collisions)

    def _rgba(self, geom: int) -> tuple[Any, ...]:
        model = self._model
        own = tuple(round(float(v), 6) for v in model.geom_rgba[geom])
        material = int(model.geom_matid[geom])
        # MuJoCo's rule: a geom's own colour goes first, unless it is the default one.
        if material < 0 or own != _DEFAULT_RGBA:
            return own
        return tuple(round(float(v), 6) for v in model.mat_rgba[material])

    def _shape(self, geom: int, element: str) -> tuple[RawShape | None, Array]:
        """A geom's form and its pose in the geom's frame; None for planes."""
        model, kinds = self._model, self._mujoco.mjtGeom
        kind = int(model.geom_type[geom])
        x, y, z = (float(v) for v in model.geom_size[geom])
        if kind == kinds.mjGEOM_PLANE:
            self._notes.append(f"{element}: a plane, left out")
            return None, np.eye(4)
        if kind == kinds.mjGEOM_BOX:
            return Box(half_size=(x, y, z)), np.eye(4)
        if kind == kinds.mjGEOM_SPHERE:
            return Ellipsoid(half_size=(x, x, x)), np.eye(4)
        if kind == kinds.mjGEOM_ELLIPSOID:
            return Ellipsoid(half_size=(x, y, z)), np.eye(4)
        if kind == kinds.mjGEOM_CYLINDER:
            return Cylinder(radius=x, half_length=y), _Z_FROM_X
        if kind == kinds.mjGEOM_CAPSULE:
            return Capsule(radius=x, half_length=y), _Z_FROM_X
        if kind == kinds.mjGEOM_MESH:
            return self._mesh(int(model.geom_dataid[geom]), geom, element), np.eye(4)
        self._refuse(
            "a kind of geom that is not supported",
            element=element,
            value=kind,
            remedy="Use box, sphere, capsule, cylinder, ellipsoid or mesh.",
        )

    def _mesh(self, mesh: int, geom: int, element: str) -> tuple[MeshPiece, ...]:
        """Pieces of a mesh in the frame that MuJoCo gave it."""
        model = self._model
        material = int(model.geom_matid[geom])
        picture = self._source.pictures.get(self._name("mjOBJ_MATERIAL", material))
        key = mesh if picture is None else -1 - geom
        if key in self._meshes:
            return self._meshes[key]
        start = int(model.mesh_vertadr[mesh])
        vertices = model.mesh_vert[start : start + int(model.mesh_vertnum[mesh])].astype(float)
        given = self._source.meshes[self._name("mjOBJ_MESH", mesh)]
        if len(vertices) != sum(len(p.mesh.vertices) for p in given):
            self._refuse(
                "MuJoCo changed the mesh's vertices", element=element, remedy="Simplify the mesh."
            )
        pieces, first = [], 0
        for piece in given:
            count = len(piece.mesh.vertices)
            own = TriangleMesh(vertices[first : first + count], piece.mesh.faces, piece.mesh.uv)
            look = None
            if picture is not None and own.uv is not None:
                look = Material(color=(1.0, 1.0, 1.0), texture=picture)
            pieces.append(MeshPiece(mesh=own, material=look))
            first += count
        self._meshes[key] = tuple(pieces)
        return self._meshes[key]

    # -- mass and joints --

    def _inertial(self, body: int, name: str) -> RawInertial | None:
        model = self._model
        mass = float(model.body_mass[body])
        if body == 0 or mass == 0.0:
            return None
        T_body_inertia = _transform(model.body_ipos[body], model.body_iquat[body])
        R = T_body_inertia[:3, :3]
        return RawInertial(
            mass=mass,
            center_of_mass=T_body_inertia[:3, 3],
            inertia=R @ np.diag(model.body_inertia[body]) @ R.T,
            element=f"body {name!r} inertial",
        )

    def _joints(self, body: int, name: str) -> list[RawJoint]:
        """A body's joints, parent and pose still open; one fixed joint where it has none."""
        model, kinds = self._model, self._mujoco.mjtJoint
        first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
        joints = []
        for j in range(first, first + count):
            known = self._name("mjOBJ_JOINT", j) or f"{name} joint {j - first + 1}"
            element = f"joint {known!r}"
            kind = int(model.jnt_type[j])
            if kind == kinds.mjJNT_FREE:
                if int(model.body_parentid[body]) != 0:
                    self._refuse("free inside the object", element=element, remedy="Remove it.")
                self._notes.append(f"{element}: free, left out: the base stands still")
                continue
            if kind == kinds.mjJNT_BALL:
                self._refuse(
                    "a ball joint", element=element, remedy="Use a hinge or a slide in its place."
                )
            joints.append(self._joint(j, known, element, kind == kinds.mjJNT_HINGE))
        return joints or [RawJoint(name=f"{name} fixed", type="fixed", parent="", child="")]

    def _joint(self, j: int, name: str, element: str, is_hinge: bool) -> RawJoint:
        model = self._model
        reference = float(model.qpos0[model.jnt_qposadr[j]])
        if model.jnt_limited[j]:
            lower, upper = (float(v) - reference for v in model.jnt_range[j])
        elif is_hinge:
            lower, upper = -UNLIMITED, UNLIMITED
            self._notes.append(f"{element}: no limits, taken to be half a turn either way")
        else:
            self._refuse("a slide without limits", element=element, remedy="Give range=.")
        if float(np.ravel(model.jnt_stiffness[j])[0]) > 0:
            self._notes.append(f"{element}: its spring was left out")
        dof = int(model.jnt_dofadr[j])
        # 0 is MuJoCo's default: such a file says nothing about friction.
        friction, damping = (
            float(np.ravel(array[dof])[0]) or None
            for array in (model.dof_frictionloss, model.dof_damping)
        )
        return RawJoint(
            name=name,
            type="revolute" if is_hinge else "prismatic",
            parent="",
            child="",
            axis=_vector(model.jnt_axis[j]),
            pivot=_vector(model.jnt_pos[j]),
            lower=lower,
            upper=upper,
            friction=friction,
            damping=damping,
            element=element,
        )


def _vector(values: Array) -> Vector:
    x, y, z = (float(v) for v in values)
    return (x, y, z)


def _transform(position: Array, quaternion: Array) -> Array:
    """Pose (4, 4) of a position and a quaternion wxyz."""
    rotation = matrix_from_quaternion(quaternion)
    return transforms.transform_from(rotation, np.asarray(position, dtype=float))
