"""Safes: a steel box with a thick door hinged at a side, revolute about the vertical.

Families: "hotel" (low and wide, keypad and display), "office" (upright, combination dial or
keypad and a handle), "vault" (thick walls, spoked handwheel). Handles: "lever", "bar", "knob",
"wheel" (rods about a hub, with or without a rim), all rigid on the door. Locks: "keypad", "dial".
The hinge is on the left or on the right as the user sees it (left is y < 0).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from artgym.objects.model import ArticulatedObject, Link, Material, Shape, Vector
from artgym.objects.procedural.cabinetry import (
    BLACK,
    CHROME,
    RUBBER,
    STEEL,
    Rectangle,
    badge,
    button_grid,
    display,
    feet,
    hollow_body,
    pull_bar,
    side_hinge,
)
from artgym.objects.procedural.shapes import (
    Interval,
    box_between,
    cylinder_along,
    darker,
    frustum,
    turned,
    uniform,
    with_role,
)

FAMILIES = ("hotel", "office", "vault")
HANDLES = ("lever", "bar", "knob", "wheel")

Side = Literal["left", "right"]

#: Width, depth and height of the body, thickness of walls and of the door, metres.
_SIZES: dict[str, tuple[Interval, Interval, Interval, Interval, Interval]] = {
    "hotel": ((0.33, 0.45), (0.25, 0.38), (0.19, 0.28), (0.006, 0.012), (0.012, 0.022)),
    "office": ((0.30, 0.42), (0.28, 0.42), (0.34, 0.58), (0.022, 0.038), (0.030, 0.048)),
    "vault": ((0.36, 0.52), (0.32, 0.46), (0.38, 0.60), (0.035, 0.055), (0.045, 0.065)),
}
_GRIPS: dict[str, tuple[float, float, float, float]] = {
    "hotel": (0.25, 0.20, 0.55, 0.0),
    "office": (0.50, 0.30, 0.0, 0.20),
    "vault": (0.10, 0.0, 0.0, 0.90),
}
_GAP = 0.002


def make_safe(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A safe of 0.2-0.6 m; its door opens by 95-120 degrees."""
    family = str(rng.choice(FAMILIES, p=(0.35, 0.35, 0.30)))
    handle = str(rng.choice(HANDLES, p=_GRIPS[family]))
    if family == "hotel":
        lock = "keypad"
    else:
        lock = "keypad" if handle != "wheel" and rng.random() < 0.4 else "dial"
    side: Side = "left" if rng.random() < 0.65 else "right"
    inset = bool(family == "hotel" or rng.random() < 0.4)
    width, depth, height, wall, thickness = (uniform(rng, i) for i in _SIZES[family])

    shell = _enamel(rng, family)
    front = shell if rng.random() < 0.7 else darker(shell, uniform(rng, (0.6, 1.3)))
    fittings = CHROME if rng.random() < 0.5 else _brass(rng) if rng.random() < 0.4 else STEEL
    ground = uniform(rng, (0.004, 0.010)) if family == "hotel" else uniform(rng, (0.012, 0.035))
    x, y = depth / 2, width / 2
    z0, z1 = ground, ground + height
    opening = (-y + wall, z0 + wall, y - wall, z1 - wall)
    felt = Material(color=_felt(rng), roughness=0.95)
    shelf_back = -x + wall
    body = [
        *hollow_body(
            (-x, -y, z0), (x, y, z1), opening, shelf_back, shell, felt, min(0.004, wall / 2)
        ),
        *(feet if family == "office" else _runners)((-x, -y, z0), (x, y, z1)),
    ]
    rear = x - thickness if inset else x + _GAP
    if height > 0.3:
        z = z0 + uniform(rng, (0.4, 0.6)) * height
        inside = min(x, rear) - 0.05
        body.append(
            box_between((shelf_back, opening[0], z - 0.004), (inside, opening[2], z + 0.004), felt)
        )

    if inset:
        place = (opening[0] + _GAP, opening[1] + _GAP, opening[2] - _GAP, opening[3] - _GAP)
    else:
        margin = uniform(rng, (0.0, 0.5)) * wall
        place = (-y + margin, z0 + margin, y - margin, z1 - margin)
    face = rear + thickness
    hinge_y = place[0] if side == "left" else place[2]
    outwards = -1.0 if side == "left" else 1.0
    knuckle = uniform(rng, (0.007, 0.010)) if family == "hotel" else uniform(rng, (0.009, 0.014))
    # The barrels lie before the seam of an inset door and beside an overlaid one.
    pivot: Vector = (
        (face + knuckle + 0.0005, hinge_y, (z0 + z1) / 2)
        if inset
        else (rear + max(thickness / 2, knuckle), hinge_y + outwards * knuckle, (z0 + z1) / 2)
    )
    fixed, moving = _hinges(pivot, knuckle, height, outwards, (x, rear, y), inset, fittings)
    body += fixed

    door = [
        box_between((rear, place[0], place[1]), (face, place[2], place[3]), front),
        *moving,
        *_bolts(opening, rear, -outwards),
        *_fittings(rng, family, handle, lock, place, face, -outwards, front, fittings),
    ]
    mass = uniform(rng, {"hotel": (1.2, 2.2), "office": (1.6, 2.8), "vault": (2.0, 3.4)}[family])
    link = Link(
        name="door",
        shapes=tuple(door),
        density=mass / sum(s.geometry.volume for s in door),
        friction=uniform(rng, (0.6, 1.0)),
    )
    return ArticulatedObject(
        object_id=object_id,
        category="safe",
        links=(Link(name="body", shapes=tuple(body), density=1500.0), link),
        joints=(side_hinge(rng, "hinge", "body", link, pivot, side, grip_force=(1.0, 3.0)),),
        attributes={"family": family, "handle": handle, "lock": lock, "hinge": side},
    )


def _runners(low: Vector, high: Vector) -> tuple[Shape, ...]:
    """Two strips of rubber under a box."""
    return tuple(
        box_between((x - 0.015, 0.9 * low[1], 0.0), (x + 0.015, 0.9 * high[1], low[2]), RUBBER)
        for x in (0.8 * low[0], 0.8 * high[0])
    )


def _enamel(rng: np.random.Generator, family: str) -> Material:
    """Greys, black, dark green, blue or red, beige: hammered or smooth paint."""
    colors: tuple[Vector, ...] = (
        (0.05, 0.05, 0.055),
        (0.16, 0.17, 0.18),
        (0.32, 0.33, 0.34),
        (0.52, 0.51, 0.48),
        (0.62, 0.57, 0.46),
        (0.04, 0.11, 0.07),
        (0.04, 0.08, 0.16),
        (0.22, 0.05, 0.04),
        (0.70, 0.71, 0.72),
    )
    first = 3 if family == "hotel" else len(colors)
    r, g, b = colors[int(rng.integers(first if rng.random() < 0.6 else len(colors)))]
    shade = uniform(rng, (0.8, 1.25))
    return Material(
        color=(min(r * shade, 0.9), min(g * shade, 0.9), min(b * shade, 0.9)),
        roughness=uniform(rng, (0.35, 0.6)),
        metallic=uniform(rng, (0.0, 0.4)),
    )


def _brass(rng: np.random.Generator) -> Material:
    v = uniform(rng, (0.5, 0.8))
    return Material(color=(v, 0.78 * v, 0.38 * v), roughness=0.3, metallic=0.8)


def _felt(rng: np.random.Generator) -> Vector:
    """The colour of the lining."""
    colors: tuple[Vector, ...] = (
        (0.20, 0.03, 0.04),
        (0.03, 0.12, 0.08),
        (0.25, 0.25, 0.26),
        (0.05, 0.06, 0.14),
        (0.45, 0.40, 0.33),
    )
    return colors[int(rng.integers(len(colors)))]


def _hinges(
    pivot: Vector,
    radius: float,
    height: float,
    outwards: float,
    edges: tuple[float, float, float],
    inset: bool,
    look: Material,
) -> tuple[list[Shape], list[Shape]]:
    """Two hinges: a knuckle on the body below one on the door; the body's shapes, the door's.

    Args:
        pivot: a point of the axis.
        radius: of the knuckles.
        height: of the body.
        outwards: the sign of y that leads away from the door.
        edges: x of the body's front, x of the door's inner face, half the body's width.
        inset: whether the door lies in the body's mouth.
        look: of the hinges.
    """
    x, y, middle = pivot
    front, rear, half = edges
    length = min(0.055, 0.16 * height)
    fixed, moving = [], []
    for s in (-1.0, 1.0):
        z = middle + s * 0.32 * height
        low, high = z - length / 2 - 0.0005, z + length / 2 + 0.0005
        fixed.append(cylinder_along("z", (x, y, low), radius, length, look))
        moving.append(cylinder_along("z", (x, y, high), radius, length, look))
        # A leaf ties the body's knuckle to the body; the door's touches the door.
        if inset:
            near, far = sorted((y, outwards * (half - 0.002)))
            fixed.append(
                box_between((front, near, low - length / 2), (front + 0.003, far, z - 0.0005), look)
            )
        else:
            near, far = sorted((y - outwards * radius, y + outwards * radius))
            fixed.append(
                box_between(
                    (front - 0.02, near, low - 0.4 * length),
                    (min(rear - 0.0005, x), far, low + 0.4 * length),
                    look,
                )
            )
    return fixed, moving


def _bolts(
    opening: Rectangle,
    rear: float,
    towards_free: float,
) -> list[Shape]:
    """An inner plate, and the bolts that would lock the door: seen when it stands open."""
    plate = 0.012
    margin = 0.020
    inner = (opening[0] + margin, opening[1] + margin, opening[2] - margin, opening[3] - margin)
    shapes = [box_between((rear - plate, inner[0], inner[1]), (rear, inner[2], inner[3]), STEEL)]
    edge = inner[2] if towards_free > 0 else inner[0]
    middle, reach = (inner[1] + inner[3]) / 2, 0.012
    shapes += [
        cylinder_along(
            "y", (rear - plate / 2, edge + towards_free * reach / 2, z), 0.0055, reach, CHROME
        )
        for z in (middle - 0.25 * (inner[3] - inner[1]), middle + 0.25 * (inner[3] - inner[1]))
    ]
    return shapes


def _fittings(
    rng: np.random.Generator,
    family: str,
    handle: str,
    lock: str,
    place: Rectangle,
    face: float,
    towards_free: float,
    front: Material,
    look: Material,
) -> list[Shape]:
    """Lock, handle and plate on the door's face."""
    y_low, z_low, y_high, z_high = place
    middle, width, height = (y_low + y_high) / 2, y_high - y_low, z_high - z_low
    free = y_high if towards_free > 0 else y_low
    shapes: list[Shape] = []
    if family == "hotel":
        # Keypad and display in the middle, the handle beside them, towards the free edge.
        grip_y = free - towards_free * uniform(rng, (0.045, 0.065))
        center = middle - towards_free * 0.12 * width
        half_y, half_z = uniform(rng, (0.040, 0.055)), min(0.065, 0.36 * height)
        z = (z_low + z_high) / 2
        area = (center - half_y, z - half_z, center + half_y, z + half_z)
        shapes += _keypad(rng, face, area, front)
        grip_z = z
    else:
        upper = z_high - uniform(rng, (0.26, 0.34)) * height
        grip_z = z_low + uniform(rng, (0.36, 0.46)) * height
        grip_y = middle + towards_free * uniform(rng, (0.05, 0.2)) * width
        if handle == "wheel":
            grip_y = middle + towards_free * uniform(rng, (0.02, 0.10)) * width
        if lock == "keypad":
            half_y, half_z = uniform(rng, (0.035, 0.045)), min(0.050, 0.12 * height)
            area = (middle - half_y, upper - half_z, middle + half_y, upper + half_z)
            shapes += _keypad(rng, face, area, front)
        else:
            shapes += _dial(rng, face, middle, upper + 0.02, look)
        if rng.random() < 0.6:
            shapes.append(badge(face, middle, z_high - 0.045, uniform(rng, (0.05, 0.09)), look))
        if handle != "wheel" and rng.random() < 0.4:
            shapes += _border(place, face, darker(look, 0.8))
    if handle == "wheel":
        return [*shapes, *_wheel(rng, face, grip_y, grip_z, 0.27 * min(width, height), look)]
    if handle == "knob":
        return [*shapes, *_turn_knob(rng, face, grip_y, grip_z, look)]
    if handle == "bar":
        length = min(uniform(rng, (0.10, 0.16)), 0.6 * height)
        bar = pull_bar(
            face,
            free - towards_free * uniform(rng, (0.045, 0.065)),
            grip_z,
            "z",
            length,
            look,
            thickness=uniform(rng, (0.010, 0.016)),
            clearance=uniform(rng, (0.028, 0.038)),
            form=("round", "square", "strap")[int(rng.integers(3))],
        )
        return [*shapes, *bar]
    return [*shapes, *_lever(rng, face, grip_y, grip_z, -towards_free, height, look)]


def _keypad(
    rng: np.random.Generator, face: float, area: Rectangle, front: Material
) -> tuple[Shape, ...]:
    """A dark plate with a display above three by three or four by three keys."""
    y_low, z_low, y_high, z_high = area
    plate = box_between((face, y_low, z_low), (face + 0.004, y_high, z_high), darker(BLACK, 2.0))
    split = z_low + 0.70 * (z_high - z_low)
    colors: tuple[Vector, ...] = ((0.1, 0.9, 0.3), (0.9, 0.1, 0.05), (0.2, 0.6, 0.9))
    color = colors[int(rng.integers(len(colors)))]
    v = uniform(rng, (0.3, 0.9))
    keys = Material(color=(v, v, v), roughness=0.5)
    top = face + 0.004
    inset = 0.1 * (y_high - y_low)
    return (
        plate,
        *display(top, (y_low + inset, split, y_high - inset, z_high - 0.006), color, 3),
        *button_grid(
            top,
            (y_low + inset, z_low + 0.005, y_high - inset, split),
            int(rng.integers(3, 5)),
            3,
            keys,
        ),
    )


def _dial(
    rng: np.random.Generator, face: float, y: float, z: float, look: Material
) -> tuple[Shape, ...]:
    """A combination dial: a ring, a black tapered disc with marks, a small grip."""
    r = uniform(rng, (0.028, 0.040))
    white = Material(color=(0.85, 0.85, 0.83))
    mark = box_between(
        (face + 0.0145, y - 0.001, z + 0.62 * r), (face + 0.0155, y + 0.001, z + 0.86 * r), white
    )
    marks = [turned(mark, (1.0, 0.0, 0.0), (face, y, z), a) for a in np.arange(4) * np.pi / 2]
    return (
        cylinder_along("x", (face + 0.003, y, z), 1.25 * r, 0.006, look),
        frustum("x", (face + 0.006, y, z), (r, r), (0.92 * r, 0.92 * r), 0.009, BLACK, 20),
        *marks,
        cylinder_along("x", (face + 0.021, y, z), 0.45 * r, 0.012, look),
    )


def _border(place: Rectangle, face: float, look: Material) -> tuple[Shape, ...]:
    """A thin line around the door, as painted or beaten into old safes."""
    m, t = 0.022, 0.003
    y0, z0, y1, z1 = place[0] + m, place[1] + m, place[2] - m, place[3] - m
    sides = ((y0, z0, y1, z0 + t), (y0, z1 - t, y1, z1), (y0, z0, y0 + t, z1), (y1 - t, z0, y1, z1))
    return tuple(box_between((face, a, b), (face + 0.0008, c, d), look) for a, b, c, d in sides)


def _lever(
    rng: np.random.Generator,
    face: float,
    y: float,
    z: float,
    direction: float,
    height: float,
    look: Material,
) -> tuple[Shape, ...]:
    """A hub and an arm before the door; it points down, sideways or slantwise."""
    length, r = min(uniform(rng, (0.085, 0.125)), 0.4 * height), uniform(rng, (0.007, 0.010))
    reach = face + uniform(rng, (0.034, 0.046))
    angle = float(rng.choice((0.0, 0.5 * np.pi, 0.25 * np.pi))) * direction
    hub_radius = uniform(rng, (0.016, 0.024))
    hub = (
        cylinder_along("x", (face + 0.004, y, z), 1.4 * hub_radius, 0.008, look),
        cylinder_along("x", ((face + reach) / 2, y, z), hub_radius, reach - face, look),
    )
    arm: tuple[Shape, ...]
    if rng.random() < 0.5:
        arm = (cylinder_along("z", (reach, y, z - length / 2), r, length, look),)
    else:
        arm = (
            frustum(
                "z",
                (reach, y, z - length),
                (0.8 * r, 1.3 * r),
                (r, 0.9 * r),
                length,
                look,
                12,
            ),
        )
    arm = tuple(turned(s, (1.0, 0.0, 0.0), (reach, y, z), angle) for s in arm)
    return (hub[0], *with_role("handle", (hub[1], *arm)))


def _turn_knob(
    rng: np.random.Generator, face: float, y: float, z: float, look: Material
) -> tuple[Shape, ...]:
    """A round knob with a raised grip across it, as on small safes."""
    r, deep = uniform(rng, (0.018, 0.026)), uniform(rng, (0.022, 0.030))
    blade = box_between(
        (face + deep, y - 0.25 * r, z - 0.95 * r),
        (face + deep + 0.016, y + 0.25 * r, z + 0.95 * r),
        look,
    )
    blade = turned(blade, (1.0, 0.0, 0.0), (face, y, z), uniform(rng, (-0.8, 0.8)))
    return (
        cylinder_along("x", (face + 0.002, y, z), 1.35 * r, 0.004, darker(look, 0.7)),
        *with_role("handle", (cylinder_along("x", (face + deep / 2, y, z), r, deep, look), blade)),
    )


def _wheel(
    rng: np.random.Generator, face: float, y: float, z: float, radius: float, look: Material
) -> tuple[Shape, ...]:
    """A handwheel: three to five rods about a hub, with knobs at their ends or a rim."""
    radius = min(radius, uniform(rng, (0.070, 0.100)))
    reach = face + uniform(rng, (0.038, 0.050))
    rim = rng.random() < 0.5
    spokes = int(rng.integers(3, 5 if rim else 6))
    r = uniform(rng, (0.006, 0.008))
    hub = uniform(rng, (0.018, 0.026))
    shapes: list[Shape] = [
        cylinder_along("x", (face + 0.004, y, z), 1.5 * hub, 0.008, look),
        cylinder_along("x", ((face + reach) / 2, y, z), 0.6 * hub, reach - face, look),
    ]
    grips: list[Shape] = [cylinder_along("x", (reach, y, z), hub, 0.024, look)]
    pivot = (reach, y, z)
    rod = cylinder_along("z", (reach, y, z + radius / 2), r, radius, look)
    end = cylinder_along("z", (reach, y, z + radius), 1.8 * r, 0.022, look)
    start = uniform(rng, (0.0, 2 * np.pi / spokes))
    angles = start + np.arange(spokes) * 2 * np.pi / spokes
    grips += _around(rod, pivot, angles)
    if rim:
        sides = 11
        half = radius * np.tan(np.pi / sides) + 0.3 * r
        segment = cylinder_along("y", (reach, y, z + radius), 1.1 * r, 2 * half, look)
        grips += _around(segment, pivot, np.arange(sides) * 2 * np.pi / sides)
    else:
        grips += _around(end, pivot, angles)
    return (*shapes, *with_role("handle", grips))


def _around(shape: Shape, pivot: Vector, angles: Sequence[float] | np.ndarray) -> list[Shape]:
    """Copies of a shape turned about an axis along x."""
    return [turned(shape, (1.0, 0.0, 0.0), pivot, float(a)) for a in angles]
