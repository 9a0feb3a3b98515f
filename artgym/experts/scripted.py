"""An expert that knows the simulator's state and tries its grasps in a copy before it acts."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from artgym.annotation.annotate import visible_points
from artgym.annotation.filter import Verdict, judge
from artgym.annotation.trial import TrialConfig, try_grasp
from artgym.control import ExecutorConfig, GraspExecutor, GraspPlan
from artgym.envs.articulated_env import ArticulatedEnv
from artgym.errors import InvalidArgumentError
from artgym.geometry import transforms
from artgym.geometry.grasps import T_GRASP_TCP, candidate_rotations
from artgym.geometry.hand import T_hand_grasp
from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.sim.setting import MAX_YAW

Array = NDArray[np.floating]

#: Stay, with closed jaws.
_HOLD = np.array([0, 0, 0, 0, 0, 0, -1], dtype=np.float32)

_T_GRASP_HAND = transforms.invert(T_hand_grasp)

#: An arm lags behind its targets: it is tried more slowly, and given more time to come to rest.
_ARM_TRIAL = TrialConfig(speed=0.15, settle_time=0.3, rest=0.0)
#: Share of the range through which an arm must be able to carry a part.
_ARM_CARRIES = 0.65
#: Where the straight approach begins, metres before the grasp.
_STANDOFF = ExecutorConfig().standoff


class ScriptedExpert:
    """Finds a grasp by trial in a scene of its own, then carries it out in the episode.

    Args:
        env: the environment it acts in; its state is read, not changed.
        points: surface points considered at a time.
        trials: attempts in physics before more points are drawn.
    """

    name = "expert"

    def __init__(self, env: ArticulatedEnv, *, points: int = 40, trials: int = 60) -> None:
        self._env = env
        self._points = points
        self._trials = trials
        self._executor = GraspExecutor()
        self._rng = np.random.default_rng(0)

    def reset(self, seed: int) -> None:
        """Starts an episode."""
        self._rng = np.random.default_rng(seed)
        self._executor = GraspExecutor()

    def act(self, observation: Any) -> NDArray[np.float32]:
        """The next action; plans whenever nothing is under way."""
        if self._executor.phase == "idle":
            plan = self._plan()
            if plan is None:
                return _HOLD.copy()
            self._executor.begin(plan)
        action = self._executor.action(self._env.tcp_pose(), self._env.jaw_width())
        if self._env.progress.success and self._executor.phase != "move":
            # As far as it goes: letting go could only push the part back.
            return _HOLD.copy()
        return action

    def _plan(self) -> GraspPlan | None:
        """A grasp that succeeds in a copy of the present state; the best filtered one else.

        None where the part cannot be seen, or gripped anywhere.
        """
        env = self._env
        obj, part, q = env.object, env.target_part, env.joint_positions()
        joint = obj.joint_of(part)
        T_grasp = self._working_grasp()
        if T_grasp is None:
            return None
        R_world_object = env.T_world_object[:3, :3]
        pivot = env.T_world_object @ np.append(joint.pivot, 1.0)
        direction = np.sign(joint.range) * env.direction
        end = joint.open if env.direction > 0 else joint.closed
        return GraspPlan(
            T_world_tcp=env.T_world_object @ T_grasp @ T_GRASP_TCP,
            joint_type=joint.type,
            axis_world=direction * (R_world_object @ np.asarray(joint.axis)),
            pivot_world=pivot[:3],
            displacement=abs(end - float(q[part - 1])),
        )

    def _working_grasp(self) -> Array | None:
        """``T_object_grasp`` (4, 4): one that also succeeds a little off its pose, if there is."""
        env = self._env
        obj, part, q = env.object, env.target_part, env.joint_positions()
        working: list[Array] = []
        T_object_grasp: Array | None = None
        for _ in range(3):
            points, normals = visible_points(obj, q, part, self._points, 4, MAX_YAW, self._rng)
            if not len(points):
                continue
            R_grasps = candidate_rotations(normals)
            possible = np.argwhere(judge(obj, q, part, points, R_grasps) == Verdict.POSSIBLE)
            trials = 0
            for i, c in self._rng.permutation(possible):
                T_considered = transforms.transform_from(R_grasps[i, c], points[i])
                if not self._is_reachable(T_considered):
                    continue
                if trials == self._trials:
                    break
                trials += 1
                T_object_grasp = T_considered
                if not self._succeeds(T_object_grasp):
                    continue
                working.append(T_object_grasp)
                nearby = [T_object_grasp @ self._small_motion() for _ in range(2)]
                if all(self._succeeds(T) for T in nearby):
                    return T_object_grasp
            if working:
                return working[0]
        return T_object_grasp

    def _succeeds(self, T_object_grasp: Array) -> bool:
        """Whether a grasp succeeds in a copy of the present state."""
        env = self._env
        obj, part, q = env.object, env.target_part, env.joint_positions()
        if env.T_world_base is None:
            return try_grasp(obj, q, part, T_object_grasp).success
        T_object_base = transforms.invert(env.T_world_object) @ env.T_world_base
        try:
            return try_grasp(
                obj, q, part, T_object_grasp, _ARM_TRIAL, T_object_base=T_object_base
            ).success
        except InvalidArgumentError:
            # The hand is there from the arm's posture now, and from none that starts afresh.
            return False

    def _is_reachable(self, T_object_grasp: Array) -> bool:
        """Whether an arm can follow a grasp from before it to where the part shall go."""
        env = self._env
        if env.T_world_base is None:
            return True
        from artgym.sim.kinematics import solve

        obj, part = env.object, env.target_part
        joint, q = obj.joint_of(part), env.joint_positions()[part - 1]
        start = joint.open_fraction(q)
        end = np.clip(start + env.direction * _ARM_CARRIES, 0.0, 1.0)
        carried = joint.motion(joint.position(np.linspace(start, end, 6)))
        T_taken = transforms.invert(joint.motion(q)) @ T_object_grasp @ _T_GRASP_HAND
        T_before = T_object_grasp @ transforms.translation([0.0, 0.0, -_STANDOFF]) @ _T_GRASP_HAND
        path = np.concatenate([T_before[None], carried @ T_taken])
        T_base_object = transforms.invert(env.T_world_base) @ env.T_world_object
        posture = env.arm_positions()
        for T_object_hand in path:
            found = solve(T_base_object @ T_object_hand, posture)
            if not found.reached:
                return False
            posture = found.q
        return True

    def _small_motion(self) -> Array:
        """A rigid motion (4, 4) of about 4 mm and 4 degrees."""
        turn = matrix_from_axis_angle(self._rng.normal(0.0, 0.04, 3))
        return transforms.transform_from(turn, self._rng.normal(0.0, 0.0025, 3))
