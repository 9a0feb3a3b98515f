"""Turns the fitted boxes of an object's parts until they agree with the joints between them.

The frames of a part and of the base differ by the motion of the joint alone: they have the same
axes after a slide, and after a turn share the joint's axis. Fits from each part's own points miss
that by their errors, so that what one part is surer of helps the others. Taken are the small turns
that are most probable, given how sure each fit is of each direction and the network of the axis:
one linear update, as of a Kalman filter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.datasets.sample import JOINT_NONE, JOINT_REVOLUTE
from artgym.errors import InvalidArgumentError
from artgym.geometry.rotations import axis_angle_from_matrix, frame_from_z, matrix_from_axis_angle
from artgym.geometry.transforms import transform_from
from icaf4_policy.pose_fitting import TOLERANCE, PoseFit

Array = NDArray[np.floating]

#: Standard deviation of the turn that a joint itself leaves to chance, radians.
_EXACT = 1e-6
#: A fit without error may have so much after it was computed anew, in normalised units.
_ROUNDING = 1e-9
#: Points on one line still have so much of an arm for turns about it, in normalised units.
_NO_ARM = 0.01


@dataclass(frozen=True, kw_only=True)
class ConsistencyConfig:
    """How sure fits and axes are.

    Attributes:
        independent: points of a part that err independently; a network's errors at
            neighbouring points are alike, so that more points do not make a fit surer.
        axis_error: radians, standard deviation of a predicted axis in each direction.
        worse: a part's fit may have its root-mean-square error grow by this share; a joint that
            asks for more is left out. Points on a flat part hardly tell its depth from a turn, so
            that a fit that is better by half can still be the wrong one.
    """

    independent: float = 30.0
    axis_error: float = float(np.radians(6.0))
    worse: float = 1.0

    def __post_init__(self) -> None:
        if not (self.independent > 0 and self.axis_error >= 0 and self.worse >= 0):
            raise InvalidArgumentError(
                f"independent={self.independent}, axis_error={self.axis_error}, "
                f"worse={self.worse}: expected the first above 0, the others at least 0."
            )


def consistent_fits(
    fits: Sequence[PoseFit | None],
    nocs: Sequence[Array],
    points_camera: Sequence[Array],
    joint_types: Sequence[int],
    axes_camera: ArrayLike,
    config: ConsistencyConfig = ConsistencyConfig(),
) -> tuple[PoseFit | None, ...]:
    """The fits of K parts (base = 0), made to agree with the joints that link them to the base.

    Args:
        fits: of each part; ``None`` where it was not found.
        nocs: of each part, (n, 3), what it was fitted to.
        points_camera: of each part, (n, 3), metres.
        joint_types: (K,), codes of ``Sample.joint_type``.
        axes_camera: (K, 3), unit axes.
        config: how sure fits and axes are.

    Returns:
        The fits, turned, with the size and position that suit the turned box best. A joint that
        fits contradict has no effect; a fit without error stays.

    Raises:
        InvalidArgumentError: not all are of K parts.
    """
    axes = np.asarray(axes_camera, dtype=float).reshape(-1, 3)
    counts = [len(a) for a in (fits, nocs, points_camera, joint_types, axes)]
    if len(set(counts)) != 1:
        raise InvalidArgumentError(
            "fits, nocs, points_camera, joint_types and axes_camera must be of the same parts, not "
            f"of {', '.join(map(str, counts))}."
        )
    parts = {
        k: part
        for k, (fit, x, y) in enumerate(zip(fits, nocs, points_camera, strict=True))
        if fit is not None and (part := _Part.of(fit, np.asarray(x) - 0.5, np.asarray(y)))
    }
    joints = [k for k in parts if k > 0 and joint_types[k] != JOINT_NONE]
    while 0 in parts and joints:
        linked = [parts[k] for k in (0, *joints)]
        turns, surprise = _small_turns(
            linked, [joint_types[k] for k in joints], axes[joints], config
        )
        turned = [p.turned(R) for p, R in zip(linked, matrix_from_axis_angle(turns), strict=True)]
        limits = [(1.0 + config.worse) * part.error + _ROUNDING for part in linked]
        if all(error <= limit for (_, error), limit in zip(turned, limits, strict=True)):
            new = {k: fit for k, (fit, _) in zip((0, *joints), turned, strict=True)}
            return tuple(new.get(k, fit) for k, fit in enumerate(fits))
        joints.pop(int(np.argmax(surprise)))
    return tuple(fits)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Part:
    """A fit and the points that agree with it.

    Attributes:
        fit: of the part.
        nocs: (m, 3), 0 at the box's centre.
        points: (m, 3), camera frame, metres.
        error: root-mean-square error, in normalised units.
    """

    fit: PoseFit
    nocs: Array
    points: Array
    error: float

    @classmethod
    def of(cls, fit: PoseFit, nocs: Array, points: Array) -> _Part | None:
        """The inliers of a fit; None where there are less than four, or it has no size."""
        if fit.scale <= 0:
            return None
        squares = _squared_errors(fit, nocs, points)
        inliers = squares < TOLERANCE**2
        if inliers.sum() < 4:
            return None
        error = float(np.sqrt(squares[inliers].mean()))
        return cls(fit=fit, nocs=nocs[inliers], points=points[inliers], error=error)

    def covariance(self, independent: float) -> Array:
        """(3, 3), radians squared: of the small turn, camera frame, that the fit is off by."""
        turned = (self.nocs - self.nocs.mean(axis=0)) @ self.fit.T_camera_box[:3, :3].T
        scatter = turned.T @ turned / len(turned)
        # A point tells of turns about the axes it is off, by the square of the distance.
        information = (np.trace(scatter) + _NO_ARM**2) * np.eye(3) - scatter
        return self.error**2 / 3.0 / independent * np.linalg.inv(information)

    def turned(self, R_turn: Array) -> tuple[PoseFit, float]:
        """The fit after a turn in the camera frame, best size and place, and its new error."""
        R = R_turn @ self.fit.T_camera_box[:3, :3]
        turned, center = self.nocs @ R.T, self.points.mean(axis=0)
        middle = turned.mean(axis=0)
        scale = np.sum((turned - middle) * (self.points - center)) / np.sum((turned - middle) ** 2)
        fit = PoseFit(
            T_camera_box=transform_from(R, center - scale * middle),
            scale=float(scale),
            inlier_share=self.fit.inlier_share,
        )
        if scale <= 0:
            return fit, np.inf
        return fit, float(np.sqrt(_squared_errors(fit, self.nocs, self.points).mean()))


def _squared_errors(fit: PoseFit, nocs: Array, points: Array) -> Array:
    """(n,), in normalised units."""
    R, center = fit.T_camera_box[:3, :3], fit.T_camera_box[:3, 3]
    return (((points - center) @ (R / fit.scale) - nocs) ** 2).sum(axis=-1)


def _small_turns(
    parts: Sequence[_Part], joint_types: Sequence[int], axes: Array, config: ConsistencyConfig
) -> tuple[Array, Array]:
    """The turns that make base and J parts agree.

    Returns:
        Their rotation vectors (J + 1, 3), camera frame, and how far each joint (J,) is from what
        the fits say, in variances.
    """
    count = len(parts)
    covariance = np.zeros((3 * count, 3 * count))
    for k, part in enumerate(parts):
        covariance[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = part.covariance(config.independent)
    R_camera_base = parts[0].fit.T_camera_box[:3, :3]
    # Of the base's and the parts' turns, H makes how far each joint is off: a miss, that is noise.
    rows, misses, noise, of_joint = [], [], [], []
    for k, (joint_type, axis) in enumerate(zip(joint_types, axes, strict=True), start=1):
        R_relative = parts[k].fit.T_camera_box[:3, :3] @ R_camera_base.T
        R_motion, across, spread = np.eye(3), np.eye(3), 0.0
        if joint_type == JOINT_REVOLUTE:
            # The turn about the axis that comes nearest; what is left is across the axis.
            skewed = R_relative - R_relative.T
            sine = axis @ [skewed[2, 1], skewed[0, 2], skewed[1, 0]]
            q = np.arctan2(sine, np.trace(R_relative) - axis @ R_relative @ axis)
            R_motion = matrix_from_axis_angle(q * axis)
            across = frame_from_z(axis)[:, :2].T
            spread = 2.0 * np.sin(q / 2.0) * config.axis_error
        row = np.zeros((len(across), 3 * count))
        row[:, 3 * k : 3 * k + 3], row[:, :3] = across, -across @ R_motion
        rows.append(row)
        misses.append(across @ axis_angle_from_matrix(R_relative @ R_motion.T))
        noise += [spread**2 + _EXACT**2] * len(across)
        of_joint += [k - 1] * len(across)
    H, miss = np.concatenate(rows), np.concatenate(misses)
    innovation = H @ covariance @ H.T + np.diag(noise)
    solved = np.linalg.solve(innovation, miss)
    surprise: Array = np.bincount(of_joint, miss**2 / np.diag(innovation)).astype(float)
    return -(covariance @ H.T @ solved).reshape(count, 3), surprise
