"""What cameras see: colours, patterns, and pictures the right way up."""

from __future__ import annotations

import imageio.v3 as iio
import numpy as np
import pytest
import sapien

from artgym import cli
from artgym.geometry.camera import look_at
from artgym.objects import catalog
from artgym.objects.contents import Image, TriangleMesh
from artgym.objects.model import (
    Box,
    Convex,
    Cylinder,
    Geometry,
    Link,
    Material,
    Shape,
    Texture,
    Visual,
)
from artgym.objects.procedural.shapes import frustum
from artgym.objects.textures import PATTERNS
from artgym.sim.camera import RenderedCamera, View
from artgym.sim.scene import link_visual, visual_body
from artgym.sim.setting import add_lights, random_table
from artgym.sim.surfaces import piece_surface
from artgym.sim.thumbnail import thumbnail

COLOR = (0.5, 0.25, 0.1)
PLAIN = Material(color=COLOR, roughness=1.0)
GEOMETRIES: dict[str, Geometry] = {
    "box": Box(half_size=(0.05, 0.15, 0.08)),
    "cylinder": Cylinder(radius=0.08, half_length=0.15),
    "convex": Convex(points=((-0.1, -0.1, -0.1), (0.1, -0.1, -0.1), (0, 0.15, -0.1), (0, 0, 0.15))),
}
FRUSTUM = frustum("z", (0, 0, -0.1), (0.1, 0.1), (0.08, 0.08), 0.2, PLAIN).geometry


def seen(
    body: sapien.render.RenderBodyComponent, system: sapien.render.RenderSystem, up: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """RGB and whether something is there, from 0.6 m in front (+x) or obliquely above."""
    scene = sapien.Scene([sapien.physx.PhysxCpuSystem(), system])
    scene.set_ambient_light([0.7] * 3)
    entity = sapien.Entity()
    entity.add_component(body)
    scene.add_entity(entity)
    eye = [0.4, 0.2, 0.4] if up else [0.6, 0.0, 0.0]
    view = View(T_world_camera=look_at(eye, [0, 0, 0]), fov_y=0.6, width=160, height=120)
    rgb, depth = RenderedCamera(scene, view).take()
    scene.clear()
    return rgb.astype(int), depth > 0


def shape_of(geometry: Geometry, material: Material) -> Shape:
    return Shape(geometry=geometry, position=(0, 0, 0), material=material)


@pytest.mark.parametrize("name", GEOMETRIES)
@pytest.mark.parametrize("pattern", ["granite", "grain", "tiles"])
def test_a_textured_piece_shows_its_colour_and_its_pattern(render_system, name, pattern):
    texture = Texture(pattern=pattern, seed=1, tile=0.1)
    textured = Material(color=COLOR, roughness=1.0, texture=texture)
    shape = GEOMETRIES[name]
    plain, there = seen(visual_body([shape_of(shape, PLAIN)]), render_system)
    got, there_too = seen(visual_body([shape_of(shape, textured)]), render_system)
    # The same silhouette, up to the sides of a cylinder.
    assert np.mean(there != there_too) < 0.01
    both = there & there_too
    assert np.abs(got[both].mean(axis=0) - plain[both].mean(axis=0)).max() < 6
    assert got[both].std(axis=0).max() > plain[both].std(axis=0).max() + 1.0


def test_a_flat_picture_looks_like_plain_colour(render_system):
    """Pictures are sRGB: each linear colour comes out as it does without a texture."""
    for value in (0.02, 0.2, 0.8):
        linear = (value, 0.5 * value, 0.9 * value)
        encoded = [12.92 * c if c <= 0.0031308 else 1.055 * c ** (1 / 2.4) - 0.055 for c in linear]
        image = Image(np.tile(np.uint8(np.round(255 * np.array(encoded))), (16, 16, 1)))
        square = np.array([[0, -0.1, -0.1], [0, 0.1, -0.1], [0, 0.1, 0.1], [0, -0.1, 0.1]])
        mesh = TriangleMesh(square, [[0, 1, 2], [0, 2, 3]], [[0, 0], [1, 0], [1, 1], [0, 1]])
        looks = [Material(color=linear), Material(color=(1, 1, 1), texture=image)]
        shown = []
        for look in looks:
            link = Link(name="picture", shapes=(), visuals=(Visual(mesh=mesh, material=look),))
            shown.append(seen(link_visual(link), render_system)[0][60, 80])
        assert np.abs(shown[0] - shown[1]).max() <= 3


def test_an_imported_picture_is_the_right_way_up(render_system):
    """v grows upwards: the picture's first row is at the top, its first column at the left."""
    picture = np.zeros((32, 32, 3), dtype=np.uint8)
    picture[:16, :16] = (255, 0, 0)
    picture[:16, 16:] = (0, 255, 0)
    picture[16:, :16] = (0, 0, 255)
    picture[16:, 16:] = (255, 255, 255)
    # Seen from +x with z up, y grows to the right.
    square = np.array([[0, -0.1, -0.1], [0, 0.1, -0.1], [0, 0.1, 0.1], [0, -0.1, 0.1]])
    mesh = TriangleMesh(square, [[0, 1, 2], [0, 2, 3]], [[0, 0], [1, 0], [1, 1], [0, 1]])
    look = Material(color=(1, 1, 1), roughness=1.0, texture=Image(picture))
    link = Link(name="picture", shapes=(), visuals=(Visual(mesh=mesh, material=look),))
    rgb, _ = seen(link_visual(link), render_system)
    above, below, left, right = 50, 70, 70, 90
    np.testing.assert_array_equal(rgb[above, left] > 100, [True, False, False])
    np.testing.assert_array_equal(rgb[above, right] > 100, [False, True, False])
    np.testing.assert_array_equal(rgb[below, left] > 100, [False, False, True])
    np.testing.assert_array_equal(rgb[below, right] > 100, [True, True, True])


def test_a_picture_without_a_place_gives_way_to_the_colour(render_system):
    image = Image(np.full((8, 8, 3), 255, dtype=np.uint8))
    square = np.array([[0, -0.1, -0.1], [0, 0.1, -0.1], [0, 0.1, 0.1], [0, -0.1, 0.1]])
    mesh = TriangleMesh(square, [[0, 1, 2], [0, 2, 3]])
    look = Material(color=(0.5, 0.0, 0.0), texture=image)
    link = Link(name="picture", shapes=(), visuals=(Visual(mesh=mesh, material=look),))
    rgb, _ = seen(link_visual(link), render_system)
    assert rgb[60, 80, 0] > 100
    assert rgb[60, 80, 1] == 0


@pytest.mark.parametrize("geometry", [*GEOMETRIES.values(), FRUSTUM])
def test_surfaces_are_closed_and_face_outwards(geometry):
    surface = piece_surface(geometry)
    a, b, c = surface.vertices.reshape(-1, 3, 3).astype(float).swapaxes(0, 1)
    flat = np.cross(b - a, c - a)
    np.testing.assert_allclose(flat.sum(axis=0), 0.0, atol=1e-6)
    volume = np.einsum("ij,ij->i", a, flat).sum() / 6
    assert volume == pytest.approx(geometry.volume, rel=0.01)
    shaded = surface.normals.reshape(-1, 3, 3)
    np.testing.assert_allclose(np.linalg.norm(shaded, axis=-1), 1.0, atol=1e-5)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    assert np.einsum("nci,ni->nc", shaded, flat).min() > np.cos(np.radians(40.0))


def test_round_pieces_shade_smoothly_and_edges_stay_sharp():
    surface = piece_surface(FRUSTUM)
    corners = {}
    for point, normal in zip(surface.vertices, surface.normals, strict=True):
        corners.setdefault(tuple(np.round(point, 5)), set()).add(tuple(np.round(normal, 2)))
    # Each corner of the rim has one normal of the side and one of the end, not one a face.
    assert all(len(normals) == 2 for normals in corners.values())


def test_pictures_have_the_size_of_their_tile():
    for geometry in (GEOMETRIES["box"], GEOMETRIES["convex"], FRUSTUM):
        surface = piece_surface(geometry)
        uv = surface.uv(np.zeros(3), tile=0.2).reshape(-1, 3, 2)
        points = surface.vertices.reshape(-1, 3, 3)
        for k in (1, 2):
            length = np.linalg.norm(points[:, k] - points[:, 0], axis=1)
            assert np.all(np.linalg.norm(uv[:, k] - uv[:, 0], axis=1) <= length / 0.2 + 1e-6)


def test_the_longest_side_lies_along_the_rows():
    surface = piece_surface(Box(half_size=(0.1, 0.5, 0.2)))
    uv = surface.uv(np.zeros(3), tile=1.0)
    front = surface.sides == 0
    np.testing.assert_allclose(uv[front, 0], surface.vertices[front, 1], atol=1e-6)


def test_a_thumbnail_is_filled_by_its_object(render_system):
    for object_id in ("drawer/1200", "faucet/0003"):
        picture = thumbnail(catalog.load(object_id), (160, 120), open_fraction=0.5).astype(int)
        assert picture.shape == (120, 160, 3)
        ground = np.median(picture[0], axis=0)
        differs = np.abs(picture - ground).max(axis=-1) > 12
        rows, columns = np.flatnonzero(differs.any(1)), np.flatnonzero(differs.any(0))
        assert max(np.ptp(rows) / 120, np.ptp(columns) / 160) > 0.85


@pytest.mark.parametrize("pattern", PATTERNS)
def test_every_pattern_can_be_rendered(render_system, pattern):
    look = Material(color=COLOR, texture=Texture(pattern=pattern, tile=0.1))
    rgb, there = seen(visual_body([shape_of(GEOMETRIES["box"], look)]), render_system, up=True)
    assert rgb[there].mean() > 30


def test_tables_come_in_many_materials_that_their_numbers_decide():
    tables = [random_table(np.random.default_rng(seed)) for seed in range(200)]
    assert tables == [random_table(np.random.default_rng(seed)) for seed in range(200)]
    assert all(0.0 <= c <= 1.0 for table in tables for c in table.color)
    patterns = {t.texture.pattern for t in tables if isinstance(t.texture, Texture)}
    assert patterns <= set(PATTERNS)
    assert len(patterns) >= 10
    assert 0.25 < np.mean([t.texture is None for t in tables]) < 0.55


def test_light_is_neither_dark_nor_blinding(render_system):
    brightness = []
    for seed in range(30):
        scene = sapien.Scene([sapien.physx.PhysxCpuSystem(), render_system])
        add_lights(scene, np.random.default_rng(seed))
        entity = sapien.Entity()
        look = Material(color=(0.4, 0.4, 0.4), roughness=0.8)
        entity.add_component(visual_body([shape_of(Box(half_size=(0.3, 0.3, 0.1)), look)]))
        scene.add_entity(entity)
        T = look_at([0.5, 0.2, 0.7], [0, 0, 0])
        view = View(T_world_camera=T, fov_y=0.3, width=32, height=24)
        rgb, _ = RenderedCamera(scene, view).take()
        scene.clear()
        brightness.append(rgb.mean())
    assert min(brightness) > 60
    assert max(brightness) < 250
    assert np.ptp(brightness) > 50


def test_objects_are_listed_with_pictures(render_system, tmp_path, capsys):
    command = ["objects", "--category", "stapler", "--count", "2", "--pictures", str(tmp_path)]
    assert cli.main(command) == 0
    printed = capsys.readouterr().out
    for name in ("stapler_0000.png", "stapler_0001.png"):
        assert name in printed
        assert iio.imread(tmp_path / name).std() > 5
