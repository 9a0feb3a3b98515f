"""Meshes taken apart into convex pieces: closed, open, inside out, in time, and kept."""

from __future__ import annotations

import importlib.util
import time
from pathlib import Path

import numpy as np
import pytest
import trimesh

from artgym.errors import AssetError, MissingDependencyError
from artgym.objects import collision
from artgym.objects.collision import convex_pieces, facing_outwards, surface_gap
from artgym.objects.contents import TriangleMesh

needs_coacd = pytest.mark.skipif(
    importlib.util.find_spec("coacd") is None, reason="coacd is not installed: artgym[assets]"
)


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(collision.CACHE_VARIABLE, str(tmp_path / "cache"))
    return tmp_path / "cache" / "convex"


def mesh_of(*parts: trimesh.Trimesh) -> TriangleMesh:
    whole = trimesh.util.concatenate(parts)
    return TriangleMesh(whole.vertices, whole.faces)


def box(extents: tuple[float, float, float], at: tuple[float, float, float] = (0, 0, 0)):
    return trimesh.creation.box(extents, trimesh.transformations.translation_matrix(at))


#: A bar on two posts, as one surface, in metres.
HANDLE = trimesh.creation.extrude_polygon(
    trimesh.path.polygons.Polygon(
        [
            (0, 0),
            (0.02, 0),
            (0.02, 0.03),
            (0.13, 0.03),
            (0.13, 0),
            (0.15, 0),
            (0.15, 0.05),
            (0, 0.05),
        ]
    ),
    0.02,
)


def test_a_convex_mesh_is_its_hull():
    (piece,) = convex_pieces(mesh_of(box((0.4, 0.3, 0.2))))
    assert len(piece.points) == 8
    assert piece.volume == pytest.approx(0.024)


def test_loose_parts_are_pieces_of_their_own():
    pieces = convex_pieces(mesh_of(box((0.1, 0.1, 0.1)), box((0.1, 0.1, 0.1), (0.3, 0, 0))))
    assert sorted(p.centroid[0].round(6) for p in pieces) == [0.0, 0.3]


def test_what_lies_inside_another_part_is_left_out():
    assert len(convex_pieces(mesh_of(box((0.2, 0.2, 0.2)), box((0.1, 0.1, 0.1))))) == 1


@needs_coacd
def test_a_handle_keeps_its_gap():
    mesh = mesh_of(HANDLE)
    pieces = convex_pieces(mesh)
    assert 3 <= len(pieces) <= 12
    assert surface_gap(mesh, pieces) < collision.GOAL
    behind_bar = np.array([[0.075, 0.015, 0.01]])
    for piece in pieces:
        hull = trimesh.convex.convex_hull(piece.corners())
        assert trimesh.proximity.signed_distance(hull, behind_bar)[0] < -0.005


@needs_coacd
def test_inside_out_is_the_same_solid():
    turned = TriangleMesh(HANDLE.vertices, HANDLE.faces[:, ::-1])
    assert convex_pieces(turned) == convex_pieces(mesh_of(HANDLE))


@needs_coacd
def test_a_small_hole_is_closed():
    torn = TriangleMesh(HANDLE.vertices, HANDLE.faces[1:])
    assert surface_gap(mesh_of(HANDLE), convex_pieces(torn)) < collision.GOAL


@needs_coacd
def test_an_open_bowl_stays_open():
    whole = trimesh.creation.box((0.1, 0.1, 0.06))
    # Without its upper side, and without thickness.
    faces = whole.faces[whole.face_normals[:, 2] < 0.5]
    pieces = convex_pieces(TriangleMesh(whole.vertices, faces))
    middle = np.array([[0.0, 0.0, 0.0]])
    for piece in pieces:
        hull = trimesh.convex.convex_hull(piece.corners())
        assert trimesh.proximity.signed_distance(hull, middle)[0] < 0


def test_a_sheet_gets_a_thickness():
    flat = TriangleMesh(
        [[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0]], [[0, 1, 2], [0, 2, 3]]
    )
    (piece,) = convex_pieces(flat)
    assert np.ptp(piece.corners(), axis=0) == pytest.approx([0.1, 0.1, collision.THICKNESS])


def test_round_forms_have_few_points_and_little_loss():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    mesh = mesh_of(ball)
    pieces = convex_pieces(mesh)
    assert all(len(p.points) <= collision.MAX_POINTS for p in pieces)
    hulls = [trimesh.convex.convex_hull(p.corners()) for p in pieces]
    outside = np.min([-trimesh.proximity.signed_distance(h, ball.vertices) for h in hulls], axis=0)
    assert outside.max() < 0.001


def test_many_loose_parts_are_joined():
    bolts = [box((0.01, 0.01, 0.01), (0.03 * i, 0.03 * j, 0)) for i in range(10) for j in range(10)]
    pieces = convex_pieces(mesh_of(*bolts))
    assert len(pieces) == collision.MAX_PIECES


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        ([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]),
        ([[0, 0, 0], [0, 0, 0], [0, 0, 0]], [[0, 1, 2]]),
        (np.empty((0, 3)), np.empty((0, 3))),
    ],
)
def test_nothing_solid(vertices, faces):
    with pytest.raises(AssetError, match=r"knob\.obj: no triangle has an area"):
        convex_pieces(TriangleMesh(vertices, faces), name="knob.obj")


@needs_coacd
def test_kept_by_content(cache, monkeypatch):
    mesh = mesh_of(HANDLE)
    first = convex_pieces(mesh)
    (file,) = cache.iterdir()
    monkeypatch.setattr(collision, "_decomposed", None)
    with_picture = TriangleMesh(mesh.vertices, mesh.faces, np.zeros((len(mesh.vertices), 2)))
    assert convex_pieces(with_picture) == first
    monkeypatch.undo()
    monkeypatch.setenv(collision.CACHE_VARIABLE, str(cache.parent))
    # A damaged file is made again.
    file.write_bytes(file.read_bytes()[:-100])
    assert convex_pieces(mesh) == first


def test_a_cache_that_cannot_be_written_harms_nothing(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(collision.CACHE_VARIABLE, str(tmp_path / "file" / "cache"))
    assert len(convex_pieces(mesh_of(box((0.1, 0.1, 0.1))))) == 1


@needs_coacd
def test_it_ends_in_time():
    bumpy = trimesh.creation.icosphere(subdivisions=5, radius=0.2)
    rng = np.random.default_rng(0)
    bumpy.vertices *= rng.uniform(0.5, 1.0, (len(bumpy.vertices), 1))
    began = time.monotonic()
    with pytest.raises(AssetError, match=r"bumpy.*no convex pieces in time.*Simplify"):
        convex_pieces(TriangleMesh(bumpy.vertices, bumpy.faces), name="bumpy", time_limit=1.0)
    assert time.monotonic() - began < 20


def test_without_coacd(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingDependencyError, match=r"artgym\[assets\]"):
        convex_pieces(mesh_of(HANDLE))


def test_faces_are_turned_outwards():
    good = mesh_of(box((0.1, 0.2, 0.3)), box((0.1, 0.1, 0.1), (1, 0, 0)))
    assert facing_outwards(good) is good
    faces = good.faces.copy()
    faces[:12] = faces[:12][:, ::-1]
    faces[15] = faces[15][::-1]
    mended = facing_outwards(TriangleMesh(good.vertices, faces))
    volume = trimesh.Trimesh(mended.vertices, mended.faces, process=False).volume
    assert volume == pytest.approx(0.006 + 0.001)
    opened = TriangleMesh(good.vertices, good.faces[1:12][:, ::-1])
    assert facing_outwards(opened) is opened
