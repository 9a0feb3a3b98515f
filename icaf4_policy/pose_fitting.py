"""Pose and size from corresponding points: Umeyama inside RANSAC, all hypotheses at once.

Paper, Section 5.2: the pose of a part follows from its normalised coordinates and its points in
the camera frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.errors import InvalidArgumentError
from artgym.geometry.transforms import transform_from

Array = NDArray[np.floating]

#: Points on which hypotheses are compared; the final fit uses all.
_SCORED_POINTS = 200


@dataclass(frozen=True, kw_only=True, eq=False)
class PoseFit:
    """A fitted box.

    Attributes:
        T_camera_box: float64 (4, 4). The box frame has the axes of the part (or object) frame and
            its origin where the normalised coordinates are 0.5: at the canonical box's centre.
        scale: metres of one normalised unit, the diagonal of the canonical box.
        inlier_share: share of the points that agree with the fit.
    """

    T_camera_box: Array
    scale: float
    inlier_share: float


def umeyama(source: ArrayLike, target: ArrayLike, weights: ArrayLike) -> tuple[Array, Array, Array]:
    """The similarity that maps source to target with least weighted squares (Umeyama, 1991).

    Args:
        source: (..., n, 3).
        target: (..., n, 3).
        weights: (..., n), not negative, not all zero.

    Returns:
        Scale s (...), rotation R (..., 3, 3) and translation t (..., 3) such that
        ``target = s R source + t``.
    """
    source, target = np.asarray(source, dtype=float), np.asarray(target, dtype=float)
    w = np.asarray(weights, dtype=float)
    w = (w / w.sum(axis=-1, keepdims=True))[..., None]
    mean_source, mean_target = (w * source).sum(axis=-2), (w * target).sum(axis=-2)
    centred_source = source - mean_source[..., None, :]
    centred_target = target - mean_target[..., None, :]
    covariance = np.swapaxes(w * centred_target, -1, -2) @ centred_source  # (..., 3, 3)
    U, singular, Vt = np.linalg.svd(covariance)
    sign = np.where(np.linalg.det(U @ Vt) < 0, -1.0, 1.0)
    signs = np.stack([np.ones_like(sign), np.ones_like(sign), sign], axis=-1)
    R = (U * signs[..., None, :]) @ Vt
    variance = (w * centred_source**2).sum(axis=(-2, -1))
    scale = (singular * signs).sum(axis=-1) / np.maximum(variance, 1e-12)
    t = mean_target - scale[..., None] * (R @ mean_source[..., None])[..., 0]
    return scale, R, t


def _squared_errors(source: Array, target: Array, scale: Array, R: Array, t: Array) -> Array:
    """(..., n): squared distances in metres for a stack of similarities."""
    mapped = source @ np.swapaxes(scale[..., None, None] * R, -1, -2) + t[..., None, :]
    return ((mapped - target) ** 2).sum(axis=-1)


def fit_pose(
    nocs: ArrayLike,
    points_camera: ArrayLike,
    rng: np.random.Generator,
    *,
    hypotheses: int = 100,
    tolerance: float = 0.05,
) -> PoseFit:
    """Fits a box to normalised coordinates and the points they belong to.

    Args:
        nocs: (n, 3), 0.5 at the box's centre, n >= 4.
        points_camera: (n, 3), metres.
        rng: chooses the minimal sets.
        hypotheses: how many sets of three points are tried.
        tolerance: largest error of an inlier, in normalised units; the spread of the points sets
            how many metres that is.

    Returns:
        The fit over all inliers of the best hypothesis, refined twice.
    """
    nocs = np.asarray(nocs, dtype=float) - 0.5
    points = np.asarray(points_camera, dtype=float)
    if nocs.shape != points.shape or nocs.ndim != 2 or nocs.shape[1] != 3 or len(nocs) < 4:
        raise InvalidArgumentError(
            f"nocs {nocs.shape} and points_camera {points.shape} must both have shape (n >= 4, 3)."
        )
    # Medians, because the outliers that RANSAC is for must not set its own tolerance.
    spread = [np.median(np.linalg.norm(a - np.median(a, axis=0), axis=1)) for a in (nocs, points)]
    limit = (tolerance * spread[1] / max(spread[0], 1e-6)) ** 2

    scored = rng.choice(len(nocs), min(len(nocs), _SCORED_POINTS), replace=False)
    # A repeated point makes a poor hypothesis, which loses; no need to draw without repetition.
    triples = rng.integers(0, len(nocs), (hypotheses, 3))
    s, R, t = umeyama(nocs[triples], points[triples], np.ones(3))
    errors = _squared_errors(nocs[scored], points[scored], s, R, t)  # (h, scored)
    # Truncated squared error ranks hypotheses more finely than the number of inliers.
    best = np.argmin(np.minimum(errors, limit).sum(axis=-1))
    s, R, t = s[best], R[best], t[best]
    inliers = _squared_errors(nocs, points, s, R, t) < limit
    for _ in range(2):
        if inliers.sum() < 3:
            break
        s, R, t = umeyama(nocs, points, inliers)
        inliers = _squared_errors(nocs, points, s, R, t) < limit
    return PoseFit(
        T_camera_box=transform_from(R, t), scale=float(s), inlier_share=float(inliers.mean())
    )
