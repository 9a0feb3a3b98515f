"""Turns the fitted boxes of an object's parts until they agree with what else is known of them.

The frames of a part and of the base differ by the motion of the joint alone: they have the same
axes after a slide, and after a turn share the joint's axis. Some axes are seen: the base of an
object that stands upright has the z axis of its box along the vertical, and flat faces lie across
the axes. Fits from each part's own points miss that by their errors, so that what one part is surer
of helps the others. Taken are the turns that are most probable, given how sure each fit is of each
direction, the network of the joint's axis, and who looks of the directions: the update of an
iterated Kalman filter.
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
        faces: whether faces count.
        face_error: radians, the same of a face's direction beside what ``faces.FaceErrors`` has.
        worst_face: radians; a face that told an axis worse than this in training does not count.
        worse: a part's fit may have its root-mean-square error grow by this share; a link that
            asks for more is left out. Points on a flat part hardly tell its depth from a turn, so
            that a fit that is better by half can still be the wrong one.
    """

    independent: float = 10.0
    axis_error: float = float(np.radians(6.0))
    tilt: float = float(np.radians(1.0))
    faces: bool = True
    face_error: float = float(np.radians(0.5))
    worst_face: float = float(np.radians(4.5))
    worse: float = 1.0

    def __post_init__(self) -> None:
        errors = (self.axis_error, self.tilt, self.face_error, self.worst_face, self.worse)
        if not (self.independent > 0 and all(error >= 0 for error in errors)):
            raise InvalidArgumentError(
                f"independent={self.independent}, axis_error={self.axis_error}, tilt={self.tilt}, "
                f"face_error={self.face_error}, worst_face={self.worst_face}, worse={self.worse}: "
                "expected the first above 0, the others at least 0."
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class AxisDirection:
    """Where an axis of a part's box points, by something else than the fit of the box.

    Attributes:
        part: whose box.
        axis: 0, 1 or 2.
        camera: (3,), unit, in the camera frame.
        error: radians, standard deviation in each direction across it.
    """

    part: int
    axis: int
    camera: Array
    error: float


def consistent_fits(
    fits: Sequence[PoseFit | None],
    nocs: Sequence[Array],
    points_camera: Sequence[Array],
    joint_types: Sequence[int],
    axes_camera: ArrayLike,
    config: ConsistencyConfig = ConsistencyConfig(),
    *,
    directions: Sequence[AxisDirection] = (),
) -> tuple[PoseFit | None, ...]:
    """The fits of K parts (base = 0), made to agree with the joints and with directions seen.

    Args:
        fits: of each part; ``None`` where it was not found.
        nocs: of each part, (n, 3), what it was fitted to.
        points_camera: of each part, (n, 3), metres.
        joint_types: (K,), codes of ``Sample.joint_type``.
        axes_camera: (K, 3), unit axes.
        config: how sure fits and axes are.
        directions: where axes point; those of parts without a fit are passed over.

    Returns:
        The fits, turned, with the size and position that suit the turned box best. A joint or a
        direction that fits contradict has no effect; a fit without error stays.

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
    links: list[_Link] = [each for each in directions if each.part in parts]
    links += [
        _Joint(part=k, joint_type=joint_types[k], axis_camera=axes[k])
        for k in parts
        if k > 0 and joint_types[k] != JOINT_NONE and 0 in parts
    ]
    while links:
        linked = {link.part for link in links}
        if any(isinstance(link, _Joint) for link in links):
            linked.add(0)
        turns, surprise = _most_probable_turns({k: parts[k] for k in sorted(linked)}, links, config)
        turned = {k: parts[k].turned(R) for k, R in turns.items()}
        if all(
            error <= (1.0 + config.worse) * parts[k].error + _ROUNDING
            for k, (_, error) in turned.items()
        ):
            return tuple(turned[k][0] if k in turned else fit for k, fit in enumerate(fits))
        del links[int(np.argmax(surprise))]
    return tuple(fits)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Joint:
    """What moves a part.

    Attributes:
        part: index.
        joint_type: code of ``Sample.joint_type``.
        axis_camera: (3,), unit.
    """

    part: int
    joint_type: int
    axis_camera: Array


#: What fits are made to agree with.
_Link = AxisDirection | _Joint


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
    parts: Mapping[int, _Part], links: Sequence[_Link], config: ConsistencyConfig
) -> tuple[dict[int, Array], list[float]]:
    """The turns that make linked parts agree.

    Returns:
        Rotations (3, 3) in the camera frame by part, and for each link how far it is from what the
        fits say, in variances.
    """
    place = {k: slice(3 * i, 3 * i + 3) for i, k in enumerate(parts)}
    covariance = np.zeros((3 * len(parts), 3 * len(parts)))
    for k, part in parts.items():
        covariance[place[k], place[k]] = part.covariance(config.independent)
    turns = np.zeros(3 * len(parts))
    surprise: list[float] = []
    for _ in range(_ITERATIONS):
        R_turns = {k: matrix_from_axis_angle(turns[at]) for k, at in place.items()}
        R_camera = {k: R_turns[k] @ part.fit.T_camera_box[:3, :3] for k, part in parts.items()}
        # Of the parts' turns, H makes how far each link is off: a miss, that is noise.
        rows, misses, noise = [], [], []
        for link in links:
            if isinstance(link, AxisDirection):
                row, miss = _direction_miss(link, R_camera, place)
                spread = link.error
            else:
                row, miss, spread = _joint_miss(link, R_camera, place, config.axis_error)
            rows.append(row)
            misses.append(miss)
            noise += [spread**2] * len(miss)
        H, miss = np.concatenate(rows), np.concatenate(misses)
        innovation = H @ covariance @ H.T + np.diag(noise)
        if not surprise:
            ends = np.cumsum([len(each) for each in misses])[:-1]
            squares = np.split(miss**2 / np.diag(innovation), ends)
            surprise = [float(each.sum()) for each in squares]
        turns = -covariance @ H.T @ np.linalg.solve(innovation, miss - H @ turns)
    return {k: matrix_from_axis_angle(turns[at]) for k, at in place.items()}, surprise


def _direction_miss(
    link: AxisDirection, R_camera: Mapping[int, Array], place: Mapping[int, slice]
) -> tuple[Array, Array]:
    """How an axis is off from its direction, and what small turns of the parts change of it.

    Returns:
        Rows (2, 3 K) over the parts' turns, and the miss (2,), radians.
    """
    axis = R_camera[link.part][:, link.axis]
    across = frame_from_z(axis)[:, :2].T
    rows = np.zeros((2, 3 * len(place)))
    rows[:, place[link.part]] = across
    # The turn from the direction to where the box has it.
    turn = np.cross(link.camera, axis)
    sine = np.linalg.norm(turn)
    angle = np.arctan2(sine, link.camera @ axis)
    return rows, across @ turn * (angle / max(sine, _EXACT))


def _joint_miss(
    link: _Joint, R_camera: Mapping[int, Array], place: Mapping[int, slice], axis_error: float
) -> tuple[Array, Array, float]:
    """How a joint is off, and what small turns of the parts change of it.

    Returns:
        Rows (m, 3 K) over the parts' turns, the miss (m,), and its standard deviation, radians.
    """
    axis = link.axis_camera
    R_relative = R_camera[link.part] @ R_camera[0].T
    R_motion, across, spread = np.eye(3), np.eye(3), 0.0
    if link.joint_type == JOINT_REVOLUTE:
        # The turn about the axis that comes nearest; what is left is across the axis.
        skewed = R_relative - R_relative.T
        sine = axis @ [skewed[2, 1], skewed[0, 2], skewed[1, 0]]
        q = np.arctan2(sine, np.trace(R_relative) - axis @ R_relative @ axis)
        R_motion = matrix_from_axis_angle(q * axis)
        across = frame_from_z(axis)[:, :2].T
        spread = 2.0 * np.sin(q / 2.0) * axis_error
    rows = np.zeros((len(across), 3 * len(place)))
    rows[:, place[link.part]], rows[:, place[0]] = across, -across @ R_motion
    miss = across @ axis_angle_from_matrix(R_relative @ R_motion.T)
    return rows, miss, float(np.hypot(spread, _EXACT))
