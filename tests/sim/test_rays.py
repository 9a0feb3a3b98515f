"""Rays see what the renderer sees."""

from __future__ import annotations

import numpy as np
import pytest

from artgym.geometry import transforms
from artgym.geometry.camera import look_at
from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.objects import catalog
from artgym.objects.model import Material
from artgym.sim import rays
from artgym.sim.camera import RenderedCamera, View, ViewDistribution
from artgym.sim.scene import TABLE_HALF_SIZE, ManipulationScene
from artgym.sim.setting import add_lights

IDS = ["drawer/0004", "drawer/0007", "laptop/0001", "laptop/0002"]
ABOVE = transforms.transform_from(np.diag([1.0, -1.0, -1.0]), [0.15, 0.1, 0.55])


def hits_of(obj, T_world_object, q, view, T_world_hand, width):
    bodies = [*(rays.link_body(link) for link in obj.links), *rays.hand_bodies()]
    poses = np.concatenate(
        [T_world_object @ obj.link_poses(q), rays.hand_poses(T_world_hand, width)]
    )
    directions = rays.camera_rays(view.intrinsics, view.width, view.height, view.T_world_camera)
    eye = view.T_world_camera[:3, 3]
    hits = rays.cast(bodies, poses, eye, directions)
    points = eye + hits.distance[:, None] * directions
    return hits, points


@pytest.mark.parametrize("object_id", IDS)
def test_depth_is_the_renderer_s(object_id, render_system):
    obj = catalog.load(object_id)
    rng = np.random.default_rng(3)
    T_world_object = transforms.transform_from(
        matrix_from_axis_angle([0, 0, rng.uniform(-0.3, 0.3)]), [0.02, -0.03, 0.0]
    )
    q = [obj.joints[0].position(0.4)]
    view = ViewDistribution().sample(rng, 320, 240)
    scene = ManipulationScene(
        obj, T_world_object, q, T_world_hand=ABOVE, width=0.05,
        render_system=render_system, table_material=Material(color=(0.5, 0.5, 0.5)),
    )  # fmt: skip
    add_lights(scene.sapien_scene, rng)
    rgb, depth = RenderedCamera(scene.sapien_scene, view).take()
    scene.close()
    hits, points = hits_of(obj, T_world_object, q, view, ABOVE, 0.05)
    # The table of the rays has no edge.
    on_table = hits.body == rays.TABLE
    beyond = on_table & (np.abs(points[:, :2]) > TABLE_HALF_SIZE[0]).any(axis=1)
    expected = np.where(beyond | ~np.isfinite(hits.distance), 0.0, hits.distance)
    agree = np.abs(depth.reshape(-1) - expected) <= 1e-3
    assert agree.mean() >= 0.995
    # All of it was in the picture: both parts, the hand and the table.
    assert {0, 1, 2, rays.TABLE} <= set(hits.body.tolist())
    assert rgb.std() > 5


def test_rays_against_a_box_by_hand():
    obj = catalog.load("drawer/0003")
    top = obj.rest_bounds[1, 2]
    view = View(
        T_world_camera=look_at([0.0, 0.0, top + 1.0], [0.0, 0.0, 0.0], up_world=[1.0, 0.0, 0.0]),
        fov_y=0.05,
        width=8,
        height=8,
    )
    directions = rays.camera_rays(view.intrinsics, 8, 8, view.T_world_camera)
    bodies = [rays.link_body(link) for link in obj.links]
    hits = rays.cast(
        bodies, obj.link_poses(obj.rest_positions), view.T_world_camera[:3, 3], directions
    )
    np.testing.assert_array_equal(hits.body, 0)
    np.testing.assert_allclose(hits.distance, 1.0, atol=1e-6)
    np.testing.assert_allclose(bodies[0].normals()[hits.triangle], [[0, 0, 1]] * 64, atol=1e-6)


def test_rays_that_meet_nothing():
    up = np.array([[0.0, 0.0, 1.0], [0.1, 0.0, 1.0]])
    hits = rays.cast([], np.zeros((0, 4, 4)), np.array([0.0, 0.0, 1.0]), up)
    np.testing.assert_array_equal(hits.body, rays.NOTHING)
    assert np.all(np.isinf(hits.distance))
    down = rays.cast([], np.zeros((0, 4, 4)), np.array([0.0, 0.0, 1.0]), -up)
    np.testing.assert_array_equal(down.body, rays.TABLE)
    np.testing.assert_allclose(down.distance, 1.0)


@pytest.mark.parametrize("width", [0.0, 0.03, 0.08])
def test_fingers_stand_at_the_width_of_the_jaws(width):
    hand, left, right = rays.hand_poses(np.eye(4), width)
    assert left[1, 3] - right[1, 3] == pytest.approx(width)
    np.testing.assert_array_equal(hand, np.eye(4))


def test_views_look_at_the_object_from_the_front():
    rng = np.random.default_rng(0)
    for _ in range(50):
        view = ViewDistribution().sample(rng, 320, 240)
        eye = view.T_world_camera[:3, 3]
        assert eye[0] > 0.2
        assert eye[2] > 0.3
        origin_camera = transforms.apply(transforms.invert(view.T_world_camera), np.zeros((1, 3)))
        u, v, w = (view.intrinsics @ origin_camera[0]).tolist()
        assert 0 < u / w < 320
        assert 0 < v / w < 240
