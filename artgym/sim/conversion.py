"""Between the simulator's poses and 4x4 transforms."""

from __future__ import annotations

import numpy as np
import sapien
from numpy.typing import NDArray

from artgym.geometry import quaternions
from artgym.geometry.rotations import quaternion_from_matrix

Array = NDArray[np.floating]

#: The simulator's cameras look along x with y left and z up: ``R_simcam_camera`` maps OpenCV
#: camera directions to them.
R_SIMCAM_CAMERA: Array = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


def pose_from_transform(T_a_b: Array) -> sapien.Pose:
    """A simulator pose from ``T_a_b`` (4, 4)."""
    quaternion = quaternions.quaternion_from_rows(T_a_b[:3, :3].tolist())
    return sapien.Pose(T_a_b[:3, 3], quaternion)  # pyright: ignore[reportArgumentType]


def poses_from_transforms(Ts_a_b: Array) -> list[sapien.Pose]:
    """Simulator poses from a stack (n, 4, 4)."""
    quaternions = quaternion_from_matrix(Ts_a_b[:, :3, :3])
    return [sapien.Pose(p, q) for p, q in zip(Ts_a_b[:, :3, 3], quaternions, strict=True)]


def transform_from_pose(pose: sapien.Pose) -> Array:
    """``T_a_b`` (4, 4) in double precision from a simulator pose."""
    (x, y, z), quaternion = numbers_from_pose(pose)
    a, b, c = quaternions.rows_from_quaternion(quaternion)
    return np.array(((*a, x), (*b, y), (*c, z), (0.0, 0.0, 0.0, 1.0)))


def numbers_from_pose(pose: sapien.Pose) -> tuple[quaternions.Vector, quaternions.Quaternion]:
    """Position and quaternion wxyz of a simulator pose."""
    # What pickling keeps; the arrays p and q take four times as long.
    state: tuple[float, ...] = pose.__getstate__()  # pyright: ignore[reportAssignmentType]
    return state[:3], state[3:]  # pyright: ignore[reportReturnType]
