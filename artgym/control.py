"""Carries out a grasp with the hand's own senses: where it is and how wide its jaws stand.

One motion for every policy, so that a benchmark compares what they see and not how they move:
hover, approach, close, move along a joint, and let go when that fails. Nothing here knows the
simulator; poses come from an observation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from artgym.geometry import transforms
from artgym.geometry.rotations import axis_angle_from_matrix
from artgym.geometry.screw import JointType, joint_motion

Array = NDArray[np.floating]

#: Largest move of the hand in one control step: metres and radians at an action of 1.
MAX_TRANSLATION, MAX_ROTATION = 0.02, 0.1
#: Largest turn of an arm's joint in one control step, radians.
MAX_JOINT_TURN = 0.1
#: Jaw opening at an action of +1, metres; -1 closes them.
MAX_WIDTH = 0.08

Phase = Literal[
    "hover", "standoff", "approach", "close", "move", "hold", "release", "retreat", "home", "idle"
]


@dataclass(frozen=True, kw_only=True)
class GraspPlan:
    """A grasp and the joint that the part is expected to move about.

    Attributes:
        T_world_tcp: where the hand's tool centre shall be when it closes, (4, 4).
        joint_type: how the part moves.
        axis_world: unit direction; opening is positive.
        pivot_world: a point of the axis, metres.
        displacement: how far to go along the joint, metres or radians.
        hold_from: a motion that comes to its end after so much of it, by the end of the part's
            range or whatever else is in the way, ends in holding on; else the hand lets go.
    """

    T_world_tcp: Array
    joint_type: JointType
    axis_world: Array
    pivot_world: Array
    displacement: float
    hold_from: float = np.inf


@dataclass(frozen=True, kw_only=True)
class ExecutorConfig:
    """How a plan is carried out; metres, radians, control steps.

    Attributes:
        standoff: distance along the approach at which the straight approach begins.
        hover_height: least height of the way to the standoff, world z.
        position_tolerance, rotation_tolerance: when a pose counts as reached.
        close_steps: given to the jaws.
        release_steps: given to the jaws to let go.
        patience: steps without headway after which a phase is given up.
        empty_width: closed jaws narrower than this hold nothing.
        leash: how far the hand may lag behind before the motion along the joint waits.
        goes_home: after a grasp, return to where the first plan was given, out of the camera's
            way; else stay where the retreat ends.
    """

    standoff: float = 0.08
    hover_height: float = 0.45
    position_tolerance: float = 0.004
    rotation_tolerance: float = 0.03
    close_steps: int = 5
    release_steps: int = 4
    patience: int = 8
    empty_width: float = 0.0015
    leash: float = 0.03
    goes_home: bool = False


class GraspExecutor:
    """Turns a plan into actions, one a control step.

    ``phase`` is "idle" before a plan is given and after one has ended, whether by the end of the
    part's range or by jaws that came back empty: only a new look can tell. It stays "hold" where
    the plan says so.
    """

    def __init__(self, config: ExecutorConfig = ExecutorConfig()) -> None:
        self._config = config
        self.phase: Phase = "idle"
        self._plan: GraspPlan | None = None
        self._elapsed = 0
        self._waited = 0
        self._best_gap = np.inf
        self._moved = 0.0
        self._T_grasped = np.eye(4)
        self._T_home: Array | None = None

    @property
    def moved(self) -> float:
        """How far the last plan asked the hand along its joint, which lags; metres or radians."""
        return self._moved

    def begin(self, plan: GraspPlan) -> None:
        """Starts a new plan."""
        self._plan = plan
        self._moved = 0.0
        self._enter("hover")

    def action(self, T_world_tcp: Array, width: float) -> NDArray[np.float32]:
        """The action (7,) for the hand's present pose (4, 4) and jaw width in metres."""
        if self._T_home is None:
            self._T_home = T_world_tcp.copy()
        self._switch_phase(T_world_tcp, width)
        if self.phase == "idle" or self._plan is None:
            return np.zeros(7, dtype=np.float32)
        closed = self.phase in ("close", "move", "hold")
        return action_towards(self._goal(T_world_tcp), T_world_tcp, 0.0 if closed else MAX_WIDTH)

    def _enter(self, phase: Phase) -> None:
        self.phase = phase
        self._elapsed = 0
        self._waited = 0
        self._best_gap = np.inf

    def _goal(self, T_world_tcp: Array) -> Array:
        """Where the present phase wants the hand."""
        assert self._plan is not None
        T_grasp = self._plan.T_world_tcp
        standoff = T_grasp @ transforms.translation([0.0, 0.0, -self._config.standoff])
        if self.phase == "hover":
            standoff[2, 3] = max(standoff[2, 3], self._config.hover_height)
            return standoff
        if self.phase == "standoff":
            return standoff
        if self.phase in ("approach", "close"):
            return T_grasp
        if self.phase == "move":
            return self._carried(self._moved)
        if self.phase == "retreat":
            return self._T_grasped @ transforms.translation([0.0, 0.0, -self._config.standoff])
        if self.phase == "home" and self._T_home is not None:
            return self._T_home
        return T_world_tcp

    def _carried(self, displacement: float) -> Array:
        """The pose the grasped hand comes to when the joint moves by ``displacement``."""
        plan = self._plan
        assert plan is not None
        motion = joint_motion(plan.joint_type, plan.axis_world, plan.pivot_world, displacement)
        return motion @ self._T_grasped

    def _switch_phase(self, T_world_tcp: Array, width: float) -> None:
        config = self._config
        if self.phase == "idle":
            return
        gap, turn = pose_gap(self._goal(T_world_tcp), T_world_tcp)
        reached = gap < config.position_tolerance and turn < config.rotation_tolerance
        self._elapsed += 1
        self._waited += 1
        if gap + 0.1 * turn < self._best_gap - 1e-3:
            self._best_gap, self._waited = gap + 0.1 * turn, 0
        stuck = self._waited > config.patience
        if self.phase == "hover" and (stuck or gap < 0.03):
            self._enter("standoff")
        elif self.phase == "standoff" and (stuck or reached):
            self._enter("approach")
        elif self.phase == "approach" and (stuck or reached):
            self._enter("close")
        elif self.phase == "close" and self._elapsed >= config.close_steps:
            self._T_grasped = T_world_tcp.copy()
            self._enter("release" if width < config.empty_width else "move")
        elif self.phase == "move":
            self._follow_joint(T_world_tcp, width)
        elif self.phase == "release" and self._elapsed >= config.release_steps:
            self._T_grasped = T_world_tcp.copy()
            self._enter("retreat")
        elif self.phase == "retreat" and (stuck or reached):
            self._enter("home" if config.goes_home else "idle")
        elif self.phase == "home" and (stuck or gap < 0.03):
            self._enter("idle")

    def _follow_joint(self, T_world_tcp: Array, width: float) -> None:
        plan, config = self._plan, self._config
        assert plan is not None
        if width < config.empty_width:
            self._enter("release")
            return
        gap, turn = pose_gap(self._carried(self._moved), T_world_tcp)
        if gap < config.leash and turn < 5 * config.leash and self._moved < plan.displacement:
            lever = 1.0
            if plan.joint_type == "revolute":
                arm = T_world_tcp[:3, 3] - plan.pivot_world
                lever = max(float(np.linalg.norm(np.cross(plan.axis_world, arm))), 0.05)
            self._moved = min(self._moved + 0.8 * MAX_TRANSLATION / lever, plan.displacement)
            self._waited = 0
        elif self._waited > config.patience:
            # Held back: at the end of the range, by a wrong joint, or by what is in the way.
            self._enter("hold" if self._moved >= plan.hold_from else "release")


def pose_gap(T_a: Array, T_b: Array) -> tuple[float, float]:
    """Distance in metres and angle in radians between two poses (4, 4)."""
    turn = axis_angle_from_matrix(T_a[:3, :3] @ T_b[:3, :3].T)
    return float(np.linalg.norm(T_a[:3, 3] - T_b[:3, 3])), float(np.linalg.norm(turn))


def action_towards(T_world_goal: Array, T_world_tcp: Array, width: float) -> NDArray[np.float32]:
    """The action (7,) that brings the hand nearest to a goal within one control step.

    Translation and turn keep their direction when they are cut to the largest move.
    """
    move = (T_world_goal[:3, 3] - T_world_tcp[:3, 3]) / MAX_TRANSLATION
    turn = axis_angle_from_matrix(T_world_goal[:3, :3] @ T_world_tcp[:3, :3].T) / MAX_ROTATION
    move /= max(1.0, float(np.abs(move).max()))
    turn /= max(1.0, float(np.abs(turn).max()))
    jaws = 2.0 * width / MAX_WIDTH - 1.0
    return np.concatenate([move, turn, [jaws]]).astype(np.float32)
