"""What is predicted of one view of an object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from artgym.datasets.sample import JOINT_NONE
from artgym.geometry.rotations import geodesic_angle
from icaf4_policy.metrics import expected_iou
from icaf4_policy.pose_fitting import PoseFit

Array = NDArray[np.floating]

#: Angle between two estimates of the same axes that makes them a third as sure, radians.
_DOUBT = float(np.radians(5.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class JointEstimate:
    """The joint that moves one part.

    Attributes:
        joint_type: code of ``Sample.joint_type``; -1 also where the part was not found.
        axis_camera: (3,), unit, opening direction positive; zeros without a joint.
        pivot_camera: (3,), metres, a point of the axis near the part; for a slide, the part's
            middle; zeros without a joint.
    """

    joint_type: int
    axis_camera: Array
    pivot_camera: Array


#: That of a part that does not move, or was not found.
NO_JOINT = JointEstimate(joint_type=JOINT_NONE, axis_camera=np.zeros(3), pivot_camera=np.zeros(3))


@dataclass(frozen=True, kw_only=True, eq=False)
class Grasps:
    """Proposals, best first. J of them.

    Attributes:
        points_camera: (J, 3), metres, surface points.
        R_camera_grasp: (J, 3, 3), columns (x, y = closing, z = approach).
        scores: (J,), probability that the point can be grasped times that of the anchor, and times
            that of the part where one was asked for.
        parts: int64 (J,), predicted part of the point, or the one that was asked for.
    """

    points_camera: Array
    R_camera_grasp: Array
    scores: Array
    parts: NDArray[np.int64]

    def of_part(self, part: int) -> Grasps:
        """The proposals on one part, still best first."""
        keep = self.parts == part
        return Grasps(
            points_camera=self.points_camera[keep],
            R_camera_grasp=self.R_camera_grasp[keep],
            scores=self.scores[keep],
            parts=self.parts[keep],
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class PointGrasps:
    """Grasps at every point of a cloud. N points, J grasps each, best first.

    Attributes:
        points_camera: (N, 3), metres.
        point_index: int64 (N,), into the points that were given.
        affordance: (N,), probability that the point can be grasped.
        graspable: bool (N,), whether the network calls it so.
        R_camera_grasp: (N, J, 3, 3).
        scores: (N, J), probability of each anchor.
    """

    points_camera: Array
    point_index: NDArray[np.int64]
    affordance: Array
    graspable: NDArray[np.bool_]
    R_camera_grasp: Array
    scores: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Prediction:
    """What the network says about one view. N points, K parts (base = 0).

    Attributes:
        points_camera: (N, 3), metres.
        point_index: int64 (N,), into the points that were given.
        part: int64 (N,), and part_probability: (N, K).
        npcs: (N, 3) and naocs: (N, 3), of the predicted part, 0.5 at the box's centre.
        affordance: (N,), probability that the point can be grasped.
        graspable: bool (N,), whether the network calls it so.
        part_boxes: K fits of the parts' canonical boxes (``None`` where a part was not found): axes
            and centre.
        object_boxes: K fits of the object's rest-state box, each from the points of one part: the
            pose the object would have if the whole moved with that part; that of part 0 is the
            object's pose.
        joints: K joints, ``JOINT_NONE`` for the base.
        grasps: ranked proposals.
        R_level_camera: (3, 3).
    """

    points_camera: Array
    point_index: NDArray[np.int64]
    part: NDArray[np.int64]
    part_probability: Array
    npcs: Array
    naocs: Array
    affordance: Array
    graspable: NDArray[np.bool_]
    part_boxes: tuple[PoseFit | None, ...]
    object_boxes: tuple[PoseFit | None, ...]
    joints: tuple[JointEstimate, ...]
    grasps: Grasps
    R_level_camera: Array

    def part_confidences(self) -> Array:
        """The expected intersection over union (K,) of each part's points; 0 of one without any."""
        called = self.part[:, None] == np.arange(self.part_probability.shape[1])
        return expected_iou(self.part_probability, called)

    def pose_confidences(self) -> Array:
        """How sure the boxes (K,) of each part are, in [0, 1]; 0 of a part that was not found.

        Of both boxes of a part, its own and that of the object as it moves with the part, the axes
        are the same, and their coordinates are predicted apart: it is the expected intersection
        over union of the part's points, times the share of them that agrees with its box, less the
        farther the axes of the two are from each other.
        """
        confidences = np.zeros(len(self.part_boxes))
        for k, boxes in enumerate(zip(self.part_boxes, self.object_boxes, strict=True)):
            own, with_part = boxes
            if own is not None and with_part is not None:
                apart = geodesic_angle(own.T_camera_box[:3, :3], with_part.T_camera_box[:3, :3])
                confidences[k] = own.inlier_share * np.exp(-apart / _DOUBT)
        return confidences * self.part_confidences()

    def affordance_confidence(self) -> float:
        """The expected intersection over union of the points that are called graspable."""
        return float(expected_iou(self.affordance[:, None], self.graspable[:, None])[0])
