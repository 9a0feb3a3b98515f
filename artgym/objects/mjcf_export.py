"""Objects written as MJCF for MuJoCo: bodies, hinges and slides, convex geoms, inertias.

Names, joint values, ranges, masses, damping and friction are the object's; a body's frame lies at
the pivot of its joint and is turned like the object's frame at rest. Patterns on primitive pieces
become plain colours. Bodies of the object do not collide with each other.
"""

from __future__ import annotations

import itertools
import os
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from artgym.errors import InvalidArgumentError
from artgym.files import write_file_whole
from artgym.geometry.rotations import quaternion_from_matrix
from artgym.objects.contents import Image, TriangleMesh
from artgym.objects.model import ArticulatedObject, Box, Convex, Cylinder, Link, Material
from artgym.objects.urdf_export import R_CYLINDER, link_origins, mesh_and_picture
from artgym.objects.wavefront import convex_mesh, file_stem, number_text, write_obj

Array = NDArray[np.floating]

_TYPES = {"prismatic": "slide", "revolute": "hinge"}
#: Torsional and rolling friction of geoms: MuJoCo's own defaults.
_OTHER_FRICTION = (0.005, 0.0001)
#: Groups of geoms as MuJoCo's viewer has them: what is seen, and what only collides.
_SEEN, _HIDDEN = "2", "3"


def write_mjcf(obj: ArticulatedObject, folder: str | os.PathLike[str]) -> Path:
    """Writes an object as MJCF with its meshes.

    Args:
        obj: the object.
        folder: made if missing; gets NAME.xml and meshes/, where NAME is the object id with "_" for
            "/". Files of these names are replaced.

    Returns:
        The MJCF file.

    Raises:
        InvalidArgumentError: a link is called "world", which MuJoCo keeps for itself.
        FileNotWrittenError: the system refused.
    """
    if "world" in obj.part_names:
        raise InvalidArgumentError(
            f"{obj.object_id} has a link named 'world', a name that MJCF keeps for itself: rename "
            "the link."
        )
    folder = Path(folder)
    name = file_stem(obj.object_id)
    model = ET.Element("mujoco", model=name)
    ET.SubElement(model, "compiler", angle="radian", meshdir=".", texturedir=".")
    assets = _Assets(ET.SubElement(model, "asset"), folder)
    world = ET.SubElement(model, "worldbody")
    origins = link_origins(obj)
    bodies: dict[str, ET.Element] = {}
    for i, link in enumerate(obj.links):
        joint = obj.joints[i - 1] if i else None
        parent = bodies[joint.parent] if joint else world
        offset = origins[link.name] - (origins[joint.parent] if joint else 0.0)
        body = ET.SubElement(parent, "body", name=link.name, pos=number_text(*offset))
        bodies[link.name] = body
        if joint is not None:
            low, high = sorted((joint.closed, joint.open))
            attributes = {
                "name": joint.name,
                "type": _TYPES[joint.type],
                "axis": number_text(*joint.axis),
                "limited": "true",
                "range": number_text(low, high),
                # The value of q where the bodies stand as they are written.
                "ref": number_text(joint.closed),
                "damping": number_text(joint.damping),
                "frictionloss": number_text(joint.friction),
            }
            ET.SubElement(body, "joint", attributes)
        _add_inertial(body, link, origins[link.name])
        _add_geoms(body, link, origins[link.name], assets, f"{name}_{i}_{file_stem(link.name)}")
    contact = ET.SubElement(model, "contact")
    for one, other in itertools.combinations(obj.part_names, 2):
        ET.SubElement(contact, "exclude", body1=one, body2=other)
    ET.indent(model)
    path = folder / f"{name}.xml"
    write_file_whole(path, (ET.tostring(model, encoding="unicode") + "\n").encode())
    return path


class _Assets:
    """The <asset> element, and the files it names."""

    def __init__(self, element: ET.Element, folder: Path) -> None:
        self._element = element
        self._folder = folder

    def add_mesh(
        self, name: str, mesh: TriangleMesh, *, picture: Image | None = None, shell: bool
    ) -> None:
        """Adds a mesh and writes its picture; one that need not enclose a volume is a shell."""
        file = f"meshes/{name}.obj"
        # The same bytes as beside a URDF: both may lie in one folder.
        write_obj(self._folder / file, mesh, picture)
        item = ET.SubElement(self._element, "mesh", name=name, file=file)
        if shell:
            item.set("inertia", "shell")

    def add_material(self, name: str, material: Material, picture: Image | None = None) -> None:
        """Adds how a geom looks; its picture lies beside its mesh."""
        attributes = {
            "name": name,
            "rgba": number_text(*material.color, 1.0),
            "metallic": number_text(material.metallic),
            "roughness": number_text(material.roughness),
        }
        if picture is not None:
            file = f"meshes/{name}.png"
            ET.SubElement(self._element, "texture", name=name, type="2d", file=file)
            attributes |= {"texture": name, "rgba": "1 1 1 1"}
        ET.SubElement(self._element, "material", attributes)


def _add_inertial(body: ET.Element, link: Link, origin: Array) -> None:
    I = link.inertia  # noqa: E741
    moments = (I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2])
    attributes = {
        "pos": number_text(*(link.center_of_mass - origin)),
        "mass": number_text(link.mass),
        "fullinertia": number_text(*moments),
    }
    ET.SubElement(body, "inertial", attributes)


def _add_geoms(body: ET.Element, link: Link, origin: Array, assets: _Assets, name: str) -> None:
    for i, visual in enumerate(link.visuals):
        seen = f"{name}_visual_{i}"
        mesh, picture = mesh_and_picture(visual)
        assets.add_mesh(seen, mesh, picture=picture, shell=True)
        assets.add_material(seen, visual.material, picture)
        attributes = {
            "name": seen,
            "type": "mesh",
            "mesh": seen,
            "material": seen,
            "pos": number_text(*-origin),
            "contype": "0",
            "conaffinity": "0",
            "group": _SEEN,
        }
        ET.SubElement(body, "geom", attributes)
    for i, shape in enumerate(link.shapes):
        piece, form = f"{name}_{i}", shape.geometry
        R = np.asarray(shape.rotation, dtype=float)
        if isinstance(form, Box):
            attributes = {"type": "box", "size": number_text(*form.half_size)}
        elif isinstance(form, Cylinder):
            R = R @ R_CYLINDER
            size = number_text(form.radius, form.half_length)
            attributes = {"type": "cylinder", "size": size}
        else:
            assert isinstance(form, Convex)
            assets.add_mesh(piece, convex_mesh(form), shell=False)
            attributes = {"type": "mesh", "mesh": piece}
        assets.add_material(piece, shape.material)
        attributes |= {
            "name": piece,
            "material": piece,
            "pos": number_text(*(np.asarray(shape.position, dtype=float) - origin)),
            "quat": number_text(*quaternion_from_matrix(R)),
            "friction": number_text(link.friction, *_OTHER_FRICTION),
            "group": _HIDDEN if link.visuals else _SEEN,
        }
        ET.SubElement(body, "geom", attributes)
