"""Room doors: a leaf in its frame and a piece of wall, revolute about the vertical, towards +x.

Families: "flat", "panelled" (raised fields in stiles and rails), "glazed" (a large pane, with or
without glazing bars), "barn" (boards with a Z or two ledges). Handles: "lever" (on a rose or a
plate), "knob", "bar" (upright), rigid on the leaf at about a metre's height. The hinge is on the
left or on the right as the user sees it (left is y < 0).

Real sizes; the wall is the frame's stand, the frame itself is what a person would measure.
"""

from __future__ import annotations

import itertools
from typing import Literal

import numpy as np

from artgym.objects.model import ArticulatedObject, Link, Material, Shape, Vector
from artgym.objects.procedural.cabinetry import Rectangle, door_panel, pull_bar, side_hinge
from artgym.objects.procedural.shapes import (
    box_between,
    convex,
    cylinder_along,
    darker,
    frustum,
    metal,
    painted,
    uniform,
    with_role,
    wood,
)

FAMILIES = ("flat", "panelled", "glazed", "barn")
HANDLES = ("lever", "knob", "bar")

Side = Literal["left", "right"]

#: Between leaf and jambs, metres.
_GAP = 0.003
#: Below the leaf, metres.
_SILL = 0.010


def make_door(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A door with a leaf of 0.6-0.9 x 1.85-2.1 m that opens by 70-95 degrees."""
    family = str(rng.choice(FAMILIES, p=(0.25, 0.33, 0.25, 0.17)))
    handle = str(rng.choice(HANDLES, p=(0.55, 0.28, 0.17)))
    side: Side = "left" if rng.random() < 0.5 else "right"
    width, height = uniform(rng, (0.62, 0.88)), uniform(rng, (1.85, 2.08))
    thickness = uniform(rng, (0.034, 0.044))
    jamb = uniform(rng, (0.022, 0.040))
    casing = uniform(rng, (0.045, 0.085))

    frame_look = painted(rng) if rng.random() < 0.55 else wood(rng)
    leaf_look = frame_look if rng.random() < 0.4 else _leaf_look(rng, family)
    iron = metal(rng)
    low, high = -width / 2, width / 2
    place = (low, _SILL, high, _SILL + height)
    # The leaf is flush with the room's side of its jambs; its inner face is x = 0.
    face = thickness
    frame = (
        *_frame(place, face, jamb, casing, uniform(rng, (0.008, 0.016)), frame_look),
        *_wall(rng, place, face, jamb),
    )

    grip_at = uniform(rng, (0.94, 1.06))
    towards_hinge = -1.0 if side == "left" else 1.0
    edge = (high if side == "left" else low) + towards_hinge * uniform(rng, (0.055, 0.075))
    pivot: Vector = (face + 0.002, low if side == "left" else high, _SILL + height / 2)
    leaf = [
        *_leaf(rng, family, place, (0.0, face), grip_at, leaf_look),
        *(
            cylinder_along("z", (pivot[0], pivot[1], z), 0.0055, 0.09, iron)
            for z in (0.22, 1.02, height - 0.18)
        ),
        *_handle(rng, handle, (0.0, face), edge, grip_at, towards_hinge, iron),
    ]
    mass = uniform(rng, (3.0, 5.0))
    door = Link(
        name="door",
        shapes=tuple(leaf),
        density=mass / sum(s.geometry.volume for s in leaf),
        friction=uniform(rng, (0.6, 1.0)),
    )
    hinge = side_hinge(
        rng, "hinge", "frame", door, pivot, side, angles_deg=(70.0, 95.0), grip_force=(1.0, 3.0)
    )
    return ArticulatedObject(
        object_id=object_id,
        category="door",
        links=(Link(name="frame", shapes=frame, density=500.0), door),
        joints=(hinge,),
        attributes={"family": family, "handle": handle, "hinge": side},
    )


def _leaf_look(rng: np.random.Generator, family: str) -> Material:
    """White and grey lacquer, wood, a colour."""
    if family == "barn":
        return wood(rng)
    kind = rng.random()
    if kind < 0.35:
        v = uniform(rng, (0.6, 0.9))
        return Material(color=(v, v, v * uniform(rng, (0.88, 1.0))), roughness=0.5)
    return wood(rng) if kind < 0.75 else painted(rng)


def _frame(
    place: Rectangle, face: float, jamb: float, casing: float, proud: float, look: Material
) -> tuple[Shape, ...]:
    """Jambs, head, stops behind the leaf, a threshold and the casing around them."""
    low, z_low, high, z_high = place
    y0, y1, top = low - _GAP, high + _GAP, z_high + _GAP
    back = -0.055
    return (
        box_between((back, y0 - jamb, 0.0), (face, y0, top), look),
        box_between((back, y1, 0.0), (face, y1 + jamb, top), look),
        box_between((back, y0 - jamb, top), (face, y1 + jamb, top + jamb), look),
        # Stops: the leaf closes against them.
        box_between((back, y0, 0.0), (-_GAP, y0 + 0.012, top), look),
        box_between((back, y1 - 0.012, 0.0), (-_GAP, y1, top), look),
        box_between((back, y0, top - 0.012), (-_GAP, y1, top), look),
        box_between((back, y0, 0.0), (face, y1, z_low - 0.004), darker(look, 0.6)),
        # The casing leaves the edge of the jambs, and so the hinges, free.
        box_between((face, y0 - casing, 0.0), (face + proud, y0 - 0.008, top + casing), look),
        box_between((face, y1 + 0.008, 0.0), (face + proud, y1 + casing, top + casing), look),
        box_between(
            (face, y0 - 0.008, top + 0.008), (face + proud, y1 + 0.008, top + casing), look
        ),
    )


def _wall(
    rng: np.random.Generator, place: Rectangle, face: float, jamb: float
) -> tuple[Shape, ...]:
    """Pieces of wall beside and above the frame, with a skirting board or none: the stand."""
    low, _, high, z_high = place
    side, above = uniform(rng, (0.14, 0.26)), uniform(rng, (0.10, 0.15))
    v, warmth = uniform(rng, (0.5, 0.85)), uniform(rng, (0.85, 1.0))
    plaster = Material(color=(v, v * (0.5 + 0.5 * warmth), v * warmth), roughness=0.95)
    if rng.random() < 0.25:
        plaster = painted(rng)
    y0, y1 = low - _GAP - jamb, high + _GAP + jamb
    top = z_high + _GAP + jamb
    back = -0.055
    walls = [
        box_between((back, y0 - side, 0.0), (face, y0, top + above), plaster),
        box_between((back, y1, 0.0), (face, y1 + side, top + above), plaster),
        box_between((back, y0, top), (face, y1, top + above), plaster),
    ]
    return with_role("stand", walls)


def _leaf(
    rng: np.random.Generator,
    family: str,
    place: Rectangle,
    x: tuple[float, float],
    lock_at: float,
    look: Material,
) -> tuple[Shape, ...]:
    """The leaf without its handle, between its inner and its outer face."""
    y_low, z_low, y_high, z_high = place
    back, face = x
    low, high = (back, y_low, z_low), (face, y_high, z_high)
    height = z_high - z_low
    if family == "flat":
        shapes = [box_between(low, high, look)]
        inlay = rng.random()
        if inlay < 0.35:
            # Strips of metal or a darker wood across the leaf.
            strip = metal(rng) if rng.random() < 0.5 else darker(look, 0.55)
            for i in range(int(rng.integers(3, 6))):
                z = z_low + height * (0.18 + 0.16 * i)
                shapes.append(
                    box_between((face, y_low, z - 0.005), (face + 0.0005, y_high, z + 0.005), strip)
                )
        elif inlay < 0.6:
            shapes.append(
                box_between(
                    (face, y_low + 0.01, z_low + 0.01),
                    (face + 0.0015, y_high - 0.01, z_low + uniform(rng, (0.15, 0.25))),
                    metal(rng),
                )
            )
        return tuple(shapes)
    stile = uniform(rng, (0.095, 0.125))
    if family == "barn":
        return _boards(rng, place, x, look)
    if family == "glazed":
        glass = Material(color=(0.52, 0.62, 0.66), roughness=0.08)
        lower = uniform(rng, (0.16, 0.30)) if rng.random() < 0.5 else uniform(rng, (0.75, 0.85))
        window = (y_low + stile, z_low + lower, y_high - stile, z_high - stile)
        shapes = list(door_panel(low, high, look, window, glass, 0.012))
        rows, columns = int(rng.integers(1, 5)), int(rng.integers(1, 4))
        shapes += _bars(window, (back + 0.006, face - 0.006), rows, columns, look)
        if lower > 0.5:
            field = (window[0], z_low + 0.12, window[2], window[1] - 0.10)
            shapes += _field(field, face, look)
        return tuple(shapes)
    # Panelled: a thinner core, stiles and rails on it, raised fields between them.
    rows, columns = int(rng.integers(2, 5)), int(rng.integers(1, 3))
    core = 0.013
    shapes = [box_between((back, y_low, z_low), (face - core, y_high, z_high), look)]
    shapes += [
        box_between((face - core, y_low, z_low), (face, y_low + stile, z_high), look),
        box_between((face - core, y_high - stile, z_low), (face, y_high, z_high), look),
    ]
    rail = 0.09
    bottom, top = z_low + 0.18, z_high - stile
    shares = np.array([1.0, 0.75, 0.9, 0.6])[:rows]
    tall = (top - bottom - (rows - 1) * rail) * shares / shares.sum()
    edges = [z_low]
    z, fields = bottom, []
    inner = (y_low + stile, y_high - stile)
    pitch = (inner[1] - inner[0] + rail) / columns
    for t in tall:
        shapes.append(box_between((face - core, inner[0], edges[-1]), (face, inner[1], z), look))
        fields += [
            (inner[0] + c * pitch, z, inner[0] + (c + 1) * pitch - rail, z + float(t))
            for c in range(columns)
        ]
        edges.append(z + float(t))
        z += float(t) + rail
    shapes.append(box_between((face - core, inner[0], edges[-1]), (face, inner[1], z_high), look))
    if columns == 2:
        middle = (inner[0] + inner[1]) / 2
        shapes.append(
            box_between(
                (face - core, middle - rail / 2, bottom),
                (face - 0.0003, middle + rail / 2, top),
                look,
            )
        )
    for field in fields:
        shapes += _field(field, face - core, look)
    return tuple(shapes)


def _field(area: Rectangle, face: float, look: Material) -> tuple[Shape, ...]:
    """A raised field with slanted edges, 9 mm high."""
    y0, z0, y1, z1 = area
    margin, slope, high = 0.014, 0.030, 0.009
    corners = [
        (face + x, y, z)
        for x, m in ((0.0, margin), (high, margin + slope))
        for y in (y0 + m, y1 - m)
        for z in (z0 + m, z1 - m)
    ]
    return (convex(corners, darker(look, 0.95)),)


def _bars(
    window: Rectangle, x: tuple[float, float], rows: int, columns: int, look: Material
) -> tuple[Shape, ...]:
    """Glazing bars that part a window into rows and columns."""
    y0, z0, y1, z1 = window
    half = 0.010
    upright = [y0 + i * (y1 - y0) / columns for i in range(1, columns)]
    lying = [z0 + i * (z1 - z0) / rows for i in range(1, rows)]
    return (
        *(box_between((x[0], y - half, z0), (x[1], y + half, z1), look) for y in upright),
        *(
            box_between((x[0] + 0.001, y0, z - half), (x[1] - 0.001, y1, z + half), look)
            for z in lying
        ),
    )


def _boards(
    rng: np.random.Generator, place: Rectangle, x: tuple[float, float], look: Material
) -> tuple[Shape, ...]:
    """Upright boards of slightly different shade, two ledges and a brace across them."""
    y_low, z_low, y_high, z_high = place
    back, face = x
    ground = face - 0.014
    count = int(rng.integers(4, 7))
    pitch = (y_high - y_low) / count
    shapes = [
        box_between(
            (back, y_low + i * pitch, z_low),
            (ground, y_low + (i + 1) * pitch, z_high),
            darker(look, uniform(rng, (0.75, 1.0))),
        )
        for i in range(count)
    ]
    ledge, dark = uniform(rng, (0.09, 0.13)), darker(look, uniform(rng, (0.55, 0.9)))
    rows = [z_low + 0.10, z_high - 0.10 - ledge]
    if rng.random() < 0.6:
        rows.insert(1, (z_low + z_high - ledge) / 2 - 0.18)
    for z in rows:
        shapes.append(box_between((ground, y_low, z), (face, y_high, z + ledge), dark))
    rising = 1.0 if rng.random() < 0.5 else -1.0
    for below, above in itertools.pairwise(rows):
        a, b = (y_low, y_high) if rising > 0 else (y_high, y_low)
        wide = rising * 0.09
        outline = [(a, below + ledge), (a + wide, below + ledge), (b, above), (b - wide, above)]
        corners = [(px, py, pz) for px in (ground, face - 0.001) for py, pz in outline]
        shapes.append(convex(corners, dark))
    return tuple(shapes)


def _handle(
    rng: np.random.Generator,
    handle: str,
    x: tuple[float, float],
    y: float,
    z: float,
    towards_hinge: float,
    look: Material,
) -> tuple[Shape, ...]:
    """A handle on the outer face and, of levers and knobs, its like on the inner one."""
    back, face = x
    if handle == "bar":
        return pull_bar(
            face,
            y,
            z,
            "z",
            uniform(rng, (0.25, 0.55)),
            look,
            thickness=uniform(rng, (0.014, 0.022)),
            clearance=uniform(rng, (0.034, 0.046)),
            form=("round", "square", "strap")[int(rng.integers(3))],
        )
    plate = rng.random() < 0.4
    shapes: list[Shape] = []
    if plate:
        half, up, down = uniform(rng, (0.018, 0.024)), 0.06, uniform(rng, (0.12, 0.16))
        shapes += [
            box_between((face, y - half, z - down), (face + 0.006, y + half, z + up), look),
            box_between((back - 0.006, y - half, z - down), (back, y + half, z + up), look),
        ]
        shapes.append(
            cylinder_along("x", (face + 0.006, y, z - 0.075), 0.007, 0.002, darker(look, 0.2))
        )
    else:
        r = uniform(rng, (0.022, 0.028))
        shapes += [
            cylinder_along("x", (face + 0.004, y, z), r, 0.008, look),
            cylinder_along("x", (back - 0.004, y, z), r, 0.008, look),
        ]
        if rng.random() < 0.6:
            # A rose of its own for the key.
            shapes.append(cylinder_along("x", (face + 0.003, y, z - 0.085), 0.9 * r, 0.006, look))
    grip = (
        _lever(rng, face, y, z, towards_hinge, look)
        if handle == "lever"
        else _knob(rng, face, y, z, look)
    )
    inside = cylinder_along("x", (back - 0.025, y, z), 0.010, 0.050, look)
    if handle == "lever":
        far = y + towards_hinge * 0.115
        knob = box_between(
            (back - 0.056, min(y, far) - 0.008, z - 0.008),
            (back - 0.040, max(y, far), z + 0.008),
            look,
        )
    else:
        knob = cylinder_along("x", (back - 0.055, y, z), 0.025, 0.030, look)
    return (*shapes, inside, knob, *with_role("handle", grip))


def _lever(
    rng: np.random.Generator, face: float, y: float, z: float, towards_hinge: float, look: Material
) -> tuple[Shape, ...]:
    """A neck and a lever that points to the hinge: round, square, flat or returned to the leaf."""
    form = str(rng.choice(("round", "square", "flat", "return")))
    length, r = uniform(rng, (0.105, 0.140)), uniform(rng, (0.008, 0.011))
    reach = face + uniform(rng, (0.042, 0.058))
    start, end = y - towards_hinge * r, y + towards_hinge * length
    middle, half = (start + end) / 2, length / 2 + r / 2
    neck = cylinder_along("x", ((face + reach) / 2, y, z), 0.9 * r, reach - face, look)
    if form in ("round", "return"):
        lever = cylinder_along("y", (reach, middle, z), r, 2 * half, look)
        if form == "round":
            return neck, lever
        tip = end - towards_hinge * r
        bend = cylinder_along("x", (reach - 0.015, tip, z), r, 0.030, look)
        return neck, lever, bend
    deep, tall = (r, r) if form == "square" else (0.6 * r, 1.3 * r)
    low, high = sorted((start, end))
    return neck, box_between((reach - deep, low, z - tall), (reach + deep, high, z + tall), look)


def _knob(
    rng: np.random.Generator, face: float, y: float, z: float, look: Material
) -> tuple[Shape, ...]:
    """A neck and a round head of two tapered halves, or a disc."""
    r, stem = uniform(rng, (0.022, 0.028)), uniform(rng, (0.026, 0.034))
    neck = cylinder_along("x", (face + stem / 2, y, z), 0.45 * r, stem, look)
    x = face + stem
    if rng.random() < 0.3:
        return neck, cylinder_along("x", (x + 0.012, y, z), r, 0.024, look)
    small, wide = (0.55 * r, 0.55 * r), (r, r)
    return (
        neck,
        frustum("x", (x, y, z), small, wide, 0.7 * r, look, 16),
        frustum("x", (x + 0.7 * r, y, z), wide, small, 0.6 * r, look, 16),
    )
