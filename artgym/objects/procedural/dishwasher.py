"""Dishwashers: a body with racks and a door hinged at its lower front edge, revolute about +y.

Families: "built_in" (0.6 m wide), "slim" (0.45 m), "counter_top" (low, on feet). Handles: "bar"
(across the door, round or square), "strap" (bent back at its ends), "lip" (a blade across the
door), "edge" (the door's upper edge, which stands free before a step in the body). The controls
are on the door's upper strip or on a panel of the body above the door.
"""

from __future__ import annotations

from typing import cast

import numpy as np

from artgym.objects.model import ArticulatedObject, Link, Material, Shape, Vector
from artgym.objects.procedural.cabinetry import (
    BLACK,
    Rectangle,
    badge,
    bar_form,
    button_grid,
    control_knob,
    display,
    door_panel,
    drop_hinge,
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
    uniform,
    with_role,
    wood,
)

FAMILIES = ("built_in", "slim", "counter_top")
HANDLES = ("bar", "strap", "lip", "edge")

_GAP = 0.0025
#: Height of what stands on the ground below the door: a plinth or feet, metres.
_BASE = {"built_in": (0.09, 0.13), "slim": (0.09, 0.13), "counter_top": (0.018, 0.028)}
_WIDTH = {"built_in": (0.59, 0.61), "slim": (0.44, 0.46), "counter_top": (0.50, 0.56)}
_HEIGHT = {"built_in": (0.81, 0.87), "slim": (0.81, 0.87), "counter_top": (0.43, 0.50)}
_DEPTH = {"built_in": (0.55, 0.61), "slim": (0.54, 0.60), "counter_top": (0.46, 0.52)}


def make_dishwasher(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A dishwasher of 0.45-0.6 m width; the door comes down by 72-95 degrees."""
    family = str(rng.choice(FAMILIES, p=(0.45, 0.25, 0.3)))
    handle = str(rng.choice(HANDLES, p=(0.42, 0.20, 0.20, 0.18)))
    panel_on_body = handle != "edge" and bool(rng.random() < 0.35)
    width, height = uniform(rng, _WIDTH[family]), uniform(rng, _HEIGHT[family])
    depth, base = uniform(rng, _DEPTH[family]), uniform(rng, _BASE[family])
    thickness = uniform(rng, (0.028, 0.045))
    strip = uniform(rng, (0.07, 0.11)) * (0.8 if family == "counter_top" else 1.0)
    shell = finish(rng)
    front_look = shell if rng.random() < 0.6 else finish(rng)
    strip_look = front_look if rng.random() < 0.35 else (BLACK if rng.random() < 0.5 else shell)
    grip_look = trim(rng, front_look)

    y = width / 2
    front = depth / 2
    body_front = front - thickness - _GAP
    step = 0.045 if handle == "edge" else 0.0
    top = height - step
    opening: Rectangle = (
        -y + 0.03,
        base + 0.04,
        y - 0.03,
        top - (strip + 0.015 if panel_on_body else 0.04),
    )
    inside = Material(color=(0.50, 0.51, 0.52), roughness=0.4, metallic=0.5)
    body = [
        *hollow_body(
            (-depth / 2, -y, base), (body_front, y, top), opening, -depth / 2 + 0.04, shell, inside
        ),
        *_racks(rng, opening, -depth / 2 + 0.06, body_front - 0.045),
    ]
    if family == "counter_top":
        body += feet((-depth / 2, -y, base), (body_front, y, top))
    else:
        body.append(plinth((-depth / 2, -y + 0.01, base), (body_front, y - 0.01, top), 0.04))
    if step:
        body.append(
            box_between((-depth / 2, -y, top), (body_front - 0.05, y, height), darker(shell, 0.9))
        )
    elif family != "counter_top" and rng.random() < 0.5:
        # A worktop overhangs the door a little.
        board = wood(rng) if rng.random() < 0.4 else darker(shell, 0.85)
        over = uniform(rng, (0.0, 0.02))
        body.append(box_between((-depth / 2, -y, height), (front + over, y, height + 0.025), board))

    door_low = base + 0.004
    panel_low = height - strip
    door_high = panel_low - _GAP if panel_on_body else height - (0.0 if step else 0.003)
    half = y - 0.003
    slab_high = door_high if panel_on_body else panel_low
    door = [*door_panel((front - thickness, -half, door_low), (front, half, slab_high), front_look)]
    area: Rectangle
    if panel_on_body:
        body.append(box_between((body_front, -y, panel_low), (front, y, height), strip_look))
        area = (-y, panel_low, y, height)
        body += _controls(rng, front, area, strip_look)
    else:
        # Behind its edge a door with a free edge is thin enough for a hand.
        back = front - (min(thickness, 0.030) if step else thickness)
        door.append(box_between((back, -half, panel_low), (front, half, door_high), strip_look))
        area = (-half, panel_low, half, door_high)
        door += _controls(rng, front, area, strip_look)
    door += _inner_door(opening, front - thickness, inside)
    grip_z = slab_high - uniform(rng, (0.035, 0.06))
    if rng.random() < 0.4 and family != "counter_top":
        door.append(groove(front, (-0.9 * half, door_low + 0.03, 0.9 * half, door_low + 0.034)))
    door += _grip(rng, handle, front, grip_z, width, grip_look)
    if handle == "edge":
        # The upper strip, the second shape, is what a hand takes hold of.
        door[1:2] = with_role("handle", door[1:2])

    # A low door has a short lever: light enough to be closed again with one hand.
    mass = uniform(rng, (0.9, 1.5) if family == "counter_top" else (1.4, 2.2))
    link = Link(
        name="door",
        shapes=tuple(door),
        density=mass / sum(s.geometry.volume for s in door),
        friction=uniform(rng, (0.6, 1.0)),
    )
    pivot = (front - thickness / 2, 0.0, door_low + 0.006)
    # A hand that lowers a door needs room beneath: one near the ground opens less far.
    angles_deg = (72.0, 86.0) if family == "counter_top" else (80.0, 95.0)
    return ArticulatedObject(
        object_id=object_id,
        category="dishwasher",
        links=(Link(name="body", shapes=tuple(body), density=300.0), link),
        joints=(drop_hinge(rng, "hinge", "body", link, pivot, angles_deg),),
        attributes={
            "family": family,
            "handle": handle,
            "controls": "body" if panel_on_body else "door",
        },
    )


def _grip(
    rng: np.random.Generator,
    handle: str,
    face: float,
    z: float,
    width: float,
    look: Material,
) -> tuple[Shape, ...]:
    """What stands out of the door to hold it; nothing where its edge serves."""
    length = width * uniform(rng, (0.5, 0.9))
    if handle == "edge":
        return ()
    if handle == "lip":
        return lip(
            face,
            0.0,
            z,
            "y",
            length,
            look,
            thickness=uniform(rng, (0.010, 0.016)),
            reach=uniform(rng, (0.032, 0.042)),
        )
    form = bar_form(rng, handle)
    return pull_bar(
        face,
        0.0,
        z,
        "y",
        length,
        look,
        thickness=uniform(rng, (0.010, 0.014) if form == "strap" else (0.012, 0.020)),
        clearance=uniform(rng, (0.030, 0.040)),
        form=form,
    )


def _controls(
    rng: np.random.Generator, face: float, area: Rectangle, ground: Material
) -> tuple[Shape, ...]:
    """A display and keys, or a dial, and the maker's plate, along a strip."""
    y_low, z_low, y_high, z_high = area
    width, middle, high = y_high - y_low, (z_low + z_high) / 2, z_high - z_low
    keys = darker(ground, 0.6) if sum(ground.color) > 0.6 else Material(color=(0.5, 0.5, 0.52))
    colors = ((0.1, 0.7, 0.9), (0.9, 0.3, 0.1), (0.2, 0.9, 0.3), (0.9, 0.9, 0.9))
    color = cast(Vector, colors[int(rng.integers(len(colors)))])
    row = (middle - 0.14 * high, middle + 0.14 * high)
    shapes: list[Shape] = [badge(face, y_low + 0.14 * width, middle, 0.12 * width)]
    if rng.random() < 0.3:
        shapes += control_knob(face, y_high - 0.12 * width, middle, 0.36 * high, keys)
        end = y_high - 0.24 * width
    else:
        pane = (y_high - 0.30 * width, middle - 0.28 * high, y_high - 0.10 * width)
        shapes += display(face, (*pane, middle + 0.28 * high), color, 3)
        end = y_high - 0.36 * width
    count = int(rng.integers(3, 6))
    shapes += button_grid(face, (end - 0.07 * width * count, row[0], end, row[1]), 1, count, keys)
    return tuple(shapes)


def _inner_door(opening: Rectangle, back: float, material: Material) -> tuple[Shape, ...]:
    """The door's steel tub side and the box for the detergent, inside the opening."""
    y_low, z_low, y_high, z_high = opening
    m = 0.012
    shapes = [
        box_between((back - 0.012, y_low + m, z_low + m), (back, y_high - m, z_high - m), material)
    ]
    width, high = y_high - y_low, z_high - z_low
    shapes.append(
        box_between(
            (back - 0.022, y_high - 0.45 * width, z_low + 0.45 * high),
            (back - 0.012, y_high - 0.18 * width, z_low + 0.70 * high),
            Material(color=(0.16, 0.17, 0.19), roughness=0.5),
        )
    )
    return tuple(shapes)


def _racks(
    rng: np.random.Generator, opening: Rectangle, back: float, end: float
) -> tuple[Shape, ...]:
    """One or two wire racks, a row of plates in the lower one, the spray arm below."""
    y_low, z_low, y_high, z_high = opening
    blue = Material(color=(0.25, 0.35, 0.55), roughness=0.5)
    wire = blue if rng.random() < 0.3 else Material(color=(0.7, 0.7, 0.7), roughness=0.4)
    low, high = (back, y_low + 0.012), (end, y_high - 0.012)
    tall = z_high - z_low > 0.45
    floor = z_low + 0.055
    shapes = list(wire_rack(low, high, floor, 6, wire))
    if tall:
        shapes += wire_rack(low, high, z_low + 0.55 * (z_high - z_low), 6, wire)
    arm = Material(color=(0.3, 0.31, 0.33), roughness=0.5)
    middle = (back + end) / 2
    shapes.append(
        box_between(
            (middle - 0.02, y_low + 0.06, z_low + 0.02),
            (middle + 0.02, y_high - 0.06, z_low + 0.03),
            arm,
        )
    )
    plate = Material(color=(0.85, 0.85, 0.82), roughness=0.25)
    radius = min(0.115, 0.4 * (z_high - floor) * (0.55 if tall else 0.9))
    for i in range(int(rng.integers(0, 5))):
        x = end - 0.05 - radius
        y = y_low + 0.08 + 0.035 * i
        shapes.append(cylinder_along("y", (x, y, floor + 0.006 + radius), radius, 0.006, plate))
    return tuple(shapes)
