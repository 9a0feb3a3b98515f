"""Microwave ovens: a box with a door hinged on its left, revolute about -z (swings to the front).

Families: "keypad" (display over keys), "dials" (two turning knobs), "glass" (all black in front),
"retro" (rounded, one large dial). Handles: "bar" (upright, round or square), "strap" (bent back at
its ends), "lip" (an upright blade at the door's free edge), "latch" (a lever across the free edge).
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
    button_grid,
    control_knob,
    display,
    door_panel,
    enamel,
    feet,
    finish,
    groove,
    hollow_body,
    latch,
    lip,
    pull_bar,
    side_hinge,
    trim,
)
from artgym.objects.procedural.shapes import (
    box_between,
    cylinder_along,
    darker,
    uniform,
    with_texture,
)

FAMILIES = ("keypad", "dials", "glass", "retro")
HANDLES = ("bar", "strap", "lip", "latch")

_GAP = 0.0025
_INSIDE = Material(color=(0.55, 0.56, 0.56), roughness=0.5)
_COLORS: tuple[Vector, ...] = ((0.1, 0.8, 0.9), (0.2, 0.9, 0.3), (0.9, 0.35, 0.05), (0.9, 0.9, 0.9))


def make_microwave(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A microwave oven of 0.44-0.54 m width; the door opens by 95-120 degrees."""
    family = str(rng.choice(FAMILIES, p=(0.34, 0.24, 0.2, 0.22)))
    odds = (0.35, 0.15, 0.2, 0.3) if family == "retro" else (0.45, 0.3, 0.25, 0.0)
    handle = str(rng.choice(HANDLES, p=odds))
    width = uniform(rng, (0.44, 0.54))
    height = uniform(rng, (0.25, 0.31))
    depth = uniform(rng, (0.31, 0.41))
    base = uniform(rng, (0.010, 0.022))
    thickness = uniform(rng, (0.024, 0.040))
    side = width * uniform(rng, (0.20, 0.28))
    retro = family == "retro"
    shell = enamel(rng) if retro and rng.random() < 0.8 else finish(rng)
    front_look = BLACK if family == "glass" else (shell if rng.random() < 0.7 else finish(rng))
    panel_look = front_look if rng.random() < 0.65 else (BLACK if rng.random() < 0.6 else shell)
    grip_look = trim(rng, front_look)

    y, front, high = width / 2, depth / 2, base + height
    body_front = front - thickness - _GAP
    wall = 0.026 if retro else 0.020
    split = y - side
    opening: Rectangle = (-y + wall, base + wall, split - 0.004, high - wall)
    back = -depth / 2 + wall
    body = [
        *hollow_body(
            (-depth / 2, -y, base),
            (body_front, y, high),
            opening,
            back,
            shell,
            _INSIDE,
            radius=wall - 0.002 if retro else 0.0,
        ),
        *feet((-depth / 2, -y, base), (body_front, y, high)),
        *_turntable(opening, back, body_front),
        box_between((body_front, split, base + 0.003), (front, y, high - 0.003), panel_look),
        *_panel(rng, family, front, (split, base + 0.003, y, high - 0.003), panel_look),
        *_vents(rng, -depth / 2, y, high),
    ]
    door_low = (front - thickness, -y, base + 0.003)
    door_high = (front, split - _GAP, high - 0.003)
    door = _door(rng, family, door_low, door_high, front_look)
    door += _grip(rng, handle, front, door_high[1], door_low[2], door_high[2], grip_look)
    mass = uniform(rng, (0.5, 1.3))
    link = Link(
        name="door",
        shapes=tuple(door),
        density=mass / sum(s.geometry.volume for s in door),
        friction=uniform(rng, (0.6, 1.0)),
    )
    pivot = (front - thickness / 2, -y + 0.008, 0.0)
    return ArticulatedObject(
        object_id=object_id,
        category="microwave",
        links=(Link(name="body", shapes=tuple(body), density=500.0), link),
        joints=(side_hinge(rng, "hinge", "body", link, pivot, "left"),),
        attributes={"family": family, "handle": handle},
    )


def _door(
    rng: np.random.Generator, family: str, low: Vector, high: Vector, look: Material
) -> list[Shape]:
    """The door, its window and the mesh in it; the right border leaves room for the grip."""
    tall = high[2] - low[2]
    border = uniform(rng, (0.10, 0.20)) * tall
    window: Rectangle = (
        low[1] + border,
        low[2] + border * 1.1,
        high[1] - max(border, 0.065),
        high[2] - border,
    )
    shapes = list(door_panel(low, high, look, window, GLASS, 0.002))
    m = 0.10 * tall if family == "glass" else uniform(rng, (0.03, 0.08)) * tall
    mesh = with_texture(Material(color=(0.085, 0.085, 0.09), roughness=0.5), "perforated", 0.06, 0)
    shapes.append(
        box_between(
            (high[0] - 0.002, window[0] + m, window[1] + m),
            (high[0] - 0.001, window[2] - m, window[3] - m),
            mesh,
        )
    )
    shapes.append(badge(high[0], (window[0] + window[2]) / 2, low[2] + 0.5 * border, 0.22 * tall))
    return shapes


def _grip(
    rng: np.random.Generator,
    handle: str,
    face: float,
    edge: float,
    low: float,
    high: float,
    look: Material,
) -> tuple[Shape, ...]:
    """What stands out near the door's free edge, at y = ``edge``."""
    tall, middle = high - low, (low + high) / 2
    length = tall * uniform(rng, (0.5, 0.85))
    if handle == "lip":
        thickness = uniform(rng, (0.010, 0.014))
        y = edge - thickness
        reach = uniform(rng, (0.030, 0.038))
        return lip(face, y, middle, "z", length, look, thickness=thickness, reach=reach)
    if handle == "latch":
        return latch(face, edge - 0.055, middle, 0.10, "left", look, thickness=0.014)
    form = bar_form(rng, handle)
    return pull_bar(
        face,
        edge - uniform(rng, (0.026, 0.036)),
        middle,
        "z",
        length,
        look,
        thickness=uniform(rng, (0.009, 0.011) if form == "strap" else (0.011, 0.016)),
        clearance=uniform(rng, (0.028, 0.036)),
        form=form,
    )


def _panel(
    rng: np.random.Generator, family: str, face: float, area: Rectangle, ground: Material
) -> tuple[Shape, ...]:
    """Controls to the right of the door: a display with keys, knobs, or one large dial."""
    y_low, z_low, y_high, z_high = area
    width, tall, middle = y_high - y_low, z_high - z_low, (y_low + y_high) / 2
    dark = sum(ground.color) < 0.5
    keys = Material(color=(0.42, 0.43, 0.44), roughness=0.5) if dark else darker(ground, 0.55)
    color = cast(Vector, _COLORS[int(rng.integers(len(_COLORS)))])
    left, right = y_low + 0.12 * width, y_high - 0.12 * width
    pane: Rectangle = (left, z_high - 0.24 * tall, right, z_high - 0.08 * tall)
    shapes: list[Shape] = []
    if family in ("keypad", "glass"):
        shapes += display(face, pane, color)
        rows = int(rng.integers(4, 6))
        pad: Rectangle = (left, z_low + 0.24 * tall, right, z_high - 0.30 * tall)
        shapes += button_grid(face, pad, rows, 3, keys)
        start = Material(color=(0.08, 0.42, 0.12)) if rng.random() < 0.4 else keys
        end: Rectangle = (left, z_low + 0.08 * tall, right, z_low + 0.20 * tall)
        shapes += button_grid(face, end, 1, 1 + int(rng.random() < 0.6), start)
        return tuple(shapes)
    knob = CHROME if rng.random() < 0.5 else (keys if dark else BLACK)
    angles = rng.uniform(-2.2, 2.2, 2).tolist()
    skirt = darker(CHROME, 0.7) if rng.random() < 0.5 else None
    if family == "dials":
        radius = min(0.32 * width, 0.030)
        for share, angle in zip((0.30, 0.70), angles, strict=True):
            at = z_low + share * tall
            shapes += control_knob(face, middle, at, radius, knob, angle=angle, skirt=skirt)
        shapes.append(groove(face, (left, z_low + 0.495 * tall, right, z_low + 0.505 * tall)))
        return tuple(shapes)
    if rng.random() < 0.6:
        shapes += display(face, pane, color)
    at = z_low + 0.52 * tall
    shapes += control_knob(
        face, middle, at, 0.34 * width, knob, angle=angles[0], depth=0.024, skirt=skirt
    )
    end = (left, z_low + 0.10 * tall, right, z_low + 0.22 * tall)
    shapes += button_grid(face, end, 1, int(rng.integers(2, 4)), CHROME)
    return tuple(shapes)


def _turntable(opening: Rectangle, back: float, end: float) -> tuple[Shape, ...]:
    """The glass plate, its hub and the lamp's grille."""
    y_low, z_low, y_high, z_high = opening
    x, y = (back + end) / 2, (y_low + y_high) / 2
    radius = 0.46 * min(end - back, y_high - y_low)
    plate = Material(color=(0.50, 0.62, 0.64), roughness=0.1)
    return (
        cylinder_along("z", (x, y, z_low + 0.006), 0.03, 0.012, BLACK),
        cylinder_along("z", (x, y, z_low + 0.015), radius, 0.006, plate),
        box_between(
            (x - 0.04, y_high - 0.001, z_high - 0.08),
            (x + 0.04, y_high, z_high - 0.03),
            Material(color=(0.25, 0.25, 0.26), roughness=0.6),
        ),
    )


def _vents(rng: np.random.Generator, back: float, y: float, top: float) -> tuple[Shape, ...]:
    """Slots in the right wall or in the top."""
    slots = []
    on_top = rng.random() < 0.4
    for i in range(4):
        x = back + 0.05 + 0.022 * i
        if on_top:
            low, high = (x, -0.4 * y, top), (x + 0.006, 0.4 * y, top + 0.0005)
        else:
            low, high = (x, y, top - 0.10), (x + 0.006, y + 0.0005, top - 0.04)
        slots.append(box_between(low, high, BLACK))
    return tuple(slots)
