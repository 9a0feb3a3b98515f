"""One RGB-D picture and the hand's own senses: all that a vision policy is given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]


@dataclass(frozen=True, kw_only=True)
class CameraFrame:
    """An "rgbd" observation with its shapes.

    Attributes:
        rgb: uint8 (H, W, 3).
        depth: float32 (H, W), metres, 0 where nothing was seen.
        intrinsics: (3, 3).
        T_world_camera: (4, 4), OpenCV axes.
        T_world_tcp: (4, 4), the hand's tool centre.
        jaw_width: metres.
        target_part: index of the part to move.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    intrinsics: Array
    T_world_camera: Array
    T_world_tcp: Array
    jaw_width: float
    target_part: int

    @classmethod
    def from_observation(cls, observation: Mapping[str, Any]) -> CameraFrame:
        """Reads an observation of the mode "rgbd"."""
        rgb = observation["rgb"]
        return cls(
            rgb=rgb,
            depth=observation["depth"].reshape(rgb.shape[:2]),
            intrinsics=observation["intrinsics"].reshape(3, 3).astype(float),
            T_world_camera=observation["T_world_camera"].reshape(4, 4).astype(float),
            T_world_tcp=observation["T_world_tcp"].reshape(4, 4).astype(float),
            jaw_width=float(observation["jaw_width"][0]),
            target_part=int(observation["target_part"]),
        )
