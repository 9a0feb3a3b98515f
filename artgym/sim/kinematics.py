"""Where the Panda's joints bring its hand, and which joints bring its hand to a pose.

The chain is that of the Panda's description. Its frames are the description's: the base is
``panda_link0``, the hand ``panda_hand``. Nothing here knows the simulator's state.
"""

from __future__ import annotations

import functools
import itertools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.errors import AssetError, InvalidArgumentError
from artgym.geometry import transforms
from artgym.geometry.rotations import axis_angle_from_matrix, matrix_from_axis_angle
from artgym.objects.assembly import RawModel
from artgym.objects.urdf import parse_urdf
from artgym.sim.robots import panda_meshes

Array = NDArray[np.floating]

#: Number of the arm's joints.
NUM_JOINTS = 7
#: The posture that the arm comes back to where the hand's pose leaves a choice, radians.
REST: Array = np.array([0.0, np.pi / 8, 0.0, -5 * np.pi / 8, 0.0, 3 * np.pi / 4, np.pi / 4])
#: How far the arm keeps off the ends of its joints' ranges, radians.
LIMIT_MARGIN = 0.02
#: A pose counts as reached within these, metres and radians.
POSITION_TOLERANCE, ROTATION_TOLERANCE = 0.005, 0.05
#: How far the middle of a base keeps from the object and from the hand, metres.
BASE_CLEARANCE = 0.25

#: The arm's links from its base on, as its description calls them.
ARM_LINKS = tuple(f"panda_link{i}" for i in range(NUM_JOINTS + 1))

# Joints 2 to 7 where a search starts, and how far the first is turned away from the pose.
_STARTS = np.array(
    [
        [*REST[1:], 0.0],
        [-0.4, 0.0, -2.2, 0.0, 1.0, 0.8, 0.0],
        [0.4, 0.0, -2.2, 1.6, 2.4, -0.8, 0.0],
        [0.4, 0.0, -2.2, -1.6, 2.4, 2.3, 0.0],
        [0.4, -1.5, -1.2, -1.6, 2.4, -0.8, 0.0],
        [0.4, 1.5, -1.2, 1.6, 2.4, 2.3, 0.0],
        [-0.4, 0.0, -2.2, -1.6, 1.0, -2.2, 0.0],
        [-0.4, 0.0, -2.2, 1.6, 2.4, -0.8, np.pi],
        [-0.4, 1.5, -2.2, -1.6, 2.4, -0.8, np.pi],
        [-0.4, -1.5, -2.2, 1.6, 2.4, 2.4, np.pi],
        [-1.2, -1.5, -2.2, 0.0, 2.4, -2.2, np.pi],
        [-1.2, 1.5, -2.2, 0.0, 2.4, 2.2, np.pi],
        [1.4, 1.5, -2.8, 0.0, 3.5, -2.2, 0.0],
    ]
)
# Of one search: most iterations, after how many without headway it is given up, and how near the
# pose, metres, the error may grow while the arm comes back to its rest posture.
_ITERATIONS, _PATIENCE, _NEAR = 60, 12, 1e-4
# Of one iteration: most that a joint moves, radians; metres of error that weigh as much as a
# radian; the share of the way to the rest posture that is made where the hand's pose allows it.
_STEP, _METRES_A_RADIAN, _PULL = 0.4, 0.25, 0.05
# A posture is as good as any when its joints are this far from their ends, radians, and its
# manipulability (Yoshikawa 1985, the root of det J J^T) is this.
_EASY_MARGIN, _EASY_MANIPULABILITY = 0.4, 0.05
# Half the thickness of the arm, metres.
_THICKNESS = 0.05

# Bases that are tried: directions about the hand's poses, distances from their middle and heights
# above the table, metres; a height is high enough when the path is this good from there.
_AZIMUTHS, _DISTANCES = 24, np.arange(0.3, 0.85, 0.1)
_HEIGHTS, _ENOUGH = np.arange(0.0, 1.25, 0.15), 0.4
# A path is followed in steps of at most this many metres and radians.
_PATH_STEP, _PATH_TURN = 0.1, 0.3


@functools.cache
def panda_description() -> RawModel:
    """The Panda as its description in the installed mani_skill package has it.

    Raises:
        MissingDependencyError: mani_skill is not installed.
        AssetError: the description cannot be used.
    """
    return parse_urdf(panda_meshes().parents[2] / "panda_v2.urdf")


@dataclass(frozen=True, kw_only=True, eq=False)
class Chain:
    """The arm from its base to its hand.

    Attributes:
        frames: (8, 4, 4); of the seven joints in their parent links, where they turn about z, and
            of the hand in the last link.
        lower, upper: (7,) ends of the joints' ranges, radians.
        radius: no hand's mount (the origin of the last joint) is farther than this from the
            shoulder (the origin of the second joint), metres.
    """

    frames: Array
    lower: Array
    upper: Array
    radius: float


@functools.cache
def panda_chain() -> Chain:
    """The Panda's chain.

    Raises:
        MissingDependencyError: mani_skill is not installed.
        AssetError: the description cannot be used.
    """
    model = panda_description()
    joints = {joint.child: joint for joint in model.joints}
    frames, ranges = [], []
    for parent, child in itertools.pairwise(ARM_LINKS):
        joint = joints.get(child)
        if joint is None or joint.parent != parent or joint.axis != (0.0, 0.0, 1.0):
            raise AssetError(
                model.file,
                f"no joint about z between {parent} and {child}",
                remedy="Install the release of mani_skill that artgym asks for.",
            )
        frames.append(joint.T_parent_joint)
        ranges.append((joint.lower, joint.upper))
    T_link7_hand, link = np.eye(4), "panda_hand"
    while link != ARM_LINKS[-1]:
        T_link7_hand = joints[link].T_parent_joint @ T_link7_hand
        link = joints[link].parent
    lower, upper = np.array(ranges).T
    return Chain(
        frames=np.stack([*frames, T_link7_hand]),
        lower=lower,
        upper=upper,
        radius=float(sum(np.linalg.norm(T[:3, 3]) for T in frames[2:])),
    )


class Solution(NamedTuple):
    """The joints that bring the hand nearest to a pose.

    Attributes:
        q: (7,) joint positions, radians, inside their ranges.
        position_error, rotation_error: how far from the pose the hand then is, metres and radians.
    """

    q: Array
    position_error: float
    rotation_error: float

    @property
    def reached(self) -> bool:
        """Whether the hand is at the pose."""
        return _is_reached(self.position_error, self.rotation_error)


def link_poses(q: ArrayLike) -> Array:
    """Where joint positions (7,), radians, bring the links.

    Returns:
        ``Ts_base_link`` (9, 4, 4): ``panda_link0`` to ``panda_link7`` and the hand.
    """
    chain = panda_chain()
    turns = transforms.transform_from(
        matrix_from_axis_angle(np.asarray(q, dtype=float)[:, None] * [0.0, 0.0, 1.0]), np.zeros(3)
    )
    poses = [np.eye(4)]
    for T_parent_joint, T_joint_link in zip(chain.frames, [*turns, np.eye(4)], strict=True):
        poses.append(poses[-1] @ T_parent_joint @ T_joint_link)
    return np.stack(poses)


def solve(
    T_base_hand: ArrayLike, start: ArrayLike | None = None, *, floor: float = -math.inf
) -> Solution:
    """The joint positions that bring the hand to a pose, or as near as it can come.

    Damped least squares on the pose, inside the joints' ranges; what freedom is left draws the arm
    to its rest posture. Equal arguments give equal results.

    Args:
        T_base_hand: the pose (4, 4) in the base's frame.
        start: (7,) where the search starts; by default several postures, and of those found the
            one farthest from the ends of its joints and from singularities.
        floor: the arm stays above this height of the base's frame where no start is given, metres.

    Raises:
        InvalidArgumentError: a pose or a start of another shape, or not finite.
    """
    T = _checked("T_base_hand", T_base_hand, (4, 4))
    if start is None:
        q = np.empty(NUM_JOINTS)
        position_error, rotation_error, _ = _search(*_chain_arrays(), T, floor, q)
    else:
        q = _checked("start", start, (NUM_JOINTS,)).copy()
        position_error, rotation_error = _descend(*_chain_arrays(), T, q)
    return Solution(q, position_error, rotation_error)


def reachable(Ts_base_hand: ArrayLike) -> NDArray[np.bool_]:
    """Whether the hand comes to poses (n, 4, 4) in the base's frame, from any posture.

    Raises:
        InvalidArgumentError: poses of another shape, or not finite.
    """
    Ts = _checked("Ts_base_hand", Ts_base_hand, (-1, 4, 4))
    q, arrays = np.empty(NUM_JOINTS), _chain_arrays()
    found = [_is_reached(*_search(*arrays, T, -math.inf, q)[:2]) for T in Ts]
    return np.array(found, dtype=bool)


def choose_base(Ts_world_hand: ArrayLike, *, object_bounds: ArrayLike | None = None) -> Array:
    """Where the base of an arm stands whose hand shall follow a path.

    On the table if the arm gets there, which is its top at z = 0, and else on a column as low as
    can be, of at most 1.2 m. The arm takes the posture at the first pose that ``solve`` finds and
    follows the path without leaving hold of it; of the places that allow it the one is taken
    that is farthest from the ends of the joints and from singularities.

    Args:
        Ts_world_hand: the poses (n, 4, 4) in their order; between them the hand goes straight.
        object_bounds: lowest and highest corner (2, 3) of a box, world frame, that the base keeps
            away from by ``BASE_CLEARANCE`` and the arm, where it can, out of.

    Returns:
        ``T_world_base`` (4, 4), upright.

    Raises:
        InvalidArgumentError: no base serves all poses, or arguments of another shape or not
            finite.
    """
    poses = _checked("Ts_world_hand", Ts_world_hand, (-1, 4, 4))
    if not len(poses):
        raise InvalidArgumentError("Ts_world_hand: expected at least one pose, got none")
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    if object_bounds is not None:
        low, high = _checked("object_bounds", object_bounds, (2, 3))
    path = _finely(poses)
    places = _base_places(path, low, high)
    best, T_best = 0.0, None
    for height in _HEIGHTS:
        Ts_world_base = places @ transforms.translation([0.0, 0.0, height])
        for T_world_base in Ts_world_base[_near_enough(path, Ts_world_base)]:
            Ts_base_hand = transforms.invert(T_world_base) @ path
            rating = _rate_path(*_chain_arrays(), Ts_base_hand, T_world_base, low, high)
            if rating > best:
                best, T_best = rating, T_world_base
            if best >= 1.0:
                break
        if best >= _ENOUGH:
            break
    if T_best is None:
        low, high = poses[:, :3, 3].min(axis=0).round(3), poses[:, :3, 3].max(axis=0).round(3)
        raise InvalidArgumentError(
            f"Ts_world_hand: no place of the base lets the hand follow all {len(poses)} poses, "
            f"which lie between {low.tolist()} and {high.tolist()} m; an arm reaches "
            f"{panda_chain().radius:.2f} m from its shoulder: shorten the path, or choose another "
            "grasp"
        )
    return T_best


def _checked(name: str, value: ArrayLike, shape: tuple[int, ...]) -> Array:
    array = np.ascontiguousarray(value, dtype=float)
    fits = array.ndim == len(shape) and all(
        expected in (-1, got) for expected, got in zip(shape, array.shape, strict=True)
    )
    if not fits or not np.isfinite(array).all():
        wanted = ", ".join("n" if size < 0 else str(size) for size in shape)
        raise InvalidArgumentError(
            f"{name}: expected finite numbers of shape ({wanted}), got shape {array.shape}"
            + (f" with values {array[~np.isfinite(array)][:3]}" if fits else "")
        )
    return array


def _is_reached(position_error: float, rotation_error: float) -> bool:
    return position_error < POSITION_TOLERANCE and rotation_error < ROTATION_TOLERANCE


def _finely(poses: Array) -> Array:
    """The path (m, 4, 4) through poses (n, 4, 4), with steps as small as a path is followed in."""
    path = [poses[:1]]
    for T_from, T_to in itertools.pairwise(poses):
        move = T_to[:3, 3] - T_from[:3, 3]
        turn = axis_angle_from_matrix(T_to[:3, :3] @ T_from[:3, :3].T)
        steps = max(np.linalg.norm(move) / _PATH_STEP, np.linalg.norm(turn) / _PATH_TURN, 1.0)
        shares = np.linspace(0.0, 1.0, math.ceil(steps) + 1)[1:, None]
        R = matrix_from_axis_angle(shares * turn) @ T_from[:3, :3]
        path.append(transforms.transform_from(R, T_from[:3, 3] + shares * move))
    return np.concatenate(path)


def _base_places(path: Array, low: Array, high: Array) -> Array:
    """Bases (m, 4, 4) on the table that face the path, clear of it and of the object's box."""
    middle = 0.5 * (path[:, :2, 3].min(axis=0) + path[:, :2, 3].max(axis=0))
    # Where several places are as good the first is taken: behind the hand, and where it points
    # downwards, in front of the objects, which face +x.
    ahead = path[:, :2, 2].mean(axis=0)
    behind = math.atan2(ahead[1], ahead[0]) if np.linalg.norm(ahead) > 0.1 else math.pi
    order = np.arange(_AZIMUTHS)
    sides = (order + 1) // 2 * np.where(order % 2, 1, -1)
    azimuths, distances = np.meshgrid(
        behind + sides * 2 * np.pi / _AZIMUTHS, _DISTANCES, indexing="ij"
    )
    yaws = azimuths.ravel()
    facing = np.stack([np.cos(yaws), np.sin(yaws)], axis=-1)
    places = middle - distances.ravel()[:, None] * facing
    from_hand = np.linalg.norm(places[:, None] - path[:, :2, 3], axis=-1).min(axis=1)
    from_box = np.linalg.norm(
        np.maximum(np.maximum(low[:2] - places, places - high[:2]), 0.0), axis=-1
    )
    clear = (from_hand >= BASE_CLEARANCE) & (from_box >= BASE_CLEARANCE)
    turns = matrix_from_axis_angle(yaws[clear, None] * [0.0, 0.0, 1.0])
    return transforms.transform_from(turns, np.pad(places[clear], ((0, 0), (0, 1))))


def _near_enough(path: Array, Ts_world_base: Array) -> NDArray[np.bool_]:
    """Of which bases (b, 4, 4) no pose of the path is beyond the arm's length."""
    chain = panda_chain()
    mounts = (path @ transforms.invert(chain.frames[-1]))[:, :3, 3]
    shoulders = (Ts_world_base @ chain.frames[0] @ chain.frames[1])[:, :3, 3]
    away = np.linalg.norm(mounts - shoulders[:, None], axis=-1)
    return away.max(axis=1) <= chain.radius


@functools.cache
def _chain_arrays() -> tuple[Array, Array, Array]:
    """The chain as the compiled functions take it: frames, least and greatest positions."""
    chain = panda_chain()
    return chain.frames, chain.lower + LIMIT_MARGIN, chain.upper - LIMIT_MARGIN


@numba.njit(cache=True)
def _rate_path(frames, lower, upper, Ts_base_hand, T_world_base, low, high):  # type: ignore[no-untyped-def]
    """How well a path (n, 4, 4) is followed: least goodness less the share inside the box.

    Zero, or less, where it cannot be followed.
    """
    q = np.empty(7)
    points = np.empty((4, 3))
    floor = -T_world_base[2, 3]
    worst, inside = 1.0, 0.0
    count = Ts_base_hand.shape[0]
    for i in range(count):
        if i == 0:
            position_error, rotation_error, _ = _search(
                frames, lower, upper, Ts_base_hand[i], floor, q
            )
        else:
            position_error, rotation_error = _descend(frames, lower, upper, Ts_base_hand[i], q)
        if position_error >= POSITION_TOLERANCE or rotation_error >= ROTATION_TOLERANCE:
            return 0.0
        worst = min(worst, _goodness(frames, lower, upper, q, floor, points))
        if worst <= 0.0:
            return 0.0
        for point in points:
            within = True
            for k in range(3):
                world = T_world_base[k, 3]
                for j in range(3):
                    world += T_world_base[k, j] * point[j]
                within &= low[k] - _THICKNESS < world < high[k] + _THICKNESS
            if within:
                inside += 1.0 / (count * len(points))
    return worst - inside


@numba.njit(cache=True)
def _search(frames, lower, upper, T_base_hand, floor, q):  # type: ignore[no-untyped-def]
    """Descends from all starts and leaves the best in ``q``; its two errors and its goodness."""
    trial, points = np.empty(7), np.empty((4, 3))
    best_position = best_rotation = np.inf
    best = -1.0
    for start in _STARTS:
        azimuth = math.atan2(T_base_hand[1, 3], T_base_hand[0, 3]) + start[6]
        azimuth -= 2 * math.pi * math.floor(azimuth / (2 * math.pi) + 0.5)
        trial[0] = min(max(azimuth, lower[0]), upper[0])
        trial[1:] = start[:6]
        position_error, rotation_error = _descend(frames, lower, upper, T_base_hand, trial)
        reached = position_error < POSITION_TOLERANCE and rotation_error < ROTATION_TOLERANCE
        goodness = _goodness(frames, lower, upper, trial, floor, points) if reached else -1.0
        nearer = (
            position_error + _METRES_A_RADIAN * rotation_error
            < best_position + _METRES_A_RADIAN * best_rotation
        )
        if goodness > best or (best < 0.0 and goodness < 0.0 and nearer):
            best, best_position, best_rotation = goodness, position_error, rotation_error
            q[:] = trial
        if best >= 1.0:
            break
    return best_position, best_rotation, best


@numba.njit(cache=True)
def _goodness(frames, lower, upper, q, floor, points):  # type: ignore[no-untyped-def]
    """In [0, 1]: how far a posture is from the joints' ends and from singularities.

    Zero below the floor. Leaves the elbow, the middle of the forearm, the wrist and the mount of
    the hand in ``points`` (4, 3).
    """
    axes, origins = np.empty((7, 3)), np.empty((7, 3))
    R, t = np.empty((3, 3)), np.empty(3)
    J, A = np.empty((6, 7)), np.empty((6, 6))
    _forward(frames, q, axes, origins, R, t)
    points[0] = origins[3]
    points[1] = 0.5 * (origins[3] + origins[5])
    points[2] = origins[5]
    points[3] = origins[6]
    for point in points:
        if point[2] - _THICKNESS < floor:
            return 0.0
    margin = np.inf
    for k in range(7):
        margin = min(margin, q[k] - lower[k], upper[k] - q[k])
    _jacobian(axes, origins, t, 1.0, J)
    _gram(J, 1e-12, A)
    _factorise(A)
    manipulability = 1.0
    for i in range(6):
        manipulability *= A[i, i]
    return max(0.0, min(1.0, margin / _EASY_MARGIN, manipulability / _EASY_MANIPULABILITY))


@numba.njit(cache=True)
def _descend(frames, lower, upper, T_base_hand, q):  # type: ignore[no-untyped-def]
    """Brings ``q`` (7,) to where the hand is at a pose or nearest to it; its two errors.

    Each iteration is a Levenberg-Marquardt step whose damping falls with the squared error
    (Sugihara 2011), shortened until the error does not grow.
    """
    axes, origins = np.empty((7, 3)), np.empty((7, 3))
    R, t = np.empty((3, 3)), np.empty(3)
    J, error, step, best = np.empty((6, 7)), np.empty(6), np.zeros(7), np.empty(7)
    for k in range(7):
        q[k] = min(max(q[k], lower[k]), upper[k])
    least, best_position, best_rotation = np.inf, np.inf, np.inf
    scale, largest, waited = 1.0, np.inf, 0
    for _ in range(_ITERATIONS):
        _forward(frames, q, axes, origins, R, t)
        position_error, rotation_error = _miss(T_base_hand, R, t, error)
        squared = position_error**2 + (_METRES_A_RADIAN * rotation_error) ** 2
        waited = 0 if squared < 0.9 * least else waited + 1
        if squared <= max(least, _NEAR**2):
            least, best_position, best_rotation = squared, position_error, rotation_error
            best[:] = q
            at_pose = squared < 1e-12
            if (at_pose and largest < 1e-4) or (waited > _PATIENCE and squared > _NEAR**2):
                break
            error[3:] *= _METRES_A_RADIAN
            _jacobian(axes, origins, t, _METRES_A_RADIAN, J)
            largest = _damped_step(J, error, 0.05 * squared + 1e-8, lower, upper, q, step)
            scale = min(1.0, _STEP / largest) if largest > 0.0 else 1.0
        else:
            # Too far: less of the same step.
            scale *= 0.5
            if waited > _PATIENCE:
                break
        for k in range(7):
            q[k] = min(max(best[k] + scale * step[k], lower[k]), upper[k])
    q[:] = best
    return best_position, best_rotation


@numba.njit(cache=True)
def _damped_step(J, error, damping, lower, upper, q, step):  # type: ignore[no-untyped-def]
    """The step (7,) towards less error and to the rest posture; its largest component.

    step = n + J^T (J J^T + damping)^-1 (error - J n), with n the pull to the rest posture. Joints
    at an end of their range that it would leave take no part.
    """
    A, y = np.empty((6, 6)), np.empty(6)
    J = J.copy()
    pull = np.empty(7)
    for k in range(7):
        pull[k] = _PULL * (REST[k] - q[k])
    largest = 0.0
    for _ in range(7):
        for i in range(6):
            y[i] = error[i]
            for k in range(7):
                y[i] -= J[i, k] * pull[k]
        _gram(J, damping, A)
        _factorise(A)
        _substitute(A, y)
        largest, leaves = 0.0, False
        for k in range(7):
            step[k] = pull[k]
            for i in range(6):
                step[k] += J[i, k] * y[i]
            if (q[k] <= lower[k] and step[k] < 0.0) or (q[k] >= upper[k] and step[k] > 0.0):
                leaves = True
                J[:, k] = pull[k] = 0.0
            largest = max(largest, abs(step[k]))
        if not leaves:
            break
    return largest


@numba.njit(cache=True)
def _forward(frames, q, axes, origins, R, t):  # type: ignore[no-untyped-def]
    """Axes (7, 3) and origins (7, 3) of the joints, R (3, 3) and t (3,) of the hand; base frame."""
    for i in range(3):
        t[i] = 0.0
        for j in range(3):
            R[i, j] = 1.0 if i == j else 0.0
    for k in range(8):
        F = frames[k]
        # The hand sits firmly on the last link.
        cosine, sine = (math.cos(q[k]), math.sin(q[k])) if k < 7 else (1.0, 0.0)
        for i in range(3):
            a, b, c = R[i, 0], R[i, 1], R[i, 2]
            t[i] += a * F[0, 3] + b * F[1, 3] + c * F[2, 3]
            x = a * F[0, 0] + b * F[1, 0] + c * F[2, 0]
            y = a * F[0, 1] + b * F[1, 1] + c * F[2, 1]
            z = a * F[0, 2] + b * F[1, 2] + c * F[2, 2]
            R[i, 0], R[i, 1], R[i, 2] = cosine * x + sine * y, cosine * y - sine * x, z
            if k < 7:
                axes[k, i], origins[k, i] = z, t[i]


@numba.njit(cache=True)
def _miss(T_base_hand, R, t, error):  # type: ignore[no-untyped-def]
    """The way (6,) from a pose R, t to the one asked for: metres, then a rotation vector."""
    E = np.empty((3, 3))
    for i in range(3):
        error[i] = T_base_hand[i, 3] - t[i]
        for j in range(3):
            E[i, j] = 0.0
            for k in range(3):
                E[i, j] += T_base_hand[i, k] * R[j, k]
    x, y, z = 0.5 * (E[2, 1] - E[1, 2]), 0.5 * (E[0, 2] - E[2, 0]), 0.5 * (E[1, 0] - E[0, 1])
    sine = math.sqrt(x * x + y * y + z * z)
    angle = math.atan2(sine, 0.5 * (E[0, 0] + E[1, 1] + E[2, 2] - 1.0))
    if sine > 1e-6:
        scale = angle / sine
    elif angle < 1.0:
        scale = 1.0
    else:
        # Half a turn: E + I is twice the axis times itself; its longest column gives the axis.
        m = 0
        for k in range(1, 3):
            if E[k, k] > E[m, m]:
                m = k
        x, y, z = E[0, m] + (m == 0), E[1, m] + (m == 1), E[2, m] + (m == 2)
        scale = angle / math.sqrt(x * x + y * y + z * z)
    error[3], error[4], error[5] = scale * x, scale * y, scale * z
    return math.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2), angle


@numba.njit(cache=True)
def _jacobian(axes, origins, t, weight, J):  # type: ignore[no-untyped-def]
    """J (6, 7) of the hand's origin, and of its rotation times a weight; base frame."""
    for k in range(7):
        a, b, c = axes[k]
        x, y, z = t[0] - origins[k, 0], t[1] - origins[k, 1], t[2] - origins[k, 2]
        J[0, k], J[1, k], J[2, k] = b * z - c * y, c * x - a * z, a * y - b * x
        J[3, k], J[4, k], J[5, k] = weight * a, weight * b, weight * c


@numba.njit(cache=True)
def _gram(J, damping, A):  # type: ignore[no-untyped-def]
    """The lower half of A = J J^T + damping."""
    for i in range(6):
        for j in range(i + 1):
            A[i, j] = damping if i == j else 0.0
            for k in range(7):
                A[i, j] += J[i, k] * J[j, k]


@numba.njit(cache=True)
def _factorise(A):  # type: ignore[no-untyped-def]
    """Puts the Cholesky factor of A into its lower half."""
    for j in range(6):
        for i in range(j, 6):
            a = A[i, j]
            for k in range(j):
                a -= A[i, k] * A[j, k]
            # What rounding leaves of a pivot may be below zero.
            A[i, j] = math.sqrt(max(a, 1e-24)) if i == j else a / A[j, j]


@numba.njit(cache=True)
def _substitute(A, y):  # type: ignore[no-untyped-def]
    """Solves in place with a Cholesky factor."""
    for i in range(6):
        for k in range(i):
            y[i] -= A[i, k] * y[k]
        y[i] /= A[i, i]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            y[i] -= A[k, i] * y[k]
        y[i] /= A[i, i]
