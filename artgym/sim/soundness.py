"""Is this object fit to simulate? One verdict a rule, each with what was measured.

An object that passes stays where it is left, opens under a force a hand can give, has the shape
it shows, a plausible size, and somewhere to grip it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from artgym.geometry import transforms
from artgym.geometry.grasps import candidate_rotations
from artgym.objects import catalog
from artgym.objects.meshes import link_triangles
from artgym.objects.model import ArticulatedObject, Box, Cylinder, Link
from artgym.objects.surface import grid_points
from artgym.sim.conversion import transform_from_pose
from artgym.sim.rays import link_body
from artgym.sim.scene import ManipulationScene

Array = NDArray[np.floating]

#: Verdicts (n, c) on c grasp rotations (n, c, 3, 3) at n points (n, 3) of a part, object frame, at
#: joint positions q; 0 is a grasp that geometry allows. ``annotation.filter.judge`` is one.
GraspJudge = Callable[[ArticulatedObject, Array, int, Array, Array], NDArray[np.integer]]

Rule = Literal[
    "movable",
    "mass",
    "size",
    "collision shape",
    "penetration",
    "no drift",
    "opens",
    "no jam",
    "stays put",
    "graspable",
]

#: What a hand can give at the grip point, newtons.
HAND_FORCE = 40.0
#: Least range of a joint, metres or radians.
MIN_RANGE = 0.01
#: Seconds without any effort, and how far a joint may creep in them, as a share of its range.
REST_TIME, MAX_DRIFT = 5.0, 0.01
#: Open fraction that counts as open, and as closed again.
OPENED, CLOSED_AGAIN = 0.95, 0.05
#: How far collision shapes may lie from what is seen, and links inside each other, metres.
MAX_GAP, MAX_PENETRATION = 0.002, 0.003
#: Nearer to a hinge's axis than this, metres, the two links are the hinge and may interlock.
HINGE_RADIUS = 0.006

_PUSH_TIME = 4.0
_SPACING = 0.007
_GRIP_POINTS = 24


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What one rule found.

    Attributes:
        rule: the rule's name.
        value: what was measured; NaN where it could not be.
        relation: how value and bar must compare.
        bar: what the rule asks for.
        unit: of both.
        note: where the worst value was found, or why there is none.
    """

    rule: Rule
    value: float
    relation: Literal["<=", ">="]
    bar: float
    unit: str = ""
    note: str = ""

    @property
    def passed(self) -> bool:
        """Whether the value meets the bar; what could not be measured does not."""
        return self.value <= self.bar if self.relation == "<=" else self.value >= self.bar

    def __str__(self) -> str:
        mark = "pass" if self.passed else "FAIL"
        measured = f"{self.value:.4g} {self.relation} {self.bar:.4g} {self.unit}".rstrip()
        return f"{mark}  {self.rule:<16} {measured}" + (f"  ({self.note})" if self.note else "")


@dataclass(frozen=True, kw_only=True)
class Soundness:
    """All verdicts on one object."""

    object_id: str
    verdicts: tuple[Verdict, ...]

    @property
    def passed(self) -> bool:
        """Whether every rule is kept."""
        return not self.failures

    @property
    def failures(self) -> tuple[Verdict, ...]:
        """The verdicts of the rules that are broken."""
        return tuple(v for v in self.verdicts if not v.passed)

    def __getitem__(self, rule: Rule) -> Verdict:
        return next(v for v in self.verdicts if v.rule == rule)


def check(obj: ArticulatedObject, judge: GraspJudge) -> Soundness:
    """Measures an object against every rule; takes some tenths of a second.

    Args:
        obj: the object; its category must be in the catalogue.
        judge: says which grasps geometry allows (``annotation.filter.judge``).

    Raises:
        UnknownNameError: the category is not in the catalogue.
    """
    category = catalog.category(obj.category)
    movable = _movable(obj)
    mass = _mass(obj)
    verdicts = [movable, mass, _size(obj, category)]
    if movable.passed and mass.passed:
        verdicts += [
            _collision_shape(obj),
            _penetration(obj),
            _no_drift(obj, category),
            _opens(obj),
            _no_jam(obj),
            _stays_put(obj),
            _graspable(obj, category, judge),
        ]
    else:
        note = "not measured: " + ("no mass" if movable.passed else "nothing moves")
        verdicts += [
            Verdict(rule=rule, value=math.nan, relation="<=", bar=0.0, note=note)
            for rule in get_args(Rule)[len(verdicts) :]
        ]
    return Soundness(object_id=obj.object_id, verdicts=tuple(verdicts))


def _largest(values: list[tuple[float, str]]) -> tuple[float, str]:
    """The largest value and its note; a NaN counts as largest."""
    return max(values, key=lambda v: math.inf if math.isnan(v[0]) else v[0])


# -- description -------------------------------------------------------------------------------


def _movable(obj: ArticulatedObject) -> Verdict:
    """The smallest range of a joint."""
    if not obj.joints:
        return Verdict(
            rule="movable", value=0.0, relation=">=", bar=MIN_RANGE, note="no movable part"
        )
    ranges = [(abs(joint.range), joint.name) for joint in obj.joints]
    bad = [r for r in ranges if not math.isfinite(r[0])]
    value, name = bad[0] if bad else min(ranges)
    return Verdict(
        rule="movable",
        value=value if math.isfinite(value) else math.nan,
        relation=">=",
        bar=MIN_RANGE,
        unit="m or rad",
        note=name,
    )


def _mass(obj: ArticulatedObject) -> Verdict:
    """The smallest mass or principal moment of inertia; 0 where a body cannot have such moments."""

    def smallest(link: Link) -> float:
        if not (math.isfinite(link.mass) and np.all(np.isfinite(link.inertia))):
            return math.nan
        moments = np.linalg.eigvalsh(link.inertia)
        # No body has a moment above the sum of the other two.
        if moments[2] > (moments[0] + moments[1]) * (1 + 1e-6):
            return 0.0
        return float(min(link.mass, moments[0]))

    value, name = _largest([(-smallest(link), link.name) for link in obj.links])
    return Verdict(
        rule="mass", value=-value, relation=">=", bar=1e-9, unit="kg or kg m^2", note=name
    )


def _size(obj: ArticulatedObject, category: catalog.Category) -> Verdict:
    """How far the rest extents lie outside the category's interval, as a factor."""
    low, high = obj.rest_bounds
    extents = high - low
    smallest, largest = category.size
    value = max(float(smallest / extents.min()), float(extents.max() / largest))
    return Verdict(
        rule="size",
        value=value,
        relation="<=",
        bar=1.0,
        unit="of the interval's end",
        note=" x ".join(f"{e:.3f}" for e in extents) + " m",
    )


# -- shapes ------------------------------------------------------------------------------------


def _signed_distance(points: Array, half_size: Array | None, cylinder: Any | None) -> Array:
    """Distance (n,) of points (n, 3) from a box or a cylinder about x; negative inside, metres."""
    if half_size is not None:
        excess = np.abs(points) - half_size
    else:
        assert cylinder is not None
        across = np.hypot(points[:, 1], points[:, 2])
        excess = np.stack(
            [np.abs(points[:, 0]) - cylinder.half_length, across - cylinder.radius], axis=1
        )
    outside = np.linalg.norm(np.maximum(excess, 0.0), axis=1)
    return outside + np.minimum(excess.max(axis=1), 0.0)


def _geometry_distance(geometry: Box | Cylinder, points: Array) -> Array:
    if isinstance(geometry, Box):
        return _signed_distance(points, np.asarray(geometry.half_size), None)
    return _signed_distance(points, None, geometry)


def _collision_shape(obj: ArticulatedObject) -> Verdict:
    """How far what is seen lies from the surface of what the simulator was given."""
    scene = ManipulationScene(obj, np.eye(4), obj.rest_positions)
    gaps = []
    for link, body in zip(obj.links, scene.body.links, strict=True):
        if len(body.collision_shapes) != len(link.shapes):
            gaps.append((math.inf, f"{link.name}: {len(body.collision_shapes)} collision shapes"))
            continue
        triangles, shape_index = link_triangles(link)
        for i, given in enumerate(body.collision_shapes):
            corners = triangles[shape_index == i].reshape(-1, 3)
            seen = np.concatenate([corners, triangles[shape_index == i].mean(axis=1)])
            T_shape_link = transforms.invert(transform_from_pose(given.local_pose))
            half_size = getattr(given, "half_size", None)
            distance = _signed_distance(
                transforms.apply(T_shape_link, seen),
                half_size,
                None if half_size is not None else given,
            )
            gaps.append((float(np.abs(distance).max()), f"{link.name}, shape {i}"))
    scene.close()
    value, note = _largest(gaps)
    return Verdict(
        rule="collision shape", value=value, relation="<=", bar=MAX_GAP, unit="m", note=note
    )


def _penetration(obj: ArticulatedObject) -> Verdict:
    """How deep a link's surface lies inside another link at rest, hinges apart."""
    Ts_object_link = obj.link_poses(obj.rest_positions)
    worst = [(0.0, "")]
    for i, link in enumerate(obj.links):
        points = transforms.apply(Ts_object_link[i], grid_points(link, _SPACING))
        for joint in obj.joints:
            if joint.type == "revolute" and link.name in (joint.parent, joint.child):
                arm = points - np.asarray(joint.pivot)
                points = points[np.linalg.norm(np.cross(joint.axis, arm), axis=1) > HINGE_RADIUS]
        for k, other in enumerate(obj.links):
            if k == i or not len(points):
                continue
            points_other = transforms.apply(transforms.invert(Ts_object_link[k]), points)
            for shape in other.shapes:
                points_shape = transforms.apply(transforms.invert(shape.T_link_shape), points_other)
                depth = -_geometry_distance(shape.geometry, points_shape).min()
                worst.append((float(depth), f"{link.name} in {other.name}"))
    value, note = _largest(worst)
    return Verdict(
        rule="penetration", value=value, relation="<=", bar=MAX_PENETRATION, unit="m", note=note
    )


# -- motion ------------------------------------------------------------------------------------


class _FreeObject:
    """An object alone on its table, one of its joints under a force at the grip point."""

    def __init__(self, obj: ArticulatedObject, part: int, fraction: float) -> None:
        self._joint = obj.joint_of(part)
        self._part = part
        q = obj.rest_positions.copy()
        q[part - 1] = self._joint.position(fraction)
        self._scene = ManipulationScene(obj, np.eye(4), q)
        self._lever = math.copysign(_lever(obj, part), self._joint.range)

    def __enter__(self) -> _FreeObject:
        return self

    def __exit__(self, *_: object) -> None:
        self._scene.close()

    def fraction(self) -> float:
        """Open fraction now."""
        q = float(self._scene.body.positions()[self._part - 1])
        return float(self._joint.open_fraction(q))

    def rest(self, seconds: float) -> None:
        """Lets time pass."""
        self._scene.step(round(seconds / self._scene.config.timestep))

    def push(self, force: float) -> None:
        """Pushes the grip point in the opening direction, newtons, for one step."""
        efforts = np.zeros(len(self._scene.body.links) - 1)
        efforts[self._part - 1] = force * self._lever
        self._scene.body.push(efforts)
        self._scene.sapien_scene.physx_system.step()

    def force_to_reach(self, fraction: float) -> float:
        """Pushes harder and harder; the force at which the part got there, inf if it did not."""
        force, growth = 0.0, HAND_FORCE / 400
        while self.fraction() < fraction:
            force += growth
            if force > 2 * HAND_FORCE:
                return math.inf
            self.push(force)
        return force

    def push_until(self, force: float, fraction: float) -> float:
        """Pushes until an open fraction is passed or time is up; the fraction come to."""
        sign = math.copysign(1.0, force)
        for _ in range(round(_PUSH_TIME / self._scene.config.timestep)):
            if sign * (self.fraction() - fraction) >= 0:
                break
            self.push(force)
        return self.fraction()


def _lever(obj: ArticulatedObject, part: int) -> float:
    """Effort of the joint for a newton at the grip point: 1, or the distance from the hinge."""
    joint = obj.joint_of(part)
    if joint.type == "prismatic":
        return 1.0
    arm = obj.grip_point(part) - np.asarray(joint.pivot)
    return float(np.linalg.norm(np.cross(joint.axis, arm)))


def _no_drift(obj: ArticulatedObject, category: catalog.Category) -> Verdict:
    """The largest creep, as a share of the range, of a joint left alone anywhere in its range."""
    drifts = []
    for part, joint in enumerate(obj.joints, start=1):
        for fraction in (0.0, *category.start_fraction, 0.5, 1.0):
            with _FreeObject(obj, part, fraction) as free:
                free.rest(REST_TIME)
                drifts.append((abs(free.fraction() - fraction), f"{joint.name} at {fraction:.2f}"))
    value, note = _largest(drifts)
    return Verdict(
        rule="no drift", value=value, relation="<=", bar=MAX_DRIFT, unit="of the range", note=note
    )


def _opens(obj: ArticulatedObject) -> Verdict:
    """The force at the grip point that opens the part, growing slowly from nothing."""
    needed = []
    for part, joint in enumerate(obj.joints, start=1):
        with _FreeObject(obj, part, 0.0) as free:
            needed.append((free.force_to_reach(OPENED), joint.name))
    value, note = _largest(needed)
    return Verdict(rule="opens", value=value, relation="<=", bar=HAND_FORCE, unit="N", note=note)


def _no_jam(obj: ArticulatedObject) -> Verdict:
    """The share of the range covered, back and forth, under a force a hand can give."""
    covered = []
    for part, joint in enumerate(obj.joints, start=1):
        with _FreeObject(obj, part, 0.0) as free:
            farthest = free.push_until(HAND_FORCE, OPENED)
            free.rest(0.5)
            nearest = free.push_until(-HAND_FORCE, CLOSED_AGAIN)
        covered.append((nearest - farthest, joint.name))
    value, note = _largest(covered)
    return Verdict(
        rule="no jam",
        value=-value,
        relation=">=",
        bar=OPENED - CLOSED_AGAIN,
        unit="of the range",
        note=note,
    )


def _stays_put(obj: ArticulatedObject) -> Verdict:
    """The creep, as a share of the range, of a joint that was pushed half open and let go."""
    drifts = []
    for part, joint in enumerate(obj.joints, start=1):
        with _FreeObject(obj, part, 0.45) as free:
            free.force_to_reach(0.5)
            # It coasts to a stop first.
            free.rest(1.0)
            before = free.fraction()
            free.rest(REST_TIME)
            drifts.append((abs(free.fraction() - before), f"{joint.name} at {before:.2f}"))
    value, note = _largest(drifts)
    return Verdict(
        rule="stays put", value=value, relation="<=", bar=MAX_DRIFT, unit="of the range", note=note
    )


# -- gripper -----------------------------------------------------------------------------------


def _graspable(obj: ArticulatedObject, category: catalog.Category, judge: GraspJudge) -> Verdict:
    """How many candidate grasps of a part geometry allows at the start, the least of all parts."""
    rng = np.random.default_rng(0)
    counts = []
    for part, joint in enumerate(obj.joints, start=1):
        q = obj.rest_positions.copy()
        q[part - 1] = joint.position(float(np.mean(category.start_fraction)))
        T_object_part = obj.link_poses(q)[part]
        points_part, normals_part = _random_surface(obj.links[part], _GRIP_POINTS, rng)
        normals = transforms.rotate(T_object_part, normals_part)
        verdicts = judge(
            obj,
            q,
            part,
            transforms.apply(T_object_part, points_part),
            candidate_rotations(normals),
        )
        counts.append((-float((verdicts == 0).sum()), f"{obj.links[part].name}, {verdicts.size}"))
    value, note = _largest(counts)
    return Verdict(
        rule="graspable",
        value=-value,
        relation=">=",
        bar=1.0,
        unit="grasps",
        note=f"{note} tried",
    )


def _random_surface(link: Link, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Points (count, 3) on a link's surface and outward normals, link frame.

    A shape's share goes with the square root of its area: handles are small.
    """
    triangles, shape_index = link_triangles(link)
    a, b, c = np.swapaxes(triangles, 0, 1)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    weight = area / np.sqrt(np.bincount(shape_index, area))[shape_index]
    chosen = rng.choice(len(triangles), count, p=weight / weight.sum())
    u, v = rng.random((2, count, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    points = a[chosen] + u * (b - a)[chosen] + v * (c - a)[chosen]
    return points, link_body(link).normals()[chosen]
