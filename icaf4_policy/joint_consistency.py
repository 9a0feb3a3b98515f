"""Turns the fitted boxes of an object's parts until they agree with what links them.

The frames of a part and of the base differ by the motion of the joint alone: they have the same
axes after a slide, and after a turn share the joint's axis. The base of an object that stands
upright has the z axis of its box along the vertical. Fits from each part's own points miss that by
their errors, so that what one part is surer of helps the others. Taken are the turns that are most
probable, given how sure each fit is of each direction, the network of the axis, and who looks of
the vertical: the update of an iterated Kalman filter.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
#: How often the turns are worked out, each time about those of before.
_ITERATIONS = 2
#: The link of an upright base to the world, beside the codes of ``Sample.joint_type``.
_UPRIGHT = 2
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
        tilt: radians, standard deviation, in each direction, of an upright base's z axis from
            where the vertical is taken to be.
        worse: a part's fit may have its root-mean-square error grow by this share; a link that
            asks for more is left out. Points on a flat part hardly tell its depth from a turn, so
            that a fit that is better by half can still be the wrong one.
    """

    independent: float = 30.0
    axis_error: float = float(np.radians(6.0))
    tilt: float = float(np.radians(1.0))
    worse: float = 1.0

    def __post_init__(self) -> None:
        errors = (self.axis_error, self.tilt, self.worse)
        if not (self.independent > 0 and all(error >= 0 for error in errors)):
            raise InvalidArgumentError(
                f"independent={self.independent}, axis_error={self.axis_error}, tilt={self.tilt}, "
                f"worse={self.worse}: expected the first above 0, the others at least 0."
            )


def consistent_fits(
    fits: Sequence[PoseFit | None],
    nocs: Sequence[Array],
    points_camera: Sequence[Array],
    joint_types: Sequence[int],
    axes_camera: ArrayLike,
    config: ConsistencyConfig = ConsistencyConfig(),
    *,
    up_camera: ArrayLike | None = None,
) -> tuple[PoseFit | None, ...]:
    """The fits of K parts (base = 0), made to agree with the joints and with the vertical.

    Args:
        fits: of each part; ``None`` where it was not found.
        nocs: of each part, (n, 3), what it was fitted to.
        points_camera: of each part, (n, 3), metres.
        joint_types: (K,), codes of ``Sample.joint_type``.
        axes_camera: (K, 3), unit axes.
        config: how sure fits, axes and the vertical are.
        up_camera: (3,), unit: where the z axis of the base points, if the object stands upright.

    Returns:
        The fits, turned, with the size and position that suit the turned box best. A link that
        fits contradict has no effect; a fit without error stays.

    Raises:
        InvalidArgumentError: not all are of K parts.
    """
    axes = np.array(axes_camera, dtype=float).reshape(-1, 3)
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
    links = {k: joint_types[k] for k in parts if k > 0 and joint_types[k] != JOINT_NONE}
    if up_camera is not None:
        # Stands first: the base's own link, to the world.
        links = {0: _UPRIGHT, **links}
        axes[0] = up_camera
    while 0 in parts and links:
        linked = sorted({0, *links})
        turns, surprise = _most_probable_turns({k: parts[k] for k in linked}, links, axes, config)
        turned = {k: parts[k].turned(R) for k, R in turns.items()}
        if all(
            error <= (1.0 + config.worse) * parts[k].error + _ROUNDING
            for k, (_, error) in turned.items()
        ):
            return tuple(turned[k][0] if k in turned else fit for k, fit in enumerate(fits))
        del links[max(surprise, key=surprise.__getitem__)]
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


def _most_probable_turns(
    parts: Mapping[int, _Part], links: Mapping[int, int], axes: Array, config: ConsistencyConfig
) -> tuple[dict[int, Array], dict[int, float]]:
    """The turns that make linked parts agree.

    Returns:
        Rotations (3, 3) in the camera frame by part, and by link how far it is from what the fits
        say, in variances.
    """
    place = {k: slice(3 * i, 3 * i + 3) for i, k in enumerate(parts)}
    covariance = np.zeros((3 * len(parts), 3 * len(parts)))
    for k, part in parts.items():
        covariance[place[k], place[k]] = part.covariance(config.independent)
    turns = np.zeros(3 * len(parts))
    surprise: dict[int, float] = {}
    for _ in range(_ITERATIONS):
        R_turns = {k: matrix_from_axis_angle(turns[at]) for k, at in place.items()}
        R_camera = {k: R_turns[k] @ part.fit.T_camera_box[:3, :3] for k, part in parts.items()}
        # Of the parts' turns, H makes how far each link is off: a miss, that is noise.
        rows, misses, noise = [], [], []
        for k, link in links.items():
            row, miss, spread = _linearised(k, link, axes[k], R_camera, place, config)
            rows.append(row)
            misses.append(miss)
            noise += [spread**2] * len(miss)
        H, miss = np.concatenate(rows), np.concatenate(misses)
        innovation = H @ covariance @ H.T + np.diag(noise)
        if not surprise:
            ends = np.cumsum([len(each) for each in misses])[:-1]
            squares = np.split(miss**2 / np.diag(innovation), ends)
            surprise = {k: float(part.sum()) for k, part in zip(links, squares, strict=True)}
        turns = -covariance @ H.T @ np.linalg.solve(innovation, miss - H @ turns)
    return {k: matrix_from_axis_angle(turns[at]) for k, at in place.items()}, surprise


def _linearised(
    k: int,
    link: int,
    axis: Array,
    R_camera: Mapping[int, Array],
    place: Mapping[int, slice],
    config: ConsistencyConfig,
) -> tuple[Array, Array, float]:
    """How part k's link is off, and what small turns of the parts change of it.

    Returns:
        Rows (m, 3 K) over the parts' turns, the miss (m,), and its standard deviation, radians.
    """
    count = 3 * len(place)
    if link == _UPRIGHT:
        z = R_camera[k][:, 2]
        across = frame_from_z(z)[:, :2].T
        row = np.zeros((2, count))
        row[:, place[k]] = across
        # The turn from the vertical to where the base has it.
        turn = np.cross(axis, z)
        sine = np.linalg.norm(turn)
        angle = np.arctan2(sine, axis @ z)
        return row, across @ turn * (angle / max(sine, _EXACT)), config.tilt
    R_relative = R_camera[k] @ R_camera[0].T
    R_motion, across, spread = np.eye(3), np.eye(3), 0.0
    if link == JOINT_REVOLUTE:
        # The turn about the axis that comes nearest; what is left is across the axis.
        skewed = R_relative - R_relative.T
        sine = axis @ [skewed[2, 1], skewed[0, 2], skewed[1, 0]]
        q = np.arctan2(sine, np.trace(R_relative) - axis @ R_relative @ axis)
        R_motion = matrix_from_axis_angle(q * axis)
        across = frame_from_z(axis)[:, :2].T
        spread = 2.0 * np.sin(q / 2.0) * config.axis_error
    row = np.zeros((len(across), count))
    row[:, place[k]], row[:, place[0]] = across, -across @ R_motion
    miss = across @ axis_angle_from_matrix(R_relative @ R_motion.T)
    return row, miss, float(np.hypot(spread, _EXACT))
