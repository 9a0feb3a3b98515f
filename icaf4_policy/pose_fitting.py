"""Pose and size from corresponding points: Umeyama inside RANSAC, compiled.

Paper, Section 5.2: the pose of a part follows from its normalised coordinates and its points in
the camera frame. The coordinates are a network's and the points are measured: what counts as an
outlier is decided in the coordinates.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.errors import InvalidArgumentError
from artgym.geometry.transforms import transform_from

Array = NDArray[np.floating]

#: Largest error of an inlier, in normalised units.
TOLERANCE = 0.05
#: Points on which hypotheses are compared; the final fit uses all.
_SCORED_POINTS = 200
#: How often the best hypothesis is fitted anew to its inliers, unless they stay the same before.
_REFINEMENTS = 5


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseFit:
    """A fitted box.

    Attributes:
        T_camera_box: float64 (4, 4). The box frame has the axes of the canonical box and
            its origin where the normalised coordinates are 0.5: at the canonical box's centre.
        scale: metres of one normalised unit, the diagonal of the canonical box; 0 where the
            coordinates tell nothing.
        inlier_share: share of the points that agree with the fit.
    """

    T_camera_box: Array
    scale: float
    inlier_share: float


def umeyama(source: ArrayLike, target: ArrayLike, weights: ArrayLike) -> tuple[float, Array, Array]:
    """The similarity that maps source to target with least weighted squares (Umeyama, 1991).

    Args:
        source: (n, 3).
        target: (n, 3).
        weights: (n,), not negative, not all zero.

    Returns:
        Scale s, rotation R (3, 3) and translation t (3,) such that ``target = s R source + t``.

    Raises:
        InvalidArgumentError: other shapes.
    """
    source, target, w = (np.ascontiguousarray(a, dtype=float) for a in (source, target, weights))
    if source.shape != (*w.shape, 3) or target.shape != source.shape or w.ndim != 1:
        raise InvalidArgumentError(
            f"source {source.shape}, target {target.shape} and weights {w.shape} must have shapes "
            "(n, 3), (n, 3) and (n,)."
        )
    return _similarity(source, target, w)


@numba.njit(cache=True)
def _similarity(source, target, weights):  # type: ignore[no-untyped-def]
    """``umeyama``, unchecked; scale 0 where the source is a single point."""
    total = 0.0
    mean_source, mean_target = np.zeros(3), np.zeros(3)
    for i in range(source.shape[0]):
        total += weights[i]
        for j in range(3):
            mean_source[j] += weights[i] * source[i, j]
            mean_target[j] += weights[i] * target[i, j]
    mean_source /= total
    mean_target /= total
    covariance, variance = np.zeros((3, 3)), 0.0
    for i in range(source.shape[0]):
        for k in range(3):
            b = weights[i] * (source[i, k] - mean_source[k])
            variance += b * (source[i, k] - mean_source[k])
            for j in range(3):
                covariance[j, k] += (target[i, j] - mean_target[j]) * b
    U, singular, Vt = np.linalg.svd(covariance)
    # A mirror image becomes the nearest rotation by a turn of the direction that matters least.
    if _determinant(U) * _determinant(Vt) < 0.0:
        singular[2] = -singular[2]
        for j in range(3):
            U[j, 2] = -U[j, 2]
    R, t = np.zeros((3, 3)), mean_target.copy()
    scale = singular.sum() / variance if variance > 0.0 else 0.0
    for j in range(3):
        for k in range(3):
            R[j, k] = U[j, 0] * Vt[0, k] + U[j, 1] * Vt[1, k] + U[j, 2] * Vt[2, k]
            t[j] -= scale * R[j, k] * mean_source[k]
    return scale, R, t


@numba.njit(cache=True)
def _determinant(A):  # type: ignore[no-untyped-def]
    return (
        A[0, 0] * (A[1, 1] * A[2, 2] - A[1, 2] * A[2, 1])
        + A[0, 1] * (A[1, 2] * A[2, 0] - A[1, 0] * A[2, 2])
        + A[0, 2] * (A[1, 0] * A[2, 1] - A[1, 1] * A[2, 0])
    )


@numba.njit(cache=True)
def _triangle_frame(a, b, c, frame):  # type: ignore[no-untyped-def]
    """Leaves in the rows of ``frame`` a triangle's first side, its normal's cross and its normal.

    False, and an undefined frame, for a triangle without area.
    """
    longest = 0.0
    for j in range(3):
        frame[0, j], frame[1, j] = b[j] - a[j], c[j] - a[j]
        longest = max(longest, abs(frame[0, j]), abs(frame[1, j]))
    for j in range(3):
        k, m = (j + 1) % 3, (j + 2) % 3
        frame[2, j] = frame[0, k] * frame[1, m] - frame[0, m] * frame[1, k]
    side = math.sqrt(frame[0, 0] ** 2 + frame[0, 1] ** 2 + frame[0, 2] ** 2)
    area = math.sqrt(frame[2, 0] ** 2 + frame[2, 1] ** 2 + frame[2, 2] ** 2)
    if area <= 1e-9 * longest * longest:
        return False
    for j in range(3):
        frame[0, j] /= side
        frame[2, j] /= area
    for j in range(3):
        k, m = (j + 1) % 3, (j + 2) % 3
        frame[1, j] = frame[2, k] * frame[0, m] - frame[2, m] * frame[0, k]
    return True


@numba.njit(cache=True)
def _from_triangle(source, target, triple, M, t):  # type: ignore[no-untyped-def]
    """Umeyama of three points: ``target = M source + t``. False where they lie on a line.

    The normals of both triangles fall together, and what remains is a turn in the plane.
    """
    frame_source, frame_target = np.empty((3, 3)), np.empty((3, 3))
    if not _triangle_frame(source[triple[0]], source[triple[1]], source[triple[2]], frame_source):
        return False
    if not _triangle_frame(target[triple[0]], target[triple[1]], target[triple[2]], frame_target):
        return False
    mean_source, mean_target = np.zeros(3), np.zeros(3)
    for i in triple:
        for j in range(3):
            mean_source[j] += source[i, j] / 3.0
            mean_target[j] += target[i, j] / 3.0
    cosine = sine = variance = 0.0
    for i in triple:
        x = y = u = v = 0.0
        for j in range(3):
            x += frame_source[0, j] * (source[i, j] - mean_source[j])
            y += frame_source[1, j] * (source[i, j] - mean_source[j])
            u += frame_target[0, j] * (target[i, j] - mean_target[j])
            v += frame_target[1, j] * (target[i, j] - mean_target[j])
        cosine += x * u + y * v
        sine += x * v - y * u
        variance += x * x + y * y
    # The turn and the scale together; the scale alone along the normal.
    c, s = cosine / variance, sine / variance
    scale = math.sqrt(c * c + s * s)
    for j in range(3):
        t[j] = mean_target[j]
        a, b = frame_target[0, j], frame_target[1, j]
        for k in range(3):
            M[j, k] = (c * a + s * b) * frame_source[0, k] + (c * b - s * a) * frame_source[1, k]
            M[j, k] += scale * frame_target[2, j] * frame_source[2, k]
            t[j] -= M[j, k] * mean_source[k]
    return True


@numba.njit(cache=True)
def _squared_error(source, target, M, t):  # type: ignore[no-untyped-def]
    """Of one point."""
    total = 0.0
    for j in range(3):
        d = M[j, 0] * source[0] + M[j, 1] * source[1] + M[j, 2] * source[2] + t[j] - target[j]
        total += d * d
    return total


@numba.njit(cache=True)
def _fit(nocs, points, triples, scored, limit):  # type: ignore[no-untyped-def]
    """The similarity from coordinates to points, and its inliers bool (n,)."""
    best, M, t = np.inf, np.empty((3, 3)), np.empty(3)
    best_M, best_t = np.zeros((3, 3)), np.zeros(3)
    for triple in triples:
        if not _from_triangle(points, nocs, triple, M, t):
            continue
        # Truncated squared error ranks hypotheses more finely than the number of inliers.
        cost = 0.0
        for i in scored:
            cost += min(_squared_error(points[i], nocs[i], M, t), limit)
            if cost >= best:
                break
        if cost < best:
            best = cost
            best_M[:], best_t[:] = M, t
    n = nocs.shape[0]
    inliers, before = np.ones(n, np.bool_), np.zeros(n, np.bool_)
    scale, R, center = _similarity(nocs, points, np.ones(n))
    if best == np.inf:
        # All in one place or on one line: no hypothesis is better than all points together.
        inverse, M, best_t = _similarity(points, nocs, np.ones(n))
        best_M = inverse * M
    for _ in range(_REFINEMENTS):
        count = 0
        for i in range(n):
            inliers[i] = _squared_error(points[i], nocs[i], best_M, best_t) < limit
            count += inliers[i]
        if count < 3 or np.all(inliers == before):
            break
        before[:] = inliers
        scale, R, center = _similarity(nocs, points, inliers.astype(np.float64))
        if scale <= 0.0:
            break
        for j in range(3):
            best_t[j] = 0.0
            for k in range(3):
                best_M[j, k] = R[k, j] / scale
                best_t[j] -= best_M[j, k] * center[k]
    return scale, R, center, inliers


def fit_pose(
    nocs: ArrayLike,
    points_camera: ArrayLike,
    rng: np.random.Generator,
    *,
    hypotheses: int = 200,
    tolerance: float = TOLERANCE,
) -> PoseFit:
    """Fits a box to normalised coordinates and the points they belong to.

    Args:
        nocs: (n, 3), 0.5 at the box's centre, n >= 4.
        points_camera: (n, 3), metres.
        rng: chooses the minimal sets.
        hypotheses: how many sets of three points are tried.
        tolerance: largest error of an inlier, in normalised units.

    Returns:
        The fit over all inliers of the best hypothesis, refined until these stay the same. Points
        without any pose, all in one place or on one line, give one of the fits that suit them.

    Raises:
        InvalidArgumentError: other shapes, or a coordinate that is not finite.
    """
    nocs = np.ascontiguousarray(nocs, dtype=float)
    points = np.ascontiguousarray(points_camera, dtype=float)
    n = len(nocs)
    if nocs.shape != points.shape or nocs.ndim != 2 or nocs.shape[1] != 3 or n < 4:
        raise InvalidArgumentError(
            f"nocs {nocs.shape} and points_camera {points.shape} must both have shape (n >= 4, 3)."
        )
    for name, values in (("nocs", nocs), ("points_camera", points)):
        if not np.isfinite(values).all():
            row = int(np.argmin(np.isfinite(values).all(axis=1)))
            raise InvalidArgumentError(
                f"{name}[{row}] is {values[row].tolist()}: leave out points that are not finite."
            )
    scored = rng.choice(n, min(n, _SCORED_POINTS), replace=False)
    # A repeated point makes no triangle and is passed over; no need to draw without repetition.
    triples = rng.integers(0, n, (hypotheses, 3))
    scale, R, center, inliers = _fit(nocs - 0.5, points, triples, scored, tolerance**2)
    return PoseFit(
        T_camera_box=transform_from(R, center),
        scale=float(scale),
        inlier_share=float(inliers.mean()),
    )


def fit_turned(
    nocs: ArrayLike,
    points_camera: ArrayLike,
    R_camera_box: ArrayLike,
    *,
    tolerance: float = TOLERANCE,
) -> PoseFit:
    """Fits the place and size of a box whose rotation is known.

    Args:
        nocs: (n, 3), 0.5 at the box's centre.
        points_camera: (n, 3), metres.
        R_camera_box: (3, 3).
        tolerance: largest error of an inlier, in normalised units.

    Returns:
        The fit to the nearer points, found anew a few times; of no size where the coordinates run
        against the points.
    """
    centered, points = np.asarray(nocs, dtype=float) - 0.5, np.asarray(points_camera, dtype=float)
    R = np.asarray(R_camera_box, dtype=float)
    turned = centered @ R.T
    near = np.ones(len(points), dtype=bool)
    errors = np.full(len(points), np.inf)
    scale, center = 0.0, points.mean(axis=0)
    for _ in range(_REFINEMENTS):
        middle, center = turned[near].mean(axis=0), points[near].mean(axis=0)
        arms = turned[near] - middle
        scale = float(np.sum(arms * (points[near] - center)) / max(np.sum(arms**2), 1e-12))
        if scale <= 0.0:
            scale, errors = 0.0, np.full(len(points), np.inf)
            break
        center = center - scale * middle
        errors = np.linalg.norm((points - center) @ R / scale - centered, axis=1)
        near = errors <= max(tolerance, 1.5 * float(np.median(errors)))
    return PoseFit(
        T_camera_box=transform_from(R, center),
        scale=scale,
        inlier_share=float(np.mean(errors < tolerance)),
    )
