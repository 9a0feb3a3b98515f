"""Ovens: a hot box with a glazed door hinged at its lower front edge, revolute about +y.

Families: "toaster" (counter top, controls in a column beside the door), "built_in" (a cube with the
controls above the door), "range" (a cooker with a hob), "compact" (counter top, controls above the
door). Handles: "bar" (round or square, on posts), "strap" (bent back at its ends), "lip" (a blade
across the door).
"""

from __future__ import annotations

from typing import cast

import numpy as np

from artgym.objects.model import ArticulatedObject, Link, Material, Shape, Vector
from artgym.objects.procedural.cabinetry import (
    BLACK,
    CHROME,
    GLASS,
    Rectangle,
    badge,
    bar_form,
    control_knob,
    display,
    door_panel,
    drop_hinge,
    enamel,
    feet,
    finish,
    groove,
    hollow_body,
    lip,
    plinth,
    pull_bar,
    trim,
    wire_rack,
)
from artgym.objects.procedural.shapes import (
    box_between,
    cylinder_along,
    darker,
    painted,
    uniform,
    wood,
)

FAMILIES = ("toaster", "built_in", "range", "compact")
HANDLES = ("bar", "strap", "lip")

_GAP = 0.0025
_WIDTH = {
    "toaster": (0.40, 0.54),
    "built_in": (0.56, 0.60),
    "range": (0.50, 0.76),
    "compact": (0.36, 0.50),
}
_HEIGHT = {
    "toaster": (0.22, 0.31),
    "built_in": (0.56, 0.60),
    "range": (0.85, 0.92),
    "compact": (0.30, 0.40),
}
_DEPTH = {
    "toaster": (0.28, 0.38),
    "built_in": (0.50, 0.57),
    "range": (0.55, 0.65),
    "compact": (0.30, 0.42),
}
#: Height of the ground below the body: feet, or a plinth.
_BASE = {"toaster": (0.014, 0.025), "built_in": (0.0, 0.0), "range": (0.03, 0.08)}
_BASE["compact"] = _BASE["toaster"]
_DOOR = {"toaster": (0.014, 0.022), "compact": (0.016, 0.024)}
_ENAMEL_INSIDE = Material(color=(0.035, 0.035, 0.04), roughness=0.5)
_HOT = Material(color=(0.75, 0.12, 0.02), roughness=0.5)
_COLD = Material(color=(0.25, 0.25, 0.26), roughness=0.4, metallic=0.6)


def make_oven(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """An oven of 0.22-0.92 m height; the door comes down by 70-95 degrees."""
    family = str(rng.choice(FAMILIES, p=(0.3, 0.25, 0.3, 0.15)))
    handle = str(rng.choice(HANDLES, p=(0.5, 0.3, 0.2)))
    small = family in ("toaster", "compact")
    width, height = uniform(rng, _WIDTH[family]), uniform(rng, _HEIGHT[family])
    depth, base = uniform(rng, _DEPTH[family]), uniform(rng, _BASE[family])
    thickness = uniform(rng, _DOOR.get(family, (0.030, 0.045)))
    shell = enamel(rng) if small and rng.random() < 0.25 else finish(rng)
    door_look = _door_look(rng, shell)
    panel_look = shell if rng.random() < 0.5 else (BLACK if rng.random() < 0.6 else finish(rng))
    grip_look = trim(rng, door_look)

    y, front = width / 2, depth / 2
    body_front = front - thickness - _GAP
    side = width * uniform(rng, (0.20, 0.27)) if family == "toaster" else 0.0
    panel = 0.0 if side else height * uniform(rng, (0.15, 0.20))
    if family == "range":
        panel = uniform(rng, (0.09, 0.13))
    housing = 0.0
    if family == "built_in" and rng.random() < 0.8:
        # It is built into the lower part of a cupboard.
        housing = uniform(rng, (0.12, 0.28))
        base, height = base + housing, height + housing
    storage = uniform(rng, (0.14, 0.22)) if family == "range" else 0.0
    door_low = base + storage + {"built_in": 0.036, "range": 0.006}.get(family, 0.012)
    door_high = height - panel - (0.012 if side else _GAP)
    door_left, door_right = -y + (0.008 if small else 0.003), y - side - 0.003
    wall = 0.018 if small else 0.045
    opening: Rectangle = (
        -y + wall,
        door_low + 0.5 * wall,
        y - max(wall, side + 0.006),
        door_high - 0.5 * wall,
    )
    back = -depth / 2 + wall
    area: Rectangle = (y - side, base, y, height) if side else (-y, height - panel, y, height)
    body = [
        *hollow_body(
            (-depth / 2, -y, base),
            (body_front, y, height),
            opening,
            back,
            shell,
            _ENAMEL_INSIDE if rng.random() < 0.7 else _COLD,
            lining_thickness=0.003,
        ),
        *_inside(rng, opening, back, body_front, small),
        box_between((body_front, *area[:2]), (front, *area[2:]), panel_look),
        *_controls(rng, front, area, panel_look, 6 if family == "range" else 4),
    ]
    if side:
        # A frame closes the front level with the door.
        body.append(
            box_between(
                (body_front, -y, base), (front - 0.004, door_right, door_low - 0.002), shell
            )
        )
        body.append(
            box_between(
                (body_front, -y, door_high + 0.002), (front - 0.004, door_right, height), shell
            )
        )
    if small:
        body += feet((-depth / 2, -y, base), (body_front, y, height))
    elif housing > 0:
        body += _housing(rng, -depth / 2, front, y, housing)
    elif base > 0:
        body.append(plinth((-depth / 2, -y + 0.01, base), (body_front, y - 0.01, height), 0.03))
    if family == "built_in":
        body.append(box_between((body_front, -y, base), (front - 0.01, y, door_low - 0.003), BLACK))
    if family == "range":
        top = door_low - _GAP
        body.append(box_between((body_front, -y, base), (front, y, top), shell))
        body.append(groove(front, (-0.25 * width, top - 0.035, 0.25 * width, top - 0.022)))
        body += _hob(rng, -depth / 2, body_front, y, height, shell)

    door = _door(
        rng,
        (front - thickness, door_left, door_low),
        (front, door_right, door_high),
        door_look,
        small,
    )
    door += _grip(rng, handle, front, door_left, door_right, door_high, grip_look, small)
    mass = uniform(rng, (0.3, 0.9)) if small else uniform(rng, (1.3, 2.2))
    link = Link(
        name="door",
        shapes=tuple(door),
        density=mass / sum(s.geometry.volume for s in door),
        friction=uniform(rng, (0.6, 1.0)),
    )
    pivot = (front - thickness / 2, 0.0, door_low + 0.006)
    # A hand that lowers a door needs room beneath: those near the ground open less far.
    angles_deg = (80.0, 95.0) if base + storage > 0.08 else (70.0, 84.0)
    return ArticulatedObject(
        object_id=object_id,
        category="oven",
        links=(Link(name="body", shapes=tuple(body), density=400.0), link),
        joints=(drop_hinge(rng, "hinge", "body", link, pivot, angles_deg),),
        attributes={"family": family, "handle": handle},
    )


def _door_look(rng: np.random.Generator, shell: Material) -> Material:
    """Black glass, the body's own finish or steel."""
    draw = rng.random()
    if draw < 0.4:
        return BLACK
    return shell if draw < 0.8 else finish(rng)


def _door(
    rng: np.random.Generator, low: Vector, high: Vector, look: Material, small: bool
) -> list[Shape]:
    """The door with its window, low enough to leave room for the grip above it."""
    width, tall = high[1] - low[1], high[2] - low[2]
    margin = uniform(rng, (0.05, 0.10)) * width if small else uniform(rng, (0.10, 0.20)) * width
    window: Rectangle = (
        low[1] + margin,
        low[2] + (0.14 if small else 0.18) * tall,
        high[1] - margin,
        high[2] - (0.30 if small else uniform(rng, (0.26, 0.34))) * tall,
    )
    name = badge(high[0], (low[1] + high[1]) / 2, low[2] + 0.06 * tall, 0.16 * width)
    recess = 0.004 if sum(look.color) > 0.15 else 0.002
    # Against a black door the pane has a tint of its own.
    glass = GLASS if sum(look.color) > 0.15 else Material(color=(0.09, 0.075, 0.06), roughness=0.1)
    return [*door_panel(low, high, look, window, glass, recess), name]


def _grip(
    rng: np.random.Generator,
    handle: str,
    face: float,
    left: float,
    right: float,
    high: float,
    look: Material,
    small: bool,
) -> tuple[Shape, ...]:
    """A bar, a strap or a blade across the door, near its upper edge."""
    length = (right - left) * uniform(rng, (0.55, 0.88))
    middle = (left + right) / 2
    z = high - (uniform(rng, (0.018, 0.028)) if small else uniform(rng, (0.035, 0.055)))
    if handle == "lip":
        return lip(
            face,
            middle,
            z,
            "y",
            length,
            look,
            thickness=uniform(rng, (0.009, 0.014)),
            reach=uniform(rng, (0.030, 0.038)),
        )
    thickness = uniform(rng, (0.010, 0.014)) if small else uniform(rng, (0.014, 0.022))
    form = bar_form(rng, handle)
    if form == "strap":
        thickness *= 0.75
    return pull_bar(
        face,
        middle,
        z,
        "y",
        length,
        look,
        thickness=thickness,
        clearance=uniform(rng, (0.028, 0.034)) if small else uniform(rng, (0.032, 0.042)),
        form=form,
    )


def _controls(
    rng: np.random.Generator, face: float, area: Rectangle, ground: Material, most_knobs: int
) -> tuple[Shape, ...]:
    """Knobs, perhaps a display and keys, and the maker's plate, along the longer side of a panel.

    Args:
        rng: draws them.
        face: x of the panel.
        area: the panel.
        ground: how the panel looks.
        most_knobs: the largest number of knobs.
    """
    y_low, z_low, y_high, z_high = area
    width, tall = y_high - y_low, z_high - z_low
    upright = tall > width
    span, breadth = (tall, width) if upright else (width, tall)
    dark = sum(ground.color) < 0.5
    knob = Material(color=(0.55, 0.55, 0.56), roughness=0.4) if dark else BLACK
    if rng.random() < 0.4:
        knob = CHROME
    skirt = None if rng.random() < 0.6 else darker(CHROME, 0.8)
    with_display = bool(rng.random() < (0.45 if upright else 0.65))
    count = int(rng.integers(2, most_knobs + 1))
    if count > 4:
        skirt = None
    slots = count + (2 if with_display else 0)
    pitch = 0.86 * span / (slots + (0.4 if upright else 0.0))
    radius = min(0.34 * breadth, 0.36 * pitch, 0.028)

    def spot(slot: float) -> tuple[float, float]:
        """Middle (y, z) of a place along the panel; a column is filled from above."""
        along = (slot - (slots - 1) / 2) * pitch
        if upright:
            return (y_low + y_high) / 2, (z_low + z_high) / 2 - along + 0.03 * span
        return (y_low + y_high) / 2 + along, (z_low + z_high) / 2

    shapes: list[Shape] = []
    # A display lies in the middle of a strip with knobs on both sides, and on top of a column.
    first = 0 if upright else count // 2
    for i in range(count):
        slot = i + (2 if with_display and i >= first else 0)
        y, z = spot(slot)
        angle = float(rng.uniform(-2.3, 2.3))
        shapes += control_knob(face, y, z, radius, knob, angle=angle, skirt=skirt)
    if with_display:
        y, z = spot(first + 0.5)
        half_y = 0.36 * breadth if upright else 0.8 * pitch
        half_z = min(0.30 * breadth, 0.7 * pitch) if upright else 0.30 * breadth
        colors = ((0.1, 0.7, 0.9), (0.9, 0.3, 0.1), (0.2, 0.9, 0.3), (0.9, 0.7, 0.1))
        color = cast(Vector, colors[int(rng.integers(len(colors)))])
        half_y = min(half_y, 0.09)
        shapes += display(face, (y - half_y, z - half_z, y + half_y, z + half_z), color)
    return tuple(shapes)


def _inside(
    rng: np.random.Generator, opening: Rectangle, back: float, end: float, small: bool
) -> tuple[Shape, ...]:
    """Racks, a tray, and the heating rods of a small oven."""
    y_low, z_low, y_high, z_high = opening
    tall = z_high - z_low
    low, high = (back + 0.01, y_low + 0.006), (end - 0.02, y_high - 0.006)
    shapes = list(wire_rack(low, high, z_low + uniform(rng, (0.30, 0.42)) * tall, 6))
    if not small:
        tray = Material(color=(0.06, 0.06, 0.07), roughness=0.5)
        z = z_low + 0.62 * tall
        if rng.random() < 0.6:
            shapes.append(box_between((*low, z), (*high, z + 0.012), tray))
        else:
            shapes += wire_rack(low, high, z, 5)
        return tuple(shapes)
    rod = _HOT if rng.random() < 0.6 else _COLD
    for z in (z_low + 0.10 * tall, z_high - 0.10 * tall):
        for share in (0.3, 0.7):
            x = back + share * (end - back)
            middle = (x, (y_low + y_high) / 2, z)
            shapes.append(cylinder_along("y", middle, 0.004, 0.98 * (y_high - y_low), rod))
    return tuple(shapes)


def _housing(
    rng: np.random.Generator, back: float, front: float, y: float, top: float
) -> tuple[Shape, ...]:
    """The cupboard under a built-in oven: a plinth and the front of a drawer that does not move."""
    look = wood(rng) if rng.random() < 0.6 else painted(rng)
    kick = 0.35 * top
    return (
        box_between((back, -y + 0.005, 0.0), (front - 0.05, y - 0.005, kick), BLACK),
        box_between((back, -y, kick), (front - 0.022, y, top), look),
        box_between(
            (front - 0.022, -y + 0.002, kick), (front - 0.002, y - 0.002, top - 0.003), look
        ),
    )


def _hob(
    rng: np.random.Generator, back: float, end: float, y: float, top: float, shell: Material
) -> tuple[Shape, ...]:
    """Four plates on top: coils in pans, fields of a glass top, or gas burners under grates."""
    kind = str(rng.choice(("plates", "glass", "gas")))
    shapes: list[Shape] = []
    surface = top
    if kind == "glass":
        surface += 0.006
        shapes.append(box_between((back, -y, top), (end + 0.02, y, surface), GLASS))
    elif kind == "gas":
        surface += 0.003
        shapes.append(
            box_between(
                (back + 0.02, -0.94 * y, top), (end - 0.02, 0.94 * y, surface), darker(shell, 0.5)
            )
        )
    depth = end - back
    radii = rng.permutation([0.10, 0.075, 0.075, 0.09])
    places = [(back + f * depth, g * y) for f in (0.30, 0.74) for g in (-0.48, 0.48)]
    for (x, at), radius in zip(places, radii.tolist(), strict=True):
        r = min(radius, 0.36 * y)
        if kind == "glass":
            ring = Material(color=(0.12, 0.12, 0.13), roughness=0.3)
            shapes.append(cylinder_along("z", (x, at, surface + 0.0005), r, 0.001, ring))
            shapes.append(cylinder_along("z", (x, at, surface + 0.0008), 0.93 * r, 0.0016, GLASS))
        elif kind == "plates":
            shapes.append(cylinder_along("z", (x, at, surface + 0.002), r + 0.012, 0.004, CHROME))
            shapes.append(cylinder_along("z", (x, at, surface + 0.006), r, 0.012, BLACK))
        else:
            shapes.append(cylinder_along("z", (x, at, surface + 0.007), 0.45 * r, 0.014, _COLD))
            shapes.append(
                box_between(
                    (x - 0.005, at - 1.15 * r, surface + 0.018),
                    (x + 0.005, at + 1.15 * r, surface + 0.026),
                    BLACK,
                )
            )
    if kind == "gas":
        # One bar of the grate runs from the back to the front over two burners.
        for at in (-0.48 * y, 0.48 * y):
            low, high = (back + 0.10 * depth, at - 0.005), (back + 0.93 * depth, at + 0.005)
            shapes.append(box_between((*low, surface + 0.018), (*high, surface + 0.026), BLACK))
    if rng.random() < 0.4:
        guard = top + uniform(rng, (0.03, 0.07))
        shapes.append(box_between((back, -y, top), (back + 0.03, y, guard), shell))
    return tuple(shapes)
