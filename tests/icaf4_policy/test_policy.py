"""The policy's memory of an episode, with a hand that goes where it is told."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from artgym.control import MAX_ROTATION, MAX_TRANSLATION
from artgym.datasets.sample import JOINT_PRISMATIC
from artgym.errors import InvalidArgumentError
from artgym.geometry.rotations import frame_from_z, matrix_from_axis_angle
from artgym.geometry.transforms import transform_from
from icaf4_policy.inference import Perception
from icaf4_policy.policy import Icaf4Policy
from icaf4_policy.prediction import Grasps, JointEstimate
from tests.icaf4_policy.toy import toy_network

#: The end of the way of a part that slides along x, metres.
LIMIT = 0.15
HANDLE = np.array([0.2, 0.05, 0.2])


class Seen:
    """In the place of a network: where the part is, known exactly."""

    def __init__(self) -> None:
        self.slid = 0.0

    def perceive(self, rgb, depth, intrinsics, *, part, rng, **hints):
        middle = HANDLE + np.array([self.slid, 0.0, 0.0])
        grasps = Grasps(
            points_camera=middle[None],
            R_camera_grasp=frame_from_z([-1.0, 0.0, 0.0], 0.3)[None],
            scores=np.ones(1),
            parts=np.array([part]),
        )
        joint = JointEstimate(
            joint_type=JOINT_PRISMATIC, axis_camera=np.array([1.0, 0, 0]), pivot_camera=middle
        )
        prediction = SimpleNamespace(
            points_camera=np.tile(middle, (20, 1)),
            part=np.full(20, part),
            joints={part: joint},
            grasps=grasps,
        )
        return prediction, None


def episode(policy, seen, *, springs_back, steps):
    """The phases of an episode; a part that springs back does so as soon as the jaws open."""
    T = transform_from(np.diag([1.0, -1.0, -1.0]), [0.3, 0.0, 0.65])
    phases = []
    for _ in range(steps):
        action = policy.act(
            {
                "rgb": np.zeros((4, 4, 3), np.uint8),
                "depth": np.zeros(16, np.float32),
                "intrinsics": np.eye(3).ravel(),
                "T_world_camera": np.eye(4).ravel(),
                "T_world_tcp": T.ravel(),
                "jaw_width": np.array([0.01]),
                "target_part": 1,
            }
        )
        phase = policy._executor.phase
        phases.append(phase)
        before = T[0, 3]
        T[:3, 3] += MAX_TRANSLATION * action[:3]
        T[:3, :3] = matrix_from_axis_angle(MAX_ROTATION * action[3:6].astype(float)) @ T[:3, :3]
        if phase == "move":
            T[0, 3] = min(T[0, 3], before + LIMIT - seen.slid)
            seen.slid += T[0, 3] - before
        elif phase == "release" and springs_back:
            seen.slid = 0.0
    return phases


@pytest.mark.parametrize("springs_back", [False, True])
def test_a_part_that_went_back_is_held_the_next_time(springs_back):
    seen = Seen()
    policy = Icaf4Policy(seen)
    phases = episode(policy, seen, springs_back=springs_back, steps=400)
    assert phases.index("release") > phases.index("move")
    assert (phases[-1] == "hold") == springs_back
    assert seen.slid == pytest.approx(LIMIT)


def test_a_picture_of_nothing_is_waited_out_and_a_wrong_one_is_not():
    observation = {
        "rgb": np.zeros((40, 40, 3), np.uint8),
        "depth": np.zeros(1600, np.float32),
        "intrinsics": np.array([40.0, 0, 20, 0, 40, 20, 0, 0, 1]),
        "T_world_camera": np.eye(4).ravel(),
        "T_world_tcp": np.eye(4).ravel(),
        "jaw_width": np.array([0.08]),
        "target_part": 1,
    }
    policy = Icaf4Policy(Perception(model=toy_network(), category="toy"))
    np.testing.assert_array_equal(policy.act(observation), np.zeros(7))
    observation["rgb"] = observation["rgb"].astype(np.float32)
    with pytest.raises(InvalidArgumentError, match="uint8"):
        policy.act(observation)


def test_a_new_episode_begins_without_memory():
    seen = Seen()
    policy = Icaf4Policy(seen)
    episode(policy, seen, springs_back=True, steps=400)
    seen.slid = 0.0
    policy.reset(1)
    assert "release" in episode(policy, seen, springs_back=True, steps=200)
