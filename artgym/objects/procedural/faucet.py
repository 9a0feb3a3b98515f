"""Faucets: a spout that swings about the vertical and a handle, on a foot, a slab or a sink.

Families: "gooseneck" (kitchen, a high bent neck and a lever at the side), "basin" (a short stout
body, a straight spout and a lever on top), "pillar" (slender, turned, with a handle on top of the
spout's collar), "two_hole" (spout and handle side by side on a plate). Handles: "lever" (a rod),
"paddle" (a flat lever), "cross" (four arms), "knob". The handle turns about the vertical where it
is on top, about a level axis where it is a side lever or lifts.

What turns sits on what stands with a gap of ``_GAP``; a thin pin, on the axis, bridges it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from artgym.objects.model import ArticulatedObject, Joint, Link, Material, Shape, Vector
from artgym.objects.procedural.shapes import (
    arc,
    box_between,
    ceramic,
    cylinder_along,
    darker,
    frustum,
    metal,
    painted,
    prism,
    stone,
    tube,
    turned,
    uniform,
    with_role,
)

FAMILIES = ("gooseneck", "basin", "pillar", "two_hole")
HANDLES = ("lever", "paddle", "cross", "knob")

_TOP_HANDLES = {
    "basin": ("lever", "paddle", "paddle", "knob"),
    "pillar": ("cross", "cross", "lever", "knob"),
    "two_hole": ("cross", "lever", "paddle", "knob"),
}
#: Between what turns and what stands, and the radius of the pin in between, metres.
_GAP, _PIN = 0.0015, 0.0045

_UP: Vector = (0.0, 0.0, 1.0)

#: What is seen of the inside of a spout.
_MOUTH = Material(color=(0.05, 0.05, 0.055), roughness=0.5)


@dataclass(frozen=True, kw_only=True)
class _Lever:
    """The moving handle.

    Attributes:
        shapes: its pieces.
        kind: one of ``HANDLES``.
        axis: of its joint; it opens along it.
        pivot: a point of the axis, metres.
        range: radians.
    """

    shapes: Sequence[Shape]
    kind: str
    axis: Vector
    pivot: Vector
    range: float


def make_faucet(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A faucet 0.1 to 0.4 m high; the spout swings by 60-150 degrees, the handle by 25-130."""
    family = str(rng.choice(FAMILIES, p=(0.35, 0.25, 0.2, 0.2)))
    stand = str(rng.choice(("none", "slab", "sink"), p=(0.3, 0.25, 0.45)))
    if family == "two_hole" and stand == "none":
        # Its two halves need something to stand on together.
        stand = "slab"
    look = _finish(rng)
    makers = {
        "gooseneck": _gooseneck,
        "basin": _basin,
        "pillar": _pillar,
        "two_hole": _two_hole,
    }
    base, lever, spout, spout_foot = makers[family](rng, look)
    deck = uniform(rng, (0.055, 0.085))
    stand_shapes, height = _stand(rng, stand, deck, (*base, *lever.shapes))
    # The origin lies under the middle of the faucet, which reaches out in front of its foot.
    reach = max(s.corners_link()[:, 0].max() for s in spout)
    move = np.array([-(reach - 0.03) / 2, 0.0, height])
    handle_mass, spout_mass = uniform(rng, (0.08, 0.25)), uniform(rng, (0.3, 0.9))
    swing = np.radians(uniform(rng, (60.0, 150.0)))
    # A handle at the side must not stand in the spout's way.
    across = np.concatenate([s.corners_link()[:, 1] for s in lever.shapes])
    aside = (across.min() + across.max()) / 2
    side = -np.sign(aside) if abs(aside) > 0.02 else rng.choice((-1.0, 1.0))
    level = abs(lever.axis[2]) < 0.5
    arm = max(np.linalg.norm(s.corners_link() - lever.pivot, axis=1).max() for s in lever.shapes)
    # A lever that tilts must not fall: its friction exceeds gravity's torque.
    hold = handle_mass * 9.81 * arm if level else 0.0
    return ArticulatedObject(
        object_id=object_id,
        category="faucet",
        links=(
            Link(
                name="base",
                shapes=(*_moved(base, move), *with_role("stand", _moved(stand_shapes, move))),
                density=4000.0,
            ),
            _link("handle", _moved(lever.shapes, move), handle_mass, uniform(rng, (0.6, 1.0))),
            _link("spout", _moved(spout, move), spout_mass, uniform(rng, (0.6, 1.0))),
        ),
        joints=(
            Joint(
                name="handle_hinge",
                type="revolute",
                parent="base",
                child="handle",
                axis=lever.axis,
                pivot=_vector(np.asarray(lever.pivot) + move),
                closed=0.0,
                open=float(lever.range),
                friction=float(hold) * uniform(rng, (1.3, 1.6)) + uniform(rng, (0.02, 0.15)),
                damping=uniform(rng, (0.002, 0.01)),
            ),
            Joint(
                name="swivel",
                type="revolute",
                parent="base",
                child="spout",
                axis=(0.0, 0.0, float(side)),
                pivot=_vector(np.asarray(spout_foot) + move),
                closed=0.0,
                open=float(swing),
                friction=uniform(rng, (0.1, 0.7)),
                damping=uniform(rng, (0.01, 0.05)),
            ),
        ),
        attributes={"family": family, "handle": lever.kind, "stand": stand},
    )


def _link(name: str, shapes: Sequence[Shape], mass: float, friction: float) -> Link:
    volume = sum(s.geometry.volume for s in shapes)
    return Link(name=name, shapes=tuple(shapes), density=mass / volume, friction=friction)


def _moved(shapes: Iterable[Shape], offset: np.ndarray) -> tuple[Shape, ...]:
    return tuple(replace(s, position=_vector(np.asarray(s.position) + offset)) for s in shapes)


def _vector(values: Iterable[float]) -> Vector:
    x, y, z = (float(v) for v in values)
    return (x, y, z)


def _finish(rng: np.random.Generator) -> Material:
    """Mostly chrome and steel; brass, bronze, matt black, white."""
    kind = rng.choice(
        ("chrome", "steel", "gold", "bronze", "black", "color", "any"),
        p=(0.36, 0.2, 0.1, 0.07, 0.13, 0.06, 0.08),
    )
    shade = rng.uniform(0.85, 1.1)
    if kind == "color":
        return painted(rng)
    if kind == "any":
        return metal(rng)
    r, g, b, roughness, metallic = {
        "chrome": (0.76, 0.78, 0.80, 0.22, 0.35),
        "steel": (0.58, 0.57, 0.55, 0.42, 0.35),
        "gold": (0.78, 0.58, 0.28, 0.3, 0.4),
        "bronze": (0.30, 0.20, 0.13, 0.45, 0.35),
        "black": (0.035, 0.035, 0.04, 0.5, 0.1),
    }[str(kind)]
    return Material(
        color=(round(r * shade, 4), round(g * shade, 4), round(b * shade, 4)),
        roughness=roughness,
        metallic=metallic,
    )


def _pin(x: float, y: float, low: float, high: float, look: Material) -> Shape:
    """Bridges the gap between two pieces on a vertical axis."""
    return cylinder_along("z", (x, y, (low + high) / 2), _PIN, high - low, darker(look, 0.6))


def _cone(
    x: float,
    y: float,
    z: float,
    below: float,
    above: float,
    height: float,
    look: Material,
    sides: int = 20,
) -> Shape:
    """A tapered upright piece of two radii, its foot at z."""
    return frustum("z", (x, y, z), (below, below), (above, above), height, look, sides)


def _round_or_square(
    square: bool, x: float, y: float, low: float, high: float, half: float, look: Material
) -> Shape:
    """An upright piece of a body: a cylinder, or a block of nearly its width."""
    if square:
        h = 0.92 * half
        return box_between((x - h, y - h, low), (x + h, y + h, high), look)
    return cylinder_along("z", (x, y, (low + high) / 2), half, high - low, look)


# -- families -----------------------------------------------------------------------------------

_Made = tuple[Sequence[Shape], _Lever, Sequence[Shape], Vector]


def _gooseneck(rng: np.random.Generator, look: Material) -> _Made:
    """A column, a lever at its side, and a high neck."""
    neck = str(rng.choice(("round", "shepherd", "square"), p=(0.5, 0.25, 0.25)))
    square = neck == "square" and rng.random() < 0.6
    radius, height = uniform(rng, (0.018, 0.025)), uniform(rng, (0.07, 0.12))
    thickness = uniform(rng, (0.010, 0.014))
    base = [
        _foot(rng, radius, look),
        _round_or_square(square, 0.0, 0.0, 0.004, height, radius, look),
    ]
    base.append(_pin(0.0, 0.0, height, height + 2 * _GAP, look))
    lever = _side_lever(rng, base, radius, height, look)

    low = height + _GAP
    collar = uniform(rng, (0.012, 0.03))
    top = low + collar
    reach, rise = uniform(rng, (0.13, 0.20)), uniform(rng, (0.06, 0.14))
    spout = [_round_or_square(square, 0.0, 0.0, low, top, radius, look)]
    if neck == "square":
        bend = top + rise + 0.04
        drop = uniform(rng, (0.03, 0.09))
        width = thickness * uniform(rng, (0.9, 1.3))
        t = thickness
        spout += [
            box_between((-t, -width, top), (t, width, bend + t), look),
            box_between((t, -width, bend - t), (reach + t, width, bend + t), look),
            box_between((reach - t, -width, bend - drop), (reach + t, width, bend - t), look),
        ]
        tip, mouth = bend - drop, t
    else:
        half = reach / 2
        arch = half * (1.0 if neck == "round" else uniform(rng, (1.15, 1.5)))
        shoulder = top + rise
        spout.append(cylinder_along("z", (0, 0, (top + shoulder) / 2), thickness, rise, look))
        sweep = np.radians(180.0 if rng.random() < 0.6 else uniform(rng, (140.0, 170.0)))
        bend_points = arc((half, 0, shoulder), (-half, 0, 0), (0, 0, arch), float(sweep), 8)
        end, direction = bend_points[-1], bend_points[-1] - bend_points[-2]
        direction = direction / np.linalg.norm(direction)
        drop = uniform(rng, (0.015, 0.06))
        after = end + direction * drop
        head = uniform(rng, (1.0, 1.4)) * thickness
        outlet = after + direction * uniform(rng, (0.03, 0.08))
        # A spray head may be pulled out of the neck.
        radii = [thickness] * (len(bend_points) + 1) + [head]
        spout += tube([*bend_points, after, outlet], radii, look)
        spout += tube([outlet, outlet + 0.004 * direction], 0.85 * head, _MOUTH)
        return base, lever, spout, (0.0, 0.0, low)
    spout.append(cylinder_along("z", (reach, 0, tip - 0.002), 0.8 * mouth, 0.004, _MOUTH))
    return base, lever, spout, (0.0, 0.0, low)


def _basin(rng: np.random.Generator, look: Material) -> _Made:
    """A stout body; spout and handle turn on top of it."""
    square = rng.random() < 0.35
    half = uniform(rng, (0.020, 0.027))
    height = uniform(rng, (0.045, 0.10)) if rng.random() < 0.75 else uniform(rng, (0.15, 0.22))
    collar = uniform(rng, (0.026, 0.036))
    base = [
        _foot(rng, half, look),
        _round_or_square(square, 0.0, 0.0, 0.004, height, half, look),
    ]
    low = height + _GAP
    top = low + collar
    base.append(_pin(0.0, 0.0, height, top + 2 * _GAP, look))
    spout = [_round_or_square(square, 0.0, 0.0, low, top, half, look)]
    spout += _straight_spout(rng, square, half, (low + top) / 2, collar, look)
    kind = str(rng.choice(_TOP_HANDLES["basin"]))
    lever = _top_handle(
        rng, kind, (0.0, 0.0), top + _GAP, half, square, look, may_lift=kind in ("lever", "paddle")
    )
    return base, lever, spout, (0.0, 0.0, low)


def _pillar(rng: np.random.Generator, look: Material) -> _Made:
    """A turned pillar; its spout's collar and its handle sit on top of each other."""
    slim, height = uniform(rng, (0.012, 0.017)), uniform(rng, (0.05, 0.15))
    bulge, collar = uniform(rng, (0.018, 0.023)), uniform(rng, (0.026, 0.036))
    low = height + _GAP
    top = low + collar
    ring = uniform(rng, (0.15, 0.8)) * height
    base = [
        cylinder_along("z", (0, 0, 0.003), 1.7 * slim, 0.006, look),
        _cone(0.0, 0.0, 0.006, 1.5 * slim, slim, 0.02, look),
        cylinder_along("z", (0, 0, height / 2), slim, height, look),
        cylinder_along("z", (0, 0, ring), 1.25 * slim, 0.007, look),
        _cone(0.0, 0.0, height - 0.012, slim, bulge, 0.012, look),
        _pin(0.0, 0.0, height, top + 2 * _GAP, look),
    ]
    middle = (low + top) / 2
    # A neck that rises needs a handle that sits higher, and a lever that points aside.
    rise = 0.0 if rng.random() < 0.4 else uniform(rng, (0.015, 0.045))
    spout = [
        cylinder_along("z", (0, 0, middle), bulge, collar, look),
        *_bent_spout(rng, middle, collar / 2, rise, look),
    ]
    lever = _top_handle(
        rng,
        str(rng.choice(_TOP_HANDLES["pillar"])),
        (0.0, 0.0),
        top + _GAP,
        bulge,
        False,
        look,
        bonnet=uniform(rng, (0.018, 0.030)) + 0.6 * rise,
        outwards=float(rng.choice((-1.0, 1.0))),
    )
    return base, lever, spout, (0.0, 0.0, low)


def _two_hole(rng: np.random.Generator, look: Material) -> _Made:
    """Spout and handle side by side."""
    apart = uniform(rng, (0.10, 0.15))
    side = float(rng.choice((-1.0, 1.0)))
    radius, height = uniform(rng, (0.015, 0.021)), uniform(rng, (0.02, 0.07))
    plate = uniform(rng, (0.006, 0.012))
    y_spout, y_handle = -side * apart / 2, side * apart / 2
    if rng.random() < 0.6:
        base = [_plate(apart + 0.055, 1.35 * radius, plate, look)]
    else:
        base = [
            cylinder_along("z", (0, y, plate / 2), 1.4 * radius, plate, look)
            for y in (y_spout, y_handle)
        ]
    post = plate + uniform(rng, (0.02, 0.05))
    low = plate + height
    base += [
        cylinder_along("z", (0, y_spout, low / 2), radius, low, look),
        cylinder_along("z", (0, y_handle, post / 2), radius, post, look),
        _pin(0.0, y_spout, low, low + 2 * _GAP, look),
        _pin(0.0, y_handle, post, post + 2 * _GAP, look),
    ]
    low += _GAP
    collar = uniform(rng, (0.015, 0.028))
    thickness = uniform(rng, (0.009, 0.0125))
    reach, rise = uniform(rng, (0.11, 0.18)), uniform(rng, (0.05, 0.14))
    half, shoulder = reach / 2, low + collar + rise
    sweep = float(np.radians(uniform(rng, (135.0, 180.0))))
    arch = half * uniform(rng, (0.7, 1.2))
    points = arc((half, y_spout, shoulder), (-half, 0, 0), (0, 0, arch), sweep, 8)
    direction = points[-1] - points[-2]
    end = points[-1] + direction / np.linalg.norm(direction) * uniform(rng, (0.01, 0.04))
    foot = (0.0, y_spout, low + collar - 0.002)
    spout = [
        _cone(0.0, y_spout, low, radius, 1.1 * thickness, collar, look),
        *tube([foot, *points, end], thickness, look),
    ]
    lever = _top_handle(
        rng,
        str(rng.choice(_TOP_HANDLES["two_hole"])),
        (0.0, y_handle),
        post + _GAP,
        radius,
        False,
        look,
        bonnet=uniform(rng, (0.014, 0.026)),
        outwards=side,
    )
    return base, lever, spout, (0.0, y_spout, low)


# -- pieces -------------------------------------------------------------------------------------


def _foot(rng: np.random.Generator, radius: float, look: Material) -> Shape:
    """A disc or a long plate under the body."""
    thickness = uniform(rng, (0.004, 0.009))
    form = rng.random()
    if form < 0.55:
        wide = radius * uniform(rng, (1.25, 1.6))
        return _cone(0.0, 0.0, 0.0, wide, 0.93 * wide, thickness, look)
    if form < 0.75:
        wide = radius * uniform(rng, (1.25, 1.5))
        return box_between((-wide, -wide, 0.0), (wide, wide, thickness), look)
    return _plate(uniform(rng, (0.15, 0.25)), 1.35 * radius, thickness, look)


def _plate(length: float, half_width: float, thickness: float, look: Material) -> Shape:
    """A plate along y with round ends."""
    turn = np.linspace(0.0, np.pi, 9)
    straight = length / 2 - half_width
    ends = [
        (side * half_width * np.cos(a), side * (straight + half_width * np.sin(a)))
        for side in (1.0, -1.0)
        for a in turn
    ]
    return prism(ends, "z", 0.0, thickness, look)


def _straight_spout(
    rng: np.random.Generator, square: bool, half: float, z: float, collar: float, look: Material
) -> list[Shape]:
    """An arm from a stout body and a mouth under its tip."""
    reach, tilt = uniform(rng, (0.10, 0.16)), np.radians(uniform(rng, (-8.0, 16.0)))
    rise = reach * np.tan(tilt)
    thick = 0.42 * collar
    thin = uniform(rng, (0.008, min(0.012, thick)))
    if square:
        w = uniform(rng, (0.5, 0.9)) * half
        outline = [
            (0.5 * half, z - thick),
            (0.5 * half, z + thick),
            (reach, z + rise + thin),
            (reach, z + rise - thin),
        ]
        arm = [prism(outline, "y", -w, w, look)]
        mouth = (reach - w, 0.0, z + rise - thin)
        mouth_radius = 0.6 * w
    else:
        wide = uniform(rng, (1.0, 1.5))
        path = [(0.5 * half, 0, z), (reach - 0.02, 0, z + 0.9 * rise), (reach, 0, z + rise - 0.004)]
        arm = list(
            tube(path, [thick * wide, thin * wide, thin * wide], look, 16, flatness=1 / wide)
        )
        mouth = (reach - 0.012, 0.0, z + 0.9 * rise - 0.6 * thin)
        mouth_radius = 0.010
    drop = uniform(rng, (0.008, 0.016)) + 0.004
    x, y, top = mouth
    return [
        *arm,
        cylinder_along("z", (x, y, top - drop / 2 + 0.004), mouth_radius, drop, look),
        cylinder_along("z", (x, y, top - drop + 0.003), 0.8 * mouth_radius, 0.004, _MOUTH),
    ]


def _bent_spout(
    rng: np.random.Generator, z: float, most: float, rise: float, look: Material
) -> tuple[Shape, ...]:
    """A tube that leaves a collar level, may rise, and bends down.

    Args:
        rng: draws its sizes.
        z: where it leaves the collar.
        most: half the collar's height.
        rise: from there to its highest point, metres.
        look: how it looks.
    """
    thickness = min(uniform(rng, (0.009, 0.012)), 0.85 * most)
    reach, bend = uniform(rng, (0.09, 0.15)), uniform(rng, (0.02, 0.035))
    level = reach - bend
    if rise:
        up = np.linspace(0.0, 1.0, 6)
        # A swan's neck: level at the collar and at the top.
        path = [(0.008 + u * (level - 0.008), 0, z + rise * (3 * u**2 - 2 * u**3)) for u in up]
    else:
        path = [(0.008, 0, z), (level, 0, z)]
    down = arc((level, 0, z + rise - bend), (0, 0, bend), (bend, 0, 0), np.pi / 2, 4)
    end = down[-1] - [0, 0, uniform(rng, (0.006, 0.02))]
    lip = cylinder_along("z", end - [0.0, 0.0, 0.004], 1.2 * thickness, 0.008, look)
    return (*tube([*path, *down[1:], end], thickness, look), lip)


def _side_lever(
    rng: np.random.Generator, base: list[Shape], radius: float, height: float, look: Material
) -> _Lever:
    """A lever at the side of a column; what carries it is added to the base."""
    side = float(rng.choice((-1.0, 1.0)))
    z = height * uniform(rng, (0.55, 0.72))
    boss, hub = uniform(rng, (0.012, 0.017)), uniform(rng, (0.012, 0.02))
    outer = radius + uniform(rng, (0.006, 0.014))
    base.append(cylinder_along("y", (0, side * outer / 2, z), boss, outer, look))
    base.append(
        cylinder_along("y", (0, side * (outer + _GAP), z), _PIN, 4 * _GAP, darker(look, 0.6))
    )
    near, far = outer + _GAP, outer + _GAP + hub
    middle = side * (near + far) / 2
    length = uniform(rng, (0.085, 0.125))
    # Outwards, so that fingers pass beside the neck.
    lean = np.radians(uniform(rng, (8.0, 30.0)))
    start = np.radians(uniform(rng, (-20.0, 70.0)))
    out, along = np.sin(lean) * side, np.cos(lean)
    direction = np.array([along * np.cos(start), out, along * np.sin(start)])
    foot = np.array([0.0, middle, z])
    tip = foot + length * direction
    if rng.random() < 0.6:
        kind = "lever"
        thick = uniform(rng, (0.0055, 0.0075))
        arm = tube([foot, tip], [thick, thick * uniform(rng, (0.8, 1.25))], look, 12)
    else:
        kind = "paddle"
        wide = uniform(rng, (0.008, 0.012))
        arm = tube([foot, tip], [0.7 * wide, wide], look, 12, flatness=0.5)
    if start < np.radians(35.0):
        axis, most = (0.0, -1.0, 0.0), 90.0 - np.degrees(start)
    else:
        axis, most = (0.0, 1.0, 0.0), np.degrees(start) + 20.0
    return _Lever(
        shapes=(cylinder_along("y", foot, boss, hub, look), *with_role("handle", arm)),
        kind=kind,
        axis=axis,
        pivot=_vector(foot),
        range=float(np.radians(uniform(rng, (45.0, max(50.0, min(90.0, float(most))))))),
    )


def _top_handle(
    rng: np.random.Generator,
    kind: str,
    at: tuple[float, float],
    low: float,
    radius: float,
    square: bool,
    look: Material,
    *,
    bonnet: float = 0.0,
    may_lift: bool = False,
    outwards: float = 0.0,
) -> _Lever:
    """A handle on top of a body.

    Args:
        rng: draws its sizes.
        kind: one of ``HANDLES``.
        at: x and y of the vertical axis, metres.
        low: z of its lower end.
        radius: of the body below.
        square: whether the body is.
        look: how it looks.
        bonnet: height of a cone between body and handle, 0 for none.
        may_lift: whether it may tilt about a level axis.
        outwards: side of y to which a lever points; 0 for the front.
    """
    x, y = at
    pivot = (x, y, low)
    axis = (0.0, 0.0, float(rng.choice((-1.0, 1.0))))
    shapes: list[Shape] = []
    white = Material(color=(0.85, 0.85, 0.83), roughness=0.25)
    inlay = white if rng.random() < 0.3 else look
    if bonnet:
        neck = 0.6 * radius
        shapes.append(_cone(x, y, low, radius, neck, bonnet, look))
        low, radius = low + bonnet, max(neck, 0.008)
    if kind == "cross":
        arm, thick = uniform(rng, (0.026, 0.036)), uniform(rng, (0.0042, 0.006))
        z = low + 0.012
        offset = uniform(rng, (0.0, np.pi / 2))
        shapes.append(cylinder_along("z", (x, y, low + 0.009), 0.011, 0.018, look))
        shapes.append(cylinder_along("z", (x, y, low + 0.019), 0.009, 0.003, inlay))
        for k in range(4):
            angle = offset + k * np.pi / 2
            pieces = [
                cylinder_along("x", (x + arm / 2, y, z), thick, arm, look),
                cylinder_along("x", (x + arm + 0.004, y, z), 1.35 * thick, 0.008, look),
            ]
            turned_pieces = [turned(piece, _UP, (x, y, z), angle) for piece in pieces]
            # One arm is enough to hold: between all four lies the axis, where no force turns it.
            shapes += with_role("handle" if k == 0 else "body", turned_pieces)
        return _Lever(
            shapes=shapes,
            kind=kind,
            axis=axis,
            pivot=pivot,
            range=float(np.radians(uniform(rng, (70.0, 130.0)))),
        )
    if kind == "knob":
        wide, tall = uniform(rng, (0.020, 0.030)), uniform(rng, (0.022, 0.032))
        shapes.append(cylinder_along("z", (x, y, low + 0.005), 0.7 * wide, 0.010, look))
        low += 0.008
        sides = int(rng.choice((6, 8, 24)))
        grip = _cone(x, y, low, wide, 0.88 * wide, tall, look, sides)
        cap = cylinder_along("z", (x, y, low + tall + 0.001), 0.55 * wide, 0.003, inlay)
        # A wing shows how far it is turned, and gives a finger its lever.
        tip, half = wide + uniform(rng, (0.006, 0.014)), uniform(rng, (0.003, 0.0045))
        wing = box_between(
            (x + 0.7 * wide, y - half, low + 0.2 * tall),
            (x + tip, y + half, low + 0.8 * tall),
            look,
        )
        return _Lever(
            shapes=(*shapes, grip, cap, *with_role("handle", (wing,))),
            kind=kind,
            axis=axis,
            pivot=pivot,
            range=float(np.radians(uniform(rng, (70.0, 130.0)))),
        )
    cap = uniform(rng, (0.018, 0.03))
    if square:
        shapes.append(_round_or_square(True, x, y, low, low + cap, radius, look))
    else:
        shapes.append(_cone(x, y, low, radius, 0.85 * radius, cap, look))
    length = uniform(rng, (0.085, 0.12)) if not bonnet else uniform(rng, (0.06, 0.085))
    tilt = float(np.radians(uniform(rng, (5.0, 28.0))))
    yaw = np.pi / 2 * outwards + uniform(rng, (-0.25, 0.25)) if outwards else 0.0
    z = low + 0.6 * cap
    if kind == "lever":
        thick = uniform(rng, (0.0055, 0.0075))
        arm = tube([(x, y, z), (x + length, y, z)], [thick, 1.15 * thick], look, 12)
    else:
        foot_width, tip_width = uniform(rng, (0.5, 0.75)) * radius, uniform(rng, (0.009, 0.015))
        thick = uniform(rng, (0.0035, 0.005))
        outline = [
            (x, y - foot_width),
            (x + length - 0.006, y - tip_width),
            (x + length, y - 0.6 * tip_width),
            (x + length, y + 0.6 * tip_width),
            (x + length - 0.006, y + tip_width),
            (x, y + foot_width),
        ]
        arm = (prism(outline, "z", z - thick, z + thick, look),)
    arm = [turned(s, (0.0, -1.0, 0.0), (x, y, z), tilt) for s in arm]
    arm = [turned(s, _UP, (x, y, z), float(yaw)) for s in arm]
    shapes += with_role("handle", arm)
    span = uniform(rng, (55.0, 110.0))
    if may_lift and rng.random() < 0.5:
        return _Lever(
            shapes=shapes,
            kind=kind,
            axis=(0.0, -1.0, 0.0),
            pivot=(x, y, z),
            range=float(np.radians(uniform(rng, (25.0, 40.0)))),
        )
    return _Lever(shapes=shapes, kind=kind, axis=axis, pivot=pivot, range=float(np.radians(span)))


def _stand(
    rng: np.random.Generator, kind: str, deck: float, foot: Iterable[Shape]
) -> tuple[list[Shape], float]:
    """What the faucet stands on, its top at z = 0, and how high that is, metres.

    Args:
        rng: draws sizes and material.
        kind: "none", "slab" or "sink".
        deck: half the depth of a sink's deck.
        foot: what must find room on it.
    """
    if kind == "none":
        return [], 0.0
    half_foot = max(float(np.abs(s.corners_link()[:, 1]).max()) for s in foot) + 0.02
    if kind == "slab":
        look = stone(rng) if rng.random() < 0.7 else ceramic(rng)
        height = uniform(rng, (0.012, 0.03))
        x, y = uniform(rng, (0.07, 0.11)), max(half_foot, uniform(rng, (0.10, 0.18)))
        return [box_between((-x, -y, -height), (x, y, 0.0), look)], height
    steel = Material(color=(0.62, 0.63, 0.64), roughness=0.4, metallic=0.35)
    look = steel if rng.random() < 0.45 else (ceramic(rng) if rng.random() < 0.6 else stone(rng))
    height, wall = uniform(rng, (0.045, 0.075)), uniform(rng, (0.010, 0.022))
    y = max(half_foot, uniform(rng, (0.15, 0.21)))
    near, far = deck, deck + uniform(rng, (0.19, 0.26))
    dark = darker(look, 0.5)
    drain = ((near + far) / 2, 0.0, -height + 0.009)
    return [
        box_between((-deck, -y, -height), (near, y, 0.0), look),
        box_between((far, -y, -height), (far + wall, y, 0.0), look),
        box_between((near, -y, -height), (far, -y + wall, 0.0), look),
        box_between((near, y - wall, -height), (far, y, 0.0), look),
        box_between((near, -y + wall, -height), (far, y - wall, -height + 0.008), look),
        cylinder_along("z", drain, 0.022, 0.003, dark),
    ], height
