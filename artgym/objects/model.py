"""The description of an articulated object: geometry, joints, mass, semantics.

Frames: the *object* frame is the root link's, origin on the table under the object's middle, x
towards the side a user faces (the front), z up. Every link's frame coincides with the object's
frame in the rest state (all joints at ``closed``), so a part's pose is the motion of its joints and
the canonical boxes of the paper (NPCS, NAOCS) are axis-aligned there.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from artgym.errors import InvalidArgumentError, UnknownNameError
from artgym.geometry import transforms
from artgym.geometry.screw import JointType, joint_motion

Vector = tuple[float, float, float]
Array = NDArray[np.floating]


@dataclass(frozen=True, kw_only=True)
class Material:
    """How a surface looks.

    Attributes:
        color: linear RGB in [0, 1].
        roughness: 0 mirror, 1 matt.
        metallic: 0 dielectric, 1 metal.
    """

    color: Vector
    roughness: float = 0.6
    metallic: float = 0.0


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
        signs = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij"), -1).reshape(-1, 3)
        return signs * np.asarray(self.half_size)


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
class Shape:
    """A convex piece of a link: at once what is seen and what collides.

    Attributes:
        geometry: the primitive.
        position: its centre in the link's frame, metres.
        rotation: its axes in the link's frame, rows of a 3x3 matrix.
        material: how it looks.
    """

    geometry: Box | Cylinder
    position: Vector
    material: Material
    rotation: tuple[Vector, Vector, Vector] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))

    @cached_property
    def T_link_shape(self) -> Array:
        """Pose (4, 4) of the primitive's frame in the link's."""
        return transforms.transform_from(self.rotation, self.position)

    def corners_link(self) -> Array:
        """Points (n, 3) in the link's frame whose hull holds the shape."""
        return transforms.apply(self.T_link_shape, self.geometry.corners())


@dataclass(frozen=True, kw_only=True)
class Link:
    """A rigid body.

    Attributes:
        name: unique in its object; for movable parts the word a person would use.
        shapes: its convex pieces.
        density: kg per cubic metre, uniform.
        friction: Coulomb coefficient of its surface.
    """

    name: str
    shapes: tuple[Shape, ...]
    density: float
    friction: float = 0.8

    @cached_property
    def mass(self) -> float:
        """Kilograms."""
        return self.density * sum(s.geometry.volume for s in self.shapes)

    @cached_property
    def center_of_mass(self) -> Array:
        """(3,) in the link's frame, metres."""
        weights = np.array([s.geometry.volume for s in self.shapes])
        centers = np.array([s.position for s in self.shapes], dtype=float)
        return weights @ centers / weights.sum()

    @cached_property
    def inertia(self) -> Array:
        """(3, 3), kg m^2, about the centre of mass, in the axes of the link's frame."""
        center, total = self.center_of_mass, np.zeros((3, 3))
        for shape in self.shapes:
            mass = self.density * shape.geometry.volume
            R = np.asarray(shape.rotation, dtype=float)
            d = np.asarray(shape.position) - center
            total += mass * (R @ shape.geometry.unit_inertia @ R.T)
            total += mass * (d @ d * np.eye(3) - np.outer(d, d))
        return total

    def bounds(self) -> Array:
        """Axis-aligned box (2, 3), min and max, in the link's frame."""
        corners = np.concatenate([s.corners_link() for s in self.shapes])
        return np.stack([corners.min(axis=0), corners.max(axis=0)])


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
    """

    object_id: str
    category: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    attributes: Mapping[str, str | float] = field(default_factory=dict)

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

    @cached_property
    def rest_bounds(self) -> Array:
        """Axis-aligned box (2, 3) of the whole object at rest, object frame: NAOCS's box."""
        bounds = np.stack([link.bounds() for link in self.links])
        return np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])

    def grip_point(self, part: int) -> Array:
        """The point (3,) of a part, in its own frame, that its joint moves most plainly.

        The middle of what lies farthest along a slide, or farthest from a hinge: a drawer's
        handle, a lid's front edge. Privileged knowledge, for rewards and state observations.
        """
        joint = self.joint_of(part)
        corners = np.concatenate([s.corners_link() for s in self.links[part].shapes])
        axis = np.asarray(joint.axis)
        if joint.type == "prismatic":
            reach = corners @ axis * np.sign(joint.range)
        else:
            arm = corners - np.asarray(joint.pivot)
            reach = np.linalg.norm(arm - np.outer(arm @ axis, axis), axis=1)
        return corners[reach > reach.max() - 0.004].mean(axis=0)

    def content_hash(self) -> str:
        """SHA-256 of everything that describes the object; equal objects have equal hashes."""
        digest = hashlib.sha256()
        for token in _tokens(self):
            digest.update(token.encode())
            digest.update(b"\0")
        return digest.hexdigest()


def _tokens(value: object) -> Iterator[str]:
    """A value as a flat, unambiguous sequence of texts."""
    if is_dataclass(value):
        yield type(value).__name__
        for item in fields(value):
            yield item.name
            yield from _tokens(getattr(value, item.name))
    elif isinstance(value, Mapping):
        for key in sorted(value):
            yield str(key)
            yield from _tokens(value[key])
    elif isinstance(value, tuple):
        yield f"tuple {len(value)}"
        for item in value:
            yield from _tokens(item)
    else:
        yield repr(value)


def canonical_box(bounds: Array) -> tuple[Array, float]:
    """Centre (3,) and scale of a normalised-coordinate box (NPCS, NAOCS).

    A point p has coordinates ``(p - center) / scale + 0.5``; the scale is the box's diagonal, so
    they lie in [0, 1].
    """
    return bounds.mean(axis=0), float(np.linalg.norm(bounds[1] - bounds[0]))
