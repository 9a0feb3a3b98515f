"""Rays see what the renderer sees, and clouds are what rays see."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from artgym.errors import InvalidArgumentError
from artgym.geometry import transforms
from artgym.geometry.camera import look_at, project
from artgym.geometry.rotations import frame_from_z
from artgym.objects import catalog
from artgym.objects.model import Material
from artgym.sim import rays
from artgym.sim.camera import FAR, NEAR, RenderedCamera, View, ViewDistribution
from artgym.sim.masks import NOTHING, TABLE
from artgym.sim.scene import TABLE_HALF_SIZE, ManipulationScene
from benchmarks.rays import RaysConfig, Sight, loaded, view_agreement

BOX = rays.RayBody(trimesh.creation.box((0.1, 0.2, 0.3)).triangles)
GRAY = Material(color=(0.5, 0.5, 0.5))


def sight_of(object_id, seed=0, size=(320, 240)):
    return Sight.draw(catalog.load(object_id), size, np.random.default_rng(seed))


def view_from(eye, target=(0.0, 0.0, 0.0), size=(320, 240), fov_y=0.6):
    width, height = size
    return View(T_world_camera=look_at(eye, target), fov_y=fov_y, width=width, height=height)


def poses_about(place, count, rng, spread=0.0):
    """``Ts_world_body`` of any orientation, within ``spread`` metres of a place."""
    turns = [
        frame_from_z(axis / np.linalg.norm(axis), rng.uniform(-3, 3))
        for axis in rng.normal(size=(count, 3))
    ]
    return transforms.transform_from(turns, place + rng.uniform(-spread, spread, (count, 3)))


class TestAgainstTheRenderer:
    @pytest.mark.parametrize("object_id", RaysConfig.object)
    def test_objects_hand_and_table(self, object_id, render_system):
        """Six objects half open before three cameras each, the hand before them."""
        obj = loaded(object_id, as_mesh=object_id in RaysConfig.mesh)
        seen = set()
        for seed in range(3):
            rng = np.random.default_rng([seed, 7])
            found = view_agreement(Sight.draw(obj, (320, 240), rng), rng)
            assert found["depth"] > 0.9995
            assert found["mask"] > 0.9998
            # The renderer cuts off the fraction of a millimetre.
            assert found["depth_bias_mm"] == pytest.approx(0.0, abs=0.05)
            seen |= set(found["seen"])
        assert seen == {0, *range(1, obj.num_parts + 1), 255}

    @pytest.mark.parametrize(
        "eye", [(1.6, 0.5, 0.05), (1.3, 0.9, -0.2), (0.3, 0.2, -1.0), (3.0, -3.0, 1.2)]
    )
    def test_table_has_edges_and_sides(self, eye, render_system):
        obj = catalog.load("laptop/0001")
        q = [joint.position(0.5) for joint in obj.joints]
        scene = ManipulationScene(
            obj, np.eye(4), q, render_system=render_system, table_material=GRAY
        )
        view = view_from(eye, (0.5, 0.0, 0.0))
        camera = RenderedCamera(scene.sapien_scene, view)
        _, depth, body = camera.take_with_bodies(scene.body.links)
        scene.close()
        cast_depth, cast_body = rays.RayCamera(view).take(
            [rays.link_body(link) for link in obj.links], obj.link_poses(q)
        )
        assert np.mean(np.abs(cast_depth - depth) <= 1e-3) > 0.9995
        assert np.mean(cast_body == body) > 0.9998
        assert {NOTHING, TABLE} <= set(body.ravel().tolist())
        # The object does not show through the table.
        assert (0 in body) == (eye[2] > 0)

    def test_pixel_centres(self, render_system):
        """A wall at a slant: half a pixel would be 9 mm at this distance, 2 mm of depth."""
        scene = ManipulationScene(
            catalog.load("drawer/0004"), np.eye(4), [0.0],
            render_system=render_system, table_material=GRAY,
        )  # fmt: skip
        view = view_from((0.0, 0.0, 1.5), (0.1, 0.3, 0.0), (40, 30))
        _, depth = RenderedCamera(scene.sapien_scene, view).take()
        scene.close()
        directions = rays.camera_rays(view.intrinsics, 40, 30, view.T_world_camera)
        plane = -1.5 / directions[:, 2]
        points = view.T_world_camera[:3, 3] + plane[:, None] * directions
        on_table = (np.abs(depth.ravel() - plane) < 0.02) & (np.abs(points[:, :2]) < 0.7).all(1)
        assert on_table.sum() > 300
        error = (plane - depth.ravel())[on_table]
        # Pictures come in whole millimetres.
        assert np.abs(error).max() < 0.5e-3 + 1e-5
        assert abs(error.mean()) < 2e-4


class TestRayCamera:
    @pytest.mark.parametrize("size", [(160, 120), (37, 23)])
    def test_bodies_anywhere_about_the_camera(self, size):
        """Beside, behind and across the edges of the picture: as all rays would have it."""
        rng = np.random.default_rng(0)
        for _ in range(15):
            eye = rng.uniform([-0.5, -0.5, 4.5], [0.5, 0.5, 5.5])
            view = view_from(eye, eye + rng.normal(size=3), size, fov_y=rng.uniform(0.3, 1.5))
            bodies = [BOX] * 12
            poses = poses_about(eye, 12, rng, spread=0.8)
            # Not the camera inside a body: there rays begin at the plane of what is nearest.
            away = np.linalg.norm(poses[:, :3, 3] - eye, axis=1) > 0.3
            bodies, poses = bodies[: away.sum()], poses[away]
            depth, body = rays.RayCamera(view).take(bodies, poses)
            directions = rays.camera_rays(view.intrinsics, *size, view.T_world_camera)
            hits = rays.cast(bodies, poses, eye, directions, table=False)
            met = hits.body.reshape(body.shape)
            bodies_only = np.where(body == TABLE, NOTHING, body)
            assert np.mean(bodies_only == met) > 0.9995
            both = (bodies_only == met) & (met >= 0)
            np.testing.assert_allclose(
                depth[both], hits.distance.reshape(depth.shape)[both], atol=1e-5
            )
            assert depth.dtype == np.float32
            assert body.dtype == np.int32

    def test_range(self):
        """Nearer than NEAR things are seen through, beyond FAR they are not seen."""
        view = view_from((2.0, 0.0, 5.0), (0.0, 0.0, 5.0), (16, 12))
        plate = rays.RayBody(trimesh.creation.box((0.001, 9.0, 9.0)).triangles)
        for distance, seen in (
            (NEAR - 0.01, -1),
            (NEAR + 0.01, 0),
            (FAR - 0.1, 0),
            (FAR + 0.1, -1),
        ):
            pose = transforms.translation([2.0 - distance, 0.0, 5.0])[None]
            depth, body = rays.RayCamera(view).take([plate], pose)
            np.testing.assert_array_equal(body, seen)
            np.testing.assert_allclose(depth, distance if seen == 0 else 0.0, atol=1e-3)
            _, of_points = rays.PointCloudCamera(view, 5).cloud(
                [plate], pose, np.random.default_rng()
            )
            np.testing.assert_array_equal(of_points, seen)

    def test_table_alone(self):
        view = view_from((0.0, 0.1, 2.0), fov_y=0.4)
        depth, body = rays.RayCamera(view).take([], np.zeros((0, 4, 4)))
        assert set(body.ravel().tolist()) == {TABLE}
        assert depth[120, 160] == pytest.approx(np.hypot(0.1, 2.0), abs=2e-3)


class TestPointCloudCamera:
    @pytest.mark.parametrize(
        ("size", "count"),
        [
            ((320, 240), 2048),
            ((640, 480), 2048),
            ((333, 251), 777),
            ((37, 23), 50),
            ((320, 240), 1),
        ],
    )
    @pytest.mark.parametrize("object_id", ["drawer/0002", "eyeglasses/0001"])
    def test_points_are_pixels_of_the_picture(self, object_id, size, count):
        sight = sight_of(object_id, 1, size)
        bodies, poses = sight.bodies()
        camera = rays.PointCloudCamera(sight.view, count)
        points, body = camera.cloud(bodies, poses, np.random.default_rng(0))
        assert points.shape == (count, 3)
        assert points.dtype == np.float32
        assert body.shape == (count,)
        assert body.dtype == np.int32
        depth, body_map = sight.cast()
        T_camera_world = transforms.invert(sight.view.T_world_camera)
        points_camera = transforms.apply(T_camera_world, points)
        pixels = project(points_camera, sight.view.intrinsics)
        np.testing.assert_allclose(pixels % 1, 0.5, atol=2e-3)
        column, row = pixels.astype(int).T
        np.testing.assert_array_equal(body, body_map[row, column])
        np.testing.assert_allclose(points_camera[:, 2], depth[row, column], atol=1e-5)
        assert np.all(body >= 0)
        if np.sum(body_map >= 0) >= count:
            assert len(np.unique(row * size[0] + column)) == count

    def test_every_seen_pixel_is_as_likely(self):
        sight = sight_of("drawer/0002")
        bodies, poses = sight.bodies()
        _, body_map = sight.cast()
        pixels = np.bincount(body_map[body_map >= 0], minlength=len(bodies))
        camera, rng = rays.PointCloudCamera(sight.view, 2048), np.random.default_rng(0)
        clouds = [camera.cloud(bodies, poses, rng)[1] for _ in range(20)]
        drawn = np.bincount(np.concatenate(clouds), minlength=len(bodies))
        np.testing.assert_allclose(drawn / drawn.sum(), pixels / pixels.sum(), atol=0.01)

    def test_points_are_spread_evenly(self):
        """A wall that fills the picture: each of 8 x 6 fields gets its share, and no half of it."""
        view = view_from((2.0, 0.0, 5.0), (0.0, 0.0, 5.0))
        plate = rays.RayBody(trimesh.creation.box((0.001, 9.0, 9.0)).triangles)
        pose = transforms.translation([0.0, 0.0, 5.0])[None]
        camera = rays.PointCloudCamera(view, 2048)
        points, _ = camera.cloud([plate], pose, np.random.default_rng(0))
        pixels = project(
            transforms.apply(transforms.invert(view.T_world_camera), points), view.intrinsics
        )
        fields, _, _ = np.histogram2d(*pixels.T, bins=(8, 6), range=((0, 320), (0, 240)))
        # Independent draws would scatter by 6.5 about 42.7.
        assert fields.std() < 6.5
        assert np.abs(fields - 2048 / 48).max() < 15

    def test_few_pixels_come_equally_often(self):
        view = view_from((3.0, 0.0, 5.0), (0.0, 0.0, 5.0))
        pose = transforms.translation([0.0, 0.0, 5.0])[None]
        points, body = rays.PointCloudCamera(view, 2048).cloud(
            [BOX], pose, np.random.default_rng(0)
        )
        np.testing.assert_array_equal(body, 0)
        distinct, times = np.unique(points, axis=0, return_counts=True)
        _, body_map = rays.RayCamera(view).take([BOX], pose)
        assert len(distinct) == np.sum(body_map == 0) < 2048
        assert np.ptp(times) == 1

    def test_generator_decides(self):
        sight = sight_of("laptop/0001")
        bodies, poses = sight.bodies()

        def cloud(camera, seed):
            return camera.cloud(bodies, poses, np.random.default_rng(seed))

        camera = rays.PointCloudCamera(sight.view, 256)
        first, second = cloud(camera, 0), cloud(camera, 1)
        assert not np.array_equal(first[0], second[0])
        for again in (cloud(camera, 0), cloud(rays.PointCloudCamera(sight.view, 256), 0)):
            np.testing.assert_array_equal(again[0], first[0])
            np.testing.assert_array_equal(again[1], first[1])
        # What was given earlier is the caller's.
        assert not np.shares_memory(first[0], second[0])

    def test_nothing_seen(self):
        view = view_from((2.0, 0.0, 5.0), (0.0, 0.0, 5.0))
        behind = transforms.translation([4.0, 0.0, 5.0])[None]
        for bodies, poses in (([BOX], behind), ([], np.zeros((0, 4, 4)))):
            camera = rays.PointCloudCamera(view, 8)
            points, body = camera.cloud(bodies, poses, np.random.default_rng(0))
            np.testing.assert_array_equal(points, np.tile(np.float32([2, 0, 5]), (8, 1)))
            np.testing.assert_array_equal(body, NOTHING)

    def test_table_hides_what_is_below_it(self):
        edge = TABLE_HALF_SIZE[0]
        under = transforms.translation([[0.3, 0.0, -0.3], [edge + 0.2, 0.0, -0.3]])
        above, below = (
            view_from((1.5, 0.0, 1.0), (0.8, 0, -0.2)),
            view_from((0.5, 0, -2.0), (0.6, 0, 0)),
        )
        over = transforms.translation([[0.6, 0.0, 0.3]])
        for view, poses, seen in ((above, under, {1}), (below, under, {0, 1}), (below, over, {-1})):
            camera = rays.PointCloudCamera(view, 512)
            _, body = camera.cloud([BOX] * len(poses), poses, np.random.default_rng(0))
            assert set(body.tolist()) == seen

    def test_refusal(self):
        with pytest.raises(InvalidArgumentError, match="num_points=0"):
            rays.PointCloudCamera(view_from((1, 0, 1)), 0)


class TestCast:
    def test_rays_against_a_box_by_hand(self):
        obj = catalog.load("drawer/0003")
        top = obj.rest_bounds[1, 2]
        T_world_camera = look_at([0.0, 0.0, top + 1.0], [0.0, 0.0, 0.0], up_world=[1.0, 0.0, 0.0])
        view = View(T_world_camera=T_world_camera, fov_y=0.05, width=8, height=8)
        directions = rays.camera_rays(view.intrinsics, 8, 8, view.T_world_camera)
        bodies = [rays.link_body(link) for link in obj.links]
        hits = rays.cast(
            bodies, obj.link_poses(obj.rest_positions), view.T_world_camera[:3, 3], directions
        )
        np.testing.assert_array_equal(hits.body, 0)
        np.testing.assert_allclose(hits.distance, 1.0, atol=1e-6)
        np.testing.assert_allclose(bodies[0].normals()[hits.triangle], [[0, 0, 1]] * 64, atol=1e-6)

    def test_rays_that_meet_nothing(self):
        up = np.array([[0.0, 0.0, 1.0], [0.1, 0.0, 1.0]])
        hits = rays.cast([], np.zeros((0, 4, 4)), np.array([0.0, 0.0, 1.0]), up)
        np.testing.assert_array_equal(hits.body, NOTHING)
        assert np.all(np.isinf(hits.distance))
        down = rays.cast([], np.zeros((0, 4, 4)), np.array([0.0, 0.0, 1.0]), -up)
        np.testing.assert_array_equal(down.body, TABLE)
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
