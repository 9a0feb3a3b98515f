"""One attempt at a grasp, and the filter that spares most of them."""

from __future__ import annotations

import contextlib

import numpy as np
import pytest

from artgym.annotation.annotate import visible_points
from artgym.annotation.filter import Verdict, judge
from artgym.annotation.trial import REFERENCE, TrialConfig, try_grasp
from artgym.errors import InvalidArgumentError
from artgym.geometry import transforms
from artgym.geometry.grasps import candidate_rotations
from artgym.geometry.rotations import JAW_SYMMETRY
from artgym.objects import catalog
from artgym.sim.scene import ManipulationScene
from tests.sim.poses import CLOSING_UP, bar_bounds, drawer_with_lying_bar, grasp_from_tcp


@pytest.fixture(scope="module")
def drawer():
    return drawer_with_lying_bar()


def handle_grasp(obj, q):
    return grasp_from_tcp(CLOSING_UP, bar_bounds(obj).mean(axis=0) + q[0] * np.eye(3)[0])


def verdict(obj, q, T_object_grasp):
    point, R = T_object_grasp[:3, 3], T_object_grasp[:3, :3]
    return judge(obj, np.asarray(q), 1, point[None], R[None, None])[0, 0]


def test_a_good_grasp_of_a_handle(drawer):
    q = [drawer.joints[0].position(0.02)]
    T_object_grasp = handle_grasp(drawer, q)
    trial = try_grasp(drawer, q, 1, T_object_grasp)
    assert trial.end == "moved"
    assert trial.success
    assert trial.progress.travel >= 0.5
    assert trial.progress.gripped > 0.95
    assert verdict(drawer, q, T_object_grasp) == Verdict.POSSIBLE


def test_half_a_turn_about_the_approach_is_the_same_grasp(drawer):
    q = [drawer.joints[0].position(0.02)]
    T_object_grasp = handle_grasp(drawer, q)
    T_object_grasp[:3, :3] = T_object_grasp[:3, :3] @ JAW_SYMMETRY
    assert try_grasp(drawer, q, 1, T_object_grasp).success


def test_an_open_part_is_closed(drawer):
    q = [drawer.joints[0].position(0.9)]
    trial = try_grasp(drawer, q, 1, handle_grasp(drawer, q))
    assert trial.success
    assert trial.progress.fraction < 0.41


def test_the_same_trial_twice(drawer):
    q = [drawer.joints[0].position(0.02)]
    first, second = (try_grasp(drawer, q, 1, handle_grasp(drawer, q)) for _ in range(2))
    assert first == second


def test_in_the_air_the_jaws_stay_empty(drawer):
    T_object_grasp = grasp_from_tcp(CLOSING_UP, np.array([0.6, 0.0, 0.4]))
    trial = try_grasp(drawer, drawer.rest_positions, 1, T_object_grasp)
    assert (trial.end, trial.success) == ("empty", False)
    assert trial.progress.path == pytest.approx(0.0, abs=1e-6)
    assert verdict(drawer, drawer.rest_positions, T_object_grasp) == Verdict.NOTHING_BETWEEN


def test_inside_the_body_the_hand_is_blocked(drawer):
    top = drawer.links[0].bounds()[1, 2]
    T_object_grasp = grasp_from_tcp(CLOSING_UP, np.array([0.0, 0.0, top - 0.01]))
    trial = try_grasp(drawer, drawer.rest_positions, 1, T_object_grasp)
    assert (trial.end, trial.success) == ("blocked", False)
    assert verdict(drawer, drawer.rest_positions, T_object_grasp) == Verdict.COLLISION


def test_what_rests_is_not_waited_for(drawer):
    q = [drawer.joints[0].position(0.02)]
    steps = []
    for rest in (0.0, TrialConfig().rest):
        config = TrialConfig(rest=rest)
        with counted_steps() as counted:
            assert try_grasp(drawer, q, 1, handle_grasp(drawer, q), config).success
        steps.append(counted[0])
    assert steps[1] < 0.8 * steps[0]


@contextlib.contextmanager
def counted_steps():
    """Counts the simulator's steps."""
    counted, step = [0], ManipulationScene.step

    def count(scene, steps=1):
        counted[0] += steps
        step(scene, steps)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ManipulationScene, "step", count)
        yield counted


def test_below_the_table_the_hand_is_blocked(drawer):
    T_object_grasp = grasp_from_tcp(CLOSING_UP, np.array([0.6, 0.0, 0.0]))
    assert try_grasp(drawer, drawer.rest_positions, 1, T_object_grasp).end == "blocked"
    assert verdict(drawer, drawer.rest_positions, T_object_grasp) == Verdict.COLLISION


@pytest.mark.parametrize("object_id", ["drawer/0004", "laptop/0001"])
def test_the_filter_rejects_nothing_that_works(object_id):
    obj = catalog.load(object_id)
    rng = np.random.default_rng(0)
    category = catalog.category(obj.category)
    q = np.array([obj.joints[0].position(np.mean(category.start_fraction))])
    points, normals = visible_points(obj, q, 1, 60, 4, 0.35, rng)
    R_grasps = candidate_rotations(normals)
    verdicts = judge(obj, q, 1, points, R_grasps)
    assert (verdicts == Verdict.POSSIBLE).any()
    rejected = rng.permutation(np.argwhere(verdicts != Verdict.POSSIBLE))[:200]
    working = [
        (Verdict(verdicts[i, c]).name, int(i), int(c))
        for i, c in rejected
        if try_grasp(obj, q, 1, transforms.transform_from(R_grasps[i, c], points[i])).success
    ]
    assert working == []


@pytest.mark.parametrize("object_id", ["drawer/0005", "laptop/0002"])
def test_visible_points_lie_on_the_part_and_face_a_camera(object_id):
    obj = catalog.load(object_id)
    q = np.array([obj.joints[0].position(0.1)])
    points, normals = visible_points(obj, q, 1, 80, 4, 0.35, np.random.default_rng(0))
    T_part_object = transforms.invert(obj.link_poses(q)[1])
    points_part = transforms.apply(T_part_object, points)
    low, high = obj.links[1].bounds()
    assert np.all((points_part > low - 1e-5) & (points_part < high + 1e-5))
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-6)
    # Cameras stand in front and above.
    assert np.all(normals @ [0.8, 0.0, 0.6] > -0.9)
    again, _ = visible_points(obj, q, 1, 80, 4, 0.35, np.random.default_rng(0))
    np.testing.assert_array_equal(points, again)


def test_looks_come_after_whole_steps():
    assert REFERENCE.look_time == pytest.approx(4 * REFERENCE.physics.timestep)
    for seconds in (0.0, -1.0 / 60.0, 1.0 / 500.0, 1.0 / 70.0):
        with pytest.raises(InvalidArgumentError, match=f"look_time={seconds}"):
            TrialConfig(look_time=seconds)
    with pytest.raises(InvalidArgumentError, match=r"steps of 0\.0 s"):
        TrialConfig(close_timestep=0.0)
