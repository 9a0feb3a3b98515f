"""Lids about horizontal hinges: what holds them, what a hand takes hold of, hollow bodies.

A lid lies on its body and is hinged at the back about -y: its front edge goes up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import numpy as np

from artgym.objects.model import Joint, Link, Material, Shape, Vector
from artgym.objects.procedural.shapes import (
    Interval,
    box_between,
    convex,
    prism,
    turned,
    uniform,
    with_role,
)

#: Axis of a lid that is hinged at the back.
UPWARDS: Vector = (0.0, -1.0, 0.0)
#: Between a lid and what it lies on, metres.
GAP = 0.002

Outline = Sequence[tuple[float, float]]


def lid_link(rng: np.random.Generator, name: str, shapes: Iterable[Shape], mass: Interval) -> Link:
    """A movable part whose mass, kg, is drawn from an interval."""
    pieces = tuple(shapes)
    volume = sum(s.geometry.volume for s in pieces)
    return Link(
        name=name,
        shapes=pieces,
        density=uniform(rng, mass) / volume,
        friction=uniform(rng, (0.6, 1.0)),
    )


def hinge(
    rng: np.random.Generator,
    lid: Link,
    parent: str,
    pivot: tuple[float, float, float],
    open_deg: float,
    axis: Vector = UPWARDS,
    name: str = "hinge",
) -> Joint:
    """A hinge that holds its lid anywhere: dry friction above the largest torque of gravity.

    Args:
        rng: draws friction and damping.
        lid: the child; its mass must be final.
        parent: the link that carries it.
        pivot: a point of the axis, object's frame, metres.
        open_deg: range in degrees.
        axis: horizontal, opening is positive.
        name: of the joint.
    """
    direction = np.asarray(axis, dtype=float)
    arm = lid.center_of_mass - np.asarray(pivot)
    torque = lid.mass * 9.81 * float(np.linalg.norm(np.cross(direction, arm)))
    return Joint(
        name=name,
        type="revolute",
        parent=parent,
        child=lid.name,
        axis=axis,
        pivot=pivot,
        closed=0.0,
        open=float(np.radians(open_deg)),
        friction=torque * uniform(rng, (1.3, 1.7)),
        damping=torque * uniform(rng, (0.02, 0.06)),
    )


# -- what a hand takes hold of -----------------------------------------------------------------


def on_top(
    make: Callable[..., tuple[Shape, ...]],
    rng: np.random.Generator,
    top: float,
    x: float,
    y: float,
    *rest: object,
) -> tuple[Shape, ...]:
    """A handle made for a front that faces +x, standing on a top instead.

    Args:
        make: ``handles.knob_at``, ``handles.bar_at`` ...
        rng: random numbers for it.
        top: height of the surface, metres.
        x: where the handle's middle stands.
        y: the same, along y.
        rest: the maker's further arguments; an upright handle ("z") lies along x.
    """
    lying = make(rng, top, y, -x, *rest)
    return tuple(turned(s, (0.0, 1.0, 0.0), (0.0, 0.0, 0.0), -np.pi / 2) for s in lying)


def lip(
    rng: np.random.Generator,
    front: float,
    bottom: float,
    width: float,
    look: Material,
    reach: Interval = (0.022, 0.028),
    thickness: Interval = (0.005, 0.009),
    y: float = 0.0,
) -> tuple[Shape, ...]:
    """A ledge that stands forward of a lid, for fingers above and below it.

    Args:
        rng: draws reach and thickness.
        front: x of the lid's front face, metres.
        bottom: z of the ledge's underside.
        width: along y.
        look: how it looks.
        reach: how far forward, metres.
        thickness: metres.
        y: its middle.
    """
    end, high = front + uniform(rng, reach), bottom + uniform(rng, thickness)
    plate = box_between((front, y - width / 2, bottom), (end, y + width / 2, high), look)
    return with_role("handle", (plate,))


# -- hollow bodies -----------------------------------------------------------------------------


def tray(
    half: tuple[float, float], low: float, high: float, wall: float, floor: float, look: Material
) -> tuple[Shape, ...]:
    """A rectangular floor with four walls, open above.

    Args:
        half: outer half extents along x and y, metres.
        low: z of the underside.
        high: z of the rim.
        wall: thickness of the walls.
        floor: thickness of the floor.
        look: how it looks.
    """
    x, y = half
    base = low + floor
    return (
        box_between((-x, -y, low), (x, y, base), look),
        box_between((-x, -y, base), (x, -y + wall, high), look),
        box_between((-x, y - wall, base), (x, y, high), look),
        box_between((-x, -y + wall, base), (-x + wall, y - wall, high), look),
        box_between((x - wall, -y + wall, base), (x, y - wall, high), look),
    )


def cap(
    half: tuple[float, float], low: float, high: float, wall: float, roof: float, look: Material
) -> tuple[Shape, ...]:
    """A tray upside down: a roof with four walls, open below; arguments as of ``tray``."""
    x, y = half
    top = high - roof
    return (
        box_between((-x, -y, top), (x, y, high), look),
        box_between((-x, -y, low), (x, -y + wall, top), look),
        box_between((-x, y - wall, low), (x, y, top), look),
        box_between((-x, -y + wall, low), (-x + wall, y - wall, top), look),
        box_between((x - wall, -y + wall, low), (x, y - wall, top), look),
    )


def rounded(half: tuple[float, float], radius: float, arc: int = 2) -> list[tuple[float, float]]:
    """Outline (x, y) of a rectangle with round corners of ``arc`` chords each, metres."""
    points = []
    for corner, (sx, sy) in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
        for k in range(arc + 1):
            angle = (corner + k / arc) * np.pi / 2
            points.append(
                (
                    float(sx * (half[0] - radius) + radius * np.cos(angle)),
                    float(sy * (half[1] - radius) + radius * np.sin(angle)),
                )
            )
    return points


def rounded_walls(
    half: tuple[float, float],
    radius: float,
    low: float,
    high: float,
    wall: float,
    look: Material,
) -> tuple[Shape, ...]:
    """Four walls and eight chords around the corners: 4 boxes, 8 convex pieces.

    Args:
        half: outer half extents along x and y, metres.
        radius: of the outer corners, more than ``wall``.
        low: z of the lower end.
        high: z of the upper end.
        wall: thickness.
        look: how it looks.
    """
    (x, y), r = half, radius
    outer = rounded(half, r)
    inner = rounded((x - wall, y - wall), r - wall)
    # Three points a corner, hence two chords; from its third point a straight wall goes on.
    chords = [k for k in range(len(outer)) if k % 3 != 2]
    return (
        box_between((-x + r, -y, low), (x - r, -y + wall, high), look),
        box_between((-x + r, y - wall, low), (x - r, y, high), look),
        box_between((-x, -y + r, low), (-x + wall, y - r, high), look),
        box_between((x - wall, -y + r, low), (x, y - r, high), look),
        *(
            prism([outer[k], outer[k + 1], inner[k + 1], inner[k]], "z", low, high, look)
            for k in chords
        ),
    )


def rounded_plate(
    half: tuple[float, float], radius: float, low: float, high: float, look: Material
) -> Shape:
    """A slab with round corners; arguments as of ``rounded_walls``."""
    return prism(rounded(half, radius), "z", low, high, look)


def ring_wall(
    low: tuple[Outline, Outline],
    high: tuple[Outline, Outline],
    z: tuple[float, float],
    look: Material,
) -> tuple[Shape, ...]:
    """A closed wall of convex panels between outlines of equally many points.

    Args:
        low: outer and inner outline (x, y) of the lower end, metres.
        high: of the upper end.
        z: of both ends.
        look: how it looks.
    """
    corners = [
        [(x, y, height) for x, y in outline]
        for height, pair in zip(z, (low, high), strict=True)
        for outline in pair
    ]
    count = len(corners[0])
    return tuple(
        convex([ring[k] for ring in corners for k in (i, (i + 1) % count)], look)
        for i in range(count)
    )
