"""Rigid transforms as 4x4 matrices.

``T_a_b`` maps b-coordinates to a-coordinates. All functions broadcast over leading axes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.floating]


def transform_from(R_a_b: ArrayLike, t_a_b: ArrayLike) -> Array:
    """Builds ``T_a_b`` (..., 4, 4) from a rotation (..., 3, 3) and b's origin in a (..., 3)."""
    R = np.asarray(R_a_b, dtype=float)
    t = np.asarray(t_a_b, dtype=float)
    T = np.zeros((*np.broadcast_shapes(R.shape[:-2], t.shape[:-1]), 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = t
    T[..., 3, 3] = 1.0
    return T


def translation(t_a_b: ArrayLike) -> Array:
    """``T_a_b`` (..., 4, 4) with identity rotation."""
    return transform_from(np.eye(3), t_a_b)


def invert(T_a_b: ArrayLike) -> Array:
    """``T_b_a`` of a rigid ``T_a_b``, both (..., 4, 4)."""
    T = np.asarray(T_a_b, dtype=float)
    R_b_a = np.swapaxes(T[..., :3, :3], -1, -2)
    return transform_from(R_b_a, -(R_b_a @ T[..., :3, 3:])[..., 0])


def apply(T_a_b: ArrayLike, points_b: ArrayLike) -> Array:
    """Maps points (..., n, 3) in b to points (..., n, 3) in a."""
    T = np.asarray(T_a_b)
    return np.asarray(points_b) @ np.swapaxes(T[..., :3, :3], -1, -2) + T[..., None, :3, 3]


def rotate(T_a_b: ArrayLike, vectors_b: ArrayLike) -> Array:
    """Maps directions (..., n, 3) in b to a: the rotation alone."""
    return np.asarray(vectors_b) @ np.swapaxes(np.asarray(T_a_b)[..., :3, :3], -1, -2)
