"""Anchor grasps and the residuals towards real ones (paper, Section 5.3, Eqs. 2 to 4).

Anchors live in the level frame: z up, x in the viewing direction.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.errors import InvalidArgumentError
from artgym.geometry.rotations import (
    JAW_SYMMETRY,
    frame_from_z,
    grasp_angle,
    matrix_from_quaternion,
    quaternion_from_matrix,
)

Array = NDArray[np.floating]

#: Steps in degrees that the paper compares (Table 2).
ANCHOR_STEPS_DEG: tuple[int, ...] = (10, 20, 30, 45)

#: Two anchors closer than this are one, radians.
_SAME = 1e-4


@cache
def axis_anchors(step_deg: int = 45) -> Array:
    """Anchor rotations (L, 3, 3): approaches on three great circles, each with rolls.

    Approach directions lie every ``step_deg`` on the circles in the xy, yz and zx planes; the
    roll about each takes the same step. Grasps that repeat an earlier one, by the geodesic
    distance and up to half a turn of the jaws, are left out: L = 72 at 45 degrees.

    Args:
        step_deg: a divisor of 180.
    """
    if not 0 < step_deg <= 90 or 180 % step_deg:
        raise InvalidArgumentError(
            f"step_deg={step_deg} must divide 180 and be at most 90; "
            f"the paper uses {ANCHOR_STEPS_DEG}."
        )
    angles = np.radians(np.arange(0, 360, step_deg))
    cosine, sine, zero = np.cos(angles), np.sin(angles), np.zeros_like(angles)
    circles = [(cosine, sine, zero), (zero, cosine, sine), (sine, zero, cosine)]
    # Rounded, so that a last digit cannot decide which axis a frame's zero roll is taken from.
    approaches = np.concatenate([np.stack(circle, axis=-1) for circle in circles]).round(12)
    candidates = frame_from_z(
        np.repeat(approaches, len(angles), axis=0), np.tile(angles, len(approaches))
    )
    kept: list[Array] = []
    for candidate in candidates:
        if not kept or np.min(grasp_angle(np.stack(kept), candidate)) > _SAME:
            kept.append(candidate)
    anchors = np.stack(kept)
    anchors.setflags(write=False)
    return anchors


def _nearest_variants(R_grasps: Array, anchors: Array) -> tuple[Array, Array, Array]:
    """Quaternions of grasps (n, 3, 3) and of anchors (L, 3, 3), and how they agree.

    Returns:
        Quaternions (2, n, 4) of the grasps and of their jaw-swapped twins, those of the anchors
        (L, 4), and the dot products (2, n, L).
    """
    q_grasps = quaternion_from_matrix(np.stack([R_grasps, R_grasps @ JAW_SYMMETRY]))
    q_anchors = quaternion_from_matrix(anchors)
    return q_grasps, q_anchors, q_grasps @ q_anchors.T


def match_anchors(R_grasps: ArrayLike, anchors: Array) -> tuple[NDArray[np.int64], Array]:
    """The anchor nearest to each grasp, and the residual from it (Eqs. 2 and 4).

    Distance is the geodesic angle, minimum over the jaw symmetry. The residual is ``q - A``, with
    q that of the four equal grasps (sign of the quaternion, jaws swapped) nearest to A.

    Args:
        R_grasps: (n, 3, 3), same frame as the anchors.
        anchors: (L, 3, 3).

    Returns:
        Anchor indices (n,) and residuals (n, 4), wxyz.
    """
    q_grasps, q_anchors, dots = _nearest_variants(np.asarray(R_grasps, dtype=float), anchors)
    matched = np.argmax(np.max(np.abs(dots), axis=0), axis=-1)  # (n,)
    row = np.arange(len(matched))
    dot = dots[:, row, matched]  # (2, n)
    variant = np.argmax(np.abs(dot), axis=0)
    q = q_grasps[variant, row] * np.where(dot[variant, row] < 0, -1.0, 1.0)[:, None]
    return matched, q - q_anchors[matched]


def grasps_from_residuals(anchors: ArrayLike, residuals: ArrayLike) -> Array:
    """Grasps (..., 3, 3): anchors (..., 3, 3) plus residuals (..., 4), normalised (Eq. 4)."""
    return matrix_from_quaternion(quaternion_from_matrix(anchors) + np.asarray(residuals))
