"""Files that should never load, each with what is wrong and what the error must say.

Nothing hostile lies in the repository: `python -m tests.hostile.corpus FOLDER` writes the files,
one folder a case, with `asset` (what is imported) beside `outside` (what must not be touched).
"""

from __future__ import annotations

import io
import json
import os
import struct
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

Kind = Literal["urdf", "mesh", "picture", "mjcf", "partnet", "description", "archive"]


@dataclass(frozen=True)
class Link:
    """A symbolic link; the target is relative to its folder."""

    target: str


@dataclass(frozen=True)
class Fifo:
    """A pipe that nobody writes to."""


@dataclass(frozen=True)
class Folder:
    """A folder where a file is expected."""


@dataclass(frozen=True)
class Sparse:
    """A file that claims a size and takes no space on the disk."""

    size: int


Content = bytes | Link | Fifo | Folder | Sparse


@dataclass(frozen=True, kw_only=True)
class HostileCase:
    """One thing that should be refused.

    Attributes:
        name: unique; the name of its folder.
        kind: what sort of file is hostile.
        what: what is wrong with it.
        files: contents by path in the asset folder; made when the case is written.
        entry: what is given to the importer, relative to the asset folder; "" is the folder itself.
        words: each occurs in the error's message, whatever the case of its letters.
    """

    name: str
    kind: Kind
    what: str
    files: Callable[[], Mapping[str, Content]]
    entry: str
    words: tuple[str, ...]

    def write(self, root: Path) -> Path:
        """Writes the case below ``root`` and returns what is to be imported."""
        folder = root / self.name
        asset = folder / "asset"
        for name, content in OUTSIDE.items():
            _write(folder / "outside" / name, content)
        asset.mkdir(parents=True, exist_ok=True)
        for name, content in self.files().items():
            if isinstance(content, bytes):
                content = content.replace(b"@OUTSIDE@", os.fsencode(folder.absolute() / "outside"))
            _write(asset / name, content)
        return asset / self.entry if self.entry else asset


def _write(path: Path, content: Content) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    match content:
        case Link(target):
            path.symlink_to(target)
        case Fifo():
            os.mkfifo(path)
        case Folder():
            path.mkdir()
        case Sparse(size):
            with open(path, "wb") as file:
                file.truncate(size)
        case bytes():
            path.write_bytes(content)


# --- Good files, to be spoilt --------------------------------------------------------------------

_CORNERS = [(x, y, z) for x in (0.0, 0.02) for y in (0.0, 0.3) for z in (0.0, 0.3)]
_FACES = [
    (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
    (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
]  # fmt: skip

GOOD_OBJ = (
    "".join(f"v {x} {y} {z}\n" for x, y, z in _CORNERS)
    + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in _FACES)
).encode()

GOOD_MTL = b"newmtl paint\nKd 0.8 0.2 0.2\nmap_Kd paint.png\n"


def textured_obj(mtllib: str = "door.mtl") -> bytes:
    """The good mesh with picture coordinates and a material."""
    lines = [f"mtllib {mtllib}", "usemtl paint"]
    lines += [f"v {x} {y} {z}" for x, y, z in _CORNERS]
    lines += [f"vt {y / 0.3} {z / 0.3}" for x, y, z in _CORNERS]
    lines += ["f " + " ".join(f"{i + 1}/{i + 1}" for i in face) for face in _FACES]
    return ("\n".join(lines) + "\n").encode()


def stl(faces: Iterable[tuple[int, int, int]] = tuple(_FACES), count: int | None = None) -> bytes:
    """The good mesh as binary STL, with any count of faces in its header."""
    body = b"".join(
        struct.pack("<12fH", 0, 0, 0, *(c for i in face for c in _CORNERS[i]), 0) for face in faces
    )
    count = len(body) // 50 if count is None else count
    return b"\0" * 80 + struct.pack("<I", count) + body


def ascii_stl() -> bytes:
    """The good mesh as text STL."""
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join("vertex {} {} {}\n".format(*_CORNERS[i]) for i in face)
        + "endloop\nendfacet\n"
        for face in _FACES
    )
    return f"solid door\n{facets}endsolid door\n".encode()


def png(width: int = 4, height: int = 4, pixels: bytes | None = None) -> bytes:
    """A picture, whose header may claim any size."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    if pixels is None:
        pixels = (b"\0" + b"\x80\x40\x20" * width) * height
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(pixels))
        + chunk(b"IEND", b"")
    )


def gltf_document() -> dict:
    """The good mesh as glTF, its buffer in the binary chunk."""
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": 8,
                "type": "VEC3",
                "min": [0, 0, 0],
                "max": [0.02, 0.3, 0.3],
            },
            {"bufferView": 1, "componentType": 5125, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": 144},
        ],
        "buffers": [{"byteLength": 240}],
    }


def gltf_buffer() -> bytes:
    """Corners and faces of the good mesh."""
    corners = [c for corner in _CORNERS for c in corner]
    return struct.pack("<24f36I", *corners, *(i for face in _FACES for i in face))


def glb(document: dict | bytes | None = None, binary: bytes | None = None) -> bytes:
    """A GLB file of a document and its buffer."""
    document = gltf_document() if document is None else document
    text = document if isinstance(document, bytes) else json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary = gltf_buffer() if binary is None else binary
    chunks = struct.pack("<I", len(text)) + b"JSON" + text
    if binary:
        chunks += struct.pack("<I", len(binary)) + b"BIN\0" + binary
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def dae() -> str:
    """The good mesh as Collada."""
    positions = " ".join(str(c) for corner in _CORNERS for c in corner)
    indices = " ".join(str(i) for face in _FACES for i in face)
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit name="meter" meter="1"/></asset>
  <library_geometries>
    <geometry id="door">
      <mesh>
        <source id="positions">
          <float_array id="positions-array" count="24">{positions}</float_array>
          <technique_common>
            <accessor source="#positions-array" count="8" stride="3">
              <param name="X" type="float"/><param name="Y" type="float"/>
              <param name="Z" type="float"/>
            </accessor>
          </technique_common>
        </source>
        <vertices id="vertices"><input semantic="POSITION" source="#positions"/></vertices>
        <triangles count="12">
          <input semantic="VERTEX" source="#vertices" offset="0"/>
          <p>{indices}</p>
        </triangles>
      </mesh>
    </geometry>
  </library_geometries>
  <library_visual_scenes>
    <visual_scene id="scene">
      <node id="node"><instance_geometry url="#door"/></node>
    </visual_scene>
  </library_visual_scenes>
  <scene><instance_visual_scene url="#scene"/></scene>
</COLLADA>
"""


GOOD_URDF = """<?xml version="1.0"?>
<robot name="cabinet">
  <link name="body">
    <inertial>
      <origin xyz="0 0 0.15" rpy="0 0 0"/>
      <mass value="5.0"/>
      <inertia ixx="0.06" ixy="0" ixz="0" iyy="0.05" iyz="0" izz="0.06"/>
    </inertial>
    <visual>
      <origin xyz="0 0 0.15" rpy="0 0 0"/>
      <geometry><box size="0.2 0.3 0.3"/></geometry>
      <material name="paint"><color rgba="0.5 0.5 0.6 1"/></material>
    </visual>
    <collision>
      <origin xyz="0 0 0.15" rpy="0 0 0"/>
      <geometry><box size="0.2 0.3 0.3"/></geometry>
    </collision>
  </link>
  <link name="door">
    <inertial>
      <origin xyz="0.01 0.15 0.15" rpy="0 0 0"/>
      <mass value="1.25"/>
      <inertia ixx="0.019" ixy="0" ixz="0" iyy="0.0095" iyz="0" izz="0.0095"/>
    </inertial>
    <visual>
      <geometry><mesh filename="meshes/door.obj" scale="1 1 1"/></geometry>
    </visual>
    <collision>
      <geometry><mesh filename="meshes/door.obj" scale="1 1 1"/></geometry>
    </collision>
  </link>
  <joint name="hinge" type="revolute">
    <origin xyz="0.105 -0.15 0.0" rpy="0 0 0"/>
    <parent link="body"/>
    <child link="door"/>
    <axis xyz="0 0 -1"/>
    <limit lower="0" upper="1.5" effort="10" velocity="10"/>
    <dynamics damping="0.1" friction="0.05"/>
  </joint>
</robot>
"""

GOOD_MJCF = """<mujoco model="cabinet">
  <compiler angle="radian" meshdir="meshes"/>
  <asset><mesh name="door" file="door.obj"/></asset>
  <worldbody>
    <body name="body">
      <inertial pos="0 0 0.15" mass="5" diaginertia="0.06 0.05 0.06"/>
      <geom type="box" size="0.1 0.15 0.15" pos="0 0 0.15"/>
      <body name="door" pos="0.105 -0.15 0">
        <joint name="hinge" type="hinge" axis="0 0 -1" range="0 1.5" damping="0.1"/>
        <geom type="mesh" mesh="door" mass="1.25"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""

#: What lies beside the asset folder, whole and inviting.
OUTSIDE: Mapping[str, bytes] = {
    "secret.obj": GOOD_OBJ,
    "secret.mtl": b"newmtl paint\nKd 1 0 0\n",
    "secret.png": png(),
    "secret.xml": GOOD_MJCF.encode(),
    "secret.json": b"{}",
    "secret.bin": gltf_buffer(),
    "door.obj": GOOD_OBJ,
}


def good_files() -> dict[str, Content]:
    """A cabinet with a door, which must load: the hostile files are this one, spoilt."""
    return {"object.urdf": GOOD_URDF.encode(), "meshes/door.obj": GOOD_OBJ}


def changed(text: str, old: str, new: str) -> str:
    """The text with one thing replaced, the first of its kind."""
    assert old in text, old
    return text.replace(old, new, 1)


# --- The cases -----------------------------------------------------------------------------------

CASES: list[HostileCase] = []


def _add(
    name: str,
    kind: Kind,
    what: str,
    words: str,
    files: Callable[[], Mapping[str, Content]],
    entry: str = "object.urdf",
) -> None:
    """Adds a case; words are separated by "|"."""
    CASES.append(
        HostileCase(
            name=name,
            kind=kind,
            what=what,
            files=files,
            entry=entry,
            words=tuple(w for w in words.split("|") if w),
        )
    )


def _urdf(
    name: str,
    what: str,
    old: str,
    new: str,
    words: str,
    *,
    file: str = "object.urdf",
    **files: Content,
) -> None:
    """A URDF with one thing replaced; ``file`` is where the fault lies."""
    text = changed(GOOD_URDF, old, new).encode()
    more = {path.replace("__", "/").replace("_dot_", "."): c for path, c in files.items()}
    _add(
        name,
        "urdf",
        what,
        f"{file}|{words}",
        lambda: {**good_files(), "object.urdf": text, **more},
    )


def _raw_urdf(
    name: str,
    what: str,
    content: Callable[[], Content],
    words: str = "",
    *,
    file: str = "object.urdf",
) -> None:
    """Something else in the URDF's place; ``file`` is where the fault lies."""
    _add(
        name,
        "urdf",
        what,
        f"{file}|{words}",
        lambda: {**good_files(), "object.urdf": content()},
    )


def _mesh(name: str, what: str, suffix: str, content: Callable[[], Content], words: str) -> None:
    """A mesh file in place of the good one; the URDF is sound."""
    text = GOOD_URDF.replace("door.obj", f"door{suffix}").encode()
    _add(
        name,
        "mesh",
        what,
        words,
        lambda: {"object.urdf": text, f"meshes/door{suffix}": content()},
    )


def _picture(name: str, what: str, content: Callable[[], Content], words: str) -> None:
    """A picture in place of the good one; URDF, OBJ and MTL are sound."""
    _add(
        name,
        "picture",
        what,
        words,
        lambda: {
            **good_files(),
            "meshes/door.obj": textured_obj(),
            "meshes/door.mtl": GOOD_MTL,
            "meshes/paint.png": content(),
        },
    )


def _material(name: str, what: str, mtllib: str, mtl: Content | None, words: str) -> None:
    """A material file in place of the good one."""
    files: dict[str, Content] = {"meshes/door.obj": textured_obj(mtllib), "meshes/paint.png": png()}
    if mtl is not None:
        files["meshes/door.mtl"] = mtl
    _add(name, "mesh", what, words, lambda: {**good_files(), **files})


def _mjcf(name: str, what: str, old: str, new: str, words: str, **files: Content) -> None:
    """An MJCF with one thing replaced."""
    text = changed(GOOD_MJCF, old, new).encode()
    _add(
        name,
        "mjcf",
        what,
        words,
        lambda: {"object.xml": text, "meshes/door.obj": GOOD_OBJ, **files},
        "object.xml",
    )


def _bomb(depth: int, width: int) -> str:
    entities = ['<!ENTITY a0 "ha">']
    entities += [f'<!ENTITY a{i} "{f"&a{i - 1};" * width}">' for i in range(1, depth)]
    return f"<!DOCTYPE robot [{''.join(entities)}]>"


# Paths out of the folder.
_OBJ = 'filename="meshes/door.obj"'
for _name, _what, _path in (
    ("mesh_path_dotdot", "a mesh path leads out of the folder", "../outside/secret.obj"),
    ("mesh_path_deep_dotdot", "as above, hidden in the middle", "meshes/../../outside/secret.obj"),
    ("mesh_path_absolute", "an absolute mesh path", "@OUTSIDE@/secret.obj"),
    ("mesh_path_file_url", "a file:// URL", "file://@OUTSIDE@/secret.obj"),
    ("mesh_path_http", "a mesh on the network", "http://localhost:9/secret.obj"),
    ("mesh_path_ftp", "a mesh on the network", "ftp://localhost/secret.obj"),
    ("mesh_path_package_dotdot", "package:// and ..", "package://pkg/../../outside/secret.obj"),
    ("mesh_path_package_absolute", "package:// and /", "package://pkg//@OUTSIDE@/secret.obj"),
    ("mesh_path_backslash", "a path as Windows writes it", "..\\outside\\secret.obj"),
    ("mesh_path_home", "somebody's home folder", "~/secret.obj"),
    ("mesh_path_missing", "a mesh that is not there", "meshes/nothing.obj"),
    ("mesh_path_encoded", "an encoded ..", "%2e%2e/outside/secret.obj"),
    ("mesh_path_directory", "a folder in a mesh's place", "meshes"),
    ("mesh_path_dot", "the folder itself", "."),
    ("mesh_path_long", "a name of 10,000 characters", "m" * 10_000 + ".obj"),
    ("mesh_path_newline", "a line break in a name", "meshes/do&#10;or.obj"),
    ("mesh_path_empty", "an empty name", ""),
    ("mesh_path_archive", "a mesh in an archive", "meshes/door.zip"),
    ("mesh_path_device", "a device", "/dev/zero"),
    ("mesh_path_proc", "a file of the kernel", "/proc/self/environ"),
):
    _raw_urdf(
        _name,
        _what,
        lambda path=_path: GOOD_URDF.replace(_OBJ, f'filename="{path}"').encode(),
        file="asset",
    )
for _name, _what, _target in (
    ("mesh_link_out", "a link out of the folder", "../../outside/secret.obj"),
    ("mesh_link_device", "a link to a device", "/dev/zero"),
    ("mesh_link_self", "a link to itself", "door.obj"),
    ("mesh_link_passwd", "a link to a file of the system", "/etc/passwd"),
):
    _urdf(_name, _what, "cabinet", "cabinet", "door", meshes__door_dot_obj=Link(_target))
_add(
    "mesh_folder_link_out",
    "urdf",
    "the folder of meshes is a link out",
    "object.urdf|door|link",
    lambda: {"object.urdf": GOOD_URDF.encode(), "meshes": Link("../outside")},
)
_mesh("mesh_is_fifo", "a pipe in a mesh's place", ".obj", Fifo, "door.obj|regular file")
_mesh("mesh_is_huge", "a mesh of 10 GB", ".obj", lambda: Sparse(10**10), "door.obj|larger")
_mesh("mesh_is_folder", "a folder in a mesh's place", ".obj", Folder, "door.obj|regular file")

# XML as such.
_raw_urdf("xml_empty", "an empty file", lambda: b"", "empty")
_raw_urdf("xml_fifo", "a pipe", Fifo, "regular file")
_raw_urdf("xml_folder", "a folder", Folder, "")
_raw_urdf("xml_link_out", "a link out of the folder", lambda: Link("../outside/secret.xml"), "")
_raw_urdf("xml_huge", "10 GB", lambda: Sparse(10**10), "larger")
_raw_urdf("xml_blank", "blanks only", lambda: b" \n" * 10, "XML")
_raw_urdf("xml_nul", "zero bytes", lambda: b"\0" * 1000, "XML")
_raw_urdf("xml_nul_inside", "a zero byte", lambda: GOOD_URDF.replace("5.0", "5\0").encode(), "XML")
_raw_urdf(
    "xml_billion_laughs",
    "nested entities",
    lambda: (
        changed(GOOD_URDF, "<robot", _bomb(30, 10) + "<robot")
        .replace('name="paint"', 'name="&a29;"')
        .encode()
    ),
    "DOCTYPE",
)
_raw_urdf(
    "xml_quadratic_blowup",
    "a long entity, many times",
    lambda: (
        changed(GOOD_URDF, "<robot", f'<!DOCTYPE robot [<!ENTITY a "{"a" * 50_000}">]><robot')
        .replace('name="paint"', f'name="{"&a;" * 50_000}"')
        .encode()
    ),
    "DOCTYPE",
)
_raw_urdf(
    "xml_external_entity",
    "an entity from a file",
    lambda: (
        changed(
            GOOD_URDF, "<robot", '<!DOCTYPE robot [<!ENTITY a SYSTEM "file:///etc/passwd">]><robot'
        )
        .replace("</robot>", "&a;</robot>")
        .encode()
    ),
    "DOCTYPE",
)
_raw_urdf(
    "xml_network_entity",
    "an entity from the network",
    lambda: (
        changed(
            GOOD_URDF, "<robot", '<!DOCTYPE robot [<!ENTITY a SYSTEM "http://localhost:9/">]><robot'
        )
        .replace("</robot>", "&a;</robot>")
        .encode()
    ),
    "DOCTYPE",
)
_raw_urdf(
    "xml_parameter_entity",
    "a parameter entity from a file",
    lambda: changed(
        GOOD_URDF,
        "<robot",
        '<!DOCTYPE robot [<!ENTITY % a SYSTEM "file:///etc/passwd"> %a;]><robot',
    ).encode(),
    "DOCTYPE",
)
_raw_urdf(
    "xml_external_dtd",
    "a document type on the network",
    lambda: changed(
        GOOD_URDF, "<robot", '<!DOCTYPE robot SYSTEM "http://localhost:9/robot.dtd"><robot'
    ).encode(),
    "DOCTYPE",
)
_raw_urdf(
    "xml_deep",
    "200,000 elements in each other",
    lambda: b"<robot name='a'>" + b"<link>" * 200_000,
    "levels",
)
_raw_urdf(
    "xml_wide",
    "a million elements",
    lambda: b"<robot name='a'>" + b"<a/>" * 1_000_000 + b"</robot>",
    "elements",
)
_raw_urdf(
    "xml_long_number",
    "a number of a million digits",
    lambda: changed(GOOD_URDF, '"5.0"', f'"{"5" * 1_000_000}"').encode(),
    "body|mass",
)
_raw_urdf("xml_utf16", "UTF-16 without a mark", lambda: GOOD_URDF.encode("utf-16-le"), "")
_raw_urdf("xml_utf16_bom", "UTF-16 with a mark", lambda: GOOD_URDF.encode("utf-16"), "UTF-8")
_raw_urdf("xml_utf32", "UTF-32", lambda: GOOD_URDF.encode("utf-32"), "UTF-8")
_raw_urdf(
    "xml_latin1",
    "Latin-1 that claims nothing",
    lambda: GOOD_URDF.replace("paint", "p\xe9inture").encode("latin-1"),
    "UTF-8",
)
_raw_urdf(
    "xml_utf7",
    "an encoding that hides things",
    lambda: GOOD_URDF.replace('?xml version="1.0"', '?xml version="1.0" encoding="utf-7"').encode(),
    "encoding|utf-7",
)
_raw_urdf(
    "xml_unknown_encoding",
    "an encoding that nobody knows",
    lambda: GOOD_URDF.replace('version="1.0"', 'version="1.0" encoding="klingon"', 1).encode(),
    "encoding|klingon",
)
_raw_urdf("xml_bom_garbage", "a mark and noise", lambda: b"\xef\xbb\xbf" + bytes(range(256)), "")
for _share in (10, 35, 60, 85, 99):
    _raw_urdf(
        f"xml_truncated_{_share}",
        f"cut off after {_share} %",
        lambda share=_share: GOOD_URDF.encode()[: len(GOOD_URDF) * share // 100],
        "XML",
    )
_raw_urdf("xml_two_roots", "two documents", lambda: (GOOD_URDF + "<robot/>").encode(), "XML")
_raw_urdf("xml_png", "a picture in a URDF's place", png, "")
_raw_urdf("xml_wrong_root", "no URDF", lambda: b"<html><body>no</body></html>", "html")
_urdf("xml_duplicate_attribute", "an attribute twice", 'value="5.0"', 'value="5" value="6"', "XML")
_urdf("xml_open_element", "an element without end", "</inertial>", "", "XML")

# Numbers of links.
for _label, _value in (
    ("nan", "nan"), ("inf", "inf"), ("minus_inf", "-inf"), ("negative", "-1.25"), ("zero", "0"),
    ("huge", "1e30"), ("overflow", "1e400"), ("text", "heavy"), ("empty", ""), ("comma", "1,25"),
    ("hex", "0x10"), ("two", "1.25 1.25"), ("underscore", "1_000"), ("arabic", "\u0661"),
):  # fmt: skip
    _urdf(
        f"mass_{_label}", f"a mass of {_value!r}", 'value="1.25"', f'value="{_value}"', "door|mass"
    )
_urdf("mass_missing", "no mass", '<mass value="1.25"/>', "", "door|mass")
_urdf("mass_twice", "two masses", '<mass value="1.25"/>', '<mass value="1"/>' * 2, "door|mass")
for _label, _old, _new in (
    ("nan", 'ixx="0.019"', 'ixx="nan"'),
    ("inf", 'izz="0.0095"', 'izz="inf"'),
    ("negative", 'ixx="0.019"', 'ixx="-0.019"'),
    (
        "zero",
        'ixx="0.019" ixy="0" ixz="0" iyy="0.0095" iyz="0" izz="0.0095"',
        'ixx="0" iyy="0" izz="0"',
    ),
    ("huge", 'ixx="0.019"', 'ixx="1e30"'),
    ("triangle", 'ixx="0.019"', 'ixx="19"'),
    ("indefinite", 'iyy="0.0095" iyz="0"', 'iyy="0.0095" iyz="5"'),
    ("text", 'ixx="0.019"', 'ixx="none"'),
    ("missing", 'ixx="0.019" ', ""),
):
    _urdf(f"inertia_{_label}", f"inertia: {_new or 'ixx missing'}", _old, _new, "door|inertia")
for _label, _value in (
    ("nan", "0.2 nan 0.3"), ("inf", "inf 0.3 0.3"), ("zero", "0.2 0 0.3"),
    ("negative", "0.2 -0.3 0.3"), ("huge", "1e9 0.3 0.3"), ("tiny", "1e-12 1e-12 1e-12"),
    ("two", "0.2 0.3"), ("four", "0.2 0.3 0.3 0.3"), ("text", "a b c"), ("empty", ""),
):  # fmt: skip
    _raw_urdf(
        f"box_{_label}",
        f"a box of size {_value!r}",
        lambda value=_value: GOOD_URDF.replace('size="0.2 0.3 0.3"', f'size="{value}"').encode(),
        "body",
    )
_BOX = '<geometry><box size="0.2 0.3 0.3"/></geometry>'
for _label, _new in (
    ("cylinder_zero", '<cylinder radius="0" length="0.3"/>'),
    ("cylinder_nan", '<cylinder radius="0.1" length="nan"/>'),
    ("cylinder_negative", '<cylinder radius="-0.1" length="0.3"/>'),
    ("cylinder_no_length", '<cylinder radius="0.1"/>'),
    ("sphere_zero", '<sphere radius="0"/>'),
    ("sphere_nan", '<sphere radius="nan"/>'),
    ("geometry_empty", ""),
    ("geometry_two", '<box size="0.2 0.3 0.3"/><sphere radius="0.1"/>'),
    ("geometry_unknown", '<teapot size="1"/>'),
):
    _raw_urdf(
        _label,
        f"geometry {_new or 'of nothing'}",
        lambda new=_new: GOOD_URDF.replace(_BOX, f"<geometry>{new}</geometry>").encode(),
        "body",
    )
for _label, _value in (
    ("nan", "nan 1 1"), ("inf", "1 inf 1"), ("zero", "1 1 0"), ("huge", "1e12 1e12 1e12"),
    ("tiny", "1e-12 1e-12 1e-12"), ("two", "1 1"), ("text", "big"), ("negative_zero", "-0.0 1 1"),
):  # fmt: skip
    _raw_urdf(
        f"scale_{_label}",
        f"a mesh scale of {_value!r}",
        lambda value=_value: GOOD_URDF.replace('scale="1 1 1"', f'scale="{value}"').encode(),
        "scale",
        # Where the scaled mesh is at fault, the message names the mesh.
        file="door.obj" if _label in ("huge", "tiny") else "object.urdf",
    )

# Joints.
_XYZ = 'xyz="0.105 -0.15 0.0" rpy="0 0 0"'
for _label, _new in (
    ("xyz_nan", 'xyz="nan 0 0"'),
    ("xyz_huge", 'xyz="1e300 0 0"'),
    ("xyz_two", 'xyz="0 0"'),
    ("rpy_inf", 'xyz="0 0 0" rpy="inf 0 0"'),
    ("rpy_text", 'xyz="0 0 0" rpy="up"'),
):
    _urdf(f"origin_{_label}", f"a joint's origin {_new}", _XYZ, _new, "hinge")
for _label, _value in (
    ("zero", "0 0 0"), ("nan", "nan 0 1"), ("inf", "inf 0 0"), ("two", "0 1"), ("text", "z"),
    ("tiny", "1e-300 0 0"),
):  # fmt: skip
    _urdf(f"axis_{_label}", f"an axis {_value}", 'xyz="0 0 -1"', f'xyz="{_value}"', "hinge|axis")
_LIMIT = 'lower="0" upper="1.5"'
for _label, _new in (
    ("reversed", 'lower="1.5" upper="0"'),
    ("nan", 'lower="0" upper="nan"'),
    ("inf", 'lower="-inf" upper="inf"'),
    ("huge", 'lower="0" upper="1e12"'),
    ("text", 'lower="0" upper="open"'),
):
    _urdf(f"limit_{_label}", f"limits {_new}", _LIMIT, _new, "hinge|limit")
_urdf(
    "limit_missing",
    "a revolute joint without limits",
    '<limit lower="0" upper="1.5" effort="10" velocity="10"/>',
    "",
    "hinge|limit",
)
_raw_urdf(
    "limit_slide_huge",
    "a slide of 1,000 km",
    lambda: (
        GOOD_URDF.replace('type="revolute"', 'type="prismatic"')
        .replace('upper="1.5"', 'upper="1e6"')
        .encode()
    ),
    "hinge|limit",
)
for _label, _old, _new in (
    ("friction_nan", 'friction="0.05"', 'friction="nan"'),
    ("friction_negative", 'friction="0.05"', 'friction="-1"'),
    ("damping_inf", 'damping="0.1"', 'damping="inf"'),
    ("damping_negative", 'damping="0.1"', 'damping="-1"'),
):
    _urdf(f"joint_{_label}", f"dynamics {_new}", _old, _new, "hinge")
for _type in ("floating", "planar", "telescopic", ""):
    _urdf(
        f"joint_type_{_type or 'empty'}",
        f"a joint of type {_type!r}",
        'type="revolute"',
        f'type="{_type}"',
        "hinge|type",
    )
_urdf("joint_no_type", "a joint without type", ' type="revolute"', "", "hinge|type")
_urdf("joint_no_parent", "a joint without parent", '<parent link="body"/>', "", "hinge|parent")
_urdf("joint_no_child", "a joint without child", '<child link="door"/>', "", "hinge|child")
_urdf(
    "joint_unknown_parent",
    "an unknown parent",
    '<parent link="body"/>',
    '<parent link="wall"/>',
    "hinge|wall",
)
_urdf(
    "joint_unknown_child",
    "an unknown child",
    '<child link="door"/>',
    '<child link="flap"/>',
    "hinge|flap",
)
_urdf(
    "joint_self",
    "a link that is its own parent",
    '<parent link="body"/>',
    '<parent link="door"/>',
    "ring",
)
_urdf("joint_no_name", "a joint without name", ' name="hinge"', "", "joint|name")
_urdf("link_no_name", "a link without name", '<link name="door">', "<link>", "link|name")
_urdf(
    "link_empty_name", "a link with an empty name", '<link name="door">', '<link name="">', "name"
)
_urdf("link_long_name", "a name of 10,000 characters", '"door"', f'"{"d" * 10_000}"', "name")
_urdf("link_control_name", "control characters in a name", '"door"', '"do&#7;or"', "")
_urdf("link_newline_name", "a line break in a name", '"door"', '"do&#10;or"', "name")
_urdf("link_twice", "two links of one name", '<link name="door">', '<link name="body">', "body")
_JOINT = GOOD_URDF[GOOD_URDF.index("  <joint") : GOOD_URDF.index("</robot>")]
_urdf("joint_twice", "two joints of one name", "</robot>", f"{_JOINT}</robot>", "")
_urdf(
    "two_parents",
    "a link with two parents",
    "</robot>",
    _JOINT.replace("hinge", "second") + "</robot>",
    "door",
)
_urdf(
    "two_roots", "a link that hangs on nothing", "</robot>", '<link name="loose"/></robot>', "loose"
)
_raw_urdf(
    "no_root",
    "two links that hang on each other",
    lambda: GOOD_URDF.replace(
        "</robot>",
        _JOINT.replace("hinge", "back")
        .replace('parent link="body"', 'parent link="x"')
        .replace('child link="door"', 'child link="body"')
        .replace('parent link="x"', 'parent link="door"')
        + "</robot>",
    ).encode(),
    "",
)
_raw_urdf("no_links", "no links at all", lambda: b'<robot name="a"></robot>', "link")
_raw_urdf(
    "no_joints",
    "nothing that moves",
    lambda: GOOD_URDF.replace('type="revolute"', 'type="fixed"').encode(),
    "",
)


def _chain(count: int, kind: str = "revolute") -> bytes:
    box = '<collision><geometry><box size="0.01 0.01 0.01"/></geometry></collision>'
    links = "".join(f'<link name="l{i}">{box}</link>' for i in range(count))
    joints = "".join(
        f'<joint name="j{i}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/>'
        '<axis xyz="0 0 1"/><limit lower="0" upper="1" effort="1" velocity="1"/></joint>'
        for i in range(count - 1)
    )
    return f'<robot name="chain">{links}{joints}</robot>'.encode()


_raw_urdf("links_10000", "10,000 links", lambda: _chain(10_000), "links")
_raw_urdf(
    "links_10000_fixed",
    "10,000 links fixed to each other",
    lambda: _chain(10_000, "fixed"),
    "links",
)
_raw_urdf(
    "pieces_20000",
    "a link of 20,000 pieces",
    lambda: GOOD_URDF.replace(
        "<collision>",
        '<collision><geometry><box size="0.01 0.01 0.01"/></geometry></collision>' * 20_000
        + "<collision>",
        1,
    ).encode(),
    "pieces",
)
for _label, _new in (
    ("nowhere", '<mimic joint="ghost" multiplier="1"/>'),
    ("itself", '<mimic joint="hinge" multiplier="1"/>'),
    ("nan", '<mimic joint="hinge" multiplier="nan"/>'),
):
    _urdf(f"mimic_{_label}", f"{_new}", "<axis", f"{_new}<axis", "hinge")
_urdf("color_nan", "a colour that is no number", "0.5 0.5 0.6 1", "nan 0.5 0.6 1", "color")
_urdf("color_short", "a colour of two numbers", "0.5 0.5 0.6 1", "0.5 0.5", "color")
_urdf(
    "texture_out",
    "a picture outside the folder",
    '<color rgba="0.5 0.5 0.6 1"/>',
    '<texture filename="../outside/secret.png"/>',
    "texture",
)

# OBJ and MTL.
_mesh("obj_empty", "an empty mesh", ".obj", lambda: b"", "door.obj|empty")
_mesh(
    "obj_no_faces",
    "points without faces",
    ".obj",
    lambda: GOOD_OBJ.split(b"f ")[0],
    "door.obj|faces",
)
_mesh("obj_no_vertices", "faces without points", ".obj", lambda: b"f 1 2 3\n", "door.obj|face")
for _label, _old, _new in (
    ("index_high", b"f 1 2 4", b"f 1 2 900"),
    ("index_huge", b"f 1 2 4", b"f 1 2 99999999999999999999"),
    ("index_negative", b"f 1 2 4", b"f 1 2 -900"),
    ("index_zero", b"f 1 2 4", b"f 1 2 0"),
    ("index_text", b"f 1 2 4", b"f 1 2 x"),
    ("index_two", b"f 1 2 4", b"f 1 2"),
    ("vertex_nan", b"v 0.0 0.0 0.0", b"v nan 0 0"),
    ("vertex_inf", b"v 0.0 0.0 0.0", b"v 0 inf 0"),
    ("vertex_huge", b"v 0.0 0.0 0.0", b"v 1e300 0 0"),
    ("vertex_text", b"v 0.0 0.0 0.0", b"v a b c"),
    ("vertex_two", b"v 0.0 0.0 0.0", b"v 0 0"),
    ("nul", b"v 0.0 0.0 0.0", b"v \x00 0 0"),
):
    _mesh(
        f"obj_{_label}",
        f"an OBJ line {_new!r}",
        ".obj",
        lambda old=_old, new=_new: GOOD_OBJ.replace(old, new, 1),
        "door.obj",
    )
_mesh(
    "obj_degenerate",
    "all points in one",
    ".obj",
    lambda: b"v 0 0 0\n" * 3 + b"f 1 2 3\n",
    "door.obj",
)
_mesh(
    "obj_line",
    "all points on a line",
    ".obj",
    lambda: b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n",
    "door.obj",
)
_mesh(
    "obj_polygon",
    "a face of a million corners",
    ".obj",
    lambda: GOOD_OBJ + b"f" + b" 1 2 3" * 600_000,
    "door.obj|faces",
)
_mesh("obj_png", "a picture in a mesh's place", ".obj", png, "door.obj")
_mesh(
    "obj_zip",
    "an archive in a mesh's place",
    ".obj",
    lambda: _zip({"door.obj": GOOD_OBJ}),
    "door.obj",
)
_mesh("obj_utf16", "UTF-16", ".obj", lambda: GOOD_OBJ.decode().encode("utf-16"), "door.obj")
_mesh(
    "obj_truncated",
    "cut off in a face",
    ".obj",
    lambda: GOOD_OBJ[: GOOD_OBJ.rindex(b" ")],
    "door.obj",
)
_material(
    "mtl_missing", "a material file that is not there", "nothing.mtl", None, "door.obj|nothing.mtl"
)
_material(
    "mtl_dotdot", "a material file outside", "../../outside/secret.mtl", None, "door.obj|secret.mtl"
)
_material("mtl_absolute", "a material file outside", "/etc/passwd.mtl", None, "door.obj|passwd")
_material(
    "mtl_link_out",
    "a link out of the folder",
    "door.mtl",
    Link("../../outside/secret.mtl"),
    "door|link",
)
_material("mtl_fifo", "a pipe", "door.mtl", Fifo(), "door.mtl|regular file")
_material("mtl_empty", "an empty material file", "door.mtl", b"", "door.mtl|empty")
_material(
    "mtl_kd_nan",
    "a colour that is no number",
    "door.mtl",
    b"newmtl paint\nKd nan 0 0\n",
    "door.mtl|line 2",
)
_material(
    "mtl_kd_text", "a colour in words", "door.mtl", b"newmtl paint\nKd red\n", "door.mtl|line 2"
)
for _label, _path in (
    ("dotdot", b"../../outside/secret.png"),
    ("absolute", b"@OUTSIDE@/secret.png"),
    ("http", b"http://localhost:9/secret.png"),
    ("options", b"-s 1 1 1 ../../outside/secret.png"),
    ("missing", b"nothing.png"),
):
    _material(
        f"mtl_map_{_label}",
        f"a picture {_path.decode()}",
        "door.mtl",
        b"newmtl paint\nmap_Kd " + _path + b"\n",
        "door.mtl|line 2",
    )

# Pictures.
_picture(
    "png_bomb",
    "a header that claims 40 Gpixel",
    lambda: png(200_000, 200_000, b"\0"),
    "paint.png|pixels",
)
_picture("png_zero", "no pixels", lambda: png(0, 0, b"\0"), "paint.png")
_picture("png_short", "fewer pixels than claimed", lambda: png(64, 64, b"\0" * 10), "paint.png")
_picture("png_truncated", "cut off", lambda: png(64, 64)[:60], "paint.png")
_picture("png_empty", "an empty picture", lambda: b"", "paint.png|empty")
_picture("png_text", "no picture", lambda: b"<svg onload='x()'/>", "paint.png")
_picture(
    "png_postscript",
    "a program",
    lambda: b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n",
    "paint.png",
)
_picture("png_fifo", "a pipe", Fifo, "paint.png|regular file")
_picture(
    "png_link_out",
    "a link out of the folder",
    lambda: Link("../../outside/secret.png"),
    "paint.png|link",
)

# STL and PLY.
_mesh(
    "stl_billion",
    "a header of a billion faces",
    ".stl",
    lambda: stl(count=10**9),
    "door.stl|1000000000",
)
_mesh(
    "stl_negative",
    "a header of 2^32 - 1 faces",
    ".stl",
    lambda: stl(count=2**32 - 1),
    "door.stl|4294967295",
)
_mesh("stl_none", "a header of no faces", ".stl", lambda: stl(()), "door.stl|faces")
_mesh("stl_short", "a header only", ".stl", lambda: b"\0" * 80, "door.stl")
_mesh("stl_truncated", "cut off in a face", ".stl", lambda: stl()[:-20], "door.stl")
_mesh(
    "stl_nan",
    "a point that is no number",
    ".stl",
    lambda: stl()[:100] + struct.pack("<f", float("nan")) + stl()[104:],
    "door.stl",
)
_mesh("stl_text_truncated", "text, cut off", ".stl", lambda: ascii_stl()[:-90], "door.stl")
_mesh(
    "stl_text_nan",
    "text with NaN",
    ".stl",
    lambda: ascii_stl().replace(b"vertex 0.0", b"vertex nan", 1),
    "door.stl",
)
_mesh(
    "stl_text_words",
    "text with words",
    ".stl",
    lambda: ascii_stl().replace(b"vertex 0.0", b"vertex zero", 1),
    "door.stl",
)
_PLY = (
    b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    b"property float z\nelement face 1000000000\nproperty list uchar int vertex_indices\n"
    b"end_header\n"
)
_mesh("ply_billion", "a header of a billion faces", ".ply", lambda: _PLY + b"\0" * 36, "door.ply")
_mesh(
    "mesh_script", "a script in a mesh's place", ".py", lambda: b"raise SystemExit(7)\n", "door.py"
)
_mesh(
    "mesh_pickle",
    "a pickle that would run a command",
    ".pkl",
    lambda: b"cos\nsystem\n(S'true'\ntR.",
    "door.pkl",
)
_mesh("mesh_no_suffix", "a mesh of no format", "", lambda: GOOD_OBJ, "door")

# Collada.
for _label, _what, _old, _new in (
    ("index_high", "a corner that is not there", "<p>0 1 3", "<p>0 1 300"),
    ("index_negative", "a corner below zero", "<p>0 1 3", "<p>0 1 -3"),
    ("index_nan", "a corner that is no number", "<p>0 1 3", "<p>0 1 nan"),
    ("index_huge", "a corner beyond all", "<p>0 1 3", "<p>0 1 1e300"),
    ("vertex_nan", "a point that is no number", 'count="24">0.0', 'count="24">nan'),
    ("vertex_text", "a point in words", 'count="24">0.0', 'count="24">zero'),
    ("no_source", "a source that is not there", 'source="#positions"/', 'source="#nothing"/'),
    ("source_self", "a source that is a node", 'source="#positions"/', 'source="#node"/'),
    ("stride_zero", "a stride of 0", 'stride="3"', 'stride="0"'),
    ("stride_nan", "a stride of NaN", 'stride="3"', 'stride="nan"'),
    ("offset_huge", "an offset of a billion", 'offset="0"', 'offset="1000000000"'),
    ("unit_zero", "a metre of 0 m", 'meter="1"', 'meter="0"'),
    ("unit_nan", "a metre of NaN m", 'meter="1"', 'meter="nan"'),
    (
        "node_self",
        "a node inside itself",
        "<instance_geometry",
        '<instance_node url="#node"/><instance_geometry',
    ),
    (
        "geometry_outside",
        "geometry of another file",
        'url="#door"',
        'url="../../outside/secret.dae#door"',
    ),
    ("no_mesh", "no mesh", "<mesh>", "<spline>"),
    ("not_collada", "another document", "COLLADA", "html"),
):
    _mesh(
        f"dae_{_label}",
        f"Collada: {_what}",
        ".dae",
        lambda old=_old, new=_new: dae().replace(old, new, 2 if "html" in new else 1).encode(),
        "door.dae",
    )
_mesh(
    "dae_external_entity",
    "Collada with an entity from a file",
    ".dae",
    lambda: (
        dae()
        .replace("<COLLADA", '<!DOCTYPE a [<!ENTITY a SYSTEM "file:///etc/passwd">]><COLLADA', 1)
        .replace("<p>", "<p>&a;")
        .encode()
    ),
    "door.dae|DOCTYPE",
)
_mesh(
    "dae_billion_laughs",
    "Collada with nested entities",
    ".dae",
    lambda: (
        dae().replace("<COLLADA", _bomb(30, 10) + "<COLLADA", 1).replace("<p>", "<p>&a29;").encode()
    ),
    "door.dae|DOCTYPE",
)
_mesh("dae_truncated", "Collada, cut off", ".dae", lambda: dae().encode()[:900], "door.dae")


# GLB and glTF.
def _gltf(name: str, what: str, change: Callable[[dict], None], words: str = "") -> None:
    def content() -> bytes:
        document = gltf_document()
        change(document)
        return glb(document)

    _mesh(f"glb_{name}", f"GLB: {what}", ".glb", content, f"door.glb|{words}")


def _external(uri: str) -> Callable[[dict], None]:
    return lambda d: d["buffers"][0].update(uri=uri)


def _with_picture(uri: str) -> Callable[[dict], None]:
    def change(document: dict) -> None:
        document["meshes"][0]["primitives"][0]["material"] = 0
        look = {"baseColorTexture": {"index": 0}}
        document["materials"] = [{"pbrMetallicRoughness": look}]
        document["textures"] = [{"source": 0}]
        document["images"] = [{"uri": uri}]

    return change


_gltf("buffer_dotdot", "a buffer outside", _external("../../outside/secret.bin"), "secret.bin")
_gltf("buffer_absolute", "a buffer outside", _external("/etc/passwd"), "passwd")
_gltf("buffer_http", "a buffer on the network", _external("http://localhost:9/a.bin"), "http")
_gltf("buffer_data", "a buffer that is no base64", _external("data:;base64,@@@@"), "base64")
_gltf("image_dotdot", "a picture outside", _with_picture("../../outside/secret.png"), "secret.png")
_gltf("image_http", "a picture on the network", _with_picture("http://localhost:9/a.png"), "http")
_gltf(
    "count_billion",
    "an accessor of a billion points",
    lambda d: d["accessors"][0].update(count=10**9),
    "1000000000",
)
_gltf(
    "count_negative", "an accessor of -8 points", lambda d: d["accessors"][0].update(count=-8), "-8"
)
_gltf(
    "count_float", "an accessor of 8.5 points", lambda d: d["accessors"][0].update(count=8.5), "8.5"
)
_gltf(
    "count_text",
    "an accessor of many points",
    lambda d: d["accessors"][0].update(count="many"),
    "many",
)
_gltf(
    "view_beyond",
    "a view beyond its buffer",
    lambda d: d["bufferViews"][1].update(byteLength=10**12),
    "bufferView",
)
_gltf(
    "view_negative",
    "a view that starts at -4",
    lambda d: d["bufferViews"][1].update(byteOffset=-4),
    "bufferView",
)
_gltf(
    "buffer_claims",
    "a buffer that claims a terabyte",
    lambda d: d["buffers"][0].update(byteLength=10**12),
    "buffer",
)
_gltf(
    "type_unknown",
    "numbers of an unknown type",
    lambda d: d["accessors"][0].update(componentType=1),
    "accessor",
)
_gltf("index_beyond", "a mesh that is not there", lambda d: d["nodes"][0].update(mesh=7), "7")
_gltf("index_negative", "mesh -1", lambda d: d["nodes"][0].update(mesh=-1), "-1")
_gltf("node_cycle", "a node inside itself", lambda d: d["nodes"][0].update(children=[0]), "node")
_gltf(
    "matrix_nan_like", "a matrix of 3 numbers", lambda d: d["nodes"][0].update(matrix=[1, 0, 0]), ""
)
_gltf("scale_zero", "a node scaled to nothing", lambda d: d["nodes"][0].update(scale=[0, 0, 0]), "")
_gltf("scale_huge", "a node scaled by 1e300", lambda d: d["nodes"][0].update(scale=[1e300] * 3), "")
_gltf(
    "rotation_zero", "a rotation of length 0", lambda d: d["nodes"][0].update(rotation=[0] * 4), ""
)
_gltf(
    "draco",
    "a compression that is not supported",
    lambda d: d.update(extensionsRequired=["KHR_draco_mesh_compression"]),
    "draco",
)
_gltf("no_meshes", "no mesh", lambda d: d.update(meshes=[], nodes=[{}]), "faces")
_gltf("meshes_text", "meshes that are a text", lambda d: d.update(meshes="none"), "")
_gltf("accessors_null", "no accessors", lambda d: d.update(accessors=None), "")
_mesh(
    "glb_json_deep",
    "GLB: JSON of 100,000 levels",
    ".glb",
    lambda: glb(b"[" * 100_000),
    "door.glb|JSON",
)
_mesh(
    "glb_json_nan",
    "GLB: JSON with NaN",
    ".glb",
    lambda: glb(json.dumps(gltf_document()).replace("0.02", "NaN", 1).encode()),
    "door.glb|JSON",
)
_mesh("glb_json_list", "GLB: JSON that is a list", ".glb", lambda: glb(b"[]"), "door.glb")
_mesh(
    "glb_json_digits",
    "GLB: a number of 10,000 digits",
    ".glb",
    lambda: glb(b'{"a": ' + b"9" * 10_000 + b"}"),
    "door.glb",
)
_mesh(
    "glb_version",
    "GLB: version 1",
    ".glb",
    lambda: glb().replace(b"glTF\x02", b"glTF\x01", 1),
    "door.glb|version",
)
_mesh(
    "glb_length",
    "GLB: a wrong length",
    ".glb",
    lambda: glb()[:8] + b"\xff\xff\xff\xff" + glb()[12:],
    "door.glb|length",
)
_mesh(
    "glb_chunk",
    "GLB: a chunk of 4 GB",
    ".glb",
    lambda: glb()[:12] + b"\xff\xff\xff\xff" + glb()[16:],
    "door.glb|chunk",
)
_mesh("glb_magic", "GLB: noise", ".glb", lambda: b"\xde\xad\xbe\xef" * 100, "door.glb")
for _size in (3, 15, 100, 700):
    _mesh(
        f"glb_truncated_{_size}",
        f"GLB: {_size} bytes of it",
        ".glb",
        lambda size=_size: glb()[:size],
        "door.glb",
    )
_mesh(
    "gltf_dotdot",
    "glTF: a buffer outside",
    ".gltf",
    lambda: json.dumps(
        {**gltf_document(), "buffers": [{"byteLength": 240, "uri": "../../outside/secret.bin"}]}
    ).encode(),
    "door.gltf|secret.bin",
)

# MJCF.
for _name, _what, _old, _new, _words in (
    ("meshdir_dotdot", "meshes outside", 'meshdir="meshes"', 'meshdir="../outside"', "out of"),
    ("meshdir_absolute", "meshes outside", 'meshdir="meshes"', 'meshdir="@OUTSIDE@"', "outside"),
    (
        "file_dotdot",
        "a mesh outside",
        'file="door.obj"',
        'file="../../outside/secret.obj"',
        "secret.obj",
    ),
    (
        "file_absolute",
        "a mesh outside",
        'file="door.obj"',
        'file="@OUTSIDE@/secret.obj"',
        "secret.obj",
    ),
    ("file_missing", "a mesh that is not there", 'file="door.obj"', 'file="no.obj"', "no.obj"),
    ("mesh_unknown", "a mesh that nobody describes", 'mesh="door"', 'mesh="gate"', "gate"),
    (
        "include_out",
        "a part of the model outside",
        "<asset>",
        '<include file="../outside/secret.xml"/><asset>',
        "include",
    ),
    (
        "include_self",
        "a model that includes itself",
        "<asset>",
        '<include file="object.xml"/><asset>',
        "include",
    ),
    (
        "texture_out",
        "a picture outside",
        "<asset>",
        '<asset><texture name="t" type="2d" file="../../outside/secret.png"/>'
        '<material name="m" texture="t"/>',
        "",
    ),
    (
        "plugin",
        "a plugin to be loaded",
        "<geom",
        '<plugin plugin="mujoco.elasticity.cable"/><geom',
        "plugin",
    ),
    (
        "replicate",
        "a billion copies",
        "<worldbody>",
        '<worldbody><replicate count="1000000000" offset="1 0 0"><geom size="1"/></replicate>',
        "replicate",
    ),
    (
        "flexcomp",
        "a body of a billion points",
        "<worldbody>",
        '<worldbody><flexcomp name="f" type="grid" count="1000 1000 1000"/>',
        "flexcomp",
    ),
    ("axis_zero", "a zero axis", 'axis="0 0 -1"', 'axis="0 0 0"', "hinge|axis"),
    ("axis_nan", "an axis of NaN", 'axis="0 0 -1"', 'axis="nan 0 0"', "hinge|axis"),
    ("range_reversed", "a reversed range", 'range="0 1.5"', 'range="1.5 0"', "hinge|range"),
    ("range_nan", "a range of NaN", 'range="0 1.5"', 'range="0 nan"', "hinge|range"),
    ("range_inf", "a range without end", 'range="0 1.5"', 'range="0 inf"', "hinge|range"),
    ("mass_negative", "a negative mass", 'mass="5"', 'mass="-5"', "body|mass"),
    ("mass_nan", "a mass of NaN", 'mass="5"', 'mass="nan"', "body|mass"),
    (
        "inertia_negative",
        "negative inertia",
        'diaginertia="0.06 0.05 0.06"',
        'diaginertia="-1 1 1"',
        "body|inertia",
    ),
    ("size_zero", "a box of no size", 'size="0.1 0.15 0.15"', 'size="0 0 0"', "size"),
    ("size_nan", "a box of size NaN", 'size="0.1 0.15 0.15"', 'size="nan 1 1"', "size"),
    ("size_huge", "a box of 1e12 m", 'size="0.1 0.15 0.15"', 'size="1e12 1 1"', ""),
    ("size_missing", "a box without size", ' size="0.1 0.15 0.15"', "", "size"),
    ("pos_nan", "a position of NaN", 'pos="0.105 -0.15 0"', 'pos="nan 0 0"', "pos"),
    (
        "quat_zero",
        "a quaternion of length 0",
        'name="door" pos',
        'name="door" quat="0 0 0 0" pos',
        "quat",
    ),
    ("joint_ball", "a ball joint", 'type="hinge"', 'type="ball"', "hinge|ball"),
    ("joint_free", "a free joint", 'type="hinge"', 'type="free"', "free"),
    ("joint_unknown", "an unknown joint", 'type="hinge"', 'type="rubber"', "rubber"),
    ("geom_unknown", "an unknown geom", 'type="box"', 'type="teapot"', "teapot"),
    (
        "class_unknown",
        "defaults that are not there",
        'type="box"',
        'class="ghost" type="box"',
        "ghost",
    ),
    ("angle_unknown", "angles in gradians", 'angle="radian"', 'angle="grad"', "angle"),
    ("truncated", "cut off", "</worldbody>\n</mujoco>", "", "XML"),
    ("wrong_root", "another document", '<mujoco model="cabinet">', '<sdf version="1.6">', ""),
):
    _mjcf(f"mjcf_{_name}", _what, _old, _new, _words)
_mjcf(
    "mjcf_duplicate_body",
    "two bodies of one name",
    '<body name="door"',
    '<body name="body"',
    "body",
)
_add(
    "mjcf_no_bodies",
    "mjcf",
    "nothing in the world",
    "object.xml",
    lambda: {"object.xml": b"<mujoco><worldbody/></mujoco>"},
    "object.xml",
)
_add(
    "mjcf_deep",
    "mjcf",
    "10,000 bodies in each other",
    "object.xml",
    lambda: {
        "object.xml": b"<mujoco><worldbody>"
        + b"<body>" * 10_000
        + b"</body>" * 10_000
        + b"</worldbody></mujoco>"
    },
    "object.xml",
)
_add(
    "mjcf_billion_laughs",
    "mjcf",
    "nested entities",
    "object.xml|DOCTYPE",
    lambda: {
        "object.xml": (
            _bomb(30, 10).replace("robot", "mujoco") + '<mujoco model="&a29;"/>'
        ).encode()
    },
    "object.xml",
)


# PartNet-Mobility folders.
def _partnet(name: str, what: str, words: str, **files: Content) -> None:
    """A folder with one file replaced; a bad JSON stands where no semantics.txt says the same."""
    named = {path.replace("_dot_", "."): content for path, content in files.items()}
    urdf = GOOD_URDF.replace("meshes/", "textured_objs/")
    urdf = urdf.replace('"body"', '"link_0"').replace('"door"', '"link_1"')
    base: dict[str, Content] = {
        "mobility.urdf": urdf.encode(),
        "textured_objs/door.obj": GOOD_OBJ,
        "meta.json": b'{"model_cat": "StorageFurniture"}',
        "mobility_v2.json": json.dumps(mobility()).encode(),
    }
    if "mobility_v2.json" not in named:
        base["semantics.txt"] = b"link_0 heavy cabinet_body\nlink_1 hinge rotation_door\n"
    _add(name, "partnet", what, words, lambda: {**base, **named}, "")


def mobility() -> list[dict]:
    """A sound mobility_v2.json for the cabinet."""
    return [
        {
            "id": 0,
            "parent": -1,
            "joint": "heavy",
            "name": "cabinet_body",
            "parts": [],
            "jointData": {},
        },
        {
            "id": 1,
            "parent": 0,
            "joint": "hinge",
            "name": "rotation_door",
            "parts": [],
            "jointData": {},
        },
    ]


_partnet(
    "partnet_json_deep",
    "JSON of 100,000 levels",
    "mobility_v2.json",
    mobility_v2_dot_json=b"[" * 100_000,
)
_partnet(
    "partnet_json_nan",
    "JSON with NaN",
    "mobility_v2.json",
    mobility_v2_dot_json=json.dumps(mobility()).replace('"id": 1', '"id": NaN').encode(),
)
_partnet(
    "partnet_json_huge",
    "a number of 10,000 digits",
    "mobility_v2.json",
    mobility_v2_dot_json=b"[" + b"9" * 10_000 + b"]",
)
_partnet(
    "partnet_json_object",
    "an object in place of a list",
    "mobility_v2.json",
    mobility_v2_dot_json=b"{}",
)
_partnet(
    "partnet_json_text",
    "a text in place of an entry",
    "mobility_v2.json",
    mobility_v2_dot_json=b'["door"]',
)
_partnet(
    "partnet_json_types",
    "numbers in place of names",
    "mobility_v2.json",
    mobility_v2_dot_json=b'[{"id": [], "name": 7, "joint": {}}]',
)
_partnet(
    "partnet_json_truncated",
    "cut off",
    "mobility_v2.json",
    mobility_v2_dot_json=json.dumps(mobility()).encode()[:60],
)
_partnet("partnet_json_empty", "an empty file", "mobility_v2.json", mobility_v2_dot_json=b"")
_partnet("partnet_json_fifo", "a pipe", "mobility_v2.json", mobility_v2_dot_json=Fifo())
_partnet(
    "partnet_json_link",
    "a link out of the folder",
    "mobility_v2.json",
    mobility_v2_dot_json=Link("../outside/secret.json"),
)
_partnet(
    "partnet_semantics_binary", "no text", "semantics.txt", semantics_dot_txt=b"\xff\xfe\x00" * 9
)
_partnet(
    "partnet_semantics_short", "a line of one word", "semantics.txt", semantics_dot_txt=b"body\n"
)
_partnet(
    "partnet_semantics_unknown",
    "a link that is not there",
    "semantics.txt",
    semantics_dot_txt=b"link_7 hinge rotation_door\n",
)
_partnet("partnet_meta_list", "a list in place of an object", "meta.json", meta_dot_json=b"[]")
_partnet("partnet_meta_nan", "no JSON", "meta.json", meta_dot_json=b'{"model_cat": NaN}')
_partnet("partnet_urdf_empty", "an empty URDF", "mobility.urdf|empty", mobility_dot_urdf=b"")


# Folders and archives.
def _zip(files: Mapping[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in files.items():
            file.writestr(name, content)
    return buffer.getvalue()


_add(
    "zip_slip",
    "archive",
    "an archive whose names lead out",
    "object.zip|archive",
    lambda: {"object.zip": _zip({"../../outside/evil.obj": GOOD_OBJ})},
    "object.zip",
)
_add(
    "zip_bomb",
    "archive",
    "an archive of a gigabyte of zeros",
    "object.zip|archive",
    lambda: {"object.zip": _zip({"a.urdf": b"\0" * 2**24})},
    "object.zip",
)
_add(
    "zip_as_urdf",
    "archive",
    "an archive with a URDF's name",
    "object.urdf",
    lambda: {"object.urdf": _zip({"a.urdf": GOOD_URDF.encode()})},
)
_add(
    "tar_gz",
    "archive",
    "an archive",
    "object.tar.gz|archive",
    lambda: {"object.tar.gz": b"\x1f\x8b\x08" + b"\0" * 40},
    "object.tar.gz",
)
_add("folder_empty", "archive", "a folder of nothing", "asset", lambda: {}, "")
_add("folder_missing", "archive", "nothing there", "nothing.urdf", lambda: {}, "nothing.urdf")
_add(
    "folder_two",
    "archive",
    "a folder with two objects",
    "asset",
    lambda: {**good_files(), "other.urdf": GOOD_URDF.encode()},
    "",
)
_add(
    "folder_link_out",
    "archive",
    "a folder whose only object lies behind a link out",
    "asset",
    lambda: {"sub": Link("../outside")},
    "",
)
_add(
    "suffix_unknown",
    "archive",
    "a file of no known sort",
    "object.exe",
    lambda: {"object.exe": b"MZ"},
    "object.exe",
)


# Our own description.
def own_files(change: Callable[[dict], None] | None = None) -> dict[str, bytes]:
    """A sound description of the cabinet, changed."""
    import tempfile

    from artgym.objects.contents import Image, TriangleMesh
    from artgym.objects.description import write_description
    from artgym.objects.model import (
        ArticulatedObject,
        Box,
        Joint,
        Material,
        Shape,
        Visual,
    )
    from artgym.objects.model import Link as ObjectLink

    grey = Material(color=(0.5, 0.5, 0.5))
    uv = [(y / 0.3, z / 0.3) for _, y, z in _CORNERS]
    picture = Image([[[10, 20, 30]] * 4] * 4)
    visual = Visual(
        mesh=TriangleMesh(_CORNERS, _FACES, uv),
        material=Material(color=(1.0, 1.0, 1.0), texture=picture),
    )
    body = Shape(
        geometry=Box(half_size=(0.1, 0.15, 0.15)), position=(0.0, 0.0, 0.15), material=grey
    )
    door = Shape(
        geometry=Box(half_size=(0.01, 0.15, 0.15)), position=(0.115, 0.0, 0.15), material=grey
    )
    obj = ArticulatedObject(
        object_id="cabinet/own",
        category="cabinet",
        links=(
            ObjectLink(name="body", shapes=(body,)),
            ObjectLink(name="door", shapes=(door,), visuals=(visual,)),
        ),
        joints=(
            Joint(
                name="hinge", type="revolute", parent="body", child="door", axis=(0.0, 0.0, -1.0),
                pivot=(0.105, -0.15, 0.0), closed=0.0, open=1.5, friction=0.1, damping=0.1,
            ),
        ),
        attributes={"family": "chest"},
    )  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        write_description(obj, folder)
        files = {p.name: p.read_bytes() for p in Path(folder).iterdir()}
    if change is not None:
        content = json.loads(files["object.json"])
        change(content)
        files["object.json"] = json.dumps(content).encode()
    return files


def _description(
    name: str,
    what: str,
    change: Callable[[dict], None],
    words: str,
    *,
    file: str = "object.json",
) -> None:
    _add(
        f"own_{name}",
        "description",
        what,
        f"{file}|{words}",
        lambda: {f"a.artgym/{k}": v for k, v in own_files(change).items()},
        "a.artgym",
    )


def _own_file(
    name: str, what: str, file: str, content: Callable[[bytes], Content], words: str
) -> None:
    def files() -> dict[str, Content]:
        made: dict[str, Content] = {**own_files()}
        made[file] = content(own_files()[file])
        return {f"a.artgym/{k}": v for k, v in made.items()}

    _add(f"own_{name}", "description", what, f"{file}|{words}", files, "a.artgym")


def _door(d: dict) -> dict:
    return d["object"]["links"][1]


def _hinge(d: dict) -> dict:
    return d["object"]["joints"][0]


_description("format", "another format", lambda d: d.update(format="zip"), "format|zip")
_description(
    "version", "a version of the future", lambda d: d.update(schema_version=99), "99|version"
)
_description(
    "version_true", "a version of true", lambda d: d.update(schema_version=True), "version"
)
_description("hash", "another hash", lambda d: d.update(content_hash="0" * 64), "content_hash")
_description(
    "hash_changed",
    "a changed colour",
    lambda d: _door(d)["shapes"][0]["material"].update(color=[1, 0, 0]),
    "hash",
)
_description("missing", "no joints", lambda d: d["object"].pop("joints"), "joints")
_description("foreign", "a field that we do not know", lambda d: _door(d).update(code="x"), "code")
_description(
    "kind",
    "an unknown shape",
    lambda d: _door(d)["shapes"][0]["geometry"].update(kind="Teapot"),
    "geometry|Teapot",
)
_description(
    "kind_list",
    "a shape that is a list",
    lambda d: _door(d)["shapes"][0].update(geometry=[1]),
    "geometry",
)
_description(
    "size_negative",
    "a box inside out",
    lambda d: _door(d)["shapes"][0]["geometry"].update(half_size=[1, -1, 1]),
    "half_size|-1",
)
_description(
    "size_true",
    "true for a number",
    lambda d: _door(d)["shapes"][0]["geometry"].update(half_size=[1, True, 1]),
    "half_size[1]|True",
)
_description(
    "size_huge",
    "a box of 1e300 m",
    lambda d: _door(d)["shapes"][0]["geometry"].update(half_size=[1e300, 1, 1]),
    "half_size[0]|1e+300",
)
_description(
    "size_digits",
    "a number of 300 digits",
    lambda d: _door(d)["shapes"][0]["geometry"].update(half_size=[10**300, 1, 1]),
    "half_size[0]",
)
_description(
    "rotation",
    "a rotation that is none",
    lambda d: _door(d)["shapes"][0].update(rotation=[[2, 0, 0], [0, 1, 0], [0, 0, 1]]),
    "rotation",
)
_description("axis", "a zero axis", lambda d: _hinge(d).update(axis=[0, 0, 0]), "axis")
_description("range", "a joint that cannot move", lambda d: _hinge(d).update(open=0.0), "open")
_description(
    "friction", "negative friction", lambda d: _hinge(d).update(friction=-1), "friction|-1"
)
_description("type", "an unknown joint", lambda d: _hinge(d).update(type="ball"), "type|ball")
_description("parent", "an unknown parent", lambda d: _hinge(d).update(parent="ghost"), "ghost")
_description("names", "two links of one name", lambda d: _door(d).update(name="body"), "body")
_description("density", "a density of zero", lambda d: _door(d).update(density=0), "density")
_description("no_shapes", "a link of nothing", lambda d: _door(d).update(shapes=[]), "shapes")
_description(
    "mesh_index",
    "a mesh that is not there",
    lambda d: _door(d)["visuals"][0]["mesh"].update(index=9),
    "index|9",
)
_description(
    "mesh_claims",
    "a mesh of a billion points",
    lambda d: d["meshes"][0].update(vertices=10**9),
    "vertices",
)
_description(
    "mesh_size",
    "a mesh of another size",
    lambda d: d["meshes"][0].update(vertices=9),
    "vertices",
    file="arrays.npz",
)
_description(
    "picture_claims",
    "a picture of 10^10 pixels",
    lambda d: d["pictures"][0].update(height=100_000, width=100_000),
    "height",
)
_description(
    "links_many",
    "100,000 links",
    lambda d: d["object"].update(links=[_door(d)] * 100_000),
    "larger",
)
_own_file(
    "json_nan", "NaN for a number", "object.json", lambda b: b.replace(b"0.15", b"NaN", 1), "NaN"
)
_own_file(
    "json_overflow",
    "1e999 for a number",
    "object.json",
    lambda b: b.replace(b"0.15", b"1e999", 1),
    "1e999",
)
_own_file(
    "json_twice",
    "a field twice",
    "object.json",
    lambda b: b.replace(b'"format"', b'"object": 1, "format"', 1),
    "object",
)
_own_file("json_deep", "100,000 levels", "object.json", lambda b: b"[" * 100_000, "JSON")
_own_file("json_list", "a list", "object.json", lambda b: b"[]", "")
_own_file("json_empty", "an empty file", "object.json", lambda b: b"", "empty")
_own_file("json_truncated", "cut off", "object.json", lambda b: b[: len(b) // 2], "JSON")
_own_file("json_utf16", "UTF-16", "object.json", lambda b: b.decode().encode("utf-16"), "JSON")
_own_file("json_fifo", "a pipe", "object.json", lambda b: Fifo(), "regular file")
_own_file(
    "json_link",
    "a link out of the folder",
    "object.json",
    lambda b: Link("../../outside/secret.json"),
    "link",
)
_own_file("arrays_truncated", "cut off", "arrays.npz", lambda b: b[: len(b) // 2], "")
_own_file(
    "arrays_flipped",
    "a flipped bit",
    "arrays.npz",
    lambda b: b[:120] + bytes([b[120] ^ 4]) + b[121:],
    "",
)
_own_file("arrays_empty", "an empty file", "arrays.npz", lambda b: b"", "empty")
_own_file(
    "arrays_other",
    "no such arrays",
    "arrays.npz",
    lambda b: _zip({"../../evil.npy": b"x"}),
    "missing",
)
_own_file(
    "arrays_bomb",
    "a gigabyte of zeros",
    "arrays.npz",
    lambda b: _zip({"mesh_0_vertices.npy": b"\0" * 2**26}),
    "mesh_0_vertices",
)
_own_file(
    "arrays_pickle",
    "a pickle for an array",
    "arrays.npz",
    lambda b: _zip(
        {
            "mesh_0_vertices.npy": b"\x93NUMPY\x01\x00v\x00"
            b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }"
            + b" " * 62
            + b"\ncos\nsystem\n(S'true'\ntR."
        }
    ),
    "mesh_0_vertices",
)
_own_file("arrays_fifo", "a pipe", "arrays.npz", lambda b: Fifo(), "regular file")


def write_corpus(root: Path) -> dict[str, Path]:
    """Writes every case below ``root``; what is to be imported, by the case's name."""
    return {case.name: case.write(root) for case in CASES}


if __name__ == "__main__":
    written = write_corpus(Path(sys.argv[1]))
    print(f"{len(written)} cases in {sys.argv[1]}")
