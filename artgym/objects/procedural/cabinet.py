"""Cabinets: a case with shelves behind one or two side-hinged doors, revolute about the vertical.

Families: "wall" (hung on a piece of wall, which is its stand), "kitchen" (a base unit with plinth
and worktop), "sideboard" (on legs), "locker" (of sheet metal, narrow). Doors: "slab", "shaker" (a
frame around a recessed panel), "glass", "louvre", "grooved". Handles: "bar" (upright), "knob",
"cup" (a shell open to the hinge's side), "edge" (an upright lip).

Two doors are hinged at the outer edges, "door_1" on the left as the user sees it (y < 0); a single
"door_1" is hinged on either side.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from artgym.objects.model import ArticulatedObject, Joint, Link, Material, Shape
from artgym.objects.procedural.cabinetry import Rectangle, door_panel, hollow_body, lip, side_hinge
from artgym.objects.procedural.handles import bar_at, knob_at
from artgym.objects.procedural.shapes import (
    Interval,
    box_between,
    cylinder_along,
    darker,
    frustum,
    metal,
    painted,
    prism,
    uniform,
    with_role,
    wood,
)

FAMILIES = ("wall", "kitchen", "sideboard", "locker")
DOORS = ("slab", "shaker", "glass", "louvre", "grooved")
HANDLES = ("bar", "knob", "cup", "edge")

Side = Literal["left", "right"]

#: Between a door and what does not move, and between two doors, metres.
_GAP = 0.002


@dataclass(frozen=True, kw_only=True)
class _DoorStyle:
    """What the doors of one cabinet share.

    Attributes:
        form: one of ``DOORS``.
        look: of the door.
        thickness: metres.
        frame: width of the boards around a panel or pane, metres.
        slats: boards of a louvre, or grooves.
        seed: of the handles: both doors draw the same.
        handle: one of ``HANDLES``.
        grip: how handles look.
        grip_at: height of the handle's middle, metres.
        edge: from a door's free edge to the handle's middle, metres.
    """

    form: str
    look: Material
    thickness: float
    frame: float
    slats: int
    seed: int
    handle: str
    grip: Material
    grip_at: float
    edge: float


def make_cabinet(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A cabinet 0.3-0.9 m high and wide; its doors open by 95-120 degrees."""
    family = str(rng.choice(FAMILIES, p=(0.27, 0.27, 0.31, 0.15)))
    handle = str(rng.choice(HANDLES, p=(0.42, 0.25, 0.15, 0.18)))
    form = str(rng.choice(DOORS, p=(0.25, 0.27, 0.18, 0.15, 0.15)))
    if family == "locker":
        form = "louvre" if form == "louvre" else "slab"
    width, depth, height = _size(rng, family)
    double = bool(width > 0.46 and (width > 0.62 or rng.random() < 0.6))
    inset = bool(family == "locker" or rng.random() < 0.4)

    look, top_look, front = _looks(rng, family)
    if form == "louvre" and family != "locker":
        front = look
    wall = uniform(rng, (0.014, 0.022)) if family != "locker" else 0.012
    ground = _ground(rng, family)
    x, y = depth / 2, width / 2
    z0, z1 = ground, ground + height
    opening = (-y + wall, z0 + wall, y - wall, z1 - wall)
    inner = darker(look, 0.8) if family == "locker" else look
    body = [
        *hollow_body((-x, -y, z0), (x, y, z1), opening, -x + 0.008, look),
        *_shelves(rng, (-x + 0.008, x - 0.03), opening, inner),
        *_surroundings(rng, family, (x, y), (z0, z1), look, top_look),
    ]

    thickness = uniform(rng, (0.016, 0.022))
    room = opening if inset else (-y, z0, y, z1)
    gap = _GAP if inset else 0.001
    back = x - thickness if inset else x + _GAP
    rectangle = (room[0] + gap, room[1] + gap, room[2] - gap, room[3] - gap)
    style = _DoorStyle(
        form=form,
        look=front,
        thickness=thickness,
        frame=uniform(rng, (0.042, 0.075)),
        slats=int(rng.integers(5, 8)),
        seed=int(rng.integers(2**31)),
        handle=handle,
        grip=metal(rng) if rng.random() < 0.8 else painted(rng),
        grip_at=_grip_height(rng, family, rectangle),
        edge=uniform(rng, (0.030, 0.042)),
    )
    if double:
        middle = (rectangle[0] + rectangle[2]) / 2
        places: list[tuple[Rectangle, Side]] = [
            ((rectangle[0], rectangle[1], middle - _GAP / 2, rectangle[3]), "left"),
            ((middle + _GAP / 2, rectangle[1], rectangle[2], rectangle[3]), "right"),
        ]
    else:
        places = [(rectangle, "left" if rng.random() < 0.5 else "right")]
    density, friction = uniform(rng, (250.0, 500.0)), uniform(rng, (0.6, 1.0))
    angles = (95.0, 120.0) if not inset else (95.0, 110.0)
    links, joints = [Link(name="body", shapes=tuple(body), density=600.0)], []
    for i, (place, side) in enumerate(places, start=1):
        link, joint = _door(rng, f"door_{i}", place, back, side, style, density, friction, angles)
        links.append(link)
        joints.append(joint)
    return ArticulatedObject(
        object_id=object_id,
        category="cabinet",
        links=tuple(links),
        joints=tuple(joints),
        attributes={"family": family, "handle": handle, "door": form, "doors": len(places)},
    )


def _size(rng: np.random.Generator, family: str) -> tuple[float, float, float]:
    """Width, depth and height of the case, metres."""
    if family == "wall":
        return uniform(rng, (0.30, 0.80)), uniform(rng, (0.22, 0.34)), uniform(rng, (0.35, 0.65))
    if family == "kitchen":
        return uniform(rng, (0.32, 0.85)), uniform(rng, (0.36, 0.52)), uniform(rng, (0.48, 0.68))
    if family == "sideboard":
        return uniform(rng, (0.55, 0.90)), uniform(rng, (0.30, 0.42)), uniform(rng, (0.34, 0.56))
    return uniform(rng, (0.30, 0.42)), uniform(rng, (0.30, 0.42)), uniform(rng, (0.50, 0.86))


def _ground(rng: np.random.Generator, family: str) -> float:
    """Height of the case above the floor, metres."""
    intervals: dict[str, Interval] = {
        "wall": (0.02, 0.10),
        "kitchen": (0.07, 0.12),
        "sideboard": (0.08, 0.20),
        "locker": (0.005, 0.03),
    }
    return uniform(rng, intervals[family])


def _looks(rng: np.random.Generator, family: str) -> tuple[Material, Material, Material]:
    """How case, top and doors look."""
    if family == "locker":
        look = painted(rng) if rng.random() < 0.7 else metal(rng)
        return look, look, look if rng.random() < 0.6 else painted(rng)
    look = wood(rng) if rng.random() < 0.55 else painted(rng)
    front = look if rng.random() < 0.55 else painted(rng)
    if family != "kitchen":
        return look, look if rng.random() < 0.7 else wood(rng), front
    if rng.random() < 0.5:
        return look, wood(rng), front
    v = uniform(rng, (0.08, 0.8))
    return look, Material(color=(v, v, 0.97 * v), roughness=0.35), front


def _grip_height(rng: np.random.Generator, family: str, rectangle: Rectangle) -> float:
    """Where hands reach a door: low on the wall, high above the floor, about the middle else."""
    _, low, _, high = rectangle
    share = {"wall": (0.2, 0.5), "kitchen": (0.55, 0.78)}.get(family, (0.42, 0.66))
    return low + uniform(rng, share) * (high - low)


def _shelves(
    rng: np.random.Generator, x: Interval, opening: Rectangle, look: Material
) -> tuple[Shape, ...]:
    """One to three boards inside; x from the back wall to behind the doors."""
    y_low, z_low, y_high, z_high = opening
    room = z_high - z_low
    count = int(np.clip(room / uniform(rng, (0.18, 0.32)), 1, 3))
    pitch = room / (count + 1)
    return tuple(
        box_between((x[0], y_low, z - 0.007), (x[1], y_high, z + 0.007), look)
        for z in (z_low + (i + 1) * pitch for i in range(count))
    )


def _surroundings(
    rng: np.random.Generator,
    family: str,
    half: tuple[float, float],
    z: Interval,
    look: Material,
    top_look: Material,
) -> tuple[Shape, ...]:
    """What is below, above and behind the case."""
    (x, y), (low, high) = half, z
    if family == "wall":
        v = uniform(rng, (0.55, 0.85))
        plaster = Material(color=(v, v * uniform(rng, (0.92, 1.0)), v * 0.92), roughness=0.95)
        side = uniform(rng, (0.04, 0.12))
        slab = box_between(
            (-x - 0.05, -y - side, 0.0), (-x, y + side, high + uniform(rng, (0.03, 0.1))), plaster
        )
        shapes = list(with_role("stand", (slab,)))
        if rng.random() < 0.4:
            # A cornice, wider above.
            out = uniform(rng, (0.012, 0.025))
            outline = [(-y, high), (y, high), (y + out, high + 0.03), (-y - out, high + 0.03)]
            shapes.append(prism(outline, "x", -x, x + out, top_look))
        return tuple(shapes)
    if family == "kitchen":
        top = uniform(rng, (0.022, 0.040))
        return (
            box_between((-x + 0.01, -y, 0.0), (x - 0.05, y, low), darker(look, 0.5)),
            box_between((-x, -y - 0.005, high), (x + 0.035, y + 0.005, high + top), top_look),
        )
    if family == "sideboard":
        out, slab = uniform(rng, (0.0, 0.015)), uniform(rng, (0.012, 0.024))
        leg = metal(rng) if rng.random() < 0.35 else darker(look, uniform(rng, (0.5, 1.0)))
        return (
            box_between((-x, -y - out, high), (x + 0.024 + out, y + out, high + slab), top_look),
            *_legs(rng, (x, y), low, leg),
        )
    return (box_between((-x + 0.01, -y + 0.01, 0.0), (x - 0.01, y - 0.01, low), darker(look, 0.3)),)


def _legs(
    rng: np.random.Generator, half: tuple[float, float], height: float, look: Material
) -> tuple[Shape, ...]:
    """Four legs, tapered, square or round, or two runners."""
    form = str(rng.choice(("tapered", "square", "round", "runner")))
    r, inset = uniform(rng, (0.012, 0.022)), uniform(rng, (0.03, 0.07))
    x, y = half[0] - inset, half[1] - inset
    if form == "runner":
        return tuple(
            shape
            for s in (-1.0, 1.0)
            for shape in (
                box_between((-x, s * y - r, 0.0), (x, s * y + r, 2 * r), look),
                box_between((-x, s * y - r, 2 * r), (-x + 2 * r, s * y + r, height), look),
                box_between((x - 2 * r, s * y - r, 2 * r), (x, s * y + r, height), look),
            )
        )
    legs = []
    for px in (-x, x):
        for py in (-y, y):
            if form == "tapered":
                legs.append(
                    frustum("z", (px, py, 0.0), (0.6 * r, 0.6 * r), (r, r), height, look, 10)
                )
            elif form == "square":
                legs.append(box_between((px - r, py - r, 0.0), (px + r, py + r, height), look))
            else:
                legs.append(cylinder_along("z", (px, py, height / 2), 0.8 * r, height, look))
    return tuple(legs)


def _door(
    rng: np.random.Generator,
    name: str,
    place: Rectangle,
    back: float,
    side: Side,
    style: _DoorStyle,
    density: float,
    friction: float,
    angles_deg: Interval,
) -> tuple[Link, Joint]:
    """A door and its hinge; ``place`` is what the door covers of the front."""
    y_low, z_low, y_high, z_high = place
    face = back + style.thickness
    towards_hinge = -1.0 if side == "left" else 1.0
    edge_y = y_high if side == "left" else y_low
    hinge_y = y_low if side == "left" else y_high
    grip = _grip(style, face, edge_y + towards_hinge * style.edge, towards_hinge, place)
    pivot = (face, hinge_y, (z_low + z_high) / 2)
    barrels = [
        cylinder_along("z", (face, hinge_y, z), 0.004, 0.05, style.grip)
        for z in (z_low + 0.09, z_high - 0.09)
    ]
    link = Link(
        name=name,
        shapes=(*_panel(style, back, place), *barrels, *grip),
        density=density,
        friction=friction,
    )
    hinge = side_hinge(
        rng, f"hinge_{name[-1]}", "body", link, pivot, side, angles_deg, grip_force=(1.0, 4.0)
    )
    return link, hinge


def _panel(style: _DoorStyle, back: float, place: Rectangle) -> tuple[Shape, ...]:
    """The door without its handle; ``back`` is the x of its inner face."""
    y_low, z_low, y_high, z_high = place
    low, high = (back, y_low, z_low), (back + style.thickness, y_high, z_high)
    f = style.frame
    window = (y_low + f, z_low + f, y_high - f, z_high - f)
    if style.form == "shaker":
        return door_panel(low, high, style.look, window, darker(style.look, 0.9), 0.005)
    if style.form == "glass":
        glass = Material(color=(0.42, 0.52, 0.56), roughness=0.08)
        return door_panel(low, high, style.look, window, glass, 0.006)
    if style.form == "louvre":
        # Slats before a thin back: their lower edges stand out, their shadow shows the rest.
        shapes = list(door_panel(low, high, style.look, window, darker(style.look, 0.45), 0.006))
        pitch = (window[3] - window[1]) / style.slats
        x0, x1 = high[0] - 0.006, high[0] - 0.0005
        for i in range(style.slats):
            z = window[1] + i * pitch
            outline = [(x0, z + 0.1 * pitch), (x1, z + 0.1 * pitch), (x0, z + 0.9 * pitch)]
            shapes.append(prism(outline, "y", window[0], window[2], style.look))
        return tuple(shapes)
    shapes = [box_between(low, high, style.look)]
    if style.form == "grooved":
        dark = darker(style.look, 0.5)
        count, face = style.slats - 2, high[0]
        for i in range(1, count):
            y = y_low + i * (y_high - y_low) / count
            low, high = (face, y - 0.0015, z_low), (face + 0.0004, y + 0.0015, z_high)
            shapes.append(box_between(low, high, dark))
    return tuple(shapes)


def _grip(
    style: _DoorStyle, face: float, y: float, towards_hinge: float, place: Rectangle
) -> tuple[Shape, ...]:
    """The handle about (y, ``style.grip_at``); all doors of a cabinet draw the same numbers."""
    rng = np.random.default_rng(style.seed)
    _, z_low, _, z_high = place
    z, look = style.grip_at, style.grip
    room = 2 * min(z - z_low, z_high - z) - 0.03
    if style.handle == "bar":
        return bar_at(rng, face, y, z, "z", min(uniform(rng, (0.08, 0.30)), room), look)
    if style.handle == "knob":
        return knob_at(rng, face, y, z, look)
    if style.handle == "cup":
        return _shell(rng, face, y, z, towards_hinge, look)
    length = min(uniform(rng, (0.12, 0.5)), room)
    thickness, reach = uniform(rng, (0.008, 0.012)), uniform(rng, (0.028, 0.036))
    return lip(face, y, z, "z", length, style.look, thickness=thickness, reach=reach)


def _shell(
    rng: np.random.Generator,
    face: float,
    y: float,
    z: float,
    towards_hinge: float,
    look: Material,
) -> tuple[Shape, ...]:
    """A cup on its side: a plate before the front, open towards the hinge, short enough to span."""
    length, width = uniform(rng, (0.056, 0.072)), uniform(rng, (0.026, 0.036))
    reach, wall = uniform(rng, (0.026, 0.034)), uniform(rng, (0.003, 0.005))
    low, high = z - length / 2, z + length / 2
    shut, free = y - towards_hinge * width / 2, y + towards_hinge * width / 2
    left, right = min(shut, free), max(shut, free)
    inner = shut + towards_hinge * wall
    cheek_left, cheek_right = min(inner, free), max(inner, free)
    plate = face + reach - wall
    return with_role(
        "handle",
        (
            box_between((plate, left, low), (face + reach, right, high), look),
            box_between((face, min(shut, inner), low), (plate, max(shut, inner), high), look),
            box_between((face, cheek_left, low), (plate, cheek_right, low + wall), look),
            box_between((face, cheek_left, high - wall), (plate, cheek_right, high), look),
        ),
    )
