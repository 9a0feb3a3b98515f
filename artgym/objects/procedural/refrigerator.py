"""Refrigerators: insulated cabinets with one or two doors on upright hinges.

Families: "mini" (one door, below a worktop's height), "tall" (one door), "top_freezer" (two doors,
one above the other, ``door_1`` the larger), "bottom_freezer" (the same with the freezer below),
"side_by_side" (two doors hinged on opposite sides), "retro" (one rounded door). Handles: "bar"
(upright, round or square), "strap" (bent back at its ends), "lip" (an upright blade along the free
edge), "latch" (a lever across the free edge). A door hinged on the left turns about -z, one on the
right about +z.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from artgym.objects.model import ArticulatedObject, Joint, Link, Material, Shape, Vector
from artgym.objects.procedural.cabinetry import (
    BLACK,
    CHROME,
    GLASS,
    BarForm,
    Rectangle,
    badge,
    bar_form,
    display,
    door_panel,
    enamel,
    feet,
    finish,
    hollow_body,
    latch,
    lip,
    plinth,
    pull_bar,
    rounded_slab,
    side_hinge,
    trim,
)
from artgym.objects.procedural.shapes import box_between, cylinder_along, darker, uniform

FAMILIES = ("mini", "tall", "top_freezer", "bottom_freezer", "side_by_side", "retro")
HANDLES = ("bar", "strap", "lip", "latch")

Side = Literal["left", "right"]

_GAP = 0.003
_WIDTH = {
    "mini": (0.44, 0.55),
    "tall": (0.54, 0.60),
    "top_freezer": (0.54, 0.70),
    "bottom_freezer": (0.58, 0.70),
    "side_by_side": (0.83, 0.92),
    "retro": (0.50, 0.62),
}
_HEIGHT = {
    "mini": (0.50, 0.86),
    "tall": (1.25, 1.82),
    "top_freezer": (1.35, 1.78),
    "bottom_freezer": (1.60, 1.85),
    "side_by_side": (1.68, 1.82),
    "retro": (0.80, 1.50),
}
_DEPTH = {
    "mini": (0.45, 0.54),
    "tall": (0.56, 0.64),
    "top_freezer": (0.58, 0.68),
    "bottom_freezer": (0.60, 0.68),
    "side_by_side": (0.62, 0.70),
    "retro": (0.50, 0.62),
}
_WHITE = Material(color=(0.80, 0.82, 0.83), roughness=0.4)
_SHELF = Material(color=(0.55, 0.70, 0.72), roughness=0.1)
_DRAWER = Material(color=(0.62, 0.70, 0.74), roughness=0.2)
_FOOD: tuple[Vector, ...] = (
    (0.05, 0.30, 0.06),
    (0.75, 0.08, 0.05),
    (0.85, 0.55, 0.05),
    (0.85, 0.85, 0.80),
    (0.20, 0.08, 0.03),
    (0.10, 0.25, 0.65),
)

_PAPER: tuple[Vector, ...] = ((0.85, 0.80, 0.35), (0.85, 0.85, 0.83), (0.60, 0.75, 0.85))


@dataclass(frozen=True, kw_only=True)
class _Compartment:
    """A room and the door before it.

    Attributes:
        cover: the door's rectangle.
        mouth: the room's opening.
        side: of the hinge.
        grip: height of the handle's middle.
        reach: the most that a handle may be long.
        cold: a freezer, without bottles.
    """

    cover: Rectangle
    mouth: Rectangle
    side: Side
    grip: float
    reach: float
    cold: bool


def make_refrigerator(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A refrigerator of 0.5-1.85 m height; its doors open by 95-120 degrees."""
    family = str(rng.choice(FAMILIES, p=(0.22, 0.16, 0.2, 0.12, 0.16, 0.14)))
    odds = (0.3, 0.1, 0.15, 0.45) if family == "retro" else (0.45, 0.25, 0.3, 0.0)
    handle = str(rng.choice(HANDLES, p=odds))
    width, height = uniform(rng, _WIDTH[family]), uniform(rng, _HEIGHT[family])
    depth = uniform(rng, _DEPTH[family])
    thickness = uniform(rng, (0.040, 0.062))
    wall = uniform(rng, (0.032, 0.045))
    base = uniform(rng, (0.02, 0.05) if family in ("mini", "retro") else (0.04, 0.09))
    shell = enamel(rng) if family == "retro" and rng.random() < 0.85 else finish(rng)
    front_look = shell if family == "retro" or rng.random() < 0.75 else finish(rng)
    grip_look = trim(rng, front_look)
    rounded = family == "retro" or bool(rng.random() < 0.35)

    y, front = width / 2, depth / 2
    body_front = front - thickness - 0.004
    back = -depth / 2 + wall
    rooms = _compartments(rng, family, y, base, height, wall)
    mouth = _around([room.mouth for room in rooms])
    low, high = (-depth / 2, -y, base), (body_front, y, height)
    body = list(
        hollow_body(
            low,
            high,
            mouth,
            back,
            shell,
            _WHITE,
            radius=wall - 0.004 if family == "retro" else 0.0,
        )
    )
    if len(rooms) == 2:
        body.append(_divider(rooms, back, body_front))
    for room in rooms:
        body += _shelves(rng, room, back, body_front - 0.10)
    if family in ("mini", "retro"):
        body += feet(low, high, BLACK if rng.random() < 0.6 else CHROME)
    else:
        body.append(plinth((low[0], low[1] + 0.005, low[2]), (high[0], y - 0.005, high[2]), 0.02))
    if family in ("tall", "top_freezer", "bottom_freezer") and rng.random() < 0.5:
        # Covers of the upper hinge.
        side = -1.0 if rooms[0].side == "left" else 1.0
        body.append(
            box_between(
                (body_front - 0.06, min(side * y, side * (y - 0.05)), height),
                (body_front, max(side * y, side * (y - 0.05)), height + 0.012),
                darker(shell, 0.6),
            )
        )

    links: list[Link] = [Link(name="body", shapes=tuple(body), density=60.0)]
    joints: list[Joint] = []
    dispenser = family == "side_by_side" and bool(rng.random() < 0.6)
    screen = not dispenser and family not in ("mini", "retro") and bool(rng.random() < 0.3)
    length_share, inset = uniform(rng, (0.3, 0.75)), uniform(rng, (0.030, 0.045))
    form = bar_form(rng, handle)
    bar = (uniform(rng, (0.012, 0.020)), uniform(rng, (0.032, 0.044)))
    for i, room in enumerate(rooms, start=1):
        shapes = _door(rng, family, room, front, thickness, front_look, rounded)
        c = room.cover
        if dispenser and i == 2:
            shapes += _dispenser(front, c)
        if screen and i == 1:
            middle = (c[1] + c[3]) / 2 if c[3] - c[1] < 0.9 else 1.25
            y_mid = (c[0] + c[2]) / 2
            area = (y_mid - 0.05, middle + 0.02, y_mid + 0.05, middle + 0.055)
            shapes += display(front, area, (0.2, 0.7, 0.9), 3)
        if i == 1:
            y_mid = (c[0] + c[2]) / 2
            shapes.append(badge(front, y_mid, c[3] - 0.07 * (c[3] - c[1]) ** 0.5, 0.09))
            shapes += _notes(rng, front, c)
        shapes += _grip(handle, form, bar, front, room, inset, length_share, grip_look)
        mass = uniform(rng, (0.9, 1.6)) + 1.6 * (c[3] - c[1]) * (c[2] - c[0])
        link = Link(
            name=f"door_{i}",
            shapes=tuple(shapes),
            density=mass / sum(s.geometry.volume for s in shapes),
            friction=uniform(rng, (0.6, 1.0)),
        )
        hinge_y = c[0] + 0.012 if room.side == "left" else c[2] - 0.012
        pivot = (front - thickness / 2, hinge_y, 0.0)
        links.append(link)
        joints.append(side_hinge(rng, f"hinge_{i}", "body", link, pivot, room.side))
    return ArticulatedObject(
        object_id=object_id,
        category="refrigerator",
        links=tuple(links),
        joints=tuple(joints),
        attributes={"family": family, "handle": handle},
    )


def _compartments(
    rng: np.random.Generator, family: str, y: float, base: float, height: float, wall: float
) -> tuple[_Compartment, ...]:
    """One or two rooms, the larger one first."""
    half, low, high = y - 0.002, base + 0.003, height - 0.002
    inner = y - wall
    side: Side = "left" if rng.random() < 0.5 else "right"
    if family == "side_by_side":
        split = -y * uniform(rng, (0.0, 0.22))
        grip, reach = base + 0.52 * (height - base), 0.55 * (height - base)
        return (
            _Compartment(
                cover=(split + _GAP / 2, low, half, high),
                mouth=(split + wall / 2, base + wall, inner, height - wall),
                side="right",
                grip=grip,
                reach=reach,
                cold=False,
            ),
            _Compartment(
                cover=(-half, low, split - _GAP / 2, high),
                mouth=(-inner, base + wall, split - wall / 2, height - wall),
                side="left",
                grip=grip,
                reach=reach,
                cold=True,
            ),
        )
    if family in ("top_freezer", "bottom_freezer"):
        share = uniform(rng, (0.27, 0.36))
        above = family == "top_freezer"
        split = high - share * (high - low) if above else low + share * (high - low)
        upper = ((-half, split + _GAP / 2, half, high), (-inner, split + wall / 2, inner, high))
        lower = ((-half, low, half, split - _GAP / 2), (-inner, low, inner, split - wall / 2))
        rooms = []
        for (cover, mouth), is_upper in ((lower, False), (upper, True)):
            tall = cover[3] - cover[1]
            reach = 0.8 * min(tall, 0.75)
            # The handles of the two doors meet at the joint between them.
            grip = cover[1] + 0.08 + reach / 2 if is_upper else cover[3] - 0.08 - reach / 2
            m = (mouth[0], max(mouth[1], base + wall), mouth[2], min(mouth[3], height - wall))
            rooms.append(
                _Compartment(
                    cover=cover,
                    mouth=m,
                    side=side,
                    grip=grip,
                    reach=reach,
                    cold=is_upper == above,
                )
            )
        return tuple(rooms) if above else (rooms[1], rooms[0])
    share = uniform(rng, (0.5, 0.68))
    tall = high - low
    return (
        _Compartment(
            cover=(-half, low, half, high),
            mouth=(-inner, base + wall, inner, height - wall),
            side=side,
            grip=low + share * tall,
            reach=min(0.55 * tall, 0.8),
            cold=False,
        ),
    )


def _around(areas: Sequence[Rectangle]) -> Rectangle:
    """The smallest rectangle that holds others."""
    y_low, z_low, y_high, z_high = zip(*areas, strict=True)
    return min(y_low), min(z_low), max(y_high), max(z_high)


def _divider(rooms: Sequence[_Compartment], back: float, end: float) -> Shape:
    """The wall between two rooms."""
    (a, b), whole = (room.mouth for room in rooms), _around([room.mouth for room in rooms])
    if a[1] == b[1]:
        return box_between(
            (back, min(a[2], b[2]), whole[1]), (end, max(a[0], b[0]), whole[3]), _WHITE
        )
    return box_between((back, whole[0], min(a[3], b[3])), (end, whole[2], max(a[1], b[1])), _WHITE)


def _shelves(
    rng: np.random.Generator, room: _Compartment, back: float, end: float
) -> tuple[Shape, ...]:
    """Shelves, a drawer for vegetables, some food."""
    y_low, z_low, y_high, z_high = room.mouth
    tall, width = z_high - z_low, y_high - y_low
    shapes: list[Shape] = []
    floor = z_low
    if not room.cold and tall > 0.5:
        floor = z_low + 0.20
        front = Material(color=(0.72, 0.78, 0.80), roughness=0.2)
        shapes.append(
            box_between((back, y_low + 0.004, z_low), (end, y_high - 0.004, floor - 0.012), _DRAWER)
        )
        shapes.append(
            box_between(
                (end, y_low + 0.012, z_low + 0.01),
                (end + 0.01, y_high - 0.012, floor - 0.03),
                front,
            )
        )
    count = int(np.clip(round((z_high - floor) / 0.27), 1, 3 if room.cold else 4))
    pitch = (z_high - floor) / (count + 1)
    levels = [floor + i * pitch for i in range(count + 1)]
    if floor == z_low:
        # Without a drawer the lowest things stand on the room's own floor.
        levels = levels[1:]
    for z in levels:
        shapes.append(box_between((back, y_low, z), (end, y_high, z + 0.008), _SHELF))
    for _ in range(int(rng.integers(1, 5))):
        z = levels[int(rng.integers(len(levels)))] + 0.008
        color = _FOOD[int(rng.integers(len(_FOOD)))]
        at = y_low + uniform(rng, (0.15, 0.85)) * width
        x = end - uniform(rng, (0.06, 0.16))
        look = Material(color=color, roughness=0.4)
        size = min(uniform(rng, (0.06, 0.16)), 0.6 * pitch)
        if rng.random() < 0.5:
            shapes.append(cylinder_along("z", (x, at, z + size / 2), 0.03, size, look))
        else:
            shapes.append(
                box_between((x - 0.04, at - 0.045, z), (x + 0.04, at + 0.045, z + 0.7 * size), look)
            )
    return tuple(shapes)


def _door(
    rng: np.random.Generator,
    family: str,
    room: _Compartment,
    front: float,
    thickness: float,
    look: Material,
    rounded: bool,
) -> list[Shape]:
    """The slab, the seal and the white inner side with its bins."""
    c, m = room.cover, room.mouth
    low, high = (front - thickness, c[0], c[1]), (front, c[2], c[3])
    shapes: list[Shape]
    if family == "retro":
        shapes = [rounded_slab(low, high, 0.045, "x", look)]
    elif rounded:
        shapes = [rounded_slab(low, high, uniform(rng, (0.010, 0.022)), "z", look)]
    else:
        shapes = list(door_panel(low, high, look))
    back = low[0]
    gap = 0.014
    shapes.append(
        box_between((back - 0.014, m[0] + gap, m[1] + gap), (back, m[2] - gap, m[3] - gap), _WHITE)
    )
    tall = m[3] - m[1]
    bins = int(np.clip(round(tall / 0.36), 1, 2 if room.cold else 3))
    left, right = m[0] + 0.03, m[2] - 0.03
    for i in range(bins):
        z = m[1] + 0.05 + i * (tall - 0.1) / bins
        shapes.append(
            box_between((back - 0.075, left, z), (back - 0.014, right, z + 0.008), _SHELF)
        )
        shapes.append(
            box_between((back - 0.075, left, z + 0.008), (back - 0.070, right, z + 0.07), _SHELF)
        )
        if not room.cold and rng.random() < 0.7:
            color = Material(color=_FOOD[int(rng.integers(len(_FOOD)))], roughness=0.3)
            at = left + uniform(rng, (0.15, 0.85)) * (right - left)
            size = min(0.2, 0.6 * (tall - 0.1) / bins)
            shapes.append(
                cylinder_along("z", (back - 0.043, at, z + 0.008 + size / 2), 0.024, size, color)
            )
    return shapes


def _grip(
    handle: str,
    form: BarForm,
    bar: tuple[float, float],
    face: float,
    room: _Compartment,
    inset: float,
    share: float,
    look: Material,
) -> tuple[Shape, ...]:
    """What stands out near the door's free edge."""
    free = room.cover[2] if room.side == "left" else room.cover[0]
    inward = -1.0 if room.side == "left" else 1.0
    length = max(share * room.reach, 0.16)
    thickness, clearance = bar
    if handle == "lip":
        return lip(
            face,
            free + inward * 0.016,
            room.grip,
            "z",
            length,
            look,
            thickness=0.8 * thickness,
            reach=clearance,
        )
    if handle == "latch":
        side: Side = "left" if room.side == "left" else "right"
        return latch(face, free + inward * 0.085, room.grip, 0.13, side, look)
    y = free + inward * (inset + thickness)
    return pull_bar(
        face,
        y,
        room.grip,
        "z",
        length,
        look,
        thickness=0.7 * thickness if form == "strap" else thickness,
        clearance=clearance,
        form=form,
    )


def _notes(rng: np.random.Generator, face: float, cover: Rectangle) -> tuple[Shape, ...]:
    """Paper under magnets, on some doors, well away from the handle's edge."""
    if rng.random() < 0.7:
        return ()
    middle, high = (cover[0] + cover[2]) / 2, cover[3] - 0.2 * (cover[3] - cover[1])
    shapes: list[Shape] = []
    for _ in range(int(rng.integers(1, 4))):
        y = middle + uniform(rng, (-0.22, 0.22)) * (cover[2] - cover[0])
        z = high - uniform(rng, (0.0, 0.3)) * (cover[3] - cover[1])
        half, tall = uniform(rng, (0.03, 0.06)), uniform(rng, (0.03, 0.07))
        paper = Material(color=_PAPER[int(rng.integers(len(_PAPER)))], roughness=0.9)
        magnet = Material(color=_FOOD[int(rng.integers(len(_FOOD)))], roughness=0.4)
        low, top = (face, y - half, z - tall), (face + 0.0008, y + half, z + tall)
        shapes.append(box_between(low, top, paper))
        shapes.append(cylinder_along("x", (face + 0.003, y, z + 0.7 * tall), 0.011, 0.006, magnet))
    return tuple(shapes)


def _dispenser(face: float, cover: Rectangle) -> tuple[Shape, ...]:
    """A niche for water and ice with lit keys over it."""
    middle = (cover[0] + cover[2]) / 2
    half = 0.26 * (cover[2] - cover[0])
    low = cover[1] + 0.50 * (cover[3] - cover[1])
    grey = Material(color=(0.10, 0.10, 0.11), roughness=0.4)
    return (
        box_between((face, middle - half, low), (face + 0.004, middle + half, low + 0.36), grey),
        box_between(
            (face + 0.004, middle - 0.8 * half, low + 0.03),
            (face + 0.005, middle + 0.8 * half, low + 0.24),
            GLASS,
        ),
        box_between(
            (face + 0.004, middle - 0.8 * half, low + 0.02),
            (face + 0.016, middle + 0.8 * half, low + 0.03),
            CHROME,
        ),
        *display(
            face + 0.004,
            (middle - 0.8 * half, low + 0.27, middle + 0.8 * half, low + 0.33),
            (0.2, 0.7, 0.9),
            3,
        ),
    )
