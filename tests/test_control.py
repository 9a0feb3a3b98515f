"""The executor, driven by a hand that goes exactly where it is told."""

from __future__ import annotations

import numpy as np
import pytest

from artgym.control import (
    MAX_ROTATION,
    MAX_TRANSLATION,
    MAX_WIDTH,
    ExecutorConfig,
    GraspExecutor,
    GraspPlan,
    action_towards,
    pose_gap,
)
from artgym.geometry.rotations import frame_from_z, matrix_from_axis_angle
from artgym.geometry.screw import joint_motion
from artgym.geometry.transforms import transform_from

START = transform_from(np.diag([1.0, -1.0, -1.0]), [0.1, 0.0, 0.65])
GRASP = transform_from(frame_from_z([-1.0, 0.0, 0.0], 0.3), [0.2, 0.05, 0.2])


def plan(joint_type="prismatic", displacement=0.2, hold_from=np.inf):
    axis = [1.0, 0.0, 0.0] if joint_type == "prismatic" else [0.0, -1.0, 0.0]
    return GraspPlan(
        T_world_tcp=GRASP,
        joint_type=joint_type,
        axis_world=np.array(axis),
        pivot_world=np.array([-0.1, 0.0, 0.02]),
        displacement=displacement,
        hold_from=hold_from,
    )


def moved(T_world_tcp, action):
    """The pose after one control step of a hand without mass."""
    T = T_world_tcp.copy()
    T[:3, 3] += MAX_TRANSLATION * action[:3]
    T[:3, :3] = matrix_from_axis_angle(MAX_ROTATION * action[3:6].astype(float)) @ T[:3, :3]
    return T


def run(executor, *, held_width, steps=300, limit=None):
    """Poses and phases until the executor is idle; jaws close down to ``held_width``."""
    T, width, poses, phases = START, MAX_WIDTH, [], []
    for _ in range(steps):
        action = executor.action(T, width)
        poses.append(T)
        phases.append(executor.phase)
        if executor.phase == "idle":
            break
        T_next = moved(T, action)
        if limit is None or executor.phase != "move" or T_next[0, 3] < limit:
            T = T_next
        width = max(held_width, width - 0.02) if action[6] < 0 else MAX_WIDTH
    return np.stack(poses), phases


@pytest.mark.parametrize("joint_type", ["prismatic", "revolute"])
def test_follows_the_joint_to_its_end(joint_type):
    executor = GraspExecutor()
    executor.begin(plan(joint_type))
    poses, phases = run(executor, held_width=0.01)
    order = list(dict.fromkeys(phases))
    assert order == [
        "hover", "standoff", "approach", "close", "move", "release", "retreat", "idle"
    ]  # fmt: skip
    last = poses[len(phases) - 1 - phases[::-1].index("move")]
    p = plan(joint_type)
    goal = joint_motion(joint_type, p.axis_world, p.pivot_world, p.displacement) @ GRASP
    gap, turn = pose_gap(goal, last)
    assert gap < 0.01
    assert turn < 0.05


def test_empty_jaws_let_go_and_go_home():
    executor = GraspExecutor(ExecutorConfig(goes_home=True))
    executor.begin(plan())
    poses, phases = run(executor, held_width=0.0)
    assert "move" not in phases
    assert phases[-2:] == ["home", "idle"]
    assert pose_gap(START, poses[-1])[0] < 0.04


def test_jaws_that_slip_off_let_go():
    executor = GraspExecutor()
    executor.begin(plan())
    T = START
    while executor.phase != "move":
        T = moved(T, executor.action(T, 0.02))
    executor.action(T, 0.0)
    assert executor.phase == "release"


def test_end_of_the_range_ends_the_motion():
    executor = GraspExecutor()
    executor.begin(plan(displacement=0.5))
    poses, phases = run(executor, held_width=0.01, limit=0.3)
    assert phases[-1] == "idle"
    assert poses[:, 0, 3].max() < 0.4


def test_holds_on_where_the_plan_says_so():
    executor = GraspExecutor()
    executor.begin(plan(displacement=0.5, hold_from=0.05))
    poses, phases = run(executor, held_width=0.01, limit=0.3)
    assert executor.moved > 0.05
    assert phases[-1] == "hold"
    np.testing.assert_allclose(executor.action(poses[-1], 0.01), [0, 0, 0, 0, 0, 0, -1])

    executor.begin(plan(displacement=0.5, hold_from=0.4))
    assert executor.moved == 0.0
    _, phases = run(executor, held_width=0.01, limit=0.3)
    assert executor.moved < 0.4
    assert phases[-1] == "idle"


def test_idle_executor_does_nothing():
    np.testing.assert_array_equal(GraspExecutor().action(START, 0.04), np.zeros(7))


def test_action_keeps_its_direction_within_bounds():
    rng = np.random.default_rng(0)
    for _ in range(50):
        turn = matrix_from_axis_angle(rng.normal(size=3))
        goal = transform_from(turn, rng.normal(size=3))
        action = action_towards(goal, START, MAX_WIDTH)
        assert np.abs(action).max() <= 1.0
        assert action[6] == 1.0
        move = goal[:3, 3] - START[:3, 3]
        assert action[:3] @ move > 0.999 * np.linalg.norm(action[:3]) * np.linalg.norm(move)


def test_near_goal_is_reached_in_one_step():
    goal = moved(START, np.array([0.5, -0.3, 0.2, 0.1, 0.4, -0.2, 0.0]))
    gap, turn = pose_gap(goal, moved(START, action_towards(goal, START, 0.0)))
    assert gap < 1e-7
    assert turn < 1e-6
