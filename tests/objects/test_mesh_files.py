from __future__ import annotations

import base64
import io
import json
import struct
import sys
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest

from artgym.errors import AssetError, MissingDependencyError
from artgym.objects import mesh_files
from artgym.objects.asset_folder import AssetFolder
from artgym.objects.contents import Image
from artgym.objects.mesh_files import MeshPiece, read_mesh

# A pyramid over the unit square: volume 1/3, outward faces.
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 1]], dtype=float)
FACES = np.array([[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])


def png(side: int = 4, color: tuple[int, int, int] = (255, 0, 0)) -> bytes:
    stream = io.BytesIO()
    PIL.Image.new("RGB", (side, side), color).save(stream, "PNG")
    return stream.getvalue()


def volume(pieces: tuple[MeshPiece, ...]) -> float:
    total = 0.0
    for piece in pieces:
        a, b, c = piece.mesh.vertices[piece.mesh.faces].swapaxes(0, 1)
        total += float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6
    return total


def obj_text() -> str:
    lines = [f"v {x} {y} {z}" for x, y, z in CORNERS]
    return "\n".join(lines + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in FACES]) + "\n"


def binary_stl(triangles: np.ndarray, count: int | None = None) -> bytes:
    facets = np.zeros(len(triangles), mesh_files._STL_FACET)
    facets["corners"] = triangles
    number = len(triangles) if count is None else count
    return b"\0" * 80 + struct.pack("<I", number) + facets.tobytes()


def ascii_stl() -> str:
    facets = []
    for triangle in CORNERS[FACES]:
        rows = "\n".join(f"      vertex {x:e} {y} {z}" for x, y, z in triangle)
        facets.append(f"  facet normal 0 0 0\n    outer loop\n{rows}\n    endloop\n  endfacet\n")
    return "solid pyramid\n" + "".join(facets) + "endsolid pyramid\n"


def gltf(**changes: Any) -> tuple[dict[str, Any], bytes]:
    positions = CORNERS.astype("<f4").tobytes()
    indices = FACES.astype("<u2").tobytes()
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.4, 0.6, 1.0]}}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": len(CORNERS)},
            {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": FACES.size},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": len(positions)},
            {"buffer": 0, "byteOffset": len(positions), "byteLength": len(indices)},
        ],
        "buffers": [{"byteLength": len(positions) + len(indices)}],
        **changes,
    }
    return document, positions + indices


def glb(document: dict[str, Any], binary: bytes, *, length: int | None = None) -> bytes:
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text
    body += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    total = 12 + len(body) if length is None else length
    return struct.pack("<4sII", b"glTF", 2, total) + body


DAE = """<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.5"/><up_axis>Y_UP</up_axis></asset>
<library_images><image id="img"><init_from>red.png</init_from></image></library_images>
<library_effects>
<effect id="plain"><profile_COMMON><technique sid="t"><lambert><diffuse>
<color>0.1 0.2 0.3 1</color></diffuse></lambert></technique></profile_COMMON></effect>
<effect id="pictured"><profile_COMMON>
<newparam sid="s"><surface type="2D"><init_from>img</init_from></surface></newparam>
<newparam sid="p"><sampler2D><source>s</source></sampler2D></newparam>
<technique sid="t"><phong><diffuse><texture texture="p" texcoord="UV"/></diffuse></phong>
</technique></profile_COMMON></effect></library_effects>
<library_materials><material id="mat"><instance_effect url="#{effect}"/></material>
</library_materials>
<library_geometries><geometry id="g"><mesh>
<source id="pos"><float_array id="pos-a" count="15">{positions}</float_array><technique_common>
<accessor source="#pos-a" count="5" stride="3"/></technique_common></source>
<source id="uv"><float_array id="uv-a" count="4">0 0 1 1</float_array><technique_common>
<accessor source="#uv-a" count="2" stride="2"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#pos"/></vertices>
<polylist material="m" count="5"><input semantic="VERTEX" source="#v" offset="0"/>
<input semantic="TEXCOORD" source="#uv" offset="1" set="0"/>
<vcount>{vcount}</vcount><p>{indices}</p></polylist></mesh></geometry></library_geometries>
<library_nodes><node id="again"><instance_node url="#again"/></node>{doubling}</library_nodes>
<library_visual_scenes><visual_scene id="s"><node id="n"><translate>0 0 2</translate>
<scale>2 2 2</scale>{more}<instance_geometry url="#g"><bind_material><technique_common>
<instance_material symbol="m" target="#mat"/></technique_common></bind_material>
</instance_geometry></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def dae(**changes: str) -> str:
    polygons = [[0, 3, 2, 1], *FACES[2:].tolist()]
    values = {
        "effect": "plain",
        "positions": " ".join(str(x) for x in CORNERS.ravel()),
        "vcount": "4 3 3 3 3",
        "indices": " ".join(f"{i} {i % 2}" for p in polygons for i in p),
        "more": "",
        # A few nodes that stand for 2^18.
        "doubling": "".join(
            f'<node id="twice{i}">' + f'<instance_node url="#twice{i + 1}"/>' * 2 + "</node>"
            for i in range(18)
        )
        + '<node id="twice18"/>',
        **changes,
    }
    return DAE.format(**values)


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., tuple[MeshPiece, ...]]:
    def write_and_read(
        name: str, content: bytes | str, *others: tuple[str, bytes | str], scale: Any = 1.0
    ) -> tuple[MeshPiece, ...]:
        for file, data in ((name, content), *others):
            (tmp_path / file).write_bytes(data if isinstance(data, bytes) else data.encode())
        return read_mesh(AssetFolder(tmp_path), name, scale)

    return write_and_read


Read = Callable[..., tuple[MeshPiece, ...]]


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        ("a.obj", obj_text(), 1 / 3),
        ("a.obj", obj_text().replace("\n", "\r\n"), 1 / 3),
        ("a.stl", binary_stl(CORNERS[FACES]), 1 / 3),
        ("a.stl", ascii_stl(), 1 / 3),
        ("a.STL", ascii_stl().upper(), 1 / 3),
        ("a.glb", glb(*gltf()), 1 / 3),
        ("a.dae", dae(), 1 / 3),
    ],
    ids=("obj", "crlf", "binary stl", "ascii stl", "upper case", "glb", "dae"),
)
def test_every_format_gives_the_same_pyramid(
    read: Read, name: str, content: bytes | str, expected: float
) -> None:
    pieces = read(name, content)
    assert volume(pieces) == pytest.approx(expected)
    assert sum(len(p.mesh.faces) for p in pieces) == 6
    assert sum(len(p.mesh.vertices) for p in pieces) >= 5


def test_scale_mirrors_and_keeps_the_outside_out(read: Read) -> None:
    (piece,) = read("a.obj", obj_text(), scale=(-2.0, 1.0, 0.5))
    assert volume((piece,)) == pytest.approx(1 / 3)
    assert piece.mesh.vertices.min(axis=0) == pytest.approx([-2, 0, 0])


def test_obj_polygons_negative_indices_and_other_statements(read: Read) -> None:
    text = "# x\no thing\ng a b\ns off\nvn 0 0 1\n"
    text += "".join(f"v {x} {y} {z} 1 0 0\n" for x, y, z in CORNERS)
    text += "f 4//1 3//1 2//1 1//1\nf -5 -4 -1\nf -4 -3 -1 \nf 3// 4// 5//\nl 1 2\nf \\\n4 1 5\n"
    (piece,) = read("a.obj", text)
    assert volume((piece,)) == pytest.approx(1 / 3)
    assert piece.material is None
    assert piece.mesh.uv is None


def test_obj_materials_and_pictures(read: Read) -> None:
    text = "mtllib looks.mtl\n" + "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
    text += "vt 0 0\nvt 1 0\nvt 1 1\nusemtl plain\nf 1 2 5\nusemtl wood\nf 1/1 4/2 3/3\n"
    text += "usemtl plain\nf 2 3 5\nusemtl unknown\nf 3 4 5\n"
    mtl = "newmtl plain\nKd 0.5 0.25 2\nnewmtl wood\nmap_Kd -s 1 1 1 -clamp on my red.png\n"
    mtl += "newmtl unused\nmap_Kd ../../nowhere.png\n"
    pieces = read("a.obj", text, ("looks.mtl", mtl), ("my red.png", png()))
    assert [len(p.mesh.faces) for p in pieces] == [2, 1, 1]
    plain, wood, unknown = pieces
    assert plain.material is not None
    assert plain.material.color == (0.5, 0.25, 1.0)
    assert wood.material is not None
    assert isinstance(wood.material.texture, Image)
    assert wood.material.texture.pixels[0, 0].tolist() == [255, 0, 0]
    assert wood.mesh.uv is not None
    assert wood.mesh.uv.tolist() == [[0, 0], [1, 1], [1, 0]]
    assert unknown.material is None


def test_large_pictures_are_reduced(read: Read) -> None:
    text = obj_text().replace("f ", "usemtl m\nf ", 1) + "mtllib m.mtl\n"
    (piece,) = read("a.obj", text, ("m.mtl", "newmtl m\nmap_Kd p.png"), ("p.png", png(2100)))
    assert piece.material is not None
    assert isinstance(piece.material.texture, Image)
    assert piece.material.texture.pixels.shape == (2048, 2048, 3)


def test_collision_needs_no_pictures(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("mtllib gone.mtl\nusemtl x\n" + obj_text())
    pieces = read_mesh(AssetFolder(tmp_path), "a.obj", looks=False)
    assert volume(pieces) == pytest.approx(1 / 3)
    with pytest.raises(AssetError, match=r"gone\.mtl"):
        read_mesh(AssetFolder(tmp_path), "a.obj")


def test_a_file_is_decoded_once(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(obj_text())
    folder = AssetFolder(tmp_path)
    assert read_mesh(folder, "a.obj") is read_mesh(folder, "./a.obj")
    assert folder.bytes_read == len(obj_text())


def test_dae_units_transforms_and_materials(read: Read) -> None:
    (piece,) = read("a.dae", dae())
    assert piece.mesh.vertices.min(axis=0) == pytest.approx([0, 0, 1])
    assert piece.mesh.vertices.max(axis=0) == pytest.approx([1, 1, 2])
    assert piece.material is not None
    assert piece.material.color == (0.1, 0.2, 0.3)


def test_dae_pictures(read: Read) -> None:
    (piece,) = read("a.dae", dae(effect="pictured"), ("red.png", png()))
    assert piece.material is not None
    assert isinstance(piece.material.texture, Image)
    assert piece.mesh.uv is not None


def test_gltf_nodes_pictures_and_buffers(read: Read) -> None:
    uv = np.array([[0, 0.25], [1, 0], [1, 1], [0, 1], [0.5, 0.5]], dtype="<f4").tobytes()
    document, binary = gltf()
    picture = base64.b64encode(png()).decode()
    document["nodes"] = [
        {"children": [1], "translation": [0, 0, 3]},
        {"mesh": 0, "rotation": [0, 0, 2**-0.5, 2**-0.5], "scale": [2, 1, 1]},
    ]
    document["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]
    document["textures"] = [{"source": 0}]
    document["images"] = [{"uri": f"data:image/png;base64,{picture}"}]
    document["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = 2
    document["accessors"].append(
        {"bufferView": 2, "componentType": 5126, "type": "VEC2", "count": 5}
    )
    document["bufferViews"].append({"buffer": 1, "byteLength": len(uv)})
    encoded = base64.b64encode(binary).decode()
    document["buffers"] = [
        {
            "byteLength": len(binary),
            "uri": f"data:application/octet-stream;base64,{encoded}",
        },
        {"byteLength": len(uv), "uri": "uv.bin"},
    ]
    (piece,) = read("a.gltf", json.dumps(document), ("uv.bin", uv))
    assert volume((piece,)) == pytest.approx(2 / 3)
    assert piece.mesh.vertices.min(axis=0) == pytest.approx([-1, 0, 3])
    assert piece.mesh.uv is not None
    assert piece.mesh.uv[0].tolist() == [0, 0.75]
    assert piece.material is not None
    assert isinstance(piece.material.texture, Image)


def test_degenerate_faces_are_dropped(read: Read) -> None:
    (piece,) = read("a.obj", obj_text() + "f 1 1 2\nf 1 2 2\n")
    assert len(piece.mesh.faces) == 6


_POSITION = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
_DEEP = '{"a":' * 5000


HOSTILE: list[tuple[str, bytes | str, str]] = [
    ("a.obj", _POSITION, "without faces"),
    ("a.obj", _POSITION + "f 1 2 4\n", "vertex that is not there"),
    ("a.obj", _POSITION + "f 1 2 -4\n", "vertex that is not there"),
    ("a.obj", _POSITION + "f 0 1 2\n", "Count vertices from 1"),
    ("a.obj", _POSITION + "f 1 2 99999999999999999999\n", "not there"),
    ("a.obj", _POSITION + "f 1 2\n", "fewer than three"),
    ("a.obj", _POSITION + "f a b c\n", "no index"),
    ("a.obj", _POSITION + "f 1 2 3/4/5/6\n", "no index"),
    ("a.obj", "v 0 0\nf 1 1 1\n", "too few numbers"),
    ("a.obj", _POSITION + "v nan 0 0\nf 1 2 4\n", "not finite"),
    ("a.obj", _POSITION + "v inf 0 0\nf 1 2 4\n", "not finite"),
    ("a.obj", _POSITION + "v 1e300 0 0\nf 1 2 4\n", "beyond"),
    ("a.obj", _POSITION + "v one 0 0\nf 1 2 4\n", "no number"),
    ("a.obj", _POSITION + "f 1 1 2\n", "without area"),
    ("a.obj", "v 0 0 0\nv 1e-8 0 0\nv 0 1e-8 0\nf 1 2 3\n", "smaller"),
    ("a.obj", b"\0\1\2" * 100, "not text"),
    ("a.obj", b"\xff\xfe\x81" * 100, "without faces"),
    ("a.obj", b"v " + b"9" * 10**6 + b" 0 0\nv 0 0 0\nv 0 1 0\nf 1 2 3\n", "no number"),
    ("a.obj", b"\n" * 6_000_000, "lines"),
    ("a.obj", b"v 0 0 0\n" * 1_000_002, "vertices"),
    ("a.obj", _POSITION.encode() + b"f 1 2 3\n" * 500_002, "faces"),
    ("a.obj", _POSITION.encode() + b"f" + b" 1 2 3" * 200_000 + b"\n", "faces"),
    ("a.obj", _POSITION + "vt 0 0\nf 1/1 2/1 3/2\nmtllib a\n", "picture coordinate"),
    ("a.stl", binary_stl(CORNERS[FACES], 7), "size does not match"),
    ("a.stl", binary_stl(CORNERS[FACES], 2**32 - 1), "size does not match"),
    ("a.stl", binary_stl(CORNERS[FACES])[:-1], "size does not match"),
    ("a.stl", binary_stl(CORNERS[FACES][:0]), "without faces"),
    ("a.stl", binary_stl(CORNERS[FACES] * np.nan), "not finite"),
    ("a.stl", b"x" * 34, "size does not match"),
    ("a.stl", ascii_stl()[:-30], "cut off"),
    ("a.stl", ascii_stl().replace("vertex", "vrtx", 1), "three vertices"),
    ("a.stl", ascii_stl().replace("1.0", "one"), "no number"),
    ("a.glb", glb(*gltf(), length=10), "length"),
    ("a.glb", glb(*gltf())[:-4], "length"),
    ("a.glb", b"glTF" + b"\1" * 30, "version"),
    ("a.glb", b"nonsense" * 4, "not a GLB"),
    ("a.gltf", b"{", "JSON"),
    ("a.gltf", _DEEP, "JSON"),
    ("a.gltf", b"[]", "glTF 2.0"),
    ("a.gltf", b"{}", "without faces"),
    ("a.gltf", b'{"scenes": 3}', "glTF 2.0"),
    ("a.gltf", b'{"meshes": [{"primitives": [{}]}]}', "glTF 2.0"),
    ("a.dae", dae(positions="0 0 0"), "not there"),
    ("a.dae", dae(positions=" ".join(["nan"] * 15)), "not finite"),
    ("a.dae", dae(positions="x " * 15), "no number"),
    ("a.dae", dae(vcount="4 3 3 3 300"), "corners"),
    ("a.dae", dae(vcount="4 3 3 3"), "whole faces"),
    ("a.dae", dae(indices="0 0 1"), "cut off"),
    ("a.dae", dae(more='<instance_node url="#again"/>'), "hold themselves"),
    ("a.dae", dae(more='<instance_node url="#gone"/>'), "refers to no"),
    ("a.dae", dae(effect="gone"), "refers to no"),
    ("a.dae", dae(effect="pictured"), r"red\.png"),
    ("a.dae", "<robot/>", "not a Collada"),
    ("a.dae", "<!DOCTYPE a [<!ENTITY b 'c'>]><COLLADA>&b;</COLLADA>", "document type"),
    ("a.obj", _POSITION + "mtllib " + "a " * 10**6 + "\nusemtl a\nf 1 2 3\n", "name of a file"),
    (
        "a.obj",
        _POSITION + "".join(f"usemtl m{i}\nf 1 2 3\n" for i in range(3000)),
        "groups of faces",
    ),
    ("a.dae", dae(more='<instance_node url="#twice0"/>'), "hold themselves"),
    ("a.dae", dae(more="<scale>1e308 1 1</scale><scale>1e308 1 1</scale>"), "not finite"),
    ("a.dae", dae(positions="0 " * 8_000_001), "numbers"),
    ("a.gltf", b"[" + b"0," * 600_000 + b"0]", "entries"),
    ("a.fbx", b"x", "not a mesh format"),
    ("a.obj.gz", b"x", "archive"),
]


@pytest.mark.parametrize(
    ("name", "content", "words"), HOSTILE, ids=[f"{name}: {words}" for name, _, words in HOSTILE]
)
def test_hostile_files_are_refused_quickly(
    read: Read, name: str, content: bytes | str, words: str
) -> None:
    start = time.monotonic()
    with pytest.raises(AssetError, match=words) as caught:
        read(name, content)
    assert time.monotonic() - start < 2
    assert caught.value.remedy
    assert name in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"nodes": [{"mesh": 0, "children": [0]}]}, "two parents"),
        ({"nodes": [{"mesh": 9}]}, "no such entry"),
        ({"nodes": [{"mesh": 0, "rotation": [0, 0, 0, 0]}]}, "not a rotation"),
        ({"nodes": [{"mesh": 0, "translation": [1e308, 0, 0], "scale": [1e308, 1, 1]}]}, "beyond"),
        ({"nodes": [{"mesh": 0, "skin": 0}]}, "skinned"),
        ({"scenes": [{"nodes": [-1]}]}, "no such entry"),
        ({"scenes": [{"nodes": ["0"]}]}, "no such entry"),
        ({"buffers": [{"byteLength": 10**9}]}, "less data"),
        ({"buffers": [{"byteLength": 90, "uri": "/etc/passwd"}]}, "outside"),
        ({"buffers": [{"byteLength": 90, "uri": "data:;base64,!!!"}]}, "data URI"),
        ({"bufferViews": [{"buffer": 0, "byteLength": 10**9}] * 2}, "outside its buffer"),
        ({"bufferViews": [{"buffer": 0, "byteLength": -4}] * 2}, "outside its buffer"),
        ({"materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1]}}]}, "not a colour"),
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "extension"),
        (
            {
                "accessors": [
                    {"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 10**9},
                    {"bufferView": 1, "componentType": 5123, "type": "SCALAR", "count": 18},
                ]
            },
            "vertices",
        ),
    ],
)
def test_hostile_gltf(read: Read, changes: dict[str, Any], words: str) -> None:
    with pytest.raises(AssetError, match=words):
        read("a.glb", glb(*gltf(**changes)))


def test_primitives_that_share_large_buffers(read: Read) -> None:
    document, binary = gltf()
    document["accessors"][0]["count"] = 5
    primitive = document["meshes"][0]["primitives"][0]
    document["meshes"][0]["primitives"] = [primitive] * 300
    assert volume(read("a.glb", glb(document, binary))) == pytest.approx(100)
    document["meshes"][0]["primitives"] = [primitive] * 2001
    with pytest.raises(AssetError, match="groups of faces"):
        read("a.glb", glb(document, binary))


def test_a_missing_package_is_named(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "defusedxml.common", None)
    with pytest.raises(MissingDependencyError, match="pip install"):
        read("a.dae", dae())


def test_pictures_that_are_too_large_or_broken(read: Read, monkeypatch: pytest.MonkeyPatch) -> None:
    def with_picture(data: bytes) -> tuple[MeshPiece, ...]:
        text = "mtllib m.mtl\nusemtl m\n" + obj_text()
        return read("a.obj", text, ("m.mtl", "newmtl m\nmap_Kd p.png\n"), ("p.png", data))

    for side, words in ((5000, "4096 pixels"), (60_000, "exceeds")):
        header = bytearray(png())
        header[16:24] = struct.pack(">II", side, side)
        header[29:33] = struct.pack(">I", zlib.crc32(header[12:29]))
        with pytest.raises(AssetError, match=words):
            with_picture(bytes(header))
    with pytest.raises(AssetError, match="scans"):
        with_picture(b"\xff\xd8" + b"\xff\xda\0\0" * 200)
    for broken in (png(64)[:-40], png(64)[:60], b"GIF89a", b"not a picture"):
        with pytest.raises(AssetError, match="not a picture"):
            with_picture(broken)
    monkeypatch.setattr(mesh_files, "MAX_TOTAL_PIXELS", 10)
    with pytest.raises(AssetError, match="in all"):
        with_picture(png())


@pytest.mark.parametrize("scale", [0.0, np.nan, np.inf, (1.0, 0.0, 1.0), 1e9])
def test_scales_that_make_no_mesh(read: Read, scale: Any) -> None:
    with pytest.raises(AssetError, match="scal"):
        read("a.obj", obj_text(), scale=scale)


def test_a_large_mesh_is_read_in_seconds(read: Read) -> None:
    side = 200
    x, y = np.meshgrid(np.arange(side), np.arange(side))
    lines = [f"v {a} {b} 0" for a, b in zip(x.ravel(), y.ravel(), strict=True)]
    at = np.arange(side * side).reshape(side, side)[:-1, :-1].ravel() + 1
    lines += [f"f {i} {i + 1} {i + side + 1} {i + side}" for i in at]
    start = time.monotonic()
    (piece,) = read("a.obj", "\n".join(lines))
    assert len(piece.mesh.faces) == 2 * (side - 1) ** 2
    assert time.monotonic() - start < 10
