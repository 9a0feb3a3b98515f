"""A policy that touches a lot: it takes hold of the part, pulls it about and lets go.

It reads the state observation alone, and all chance comes from the generator it is given. That a
new episode has begun it finds out by its empty jaws.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from artgym.control import MAX_WIDTH, action_towards, pose_gap
from artgym.envs.observations import STATE_FIELDS
from artgym.geometry.transforms import transform_from

Array = NDArray[np.floating]

#: So far before the grip point the hand turns before it goes there, metres.
_STANDOFF = 0.1
#: Nearer than this, in metres and radians, the jaws close; or after so many steps on the way.
_NEAR, _ALIGNED, _PATIENCE = 0.012, 0.15, 45
#: Steps that the jaws are given to close; emptier ones than this hold nothing, metres.
_CLOSING, _EMPTY = 8, 0.0015
#: Chance a step of letting go, and after that of trying another grasp than the last.
_LETS_GO, _TURNS = 1 / 80, 0.5


class ContactPolicy:
    """Goes to the grip point with noise, closes, pulls about at random and lets go now and then.

    Args:
        rng: of everything random.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._R_world_grasp: Array | None = None
        self._approach()

    def act(self, observation: Any) -> NDArray[np.float32]:
        """The next action (7,).

        Args:
            observation: in the mode "state" or "state_dict".
        """
        fields, rng = fields_of(observation), self._rng
        x, z = fields["tcp_x_axis"], fields["tcp_z_axis"]
        T_world_tcp = transform_from(
            np.stack([x, np.cross(z, x), z], axis=-1), fields["tcp_position"]
        )
        self._steps += 1
        if not self._holds:
            goal = self._goal(T_world_tcp, fields)
            if not self._holds:
                action = action_towards(goal, T_world_tcp, MAX_WIDTH)
                return _in_box(action + rng.normal(0.0, 0.1, 7))
        is_empty = fields["jaw_width"][0] < _EMPTY
        if self._steps > _CLOSING and (is_empty or rng.random() < _LETS_GO):
            if is_empty or rng.random() < _TURNS:
                self._R_world_grasp = None
            self._approach()
            return np.array([0, 0, 0, 0, 0, 0, 1], dtype=np.float32)
        if self._steps > _CLOSING and self._pulls == 0:
            self._pulls = int(rng.integers(4, 15))
            self._pull = self._random_pull(fields)
        self._pulls = max(self._pulls - 1, 0)
        return _in_box(np.append(self._pull + rng.normal(0.0, 0.05, 6), -1.0))

    def _approach(self) -> None:
        """Goes for the part once more."""
        self._holds = False
        self._steps, self._pulls = 0, 0
        self._pull = np.zeros(6)
        self._offset = self._rng.normal(0.0, 0.006, 3)

    def _goal(self, T_world_tcp: Array, fields: Mapping[str, Array]) -> Array:
        """Where the hand shall go, (4, 4); there, it is to close instead."""
        if self._R_world_grasp is None:
            self._R_world_grasp = self._random_grasp(fields["joint_axis"])
        R, point = self._R_world_grasp, fields["grip_point"] + self._offset
        gap, turn = pose_gap(transform_from(R, point), T_world_tcp)
        if (gap < _NEAR and turn < _ALIGNED) or self._steps > _PATIENCE:
            self._holds, self._steps = True, 0
        return transform_from(R, point - (_STANDOFF if turn > _ALIGNED else 0.0) * R[:, 2])

    def _random_grasp(self, joint_axis: Array) -> Array:
        """Rotation (3, 3) of a hand that comes from above, from the front or from between."""
        rng = self._rng
        level = rng.choice([0.0, 1.0, rng.random()])
        approach = np.array([-level, 0.0, level - 1.0])
        approach /= np.linalg.norm(approach)
        axes = (
            joint_axis,
            np.array([0.0, 0.0, 1.0]),
            np.array([0.0, 1.0, 0.0]),
            rng.normal(size=3),
        )
        axis = axes[rng.integers(len(axes))]
        closing = np.cross(approach, axis) if rng.random() < 0.5 else axis
        closing = closing - approach * (approach @ closing)
        if np.linalg.norm(closing) < 0.1:
            # The approach lies in the x-z plane.
            closing = np.array([0.0, 1.0, 0.0])
        closing /= np.linalg.norm(closing)
        return np.stack([np.cross(closing, approach), closing, approach], axis=-1)

    def _random_pull(self, fields: Mapping[str, Array]) -> Array:
        """Translation and rotation (6,) of an action: mostly along the joint, either way."""
        rng = self._rng
        way = axis = fields["joint_axis"]
        if fields["is_revolute"][0]:
            way = np.cross(axis, fields["grip_point"] - fields["joint_pivot"])
        way = way / max(float(np.linalg.norm(way)), 1e-6) * rng.choice([-1.0, 1.0])
        return np.concatenate(
            [0.7 * way + 0.4 * rng.normal(size=3), 0.3 * rng.normal(size=3)],
        )


def fields_of(observation: Any) -> dict[str, Array]:
    """A state observation by fields, in double precision."""
    sizes = STATE_FIELDS["hand"]
    if isinstance(observation, Mapping):
        return {name: observation[name].astype(float) for name in sizes}
    # An arm's fields come after the hand's.
    ends = np.cumsum(list(sizes.values()))
    pieces = np.split(observation.astype(float), ends)
    return dict(zip(sizes, pieces, strict=False))


def _in_box(action: Array) -> NDArray[np.float32]:
    return np.clip(action, -1.0, 1.0).astype(np.float32)
