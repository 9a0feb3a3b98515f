from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from artgym.errors import AssetError
from artgym.objects import asset_folder
from artgym.objects.asset_folder import AssetFolder

SECRET = b"what nobody may read"


@pytest.fixture
def folder(tmp_path: Path) -> AssetFolder:
    (tmp_path / "secret.obj").write_bytes(SECRET)
    inside = tmp_path / "inside"
    (inside / "meshes").mkdir(parents=True)
    (inside / "meshes" / "a.obj").write_bytes(b"a")
    (inside / "meshes" / "b c.obj").write_bytes(b"b")
    return AssetFolder(inside)


@pytest.mark.parametrize(
    ("name", "mentioned_in", "found"),
    [
        ("meshes/a.obj", "", "meshes/a.obj"),
        ("./meshes/../meshes/a.obj", "", "meshes/a.obj"),
        ("a.obj", "meshes/x.mtl", "meshes/a.obj"),
        ("../meshes/a.obj", "meshes/x.mtl", "meshes/a.obj"),
        ("meshes\\a.obj", "", "meshes/a.obj"),
        ("meshes/b c.obj", "", "meshes/b c.obj"),
        ("package://robot/meshes/a.obj", "deep/x.urdf", "meshes/a.obj"),
        ("package://meshes/a.obj", "", "meshes/a.obj"),
        ("model://robot/meshes/a.obj", "", "meshes/a.obj"),
        ("file://meshes/a.obj", "", "meshes/a.obj"),
    ],
)
def test_names_are_found_inside(
    folder: AssetFolder, name: str, mentioned_in: str, found: str
) -> None:
    assert folder.locate(name, mentioned_in=mentioned_in) == found
    assert folder.read(name, "mesh", mentioned_in=mentioned_in)


@pytest.mark.parametrize(
    "name",
    [
        "../secret.obj",
        "meshes/../../secret.obj",
        "meshes/..\\..\\secret.obj",
        "package://robot/../../secret.obj",
        "package://../secret.obj",
        "file:///etc/passwd",
        "file:/etc/passwd",
        "/etc/passwd",
        "\\etc\\passwd",
        "~/secret.obj",
        "~root/x",
        "C:\\secret.obj",
        "C:/secret.obj",
        "http://example.org/a.obj",
        "\\\\server\\share\\a.obj",
        "link.obj",
        "linked/secret.obj",
        "ring.obj",
        "missing.obj",
        "meshes",
        "",
        " ",
        ".",
        "..",
        "a\0.obj",
        "a\n.obj",
        "x" * 5000,
        "meshes/" * 60 + "a.obj",
        "a.zip",
        "package://robot",
    ],
)
def test_names_that_lead_elsewhere_are_refused(folder: AssetFolder, name: str) -> None:
    os.symlink("../secret.obj", folder.root / "link.obj")
    os.symlink("..", folder.root / "linked")
    os.symlink("ring.obj", folder.root / "ring.obj")
    with pytest.raises(AssetError) as caught:
        folder.read(name, "mesh", mentioned_in="x.urdf", element="link 'lid' visual 0")
    assert str(folder.root) in str(caught.value)
    assert caught.value.remedy


def test_a_link_inside_is_followed(folder: AssetFolder) -> None:
    os.symlink("meshes/a.obj", folder.root / "link.obj")
    assert folder.read("link.obj", "mesh") == b"a"
    assert folder.locate("link.obj") == "meshes/a.obj"


def test_a_root_reached_through_a_link_works(tmp_path: Path, folder: AssetFolder) -> None:
    os.symlink("inside", tmp_path / "alias")
    assert AssetFolder(tmp_path / "alias").read("meshes/a.obj", "mesh") == b"a"


def test_pipes_and_devices_are_refused_at_once(folder: AssetFolder) -> None:
    os.mkfifo(folder.root / "pipe.obj")
    start = time.monotonic()
    with pytest.raises(AssetError, match="not a regular file"):
        folder.read("pipe.obj", "mesh")
    assert time.monotonic() - start < 1


def test_sizes_are_limited(folder: AssetFolder, monkeypatch: pytest.MonkeyPatch) -> None:
    with open(folder.root / "large.xml", "wb") as file:
        file.truncate(asset_folder.MAX_BYTES["xml"] + 1)
    with pytest.raises(AssetError, match="larger than 8 MB"):
        folder.read("large.xml", "xml")
    (folder.root / "empty.obj").touch()
    with pytest.raises(AssetError, match="empty"):
        folder.read("empty.obj", "mesh")
    monkeypatch.setattr(asset_folder, "MAX_TOTAL_BYTES", 3)
    for _ in range(3):
        folder.read("meshes/a.obj", "mesh")
    with pytest.raises(AssetError, match="exceed"):
        folder.read("meshes/a.obj", "mesh")


@pytest.mark.parametrize("name", ["missing", "file.txt", "object.zip", "object.tar.gz", "a\0b"])
def test_a_root_that_is_no_folder_is_refused(tmp_path: Path, name: str) -> None:
    if "\0" not in name and name != "missing":
        (tmp_path / name).write_bytes(b"PK\x03\x04")
    with pytest.raises(AssetError):
        AssetFolder(tmp_path / name)


# The tracing hook cannot be removed again, so it lives in a process of its own.
_TRACED = """
import sys
from pathlib import Path
from artgym.errors import AssetError
import artgym.objects.collision, PIL.Image, defusedxml.ElementTree
from artgym.objects.urdf import parse_urdf
PIL.Image.init()
opened = []
sys.addaudithook(lambda event, args: opened.append(args[0]) if event == "open" else None)
outcomes = []
for path in sorted(Path(sys.argv[1]).glob("*.urdf")):
    try:
        parse_urdf(path)
        outcomes.append("read")
    except AssetError:
        outcomes.append("refused")
print(outcomes)
for name in opened:
    print(name)
"""

_URDF = """<robot name="x"><link name="a"><visual><geometry>
<mesh filename="{}"/></geometry></visual></link></robot>"""


def test_nothing_outside_is_ever_opened(tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n{}f 1 2 3\n"
    (outside / "mesh.obj").write_text(triangle.format(""))
    (outside / "m.mtl").write_text("newmtl m\nKd 1 0 0\n")
    inside = tmp_path / "inside"
    inside.mkdir()
    (inside / "good.obj").write_text(triangle.format(""))
    (inside / "mtl.obj").write_text(triangle.format("mtllib ../outside/m.mtl\nusemtl m\n"))
    (inside / "map.obj").write_text(triangle.format("mtllib map.mtl\nusemtl m\n"))
    (inside / "map.mtl").write_text(f"newmtl m\nmap_Kd {outside}/mesh.obj\n")
    (inside / "buffers.gltf").write_text(
        '{"asset": {"version": "2.0"}, "meshes": [{"primitives": [{"attributes": '
        '{"POSITION": 0}}]}], "accessors": [{"bufferView": 0, "componentType": 5126, '
        '"type": "VEC3", "count": 3}], "bufferViews": [{"buffer": 0, "byteLength": 36}], '
        '"buffers": [{"uri": "../outside/mesh.obj", "byteLength": 36}]}'
    )
    os.symlink(outside / "mesh.obj", inside / "link.obj")
    names = [
        "good.obj",
        "../outside/mesh.obj",
        str(outside / "mesh.obj"),
        "link.obj",
        "mtl.obj",
        "map.obj",
        "buffers.gltf",
    ]
    for i, name in enumerate(names):
        (inside / f"{i}.urdf").write_text(_URDF.format(name))
    (inside / "7.urdf").write_text(
        f'<!DOCTYPE r [<!ENTITY e SYSTEM "{outside}/mesh.obj">]><robot name="x">&e;</robot>'
    )
    result = subprocess.run(
        [sys.executable, "-c", _TRACED, str(inside)], capture_output=True, text=True, check=True
    )
    outcomes, *opened = result.stdout.splitlines()
    assert outcomes == str(["read"] + ["refused"] * 7)
    opened = [name for name in opened if not name.endswith((".py", ".pyc", ".so", ".nbi", ".nbc"))]
    assert str(inside / "good.obj") in opened
    # A file opened by descriptor shows its number.
    strangers = [n for n in opened if not (n.isdigit() or Path(n).is_relative_to(inside.resolve()))]
    assert strangers == []
