"""The exact form of an object on disk: a folder with ``object.json`` and maybe ``arrays.npz``.

Meshes and pictures go to the arrays, all else to the JSON. It mirrors the dataclasses of
``model.py`` field by field; its numbers are written such that they come back bit-equal. A reader in
another language needs nothing but JSON and npz. What is read is checked against the types of the
model and against what a real object can be, so that a damaged or hostile folder is an
``AssetError`` that names the place, never half an object.
"""

from __future__ import annotations

import io
import json
import math
import os
import types
import typing
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from artgym.errors import AssetError, InvalidArgumentError
from artgym.files import write_file_whole
from artgym.objects.asset_folder import MAX_BYTES, AssetFolder
from artgym.objects.contents import Image, TriangleMesh
from artgym.objects.model import (
    ArticulatedObject,
    Box,
    Convex,
    Cylinder,
    Inertial,
    Joint,
    Link,
    Material,
    Shape,
    Texture,
    Vector,
)

#: Raised by one with each change that an older reader cannot read.
SCHEMA_VERSION = 2

FORMAT = "artgym-object"
JSON_NAME, ARRAYS_NAME = "object.json", "arrays.npz"

#: Limits on what is read; no object of ours comes near.
MAX_ARRAYS_BYTES = 256 * 2**20
MAX_LINKS, MAX_SHAPES, MAX_VISUALS = 1000, 20_000, 20_000
MAX_PICTURE_SIDE = 8192
#: Arrays of more bytes in all are written compressed.
_MAX_UNPACKED_BYTES = 32 * 2**20
#: Metres, kilograms and the rest: larger numbers are a mistake.
MAX_MAGNITUDE = 1e9
_MAX_TEXT = 10_000

#: A JSON value of so many characters stays on one line.
_LINE_LENGTH = 120

#: How far a rotation may be from orthogonal and an axis from unit length.
_UNIT_TOLERANCE = 1e-6
#: A convex piece thinner than this share of its length has no hull that can be computed.
_FLAT = 1e-9
#: By how much, relatively, a moment of inertia may exceed the sum of the other two.
_INERTIA_TOLERANCE = 1e-3

_REMEDY = "Write the folder again with write_description, or with `artgym export`."


# --- Writing -------------------------------------------------------------------------------------


def write_description(obj: ArticulatedObject, folder: str | os.PathLike[str]) -> Path:
    """Writes an object such that ``read_description`` gives an equal one.

    Equal objects give equal bytes.

    Args:
        obj: the object.
        folder: made if missing; a description in it is replaced.

    Returns:
        The folder.

    Raises:
        InvalidArgumentError: the object is too large, or holds something that is no plain number
            or text.
        FileNotWrittenError: the system refused.
    """
    folder = Path(folder)
    arrays = _Arrays()
    content = {
        "format": FORMAT,
        "schema_version": SCHEMA_VERSION,
        "content_hash": obj.content_hash(),
        "object": _encoded(obj, obj.object_id, arrays),
        "meshes": [
            {
                "vertices": len(mesh.vertices),
                "faces": len(mesh.faces),
                "uv": mesh.uv is not None,
                "sha256": mesh.digest,
            }
            for mesh in arrays.meshes
        ],
        "pictures": [
            {"height": image.pixels.shape[0], "width": image.pixels.shape[1], "sha256": digest}
            for image, digest in ((image, image.digest) for image in arrays.pictures)
        ],
    }
    files = {JSON_NAME: f"{_json_text(content)}\n".encode()}
    if arrays.meshes or arrays.pictures:
        files[ARRAYS_NAME] = arrays.npz()
    for name, kind in ((JSON_NAME, "text"), (ARRAYS_NAME, "mesh")):
        if len(files.get(name, b"")) > MAX_BYTES[kind]:
            raise InvalidArgumentError(
                f"{obj.object_id}: {name} would have {len(files[name])} bytes, and readers take "
                f"{MAX_BYTES[kind]} at most. Simplify the meshes or reduce the pictures."
            )
    # The JSON last: it names what must be there.
    for name in reversed(files):
        write_file_whole(folder / name, files[name])
    return folder


def _json_text(value: Any, indent: str = "") -> str:
    """JSON with a line for each value short enough to be read on one."""
    line = json.dumps(value, ensure_ascii=False, allow_nan=False)
    if not isinstance(value, dict | list) or not value or len(line) <= _LINE_LENGTH:
        return line
    deeper = indent + "  "
    if isinstance(value, list):
        items, brackets = [_json_text(item, deeper) for item in value], "[]"
    else:
        items = [f"{json.dumps(k)}: {_json_text(item, deeper)}" for k, item in value.items()]
        brackets = "{}"
    inner = ",\n".join(deeper + item for item in items)
    return f"{brackets[0]}\n{inner}\n{indent}{brackets[1]}"


class _Arrays:
    """The meshes and pictures of an object, each once."""

    def __init__(self) -> None:
        self.meshes: dict[TriangleMesh, int] = {}
        self.pictures: dict[Image, int] = {}

    def index(self, value: TriangleMesh | Image) -> int:
        known: dict[Any, int] = self.meshes if isinstance(value, TriangleMesh) else self.pictures
        return known.setdefault(value, len(known))

    def npz(self) -> bytes:
        """A zip of .npy files without times in it.

        Unpacked if that is no burden to a disk: a photograph takes longer to unpack than the rest
        of the object to read.
        """
        total = sum(array.nbytes for _, array in self._named())
        packing = zipfile.ZIP_STORED if total <= _MAX_UNPACKED_BYTES else zipfile.ZIP_DEFLATED
        buffer = io.BytesIO()
        with zipfile.ZipFile(buffer, "w") as file:
            for name, array in self._named():
                info = zipfile.ZipInfo(f"{name}.npy")
                info.compress_type = packing
                file.writestr(info, _npy_header(array.dtype.str, array.shape) + array.tobytes())
        return buffer.getvalue()

    def _named(self) -> Iterator[tuple[str, NDArray[Any]]]:
        for i, mesh in enumerate(self.meshes):
            yield f"mesh_{i}_vertices", mesh.vertices
            yield f"mesh_{i}_faces", mesh.faces
            if mesh.uv is not None:
                yield f"mesh_{i}_uv", mesh.uv
        for i, image in enumerate(self.pictures):
            yield f"picture_{i}", image.pixels


def _npy_header(dtype: str, shape: tuple[int, ...]) -> bytes:
    """What a .npy file of version 1.0 begins with.

    Written here, so that the reader can compare bytes in place of parsing what may be hostile.
    """
    dimensions = "".join(f"{size}, " for size in shape)
    text = f"{{'descr': '{dtype}', 'fortran_order': False, 'shape': ({dimensions}), }}"
    padding = -(len(text) + 11) % 64
    return (
        b"\x93NUMPY\x01\x00"
        + (len(text) + padding + 1).to_bytes(2, "little")
        + (text + " " * padding + "\n").encode("ascii")
    )


def _encoded(value: object, where: str, arrays: _Arrays) -> Any:
    """A value of the model in terms of JSON."""
    if isinstance(value, TriangleMesh | Image):
        return {"kind": type(value).__name__, "index": arrays.index(value)}
    if is_dataclass(value):
        content = {
            item.name: _encoded(getattr(value, item.name), f"{where}.{item.name}", arrays)
            for item in fields(value)
        }
        return {"kind": type(value).__name__, **content}
    if isinstance(value, Mapping):
        return {str(k): _encoded(v, f"{where}[{k!r}]", arrays) for k, v in sorted(value.items())}
    if isinstance(value, tuple):
        return [_encoded(v, f"{where}[{i}]", arrays) for i, v in enumerate(value)]
    if value is None or type(value) in (bool, int, str):
        return value
    if isinstance(value, float) and math.isfinite(value):
        return float(value)
    raise InvalidArgumentError(
        f"{where} is {value!r} of type {type(value).__name__}: expected a finite int or float of "
        "Python, a str, a tuple or a dataclass of the model. Convert it with float() or int()."
    )


# --- Reading -------------------------------------------------------------------------------------


def read_description(folder: str | os.PathLike[str]) -> ArticulatedObject:
    """Reads what ``write_description`` wrote.

    Args:
        folder: the folder.

    Raises:
        AssetError: something is missing, damaged, of another version or no real object; the
            message names the file, the place in it and what stands there.
    """
    files = AssetFolder(folder)
    path = Path(files.label(JSON_NAME))
    content = _Value(path, "", _json_content(path, files.read(JSON_NAME, "text")))
    top = content.items()
    for key in ("format", "schema_version"):
        if key not in top:
            raise content.error(f"{key!r} is missing", value=sorted(top)[:8])
    if top["format"].value != FORMAT:
        raise top["format"].error(f"expected {FORMAT!r}")
    if (
        type(top["schema_version"].value) is not int
        or top["schema_version"].value != SCHEMA_VERSION
    ):
        raise AssetError(
            path,
            f"this artgym reads version {SCHEMA_VERSION}",
            element="schema_version",
            value=top["schema_version"].value,
            remedy="Write it again with this version, or install the version that wrote it.",
        )
    top = content.items(
        ("format", "schema_version", "content_hash", "object", "meshes", "pictures")
    )
    arrays = _ArraysFile(files, top["meshes"], top["pictures"])
    obj = _decoded(top["object"], ArticulatedObject, arrays)
    if obj.content_hash() != top["content_hash"].value:
        raise top["content_hash"].error(
            f"the object has another hash, {obj.content_hash()!r}: the file was changed"
        )
    return obj


def _json_content(path: Path, content: bytes) -> Any:
    def no_constant(text: str) -> float:
        raise ValueError(f"{text} is no finite number")

    def finite(text: str) -> float:
        if not math.isfinite(number := float(text)):
            raise ValueError(f"{text} is no finite number")
        return number

    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        items = dict(pairs)
        if len(items) < len(pairs):
            names = [name for name, _ in pairs]
            raise ValueError(f"{next(n for n in names if names.count(n) > 1)!r} stands there twice")
        return items

    try:
        return json.loads(
            content.decode("utf-8"),
            parse_constant=no_constant,
            parse_float=finite,
            object_pairs_hook=once,
        )
    except (ValueError, RecursionError) as error:
        raise AssetError(path, f"is no JSON that we write: {error}", remedy=_REMEDY) from error


class _Value:
    """A value of a JSON file with its place, for messages."""

    def __init__(self, file: Path, where: str, value: Any) -> None:
        self.file = file
        self.where = where
        self.value = value

    def error(self, problem: str, *, value: object = None) -> AssetError:
        return AssetError(
            self.file,
            problem,
            element=self.where,
            value=self.value if value is None else value,
            remedy=_REMEDY,
        )

    def items(self, names: tuple[str, ...] | None = None) -> dict[str, _Value]:
        """The values of an object of JSON, which must have just these names if any are given."""
        if not isinstance(self.value, dict):
            raise self.error("expected an object of JSON")
        if names is not None and set(self.value) != set(names):
            missing = sorted(set(names) - set(self.value))
            foreign = sorted(set(self.value) - set(names))
            raise self.error("has other fields than it should", value=[*missing, *foreign])
        prefix = f"{self.where}." if self.where else ""
        return {n: _Value(self.file, prefix + n, v) for n, v in self.value.items()}

    def entries(self, most: int) -> list[_Value]:
        """The values of a list."""
        if not isinstance(self.value, list):
            raise self.error("expected a list")
        if len(self.value) > most:
            raise self.error(f"has more than {most} entries", value=len(self.value))
        return [_Value(self.file, f"{self.where}[{i}]", v) for i, v in enumerate(self.value)]

    def count(self, least: int, most: int) -> int:
        """A whole number of an interval."""
        if type(self.value) is not int or not least <= self.value <= most:
            raise self.error(f"expected a whole number of {least} to {most}")
        return self.value

    def text(self) -> str:
        if not isinstance(self.value, str) or len(self.value) > _MAX_TEXT:
            raise self.error(f"expected a text of at most {_MAX_TEXT} characters")
        if "\0" in self.value or not self.value.isprintable():
            raise self.error("expected a text that can be printed")
        return self.value

    def number(self) -> float:
        """A finite number, as the int or float that it is."""
        if type(self.value) not in (int, float) or not abs(self.value) <= MAX_MAGNITUDE:
            raise self.error(f"expected a number of at most {MAX_MAGNITUDE:g}")
        return self.value


class _ArraysFile:
    """The meshes and pictures beside the JSON, read when first asked for."""

    def __init__(self, files: AssetFolder, meshes: _Value, pictures: _Value) -> None:
        self._files = files
        self._meshes = [self._mesh_entry(entry) for entry in meshes.entries(MAX_VISUALS)]
        self._pictures = [self._picture_entry(entry) for entry in pictures.entries(MAX_VISUALS)]
        self._read: dict[tuple[str, int], TriangleMesh | Image] = {}
        total = sum(12 * 4 * entry["vertices"] + 12 * entry["faces"] for entry in self._meshes)
        total += sum(3 * entry["height"] * entry["width"] for entry in self._pictures)
        if total > MAX_ARRAYS_BYTES:
            raise meshes.error(f"claim more than {MAX_ARRAYS_BYTES} bytes", value=total)
        self._zip: zipfile.ZipFile | None = None

    @staticmethod
    def _mesh_entry(entry: _Value) -> dict[str, Any]:
        items = entry.items(("vertices", "faces", "uv", "sha256"))
        if type(items["uv"].value) is not bool:
            raise items["uv"].error("expected true or false")
        most = MAX_ARRAYS_BYTES // 12
        return {
            "vertices": items["vertices"].count(0, most),
            "faces": items["faces"].count(0, most),
            "uv": items["uv"].value,
            "sha256": items["sha256"].text(),
        }

    @staticmethod
    def _picture_entry(entry: _Value) -> dict[str, Any]:
        items = entry.items(("height", "width", "sha256"))
        return {
            "height": items["height"].count(1, MAX_PICTURE_SIDE),
            "width": items["width"].count(1, MAX_PICTURE_SIDE),
            "sha256": items["sha256"].text(),
        }

    def take(self, kind: type, value: _Value) -> TriangleMesh | Image:
        """The mesh or picture that an entry of the object means."""
        items = value.items(("kind", "index"))
        if items["kind"].value != kind.__name__:
            raise items["kind"].error(f"expected {kind.__name__!r}")
        entries = self._meshes if kind is TriangleMesh else self._pictures
        if not entries:
            raise value.error("there are no such arrays in the file")
        index = items["index"].count(0, len(entries) - 1)
        key = (kind.__name__, index)
        if key not in self._read:
            read = self._mesh if kind is TriangleMesh else self._picture
            self._read[key] = read(index)
        return self._read[key]

    def _mesh(self, index: int) -> TriangleMesh:
        entry, name = self._meshes[index], f"mesh_{index}"
        num_vertices, num_faces = entry["vertices"], entry["faces"]
        vertices = self._array(f"{name}_vertices", "<f8", (num_vertices, 3))
        faces = self._array(f"{name}_faces", "<i4", (num_faces, 3))
        uv = self._array(f"{name}_uv", "<f4", (num_vertices, 2)) if entry["uv"] else None
        mesh = TriangleMesh(vertices, faces, uv)
        self._require_digest(name, mesh.digest, entry["sha256"])
        if not (num_vertices and num_faces):
            raise self._error(name, "has no triangles", num_faces)
        if not np.all(np.abs(vertices) <= MAX_MAGNITUDE):
            raise self._error(name, "has a vertex that is not finite, or far too large")
        if uv is not None and not np.all(np.isfinite(uv)):
            raise self._error(name, "has a picture coordinate that is not finite")
        if faces.min() < 0 or faces.max() >= num_vertices:
            wrong = int(faces.max()) if faces.min() >= 0 else int(faces.min())
            raise self._error(name, f"a face names a vertex that is none of {num_vertices}", wrong)
        return mesh

    def _picture(self, index: int) -> Image:
        entry, name = self._pictures[index], f"picture_{index}"
        image = Image(self._array(name, "|u1", (entry["height"], entry["width"], 3)))
        self._require_digest(name, image.digest, entry["sha256"])
        return image

    def _require_digest(self, name: str, digest: str, expected: str) -> None:
        if digest != expected:
            raise self._error(
                name, f"has another checksum than {JSON_NAME} says: it was changed", digest
            )

    def _array(self, name: str, dtype: str, shape: tuple[int, ...]) -> NDArray[Any]:
        """One array, whose type and shape the JSON has told: the file cannot say otherwise."""
        header = _npy_header(dtype, shape)
        size = int(np.prod(shape)) * np.dtype(dtype).itemsize
        content = self._entry(f"{name}.npy", len(header) + size)
        if not content.startswith(header):
            raise self._error(f"{name}.npy", f"is no array {shape} of {dtype}", content[:80])
        return np.frombuffer(content, dtype, offset=len(header)).reshape(shape)

    def _entry(self, name: str, size: int) -> bytes:
        try:
            if self._zip is None:
                self._zip = zipfile.ZipFile(io.BytesIO(self._files.read(ARRAYS_NAME, "mesh")))
            info = self._zip.getinfo(name)
            if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
                raise self._error(name, "is packed in a way that we do not use", info.compress_type)
            if info.file_size != size:
                raise self._error(name, f"should have {size} bytes", info.file_size)
            with self._zip.open(info) as file:
                # One byte more lets the checksum be compared, and shows a size that is a lie.
                content = file.read(size + 1)
        except KeyError as error:
            raise self._error(name, "is missing") from error
        except (
            EOFError,
            OSError,
            OverflowError,
            RuntimeError,
            ValueError,
            zipfile.BadZipFile,
            zlib.error,
        ) as error:
            if isinstance(error, AssetError):
                raise
            raise self._error(name, f"is damaged: {error}") from error
        if len(content) != size:
            raise self._error(name, f"should have {size} bytes", len(content))
        return content

    def _error(self, element: str, problem: str, value: object = None) -> AssetError:
        return AssetError(
            self._files.label(ARRAYS_NAME), problem, element=element, value=value, remedy=_REMEDY
        )


@cache
def _hints(kind: type) -> dict[str, Any]:
    return typing.get_type_hints(kind)


def _decoded(value: _Value, hint: Any, arrays: _ArraysFile) -> Any:
    """A value of the type that the model's annotation ``hint`` asks for."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin is Literal:
        if value.value not in arguments or not isinstance(value.value, str):
            raise value.error(f"expected one of {list(arguments)}")
        return value.value
    if origin in (typing.Union, types.UnionType):
        return _decoded(value, _member(value, arguments), arrays)
    if origin is tuple:
        return _decoded_tuple(value, arguments, arrays)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return {name: _decoded(v, arguments[1], arrays) for name, v in value.items().items()}
    if hint is float:
        return value.number()
    if hint is int:
        return value.count(-(2**63), 2**63 - 1)
    if hint is str:
        return value.text()
    if hint is type(None):
        return None
    if hint in (TriangleMesh, Image):
        return arrays.take(hint, value)
    assert is_dataclass(hint), f"the model has a type that descriptions do not know: {hint}"
    return _decoded_dataclass(value, typing.cast(type, hint), arrays)


def _member(value: _Value, members: tuple[Any, ...]) -> Any:
    """Which member of a union a value is of."""
    if value.value is None and type(None) in members:
        return type(None)
    if isinstance(value.value, dict):
        kind = value.value.get("kind")
        for member in members:
            if member.__name__ == kind:
                return member
        known = [member.__name__ for member in members if member is not type(None)]
        raise value.error(f"expected a kind of {known}", value=kind)
    if isinstance(value.value, str) and str in members:
        return str
    if type(value.value) in (int, float) and float in members:
        return float
    raise value.error(f"expected one of {[member.__name__ for member in members]}")


def _decoded_tuple(value: _Value, arguments: tuple[Any, ...], arrays: _ArraysFile) -> Any:
    if arguments[-1] is Ellipsis:
        most = {"links": MAX_LINKS, "joints": MAX_LINKS}.get(value.where.rpartition(".")[2])
        most = most or max(MAX_SHAPES, MAX_VISUALS)
        if arguments[0] == Vector and isinstance(value.value, list) and len(value.value) <= most:
            points = [_plain_numbers(point, 3) for point in value.value]
            if None not in points:
                return tuple(points)
        return tuple(_decoded(entry, arguments[0], arrays) for entry in value.entries(most))
    if set(arguments) == {float} and (numbers := _plain_numbers(value.value, len(arguments))):
        return numbers
    entries = value.entries(len(arguments))
    if len(entries) != len(arguments):
        raise value.error(f"expected {len(arguments)} entries")
    return tuple(_decoded(e, hint, arrays) for e, hint in zip(entries, arguments, strict=True))


def _plain_numbers(value: object, count: int) -> tuple[float, ...] | None:
    """So many numbers with nothing to complain of, or None: most of a description is points."""
    if (
        isinstance(value, list)
        and len(value) == count
        and all([type(n) is float and abs(n) <= MAX_MAGNITUDE for n in value])
    ):
        return tuple(value)
    return None


def _decoded_dataclass(value: _Value, kind: type, arrays: _ArraysFile) -> Any:
    hints = _hints(kind)
    names = tuple(item.name for item in fields(kind))
    items = value.items(("kind", *names))
    if items["kind"].value != kind.__name__:
        raise items["kind"].error(f"expected {kind.__name__!r}")
    arguments = {name: _decoded(items[name], hints[name], arrays) for name in names}
    try:
        made = kind(**arguments)
        if kind in _REQUIREMENTS:
            for name, problem in _REQUIREMENTS[kind](made):
                raise items[name].error(problem)
    except AssetError:
        raise
    except InvalidArgumentError as error:
        raise value.error(str(error), value="") from error
    return made


# --- What a real object can be --------------------------------------------------------------------

#: What is wrong with a value: (field, problem).
_Complaints = Iterator[tuple[str, str]]


def _box_complaints(box: Box) -> _Complaints:
    if not min(box.half_size) > 0:
        yield "half_size", "expected lengths above 0"


def _cylinder_complaints(cylinder: Cylinder) -> _Complaints:
    for name in ("radius", "half_length"):
        if not getattr(cylinder, name) > 0:
            yield name, "expected a length above 0"


def _convex_complaints(convex: Convex) -> _Complaints:
    # Their hull would tell as well, and takes ten times as long.
    spread = np.linalg.svd(convex.corners() - convex.corners().mean(axis=0), compute_uv=False)
    if not spread[-1] > _FLAT * spread[0]:
        yield "points", "lie in one plane, so that they enclose no volume"


def _shape_complaints(shape: Shape) -> _Complaints:
    if not _is_rotation(shape.rotation):
        yield "rotation", "is no rotation matrix"


def _is_rotation(rows: tuple[Vector, Vector, Vector]) -> bool:
    if rows == Shape.rotation:
        return True
    R = np.asarray(rows, dtype=float)
    is_orthogonal = np.allclose(R @ R.T, np.eye(3), atol=_UNIT_TOLERANCE)
    return is_orthogonal and bool(np.linalg.det(R) > 0)


def _material_complaints(material: Material) -> _Complaints:
    for name, numbers in (
        ("color", material.color),
        ("roughness", (material.roughness,)),
        ("metallic", (material.metallic,)),
    ):
        if not all(0 <= number <= 1 for number in numbers):
            yield name, "expected numbers of 0 to 1"


def _texture_complaints(texture: Texture) -> _Complaints:
    if not texture.tile > 0:
        yield "tile", "expected a length above 0"


def _inertial_complaints(inertial: Inertial) -> _Complaints:
    if not inertial.mass > 0:
        yield "mass", "expected a mass above 0"
    inertia = np.asarray(inertial.inertia, dtype=float)
    scale = np.abs(inertia).max()
    if not np.allclose(inertia, inertia.T, rtol=0, atol=1e-9 * scale):
        yield "inertia", "is not symmetric"
    moments = np.linalg.eigvalsh(inertia)
    if not moments[0] > 0:
        yield "inertia", "is not positive definite"
    if moments[2] > (1 + _INERTIA_TOLERANCE) * (moments[0] + moments[1]):
        yield "inertia", "has a moment larger than the sum of the others, as no body's is"


def _link_complaints(link: Link) -> _Complaints:
    if not link.name:
        yield "name", "is empty"
    if not link.shapes:
        yield "shapes", "a link needs at least one convex piece"
    if not link.density > 0:
        yield "density", "expected a density above 0"
    if not link.friction >= 0:
        yield "friction", "expected a coefficient of 0 or more"


def _joint_complaints(joint: Joint) -> _Complaints:
    if abs(np.linalg.norm(joint.axis) - 1) > _UNIT_TOLERANCE:
        yield "axis", "expected a unit direction"
    if joint.open == joint.closed:
        yield "open", "equals closed: the joint cannot move"
    for name in ("friction", "damping"):
        if not getattr(joint, name) >= 0:
            yield name, "expected 0 or more"


def _object_complaints(obj: ArticulatedObject) -> _Complaints:
    if not obj.links:
        yield "links", "an object needs at least one link"
    if not _is_rotation(obj.R_object_canonical):
        yield "R_object_canonical", "is no rotation matrix"


_REQUIREMENTS: dict[type, Callable[[Any], _Complaints]] = {
    Box: _box_complaints,
    Cylinder: _cylinder_complaints,
    Convex: _convex_complaints,
    Shape: _shape_complaints,
    Material: _material_complaints,
    Texture: _texture_complaints,
    Inertial: _inertial_complaints,
    Link: _link_complaints,
    Joint: _joint_complaints,
    ArticulatedObject: _object_complaints,
}
