"""Anchor grasps and the residuals towards real ones (paper, Section 5.3, Eqs. 2 to 4)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.errors import InvalidArgumentError, UnknownNameError
from artgym.geometry.rotations import (
    JAW_SYMMETRY,
    axis_angle_from_matrix,
    frame_from_z,
    grasp_angle,
    matrix_from_axis_angle,
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


#: The real root of ``x**3 = x + 1``: multiples of its inverse, and of the square of the inverse,
#: fill a square evenly.
_PLASTIC = 1.324717957244746


@cache
def so3_anchors(count: int) -> Array:
    """Anchor rotations (L, 3, 3) spread evenly over all grasps, ``count`` of them.

    Super-Fibonacci spirals (Alexa, "Super-Fibonacci Spirals: Fast, Low-Discrepancy Sampling of
    SO(3)", CVPR 2022) write a unit quaternion as two complex numbers and step along their phases.
    Here these are (w, z) and (x, y), which half a turn about z and the quaternion's sign move by
    (pi/2, -pi/2) and (pi, pi): steps within that cell meet each grasp once, its jaw-swapped twin
    left out. A random grasp is 22.7 degrees from the nearest of 72 on average; of the spirals' own
    72, blind to the jaws, it is 24.3.
    """
    if count < 1:
        raise InvalidArgumentError(f"count={count} must be at least 1.")
    index = np.arange(count) + 0.5
    share = index / count
    halfturn, sign = index / _PLASTIC, index / _PLASTIC**2
    phase_wz, phase_xy = np.pi * (sign + halfturn / 2), np.pi * (sign - halfturn / 2)
    w_z, x_y = np.sqrt(share), np.sqrt(1.0 - share)
    q = np.stack(
        [
            w_z * np.cos(phase_wz),
            x_y * np.cos(phase_xy),
            x_y * np.sin(phase_xy),
            w_z * np.sin(phase_wz),
        ],
        axis=-1,
    )
    anchors = matrix_from_quaternion(q)
    anchors.setflags(write=False)
    return anchors


#: What ``AnchorConfig.frame`` may be.
AnchorFrame = Literal["level", "part"]


@dataclass(frozen=True, kw_only=True)
class AnchorConfig:
    """Which anchors, and how a residual is written.

    Attributes:
        kind: "axis" anchors are the paper's (``axis_anchors``), their residual the difference of
            quaternions of Eq. 4; "so3" anchors fill all rotations (``so3_anchors``), their
            residual is the rotation vector from the anchor in the anchor's own frame; "direct"
            has no anchors but regresses one quaternion a point, as a baseline.
        step_deg: of axis anchors.
        count: of so3 anchors.
        frame: where anchors, and grasps refined from them, are turned with: the "level" frame has z
            up and x in the viewing direction; the frame of the canonical box of the "part" that a
            point is on turns with the part, as its good grasps do, but must be found first.
    """

    kind: Literal["axis", "so3", "direct"] = "axis"
    step_deg: int = 45
    count: int = 72
    frame: AnchorFrame = "level"

    def __post_init__(self) -> None:
        if self.frame not in get_args(AnchorFrame):
            raise UnknownNameError("frame", self.frame, get_args(AnchorFrame))
        anchors_from_config(self)


@dataclass(frozen=True, kw_only=True, eq=False)
class Anchors:
    """L anchors; r numbers make a residual.

    Attributes:
        kind: of ``AnchorConfig``, and
        frame: that all rotations below are in.
        rotations: (L, 3, 3); the unit rotation alone for "direct".
    """

    kind: Literal["axis", "so3", "direct"]
    frame: AnchorFrame
    rotations: Array

    def __len__(self) -> int:
        """L."""
        return len(self.rotations)

    @property
    def residual_size(self) -> int:
        """R."""
        return 3 if self.kind == "so3" else 4

    @cached_property
    def _quaternions(self) -> Array:
        """(L, 4), wxyz."""
        return quaternion_from_matrix(self.rotations)

    def match(self, R_frame_grasps: ArrayLike) -> tuple[NDArray[np.int64], Array]:
        """The anchor nearest to each grasp, and the residual from it (Eqs. 2 and 4).

        Distance is the geodesic angle, minimum over the jaw symmetry. The residual starts from
        that of the equal grasps (sign of the quaternion, jaws swapped) nearest to the anchor.

        Args:
            R_frame_grasps: (n, 3, 3).

        Returns:
            Anchor indices (n,) and residuals (n, r).
        """
        R = np.asarray(R_frame_grasps, dtype=float)
        variants = np.stack([R, R @ JAW_SYMMETRY])
        q_grasps = quaternion_from_matrix(variants)  # (2, n, 4)
        q_anchors = self._quaternions
        dots = q_grasps @ q_anchors.T  # (2, n, L)
        matched = np.argmax(np.max(np.abs(dots), axis=0), axis=-1)  # (n,)
        row = np.arange(len(matched))
        dot = dots[:, row, matched]  # (2, n)
        variant = np.argmax(np.abs(dot), axis=0)
        if self.kind == "so3":
            R_anchor_frame = np.swapaxes(self.rotations[matched], -1, -2)
            return matched, axis_angle_from_matrix(R_anchor_frame @ variants[variant, row])
        q = q_grasps[variant, row] * np.where(dot[variant, row] < 0, -1.0, 1.0)[:, None]
        return matched, q - q_anchors[matched]

    def grasps(self, index: ArrayLike, residuals: ArrayLike) -> Array:
        """Grasps (..., 3, 3): anchors at ``index`` (...) and residuals (..., r)."""
        anchors, residuals = self.rotations[np.asarray(index)], np.asarray(residuals, dtype=float)
        if self.kind == "so3":
            return anchors @ matrix_from_axis_angle(residuals)
        return matrix_from_quaternion(quaternion_from_matrix(anchors) + residuals)


@cache
def anchors_from_config(config: AnchorConfig) -> Anchors:
    """The anchors that a config asks for."""
    if config.kind == "direct":
        return Anchors(kind="direct", frame=config.frame, rotations=np.eye(3)[None])
    axis = config.kind == "axis"
    rotations = axis_anchors(config.step_deg) if axis else so3_anchors(config.count)
    return Anchors(kind=config.kind, frame=config.frame, rotations=rotations)
