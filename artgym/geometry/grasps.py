"""The grasp poses tried at a surface point (paper, Section 4, steps 1 and 2).

A grasp's rotation has columns (x, y = closing direction, z = approach); its origin is the surface
point, and the fingertips lie ``GRASP_DEPTH`` beyond it along z.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.geometry.rotations import frame_from_z, matrix_from_axis_angle
from artgym.geometry.transforms import translation

Array = NDArray[np.floating]

#: How far the fingertips go beyond the surface point along the approach, metres.
GRASP_DEPTH = 0.02

#: How far the fingertips go beyond the hand's tool centre point (TCP, the middle of the pads).
TIP_BEYOND_TCP = 0.0095

#: The tool centre in the grasp's frame, (4, 4).
T_GRASP_TCP: Array = translation([0.0, 0.0, GRASP_DEPTH - TIP_BEYOND_TCP])

#: Rings of approach directions: (tilt from the inward normal in degrees, directions on the ring).
APPROACH_RINGS: tuple[tuple[float, int], ...] = ((0.0, 1), (27.0, 6), (52.0, 9), (78.0, 9))

#: Rolls about the approach, evenly over half a turn: the other half is the same grasp.
NUM_ROLLS = 8

NUM_APPROACHES = sum(count for _, count in APPROACH_RINGS)
NUM_CANDIDATES = NUM_APPROACHES * NUM_ROLLS


def _candidates_about_z() -> Array:
    """Candidates (NUM_CANDIDATES, 3, 3) for the inward normal +z."""
    grasps = []
    for ring, (tilt_deg, count) in enumerate(APPROACH_RINGS):
        # Every other ring is turned by half a step, so that directions do not line up.
        azimuths = (np.arange(count) + 0.5 * (ring % 2)) * 2 * np.pi / count
        for azimuth in azimuths:
            tilt_axis = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
            R_tilt = matrix_from_axis_angle(tilt_axis * np.radians(tilt_deg))
            rolls = np.arange(NUM_ROLLS) * np.pi / NUM_ROLLS
            grasps.append(R_tilt @ matrix_from_axis_angle(rolls[:, None] * [0.0, 0.0, 1.0]))
    return np.concatenate(grasps)


_CANDIDATES_ABOUT_Z = _candidates_about_z()


def candidate_rotations(normals: ArrayLike) -> Array:
    """The rotations tried at surface points with outward unit ``normals`` (..., 3).

    Approach directions fill the hemisphere against the normal; each is combined with
    ``NUM_ROLLS`` rolls. A pure function of the normal, so labels need only keep one bit a try.

    Returns:
        (..., NUM_CANDIDATES, 3, 3), frame of the normals; index = approach * NUM_ROLLS + roll.
    """
    R_frame = frame_from_z(-np.asarray(normals, dtype=float))
    return R_frame[..., None, :, :] @ _CANDIDATES_ABOUT_Z


def candidates_of_part(normals_part: ArrayLike, R_object_part: ArrayLike) -> Array:
    """The rotations tried at labelled points of a part, which are kept by their normals.

    The tries follow from the normals in the object's frame, as the part stood when they were
    made. ``candidate_rotations`` jumps where two components of a normal are equal: rounding keeps
    the last digits of a rotation from deciding it.

    Args:
        normals_part: outward unit normals (..., 3) in the frame of the part.
        R_object_part: (3, 3), or (..., 3, 3) for points of several parts.

    Returns:
        (..., NUM_CANDIDATES, 3, 3) in the object's frame.
    """
    R = np.asarray(R_object_part, dtype=float)
    normals_object = (R @ np.asarray(normals_part, dtype=float)[..., None])[..., 0]
    return candidate_rotations(normals_object.round(6))
