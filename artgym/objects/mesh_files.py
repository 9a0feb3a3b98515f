"""Mesh files of others as triangles and materials: OBJ, STL, DAE (Collada), GLB and glTF.

Counts are checked before anything is built from them. Coordinates are taken as they stand in the
file, as robot simulators take them: no axis is swapped, whatever a file says of its upper side.
"""

from __future__ import annotations

import base64
import binascii
import io
import itertools
import json
import math
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath
from typing import Any, NoReturn, cast

import numpy as np
from numpy.typing import NDArray

from artgym.errors import AssetError
from artgym.geometry import transforms
from artgym.geometry.rotations import matrix_from_axis_angle, matrix_from_quaternion
from artgym.objects.asset_folder import AssetFolder
from artgym.objects.asset_xml import XmlElement, parse_xml
from artgym.objects.contents import Image, TriangleMesh
from artgym.objects.model import Material, Vector

Array = NDArray[np.floating]

MAX_FACES = 500_000
MAX_VERTICES = 1_000_000
#: Extents and coordinates of a mesh after scaling, metres.
MIN_EXTENT, MAX_COORDINATE = 1e-6, 1e4
#: Sides of a picture as it lies in its file, pixels, and what all pictures of an object may hold.
MAX_PICTURE_SIDE = 4096
MAX_TOTAL_PIXELS = 2**27
#: Sides of a picture as it is kept: larger ones are reduced.
KEPT_PICTURE_SIDE = 2048

_MAX_LINES = 5_000_000
#: An index that is out of range in every mesh.
_BEYOND = 2**31 - 1
_MAX_MATERIALS = 1000
#: Groups of faces with a material of their own, and nodes of a scene.
_MAX_SURFACES = 2000
_MAX_NODES = 10_000
#: Nodes and their children that are looked at in a scene in which nodes can stand several times.
_MAX_WALKED = 40_000
#: Numbers in one list of a Collada file, and commas in the JSON of a glTF file.
_MAX_NUMBERS = 8_000_000
_MAX_COMMAS = 500_000
#: Lines of an MTL file, and characters of one of them.
_MAX_MTL_LINES, _MAX_STATEMENT = 200_000, 2000
#: Scans of a progressive JPEG: each costs as much time as a whole picture.
_MAX_SCANS = 100
_GREY = Material(color=(0.6, 0.6, 0.6))
_SIMPLIFY = "Simplify the mesh."
_EXPORT_AGAIN = "Export the mesh again, or copy it again from its source."


@dataclass(frozen=True, kw_only=True)
class MeshPiece:
    """Triangles of one material.

    Attributes:
        mesh: the triangles, metres, in the file's axes.
        material: how the file says they look; None where it says nothing.
    """

    mesh: TriangleMesh
    material: Material | None


@dataclass
class _Surface:
    """Triangles on their way to a piece: not yet checked, not yet scaled."""

    vertices: Array
    faces: NDArray[np.integer]
    uv: Array | None
    material: Material | None


def read_mesh(
    folder: AssetFolder,
    name: str,
    scale: float | Sequence[float] = 1.0,
    *,
    mentioned_in: str = "",
    element: str = "",
    looks: bool = True,
) -> tuple[MeshPiece, ...]:
    """Reads a mesh file.

    Args:
        folder: where all files of the object lie.
        name: the mesh's file, as the mentioning file has it.
        scale: factor, or one for each axis; a negative one mirrors.
        mentioned_in: the file that names it, relative to the folder.
        element: the place in that file, for messages.
        looks: whether materials and pictures are wanted; without, materials are None.

    Returns:
        One piece for each material, in the order of first use; never empty.

    Raises:
        AssetError: anything wrong with the file, or with a file that it mentions.
        MissingDependencyError: a DAE file, and defusedxml is not installed.
    """
    inner = folder.locate(name, mentioned_in=mentioned_in, element=element)
    file = folder.label(inner)
    factors = np.broadcast_to(np.asarray(scale, dtype=float), 3)
    if not np.all(np.isfinite(factors)) or np.any(factors == 0):
        raise AssetError(
            folder.label(mentioned_in),
            "a mesh scale that is zero or not finite",
            element=element,
            value=tuple(factors.tolist()),
            remedy="Give finite factors other than zero.",
        )
    key = ("mesh", inner, tuple(factors.tolist()), looks)
    if key not in folder.decoded:
        suffix = PurePosixPath(inner).suffix.lower()
        if suffix not in _READERS:
            raise AssetError(
                file,
                "not a mesh format that can be read",
                value=suffix,
                remedy=f"Convert it to one of {', '.join(_READERS)}.",
            )
        # What overflows is infinite, and refused with its vertex.
        with np.errstate(over="ignore", invalid="ignore"):
            surfaces = _READERS[suffix](folder, inner, looks)
            folder.decoded[key] = _pieces(surfaces, factors, file)
    return cast(tuple[MeshPiece, ...], folder.decoded[key])


def read_picture(
    folder: AssetFolder, name: str, *, mentioned_in: str = "", element: str = ""
) -> Image:
    """Reads a picture: PNG, JPEG, BMP, TGA or WebP; large ones are reduced.

    Args:
        folder: where all files of the object lie.
        name: the picture's file, as the mentioning file has it.
        mentioned_in: the file that names it, relative to the folder.
        element: the place in that file, for messages.

    Raises:
        AssetError: no such file in the folder, too many pixels, or not a picture.
    """
    inner = folder.locate(name, mentioned_in=mentioned_in, element=element)
    key = ("picture", inner)
    if key not in folder.decoded:
        data = folder.read(inner, "picture")
        folder.decoded[key] = _picture(folder, data, folder.label(inner))
    return cast(Image, folder.decoded[key])


def _picture(folder: AssetFolder, data: bytes, file: str) -> Image:
    import PIL.Image

    if data[:2] == b"\xff\xd8" and data.count(b"\xff\xda") > _MAX_SCANS:
        raise AssetError(
            file, f"a JPEG of more than {_MAX_SCANS} scans", remedy="Save it without progression."
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            picture = PIL.Image.open(
                io.BytesIO(data), formats=("PNG", "JPEG", "BMP", "TGA", "WEBP")
            )
            width, height = picture.size
            if not (0 < max(width, height) <= MAX_PICTURE_SIDE and min(width, height) > 0):
                raise AssetError(
                    file,
                    f"a picture of more than {MAX_PICTURE_SIDE} pixels a side",
                    value=f"{width}x{height}",
                    remedy="Reduce it.",
                )
            folder.pixels_decoded += width * height
            if folder.pixels_decoded > MAX_TOTAL_PIXELS:
                raise AssetError(
                    file,
                    f"the object's pictures exceed {MAX_TOTAL_PIXELS} pixels in all",
                    remedy="Reduce them.",
                )
            picture.draft("RGB", (KEPT_PICTURE_SIDE, KEPT_PICTURE_SIDE))
            picture = picture.convert("RGB")
            picture.thumbnail((KEPT_PICTURE_SIDE, KEPT_PICTURE_SIDE))
            return Image(np.asarray(picture))
    except AssetError:
        raise
    except Exception as error:  # A decoder fed with hostile bytes fails in many ways.
        raise AssetError(
            file, f"not a picture that can be read: {error}", remedy="Save it as PNG or JPEG."
        ) from None


# --- Checks that all formats share ---------------------------------------------------------------


def _check_counts(vertices: int, faces: int, file: str) -> None:
    """Refuses more than the limits, before anything is built."""
    for count, limit, what in ((faces, MAX_FACES, "faces"), (vertices, MAX_VERTICES, "vertices")):
        if count > limit:
            raise AssetError(file, f"more than {limit} {what}", value=count, remedy=_SIMPLIFY)


def _check_surfaces(count: int, file: str) -> None:
    """Refuses more groups of faces than any mesh needs."""
    if count > _MAX_SURFACES:
        raise AssetError(
            file,
            f"more than {_MAX_SURFACES} groups of faces",
            value=count,
            remedy="Merge materials and parts of the mesh.",
        )


def _used_alone(vertices: Array, faces: NDArray[np.integer]) -> tuple[Array, NDArray[np.integer]]:
    """The vertices that faces use, and the faces with indices of these.

    Indices out of range are left as they are, to be refused with their face.
    """
    if not faces.size or faces.min() < 0 or faces.max() >= len(vertices):
        return vertices, faces
    used, inverse = np.unique(faces, return_inverse=True)
    return vertices[used], inverse.reshape(-1, 3)


def _pieces(surfaces: Iterable[_Surface], factors: Array, file: str) -> tuple[MeshPiece, ...]:
    """Checked, scaled, cleaned pieces."""
    surfaces = [s for s in surfaces if len(s.faces)]
    _check_counts(sum(len(s.vertices) for s in surfaces), sum(len(s.faces) for s in surfaces), file)
    if not surfaces:
        raise AssetError(file, "a mesh without faces", remedy="Export it with its triangles.")
    pieces = [p for p in (_piece(s, factors, file) for s in surfaces) if p is not None]
    if not pieces:
        raise AssetError(
            file, "a mesh without area: all faces are degenerate", remedy=_EXPORT_AGAIN
        )
    corners = np.concatenate([p.mesh.vertices for p in pieces])
    extent = float(np.ptp(corners, axis=0).max())
    if extent < MIN_EXTENT:
        raise AssetError(
            file,
            f"a mesh smaller than {MIN_EXTENT} m after scaling",
            value=f"{extent:.3g} m",
            remedy="Correct its scale.",
        )
    return tuple(pieces)


def _piece(surface: _Surface, factors: Array, file: str) -> MeshPiece | None:
    """A surface in metres without degenerate faces, or None where all of them are."""
    count = len(surface.vertices)
    faces = surface.faces
    outside = np.flatnonzero(((faces < 0) | (faces >= count)).any(axis=1))
    if len(outside):
        raise AssetError(
            file,
            f"a face uses a vertex that is not there; there are {count}",
            element=f"face {outside[0]}",
            value=tuple(faces[outside[0]].tolist()),
            remedy=_EXPORT_AGAIN,
        )
    vertices = surface.vertices * factors
    for what, values, limit in (
        ("coordinate", vertices, MAX_COORDINATE),
        ("picture coordinate", surface.uv, 1e6),
    ):
        if values is None:
            continue
        bad = np.flatnonzero(~(np.abs(values) <= limit).all(axis=1))
        if len(bad):
            raise AssetError(
                file,
                f"a {what} that is not finite or beyond {limit:g} after scaling",
                element=f"vertex {bad[0]}",
                value=tuple(values[bad[0]].tolist()),
                remedy="Correct the mesh or its scale.",
            )
    a, b, c = vertices[faces].swapaxes(0, 1)
    doubled_area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    longest = np.maximum.reduce([np.abs(b - a).max(1), np.abs(c - a).max(1), np.abs(c - b).max(1)])
    proper = doubled_area > np.maximum(1e-12 * longest**2, 1e-18)
    faces = faces[proper]
    if not len(faces):
        return None
    if np.prod(np.sign(factors)) < 0:
        faces = faces[:, ::-1]
    used, faces = np.unique(faces, return_inverse=True)
    return MeshPiece(
        mesh=TriangleMesh(
            vertices[used],
            faces.reshape(-1, 3),
            None if surface.uv is None else surface.uv[used],
        ),
        material=surface.material,
    )


def _floats(tokens: Sequence[bytes] | Sequence[str], file: str, element: str) -> Array:
    """Numbers of a text file; "nan" and "inf" pass here and are refused with their vertex."""
    try:
        if max(map(len, tokens), default=0) > 64:
            raise ValueError
        return np.fromiter(map(float, tokens), dtype=float, count=len(tokens))
    except ValueError:
        raise AssetError(
            file, "something that is no number", element=element, remedy=_EXPORT_AGAIN
        ) from None


def _color(values: Sequence[float], file: str, element: str) -> Vector:
    """Linear RGB cut to [0, 1]."""
    if len(values) < 3 or not all(math.isfinite(v) for v in values[:3]):
        raise AssetError(
            file,
            "not a colour",
            element=element,
            value=tuple(values),
            remedy="Give three numbers from 0 to 1.",
        )
    r, g, b = (float(min(max(v, 0.0), 1.0)) for v in values[:3])
    return (r, g, b)


# --- OBJ and MTL ---------------------------------------------------------------------------------


def _read_obj(folder: AssetFolder, inner: str, looks: bool) -> list[_Surface]:
    file = folder.label(inner)
    data = folder.read(inner, "mesh")
    if b"\0" in data:
        raise AssetError(file, "not text, as an OBJ file is", remedy=_EXPORT_AGAIN)
    _check_counts(data.count(b"\nv "), data.count(b"\nf "), file)
    if data.count(b"\n") + data.count(b"\r") > _MAX_LINES:
        raise AssetError(file, f"more than {_MAX_LINES} lines", remedy=_SIMPLIFY)
    positions: list[bytes] = []
    uvs: list[bytes] = []
    # Packed corners of triangles, and where each material begins among them.
    corners: list[int] = []
    known: dict[bytes, int] = {}
    uses: list[tuple[int, str]] = [(0, "")]
    materials_used = {""}
    libraries: list[str] = []
    for number, line in enumerate(data.replace(b"\\\n", b" ").splitlines(), start=1):
        keyword, _, rest = line.lstrip().partition(b" ")
        if keyword == b"v" or keyword == b"vt":
            tokens = rest.split()
            if len(tokens) < (3 if keyword == b"v" else 2):
                raise AssetError(
                    file,
                    "too few numbers",
                    element=f"line {number}",
                    value=line[:80],
                    remedy=_EXPORT_AGAIN,
                )
            if keyword == b"v":
                positions += tokens[:3]
            else:
                uvs += tokens[:2]
        elif keyword == b"f":
            polygon = []
            tokens = rest.split()
            _check_counts(0, len(corners) // 3 + len(tokens) - 2, file)
            for token in tokens:
                corner = known.get(token)
                if corner is None:
                    corner = _obj_corner(token, len(positions) // 3, len(uvs) // 2, file, number)
                    # A negative index counts back from here and means another vertex elsewhere.
                    if b"-" not in token:
                        known[token] = corner
                polygon.append(corner)
            if len(polygon) < 3:
                raise AssetError(
                    file,
                    "a face of fewer than three corners",
                    element=f"line {number}",
                    value=line[:80],
                    remedy=_EXPORT_AGAIN,
                )
            for i in range(1, len(polygon) - 1):
                corners += (polygon[0], polygon[i], polygon[i + 1])
        elif keyword == b"usemtl":
            uses.append((len(corners), rest.strip().decode("utf-8", "replace")))
            materials_used.add(uses[-1][1])
            _check_surfaces(len(materials_used), file)
        elif keyword == b"mtllib":
            libraries.append(rest.strip().decode("utf-8", "replace"))
        elif b"\t" in keyword:
            raise AssetError(
                file,
                "a tab after a keyword",
                element=f"line {number}",
                remedy="Separate words by blanks.",
            )
    vertices = _floats(positions, file, "v lines").reshape(-1, 3)
    uv = _floats(uvs, file, "vt lines").reshape(-1, 2) if uvs and looks else None
    packed = np.fromiter(corners, dtype=np.int64, count=len(corners))
    indices = np.stack([(packed >> 32) - 1, (packed & 0xFFFFFFFF) - 1], axis=1)
    materials = _obj_materials(folder, inner, libraries, uses) if looks else {}
    surfaces: dict[str, list[NDArray[np.int64]]] = {}
    for (start, material), (end, _) in itertools.pairwise([*uses, (len(indices), "")]):
        if end > start:
            surfaces.setdefault(material if looks else "", []).append(indices[start:end])
    return [
        _obj_surface(vertices, uv, np.concatenate(parts), materials.get(name), file)
        for name, parts in surfaces.items()
    ]


def _obj_corner(token: bytes, num_positions: int, num_uvs: int, file: str, line: int) -> int:
    """A corner's position in the upper 32 bits and picture coordinate in the lower ones.

    Both count from 1; 0 stands for none, and what is out of range stays out of range.
    """
    fields = token.split(b"/")
    try:
        if len(token) > 64 or len(fields) > 3 or b"_" in token:
            raise ValueError
        indices = [int(field) if field else None for field in (*fields, b"")[:2]]
    except ValueError:
        indices = [0]
    if 0 in indices or indices[0] is None:
        raise AssetError(
            file,
            "a corner that is no index of a vertex",
            element=f"line {line}",
            value=token[:40],
            remedy="Count vertices from 1.",
        )
    numbers = (num_positions, num_uvs)
    from_one = [
        0 if i is None else i if i > 0 else count + 1 + i
        for i, count in zip(indices, numbers, strict=True)
    ]
    for k, i in enumerate(indices):
        if i is not None and not 0 < from_one[k] < _BEYOND:
            from_one[k] = _BEYOND
    return from_one[0] << 32 | from_one[1]


def _obj_surface(
    vertices: Array,
    uv: Array | None,
    indices: NDArray[np.int64],
    material: Material | None,
    file: str,
) -> _Surface:
    """Triangles whose corners share one index for position and picture coordinate."""
    if uv is None or np.any(indices[:, 1] < 0):
        return _Surface(*_used_alone(vertices, indices[:, 0].reshape(-1, 3)), None, material)
    beyond = np.flatnonzero(indices[:, 1] >= len(uv))
    if len(beyond):
        raise AssetError(
            file,
            f"a face uses a picture coordinate that is not there; there are {len(uv)}",
            element=f"face {beyond[0] // 3}",
            remedy=_EXPORT_AGAIN,
        )
    # Positions out of range are refused later, with the face that uses them.
    if np.any((indices[:, 0] < 0) | (indices[:, 0] >= len(vertices))):
        return _Surface(vertices, indices[:, 0].reshape(-1, 3), None, material)
    keys, faces = np.unique(indices[:, 0] * len(uv) + indices[:, 1], return_inverse=True)
    return _Surface(vertices[keys // len(uv)], faces.reshape(-1, 3), uv[keys % len(uv)], material)


def _obj_materials(
    folder: AssetFolder, inner: str, libraries: list[str], uses: list[tuple[int, str]]
) -> Mapping[str, Material]:
    """Materials by name, of those that are used."""
    used = {name for _, name in uses if name}
    if not used:
        return {}
    materials: dict[str, Material] = {}
    for names in dict.fromkeys(libraries):
        # Several names can stand in one line, and names can hold blanks.
        short = len(names) <= _MAX_STATEMENT
        several = re.findall(r"\S.*?\.mtl(?=\s|$)", names, re.IGNORECASE) if short else []
        for name in several or [names]:
            materials |= _read_mtl(folder, folder.locate(name, mentioned_in=inner), used)
    return materials


def _read_mtl(folder: AssetFolder, inner: str, used: set[str]) -> dict[str, Material]:
    file = folder.label(inner)
    text = folder.read(inner, "text").decode("utf-8", "replace")
    if text.count("\n") > _MAX_MTL_LINES:
        raise AssetError(file, f"more than {_MAX_MTL_LINES} lines", remedy="Merge materials.")
    materials: dict[str, Material] = {}
    name, color, texture = "", _GREY.color, None
    for number, line in enumerate([*text.splitlines(), "newmtl"], start=1):
        keyword, _, rest = line.strip().partition(" ")
        keyword, element = keyword.lower(), f"line {number}"
        if len(line) > _MAX_STATEMENT:
            raise AssetError(
                file,
                f"a line of more than {_MAX_STATEMENT} characters",
                element=element,
                remedy="Write one statement a line.",
            )
        if keyword == "newmtl":
            if name in used:
                materials[name] = Material(color=color, texture=texture)
            if len(materials) > _MAX_MATERIALS:
                raise AssetError(
                    file, f"more than {_MAX_MATERIALS} materials", remedy="Merge materials."
                )
            name, color, texture = rest.strip(), _GREY.color, None
        elif keyword == "kd" and not rest.strip().startswith(("spectral", "xyz")):
            color = _color(_floats(rest.split(), file, element).tolist(), file, element)
        elif keyword == "map_kd" and name in used and _picture_name(rest):
            texture = read_picture(folder, _picture_name(rest), mentioned_in=inner, element=element)
    return materials


def _picture_name(statement: str) -> str:
    """The file's name in an MTL statement, which options such as "-s 1 1 1" can precede."""
    words = statement.strip()
    while words.startswith("-"):
        option, _, words = words.partition(" ")
        words = words.lstrip()
        # -o, -s and -t take one to three numbers, -mm two, all others one word.
        if option not in ("-o", "-s", "-t", "-mm"):
            words = words.partition(" ")[2].lstrip()
        while option in ("-o", "-s", "-t", "-mm") and re.match(r"[+-]?[\d.]+(\s|$)", words):
            words = words.partition(" ")[2].lstrip()
    return words


# --- STL -----------------------------------------------------------------------------------------

_STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_STL_VERTEX = re.compile(rb"^[ \t]*vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)[ \t\r]*$", re.MULTILINE)


def _read_stl(folder: AssetFolder, inner: str, looks: bool) -> list[_Surface]:
    del looks
    file = folder.label(inner)
    data = folder.read(inner, "mesh")
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else -1
    if count >= 0 and len(data) == 84 + 50 * count:
        _check_counts(0, count, file)
        corners = np.frombuffer(data, _STL_FACET, offset=84)["corners"].reshape(-1, 3).astype(float)
    elif data[:512].lstrip().lower().startswith(b"solid") and b"\0" not in data:
        corners = _ascii_stl(data, file)
    else:
        raise AssetError(
            file,
            "a binary STL whose size does not match its number of faces",
            element="header",
            value=f"{count} faces, {len(data)} bytes",
            remedy=_EXPORT_AGAIN,
        )
    vertices, faces = _merged(corners)
    return [_Surface(vertices, faces.reshape(-1, 3), None, None)]


def _ascii_stl(data: bytes, file: str) -> Array:
    """Corners (3 m, 3) of m faces."""
    data = data.replace(b"\r\n", b"\n").replace(b"\r", b"\n").lower()
    facets = data.count(b"endfacet")
    _check_counts(0, max(facets, data.count(b"vertex") // 3), file)
    found = _STL_VERTEX.findall(data)
    if len(found) != 3 * facets or data.count(b"endloop") != facets or b"endsolid" not in data:
        raise AssetError(
            file,
            "an STL whose faces are not all three vertices, or that is cut off",
            value=f"{len(found)} vertices, {facets} faces",
            remedy=_EXPORT_AGAIN,
        )
    tokens = list(itertools.chain.from_iterable(found))
    return _floats(tokens, file, "vertex lines").reshape(-1, 3)


def _merged(corners: Array) -> tuple[Array, NDArray[np.intp]]:
    """Different points (n, 3) among corners, in a fixed order, and the index of each corner."""
    if not len(corners):
        return corners, np.zeros(0, dtype=np.intp)
    # Adding zero makes -0.0 equal to 0.0 byte by byte.
    rows = np.ascontiguousarray(corners + 0.0).view(np.dtype((np.void, 24))).ravel()
    _, first, inverse = np.unique(rows, return_index=True, return_inverse=True)
    return corners[first], inverse.ravel()


# --- Collada -------------------------------------------------------------------------------------


def _read_dae(folder: AssetFolder, inner: str, looks: bool) -> list[_Surface]:
    file = folder.label(inner)
    root = parse_xml(folder.read(inner, "mesh"), file)
    for item in root.iter():
        if isinstance(item.tag, str):
            item.tag = item.tag.rpartition("}")[2]
    if root.tag != "COLLADA":
        raise AssetError(file, "not a Collada file", value=root.tag, remedy=_EXPORT_AGAIN)
    return _Collada(folder, inner, XmlElement(root, file, "COLLADA"), looks).surfaces()


class _Collada:
    """A Collada document: geometries placed by the nodes of its scene."""

    def __init__(self, folder: AssetFolder, inner: str, root: XmlElement, looks: bool) -> None:
        self._folder, self._inner, self._root, self._looks = folder, inner, root, looks
        self._file = root.file
        self._by_id: dict[str, XmlElement] = {}
        for item in root.element.iter():
            if "id" in item.attrib and isinstance(item.tag, str):
                name = item.attrib["id"]
                self._by_id[name] = XmlElement(item, self._file, f"{item.tag} {name!r}")
        self._geometry_surfaces: dict[str, list[tuple[str, _Surface]]] = {}
        self._values: dict[tuple[str, int], Array] = {}
        self._materials: dict[str, Material] = {}
        self._bound: dict[int, dict[str, Material]] = {}
        self._faces = self._surfaces = self._walked = 0

    def surfaces(self) -> list[_Surface]:
        unit = 1.0
        asset = self._root.child("asset")
        if asset is not None and (metre := asset.child("unit")) is not None:
            unit = metre.positive("meter")[0] if "meter" in metre.element.attrib else 1.0
        scale = np.diag([unit, unit, unit, 1.0])
        surfaces: list[_Surface] = []
        scenes = self._root.element.iter("visual_scene")
        # A node can be placed by several others: what is walked is a tree of places, not of nodes.
        stack = [
            (XmlElement(node, self._file, "node"), scale, 0)
            for scene in scenes
            for node in reversed(scene.findall("node"))
        ]
        if not stack:
            for geometry in self._root.element.iter("geometry"):
                name = geometry.get("id", "")
                surfaces += self._placed(XmlElement(geometry, self._file, name), scale, {})
            return surfaces
        while stack:
            node, T_scene_parent, depth = stack.pop()
            self._walked += 1 + len(node.element)
            if self._walked > _MAX_WALKED or depth > 64:
                node.refuse("too many nodes, or nodes that hold themselves", remedy=_SIMPLIFY)
            T_scene_node = T_scene_parent @ self._transform(node)
            for child in reversed(node.children()):
                if child.tag == "node":
                    stack.append((child, T_scene_node, depth + 1))
                elif child.tag == "instance_node":
                    stack.append((self._referred(child, "url", "node"), T_scene_node, depth + 1))
                elif child.tag == "instance_controller":
                    child.refuse("a skinned mesh", remedy="Export it as a plain mesh.")
            for child in node.children("instance_geometry"):
                geometry = self._referred(child, "url", "geometry")
                surfaces += self._placed(geometry, T_scene_node, self._bindings(child))
        return surfaces

    def _referred(self, item: XmlElement, key: str, tag: str) -> XmlElement:
        """What "#name" refers to."""
        found = self._by_id.get(item.text(key).removeprefix("#"))
        if found is None or found.tag != tag:
            item.refuse(f"refers to no <{tag}>", value=item.text(key), remedy=_EXPORT_AGAIN)
        return found

    def _words(self, item: XmlElement) -> list[str]:
        """An element's text, cut at blanks."""
        text = item.element.text or ""
        if sum(map(text.count, " \t\r\n")) > _MAX_NUMBERS:
            item.refuse(f"more than {_MAX_NUMBERS} numbers", remedy=_SIMPLIFY)
        return text.split()

    def _numbers(self, item: XmlElement, count: int) -> Array:
        """An element's text as so many finite numbers."""
        values = _floats(self._words(item), self._file, item.place)
        if len(values) != count or not np.all(np.isfinite(values)):
            item.refuse(f"not {count} finite numbers", remedy=_EXPORT_AGAIN)
        return values

    def _transform(self, node: XmlElement) -> Array:
        """``T_parent_node`` (4, 4)."""
        T = np.eye(4)
        for item in node.children():
            if item.tag == "matrix":
                T = T @ self._numbers(item, 16).reshape(4, 4)
            elif item.tag == "translate":
                T = T @ transforms.translation(self._numbers(item, 3))
            elif item.tag == "scale":
                T = T @ np.diag([*self._numbers(item, 3), 1.0])
            elif item.tag == "rotate":
                x, y, z, degrees = self._numbers(item, 4)
                length = math.sqrt(x * x + y * y + z * z)
                if not length > 0:
                    item.refuse("an axis of length zero", remedy=_EXPORT_AGAIN)
                rotvec = np.array([x, y, z]) / length * math.radians(degrees)
                T = T @ transforms.transform_from(matrix_from_axis_angle(rotvec), np.zeros(3))
            elif item.tag in ("lookat", "skew"):
                item.refuse("a transform that is not supported", remedy="Apply transforms first.")
        return T

    def _bindings(self, instance: XmlElement) -> dict[str, Material]:
        """Materials by the symbols that faces use."""
        if not self._looks:
            return {}
        bound = self._bound.setdefault(id(instance.element), {})
        if bound:
            return bound
        for item in instance.element.iter("instance_material"):
            link = XmlElement(item, self._file, f"{instance.place} instance_material")
            material = self._referred(link, "target", "material")
            bound[link.text("symbol")] = self._material(material)
        return bound

    def _material(self, material: XmlElement) -> Material:
        name = material.element.get("id", "")
        if name not in self._materials:
            self._materials[name] = self._look(material)
        return self._materials[name]

    def _look(self, material: XmlElement) -> Material:
        """How a <material> looks, by its effect."""
        effect = self._referred(material.required_child("instance_effect"), "url", "effect")
        diffuse = next(effect.element.iter("diffuse"), None)
        if diffuse is None:
            return _GREY
        color, texture = diffuse.find("color"), diffuse.find("texture")
        if color is not None:
            values = _floats((color.text or "").split(), self._file, effect.place)
            return Material(color=_color(values.tolist(), self._file, effect.place))
        if texture is None:
            return _GREY
        # texture -> sampler -> surface -> image, by sid inside the effect; newer files skip some.
        parameters = {p.get("sid", ""): p for p in effect.element.iter("newparam")}
        name = texture.get("texture", "")
        for _ in range(3):
            parameter = parameters.get(name)
            if parameter is None:
                break
            source = next((e for tag in ("source", "init_from") for e in parameter.iter(tag)), None)
            name = (source.text or "").strip() if source is not None else ""
        image = self._by_id.get(name)
        if image is None or image.tag != "image":
            effect.refuse("a texture that leads to no <image>", value=name, remedy=_EXPORT_AGAIN)
        init = image.required_child("init_from")
        reference = init.child("ref")
        path = ((reference or init).element.text or "").strip()
        picture = read_picture(self._folder, path, mentioned_in=self._inner, element=image.place)
        return Material(color=_GREY.color, texture=picture)

    def _placed(
        self, geometry: XmlElement, T_scene_geometry: Array, materials: Mapping[str, Material]
    ) -> Iterator[_Surface]:
        """A geometry's surfaces in the scene's frame."""
        key = geometry.element.get("id", "")
        if key not in self._geometry_surfaces:
            self._geometry_surfaces[key] = self._surfaces_of(geometry)
        for symbol, surface in self._geometry_surfaces[key]:
            self._faces += len(surface.faces)
            self._surfaces += 1
            _check_counts(0, self._faces, self._file)
            _check_surfaces(self._surfaces, self._file)
            yield _transformed(surface, T_scene_geometry, materials.get(symbol))

    def _surfaces_of(self, geometry: XmlElement) -> list[tuple[str, _Surface]]:
        mesh = geometry.child("mesh")
        if mesh is None:
            geometry.refuse("not a mesh", remedy="Export it as a mesh of triangles.")
        found = []
        for item in mesh.children():
            if item.tag in ("triangles", "polylist", "polygons"):
                found.append((item.element.get("material", ""), self._triangles(item)))
            elif item.tag in ("tristrips", "trifans"):
                item.refuse("strips or fans of triangles", remedy="Export plain triangles.")
        return found

    def _source(self, item: XmlElement, width: int) -> Array:
        """A source's values (n, width)."""
        source = self._referred(item, "source", "source")
        key = (source.element.get("id", ""), width)
        if key in self._values:
            return self._values[key]
        array = source.required_child("float_array")
        values = _floats(self._words(array), self._file, array.place)
        stride = width
        for accessor in source.element.iter("accessor"):
            place = XmlElement(accessor, self._file, f"{source.place} accessor")
            stride = int(place.number("stride", 1.0))
            if place.number("offset", 0.0) != 0:
                place.refuse("an offset", remedy=_EXPORT_AGAIN)
        if stride < width or len(values) % stride or not len(values):
            source.refuse("a number of values that does not fit", remedy=_EXPORT_AGAIN)
        _check_counts(len(values) // stride, 0, self._file)
        self._values[key] = values.reshape(-1, stride)[:, :width]
        return self._values[key]

    def _triangles(self, item: XmlElement) -> _Surface:
        """The faces of a <triangles>, <polylist> or <polygons>."""
        offsets: dict[str, int] = {}
        sources: dict[str, XmlElement] = {}
        width = 1
        for source in item.children("input"):
            semantic, offset = source.text("semantic"), int(source.number("offset", 0.0))
            if not 0 <= offset < 32:
                source.refuse("an offset out of range", value=offset, remedy=_EXPORT_AGAIN)
            width = max(width, offset + 1)
            if semantic not in offsets:
                offsets[semantic], sources[semantic] = offset, source
        if "VERTEX" not in sources:
            item.refuse("no input of vertices", remedy=_EXPORT_AGAIN)
        vertices_item = self._referred(sources["VERTEX"], "source", "vertices")
        position = next(
            (i for i in vertices_item.children("input") if i.text("semantic") == "POSITION"), None
        )
        if position is None:
            vertices_item.refuse("no positions", remedy=_EXPORT_AGAIN)
        vertices = self._source(position, 3)
        tokens = [self._words(p) for p in item.children("p")]
        flat = np.concatenate(
            [np.zeros(0), *(_floats(t, self._file, f"{item.place} p") for t in tokens)]
        )
        if len(flat) % width or not np.all(np.isfinite(flat)) or np.any(np.abs(flat) > 2**31):
            item.refuse("indices that are cut off or no numbers", remedy=_EXPORT_AGAIN)
        indices = flat.astype(np.int64).reshape(-1, width)
        if item.tag == "triangles":
            sizes = np.full(len(indices) // 3, 3)
        elif item.tag == "polygons":
            sizes = np.array([len(t) // width for t in tokens], dtype=np.int64)
        else:
            vcount = item.required_child("vcount")
            counts = _floats(self._words(vcount), self._file, vcount.place)
            if not np.all((counts >= 3) & (counts <= len(indices))):
                item.refuse("a face of fewer than three corners", remedy=_EXPORT_AGAIN)
            sizes = counts.astype(np.int64)
        if sizes.sum() != len(indices) or (len(sizes) and sizes.min() < 3):
            item.refuse("indices that do not make whole faces", remedy=_EXPORT_AGAIN)
        _check_counts(0, int((sizes - 2).sum()), self._file)
        corners = _fan(sizes)
        pairs = np.full((len(corners), 2), -1, dtype=np.int64)
        pairs[:, 0] = indices[corners, offsets["VERTEX"]]
        uv = None
        if "TEXCOORD" in sources and self._looks:
            uv = self._source(sources["TEXCOORD"], 2)
            pairs[:, 1] = indices[corners, offsets["TEXCOORD"]]
        return _obj_surface(vertices, uv, pairs, None, self._file)


def _fan(sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Indices (3 m,) of corners that cut polygons of these sizes, in a row, into m triangles.

    >>> _fan(np.array([3, 4])).tolist()
    [0, 1, 2, 3, 4, 5, 3, 5, 6]
    """
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]) if len(sizes) else sizes
    counts = sizes - 2
    first = np.repeat(starts, counts)
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.stack([first, first + within + 1, first + within + 2], axis=1).ravel()


def _transformed(surface: _Surface, T_a_b: Array, material: Material | None) -> _Surface:
    """A surface moved by an affine transform, turned outside again where it mirrors."""
    vertices = transforms.apply(T_a_b, surface.vertices)
    mirrors = np.linalg.det(T_a_b[:3, :3]) < 0
    faces = surface.faces[:, ::-1] if mirrors else surface.faces
    return _Surface(vertices, faces, surface.uv, material or surface.material)


# --- glTF ----------------------------------------------------------------------------------------

_COMPONENTS: Mapping[int, str] = {
    5120: "i1",
    5121: "u1",
    5122: "<i2",
    5123: "<u2",
    5125: "<u4",
    5126: "<f4",
}
_WIDTHS: Mapping[str, int] = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_IGNORABLE = ("KHR_materials_", "KHR_texture_transform", "KHR_mesh_quantization")


def _read_gltf(folder: AssetFolder, inner: str, looks: bool) -> list[_Surface]:
    file = folder.label(inner)
    data = folder.read(inner, "mesh")
    binary = None
    if PurePosixPath(inner).suffix.lower() == ".glb":
        data, binary = _glb_chunks(data, file)

    def refuse_constant(name: str) -> NoReturn:
        raise ValueError(f"{name} is no JSON")

    if data.count(b",") > _MAX_COMMAS:
        raise AssetError(file, f"more than {_MAX_COMMAS} entries in its JSON", remedy=_SIMPLIFY)
    try:
        document = json.loads(data.decode("utf-8"), parse_constant=refuse_constant)
    except (ValueError, RecursionError) as error:
        raise AssetError(file, f"its JSON cannot be read: {error}", remedy=_EXPORT_AGAIN) from None
    try:
        return _Gltf(folder, inner, document, binary, looks).surfaces()
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError) as error:
        if isinstance(error, AssetError):
            raise
        raise AssetError(
            file,
            "not laid out as glTF 2.0 prescribes",
            value=f"{type(error).__name__}: {error}",
            remedy=_EXPORT_AGAIN,
        ) from None


def _glb_chunks(data: bytes, file: str) -> tuple[bytes, bytes | None]:
    """The JSON and binary chunks of a GLB file."""

    def refuse(problem: str, value: object) -> NoReturn:
        raise AssetError(file, problem, element="header", value=value, remedy=_EXPORT_AGAIN)

    if len(data) < 20 or data[:4] != b"glTF":
        refuse("not a GLB file", data[:4])
    version, length = (int.from_bytes(data[i : i + 4], "little") for i in (4, 8))
    if version != 2:
        refuse("a GLB version other than 2", version)
    if length != len(data):
        refuse("a length that is not the file's", f"{length}, file of {len(data)} bytes")
    chunks: list[tuple[bytes, bytes]] = []
    at = 12
    while at < len(data):
        size = int.from_bytes(data[at : at + 4], "little")
        if at + 8 + size > len(data) or len(chunks) > 16:
            refuse("a chunk that is longer than the file", f"{size} bytes at {at}")
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + size]))
        at += 8 + size
    if chunks[0][0] != b"JSON":
        refuse("a first chunk that is not JSON", chunks[0][0])
    return chunks[0][1], next((c for kind, c in chunks[1:] if kind == b"BIN\0"), None)


class _Gltf:
    """A glTF document: meshes placed by the nodes of its scene."""

    def __init__(
        self,
        folder: AssetFolder,
        inner: str,
        document: dict[str, Any],
        binary: bytes | None,
        looks: bool,
    ) -> None:
        self._folder, self._inner, self._looks = folder, inner, looks
        self._file = folder.label(inner)
        self._document, self._binary = document, binary
        self._buffers: dict[int, bytes] = {}
        self._pictures: dict[int, Image] = {}
        self._values: dict[tuple[int, int], NDArray[Any]] = {}
        self._faces = self._vertices = self._surfaces = self._decoded = 0
        required = [str(e) for e in document.get("extensionsRequired", [])]
        for extension in required:
            if not extension.startswith(_IGNORABLE):
                self._refuse(
                    "an extension that cannot be read",
                    "extensionsRequired",
                    extension,
                    "Export the mesh without compression.",
                )

    def _refuse(
        self, problem: str, element: str, value: object, remedy: str = _EXPORT_AGAIN
    ) -> NoReturn:
        raise AssetError(self._file, problem, element=element, value=value, remedy=remedy)

    def _item(self, table: str, index: object) -> dict[str, Any]:
        """An entry of a table, by an index that the file gives."""
        items = self._document.get(table, [])
        if type(index) is not int or not 0 <= index < len(items):
            self._refuse(f"no such entry; there are {len(items)}", table, index)
        return items[index]

    def surfaces(self) -> list[_Surface]:
        scenes = self._document.get("scenes", [])
        if scenes:
            roots = self._item("scenes", self._document.get("scene", 0)).get("nodes", [])
        else:
            roots = list(range(len(self._document.get("nodes", []))))
            children = {
                c for node in self._document.get("nodes", []) for c in node.get("children", [])
            }
            roots = [r for r in roots if r not in children]
        surfaces: list[_Surface] = []
        seen: set[int] = set()
        stack = [(index, np.eye(4)) for index in reversed(roots)]
        while stack:
            index, T_scene_parent = stack.pop()
            node = self._item("nodes", index)
            if index in seen:
                self._refuse("a node with two parents, or inside itself", "nodes", index)
            seen.add(index)
            if len(seen) > _MAX_NODES:
                self._refuse(f"more than {_MAX_NODES} nodes", "nodes", None, _SIMPLIFY)
            T_scene_node = T_scene_parent @ self._transform(node, index)
            stack += [(child, T_scene_node) for child in reversed(node.get("children", []))]
            if "skin" in node:
                self._refuse("a skinned mesh", f"node {index}", None, "Export it as a plain mesh.")
            if "mesh" in node:
                mesh = self._item("meshes", node["mesh"])
                for primitive in mesh["primitives"]:
                    surface = self._surface(primitive, f"mesh {node['mesh']}")
                    if surface is not None:
                        surfaces.append(_transformed(surface, T_scene_node, None))
        if not surfaces and not seen:
            for number, mesh in enumerate(self._document.get("meshes", [])):
                parts = (self._surface(p, f"mesh {number}") for p in mesh["primitives"])
                surfaces += [part for part in parts if part is not None]
        return surfaces

    def _transform(self, node: dict[str, Any], index: int) -> Array:
        """``T_parent_node`` (4, 4)."""
        if "matrix" in node:
            T = np.array(node["matrix"], dtype=float).reshape(4, 4).T
        else:
            quaternion = np.array(node.get("rotation", (0, 0, 0, 1)), dtype=float)
            if quaternion.shape != (4,) or not 1e-6 < np.linalg.norm(quaternion) < 1e6:
                self._refuse("not a rotation", f"node {index}", node["rotation"])
            R = matrix_from_quaternion(np.roll(quaternion, 1))
            T = transforms.transform_from(
                R @ np.diag(np.array(node.get("scale", (1, 1, 1)), dtype=float)),
                np.array(node.get("translation", (0, 0, 0)), dtype=float),
            )
        if T.shape != (4, 4) or not np.all(np.isfinite(T)):
            self._refuse("a transform that is not finite", f"node {index}", None)
        return T

    def _buffer(self, index: object) -> bytes:
        buffer = self._item("buffers", index)
        index = cast(int, index)
        if index not in self._buffers:
            uri = buffer.get("uri")
            if uri is None:
                if index != 0 or self._binary is None:
                    self._refuse("no data", f"buffer {index}", None)
                data = self._binary
            elif str(uri).startswith("data:"):
                data = self._data_uri(uri, f"buffer {index}")
            else:
                data = self._folder.read(
                    str(uri), "mesh", mentioned_in=self._inner, element=f"buffer {index}"
                )
            if len(data) < buffer["byteLength"]:
                self._refuse("less data than it says", f"buffer {index}", buffer["byteLength"])
            self._buffers[index] = data
        return self._buffers[index]

    def _data_uri(self, uri: str, element: str) -> bytes:
        header, _, text = uri.partition(",")
        try:
            if not header.endswith(";base64"):
                raise ValueError("not base64")
            return base64.b64decode(text, validate=True)
        except (ValueError, binascii.Error) as error:
            self._refuse(f"a data URI that cannot be read: {error}", element, header[:40])

    def _view(self, index: object) -> tuple[memoryview, int]:
        """Bytes of a buffer view and its stride, 0 if packed."""
        view = self._item("bufferViews", index)
        data = self._buffer(view["buffer"])
        start, length = view.get("byteOffset", 0), view["byteLength"]
        stride = view.get("byteStride", 0)
        if not (
            all(type(n) is int and n >= 0 for n in (start, length, stride))
            and start + length <= len(data)
            and stride <= 252
        ):
            self._refuse("lies outside its buffer", f"bufferView {index}", (start, length))
        return memoryview(data)[start : start + length], stride

    def _accessor(self, index: object, width: int) -> NDArray[Any]:
        """Values (n, width) of an accessor, normalised ones as floats."""
        accessor = self._item("accessors", index)
        element, key = f"accessor {index}", (cast(int, index), width)
        if key in self._values:
            return self._values[key]
        if "sparse" in accessor or "bufferView" not in accessor:
            self._refuse("a sparse accessor", element, None, "Export plain buffers.")
        count, offset = accessor["count"], accessor.get("byteOffset", 0)
        code = _COMPONENTS.get(accessor["componentType"])
        if code is None or _WIDTHS.get(accessor["type"]) != width:
            self._refuse(
                "a type that does not fit its use",
                element,
                (accessor["componentType"], accessor["type"]),
            )
        if not all(type(n) is int and n >= 0 for n in (count, offset)):
            self._refuse("a count that is no number", element, (count, offset))
        _check_counts(count if width > 1 else 0, count // 3 if width == 1 else 0, self._file)
        self._decoded += count
        if self._decoded > _MAX_NUMBERS:
            self._refuse(f"more than {_MAX_NUMBERS} values in all", element, None, _SIMPLIFY)
        data, stride = self._view(accessor["bufferView"])
        item = np.dtype(code)
        stride = stride or item.itemsize * width
        needed = offset + (count - 1) * stride + item.itemsize * width if count else 0
        if count == 0 or needed > len(data) or stride < item.itemsize * width:
            self._refuse("lies outside its buffer view", element, count)
        values = np.ndarray(
            (count, width), item, data, offset=offset, strides=(stride, item.itemsize)
        ).copy()
        if accessor.get("normalized") and item.kind in "iu":
            values = np.maximum(values / np.iinfo(item).max, -1.0)
        elif width > 1:
            values = values.astype(float)
        self._values[key] = values
        return values

    def _surface(self, primitive: dict[str, Any], element: str) -> _Surface | None:
        """The triangles of a primitive; None for points and lines."""
        mode = primitive.get("mode", 4)
        if mode in (0, 1, 2, 3):
            return None
        if mode != 4:
            self._refuse("strips or fans of triangles", element, mode, "Export plain triangles.")
        attributes = primitive["attributes"]
        vertices = self._accessor(attributes["POSITION"], 3)
        if "indices" in primitive:
            indices = self._accessor(primitive["indices"], 1)
            if indices.dtype.kind != "u":
                self._refuse("indices that are not whole numbers", element, str(indices.dtype))
            indices = indices.ravel().astype(np.int64)
        else:
            indices = np.arange(len(vertices))
        if len(indices) % 3:
            self._refuse("indices that do not make whole triangles", element, len(indices))
        self._surfaces += 1
        _check_surfaces(self._surfaces, self._file)
        faces = indices.reshape(-1, 3)
        uv = material = None
        if self._looks and "material" in primitive:
            material, uv_set = self._material(primitive["material"])
            if f"TEXCOORD_{uv_set}" in attributes and material.texture is not None:
                uv = self._accessor(attributes[f"TEXCOORD_{uv_set}"], 2)
                if len(uv) != len(vertices):
                    self._refuse("another number of picture coordinates", element, len(uv))
        if uv is None:
            vertices, faces = _used_alone(vertices, faces)
        else:
            both, faces = _used_alone(np.concatenate([vertices, uv], axis=1), faces)
            # The picture coordinate v points down in glTF.
            vertices, uv = both[:, :3], both[:, 3:] * (1.0, -1.0) + (0.0, 1.0)
        self._faces += len(faces)
        self._vertices += len(vertices)
        _check_counts(self._vertices, self._faces, self._file)
        return _Surface(vertices, faces, uv, material)

    def _material(self, index: object) -> tuple[Material, int]:
        """A material and which set of picture coordinates it uses."""
        item = self._item("materials", index)
        look = item.get("pbrMetallicRoughness")
        if look is None:
            return _GREY, 0
        element = f"material {index}"
        color = _color(look.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0)), self._file, element)
        finish = [float(look.get(k, 1.0)) for k in ("metallicFactor", "roughnessFactor")]
        if not all(0 <= value <= 1 for value in finish):
            self._refuse("a factor outside 0 to 1", element, finish)
        texture, uv_set = None, 0
        if "baseColorTexture" in look:
            reference = look["baseColorTexture"]
            uv_set = int(reference.get("texCoord", 0))
            source = self._item("textures", reference["index"]).get("source")
            texture = None if source is None else self._picture(source)
        material = Material(color=color, metallic=finish[0], roughness=finish[1], texture=texture)
        return material, uv_set

    def _picture(self, index: int) -> Image:
        if index not in self._pictures:
            image = self._item("images", index)
            uri, element = image.get("uri"), f"image {index}"
            if uri is None:
                data, _ = self._view(image["bufferView"])
                picture = _picture(self._folder, bytes(data), f"{self._file}: {element}")
            elif str(uri).startswith("data:"):
                data = self._data_uri(uri, element)
                picture = _picture(self._folder, data, f"{self._file}: {element}")
            else:
                picture = read_picture(
                    self._folder, str(uri), mentioned_in=self._inner, element=element
                )
            self._pictures[index] = picture
        return self._pictures[index]


_READERS: Mapping[str, Callable[[AssetFolder, str, bool], list[_Surface]]] = {
    ".obj": _read_obj,
    ".stl": _read_stl,
    ".dae": _read_dae,
    ".glb": _read_gltf,
    ".gltf": _read_gltf,
}
