"""Motion of a joint: a turn about, or a slide along, an axis through a pivot."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.geometry.transforms import transform_from

Array = NDArray[np.floating]
JointType = Literal["prismatic", "revolute"]


def joint_motion(joint_type: JointType, axis: ArrayLike, pivot: ArrayLike, q: ArrayLike) -> Array:
    """The rigid motion (..., 4, 4) of a joint, in the frame ``axis`` and ``pivot`` are given in.

    Args:
        joint_type: "prismatic" slides along the axis, "revolute" turns about it.
        axis: unit direction (..., 3).
        pivot: a point of the axis (..., 3), metres; without effect for a slide.
        q: displacement, metres or radians, (...).

    Returns:
        T with ``moved = T @ point``.
    """
    axis, pivot, q = (np.asarray(a, dtype=float) for a in (axis, pivot, q))
    if joint_type == "prismatic":
        return transform_from(np.eye(3), axis * q[..., None])
    R = matrix_from_axis_angle(axis * q[..., None])
    return transform_from(R, pivot - (R @ pivot[..., None])[..., 0])
