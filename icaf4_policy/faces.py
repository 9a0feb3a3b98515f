"""Where a part's flat faces point: most things that people make have faces along their boxes' axes.

Normalised coordinates of a network place a box to some degrees; the normals of a flat face, which
are measured, tell its direction to fractions of one. How well a face of a part tells an axis of its
box is learnt from the training objects: the sides of a cabinet do, the rounded lid of a stapler
does not.
"""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.geometry.normals import surface_normals
from artgym.geometry.rotations import frame_from_z, matrix_from_axis_angle
from icaf4_policy.pose_fitting import umeyama
from icaf4_policy.targets import Targets

Array = NDArray[np.floating]

#: A face along an axis is looked for within this angle of where the axis is thought to be, radians.
REACH = float(np.radians(15.0))
#: Normals of one face are within this angle of each other, radians.
_TIGHT = float(np.radians(4.0))
#: A face has at least so many points, and this share of its part's.
_LEAST_POINTS, _LEAST_SHARE = 20, 0.1
#: Normals that are tried for the middle of a face.
_SEEDS = 128
#: How often the middle is worked out anew from the normals around it.
_ITERATIONS = 3
#: A wall stands within this angle of the vertical, radians.
_UPRIGHT = float(np.radians(10.0))
#: Of the normals of walls, at least this share is across the sides of one box, and of all normals
#: at least this one.
_SQUARE_SHARE, _WALL_SHARE = 0.6, 0.2
#: Walls tell the axes of a box with errors of less than this, radians.
_WALL_ERROR = float(np.radians(1.0))
#: The error of a face that was seen in fewer training views than this is not known.
_LEAST_VIEWS = 20
#: More training views tell no more.
_MOST_VIEWS = 1000
#: Median of a two-dimensional error whose standard deviation in each direction is one.
_RAYLEIGH_MEDIAN = float(np.sqrt(2.0 * np.log(2.0)))

#: Standard deviation of each part's faces along each axis, radians; ``None`` where not known.
FaceErrors = tuple[tuple[float | None, float | None, float | None], ...]


@numba.njit(cache=True)
def _face(normals, axis, cos_reach, cos_tight, least):  # type: ignore[no-untyped-def]
    """The middle of most normals near ``axis`` or its opposite; zeros where there are too few."""
    near = np.empty(normals.shape)
    count = 0
    for i in range(len(normals)):
        along = normals[i, 0] * axis[0] + normals[i, 1] * axis[1] + normals[i, 2] * axis[2]
        if abs(along) > cos_reach:
            near[count] = normals[i] if along > 0.0 else -normals[i]
            count += 1
    middle, most = np.zeros(3), least - 1
    step = max(count // _SEEDS, 1)
    for i in range(0, count, step):
        mine = 0
        for j in range(count):
            cosine = near[i, 0] * near[j, 0] + near[i, 1] * near[j, 1] + near[i, 2] * near[j, 2]
            mine += cosine > cos_tight
        if mine > most:
            most = mine
            middle[:] = near[i]
    if most < least:
        return middle
    for _ in range(_ITERATIONS):
        total = np.zeros(3)
        for j in range(count):
            cosine = middle[0] * near[j, 0] + middle[1] * near[j, 1] + middle[2] * near[j, 2]
            if cosine > cos_tight:
                total += near[j]
        middle = total / np.sqrt((total**2).sum())
    return middle


def face_directions(normals: ArrayLike, R_box: ArrayLike) -> tuple[Array, NDArray[np.bool_]]:
    """Directions of the faces of one part that lie nearly across the axes of its box.

    Args:
        normals: (n, 3), unit, of the part's surface; on which side of it does not matter.
        R_box: (3, 3), about where the axes are, its columns, in the frame of the normals.

    Returns:
        For each axis the direction of its face (3, 3), a row each, on the side of the axis, and
        whether there is one, bool (3,).
    """
    normals = np.ascontiguousarray(normals, dtype=float).reshape(-1, 3)
    least = max(_LEAST_POINTS, int(np.ceil(_LEAST_SHARE * len(normals))))
    axes = np.ascontiguousarray(np.asarray(R_box, dtype=float).T)
    directions = np.stack(
        [_face(normals, axis, np.cos(REACH), np.cos(_TIGHT), least) for axis in axes]
    )
    return directions, (directions != 0).any(axis=1)


def has_walls(errors: tuple[float | None, float | None, float | None]) -> bool:
    """Whether the sides of a part tell both horizontal axes of its box: its ``FaceErrors``."""
    return all(error is not None and error < _WALL_ERROR for error in errors[:2])


def square_rotations(normals: ArrayLike, up: ArrayLike) -> Array | None:
    """How an upright box may be turned whose sides are the walls that are seen.

    Args:
        normals: (n, 3), unit, of the part's surface; on which side of it does not matter.
        up: (3,), unit, the vertical in the frame of the normals.

    Returns:
        Its four rotations (4, 3, 3), the vertical as their third column, a quarter turn from one to
        the next; ``None`` where few walls are seen, or they are not at right angles.
    """
    normals, up = np.asarray(normals, dtype=float), np.asarray(up, dtype=float)
    level = frame_from_z(up)
    across = normals @ level
    walls = across[np.abs(across[:, 2]) < np.sin(_UPRIGHT)]
    # Four times its angle is the same for all four sides of a box.
    angles = 4.0 * np.arctan2(walls[:, 1], walls[:, 0])
    chosen = angles[:: max(len(angles) // _SEEDS, 1)]
    near = np.cos(chosen[:, None] - angles) > np.cos(4.0 * _TIGHT)
    counts = near.sum(axis=1)
    least = max(_LEAST_POINTS, _WALL_SHARE * len(normals), _SQUARE_SHARE * len(walls))
    if not len(walls) or counts.max() < least:
        return None
    middle = near[counts.argmax()]
    angle = np.angle(np.exp(1j * angles[middle]).sum()) / 4.0
    return np.stack(
        [
            level @ matrix_from_axis_angle([0.0, 0.0, angle + quarter * np.pi / 2.0])
            for quarter in range(4)
        ]
    )


def face_errors(targets: Sequence[Targets], num_parts: int) -> FaceErrors:
    """How far faces are from the axes of the boxes, in views whose boxes are known.

    Args:
        targets: of views of one category; of many, an even choice is looked at.
        num_parts: K.

    Returns:
        K times three errors.
    """
    apart: list[list[list[float]]] = [[[], [], []] for _ in range(num_parts)]
    chosen = np.linspace(0, len(targets) - 1, min(len(targets), _MOST_VIEWS)).round().astype(int)
    for target in [targets[i] for i in chosen]:
        points = target.points_level.astype(float)
        # Which side they point to does not matter.
        normals = surface_normals(points, np.arange(len(points)), np.zeros(3))
        for part in range(num_parts):
            on_part = target.part == part
            if on_part.sum() < _LEAST_POINTS:
                continue
            coordinates = target.npcs[on_part].astype(float)
            _, R_level_box, _ = umeyama(coordinates, points[on_part], np.ones(len(coordinates)))
            directions, found = face_directions(normals[on_part], R_level_box)
            cosines = np.sum(directions * R_level_box.T, axis=1).clip(-1.0, 1.0)
            for axis in np.flatnonzero(found):
                apart[part][axis].append(float(np.arccos(cosines[axis])))

    def error(angles: list[float]) -> float | None:
        if len(angles) < _LEAST_VIEWS:
            return None
        return round(float(np.median(angles)) / _RAYLEIGH_MEDIAN, 5)

    return tuple((error(x), error(y), error(z)) for x, y, z in apart)
