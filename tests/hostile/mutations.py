"""Sound files, spoilt at random; a seed and a number give one mutation, always the same."""

from __future__ import annotations

import functools
import json
import re
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from tests.hostile.corpus import (
    GOOD_MJCF,
    GOOD_MTL,
    GOOD_OBJ,
    GOOD_URDF,
    ascii_stl,
    dae,
    glb,
    mobility,
    own_files,
    png,
    stl,
    textured_obj,
)

Files = dict[str, bytes]

#: What numbers become.
_NUMBERS = (
    "nan", "inf", "-inf", "1e400", "-1", "", "0", "-0.0", "1e30", "1e-30", "1e9", "1e-9", "0.5",
    "99999999999999999999", "0x10", "1,5", "1e", "--1", "1 1", "true", "null",
)  # fmt: skip
_NUMBER = re.compile(rb"(?<![A-Za-z_#])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_ATTRIBUTE = re.compile(rb'\s[\w:]+="[^"]*"')
_TEXT = (".urdf", ".xml", ".dae", ".json", ".obj", ".mtl", ".txt", ".gltf")
_XML = (".urdf", ".xml", ".dae")

_PRIMITIVES = """<robot name="lamp">
  <material name="steel"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="foot">
    <inertial><mass value="2"/><inertia ixx="0.02" iyy="0.02" izz="0.03"/></inertial>
    <collision><geometry><cylinder radius="0.1" length="0.05"/></geometry></collision>
    <visual><geometry><cylinder radius="0.1" length="0.05"/></geometry>
      <material name="steel"/></visual>
  </link>
  <link name="pole">
    <collision><origin xyz="0 0 0.2"/><geometry><box size="0.02 0.02 0.4"/></geometry></collision>
  </link>
  <link name="tip"><collision><geometry><sphere radius="0.04"/></geometry></collision></link>
  <joint name="lift" type="prismatic"><origin xyz="0 0 0.03" rpy="0 0 0.5"/>
    <parent link="foot"/><child link="pole"/><axis xyz="0 0 1"/>
    <limit lower="-0.1" upper="0.2" effort="10" velocity="1"/></joint>
  <joint name="weld" type="fixed"><origin xyz="0 0 0.42"/>
    <parent link="pole"/><child link="tip"/></joint>
  <link name="shade"><collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>
  <joint name="swivel" type="continuous"><origin xyz="0.1 0 0.3" rpy="0 0.3 0"/>
    <parent link="pole"/><child link="shade"/><axis xyz="0 1 1"/>
    <dynamics damping="0.2"/></joint>
</robot>
"""


@functools.cache
def sound_objects() -> Mapping[str, tuple[Files, str]]:
    """Files by path and what is imported, by a name for each object."""
    urdf = GOOD_URDF.encode()

    def with_mesh(suffix: str, content: bytes) -> tuple[Files, str]:
        text = GOOD_URDF.replace("door.obj", f"door{suffix}").encode()
        return {"object.urdf": text, f"meshes/door{suffix}": content}, "object.urdf"

    partnet = GOOD_URDF.replace('"body"', '"link_0"').replace('"door"', '"link_1"')
    return {
        "urdf": ({"object.urdf": urdf, "meshes/door.obj": GOOD_OBJ}, "object.urdf"),
        "primitives": ({"object.urdf": _PRIMITIVES.encode()}, "object.urdf"),
        "textured": (
            {
                "object.urdf": urdf,
                "meshes/door.obj": textured_obj(),
                "meshes/door.mtl": GOOD_MTL,
                "meshes/paint.png": png(),
            },
            "object.urdf",
        ),
        "stl": with_mesh(".stl", stl()),
        "ascii_stl": with_mesh(".stl", ascii_stl()),
        "dae": with_mesh(".dae", dae().encode()),
        "glb": with_mesh(".glb", glb()),
        "mjcf": ({"object.xml": GOOD_MJCF.encode(), "meshes/door.obj": GOOD_OBJ}, "object.xml"),
        "partnet": (
            {
                "mobility.urdf": partnet.encode(),
                "meshes/door.obj": GOOD_OBJ,
                "meta.json": b'{"model_cat": "StorageFurniture"}',
                "mobility_v2.json": json.dumps(mobility()).encode(),
            },
            "",
        ),
        "own": ({f"a.artgym/{k}": v for k, v in own_files().items()}, "a.artgym"),
        "exported": _exported(),
    }


def _exported() -> tuple[Files, str]:
    """A laptop as it is exported, its exact description beside it."""
    from artgym.objects import catalog
    from artgym.objects.urdf_export import write_urdf

    with tempfile.TemporaryDirectory() as folder:
        path = write_urdf(catalog.load("laptop/0000"), folder)
        files = {
            str(p.relative_to(folder)): p.read_bytes()
            for p in sorted(Path(folder).rglob("*"))
            if p.is_file()
        }
    return files, path.name


def mutation(seed: int, number: int) -> tuple[str, Files, str]:
    """The name of the sound object, its spoilt files, and what is to be imported.

    Args:
        seed: of all mutations.
        number: which.
    """
    rng = np.random.default_rng([seed, number])
    objects = sound_objects()
    name = str(rng.choice(list(objects)))
    files, entry = objects[name]
    files = dict(files)
    for _ in range(int(rng.geometric(0.6))):
        path = str(rng.choice(list(files)))
        suffix = Path(path).suffix
        edits: list[Callable[[np.random.Generator, bytes], bytes]] = list(_BYTE_EDITS)
        if suffix in _TEXT:
            # Most flipped bytes of a text are found by its parser: other edits reach deeper.
            edits += 3 * list(_TEXT_EDITS)
        if suffix in _XML:
            edits += 3 * list(_XML_EDITS)
        edit = edits[int(rng.integers(len(edits)))]
        files[path] = edit(rng, files[path])
    return name, files, entry


def _place(rng: np.random.Generator, data: bytes) -> tuple[int, int]:
    """A random range of a file, mostly short."""
    start = int(rng.integers(len(data) + 1))
    return start, min(len(data), start + int(rng.geometric(0.05)))


def _flip(rng: np.random.Generator, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(int(rng.geometric(0.4))):
        if changed:
            changed[int(rng.integers(len(changed)))] ^= int(rng.integers(1, 256))
    return bytes(changed)


def _delete(rng: np.random.Generator, data: bytes) -> bytes:
    start, end = _place(rng, data)
    return data[:start] + data[end:]


def _insert(rng: np.random.Generator, data: bytes) -> bytes:
    start, end = _place(rng, data)
    return data[:start] + rng.bytes(end - start) + data[start:]


def _repeat(rng: np.random.Generator, data: bytes) -> bytes:
    start, end = _place(rng, data)
    return data[:end] + data[start:end] * int(rng.integers(1, 5)) + data[end:]


def _truncate(rng: np.random.Generator, data: bytes) -> bytes:
    return data[: int(rng.integers(len(data) + 1))]


def _extreme_word(rng: np.random.Generator, data: bytes) -> bytes:
    """Four bytes that mean much as an integer or a float."""
    start = 4 * int(rng.integers(len(data) // 4 + 1))
    words = (b"\xff\xff\xff\xff", b"\0\0\0\x80", b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\0\0\0\0")
    return data[:start] + words[int(rng.integers(len(words)))] + data[start + 4 :]


def _number(rng: np.random.Generator, data: bytes) -> bytes:
    found = list(_NUMBER.finditer(data))
    if not found:
        return data
    match = found[int(rng.integers(len(found)))]
    new = str(rng.choice(_NUMBERS)).encode()
    return data[: match.start()] + new + data[match.end() :]


def _scaled_number(rng: np.random.Generator, data: bytes) -> bytes:
    found = list(_NUMBER.finditer(data))
    if not found:
        return data
    match = found[int(rng.integers(len(found)))]
    factor = float(rng.choice([-1.0, 1e-6, 1e-3, 0.5, 2.0, 10.0, 1e3, 1e6]))
    new = repr(float(match[0]) * factor).encode()
    return data[: match.start()] + new + data[match.end() :]


def _line(rng: np.random.Generator, data: bytes) -> bytes:
    """Two lines exchanged, one dropped or one repeated."""
    lines = data.splitlines(keepends=True)
    if not lines:
        return data
    i, k = (int(n) for n in rng.integers(len(lines), size=2))
    choice = int(rng.integers(3))
    if choice == 0:
        lines[i], lines[k] = lines[k], lines[i]
    elif choice == 1:
        del lines[i]
    else:
        lines.insert(k, lines[i])
    return b"".join(lines)


def _drop_attribute(rng: np.random.Generator, data: bytes) -> bytes:
    found = list(_ATTRIBUTE.finditer(data))
    if not found:
        return data
    match = found[int(rng.integers(len(found)))]
    return data[: match.start()] + data[match.end() :]


def _exchange_values(rng: np.random.Generator, data: bytes) -> bytes:
    """One attribute gets the value of another."""
    found = [m for m in re.finditer(rb'"([^"]*)"', data)]
    if not found:
        return data
    one, other = (found[int(n)] for n in rng.integers(len(found), size=2))
    return data[: one.start(1)] + other[1] + data[one.end(1) :]


def _element(rng: np.random.Generator, data: bytes) -> bytes:
    """An element repeated, removed or moved to another one."""
    try:
        root = ET.fromstring(data)
    except (ET.ParseError, ValueError, LookupError):
        return data
    pairs = [(parent, child) for parent in root.iter() for child in parent]
    if not pairs:
        return data
    parent, child = pairs[int(rng.integers(len(pairs)))]
    choice = int(rng.integers(3))
    if choice != 0:
        parent.remove(child)
    if choice != 1:
        inside = set(child.iter())
        places = [e for e in root.iter() if e not in inside]
        place = parent if choice == 0 else places[int(rng.integers(len(places)))]
        place.append(child)
    return ET.tostring(root)


_BYTE_EDITS = (_flip, _delete, _insert, _repeat, _truncate, _extreme_word)
_TEXT_EDITS = (_number, _number, _scaled_number, _line)
_XML_EDITS = (_drop_attribute, _exchange_values, _element)
