"""From links and joints as a file has them to an object as this package has them.

URDF, MJCF and PartNet-Mobility readers fill a ``RawModel``; ``object_from_model`` checks it and
re-expresses it: fixed joints merged, every frame the object's frame at rest, collision convex.
"""

from __future__ import annotations

import functools
import math
from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, NoReturn, TypedDict, cast, get_args

import numpy as np
from numpy.typing import NDArray

from artgym.errors import AssetError, InvalidArgumentError, UnknownNameError
from artgym.geometry import transforms
from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.geometry.screw import joint_motion
from artgym.objects.collision import convex_pieces
from artgym.objects.contents import Image, TriangleMesh
from artgym.objects.mesh_files import MeshPiece
from artgym.objects.meshes import primitive_mesh
from artgym.objects.model import (
    ArticulatedObject,
    Box,
    Convex,
    Cylinder,
    Inertial,
    Joint,
    Link,
    Material,
    Role,
    Shape,
    Vector,
    Visual,
)

Array = NDArray[np.floating]
RawJointType = Literal["fixed", "prismatic", "revolute"]
#: An end of a joint's range as a caller names it: the lower or upper limit, or a joint position.
End = Literal["lower", "upper"] | float
#: How the closed end of a joint is found where nobody names it: the limit nearer to q = 0 (the
#: lower one if both are as near), or the one at which the object fills the smaller box.
ClosedRule = Literal["nearest", "smallest"]
#: What of a link collides: what the file says does, or what is seen.
Solid = Literal["collision", "visual"]
#: Axis of the root link that points up.
Up = Literal["+x", "-x", "+y", "-y", "+z", "-z"]

MAX_LINKS = 200
MAX_GEOMETRIES = 2000
MAX_TOTAL_FACES = 2_000_000
#: kg per cubic metre of links whose mass no file states: wood, or plastic around air.
DEFAULT_DENSITY = 600.0
#: A joint whose limits are nearer to each other than this cannot move, m or rad.
MIN_RANGE = 1e-6
MAX_TURN = 4 * math.pi
MAX_MASS = 1e5
#: Largest coordinate of an origin, in the file's units.
MAX_OFFSET = 1e6
#: Largest extent of an object, metres.
MIN_SIZE, MAX_SIZE = 1e-3, 50.0

_GRAVITY = 9.81
_GREY = Material(color=(0.6, 0.6, 0.6))
_IDENTITY = np.eye(4)
_IDENTITY.setflags(write=False)
#: Rotations (3, 3) that bring an axis to +z by the shortest way.
_UPRIGHT: Mapping[Up, Array] = {
    "+x": matrix_from_axis_angle([0.0, -math.pi / 2, 0.0]).round(),
    "-x": matrix_from_axis_angle([0.0, math.pi / 2, 0.0]).round(),
    "+y": matrix_from_axis_angle([math.pi / 2, 0.0, 0.0]).round(),
    "-y": matrix_from_axis_angle([-math.pi / 2, 0.0, 0.0]).round(),
    "+z": np.eye(3),
    "-z": np.diag([1.0, -1.0, -1.0]),
}


@dataclass(frozen=True, kw_only=True)
class Ellipsoid:
    """An ellipsoid about its own centre, a sphere for instance; half axes in metres."""

    half_size: Vector


@dataclass(frozen=True, kw_only=True)
class Capsule:
    """A cylinder with round ends about its own centre, axis along x; metres without the ends."""

    radius: float
    half_length: float


#: What a piece of geometry can be; a tuple is a mesh as ``mesh_files.read_mesh`` gives it.
RawShape = Box | Cylinder | Convex | Ellipsoid | Capsule | tuple[MeshPiece, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class RawGeometry:
    """A piece of a link that is seen or that collides.

    Attributes:
        shape: its form. Cylinders and capsules lie along x.
        T_link_shape: its pose (4, 4) in the link's frame.
        material: how it looks; None if the file does not say. Materials of meshes go first.
        element: its place in the file, for messages.
        role: what it is for.
    """

    shape: RawShape
    T_link_shape: Array = field(default_factory=lambda: _IDENTITY)
    material: Material | None = None
    element: str = ""
    role: Role = "body"


@dataclass(frozen=True, kw_only=True, eq=False)
class RawInertial:
    """Mass properties as the file states them.

    Attributes:
        mass: kilograms.
        center_of_mass: (3,) in the link's frame, metres.
        inertia: (3, 3), kg m^2, about the centre of mass, axes of the link's frame; None where the
            file gives a mass only.
        element: its place in the file, for messages.
    """

    mass: float
    center_of_mass: Array
    inertia: Array | None
    element: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class RawLink:
    """A link as the file has it.

    Attributes:
        name: unique in the model.
        visuals: what is seen.
        collisions: what collides.
        inertial: mass properties; None where the file gives none.
        element: its place in the file, for messages.
    """

    name: str
    visuals: tuple[RawGeometry, ...] = ()
    collisions: tuple[RawGeometry, ...] = ()
    inertial: RawInertial | None = None
    element: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class RawJoint:
    """A joint as the file has it.

    Attributes:
        name: unique in the model.
        type: "fixed", "prismatic" or "revolute".
        parent, child: link names.
        T_parent_joint: pose (4, 4) of the joint's frame in the parent's; the child's frame is
            there at q = 0.
        axis: (3,) of any length but zero, in the joint's frame; q grows along it.
        pivot: a point (3,) of the axis in the joint's frame, metres.
        lower, upper: limits of q; metres or radians.
        friction, damping: N or N m, N s/m or N m s/rad; None where the file does not say.
        element: its place in the file, for messages.
    """

    name: str
    type: RawJointType
    parent: str
    child: str
    T_parent_joint: Array = field(default_factory=lambda: _IDENTITY)
    axis: Vector = (1.0, 0.0, 0.0)
    pivot: Vector = (0.0, 0.0, 0.0)
    lower: float = 0.0
    upper: float = 0.0
    friction: float | None = None
    damping: float | None = None
    element: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class RawModel:
    """An articulated object as a file has it, values read but nothing re-expressed.

    Attributes:
        name: the model's name.
        file: where it comes from, for messages.
        links, joints: in the order of the file; they make one tree.
        notes: what the reader assumed.
    """

    name: str
    file: str
    links: tuple[RawLink, ...]
    joints: tuple[RawJoint, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Imported:
    """An object made from files, and what was assumed to make it.

    Attributes:
        object: the object.
        notes: one sentence for each thing that the files left open or that was changed.
    """

    object: ArticulatedObject
    notes: tuple[str, ...]


class Conversion(TypedDict, total=False):
    """The keyword arguments of ``object_from_model``, which readers of files pass on."""

    scale: float
    turn: float
    up: Up
    category: str
    name: str | None
    closed: Mapping[str, End] | None
    closed_rule: ClosedRule
    solid: Solid
    density: float | None
    part_names: Mapping[str, str] | None


def object_from_model(
    model: RawModel,
    *,
    scale: float = 1.0,
    turn: float = 0.0,
    up: Up = "+z",
    category: str = "other",
    name: str | None = None,
    closed: Mapping[str, End] | None = None,
    closed_rule: ClosedRule = "nearest",
    solid: Solid = "collision",
    density: float | None = None,
    part_names: Mapping[str, str] | None = None,
) -> Imported:
    """Checks a model and makes an object of it.

    The object's frame has its origin on the table under the middle of the rest bounds; its axes
    are the root link's, turned. Joint positions stay the file's, scaled for slides.

    Args:
        model: what a file holds.
        scale: factor for all lengths. Masses stay, inertias grow with its square.
        turn: radians about z that bring the front to +x, once ``up`` is up.
        up: the axis of the root link that points up.
        category: the object's category.
        name: the object's id; the model's name by default.
        closed: closed end of joints by name, where ``closed_rule`` would choose otherwise; the
            open end is the limit farther from it.
        closed_rule: how the closed end of all other joints is found.
        solid: what collides: the file's collision geometry, or all that is seen.
        density: kg/m^3 that replaces all masses of the file; None keeps them.
        part_names: names of parts by the name of their link in the file.

    Returns:
        The object and what was assumed.

    Raises:
        AssetError: anything in the model that makes no sound object.
        InvalidArgumentError: an argument out of range.
        UnknownNameError: ``closed`` or ``part_names`` name what the model does not have.
    """
    _check_number("scale", scale, 1e-6, 1e6)
    _check_number("turn", turn, -1e3, 1e3)
    if density is not None:
        _check_number("density", density, 1.0, 30_000.0)
    for argument, value, known in (
        ("closed_rule", closed_rule, get_args(ClosedRule)),
        ("solid", solid, get_args(Solid)),
        ("up", up, get_args(Up)),
    ):
        if value not in known:
            raise UnknownNameError(argument, value, known)
    assembly = _Assembly(model, scale, density, solid)
    R_object_root = matrix_from_axis_angle([0.0, 0.0, turn]) @ _UPRIGHT[up]
    return assembly.imported(
        R_object_root, category, name or model.name, closed, closed_rule, part_names
    )


def rest_extent(
    model: RawModel,
    *,
    closed: Mapping[str, End] | None = None,
    closed_rule: ClosedRule = "nearest",
) -> Vector:
    """Extents (x, y, z) of a model at rest in its own axes and units, to choose a scale by.

    Raises:
        AssetError, UnknownNameError: as for ``object_from_model``.
    """
    assembly = _Assembly(model, 1.0, None, "collision")
    low, high = assembly.bounds(assembly.poses(assembly.ends(closed, closed_rule), np.eye(3)))
    return cast(Vector, tuple((high - low).tolist()))


def _check_number(argument: str, value: float, low: float, high: float) -> None:
    if not (math.isfinite(value) and low <= value <= high):
        raise InvalidArgumentError(f"{argument}={value!r}: expected {low:g} to {high:g}")


# --- Tree ----------------------------------------------------------------------------------------


@dataclass(eq=False)
class _Body:
    """A link with all links that are fixed to it.

    Attributes:
        members: links and their poses (4, 4) in the body's frame, which is the first one's.
        joint: what moves it; None for the root.
        parent: index of the parent body, -1 for the root.
        T_parent_joint: pose (4, 4) of the joint's frame in the parent body's.
    """

    members: list[tuple[RawLink, Array]]
    joint: RawJoint | None
    parent: int
    T_parent_joint: Array

    @property
    def name(self) -> str:
        """The first member's that has geometry, or simply the first one's."""
        named = (m for m, _ in self.members if m.visuals or m.collisions)
        return next(named, self.members[0][0]).name

    @property
    def is_empty(self) -> bool:
        """Whether nothing of it can be seen or touched."""
        return not any(m.visuals or m.collisions for m, _ in self.members)


class _Assembly:
    """A checked model, its bodies, and the notes taken on the way."""

    def __init__(self, model: RawModel, scale: float, density: float | None, solid: Solid) -> None:
        self.model, self._scale, self._density = model, scale, density
        self._scaled_meshes: dict[int, tuple[MeshPiece, ...]] = {}
        self._convexes: dict[int, tuple[Convex, ...]] = {}
        self._solid = solid
        self.notes = list(model.notes)
        self._check_geometry()
        for link in model.links:
            if link.inertial is not None:
                _check_inertial(link.inertial, model.file)
        for joint in model.joints:
            _check_joint(joint, model.file)
        self.bodies = self._bodies()

    def _refuse(
        self, problem: str, *, element: str = "", value: object = None, remedy: str
    ) -> NoReturn:
        raise AssetError(self.model.file, problem, element=element, value=value, remedy=remedy)

    def _check_geometry(self) -> None:
        links = self.model.links
        pieces = [g for link in links for g in (*link.visuals, *link.collisions)]
        for count, limit, what in (
            (len(links), MAX_LINKS, "links"),
            (len(self.model.joints), MAX_LINKS, "joints"),
            (len(pieces), MAX_GEOMETRIES, "pieces of geometry"),
        ):
            if count > limit:
                self._refuse(f"more than {limit} {what}", value=count, remedy="Simplify it.")
        faces = sum(
            len(p.mesh.faces) for g in pieces if isinstance(g.shape, tuple) for p in g.shape
        )
        if faces > MAX_TOTAL_FACES:
            self._refuse(
                f"more than {MAX_TOTAL_FACES} faces in all",
                value=faces,
                remedy="Simplify the meshes.",
            )
        for piece in pieces:
            if not np.all(np.abs(piece.T_link_shape) <= MAX_OFFSET):
                self._refuse(
                    "a pose that is not finite or far away", element=piece.element, remedy=_FINITE
                )

    def _children(self) -> tuple[str, dict[str, list[RawJoint]]]:
        """The root's name and the joints that hang on each link; refuses what is no tree."""
        model = self.model
        if not model.links:
            self._refuse("no links", remedy="Describe at least a base and one movable link.")
        for kind, names in (
            ("link", [link.name for link in model.links]),
            ("joint", [joint.name for joint in model.joints]),
        ):
            repeated = {n for n in names if names.count(n) > 1}
            if repeated:
                self._refuse(
                    f"two {kind}s have the same name",
                    element=f"{kind} {min(repeated)!r}",
                    remedy="Give each its own name.",
                )
        known = {link.name for link in model.links}
        holder: dict[str, str] = {}
        children: dict[str, list[RawJoint]] = {name: [] for name in known}
        for joint in model.joints:
            for end, link in (("parent", joint.parent), ("child", joint.child)):
                if link not in known:
                    self._refuse(
                        f"its {end} is no link of the model",
                        element=joint.element,
                        value=link,
                        remedy="Name a link that is there.",
                    )
            if joint.child in holder:
                self._refuse(
                    f"link {joint.child!r} already hangs on joint {holder[joint.child]!r}",
                    element=joint.element,
                    remedy="Give each link one parent: loops cannot be closed here.",
                )
            holder[joint.child] = joint.name
            children[joint.parent].append(joint)
        roots = [link.name for link in model.links if link.name not in holder]
        if len(roots) != 1:
            self._refuse(
                "no root: the joints form a ring" if not roots else "more than one root link",
                value=roots[:8],
                remedy="Join all links to one base.",
            )
        return roots[0], children

    def _bodies(self) -> list[_Body]:
        """Bodies, parents first, in the order of the file's joints; empty leaves dropped."""
        root, children = self._children()
        links = {link.name: link for link in self.model.links}
        bodies = [_Body([(links[root], np.eye(4))], None, -1, np.eye(4))]
        stack: list[tuple[RawJoint, int, Array]] = [
            (joint, 0, np.eye(4)) for joint in reversed(children[root])
        ]
        reached = 1
        while stack:
            joint, index, T_body_parent = stack.pop()
            reached += 1
            T_body_joint = T_body_parent @ self._scaled_pose(joint.T_parent_joint)
            if _is_rigid(joint):
                if joint.type != "fixed":
                    T_body_joint = T_body_joint @ self._motion(joint, joint.lower)
                    self.notes.append(
                        f"{joint.element}: its limits are equal, so it was taken as fixed"
                    )
                bodies[index].members.append((links[joint.child], T_body_joint))
                body, T_body_link = index, T_body_joint
            else:
                bodies.append(_Body([(links[joint.child], np.eye(4))], joint, index, T_body_joint))
                body, T_body_link = len(bodies) - 1, np.eye(4)
            stack += [(child, body, T_body_link) for child in reversed(children[joint.child])]
        if reached != len(links):
            self._refuse("links in a ring, not joined to the base", remedy="Join them to one base.")
        return self._without_empty(bodies)

    def _without_empty(self, bodies: list[_Body]) -> list[_Body]:
        """Drops movable leaves that nobody could see; refuses empty bodies that carry others."""
        kept = list(range(len(bodies)))
        for i in reversed(range(1, len(bodies))):
            body = bodies[i]
            carried = [k for k in kept if bodies[k].parent == i]
            if not body.is_empty:
                continue
            assert body.joint is not None
            if carried:
                child = bodies[carried[0]].joint
                assert child is not None
                self._refuse(
                    f"nothing lies between it and joint {child.name!r}: link {body.name!r} has no "
                    "geometry",
                    element=body.joint.element,
                    remedy="Describe a joint of several axes as one joint, or give the link a "
                    "shape.",
                )
            kept.remove(i)
            self.notes.append(
                f"{body.joint.element}: dropped with its link {body.name!r}, which has no geometry"
            )
        if bodies[0].is_empty:
            self._refuse(
                "the base has no geometry",
                element=f"link {bodies[0].name!r}",
                remedy="Fix one of the links that have geometry to it.",
            )
        if len(kept) == 1:
            self._refuse("nothing moves", remedy="Give the object at least one movable joint.")
        order = {old: new for new, old in enumerate(kept)}
        chosen = [bodies[i] for i in kept]
        for body in chosen[1:]:
            body.parent = order[body.parent]
        for body in chosen:
            merged = [m.name for m, _ in body.members if m.name != body.name]
            if merged:
                self.notes.append(f"link {body.name!r}: fixed links merged: {', '.join(merged)}")
        return chosen

    # -- poses --

    def _scaled_pose(self, T: Array) -> Array:
        T = np.array(T, dtype=float)
        T[:3, 3] *= self._scale
        return T

    def _q_scale(self, joint: RawJoint) -> float:
        return self._scale if joint.type == "prismatic" else 1.0

    def _motion(self, joint: RawJoint, q: float) -> Array:
        """The child's motion (4, 4) in the joint's frame for a position in the file's units."""
        axis = np.asarray(joint.axis, dtype=float)
        pivot = np.asarray(joint.pivot, dtype=float) * self._scale
        assert joint.type != "fixed"
        unit = axis / np.linalg.norm(axis)
        return joint_motion(joint.type, unit, pivot, q * self._q_scale(joint))

    def poses(self, ends: Sequence[tuple[float, float]], R_a_root: Array) -> Array:
        """Poses (n, 4, 4) of the bodies at rest, in a frame with the root's origin."""
        poses = [transforms.transform_from(R_a_root, np.zeros(3))]
        for body, (rest, _) in zip(self.bodies[1:], ends, strict=True):
            assert body.joint is not None
            poses.append(poses[body.parent] @ body.T_parent_joint @ self._motion(body.joint, rest))
        return np.stack(poses)

    def _touched(self, link: RawLink, body: _Body) -> tuple[RawGeometry, ...]:
        """What collides of a link of a body."""
        if self._solid == "collision" and any(m.collisions for m, _ in body.members):
            return link.collisions
        return link.visuals or link.collisions

    @functools.cached_property
    def _corners(self) -> list[Array]:
        """Points of each body, in its frame, whose box is the body's."""
        corners = []
        for body in self.bodies:
            points = []
            for link, T_body_link in body.members:
                for piece in self._touched(link, body):
                    T = T_body_link @ self._scaled_pose(piece.T_link_shape)
                    points.append(transforms.apply(T, _corners_of(piece.shape) * self._scale))
            corners.append(np.concatenate(points))
        return corners

    def bounds(self, poses: Array) -> Array:
        """Box (2, 3) around all bodies."""
        points = [transforms.apply(T, c) for T, c in zip(poses, self._corners, strict=True)]
        lows = [p.min(axis=0) for p in points]
        highs = [p.max(axis=0) for p in points]
        return np.stack([np.min(lows, axis=0), np.max(highs, axis=0)])

    # -- ends --

    def ends(self, closed: Mapping[str, End] | None, rule: ClosedRule) -> list[tuple[float, float]]:
        """Closed and open position of each movable joint, in the file's units."""
        joints = [cast(RawJoint, body.joint) for body in self.bodies[1:]]
        given: dict[str, End] = dict(closed or {})
        for name in given:
            if name not in {j.name for j in joints}:
                raise UnknownNameError("movable joint", name, [j.name for j in joints])
        ends = [_ends(joint, given.get(joint.name, _nearest(joint))) for joint in joints]
        if rule == "smallest":
            for i, joint in enumerate(joints):
                if joint.name in given:
                    continue
                sizes = []
                for end in ("lower", "upper"):
                    ends[i] = _ends(joint, end)
                    low, high = self.bounds(self.poses(ends, np.eye(3)))
                    sizes.append((float(np.prod(high - low)), end))
                ends[i] = _ends(joint, cast(End, min(sizes)[1]))
        for joint, (rest, _) in zip(joints, ends, strict=True):
            if joint.name not in given and (rule == "smallest" or rest != 0.0):
                unit = "m" if joint.type == "prismatic" else "rad"
                self.notes.append(
                    f"{joint.element}: closed taken to be q = {rest * self._q_scale(joint):.4g} "
                    f"{unit}"
                )
        return ends

    # -- object --

    def imported(
        self,
        R_object_root: Array,
        category: str,
        name: str,
        closed: Mapping[str, End] | None,
        rule: ClosedRule,
        part_names: Mapping[str, str] | None,
    ) -> Imported:
        """The object; see ``object_from_model``."""
        names = self._part_names(part_names)
        for body in self.bodies[1:]:
            assert body.joint is not None
            limits = [self._q_scale(body.joint) * q for q in (body.joint.lower, body.joint.upper)]
            if body.joint.type == "prismatic" and max(map(abs, limits)) > MAX_SIZE:
                self._refuse(
                    f"a slide of more than {MAX_SIZE:g} m",
                    element=body.joint.element,
                    value=tuple(limits),
                    remedy="Give limits in metres.",
                )
        ends = self.ends(closed, rule)
        Ts_object_body = self.poses(ends, R_object_root)
        low, high = self.bounds(Ts_object_body)
        extent = float((high - low).max())
        if not MIN_SIZE <= extent <= MAX_SIZE:
            self._refuse(
                f"an object whose largest extent is not within {MIN_SIZE:g} to {MAX_SIZE:g} m",
                value=f"{extent:.4g} m",
                remedy="Give scale=, 0.001 for a file in millimetres.",
            )
        # Convex pieces differ a little from the meshes; it is they that stand on the table.
        bounds = [
            Link(name="", shapes=tuple(s for part in self._member_shapes(body, T) for s in part))
            for body, T in zip(self.bodies, Ts_object_body, strict=True)
        ]
        low = np.min([link.bounds()[0] for link in bounds], axis=0)
        high = np.max([link.bounds()[1] for link in bounds], axis=0)
        middle = (low + high) / 2
        Ts_object_body[:, :3, 3] -= (middle[0], middle[1], low[2])
        links = tuple(
            self._link(body, T, names[i])
            for i, (body, T) in enumerate(zip(self.bodies, Ts_object_body, strict=True))
        )
        joints = tuple(
            self._joint(i, ends, Ts_object_body, links) for i in range(1, len(self.bodies))
        )
        obj = ArticulatedObject(
            object_id=name,
            category=category,
            links=links,
            joints=joints,
            attributes={"family": "imported", "handle": "unknown"},
        )
        return Imported(object=obj, notes=tuple(dict.fromkeys(self.notes)))

    def _part_names(self, given: Mapping[str, str] | None) -> list[str]:
        """The parts' names: that of the link a body is named after, or of any of its links."""
        given = dict(given or {})
        links = {link.name for link in self.model.links}
        for link in given:
            if link not in links:
                raise UnknownNameError("link", link, links)
        names = []
        for body in self.bodies:
            called = [given[m.name] for m, _ in body.members if m.name in given]
            names.append(given.get(body.name, called[0] if called else body.name))
        if len(set(names)) != len(names):
            raise InvalidArgumentError(f"part_names: two parts would have one name: {names}")
        return names

    def _link(self, body: _Body, T_object_body: Array, name: str) -> Link:
        """A body as a link in the object's frame."""
        member_shapes = self._member_shapes(body, T_object_body)
        visuals: list[RawGeometry] = []
        touched: list[RawGeometry] = []
        for member, T_body_link in body.members:
            visuals += self._placed(member.visuals, T_object_body @ T_body_link)
            touched += self._placed(self._touched(member, body), T_object_body @ T_body_link)
        if self._solid == "collision" and not any(m.collisions for m, _ in body.members):
            self.notes.append(f"link {name!r}: no collision geometry, so what is seen collides")
        shapes = tuple(s for part in member_shapes for s in part)
        plain = not any(isinstance(v.shape, tuple) for v in visuals)
        if plain and Counter(map(_key, visuals)) == Counter(map(_key, touched)):
            visuals = []
        link = Link(
            name=name,
            shapes=shapes,
            density=self._density or DEFAULT_DENSITY,
            visuals=self._visuals(visuals),
        )
        self._note_untouched(link)
        return replace(link, inertial=self._inertial(link, member_shapes, body, T_object_body))

    def _member_shapes(self, body: _Body, T_object_body: Array) -> list[list[Shape]]:
        """The convex shapes of each of a body's links, in the object's frame."""
        found = []
        for link, T_body_link in body.members:
            T_object_link = T_object_body @ T_body_link
            materials = {_key(v): v.material for v in self._placed(link.visuals, T_object_link)}
            pieces = self._placed(self._touched(link, body), T_object_link)
            found.append([s for p in pieces for s in self._shapes(p, materials.get(_key(p)))])
        return found

    def _placed(self, pieces: Iterable[RawGeometry], T_object_link: Array) -> list[RawGeometry]:
        """Pieces in metres, posed in the object's frame."""
        return [
            replace(
                piece,
                shape=self._scaled_shape(piece.shape),
                T_link_shape=T_object_link @ self._scaled_pose(piece.T_link_shape),
            )
            for piece in pieces
        ]

    def _scaled_shape(self, shape: RawShape) -> RawShape:
        """A form in metres; equal meshes stay one."""
        s = self._scale
        if isinstance(shape, tuple):
            if id(shape) not in self._scaled_meshes:
                self._scaled_meshes[id(shape)] = tuple(
                    replace(p, mesh=TriangleMesh(p.mesh.vertices * s, p.mesh.faces, p.mesh.uv))
                    for p in shape
                )
            return self._scaled_meshes[id(shape)]
        if isinstance(shape, (Box, Ellipsoid)):
            return replace(shape, half_size=tuple(s * h for h in shape.half_size))
        if isinstance(shape, Convex):
            return Convex(points=tuple((s * x, s * y, s * z) for x, y, z in shape.points))
        return replace(shape, radius=s * shape.radius, half_length=s * shape.half_length)

    def _shapes(self, piece: RawGeometry, material: Material | None) -> list[Shape]:
        """A piece as convex shapes."""
        shape = piece.shape
        if isinstance(shape, tuple):
            if id(shape) not in self._convexes:
                self._convexes[id(shape)] = self._convex(shape, piece.element)
            geometries: tuple[Box | Cylinder | Convex, ...] = self._convexes[id(shape)]
            material = material or shape[0].material
        elif isinstance(shape, (Ellipsoid, Capsule)):
            geometries = (Convex(points=_as_points(_round_points(shape))),)
        else:
            geometries = (shape,)
        rows = piece.T_link_shape[:3, :3].tolist()
        return [
            Shape(
                geometry=geometry,
                position=_vector(piece.T_link_shape[:3, 3]),
                rotation=cast(tuple[Vector, Vector, Vector], tuple(map(tuple, rows))),
                material=piece.material or material or _GREY,
                role=piece.role,
            )
            for geometry in geometries
        ]

    def _convex(self, pieces: tuple[MeshPiece, ...], element: str) -> tuple[Convex, ...]:
        """A mesh as convex pieces."""
        try:
            return convex_pieces(
                _joined([p.mesh for p in pieces]), name=f"{self.model.file}: {element}"
            )
        except AssetError:
            raise
        except InvalidArgumentError as error:
            self._refuse(
                f"a collision mesh that cannot be cut into convex pieces: {error}",
                element=element,
                remedy="Give the link collision geometry of boxes, or a mesh with thickness.",
            )

    def _visuals(self, pieces: Sequence[RawGeometry]) -> tuple[Visual, ...]:
        """Meshes in the object's frame, one for each material."""
        by_look: dict[tuple[Material, bool], list[TriangleMesh]] = {}
        for piece in pieces:
            for mesh, own in _seen(piece.shape):
                material = own or piece.material or _GREY
                uv = mesh.uv if isinstance(material.texture, Image) else None
                moved = TriangleMesh(
                    transforms.apply(piece.T_link_shape, mesh.vertices), mesh.faces, uv
                )
                if uv is None:
                    material = replace(material, texture=None)
                by_look.setdefault((material, uv is not None), []).append(moved)
        return tuple(
            Visual(mesh=_joined(meshes), material=material)
            for (material, _), meshes in by_look.items()
        )

    def _note_untouched(self, link: Link) -> None:
        """Notes where what is seen lies far outside what collides."""
        if not link.visuals:
            return
        seen = np.concatenate([v.mesh.vertices for v in link.visuals])
        low, high = link.bounds()
        beyond = float(max((low - seen.min(axis=0)).max(), (seen.max(axis=0) - high).max()))
        if beyond > 0.005:
            self.notes.append(
                f"link {link.name!r}: what is seen reaches {1000 * beyond:.0f} mm beyond what "
                'collides; solid="visual" makes it collide'
            )

    # -- mass --

    def _inertial(
        self,
        link: Link,
        member_shapes: Sequence[list[Shape]],
        body: _Body,
        T_object_body: Array,
    ) -> Inertial | None:
        """Mass properties in the object's frame; None where the density gives them."""
        if self._density is not None:
            self.notes.append(f"masses of the file replaced by a density of {self._density:g}")
            return None
        if not any(raw.inertial is not None for raw, _ in body.members):
            self.notes.append(
                f"link {link.name!r}: no inertia in the file, computed with "
                f"{DEFAULT_DENSITY:g} kg/m^3"
            )
            return None
        low, high = link.bounds()
        reach = float(np.linalg.norm(high - low))
        parts: list[tuple[float, Array, Array]] = []
        for (raw, T_body_link), shapes in zip(body.members, member_shapes, strict=True):
            solid = None
            if shapes:
                solid = Link(name=raw.name, shapes=tuple(shapes), density=DEFAULT_DENSITY)
            if raw.inertial is None:
                if solid is not None:
                    self.notes.append(
                        f"link {raw.name!r}: no inertia in the file, computed with "
                        f"{DEFAULT_DENSITY:g} kg/m^3"
                    )
                    parts.append((solid.mass, solid.center_of_mass, solid.inertia))
                continue
            mass = raw.inertial.mass
            T = T_object_body @ T_body_link
            center = transforms.apply(T, raw.inertial.center_of_mass[None] * self._scale)[0]
            inertia = raw.inertial.inertia
            if inertia is not None:
                R = T[:3, :3]
                inertia = R @ inertia @ R.T * self._scale**2
                # No mass of a body lies farther from its centre than the body is long.
                if np.linalg.eigvalsh(inertia)[2] > mass * reach**2:
                    self.notes.append(
                        f"{raw.inertial.element}: an inertia larger than a body of this size and "
                        "mass can have; inertia and centre of mass computed from the shapes"
                    )
                    inertia = None
                    center = center if solid is None else solid.center_of_mass
            else:
                self.notes.append(f"{raw.inertial.element}: inertia computed from the shapes")
            if inertia is None:
                unit = np.zeros((3, 3)) if solid is None else solid.inertia / solid.mass
                inertia = mass * unit
            parts.append((mass, center, inertia))
        total = sum(mass for mass, _, _ in parts)
        middle = sum((mass * center for mass, center, _ in parts), np.zeros(3)) / total
        inertia = np.zeros((3, 3))
        for mass, center, own in parts:
            d = center - middle
            inertia += own + mass * (d @ d * np.eye(3) - np.outer(d, d))
        volume = sum(s.geometry.volume for s in link.shapes)
        if not 20 * volume <= total <= 25_000 * volume:
            self.notes.append(
                f"link {link.name!r}: {total:.3g} kg in {1000 * volume:.3g} litres; density= "
                "replaces the file's masses"
            )
        rows = _possible_inertia(inertia).tolist()
        return Inertial(
            mass=float(total),
            center_of_mass=_vector(middle),
            inertia=cast(tuple[Vector, Vector, Vector], tuple(map(tuple, rows))),
        )

    # -- joints --

    def _joint(
        self,
        index: int,
        ends: Sequence[tuple[float, float]],
        Ts_object_body: Array,
        links: Sequence[Link],
    ) -> Joint:
        """A body's joint in the object's frame."""
        body = self.bodies[index]
        raw = body.joint
        assert raw is not None
        assert raw.type != "fixed"
        T_object_joint = Ts_object_body[body.parent] @ body.T_parent_joint
        axis = T_object_joint[:3, :3] @ np.asarray(raw.axis, dtype=float)
        # A scale of length 1 to the last bit, and no -0.
        axis = axis / np.linalg.norm(axis) + 0.0
        pivot = transforms.apply(T_object_joint, np.asarray([raw.pivot]) * self._scale)[0]
        carried = {index}
        for i, other in enumerate(self.bodies):
            if other.parent in carried:
                carried.add(i)
        rest, far = (q * self._q_scale(raw) for q in ends[index - 1])
        joint = Joint(
            name=raw.name,
            type=raw.type,
            parent=links[body.parent].name,
            child=links[index].name,
            axis=_vector(axis),
            pivot=_vector(pivot),
            closed=rest,
            open=far,
            friction=0.0,
            damping=0.0,
        )
        friction, damping = _resistance(joint, [links[i] for i in sorted(carried)])
        for what, stated in (("friction", raw.friction), ("damping", raw.damping)):
            if stated is None:
                value = friction if what == "friction" else damping
                self.notes.append(f"{raw.element}: no {what} in the file, {value:.3g} given")
        return replace(
            joint,
            friction=friction if raw.friction is None else raw.friction,
            damping=damping if raw.damping is None else raw.damping,
        )


# --- Checks --------------------------------------------------------------------------------------

_FINITE = "Give finite numbers of a sensible size, in SI units."


def _check_inertial(inertial: RawInertial, file: str) -> None:
    """Refuses mass properties that no body has."""

    def refuse(problem: str, value: object, remedy: str) -> NoReturn:
        raise AssetError(file, problem, element=inertial.element, value=value, remedy=remedy)

    if not (math.isfinite(inertial.mass) and 0 < inertial.mass <= MAX_MASS):
        refuse(
            f"a mass that is not above 0 and at most {MAX_MASS:g} kg",
            inertial.mass,
            "Give the mass in kilograms, or remove <inertial> to have it computed.",
        )
    center = np.asarray(inertial.center_of_mass, dtype=float)
    if center.shape != (3,) or not np.all(np.abs(center) <= MAX_OFFSET):
        refuse("a centre of mass that is not finite", center.tolist(), _FINITE)
    if inertial.inertia is None:
        return
    inertia = np.asarray(inertial.inertia, dtype=float)
    if inertia.shape != (3, 3) or not np.all(np.abs(inertia) <= MAX_MASS * MAX_OFFSET):
        refuse("an inertia that is not finite", inertia.tolist(), _FINITE)
    moments = np.linalg.eigvalsh((inertia + inertia.T) / 2)
    remedy = "Correct it, or remove <inertia> to have it computed from the shapes."
    if moments[2] <= 0 or moments[0] < -1e-3 * moments[2]:
        refuse("an inertia that is not positive", moments.tolist(), remedy)
    if moments[2] > (1 + 1e-3) * (max(moments[0], 0.0) + moments[1]):
        refuse(
            "an inertia whose largest moment exceeds the sum of the others, as no body's does",
            moments.tolist(),
            remedy,
        )


def _check_joint(joint: RawJoint, file: str) -> None:
    """Refuses a joint that cannot be simulated."""

    def refuse(problem: str, value: object, remedy: str) -> NoReturn:
        raise AssetError(file, problem, element=joint.element, value=value, remedy=remedy)

    if joint.type not in get_args(RawJointType):
        refuse(
            "a joint type that is not supported",
            joint.type,
            f"Use one of {', '.join(get_args(RawJointType))}.",
        )
    T = np.asarray(joint.T_parent_joint, dtype=float)
    if T.shape != (4, 4) or not np.all(np.abs(T) <= MAX_OFFSET):
        refuse("an origin that is not finite or far away", None, _FINITE)
    if joint.type == "fixed":
        return
    axis = np.asarray(joint.axis, dtype=float)
    if axis.shape != (3,) or not np.all(np.isfinite(axis)):
        refuse("an axis that is not finite", joint.axis, "Give three finite numbers.")
    if not 1e-6 < np.linalg.norm(axis) < 1e6:
        refuse("an axis of length zero", joint.axis, "Give a direction, such as 0 0 1.")
    if not np.all(np.abs(np.asarray(joint.pivot, dtype=float)) <= MAX_OFFSET):
        refuse("a pivot that is not finite", joint.pivot, _FINITE)
    limits = (joint.lower, joint.upper)
    if not all(math.isfinite(q) for q in limits):
        refuse("limits that are not finite", limits, "Give finite limits.")
    if joint.lower > joint.upper:
        refuse("a lower limit above the upper one", limits, "Exchange them.")
    if joint.type == "revolute" and max(map(abs, limits)) > MAX_TURN:
        refuse("limits beyond two turns", limits, "Give limits in radians.")
    if joint.type == "prismatic" and max(map(abs, limits)) > MAX_OFFSET:
        refuse("limits far away", limits, _FINITE)
    for what, value in (("friction", joint.friction), ("damping", joint.damping)):
        if value is not None and not (math.isfinite(value) and 0 <= value <= 1e6):
            refuse(f"a {what} that is negative or not finite", value, f"Give {what} >= 0.")


# --- Ends and resistance of joints ---------------------------------------------------------------


def _is_rigid(joint: RawJoint) -> bool:
    return joint.type == "fixed" or joint.upper - joint.lower < MIN_RANGE


def _nearest(joint: RawJoint) -> End:
    """The limit nearer to q = 0."""
    return "upper" if abs(joint.upper) < abs(joint.lower) else "lower"


def _ends(joint: RawJoint, closed: End) -> tuple[float, float]:
    """Closed and open position for a closed end as a caller names it."""
    if isinstance(closed, str):
        if closed not in ("lower", "upper"):
            raise UnknownNameError(f"end of joint {joint.name!r}", closed, ("lower", "upper"))
        rest = joint.lower if closed == "lower" else joint.upper
    else:
        rest = float(closed)
        if not joint.lower - 1e-9 <= rest <= joint.upper + 1e-9:
            raise InvalidArgumentError(
                f"closed: joint {joint.name!r} at {rest!r}: expected {joint.lower:.6g} to "
                f"{joint.upper:.6g}"
            )
    return rest, max(joint.upper, joint.lower, key=lambda q: abs(q - rest))


def _resistance(joint: Joint, carried: Sequence[Link]) -> tuple[float, float]:
    """Friction and damping such that a part stays where it is left and a hand can move it.

    Args:
        joint: the joint, in the object's frame.
        carried: the links that move with it, at rest.

    Returns:
        N and N s/m for a slide; N m and N m s/rad for a hinge.
    """
    mass = sum(link.mass for link in carried)
    upright = abs(joint.axis[2])
    if joint.type == "prismatic":
        lift = 1.5 * mass * _GRAVITY * upright
        return float(np.clip(2 * mass, 1, 6) + lift), float(np.clip(5 * mass, 2, 15))
    center = sum((link.mass * link.center_of_mass for link in carried), np.zeros(3)) / mass
    motions = joint.motion(np.linspace(joint.closed, joint.open, 65))
    arms = transforms.apply(motions, center[None])[:, 0] - np.asarray(joint.pivot)
    torques = np.cross(arms, [0.0, 0.0, -mass * _GRAVITY]) @ np.asarray(joint.axis)
    drag = float(np.clip(0.05 * mass, 0.1, 0.3)) if upright > 0.95 else 0.005
    friction = 1.5 * float(np.abs(torques).max()) + drag
    return friction, float(np.clip(0.1 * friction, 0.01, 1.0))


# --- Forms ---------------------------------------------------------------------------------------


def _vector(values: Array) -> Vector:
    x, y, z = (float(v) for v in values)
    return (x, y, z)


def _as_points(points: Array) -> tuple[Vector, ...]:
    return tuple(_vector(p) for p in points)


def _key(piece: RawGeometry) -> Hashable:
    """Equal for pieces of the same form in the same place, to a micrometre."""
    shape = piece.shape
    if isinstance(shape, tuple):
        form: Hashable = tuple(p.mesh for p in shape)
    elif isinstance(shape, (Box, Ellipsoid)):
        form = tuple(round(h, 6) for h in shape.half_size)
    elif isinstance(shape, Convex):
        form = shape
    else:
        form = (round(shape.radius, 6), round(shape.half_length, 6))
    place = (np.round(piece.T_link_shape, 6) + 0.0).tobytes()
    return type(shape).__name__, form, place


def _round_points(shape: Ellipsoid | Capsule) -> Array:
    """Points (n, 3), n <= 64, whose hull has about the volume of a round form."""
    if isinstance(shape, Ellipsoid):
        # Points of a hull lie on the surface, its faces inside: 4 % more evens it out.
        return 1.04 * _sphere_points() * np.asarray(shape.half_size)
    ring = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    points = [
        (np.sin(up), np.cos(up) * np.cos(a), np.cos(up) * np.sin(a))
        for up, count in ((0.0, 16), (np.pi / 4, 8), (np.pi / 2, 1))
        for a in (np.linspace(0, 2 * np.pi, count, endpoint=False) if count != 8 else ring)
    ]
    cap = 1.02 * shape.radius * np.array(points)
    cap += np.array([shape.half_length, 0.0, 0.0])
    return np.concatenate([cap, cap * (-1, 1, 1)])


@functools.cache
def _sphere_points() -> Array:
    """Points (64, 3) spread evenly over the unit sphere, the same for every caller."""
    i = np.arange(64)
    z = 1 - (2 * i + 1) / 64
    angle = i * np.pi * (3 - math.sqrt(5))
    r = np.sqrt(1 - z**2)
    return np.stack([r * np.cos(angle), r * np.sin(angle), z], axis=1)


def _corners_of(shape: RawShape) -> Array:
    """Points (n, 3) whose box holds a form."""
    if isinstance(shape, tuple):
        return np.concatenate([p.mesh.vertices for p in shape])
    if isinstance(shape, (Ellipsoid, Capsule)):
        return _round_points(shape)
    return shape.corners()


def _seen(shape: RawShape) -> list[tuple[TriangleMesh, Material | None]]:
    """A form as meshes with their own materials."""
    if isinstance(shape, tuple):
        return [(p.mesh, p.material) for p in shape]
    if isinstance(shape, (Ellipsoid, Capsule)):
        shape = Convex(points=_as_points(_round_points(shape)))
    mesh = primitive_mesh(shape)
    return [(TriangleMesh(mesh.vertices, mesh.faces), None)]


def _joined(meshes: Sequence[TriangleMesh]) -> TriangleMesh:
    """Meshes as one; picture coordinates where all have them."""
    if len(meshes) == 1:
        return meshes[0]
    offsets = np.cumsum([0, *(len(m.vertices) for m in meshes[:-1])])
    uvs = [m.uv for m in meshes if m.uv is not None]
    return TriangleMesh(
        np.concatenate([m.vertices for m in meshes]),
        np.concatenate([m.faces + offset for m, offset in zip(meshes, offsets, strict=True)]),
        np.concatenate(uvs) if len(uvs) == len(meshes) else None,
    )


def _possible_inertia(inertia: Array) -> Array:
    """The inertia, moved by rounding errors at most to one that a body can have."""
    moments, axes = np.linalg.eigh((inertia + inertia.T) / 2)
    moments = np.maximum(moments, max(1e-6 * moments[2], 1e-12))
    missing = moments[2] - moments[0] - moments[1]
    if missing > 0:
        moments[:2] += 0.51 * missing
    return (axes * moments) @ axes.T
