"""Finding the object in a depth image: the table's plane, and what stands on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]

from artgym.errors import InvalidArgumentError, NothingSeenError
from artgym.geometry.camera import points_from_depth

Array = NDArray[np.floating]

#: Points higher than this above the table belong to what stands on it, metres.
HEIGHT_ABOVE_TABLE = 0.004
#: The table's normal lies within this angle of the hint.
HINT_TOLERANCE = np.radians(25.0)
#: Distance of a plane's inliers, metres; it grows with the square of the depth, as noise does.
_PLANE_TOLERANCE = 0.004
#: Pieces nearer than this to the chosen one belong to the same object, metres.
_SAME_OBJECT_GAP = 0.10
#: Pieces with fewer pixels are noise.
_SMALLEST_PIECE = 20
#: A seen object has at least this many points.
MIN_OBJECT_POINTS = 64


@dataclass(frozen=True, kw_only=True, eq=False)
class ObjectView:
    """The points of one object in an image.

    Attributes:
        points_camera: float64 (M, 3), metres.
        colors: uint8 (M, 3).
        mask: bool (H, W), its pixels; points are in row-major order of them.
        up_camera: float64 (3,), the table's upward unit normal.
        table_camera: float64 (3,), a point of the table, metres.
    """

    points_camera: Array
    colors: NDArray[np.uint8]
    mask: NDArray[np.bool_]
    up_camera: Array
    table_camera: Array


def _fitted_normal(points: Array) -> tuple[Array, Array]:
    """Unit normal and centroid of the least-squares plane of points (n, 3)."""
    centroid = points.mean(axis=0)
    centred = points - centroid
    return np.linalg.eigh(centred.T @ centred)[1][:, 0], centroid


def fit_table(
    points_camera: ArrayLike,
    rng: np.random.Generator,
    up_camera_hint: ArrayLike | None = None,
    *,
    hypotheses: int = 200,
) -> tuple[Array, Array]:
    """The dominant plane of points (n, 3) in the camera frame, by RANSAC.

    Where much of the scene lies in a parallel plane shortly below the dominant one, the dominant
    one is the top of an object, and the lower is the table.

    Args:
        points_camera: (n, 3), metres.
        rng: chooses the minimal sets.
        up_camera_hint: the rough upward direction, when known.
        hypotheses: how many planes are tried.

    Returns:
        The upward unit normal (3,), towards the camera, and a point of the plane (3,).

    Raises:
        NothingSeenError: no plane fits the hint.
    """
    points = np.asarray(points_camera, dtype=float)
    if len(points) < 100:
        raise NothingSeenError(
            f"depth has {len(points)} valid pixels: expected at least 100 to see a table."
        )
    points = points[rng.choice(len(points), min(len(points), 3000), replace=False)]
    normal, origin, share = _ransac_plane(points, rng, up_camera_hint, hypotheses)
    height = (points - origin) @ normal
    below = points[(height < -3 * _PLANE_TOLERANCE) & (height > -0.4)]
    if len(below) > 0.15 * len(points):
        lower_normal, lower_origin, lower_share = _ransac_plane(below, rng, normal, hypotheses)
        if lower_share * len(below) > 0.3 * share * len(points) and lower_normal @ normal > np.cos(
            np.radians(8.0)
        ):
            normal, origin = lower_normal, lower_origin
    return normal, origin


def _ransac_plane(
    points: Array, rng: np.random.Generator, up_hint: ArrayLike | None, hypotheses: int
) -> tuple[Array, Array, float]:
    """Upward normal, a point, and the inlier share of the best plane."""
    triples = points[rng.integers(0, len(points), (hypotheses, 3))]
    normals = np.cross(triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0])
    lengths = np.linalg.norm(normals, axis=-1)
    valid = lengths > 1e-8
    normals = normals[valid] / lengths[valid, None]
    origins = triples[valid, 0]
    # Up is the side the camera, at the origin, is on.
    normals *= np.where((normals * origins).sum(axis=-1) > 0, -1.0, 1.0)[:, None]
    if up_hint is not None:
        hint = np.asarray(up_hint, dtype=float)
        aligned = normals @ (hint / np.linalg.norm(hint)) > np.cos(HINT_TOLERANCE)
        normals, origins = normals[aligned], origins[aligned]
    if not len(normals):
        raise NothingSeenError(
            "no plane in the depth image agrees with up_camera_hint. Check the sign of the hint "
            "(it points up, away from the table, in the camera frame), or leave it out."
        )
    tolerance = _PLANE_TOLERANCE * np.maximum(points[:, 2], 0.5) ** 2
    distances = np.abs(points @ normals.T - (origins * normals).sum(axis=-1))  # (n, h)
    best = np.argmax((distances < tolerance[:, None]).sum(axis=0))
    normal, origin = normals[best], origins[best]
    for _ in range(3):
        inliers = np.abs((points - origin) @ normal) < tolerance
        if inliers.sum() < 3:
            break
        refined, origin = _fitted_normal(points[inliers])
        normal = refined * np.sign(refined @ normal)
    return normal, origin, float(inliers.mean())


def segment_object(
    depth: ArrayLike,
    intrinsics: ArrayLike,
    rgb: ArrayLike,
    up_camera_hint: ArrayLike | None = None,
    exclude_mask: ArrayLike | None = None,
    *,
    rng: np.random.Generator,
) -> ObjectView:
    """The object that stands on the table in the middle of an image.

    Args:
        depth: (H, W), metres along z, 0 where unknown.
        intrinsics: (3, 3).
        rgb: uint8 (H, W, 3).
        up_camera_hint: rough upward direction in the camera frame, when known.
        exclude_mask: bool (H, W), pixels of the robot, when known.
        rng: for the plane fit.

    Raises:
        InvalidArgumentError: shapes do not agree.
        NothingSeenError: no table, or nothing stands on it.
    """
    depth = np.asarray(depth, dtype=float)
    rgb = np.asarray(rgb)
    if depth.ndim != 2 or rgb.shape != (*depth.shape, 3) or rgb.dtype != np.uint8:
        raise InvalidArgumentError(
            f"depth {depth.shape} must be (H, W) and rgb {rgb.shape} of dtype {rgb.dtype} must be "
            "uint8 (H, W, 3) of the same size."
        )
    seen = np.isfinite(depth) & (depth > 0)
    if exclude_mask is not None:
        exclude = np.asarray(exclude_mask, dtype=bool)
        if exclude.shape != depth.shape:
            raise InvalidArgumentError(
                f"exclude_mask {exclude.shape} must have the shape of depth, {depth.shape}."
            )
        seen &= ~exclude
    points = points_from_depth(np.where(seen, depth, 0.0), intrinsics)  # (H, W, 3)
    normal, origin = fit_table(points[seen], rng, up_camera_hint)
    above = seen & ((points - origin) @ normal > HEIGHT_ABOVE_TABLE)
    mask = _central_object(above, points)
    if mask.sum() < MIN_OBJECT_POINTS:
        raise NothingSeenError(
            f"only {int(mask.sum())} pixels stand out above the table: expected at least "
            f"{MIN_OBJECT_POINTS}. Bring the object into the middle of the image."
        )
    return ObjectView(
        points_camera=points[mask],
        colors=rgb[mask],
        mask=mask,
        up_camera=normal,
        table_camera=origin,
    )


def _central_object(above: NDArray[np.bool_], points: Array) -> NDArray[np.bool_]:
    """The pixels of the large central piece of ``above`` (H, W), and of pieces close to it."""
    # Neighbouring pixels far apart in depth are different things: a jump cuts the mask.
    z = np.where(above, points[..., 2], 0.0)
    jump = 0.02 + 0.02 * z
    connected = above.copy()
    connected[:, 1:] &= ~(above[:, :-1] & (np.abs(z[:, 1:] - z[:, :-1]) > jump[:, 1:]))
    connected[1:] &= ~(above[:-1] & (np.abs(z[1:] - z[:-1]) > jump[1:]))
    labelled = ndimage.label(connected, structure=np.ones((3, 3)))
    labels, count = cast(tuple[NDArray[np.int32], int], labelled)
    if count == 0:
        return connected
    pixels = np.flatnonzero(labels)
    piece_of_pixel = labels.flat[pixels]
    row, column = np.unravel_index(pixels, above.shape)
    off_center = np.hypot(row / above.shape[0] - 0.5, column / above.shape[1] - 0.5)
    weight = np.bincount(piece_of_pixel, np.exp(-((off_center / 0.25) ** 2)), count + 1)
    by_piece = pixels[np.argsort(piece_of_pixel, kind="stable")]
    pieces = np.split(by_piece, np.cumsum(np.bincount(piece_of_pixel, minlength=count + 1))[:-1])
    flat_points = points.reshape(-1, 3)
    # A few hundred points of a piece tell how near it is.
    clouds = [flat_points[piece[:: max(1, len(piece) // 400)]] for piece in pieces]
    frontier = [int(np.argmax(weight))]
    waiting = [k for k in range(1, count + 1) if len(pieces[k]) >= _SMALLEST_PIECE]
    waiting = [k for k in waiting if k != frontier[0]]
    taken = list(frontier)
    while frontier:
        tree = cKDTree(clouds[frontier.pop()])
        for k in list(waiting):
            nearest, _ = tree.query(clouds[k], distance_upper_bound=_SAME_OBJECT_GAP)
            if np.isfinite(nearest).any():
                waiting.remove(k)
                taken.append(k)
                frontier.append(k)
    mask = np.zeros(above.shape, dtype=bool)
    mask.flat[np.concatenate([pieces[k] for k in taken])] = True
    return mask
