"""Stands that carry small objects above the table, where a hand can close around a part.

A small object is laid out in a frame of its own, its *layout*: length along x, thickness along z.
A ``Mount`` turns the layout as the object shall be held and moves it over the origin; a stand then
reaches from the table to a point of the object's fixed link.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from artgym.geometry import transforms
from artgym.geometry.rotations import frame_from_z
from artgym.objects.model import Cylinder, Material, Shape, Vector
from artgym.objects.procedural.shapes import (
    box_between,
    cylinder_along,
    metal,
    uniform,
    with_role,
    wood,
)

Array = NDArray[np.floating]


@dataclass(frozen=True, kw_only=True)
class Mount:
    """Where a layout is held.

    Attributes:
        T_object_layout: its pose (4, 4) in the object's frame.
    """

    T_object_layout: Array

    @property
    def R_object_layout(self) -> tuple[Vector, Vector, Vector]:
        """The layout's axes in the object's frame, rows of a rotation matrix."""
        return _rows(self.T_object_layout[:3, :3])

    @classmethod
    def over_origin(cls, shapes: Iterable[Shape], R_object_layout: Any, low: float) -> Mount:
        """Turned by a rotation (3, 3), its middle over the origin, its lowest point at z = low."""
        corners = np.concatenate([s.corners_link() for s in shapes]) @ np.asarray(R_object_layout).T
        least, most = corners.min(axis=0), corners.max(axis=0)
        shift = -(least + most) / 2
        shift[2] = low - least[2]
        return cls(T_object_layout=transforms.transform_from(R_object_layout, shift))

    def shapes(self, shapes: Iterable[Shape]) -> tuple[Shape, ...]:
        """Shapes of the layout, in the object's frame."""
        return tuple(
            _with_pose(shape, self.T_object_layout @ shape.T_link_shape) for shape in shapes
        )

    def point(self, point_layout: Iterable[float]) -> Vector:
        """A point of the layout, in the object's frame."""
        return _vector(transforms.apply(self.T_object_layout, [tuple(point_layout)])[0])

    def direction(self, direction_layout: Iterable[float]) -> Vector:
        """A direction of the layout, in the object's frame."""
        return _vector(transforms.rotate(self.T_object_layout, [tuple(direction_layout)])[0])


def stand(
    rng: np.random.Generator,
    point: Iterable[float],
    away: Iterable[float],
    radius: float = 0.004,
) -> tuple[Shape, ...]:
    """A clamp at a point of the object, a post and a plate on the table; object frame, metres.

    Args:
        rng: draws sizes, form and look.
        point: where it touches the object.
        away: unit direction out of the object there, level or downwards.
        radius: of the post.
    """
    look = _look(rng)
    start, direction = np.asarray(tuple(point)), np.asarray(tuple(away))
    elbow = start + uniform(rng, (0.016, 0.026)) * direction
    return with_role(
        "stand",
        (
            clamp(start, direction, radius, look),
            rod(start, elbow, radius, look),
            post(elbow, radius, look),
            plate(rng, elbow, look),
        ),
    )


def clamp(point: Array, away: Array, radius: float, look: Material) -> Shape:
    """A short thick stub that seems to hold the object at a point."""
    return rod(point - 0.0005 * away, point + 0.008 * away, 1.7 * radius, look)


def post(top: Array, radius: float, look: Material) -> Shape:
    """An upright rod from the table to a point."""
    # It ends in the middle of the arm it meets, rounded off by the arm's own radius.
    height = float(top[2]) + 0.8 * radius
    return cylinder_along("z", (top[0], top[1], height / 2), radius, height, look)


def plate(rng: np.random.Generator, over: Array, look: Material) -> Shape:
    """A round or square foot on the table under a point."""
    half, thickness = uniform(rng, (0.030, 0.045)), uniform(rng, (0.005, 0.010))
    x, y = float(over[0]), float(over[1])
    if rng.random() < 0.5:
        return cylinder_along("z", (x, y, thickness / 2), half, thickness, look)
    return box_between((x - half, y - half, 0.0), (x + half, y + half, thickness), look)


def rod(start: Iterable[float], end: Iterable[float], radius: float, look: Material) -> Shape:
    """A cylinder from one point to another, metres."""
    low, high = np.asarray(tuple(start), dtype=float), np.asarray(tuple(end), dtype=float)
    length = float(np.linalg.norm(high - low))
    # A cylinder's own axis is x.
    R = frame_from_z((high - low) / length)[:, [2, 0, 1]]
    shape = Shape(
        geometry=Cylinder(radius=radius, half_length=length / 2),
        position=(0.0, 0.0, 0.0),
        material=look,
    )
    return _with_pose(shape, transforms.transform_from(R, (low + high) / 2))


def _with_pose(shape: Shape, T_link_shape: Array) -> Shape:
    return replace(
        shape, position=_vector(T_link_shape[:3, 3]), rotation=_rows(T_link_shape[:3, :3])
    )


def _rows(R: Array) -> tuple[Vector, Vector, Vector]:
    return cast("tuple[Vector, Vector, Vector]", tuple(_vector(row) for row in R))


def _vector(values: Array) -> Vector:
    return cast(Vector, tuple(float(v) for v in values))


def _look(rng: np.random.Generator) -> Material:
    """Black, steel or wood: what stands are made of."""
    kind = rng.random()
    if kind < 0.4:
        shade = uniform(rng, (0.02, 0.15))
        return Material(color=(shade, shade, shade), roughness=0.5)
    return metal(rng) if kind < 0.8 else wood(rng)
