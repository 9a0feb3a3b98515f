"""Acting on what is perceived: look, propose, approach, close, move, look again.

A policy is given observations of ``ArtOpen-v0`` in the mode "rgbd" and nothing else: the picture,
the camera, the hand's own pose and width, and the index of the part to move.

A part that was moved and is found back where it was has fallen, or was pushed by the hand on its
way out: the next time it is held.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from artgym.control import ExecutorConfig, GraspExecutor, GraspPlan
from artgym.datasets.frame import CameraFrame
from artgym.datasets.sample import JOINT_REVOLUTE
from artgym.errors import NothingSeenError
from artgym.geometry import transforms
from artgym.geometry.camera import points_from_depth
from artgym.geometry.grasps import T_GRASP_TCP
from artgym.geometry.rotations import frame_from_z, grasp_angle
from artgym.geometry.screw import joint_motion
from icaf4_policy.inference import Perception
from icaf4_policy.prediction import Prediction
from icaf4_policy.shipped import weights_path

Array = NDArray[np.floating]

#: Half size of a box about the hand and its middle, in the tool centre's frame: pixels inside
#: are the robot's own.
_HAND_HALF_SIZE = np.array([0.06, 0.13, 0.11])
_HAND_MIDDLE = np.array([0.0, 0.0, -0.08])

#: Farther than any part moves: the end of the range ends the motion. Metres, radians.
_FULL_SLIDE, _FULL_TURN = 0.5, 2.6

#: A part that shall have moved by less, metres, may as well have stayed: twice what a hand may lag.
_LEAST_MOVE = 0.06
#: It is held from this share of the way on after which it went back.
_HELD_SHARE = 0.8

#: A proposal this near to one that failed (metres, radians) is passed over.
_SAME_POSITION, _SAME_ANGLE = 0.015, float(np.radians(20.0))


class Icaf4Policy:
    """Grasps the best proposal of the network; on failure looks again and takes the next.

    Args:
        perception: the trained network.
    """

    name = "icaf4"

    def __init__(self, perception: Perception) -> None:
        self._perception = perception
        self.prediction: Prediction | None = None
        self.reset(0)

    @classmethod
    def load(cls, category: str, weights: Path | None = None) -> Icaf4Policy:
        """The policy with the shipped weights of a category, or with others.

        Raises:
            DamagedFileError: the weights are missing or damaged.
        """
        return cls(Perception.load(weights or weights_path(category), category))

    def reset(self, seed: int) -> None:
        """Forgets the last episode."""
        self._rng = np.random.default_rng(seed)
        self._executor = GraspExecutor(ExecutorConfig(goes_home=True))
        self._tried: list[Array] = []
        self._hold_from = np.inf
        #: The last plan, and where the part's middle was when it was made.
        self._last: tuple[GraspPlan, Array] | None = None

    def act(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        """The next action (7,); looks and plans whenever nothing is under way."""
        frame = CameraFrame.from_observation(observation)
        if self._executor.phase == "idle":
            plan = self._plan(frame)
            if plan is None:
                return np.zeros(7, dtype=np.float32)
            self._executor.begin(plan)
        return self._executor.action(frame.T_world_tcp, frame.jaw_width)

    def _plan(self, frame: CameraFrame) -> GraspPlan | None:
        """A plan from one look; None when the part is not seen."""
        try:
            self.prediction, _ = self._perception.perceive(
                frame.rgb,
                frame.depth,
                frame.intrinsics,
                up_camera_hint=frame.T_world_camera[2, :3],
                exclude_mask=hand_mask(frame),
                part=frame.target_part,
                rng=self._rng,
            )
        except NothingSeenError:
            # The hand may hide what there is. Look again next step.
            return None
        joint = self.prediction.joints[frame.target_part]
        grasps_camera = self._proposals(self.prediction, frame)
        if joint.joint_type < 0 or not len(grasps_camera):
            return None
        T_grasps = frame.T_world_camera @ grasps_camera
        T_world_grasp = next((T for T in T_grasps if not self._was_tried(T)), T_grasps[0])
        self._tried.append(T_world_grasp)
        points_camera = self.prediction.points_camera[self.prediction.part == frame.target_part]
        middle = transforms.apply(frame.T_world_camera, np.median(points_camera, axis=0)[None])[0]
        self._learn_from_last(middle)
        revolute = joint.joint_type == JOINT_REVOLUTE
        pivot = transforms.apply(frame.T_world_camera, joint.pivot_camera[None])[0]
        plan = GraspPlan(
            T_world_tcp=T_world_grasp @ T_GRASP_TCP,
            joint_type="revolute" if revolute else "prismatic",
            axis_world=frame.T_world_camera[:3, :3] @ joint.axis_camera,
            pivot_world=pivot,
            displacement=_FULL_TURN if revolute else _FULL_SLIDE,
            hold_from=self._hold_from,
        )
        self._last = plan, middle
        return plan

    def _learn_from_last(self, middle: Array) -> None:
        """Whether the part, whose middle (3,) is now there, went back after the last plan."""
        if self._last is None:
            return
        plan, before = self._last
        came = self._executor.moved
        motion = joint_motion(plan.joint_type, plan.axis_world, plan.pivot_world, came)
        after = transforms.apply(motion, before[None])[0]
        moved = float(np.linalg.norm(after - before))
        if moved > _LEAST_MOVE and np.linalg.norm(middle - before) < 0.5 * moved:
            self._hold_from = min(self._hold_from, _HELD_SHARE * came)

    def _proposals(self, prediction: Prediction, frame: CameraFrame) -> Array:
        """``Ts_camera_grasp`` (J, 4, 4) on the target part, best first."""
        grasps = prediction.grasps.of_part(frame.target_part)
        return transforms.transform_from(grasps.R_camera_grasp, grasps.points_camera)

    def _was_tried(self, T_world_grasp: Array) -> bool:
        return any(
            np.linalg.norm(T[:3, 3] - T_world_grasp[:3, 3]) < _SAME_POSITION
            and grasp_angle(T[:3, :3], T_world_grasp[:3, :3]) < _SAME_ANGLE
            for T in self._tried
        )


class SurfaceNormalPolicy(Icaf4Policy):
    """Grips along the surface normal at a random point of the part, with a random roll.

    The segmentation, the joint and the motion are those of ICAF-4: what differs is the grasp.
    """

    name = "surface_normal"

    def _proposals(self, prediction: Prediction, frame: CameraFrame) -> Array:
        points = prediction.points_camera[prediction.part == frame.target_part]
        if len(points) < 12:
            return np.zeros((0, 4, 4))
        point = points[self._rng.integers(len(points))]
        near = points[np.argsort(((points - point) ** 2).sum(axis=1))[:12]]
        normal = np.linalg.eigh(np.cov(near.T))[1][:, 0]
        inward = normal * np.sign(normal @ point)
        R = frame_from_z(inward, self._rng.uniform(0.0, np.pi))
        return transforms.transform_from(R, point)[None]


def hand_mask(frame: CameraFrame) -> NDArray[np.bool_]:
    """Pixels (H, W) that the robot's own hand may cover, from its pose."""
    points_camera = points_from_depth(frame.depth, frame.intrinsics).reshape(-1, 3)
    T_tcp_camera = transforms.invert(frame.T_world_tcp) @ frame.T_world_camera
    offset = np.abs(transforms.apply(T_tcp_camera, points_camera) - _HAND_MIDDLE)
    return np.all(offset < _HAND_HALF_SIZE, axis=1).reshape(frame.depth.shape)
