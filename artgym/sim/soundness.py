"""Is this object fit to simulate? One verdict a rule, each with what was measured.

An object that passes stays where it is left, opens under a force a hand can give, has the shape
it shows, a plausible size, and somewhere to grip it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from sapien import physx

from artgym.geometry import transforms
from artgym.geometry.grasps import candidate_rotations
from artgym.objects import catalog
from artgym.objects.distance import (
    box_distance,
    cylinder_distance,
    geometry_distance,
    hull_distance,
    surface_distance,
)
from artgym.objects.meshes import primitive_mesh
from artgym.objects.model import ArticulatedObject, Link
from artgym.objects.seen import surface_points, uncovered_points
from artgym.objects.surface import grid_points
from artgym.sim.conversion import transform_from_pose
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
#: No link of an object on a table is heavier than this, kilograms.
MAX_MASS = 1000.0
#: Open fraction that counts as open, and as closed again.
OPENED, CLOSED_AGAIN = 0.95, 0.05
#: How far collision shapes may lie from what is seen, and links inside each other, metres.
MAX_GAP, MAX_PENETRATION = 0.002, 0.003
#: Nearer to a hinge's axis than this, metres, the two links are the hinge and may interlock.
HINGE_RADIUS = 0.006

_PUSH_TIME = 4.0
_SPACING = 0.007
_GRIP_POINTS, _SEEN_POINTS = 24, 120


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

    Whatever is wrong with the object, there is a verdict on each rule: what could not be measured
    counts as broken.

    Args:
        obj: the object.
        judge: says which grasps geometry allows (``annotation.filter.judge``).
    """
    category = catalog.category_of(obj)
    verdicts = [_movable(obj), _mass(obj), _size(obj, category)]
    movable, mass, _ = verdicts
    problem = ""
    if not movable.passed:
        problem = "nothing moves"
    elif not mass.passed:
        problem = "no mass, or no body's mass"
    else:
        try:
            ManipulationScene(obj, np.eye(4), obj.rest_positions).close()
        except (RuntimeError, ValueError) as error:
            problem = f"the simulator refuses it: {error}"
    if not problem:
        grips = _grips(obj, category, judge)
        verdicts += [
            _collision_shape(obj, grips),
            _penetration(obj),
            _no_drift(obj, category),
            _opens(obj),
            _no_jam(obj),
            _stays_put(obj),
            _graspable(obj, grips),
        ]
    else:
        verdicts += [
            Verdict(
                rule=rule, value=math.nan, relation="<=", bar=0.0, note=f"not measured: {problem}"
            )
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
    """The smallest mass or principal moment of inertia; 0 where no body has such masses."""

    def smallest(link: Link) -> float:
        if not (math.isfinite(link.mass) and np.all(np.isfinite(link.inertia))):
            return math.nan
        moments = np.linalg.eigvalsh(link.inertia)
        # No body has a moment above the sum of the other two; and nothing is this heavy.
        if moments[2] > (moments[0] + moments[1]) * (1 + 1e-6) or link.mass > MAX_MASS:
            return 0.0
        return float(min(link.mass, moments[0]))

    with np.errstate(all="ignore"):
        value, name = _largest([(-smallest(link), link.name) for link in obj.links])
    return Verdict(
        rule="mass", value=-value, relation=">=", bar=1e-9, unit="kg or kg m^2", note=name
    )


def _size(obj: ArticulatedObject, category: catalog.Category) -> Verdict:
    """How far the rest extents lie outside the category's interval, as a factor; stands apart."""
    low, high = obj.body_bounds
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


def _given_distance(given: Any, points: Array) -> Array:
    """As ``distance.geometry_distance``, from a shape as the simulator holds it."""
    if isinstance(given, physx.PhysxCollisionShapeConvexMesh):
        return hull_distance(points, np.asarray(given.vertices, dtype=float))
    if isinstance(given, physx.PhysxCollisionShapeBox):
        return box_distance(points, np.asarray(given.half_size, dtype=float))
    return cylinder_distance(points, given.radius, given.half_length)


def _collision_shape(obj: ArticulatedObject, grips: Sequence[_Grips]) -> Verdict:
    """How far the simulator's shapes lie from the object's, and those from what is seen."""
    gaps = [(0.0, "")]
    scene = ManipulationScene(obj, np.eye(4), obj.rest_positions)
    for link, body in zip(obj.links, scene.body.links, strict=True):
        if len(body.collision_shapes) != len(link.shapes):
            gaps.append((math.inf, f"{link.name}: {len(body.collision_shapes)} collision shapes"))
            continue
        pairs = zip(body.collision_shapes, _shape_triangles(link), strict=True)
        for i, (given, triangles) in enumerate(pairs):
            points = np.concatenate([triangles.reshape(-1, 3), triangles.mean(axis=1)])
            T_shape_link = transforms.invert(transform_from_pose(given.local_pose))
            distance = _given_distance(given, transforms.apply(T_shape_link, points))
            gaps.append((float(np.abs(distance).max()), f"{link.name}, shape {i}"))
    scene.close()
    for found in grips:
        link = obj.links[found.part]
        # The first points may lie anywhere, even inside.
        allowed = np.flatnonzero(found.allowed[_GRIP_POINTS:]) + _GRIP_POINTS
        if len(allowed):
            distance = surface_distance(
                link.shapes, found.points_part[allowed], found.normals_part[allowed]
            )
            gaps.append((float(distance.max()), f"{link.name}, what is seen"))
    value, note = _largest(gaps)
    return Verdict(
        rule="collision shape", value=value, relation="<=", bar=MAX_GAP, unit="m", note=note
    )


def _shape_triangles(link: Link) -> list[Array]:
    """Triangles (n, 3, 3) of each shape of a link, in the link's frame."""
    return [
        transforms.apply(
            shape.T_link_shape, primitive_mesh(shape.geometry).triangles.reshape(-1, 3)
        ).reshape(-1, 3, 3)
        for shape in link.shapes
    ]


def _penetration(obj: ArticulatedObject) -> Verdict:
    """How deep a link's surface lies inside another link at rest, hinges apart."""
    Ts_object_link = obj.link_poses(obj.rest_positions)
    worst = [(0.0, "")]
    for i, link in enumerate(obj.links):
        points = transforms.apply(Ts_object_link[i], grid_points(link, _SPACING))
        for k, other in enumerate(obj.links):
            if k == i:
                continue
            points_other = transforms.apply(transforms.invert(Ts_object_link[k]), points)
            inside = _within(points_other, other.bounds())
            near = points_other[inside]
            for joint in obj.joints:
                if joint.type == "revolute" and link.name in (joint.parent, joint.child):
                    arm = points[inside] - np.asarray(joint.pivot)
                    distance = np.linalg.norm(np.cross(joint.axis, arm), axis=1)
                    inside[inside] = distance > HINGE_RADIUS
                    near = points_other[inside]
            for shape in other.shapes:
                corners = shape.corners_link()
                inner = near[_within(near, np.stack([corners.min(axis=0), corners.max(axis=0)]))]
                if not len(inner):
                    continue
                points_shape = transforms.apply(transforms.invert(shape.T_link_shape), inner)
                depth = -geometry_distance(shape.geometry, points_shape).min()
                worst.append((float(depth), f"{link.name} in {other.name}"))
    value, note = _largest(worst)
    return Verdict(
        rule="penetration", value=value, relation="<=", bar=MAX_PENETRATION, unit="m", note=note
    )


def _within(points: Array, bounds: Array) -> NDArray[np.bool_]:
    """Which points (n, 3) lie in an axis-aligned box (2, 3)."""
    return np.all((points > bounds[0]) & (points < bounds[1]), axis=1)


# -- motion ------------------------------------------------------------------------------------


class _FreeObject:
    """An object alone on its table, one of its joints under a force at the grip point."""

    def __init__(self, obj: ArticulatedObject, part: int, fraction: float) -> None:
        self._joint = obj.joint_of(part)
        self._part = part
        self._scene = ManipulationScene(obj, np.eye(4), obj.positions_with(part, fraction))
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
        return force if math.isfinite(self.fraction()) else math.inf

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
    """The largest creep, as a share of the range, of a joint left alone anywhere in its range.

    All joints are left at the same open fraction; they do not touch each other.
    """
    drifts = []
    for fraction in (0.0, *category.start_fraction, 0.5, 1.0):
        q = np.array([joint.position(fraction) for joint in obj.joints])
        scene = ManipulationScene(obj, np.eye(4), q)
        scene.step(round(REST_TIME / scene.config.timestep))
        creep = np.abs(scene.body.positions() - q)
        scene.close()
        drifts += [
            (float(c / abs(joint.range)), f"{joint.name} at {fraction:.2f}")
            for c, joint in zip(creep, obj.joints, strict=True)
        ]
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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Grips:
    """Where geometry allows a part to be gripped at the start of an episode.

    Attributes:
        part: index of the part.
        points_part, normals_part: (n, 3) surface points of what is seen and outward normals.
        allowed: (n,) whether any grasp is possible there.
        grasps: how many are, at the first ``_GRIP_POINTS`` points.
        tried: of how many.
    """

    part: int
    points_part: Array
    normals_part: Array
    allowed: NDArray[np.bool_]
    grasps: int
    tried: int


def _grips(obj: ArticulatedObject, category: catalog.Category, judge: GraspJudge) -> list[_Grips]:
    """Candidate grasps of each movable part, judged."""
    rng = np.random.default_rng(0)
    found = []
    for part in range(1, obj.num_parts):
        link = obj.links[part]
        q = obj.positions_with(part, float(np.mean(category.start_fraction)))
        T_object_part = obj.link_poses(q)[part]
        points, normals = surface_points(link, _GRIP_POINTS, rng)
        if link.visuals:
            # What is seen is compared with what collides, and wants more points.
            more = uncovered_points(link, _SEEN_POINTS, np.random.default_rng(0))
            points, normals = np.concatenate([points, more[0]]), np.concatenate([normals, more[1]])
        verdicts = judge(
            obj,
            q,
            part,
            transforms.apply(T_object_part, points),
            candidate_rotations(transforms.rotate(T_object_part, normals)),
        )
        found.append(
            _Grips(
                part=part,
                points_part=points,
                normals_part=normals,
                allowed=(verdicts == 0).any(axis=1),
                grasps=int((verdicts[:_GRIP_POINTS] == 0).sum()),
                tried=verdicts[:_GRIP_POINTS].size,
            )
        )
    return found


def _graspable(obj: ArticulatedObject, grips: Sequence[_Grips]) -> Verdict:
    """How many candidate grasps of a part geometry allows at the start, the least of all parts."""
    value, note = _largest(
        [(-float(g.grasps), f"{obj.links[g.part].name}, {g.tried} tried") for g in grips]
    )
    return Verdict(rule="graspable", value=-value, relation=">=", bar=1.0, unit="grasps", note=note)
