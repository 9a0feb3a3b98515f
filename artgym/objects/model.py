"""The description of an articulated object: geometry, joints, mass, semantics.

Frames: the *object* frame is the root link's, origin on the table under the object's middle, x
towards the side a user faces (the front), z up. Every link's frame coincides with the object's
frame in the rest state (all joints at ``closed``), so a part's pose is the motion of its joints and
the canonical boxes of the paper (NPCS, NAOCS) are axis-aligned there.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cached_property
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from artgym.errors import InvalidArgumentError, UnknownNameError
from artgym.geometry import quaternions, transforms
from artgym.geometry.rotations import cross, quaternion_from_matrix
from artgym.geometry.screw import JointType, joint_motion
from artgym.objects.contents import Image, TriangleMesh

Vector = tuple[float, float, float]
Array = NDArray[np.floating]

#: What a piece is for: most are "body"; a "handle" is what a person would take hold of; a "stand"
#: carries a small object above the table and is no part of its real size.
Role = Literal["body", "handle", "stand"]


@dataclass(frozen=True, kw_only=True)
class Texture:
    """A pattern drawn over a surface in shades of its colour, the same from the same numbers.

    Attributes:
        pattern: a name in ``textures.PATTERNS``.
        seed: which of the pattern's many forms.
        tile: metres after which it repeats.
    """

    pattern: str
    seed: int = 0
    tile: float = 0.25


@dataclass(frozen=True, kw_only=True)
class Material:
    """How a surface looks.

    Attributes:
        color: linear RGB in [0, 1].
        roughness: 0 mirror, 1 matt.
        metallic: 0 dielectric, 1 metal.
        texture: a pattern in shades of the colour, or a picture that takes the colour's place.
    """

    color: Vector
    roughness: float = 0.6
    metallic: float = 0.0
    texture: Texture | Image | None = None


_BOX_SIGNS = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij"), -1).reshape(-1, 3)


@dataclass(frozen=True, kw_only=True)
class Box:
    """A cuboid about its own centre; ``half_size`` (x, y, z) in metres."""

    half_size: Vector

    @property
    def volume(self) -> float:
        """Cubic metres."""
        return 8.0 * float(np.prod(self.half_size))

    @property
    def unit_inertia(self) -> Array:
        """Inertia (3, 3) about the centre for a mass of 1 kg."""
        x, y, z = np.square(self.half_size)
        return np.diag([y + z, x + z, x + y]) / 3.0

    def corners(self) -> Array:
        """Points (n, 3) whose convex hull holds the shape."""
        return _BOX_SIGNS * np.asarray(self.half_size)


@dataclass(frozen=True, kw_only=True)
class Cylinder:
    """A cylinder about its own centre, axis along x; metres."""

    radius: float
    half_length: float

    @property
    def volume(self) -> float:
        """Cubic metres."""
        return 2.0 * np.pi * self.radius**2 * self.half_length

    @property
    def unit_inertia(self) -> Array:
        """Inertia (3, 3) about the centre for a mass of 1 kg."""
        across = (3.0 * self.radius**2 + (2.0 * self.half_length) ** 2) / 12.0
        return np.diag([0.5 * self.radius**2, across, across])

    def corners(self) -> Array:
        """Points (n, 3) whose convex hull holds the shape."""
        return Box(half_size=(self.half_length, self.radius, self.radius)).corners()


@dataclass(frozen=True, kw_only=True)
class Convex:
    """A convex polyhedron: the hull of points (n, 3), n <= 64, about their own origin, metres.

    Raises:
        InvalidArgumentError: fewer than four points, more than 64, or all in one plane.
    """

    points: tuple[Vector, ...]

    def __post_init__(self) -> None:
        if not 4 <= len(self.points) <= 64:
            raise InvalidArgumentError(
                f"a convex piece of {len(self.points)} points: expected 4 to 64"
            )

    @cached_property
    def _moments(self) -> tuple[float, Array, Array]:
        return _hull_moments(self.corners(), self.triangles)

    @property
    def volume(self) -> float:
        """Cubic metres."""
        return self._moments[0]

    @property
    def centroid(self) -> Array:
        """Centre of volume (3,) in the polyhedron's own frame."""
        return self._moments[1]

    @property
    def unit_inertia(self) -> Array:
        """Inertia (3, 3) about the centroid for a mass of 1 kg."""
        return self._moments[2]

    @cached_property
    def triangles(self) -> NDArray[np.intp]:
        """Faces (m, 3) of the hull as indices of points, seen counter-clockwise from outside."""
        return _hull_triangles(self.corners())

    @cached_property
    def _corners(self) -> Array:
        points = np.array(self.points, dtype=float)
        points.setflags(write=False)
        return points

    def corners(self) -> Array:
        """Points (n, 3) whose convex hull is the shape; read-only."""
        return self._corners


def _hull_triangles(points: Array) -> NDArray[np.intp]:
    # It takes as long to load as a whole environment, and most objects have no such shape.
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except QhullError:
        raise InvalidArgumentError(
            f"a convex piece whose {len(points)} points lie in one plane: give it thickness"
        ) from None
    faces = hull.simplices.astype(np.intp)
    a, b, c = points[faces].swapaxes(0, 1)
    inward = np.einsum("ij,ij->i", cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    faces.setflags(write=False)
    return faces


def _hull_moments(points: Array, faces: NDArray[np.intp]) -> tuple[float, Array, Array]:
    """Volume, centroid and unit inertia, summed over tetrahedra from an inner point."""
    inner = points.mean(axis=0)
    a, b, c = (points - inner)[faces].swapaxes(0, 1)
    volumes = np.einsum("ij,ij->i", a, cross(b, c)) / 6.0
    volume = float(volumes.sum())
    corners_sum = a + b + c
    centroid = volumes @ corners_sum / 4.0 / volume
    # Second moments of a tetrahedron with a corner at the origin.
    second = sum((volumes[:, None] * v).T @ v for v in (a, b, c, corners_sum)) / 20.0
    second = second / volume - np.outer(centroid, centroid)
    inertia = np.trace(second) * np.eye(3) - second
    for array in (centroid, inertia):
        array.setflags(write=False)
    return volume, centroid + inner, inertia


#: The kinds of convex pieces.
Geometry = Box | Cylinder | Convex


@dataclass(frozen=True, kw_only=True)
class Shape:
    """A convex piece of a link: what collides, and what is seen unless the link has visuals.

    Attributes:
        geometry: the primitive.
        position: its origin in the link's frame, metres.
        rotation: its axes in the link's frame, rows of a 3x3 matrix.
        material: how it looks.
        role: what it is for.
    """

    geometry: Geometry
    position: Vector
    material: Material
    rotation: tuple[Vector, Vector, Vector] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    role: Role = "body"

    @cached_property
    def T_link_shape(self) -> Array:
        """Pose (4, 4) of the primitive's frame in the link's."""
        return transforms.transform_from(self.rotation, self.position)

    def corners_link(self) -> Array:
        """Points (n, 3) in the link's frame whose hull holds the shape."""
        return transforms.apply(self.T_link_shape, self.geometry.corners())

    @cached_property
    def centroid_link(self) -> Array:
        """Centre of volume (3,) in the link's frame."""
        position = np.asarray(self.position, dtype=float)
        if isinstance(self.geometry, Convex):
            return position + np.asarray(self.rotation, dtype=float) @ self.geometry.centroid
        return position


@dataclass(frozen=True, kw_only=True)
class Visual:
    """Triangles that are seen and touch nothing, in the link's frame.

    Attributes:
        mesh: the triangles, metres.
        material: how they look.
    """

    mesh: TriangleMesh
    material: Material


@dataclass(frozen=True, kw_only=True)
class Inertial:
    """Mass properties as a file states them, where the density is not uniform.

    Attributes:
        mass: kilograms.
        center_of_mass: in the link's frame, metres.
        inertia: rows of a 3x3 matrix, kg m^2, about the centre of mass, axes of the link's frame.
    """

    mass: float
    center_of_mass: Vector
    inertia: tuple[Vector, Vector, Vector]


@dataclass(frozen=True, kw_only=True)
class Link:
    """A rigid body.

    Attributes:
        name: unique in its object; for movable parts the word a person would use.
        shapes: its convex pieces.
        density: kg per cubic metre, uniform; unused where ``inertial`` is given.
        friction: Coulomb coefficient of its surface.
        visuals: what is seen in place of the shapes, if anything.
        inertial: mass properties in place of the density's.
    """

    name: str
    shapes: tuple[Shape, ...]
    density: float = 1000.0
    friction: float = 0.8
    visuals: tuple[Visual, ...] = ()
    inertial: Inertial | None = None

    @cached_property
    def mass(self) -> float:
        """Kilograms."""
        if self.inertial is not None:
            return self.inertial.mass
        return self.density * sum(s.geometry.volume for s in self.shapes)

    @cached_property
    def center_of_mass(self) -> Array:
        """(3,) in the link's frame, metres."""
        if self.inertial is not None:
            return np.asarray(self.inertial.center_of_mass, dtype=float)
        weights = np.array([s.geometry.volume for s in self.shapes])
        centers = np.array([s.centroid_link for s in self.shapes])
        return weights @ centers / weights.sum()

    @cached_property
    def inertia(self) -> Array:
        """(3, 3), kg m^2, about the centre of mass, in the axes of the link's frame."""
        if self.inertial is not None:
            return np.asarray(self.inertial.inertia, dtype=float)
        masses = self.density * np.array([s.geometry.volume for s in self.shapes])
        R = np.array([s.rotation for s in self.shapes], dtype=float)
        own = np.array([s.geometry.unit_inertia for s in self.shapes])
        arms = np.array([s.centroid_link for s in self.shapes]) - self.center_of_mass
        total = np.tensordot(masses, R @ own @ R.swapaxes(1, 2), axes=1)
        weighted = masses[:, None] * arms
        total += np.sum(weighted * arms) * np.eye(3) - weighted.T @ arms
        return total

    @cached_property
    def principal_inertia(self) -> tuple[Array, Array]:
        """Moments (3,) about the principal axes, and those axes' quaternion (4,) in the link."""
        moments, axes = np.linalg.eigh(self.inertia)
        if np.linalg.det(axes) < 0:
            axes[:, 0] *= -1
        return moments, np.array(quaternions.quaternion_from_rows(axes.tolist()))

    @cached_property
    def shape_quaternions(self) -> Array:
        """Orientations (n, 4) of the shapes in the link."""
        return quaternion_from_matrix(np.array([shape.rotation for shape in self.shapes]))

    @cached_property
    def _bounds(self) -> Array:
        return self.bounds(roles=get_args(Role))

    def bounds(self, roles: tuple[Role, ...] | None = None) -> Array:
        """Axis-aligned box (2, 3), min and max, in the link's frame.

        Args:
            roles: only pieces of these; all by default. Without such a piece it is +inf, -inf.
        """
        if roles is None:
            return self._bounds.copy()
        chosen = [s.corners_link() for s in self.shapes if s.role in roles]
        corners = np.concatenate([np.empty((0, 3)), *chosen])
        return np.stack([corners.min(axis=0, initial=np.inf), corners.max(axis=0, initial=-np.inf)])


@dataclass(frozen=True, kw_only=True)
class Joint:
    """What lets a child link move against its parent.

    Attributes:
        name: unique in its object.
        type: "prismatic" (q in metres) or "revolute" (q in radians).
        parent, child: link names.
        axis: unit direction in the object's frame at rest; q grows along it.
        pivot: a point of the axis, same frame.
        closed, open: the two ends of the range; q = closed is the rest state.
        friction: dry friction, N or N m.
        damping: N s/m or N m s/rad.
    """

    name: str
    type: JointType
    parent: str
    child: str
    axis: Vector
    pivot: Vector
    closed: float
    open: float
    friction: float
    damping: float

    @property
    def range(self) -> float:
        """From closed to open; metres or radians."""
        return self.open - self.closed

    def open_fraction(self, q: Any) -> Any:
        """The open fraction f = (q - closed) / (open - closed)."""
        return (q - self.closed) / self.range

    def position(self, fraction: Any) -> Any:
        """The joint position q at an open fraction."""
        return self.closed + fraction * self.range

    def motion(self, q: float | Array) -> Array:
        """The child's rigid motion (..., 4, 4) from the rest state, in the parent's frame."""
        return joint_motion(self.type, self.axis, self.pivot, q - self.closed)


@dataclass(frozen=True, kw_only=True)
class ArticulatedObject:
    """Links joined by joints; ``links[0]`` is the root, parts are links in a fixed order.

    Attributes:
        object_id: catalogue id, "drawer/0012".
        category: the category's name.
        links: parents before children; the index of a link is the index of its part.
        joints: one for each link but the root, in the order of the links.
        attributes: what the generator chose, for statistics: ("handle", "bar"), ...
        R_object_canonical: axes of the canonical boxes of the object and its parts (NAOCS, NPCS),
            rows of a rotation matrix. They are the object's own unless it is held turned on a
            stand: what is normalised has to follow from what is seen, whatever holds it.
    """

    object_id: str
    category: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    attributes: Mapping[str, str | float] = field(default_factory=dict)
    R_object_canonical: tuple[Vector, Vector, Vector] = Shape.rotation

    def __post_init__(self) -> None:
        names = [link.name for link in self.links]
        if len(set(names)) != len(names):
            raise InvalidArgumentError(f"{self.object_id}: link names repeat: {names}")
        if [joint.child for joint in self.joints] != names[1:]:
            raise InvalidArgumentError(
                f"{self.object_id}: joints must be listed in the order of their child links "
                f"{names[1:]}, got {[joint.child for joint in self.joints]}"
            )
        for joint in self.joints:
            if joint.parent not in names[: names.index(joint.child)]:
                raise InvalidArgumentError(
                    f"{self.object_id}: joint {joint.name!r} hangs on {joint.parent!r}, which is "
                    "not a link listed before its child"
                )

    @property
    def num_parts(self) -> int:
        """K, the base included."""
        return len(self.links)

    @property
    def part_names(self) -> tuple[str, ...]:
        """Names in the order of part indices."""
        return tuple(link.name for link in self.links)

    def joint_of(self, part: int) -> Joint:
        """The joint that moves a part.

        Raises:
            UnknownNameError: the part does not exist or cannot move.
        """
        if not 1 <= part < self.num_parts:
            raise UnknownNameError("movable part", part, [f"{i}" for i in range(1, self.num_parts)])
        return self.joints[part - 1]

    def link_poses(self, q: Mapping[str, float] | Array | list[float]) -> Array:
        """``Ts_object_link`` (K, 4, 4) at joint positions q, given by joint name or in order."""
        values = [q[j.name] for j in self.joints] if isinstance(q, Mapping) else list(q)
        index = {link.name: i for i, link in enumerate(self.links)}
        poses = [np.eye(4)]
        for joint, value in zip(self.joints, values, strict=True):
            poses.append(poses[index[joint.parent]] @ joint.motion(value))
        return np.stack(poses)

    @property
    def rest_positions(self) -> Array:
        """Joint positions (K - 1,) of the rest state."""
        return np.array([joint.closed for joint in self.joints])

    def positions_with(self, part: int, fraction: float) -> Array:
        """Joint positions (K - 1,) with one part at an open fraction and all others closed."""
        q = self.rest_positions
        q[part - 1] = self.joint_of(part).position(fraction)
        return q

    @cached_property
    def rest_bounds(self) -> Array:
        """Axis-aligned box (2, 3) of the whole object at rest, object frame."""
        bounds = np.stack([link.bounds() for link in self.links])
        return np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])

    @cached_property
    def canonical_bounds(self) -> Array:
        """Boxes (K, 2, 3) of the parts at rest along the canonical axes: NPCS's boxes."""
        R = np.asarray(self.R_object_canonical)
        corners = [np.concatenate([s.corners_link() for s in each.shapes]) for each in self.links]
        return np.stack([[(c @ R).min(axis=0), (c @ R).max(axis=0)] for c in corners])

    def bounds_at(self, q: Array) -> Array:
        """An axis-aligned box (2, 3) around the object at joint positions q, object frame.

        Made of the links' boxes, so that turned links have some room in it.
        """
        poses = self.link_poses(q)
        R, t = poses[:, :3, :3], poses[:, None, :3, 3]
        moved = np.einsum("kij,knj->kni", R, self._box_corners) + t
        return np.stack([moved.min(axis=(0, 1)), moved.max(axis=(0, 1))])

    @cached_property
    def _box_corners(self) -> Array:
        """Corners (K, 8, 3) of the links' boxes, in their own frames."""
        bounds = np.stack([link.bounds() for link in self.links])
        middle, half = bounds.mean(axis=1), np.ptp(bounds, axis=1) / 2
        return middle[:, None] + _BOX_SIGNS * half[:, None]

    @cached_property
    def body_bounds(self) -> Array:
        """As ``rest_bounds``, without stands: the size a person would measure."""
        bounds = np.stack([link.bounds(roles=("body", "handle")) for link in self.links])
        return np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])

    def grip_point(self, part: int) -> Array:
        """The point (3,) of a part, in its own frame, where a hand moves it most easily.

        The middle of its handle; without one, of what lies farthest along a slide or farthest
        from a hinge: a lid's front edge. Privileged knowledge, for rewards and state observations.
        """
        return self._grip(part)[0].copy()

    def grip_size(self, part: int) -> Array:
        """Extents (3,) along the part's axes of what ``grip_point`` is the middle of, metres."""
        return self._grip(part)[1].copy()

    def _grip(self, part: int) -> tuple[Array, Array]:
        """Middle (3,) and extents (3,) of what a hand takes a part by, in the part's frame."""
        if part not in self._grips:
            corners = self._grip_corners(part)
            self._grips[part] = corners.mean(axis=0), np.ptp(corners, axis=0)
        return self._grips[part]

    @cached_property
    def _grips(self) -> dict[int, tuple[Array, Array]]:
        """What ``_grip`` has found, by part: every episode asks."""
        return {}

    def _grip_corners(self, part: int) -> Array:
        """Points (n, 3) around what a hand takes a part by, in the part's frame."""
        joint = self.joint_of(part)
        handle = self.links[part].bounds(roles=("handle",))
        if np.all(np.isfinite(handle)):
            return handle
        corners = np.concatenate([s.corners_link() for s in self.links[part].shapes])
        axis = np.asarray(joint.axis)
        if joint.type == "prismatic":
            reach = corners @ axis * np.sign(joint.range)
        else:
            arm = corners - np.asarray(joint.pivot)
            reach = np.linalg.norm(arm - np.outer(arm @ axis, axis), axis=1)
        return corners[reach > reach.max() - 0.004]

    def content_hash(self) -> str:
        """SHA-256 of everything that describes the object; equal objects have equal hashes."""
        text = "".join([f"{token}\0" for token in _tokens(self, [])])
        return hashlib.sha256(text.encode()).hexdigest()


def _tokens(value: object, found: list[str]) -> list[str]:
    """Adds a value to a flat, unambiguous sequence of texts."""
    if isinstance(value, tuple):
        found.append(f"tuple {len(value)}")
        # Points: numpy's own repr names the type, and has changed before.
        if all([type(item) is float for item in value]):
            found.extend(map(float.__repr__, value))
            return found
        for item in value:
            _tokens(item, found)
    elif isinstance(value, float):
        found.append(float.__repr__(value))
    elif isinstance(value, (TriangleMesh, Image)):
        found.append(f"{type(value).__name__} {value.digest}")
    elif is_dataclass(value):
        found.append(type(value).__name__)
        for item in fields(value):
            found.append(item.name)
            _tokens(getattr(value, item.name), found)
    elif isinstance(value, Mapping):
        for key in sorted(value):
            found.append(str(key))
            _tokens(value[key], found)
    else:
        found.append(repr(value))
    return found


def canonical_box(bounds: Array) -> tuple[Array, float]:
    """Centre (3,) and scale of a normalised-coordinate box (NPCS, NAOCS).

    A point p has coordinates ``(p - center) / scale + 0.5``; the scale is the box's diagonal, so
    they lie in [0, 1].
    """
    return bounds.mean(axis=0), float(np.linalg.norm(bounds[1] - bounds[0]))
