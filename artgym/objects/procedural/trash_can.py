"""Trash cans: hollow bins with a lid hinged at the back.

Families: "pedal" (round, metal), "kitchen" (rectangular with round corners), "wheelie" (tapered,
on two wheels), "office" (small and tapered), "flip" (a hood whose front half opens). Handles:
"knob", "bar", "lip" (a ledge along the front), "tab" (a short one).
"""

from __future__ import annotations

import numpy as np

from artgym.objects.model import ArticulatedObject, Link, Material, Shape
from artgym.objects.procedural.handles import bar_at, knob_at
from artgym.objects.procedural.lids import (
    GAP,
    Outline,
    hinge,
    lid_link,
    lip,
    on_top,
    ring_wall,
    rounded,
    rounded_plate,
    rounded_walls,
)
from artgym.objects.procedural.shapes import (
    box_between,
    convex,
    cylinder_along,
    darker,
    frustum,
    leather,
    metal,
    painted,
    plastic,
    uniform,
    wicker,
    with_texture,
)

FAMILIES = ("pedal", "kitchen", "wheelie", "office", "flip")
HANDLES = ("knob", "bar", "lip", "tab")

_DARK = Material(color=(0.03, 0.03, 0.032), roughness=0.7)
#: Wall panels of a round can.
_PANELS = 14

#: Shapes of the body and of the lid, pivot of the hinge, kind of handle.
_Parts = tuple[list[Shape], list[Shape], tuple[float, float, float], str]


def make_trash_can(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A bin of 0.25-0.84 m; the lid opens by 75-100 degrees."""
    family = str(rng.choice(FAMILIES))
    build = {
        "pedal": _pedal,
        "kitchen": _kitchen,
        "wheelie": _wheelie,
        "office": _office,
        "flip": _flip,
    }[family]
    body, lid, pivot, handle = build(rng)
    link = lid_link(rng, "lid", lid, (0.15, 0.6))
    joint = hinge(rng, link, "body", pivot, uniform(rng, (75.0, 100.0)))
    return ArticulatedObject(
        object_id=object_id,
        category="trash_can",
        links=(Link(name="body", shapes=tuple(body), density=300.0), link),
        joints=(joint,),
        attributes={"family": family, "handle": handle},
    )


def _circle(radius: float) -> Outline:
    """The corners of a round can's wall."""
    angles = (np.arange(_PANELS) + 0.5) * 2 * np.pi / _PANELS
    # Panels are chords: their middles lie on the circle.
    reach = radius / np.cos(np.pi / _PANELS)
    return [(float(reach * np.cos(a)), float(reach * np.sin(a))) for a in angles]


def _rectangles(x: float, y: float, wall: float, shift: float = 0.0) -> tuple[Outline, Outline]:
    """Outer and inner outline of four walls, moved along x by ``shift``."""

    def corners(a: float, b: float) -> Outline:
        return [(shift + a, b), (shift - a, b), (shift - a, -b), (shift + a, -b)]

    return corners(x, y), corners(x - wall, y - wall)


def _round_can(
    low_radius: float, radius: float, low: float, high: float, wall: float, look: Material
) -> list[Shape]:
    """A round wall that may taper downwards, and a floor."""
    return [
        *ring_wall(
            (_circle(low_radius), _circle(low_radius - wall)),
            (_circle(radius), _circle(radius - wall)),
            (low, high),
            look,
        ),
        cylinder_along("z", (0.0, 0.0, low + 0.004), low_radius - 0.002, 0.008, look),
    ]


def _square_plate(half: float, low: float, high: float, look: Material) -> Shape:
    """A square slab with round corners."""
    return rounded_plate((half, half), 0.25 * half, low, high, look)


# -- families ----------------------------------------------------------------------------------


def _pedal(rng: np.random.Generator) -> _Parts:
    """A round bin on a dark foot with a pedal; the lid is flat or domed."""
    handle = str(rng.choice(("lip", "tab", "knob"), p=(0.35, 0.35, 0.3)))
    radius = uniform(rng, (0.085, 0.16))
    height = radius * uniform(rng, (2.2, 4.0))
    shell = metal(rng) if rng.random() < 0.55 else painted(rng)
    trim = _DARK if rng.random() < 0.7 else darker(shell, 0.5)
    foot = uniform(rng, (0.018, 0.035))

    body = [
        cylinder_along("z", (0.0, 0.0, foot / 2), radius + 0.005, foot, trim),
        *_round_can(radius, radius, foot, height, 0.004, shell),
        box_between((radius - 0.01, -0.03, 0.006), (radius + 0.045, 0.03, 0.016), trim),
        box_between(
            (-radius - 0.016, -0.035, height - 0.05), (-radius + 0.002, 0.035, height), trim
        ),
    ]
    low = height + GAP
    lid_look = shell if rng.random() < 0.6 else trim
    skirt = uniform(rng, (0.012, 0.030))
    lid = [cylinder_along("z", (0.0, 0.0, low + skirt / 2), radius + 0.003, skirt, lid_look)]
    top = low + skirt
    if rng.random() < 0.65:
        dome = uniform(rng, (0.015, 0.05))
        flat = uniform(rng, (0.45, 0.75)) * radius
        lid.append(frustum("z", (0.0, 0.0, top), (radius, radius), (flat, flat), dome, lid_look))
        top += dome
    lid += _grip(rng, handle, radius + 0.001, low, top, 0.07, trim, front_x=0.2 * radius)
    return body, lid, (-radius - 0.003, 0.0, low), handle


def _kitchen(rng: np.random.Generator) -> _Parts:
    """A tall rectangular bin with round corners."""
    handle = str(rng.choice(("lip", "tab", "bar"), p=(0.4, 0.35, 0.25)))
    x, y = uniform(rng, (0.11, 0.17)), uniform(rng, (0.11, 0.20))
    height = uniform(rng, (0.32, 0.66))
    radius = uniform(rng, (0.02, 0.05))
    shell = metal(rng) if rng.random() < 0.35 else plastic(rng)
    lid_look = shell if rng.random() < 0.4 else plastic(rng)
    foot = 0.02

    body = [
        rounded_plate((x - 0.006, y - 0.006), radius, 0.0, foot, _DARK),
        *rounded_walls((x, y), radius, foot, height, 0.004, shell),
    ]
    if rng.random() < 0.5:
        body.append(box_between((x - 0.01, -0.05, 0.004), (x + 0.035, 0.05, 0.014), _DARK))
    if rng.random() < 0.5:
        body += _bag(rng, x, y, radius, height)
    low = height + GAP
    skirt = uniform(rng, (0.015, 0.035))
    lid = [rounded_plate((x + 0.002, y + 0.002), radius, low, low + skirt, lid_look)]
    top = low + skirt
    dome = uniform(rng, (0.01, 0.06))
    draw = uniform(rng, (0.015, 0.05))
    lid.append(_roof((x, y), (x - draw, y - draw), radius, top, top + dome, lid_look))
    lid += _grip(rng, handle, x + 0.002, low, low + skirt, 1.2 * y, _accent(rng, lid_look))
    return body, lid, (-x - 0.002, 0.0, low), handle


def _wheelie(rng: np.random.Generator) -> _Parts:
    """A tapered bin on two wheels with a handle bar behind."""
    handle = str(rng.choice(("lip", "tab", "bar"), p=(0.5, 0.25, 0.25)))
    x, y = uniform(rng, (0.16, 0.25)), uniform(rng, (0.15, 0.25))
    height = min(uniform(rng, (1.2, 1.6)) * 2 * max(x, y), 0.74)
    shell = _bin_plastic(rng)
    lid_look = shell if rng.random() < 0.5 else _bin_plastic(rng)
    wall = 0.006
    floor = 0.03

    taper = uniform(rng, (0.76, 0.88))
    # The back stays upright.
    shift = -x * (1 - taper) * 0.6
    body = [
        *ring_wall(
            _rectangles(taper * x, taper * y, wall, shift),
            _rectangles(x, y, wall),
            (floor, height),
            shell,
        ),
        box_between(
            (-taper * x + shift, -taper * y, 0.0), (taper * x + shift, taper * y, floor), shell
        ),
    ]
    rim = uniform(rng, (0.02, 0.035))
    edge = 0.012
    for s in (-1, 1):
        body.append(
            box_between(
                (s * x - edge, -y - edge, height - rim), (s * x + edge, y + edge, height), shell
            )
        )
        body.append(box_between((-x, s * y - edge, height - rim), (x, s * y + edge, height), shell))
    body += _wheels(rng, -x, taper * y, x)
    body += _push_bar(rng, x, y, height, shell)
    low = height + GAP
    over, thin = 0.016, uniform(rng, (0.018, 0.028))
    thick = thin + uniform(rng, (0.015, 0.05))
    front, back = x + over, -x - 0.004
    lid = [
        convex(
            [
                (px, py, pz)
                for py in (-y - over, y + over)
                for px, pz in ((back, low), (front, low), (front, low + thin))
            ]
            + [(px, py, low + thick) for py in (-y + 0.02, y - 0.02) for px in (back, 0.2 * x)],
            lid_look,
        )
    ]
    lid += _grip(rng, handle, front, low, low + thin, 1.4 * y, lid_look)
    return body, lid, (back, 0.0, low), handle


def _office(rng: np.random.Generator) -> _Parts:
    """A small tapered can, round or square, under a flat lid."""
    handle = str(rng.choice(("knob", "tab", "lip"), p=(0.5, 0.25, 0.25)))
    radius = uniform(rng, (0.085, 0.15))
    height = radius * uniform(rng, (1.9, 2.8))
    low_radius = radius * uniform(rng, (0.72, 0.92))
    shell = _basket(rng)
    lid_look = shell if rng.random() < 0.5 else plastic(rng)
    low = height + GAP
    thick = uniform(rng, (0.008, 0.016))
    top = low + thick
    if rng.random() < 0.65:
        body = _round_can(low_radius, radius, 0.0, height, 0.004, shell)
        lid = [cylinder_along("z", (0.0, 0.0, low + thick / 2), radius + 0.005, thick, lid_look)]
        if rng.random() < 0.6:
            step = uniform(rng, (0.006, 0.02))
            outer, inner = 0.9 * radius, uniform(rng, (0.4, 0.8)) * radius
            lid.append(
                frustum("z", (0.0, 0.0, top), (outer, outer), (inner, inner), step, lid_look)
            )
            top += step
    else:
        rings = [
            rounded((r, r), 0.25 * r)
            for r in (low_radius, low_radius - 0.004, radius, radius - 0.004)
        ]
        body = [
            *ring_wall((rings[0], rings[1]), (rings[2], rings[3]), (0.0, height), shell),
            _square_plate(low_radius - 0.002, 0.0, 0.008, shell),
        ]
        lid = [_square_plate(radius + 0.005, low, top, lid_look)]
    grip_look = metal(rng) if handle == "knob" else _accent(rng, lid_look)
    lid += _grip(rng, handle, radius + 0.003, low, top, 0.07, grip_look)
    return body, lid, (-radius - 0.005, 0.0, low), handle


def _flip(rng: np.random.Generator) -> _Parts:
    """A rectangular bin under a hood; the hood's front half is the lid."""
    handle = str(rng.choice(("lip", "tab", "knob"), p=(0.45, 0.35, 0.2)))
    x, y = uniform(rng, (0.12, 0.18)), uniform(rng, (0.11, 0.19))
    height = uniform(rng, (0.34, 0.60))
    shell, hood_look = plastic(rng), plastic(rng)
    flap_look = hood_look if rng.random() < 0.4 else plastic(rng)
    wall = 0.005
    taper = uniform(rng, (0.8, 0.95))

    collar = uniform(rng, (0.03, 0.06))
    edge = 0.008
    body = [
        *ring_wall(
            _rectangles(taper * x, taper * y, wall),
            _rectangles(x, y, wall),
            (0.0, height),
            shell,
        ),
        box_between((-taper * x, -taper * y, 0.0), (taper * x, taper * y, 0.006), shell),
        box_between(
            (-x - edge, -y - edge, height), (x + edge, -y + wall, height + collar), hood_look
        ),
        box_between(
            (-x - edge, y - wall, height), (x + edge, y + edge, height + collar), hood_look
        ),
        box_between((-x - edge, -y, height), (-x + wall, y, height + collar), hood_look),
        box_between((x - wall, -y, height), (x + edge, y, height + collar), hood_look),
    ]
    split = -uniform(rng, (0.15, 0.5)) * x
    low = height + collar + GAP
    thick = uniform(rng, (0.008, 0.014))
    body.append(
        box_between(
            (-x - edge, -y - edge, low - GAP), (split - 0.003, y + edge, low + thick), hood_look
        )
    )
    front = x + edge
    lid = [
        box_between((split, -y - edge, low), (front, y + edge, low + thick), flap_look),
        box_between(
            (split + 0.02, -y + 0.02, low + thick),
            (front - 0.02, y - 0.02, low + thick + 0.003),
            darker(flap_look, 0.8),
        ),
    ]
    lid += _grip(
        rng, handle, front, low, low + thick, 1.2 * y, _accent(rng, flap_look), front_x=0.55 * x
    )
    return body, lid, (split, 0.0, low), handle


# -- details -----------------------------------------------------------------------------------


def _grip(
    rng: np.random.Generator,
    handle: str,
    front: float,
    low: float,
    top: float,
    width: float,
    look: Material,
    front_x: float = 0.0,
) -> tuple[Shape, ...]:
    """What opens a lid whose front face stands at x = front, whose underside lies at z = low.

    Args:
        rng: draws sizes.
        handle: which of HANDLES.
        front: x of the lid's front.
        low: z of its underside.
        top: z of its top, where a knob stands; a bar's middle is half way between.
        width: of a lip.
        look: how it looks.
        front_x: x of a knob.
    """
    if handle == "knob":
        return on_top(knob_at, rng, top - 0.001, front_x, 0.0, look)
    if handle == "bar":
        length = min(uniform(rng, (0.09, 0.14)), 1.2 * width)
        return bar_at(rng, front - 0.002, 0.0, (low + top) / 2, "y", length, look)
    wide = width if handle == "lip" else uniform(rng, (0.030, 0.050))
    return lip(rng, front - 0.004, low, wide, look, reach=(0.028, 0.034))


def _basket(rng: np.random.Generator) -> Material:
    """What cans for paper are made of: sheet, perforated sheet, plastic, cane, leather."""
    kind = rng.random()
    if kind < 0.2:
        return with_texture(metal(rng), "perforated", uniform(rng, (0.05, 0.09)))
    if kind < 0.45:
        return metal(rng) if rng.random() < 0.5 else painted(rng)
    if kind < 0.8:
        return plastic(rng)
    return wicker(rng) if rng.random() < 0.6 else leather(rng)


def _accent(rng: np.random.Generator, lid: Material) -> Material:
    """The lid's own colour, a darker shade, or black."""
    return [lid, darker(lid, 0.6), _DARK][int(rng.integers(3))]


def _roof(
    half: tuple[float, float],
    upper: tuple[float, float],
    radius: float,
    low: float,
    high: float,
    look: Material,
) -> Shape:
    """A low hipped roof with round corners."""
    points = [(x, y, low) for x, y in rounded(half, radius)]
    return convex(points + [(x, y, high) for x, y in rounded(upper, 0.7 * radius)], look)


def _bag(
    rng: np.random.Generator, x: float, y: float, radius: float, height: float
) -> tuple[Shape, ...]:
    """The rim of a bag, folded over the walls."""
    look = Material(color=(0.75, 0.76, 0.78) if rng.random() < 0.5 else (0.04, 0.04, 0.05))
    low, t = height - uniform(rng, (0.025, 0.06)), 0.0015
    return rounded_walls((x + t, y + t), radius + t, low, height + 0.0005, 0.004 + 2 * t, look)


def _bin_plastic(rng: np.random.Generator) -> Material:
    """Green, blue, grey, black, brown, yellow: the colours of municipal bins."""
    colors = [
        (0.03, 0.14, 0.06),
        (0.03, 0.08, 0.28),
        (0.12, 0.12, 0.13),
        (0.025, 0.025, 0.03),
        (0.16, 0.08, 0.04),
        (0.62, 0.45, 0.04),
        (0.35, 0.04, 0.03),
    ]
    share = uniform(rng, (0.8, 1.5))
    chosen = colors[int(rng.integers(len(colors)))]
    return darker(Material(color=chosen, roughness=uniform(rng, (0.5, 0.8))), share)


def _wheels(rng: np.random.Generator, back: float, half: float, depth: float) -> list[Shape]:
    """Two wheels on an axle under the back edge."""
    radius = depth * uniform(rng, (0.30, 0.42))
    wide = uniform(rng, (0.03, 0.05))
    x = back + 0.25 * radius
    hub = Material(color=(0.3, 0.3, 0.3), roughness=0.5)
    shapes = [cylinder_along("y", (x, 0.0, radius), 0.010, 2 * half, hub)]
    for s in (-1, 1):
        y = s * (half + wide / 2 + 0.004)
        shapes.append(cylinder_along("y", (x, y, radius), radius, wide, _DARK))
        shapes.append(cylinder_along("y", (x, y, radius), 0.45 * radius, wide + 0.006, hub))
    return shapes


def _push_bar(
    rng: np.random.Generator, x: float, y: float, height: float, look: Material
) -> list[Shape]:
    """A bar behind the rim that one wheels the bin by."""
    reach = uniform(rng, (0.035, 0.06))
    z = height - 0.012
    return [
        cylinder_along("y", (-x - reach, 0.0, z), 0.013, 1.6 * y, look),
        *(
            box_between(
                (-x - reach, s * 0.7 * y - 0.012, z - 0.012),
                (-x, s * 0.7 * y + 0.012, z + 0.012),
                look,
            )
            for s in (-1, 1)
        ),
    ]
