"""What an observation holds in each mode, and the spaces that say so.

Apart from uint8 images everything is a vector, since learning libraries take nothing else
without complaint: ``depth`` is the picture row by row, a transform its 16 numbers.
``datasets.frame.CameraFrame.from_observation`` gives them their shapes back.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np
from gymnasium import spaces

ObsMode = Literal["state", "rgbd", "pointcloud"]

#: Fields of the state vector, in order, with their sizes. Metres, radians, world frame.
STATE_FIELDS: Mapping[str, int] = {
    "tcp_position": 3,
    "tcp_x_axis": 3,
    "tcp_z_axis": 3,
    "tcp_linear_velocity": 3,
    "tcp_angular_velocity": 3,
    "jaw_width": 1,
    "open_fraction": 1,
    "joint_velocity": 1,
    "is_revolute": 1,
    "joint_axis": 3,
    "joint_pivot": 3,
    "grip_point": 3,
    "tcp_to_grip_point": 3,
    "part_size": 3,
}

#: No coordinate, velocity or size in a scene that is still stable exceeds this.
LIMIT = 50.0


def _vector(size: int, limit: float = LIMIT) -> spaces.Box:
    return spaces.Box(-limit, limit, (size,), np.float32)


def observation_space(
    mode: ObsMode, camera_size: tuple[int, int], num_points: int, num_parts: int
) -> spaces.Space[Any]:
    """The space of a mode; ``camera_size`` is (width, height) in pixels."""
    if mode == "state":
        return _vector(sum(STATE_FIELDS.values()))
    hand = {
        "T_world_tcp": _vector(16, 10.0),
        "jaw_width": spaces.Box(-0.01, 0.1, (1,), np.float32),
        "target_part": spaces.Discrete(num_parts),
    }
    if mode == "pointcloud":
        return spaces.Dict({"points": _vector(3 * num_points, 10.0), **hand})
    width, height = camera_size
    return spaces.Dict(
        {
            "rgb": spaces.Box(0, 255, (height, width, 3), np.uint8),
            "depth": spaces.Box(0.0, 10.0, (height * width,), np.float32),
            "intrinsics": spaces.Box(0.0, 1e4, (9,), np.float32),
            "T_world_camera": _vector(16, 10.0),
            **hand,
        }
    )
