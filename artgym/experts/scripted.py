"""An expert that knows the simulator's state and tries its grasps in a copy before it acts."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from artgym.annotation.annotate import visible_points
from artgym.annotation.filter import Verdict, judge
from artgym.annotation.trial import try_grasp
from artgym.control import GraspExecutor, GraspPlan
from artgym.envs.articulated_env import ArtOpenEnv
from artgym.geometry import transforms
from artgym.geometry.grasps import T_GRASP_TCP, candidate_rotations

Array = NDArray[np.floating]


class ScriptedExpert:
    """Finds a grasp by trial in a scene of its own, then carries it out in the episode.

    Args:
        env: the environment it acts in; its state is read, not changed.
        points: surface points considered at a time.
        trials: attempts in physics before more points are drawn.
    """

    name = "expert"

    def __init__(self, env: ArtOpenEnv, *, points: int = 40, trials: int = 60) -> None:
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
            self._executor.begin(self._plan())
        return self._executor.action(self._env.tcp_pose(), self._env.jaw_width())

    def _plan(self) -> GraspPlan:
        """A grasp that succeeds in a copy of the present state; the best filtered one else."""
        env = self._env
        obj, part, q = env.object, env.target_part, env.joint_positions()
        joint = obj.joint_of(part)
        T_grasp = self._working_grasp()
        R_world_object = env.T_world_object[:3, :3]
        pivot = env.T_world_object @ np.append(joint.pivot, 1.0)
        direction = np.sign(joint.range)
        return GraspPlan(
            T_world_tcp=env.T_world_object @ T_grasp @ T_GRASP_TCP,
            joint_type=joint.type,
            axis_world=direction * (R_world_object @ np.asarray(joint.axis)),
            pivot_world=pivot[:3],
            displacement=abs(joint.open - float(q[part - 1])),
        )

    def _working_grasp(self) -> Array:
        """``T_object_grasp`` (4, 4)."""
        env = self._env
        obj, part, q = env.object, env.target_part, env.joint_positions()
        for _ in range(3):
            points, normals = visible_points(obj, q, part, self._points, 4, 0.35, self._rng)
            R_grasps = candidate_rotations(normals)
            possible = np.argwhere(judge(obj, q, part, points, R_grasps) == Verdict.POSSIBLE)
            # Upright hands first: they come from where there is room.
            height = R_grasps[possible[:, 0], possible[:, 1], 2, 2]
            order = np.argsort(np.abs(height + 0.5), kind="stable")
            chosen = self._rng.permutation(order[: 4 * self._trials])[: self._trials]
            for i, c in possible[chosen]:
                T_object_grasp = transforms.transform_from(R_grasps[i, c], points[i])
                if try_grasp(obj, q, part, T_object_grasp).success:
                    return T_object_grasp
        return T_object_grasp
