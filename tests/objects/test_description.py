"""Objects written and read again; what is damaged is refused."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from artgym.errors import AssetError, InvalidArgumentError
from artgym.objects import catalog, description
from artgym.objects.contents import Image, TriangleMesh
from artgym.objects.description import read_description, write_description
from artgym.objects.model import ArticulatedObject, Inertial, Material, Visual


@pytest.fixture(scope="module")
def pictured() -> ArticulatedObject:
    """A laptop with a mesh, a picture and mass properties of its own."""
    rng = np.random.default_rng(0)
    laptop = catalog.load("laptop/0003")
    mesh = TriangleMesh(rng.normal(size=(50, 3)), rng.integers(0, 50, (90, 3)), rng.random((50, 2)))
    plain = TriangleMesh(mesh.vertices, mesh.faces)
    picture = Image(rng.integers(0, 256, (7, 5, 3)))
    look = Material(color=(1.0, 0.5, 0.25), texture=picture)
    visuals = (
        Visual(mesh=mesh, material=look),
        Visual(mesh=plain, material=replace(look, texture=None)),
        Visual(mesh=mesh, material=replace(look, roughness=0.1)),
    )
    inertial = Inertial(
        mass=0.3,
        center_of_mass=(1e-300, -0.0, 0.1),
        inertia=((0.1, 1e-17, 0.0), (1e-17, 0.1, 0), (0.0, 0, 1 / 7)),
    )
    base = replace(laptop.links[0], visuals=visuals, inertial=inertial)
    return replace(laptop, links=(base, *laptop.links[1:]))


@pytest.mark.parametrize("category", list(catalog.CATEGORIES))
@pytest.mark.parametrize("number", [0, 1, 1200])
def test_procedural_objects_come_back(category: str, number: int, tmp_path: Path) -> None:
    obj = catalog.load(f"{category}/{number:04d}")
    read = read_description(write_description(obj, tmp_path / "a"))
    assert read == obj
    assert read.content_hash() == obj.content_hash()


def test_meshes_and_pictures_come_back(pictured: ArticulatedObject, tmp_path: Path) -> None:
    read = read_description(write_description(pictured, tmp_path))
    assert read == pictured
    assert read.content_hash() == pictured.content_hash()
    assert str(read.links[0].inertial) == str(pictured.links[0].inertial)
    arrays = np.load(tmp_path / "arrays.npz", allow_pickle=False)
    # Two visuals share a mesh, and it is there once.
    assert sorted(arrays) == [
        "mesh_0_faces",
        "mesh_0_uv",
        "mesh_0_vertices",
        "mesh_1_faces",
        "mesh_1_vertices",
        "picture_0",
    ]
    np.testing.assert_array_equal(
        arrays["picture_0"], np.asarray(read.links[0].visuals[0].material.texture.pixels)
    )  # type: ignore[union-attr]


def test_equal_objects_give_equal_bytes(pictured: ArticulatedObject, tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_description(pictured, tmp_path / name)
    for file in ("object.json", "arrays.npz"):
        assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()


def test_large_arrays_are_written_compressed(
    pictured: ArticulatedObject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    small = write_description(pictured, tmp_path / "small") / "arrays.npz"
    monkeypatch.setattr(description, "_MAX_UNPACKED_BYTES", 1000)
    large = write_description(pictured, tmp_path / "large")
    assert (large / "arrays.npz").stat().st_size < small.stat().st_size
    assert read_description(large) == read_description(small.parent) == pictured


def test_a_number_of_numpy_comes_back_equal(tmp_path: Path) -> None:
    laptop = catalog.load("laptop/0003")
    link = replace(laptop.links[1], density=np.float64(100.1))
    obj = replace(laptop, links=(laptop.links[0], link))
    read = read_description(write_description(obj, tmp_path))
    assert read == obj
    assert read.content_hash() == obj.content_hash()


@pytest.mark.parametrize("value", [np.int64(3), np.float32(0.1), float("nan"), [1.0], b"x"])
def test_what_json_does_not_know_is_refused_with_its_place(tmp_path: Path, value: object) -> None:
    laptop = catalog.load("laptop/0003")
    link = replace(laptop.links[1], density=value)  # type: ignore[arg-type]
    obj = replace(laptop, links=(laptop.links[0], link))
    with pytest.raises(InvalidArgumentError, match=r"links\[1\]\.density is "):
        write_description(obj, tmp_path)


def test_what_nobody_could_read_is_not_written(
    pictured: ArticulatedObject, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(description, "MAX_BYTES", {"text": 2**20, "mesh": 100})
    with pytest.raises(InvalidArgumentError, match=r"arrays\.npz would have .* Simplify"):
        write_description(pictured, tmp_path)
    assert not list(tmp_path.iterdir())


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_no_flipped_byte_passes(
    data: st.DataObject, pictured: ArticulatedObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """A description with a changed byte is the same object or an error, never another object."""
    folder = write_description(pictured, tmp_path_factory.mktemp("flipped"))
    path = folder / data.draw(st.sampled_from(["object.json", "arrays.npz"]))
    content = bytearray(path.read_bytes())
    at = data.draw(st.integers(0, len(content) - 1))
    content[at] ^= data.draw(st.integers(1, 255))
    path.write_bytes(content)
    found = _object_or_error(folder)
    if isinstance(found, AssetError):
        assert str(folder) in str(found)
        assert found.remedy
    else:
        assert found == pictured


def _object_or_error(folder: Path) -> ArticulatedObject | AssetError:
    try:
        return read_description(folder)
    except AssetError as error:
        return error


@pytest.mark.parametrize("value", [None, True, "1", [], {}, 1e300, -1, 10**400, [[[]]]])
def test_no_wrong_value_passes(pictured: ArticulatedObject, tmp_path: Path, value: object) -> None:
    """Every single value of the JSON, replaced: an error, or the value was the same anyway."""
    path = write_description(pictured, tmp_path) / "object.json"
    content = json.loads(path.read_text())
    places = list(_places(content))
    assert len(places) > 300
    for place in places[:: max(1, len(places) // 60)]:
        changed = json.loads(path.read_text())
        item = changed
        for key in place[:-1]:
            item = item[key]
        if item[place[-1]] == value:
            continue
        item[place[-1]] = value
        (tmp_path / "x").mkdir(exist_ok=True)
        (tmp_path / "x" / "object.json").write_text(json.dumps(changed))
        (tmp_path / "x" / "arrays.npz").write_bytes((tmp_path / "arrays.npz").read_bytes())
        with pytest.raises(AssetError, match=r"object\.json|arrays\.npz"):
            read_description(tmp_path / "x")


def _places(value: object, before: tuple = ()):
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _places(item, (*before, key))
    elif isinstance(value, list):
        for i, item in enumerate(value):
            yield from _places(item, (*before, i))
    else:
        yield before
