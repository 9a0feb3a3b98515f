"""The Panda's joints bring its hand where its description says, and a base lets it follow."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from artgym.errors import InvalidArgumentError
from artgym.geometry import transforms
from artgym.geometry.rotations import geodesic_angle, matrix_from_axis_angle
from artgym.sim import kinematics
from artgym.sim.kinematics import (
    BASE_CLEARANCE,
    LIMIT_MARGIN,
    REST,
    choose_base,
    link_poses,
    panda_chain,
    reachable,
    solve,
)

DOWN = np.diag([1.0, -1.0, -1.0])
#: Columns (x, closing direction, approach): towards -x, closing upright or across.
TOWARDS_OBJECT = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
CLOSING_UP = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def random_positions(count, seed=0):
    chain = panda_chain()
    low, high = chain.lower + LIMIT_MARGIN, chain.upper - LIMIT_MARGIN
    return np.random.default_rng(seed).uniform(low, high, (count, 7))


def hand_poses(positions):
    return np.stack([link_poses(q)[-1] for q in positions])


def forward(q):
    """Joint axes and origins, and the hand's rotation and position, as the search has them."""
    out = np.empty((7, 3)), np.empty((7, 3)), np.empty((3, 3)), np.empty(3)
    kinematics._forward(panda_chain().frames, q, *out)
    return out


def gap(T_a, T_b):
    return np.linalg.norm(T_a[:3, 3] - T_b[:3, 3]), geodesic_angle(T_a[:3, :3], T_b[:3, :3])


def assert_inside_ranges(q):
    chain = panda_chain()
    assert (q >= chain.lower + LIMIT_MARGIN - 1e-9).all()
    assert (q <= chain.upper - LIMIT_MARGIN + 1e-9).all()


def door_handle(radius=0.7, height=1.0, opening_deg=50.0):
    """Hand poses at a door's handle: before it, at it, and along its arc."""
    hinge = np.array([-0.2, 0.5 * radius, height])
    poses = []
    for angle in np.radians(np.linspace(0.0, opening_deg, 9)):
        R_turn = matrix_from_axis_angle([0.0, 0.0, angle])
        handle = hinge + R_turn @ [0.0, -radius, 0.0]
        T_world_handle = transforms.transform_from(R_turn @ TOWARDS_OBJECT, handle)
        poses.append(T_world_handle @ transforms.translation([0.0, 0.0, -0.11]))
    return np.stack([poses[0] @ transforms.translation([0.0, 0.0, -0.08]), *poses])


def low_drawer(height=0.12, travel=0.25):
    """Hand poses at a drawer's handle: before it, at it, and pulled."""
    distances = [0.08, 0.0, *np.linspace(0.0, travel, 6)]
    return transforms.transform_from(CLOSING_UP, [[0.25 + d, 0.0, height] for d in distances])


def test_rest_posture_is_the_usual_one():
    T_base_hand = link_poses(REST)[-1]
    np.testing.assert_allclose(T_base_hand[:3, 3], [0.615, 0.0, 0.273], atol=1e-3)
    np.testing.assert_allclose(T_base_hand[:3, :3], DOWN, atol=1e-9)


def test_compiled_chain_is_the_description_s():
    for q in random_positions(50):
        axes, origins, R, t = forward(q)
        Ts_base_link = link_poses(q)
        np.testing.assert_allclose(axes, Ts_base_link[1:-1, :3, 2], atol=1e-12)
        np.testing.assert_allclose(origins, Ts_base_link[1:-1, :3, 3], atol=1e-12)
        np.testing.assert_allclose(R, Ts_base_link[-1, :3, :3], atol=1e-12)
        np.testing.assert_allclose(t, Ts_base_link[-1, :3, 3], atol=1e-12)


def test_jacobian_is_the_derivative():
    J = np.empty((6, 7))
    for q in random_positions(5):
        axes, origins, R, t = forward(q)
        kinematics._jacobian(axes, origins, t, 1.0, J)
        for k, step in enumerate(1e-6 * np.eye(7)):
            error = np.empty(6)
            kinematics._miss(link_poses(q + step)[-1], R, t, error)
            np.testing.assert_allclose(error / 1e-6, J[:, k], atol=1e-4)


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-3, 1.0, 3.0, np.pi - 1e-9, np.pi])
def test_miss_is_the_rotation_vector(angle):
    rng = np.random.default_rng(1)
    for axis in (*np.eye(3), *rng.normal(size=(5, 3))):
        axis = axis / np.linalg.norm(axis)
        R = matrix_from_axis_angle(rng.normal(size=3))
        R_goal = matrix_from_axis_angle(angle * axis) @ R
        error = np.empty(6)
        _, found = kinematics._miss(
            transforms.transform_from(R_goal, np.zeros(3)), R, np.zeros(3), error
        )
        assert found == pytest.approx(angle, abs=1e-6)
        assert geodesic_angle(matrix_from_axis_angle(error[3:]) @ R, R_goal) < 1e-6


def test_reaches_what_can_be_reached():
    poses = hand_poses(random_positions(300, seed=2))
    for T_base_hand in poses:
        solution = solve(T_base_hand)
        assert solution.reached
        assert_inside_ranges(solution.q)
        position_error, rotation_error = gap(link_poses(solution.q)[-1], T_base_hand)
        assert position_error < 0.005
        assert rotation_error < 0.05
    assert reachable(poses).all()


def test_out_of_reach_it_comes_near():
    far = transforms.transform_from(DOWN, [2.0, 0.0, 0.4])
    assert not reachable(far[None]).any()
    for solution in (solve(far), solve(far, REST)):
        assert not solution.reached
        assert_inside_ranges(solution.q)
        assert link_poses(solution.q)[-1][0, 3] > 0.6
        again = solve(far, solution.q)
        assert again.position_error <= solution.position_error + 1e-3


def test_equal_arguments_give_equal_results():
    for T_base_hand in hand_poses(random_positions(20, seed=3)):
        np.testing.assert_array_equal(solve(T_base_hand).q, solve(T_base_hand).q)
        np.testing.assert_array_equal(solve(T_base_hand, REST).q, solve(T_base_hand, REST).q)
    start = REST.copy()
    solve(hand_poses(random_positions(1))[0], start)
    np.testing.assert_array_equal(start, REST)


def test_arm_stays_above_the_floor():
    low = transforms.transform_from(CLOSING_UP, [-0.45, 0.0, 0.15])
    for floor in (0.0, -0.3):
        assert solve(low, floor=floor).reached
        elbow = link_poses(solve(low, floor=floor).q)[4]
        assert elbow[2, 3] > floor


@pytest.mark.parametrize(
    ("call", "name"),
    [
        (lambda: solve(np.eye(3)), "T_base_hand"),
        (lambda: solve(np.full((4, 4), np.nan)), "T_base_hand"),
        (lambda: solve(np.eye(4), np.zeros(6)), "start"),
        (lambda: reachable(np.eye(4)), "Ts_base_hand"),
        (lambda: choose_base(np.zeros((0, 4, 4))), "Ts_world_hand"),
        (lambda: choose_base(np.eye(4)[None], object_bounds=np.zeros(6)), "object_bounds"),
    ],
)
def test_refuses_what_is_no_pose(call, name):
    with pytest.raises(InvalidArgumentError, match=name):
        call()


HOME = transforms.transform_from(DOWN, [0.4, 0.1, 0.8])


@pytest.mark.parametrize(
    ("poses", "bounds"),
    [
        (door_handle(), [[-0.6, -0.4, 0.0], [-0.2, 0.4, 1.6]]),
        (np.stack([HOME, *door_handle()]), [[-0.6, -0.4, 0.0], [-0.2, 0.4, 1.6]]),
        (door_handle(radius=0.4, height=0.3), [[-0.6, -0.3, 0.0], [-0.2, 0.3, 0.5]]),
        (low_drawer(), [[-0.2, -0.2, 0.0], [0.2, 0.2, 0.3]]),
        (np.stack([HOME, *low_drawer()]), [[-0.2, -0.2, 0.0], [0.2, 0.2, 0.3]]),
        (transforms.transform_from(DOWN, [[0.1, 0.2, 0.4], [0.1, 0.2, 0.2]]), None),
    ],
    ids=["door", "home_door", "low_door", "drawer", "home_drawer", "downwards"],
)
def test_base_lets_the_hand_follow(poses, bounds):
    T_world_base = choose_base(poses, object_bounds=bounds)
    np.testing.assert_array_equal(choose_base(poses, object_bounds=bounds), T_world_base)
    np.testing.assert_allclose(T_world_base[:3, 2], [0.0, 0.0, 1.0], atol=1e-12)
    height = T_world_base[2, 3]
    assert 0.0 <= height <= 1.2
    if poses[:, 2, 3].max() < 0.9:
        assert height == 0.0
    if bounds is not None:
        outside = np.maximum(bounds[0] - T_world_base[:3, 3], T_world_base[:3, 3] - bounds[1])
        assert np.linalg.norm(np.maximum(outside[:2], 0.0)) >= BASE_CLEARANCE - 1e-9
    Ts_base_hand = transforms.invert(T_world_base) @ poses
    assert reachable(Ts_base_hand).all()
    q = solve(Ts_base_hand[0], floor=-height).q
    for T_from, T_to in itertools.pairwise(Ts_base_hand):
        for share in (0.25, 0.5, 0.75, 1.0):
            turn = kinematics.axis_angle_from_matrix(T_to[:3, :3] @ T_from[:3, :3].T)
            between = transforms.transform_from(
                matrix_from_axis_angle(share * turn) @ T_from[:3, :3],
                (1.0 - share) * T_from[:3, 3] + share * T_to[:3, 3],
            )
            solution = solve(between, q)
            assert solution.reached
            assert np.abs(solution.q - q).max() < 1.0
            q = solution.q


def test_no_base_for_what_is_too_wide():
    with pytest.raises(InvalidArgumentError, match=r"no place of the base .* all 10 poses"):
        choose_base(door_handle(radius=1.5, opening_deg=120.0))
