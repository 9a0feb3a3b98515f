"""Rotations, quaternions (wxyz, unit, w >= 0) and the symmetry of a two-finger jaw.

The jaw symmetry is defined here and nowhere else: half a turn about the approach axis (z of a
grasp frame) swaps the two fingers and is the same grasp.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.floating]

#: Half a turn about the approach axis: ``R_grasp @ JAW_SYMMETRY`` is the same grasp.
JAW_SYMMETRY: Array = np.diag([-1.0, -1.0, 1.0])


def matrix_from_axis_angle(rotvec: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) from rotation vectors (..., 3) in radians (Rodrigues)."""
    v = np.asarray(rotvec, dtype=float)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    safe = np.where(angle > 1e-8, angle, 1.0)
    K = skew(v)
    a = np.where(angle > 1e-8, np.sin(safe) / safe, 1.0 - angle**2 / 6.0)
    b = np.where(angle > 1e-8, (1.0 - np.cos(safe)) / safe**2, 0.5 - angle**2 / 24.0)
    return np.eye(3) + a * K + b * (K @ K)


def skew(v: ArrayLike) -> Array:
    """Cross-product matrices (..., 3, 3): ``skew(v) @ x == cross(v, x)``."""
    v = np.asarray(v, dtype=float)
    K = np.zeros((*v.shape, 3))
    K[..., 0, 1], K[..., 0, 2], K[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    return K - np.swapaxes(K, -1, -2)


def cross(a: ArrayLike, b: ArrayLike) -> Array:
    """Cross products (..., 3) of vectors (..., 3), to the bit those of ``numpy.cross``.

    On a few vectors numpy's own takes ten times as long, nearly all of it for its choice of axes.
    """
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    ax, ay, az = a[..., 0], a[..., 1], a[..., 2]
    bx, by, bz = b[..., 0], b[..., 1], b[..., 2]
    result[..., 0] = ay * bz - az * by
    result[..., 1] = az * bx - ax * bz
    result[..., 2] = ax * by - ay * bx
    return result


def axis_angle_from_matrix(R: ArrayLike) -> Array:
    """Rotation vectors (..., 3), radians, norm in [0, pi], from rotation matrices (..., 3, 3)."""
    q = quaternion_from_matrix(R)
    w, v = np.clip(q[..., :1], -1.0, 1.0), q[..., 1:]
    sine = np.linalg.norm(v, axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, w)
    return v * np.where(sine > 1e-9, angle / np.maximum(sine, 1e-12), 2.0)


def quaternion_from_matrix(R: ArrayLike) -> Array:
    """Unit quaternions wxyz (..., 4) with w >= 0 from rotation matrices (..., 3, 3)."""
    R = np.asarray(R, dtype=float)
    m00, m11, m22 = R[..., 0, 0], R[..., 1, 1], R[..., 2, 2]
    # Four times the squared components; the largest one is the well-conditioned choice.
    squares = np.stack(
        [1 + m00 + m11 + m22, 1 + m00 - m11 - m22, 1 - m00 + m11 - m22, 1 - m00 - m11 + m22], -1
    )
    x, y, z = R[..., 2, 1], R[..., 0, 2], R[..., 1, 0]
    xt, yt, zt = R[..., 1, 2], R[..., 2, 0], R[..., 0, 1]
    rows = np.stack(
        [
            np.stack([squares[..., 0], x - xt, y - yt, z - zt], -1),
            np.stack([x - xt, squares[..., 1], z + zt, y + yt], -1),
            np.stack([y - yt, z + zt, squares[..., 2], x + xt], -1),
            np.stack([z - zt, y + yt, x + xt, squares[..., 3]], -1),
        ],
        -2,
    )
    best = np.argmax(squares, axis=-1)
    q = np.take_along_axis(rows, best[..., None, None], axis=-2)[..., 0, :]
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    return np.where(q[..., :1] < 0, -q, q)


def matrix_from_quaternion(q_wxyz: ArrayLike) -> Array:
    """Rotation matrices (..., 3, 3) from quaternions wxyz (..., 4), normalised here."""
    q = np.asarray(q_wxyz, dtype=float)
    q = q / np.linalg.norm(q, axis=-1, keepdims=True)
    w, v = q[..., 0, None, None], q[..., 1:]
    K = skew(v)
    return np.eye(3) + 2.0 * w * K + 2.0 * (K @ K)


def geodesic_angle(R1: ArrayLike, R2: ArrayLike) -> Array:
    """Angle in radians, [0, pi], of the rotation between R1 and R2 (..., 3, 3)."""
    R1, R2 = np.asarray(R1, dtype=float), np.asarray(R2, dtype=float)
    # The chord is accurate near zero, where the arc cosine of the trace is not.
    chord = np.sqrt(np.sum((R1 - R2) ** 2, axis=(-2, -1)))
    return 2.0 * np.arcsin(np.clip(chord / np.sqrt(8.0), 0.0, 1.0))


def grasp_angle(R1: ArrayLike, R2: ArrayLike) -> Array:
    """Geodesic angle in radians between two grasp rotations, minimum over the jaw symmetry."""
    R2 = np.asarray(R2, dtype=float)
    return np.minimum(geodesic_angle(R1, R2), geodesic_angle(R1, R2 @ JAW_SYMMETRY))


def frame_from_z(z: ArrayLike, roll: ArrayLike = 0.0) -> Array:
    """Rotations (..., 3, 3) whose z column is ``z`` (..., 3), turned by ``roll`` rad about it.

    The zero-roll x column is the projection of the world axis least aligned with ``z``, so the
    result is a deterministic function of the direction.
    """
    unit: Array = np.asarray(z, dtype=float)
    unit = unit / np.linalg.norm(unit, axis=-1, keepdims=True)
    helper = np.eye(3)[np.argmin(np.abs(unit), axis=-1)]
    x: Array = helper - np.sum(helper * unit, axis=-1, keepdims=True) * unit
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    y = cross(unit, x)
    c, s = np.cos(roll)[..., None], np.sin(roll)[..., None]
    return np.stack(np.broadcast_arrays(c * x + s * y, c * y - s * x, unit), axis=-1)
