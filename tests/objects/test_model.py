"""Geometry, mass and motion of articulated objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from artgym.errors import InvalidArgumentError, UnknownNameError
from artgym.geometry import transforms
from artgym.objects import catalog
from artgym.objects.meshes import link_triangles, primitive_mesh
from artgym.objects.model import (
    ArticulatedObject,
    Box,
    Cylinder,
    Joint,
    Link,
    Material,
    Shape,
    canonical_box,
)
from artgym.objects.surface import grid_points

IDS = [i for c in catalog.CATEGORIES for i in catalog.all_ids(c, 10)]
every_object = pytest.mark.parametrize("object_id", IDS)
GREY = Material(color=(0.5, 0.5, 0.5))


def box_link(name: str) -> Link:
    shape = Shape(geometry=Box(half_size=(0.1, 0.2, 0.3)), position=(0, 0, 0), material=GREY)
    return Link(name=name, shapes=(shape,), density=500.0)


def chain() -> ArticulatedObject:
    """A slide on a base and a hinge on the slide."""
    slide = Joint(
        name="slide", type="prismatic", parent="base", child="tray", axis=(1.0, 0.0, 0.0),
        pivot=(0.0, 0.0, 0.0), closed=0.1, open=0.4, friction=1.0, damping=1.0,
    )  # fmt: skip
    hinge = replace(
        slide, name="hinge", type="revolute", parent="tray", child="flap", axis=(0.0, 1.0, 0.0),
        pivot=(0.0, 0.0, 0.3), closed=0.5, open=-0.5,
    )  # fmt: skip
    links = tuple(box_link(name) for name in ("base", "tray", "flap"))
    return ArticulatedObject(object_id="toy/0", category="toy", links=links, joints=(slide, hinge))


@every_object
def test_mass_and_inertia_are_a_real_body_s(object_id):
    for link in catalog.load(object_id).links:
        moments = np.linalg.eigvalsh(link.inertia)
        assert 0.002 < link.mass < 300.0
        assert moments[0] > 0
        assert moments[2] < moments[0] + moments[1]
        np.testing.assert_allclose(link.inertia, link.inertia.T, rtol=1e-12, atol=1e-12)
        low, high = link.bounds()
        assert np.all((low <= link.center_of_mass) & (link.center_of_mass <= high))


@pytest.mark.parametrize(
    "geometry", [Box(half_size=(0.1, 0.2, 0.05)), Cylinder(radius=0.03, half_length=0.2)]
)
def test_volume_and_inertia_against_the_mesh(geometry):
    mesh = primitive_mesh(geometry)
    assert mesh.is_watertight
    # 32 flat sides fill 99.4 % of a cylinder.
    assert mesh.volume == pytest.approx(geometry.volume, rel=0.01)
    np.testing.assert_allclose(
        mesh.moment_inertia / mesh.volume, geometry.unit_inertia, rtol=0.015, atol=1e-9
    )
    bounds = np.stack([geometry.corners().min(axis=0), geometry.corners().max(axis=0)])
    np.testing.assert_allclose(mesh.bounds, bounds, atol=1e-12)


def test_inertia_of_a_split_box_is_the_whole_one_s():
    whole = box_link("whole")
    halves = tuple(
        Shape(geometry=Box(half_size=(0.05, 0.2, 0.3)), position=(x, 0, 0), material=GREY)
        for x in (-0.05, 0.05)
    )
    split = replace(whole, shapes=halves)
    assert split.mass == pytest.approx(whole.mass)
    np.testing.assert_allclose(split.inertia, whole.inertia, atol=1e-9)
    np.testing.assert_allclose(split.center_of_mass, 0.0, atol=1e-12)


@every_object
def test_link_poses_are_the_joints_motion(object_id):
    obj = catalog.load(object_id)
    np.testing.assert_allclose(
        obj.link_poses(obj.rest_positions), np.tile(np.eye(4), (obj.num_parts, 1, 1)), atol=1e-12
    )
    for fraction in (0.0, 0.3, 1.0):
        q = np.array([j.position(fraction) for j in obj.joints])
        by_name = {j.name: value for j, value in zip(obj.joints, q, strict=True)}
        np.testing.assert_array_equal(obj.link_poses(q), obj.link_poses(by_name))
        for part, joint in enumerate(obj.joints, start=1):
            np.testing.assert_allclose(obj.link_poses(q)[part], joint.motion(q[part - 1]))
            assert joint.open_fraction(q[part - 1]) == pytest.approx(fraction)


def test_poses_of_a_chain():
    obj = chain()
    poses = obj.link_poses([0.3, 0.5])
    np.testing.assert_allclose(poses[1], transforms.translation([0.2, 0, 0]), atol=1e-12)
    np.testing.assert_allclose(poses[2], poses[1], atol=1e-12)
    q = [0.4, 0.5 - np.pi / 2]
    tip = obj.link_poses(q)[2] @ [0.0, 0.0, 0.0, 1.0]
    # A quarter turn about -y lays what hangs 0.3 m below the hinge along +x.
    np.testing.assert_allclose(tip, [0.3 + 0.3, 0, 0.3, 1], atol=1e-12)


@every_object
def test_grip_point_lies_on_the_part_and_moves_plainly(object_id):
    obj = catalog.load(object_id)
    for part in range(1, obj.num_parts):
        point, bounds = obj.grip_point(part), obj.links[part].bounds()
        assert np.all((bounds[0] - 1e-9 <= point) & (point <= bounds[1] + 1e-9))
        joint = obj.joint_of(part)
        opened = joint.motion(joint.open) @ np.append(point, 1.0)
        moved = np.linalg.norm(opened[:3] - point)
        surface = grid_points(obj.links[part], 0.02)
        motion = np.linalg.norm(
            transforms.apply(joint.motion(joint.open), surface) - surface, axis=1
        )
        assert moved > 0.35 * motion.max()


@every_object
def test_it_stands_on_the_table(object_id):
    obj = catalog.load(object_id)
    low, high = obj.rest_bounds
    assert low[2] == pytest.approx(0.0, abs=1e-9)
    assert np.all(np.abs((low + high)[:2]) < 0.2)


@every_object
def test_bounds_hold_the_triangles(object_id):
    for link in catalog.load(object_id).links:
        triangles, shape_index = link_triangles(link)
        low, high = link.bounds()
        corners = triangles.reshape(-1, 3)
        assert np.all((corners >= low - 1e-9) & (corners <= high + 1e-9))
        assert set(shape_index) == set(range(len(link.shapes)))


def test_canonical_box():
    center, scale = canonical_box(np.array([[0.0, 0, 0], [3.0, 4.0, 0.0]]))
    np.testing.assert_array_equal(center, [1.5, 2, 0])
    assert scale == 5.0


def test_hash_follows_every_field():
    obj = chain()
    changed = [
        replace(obj, attributes={"handle": "bar"}),
        replace(obj, joints=(replace(obj.joints[0], damping=1.1), obj.joints[1])),
        replace(obj, links=(*obj.links[:2], replace(obj.links[2], friction=0.7))),
    ]
    hashes = {o.content_hash() for o in (obj, *changed)}
    assert len(hashes) == 4
    assert chain().content_hash() == obj.content_hash()


def test_inconsistent_descriptions_are_refused():
    obj = chain()
    with pytest.raises(InvalidArgumentError, match="repeat"):
        replace(obj, links=(obj.links[0], obj.links[1], obj.links[1]))
    with pytest.raises(InvalidArgumentError, match="order of their child links"):
        replace(obj, joints=obj.joints[::-1])
    loop = replace(obj.joints[0], parent="flap")
    with pytest.raises(InvalidArgumentError, match="not a link listed before"):
        replace(obj, joints=(loop, obj.joints[1]))
    for part in (0, 3, -1):
        with pytest.raises(UnknownNameError, match="movable part"):
            obj.joint_of(part)


def test_grid_points_cover_the_surface():
    link = chain().links[0]
    points = grid_points(link, 0.02)
    on_surface = np.isclose(np.abs(points), [0.1, 0.2, 0.3], atol=1e-6).any(axis=1)
    assert on_surface.all()
    rng = np.random.default_rng(0)
    face = rng.uniform(-1, 1, (200, 3)) * [0.1, 0.2, 0.3]
    face[:, 0] = 0.1
    gaps = np.linalg.norm(face[:, None] - points[None], axis=-1).min(axis=1)
    assert gaps.max() <= 0.02
