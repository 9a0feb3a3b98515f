"""Drawers: furniture and desk-top boxes with one to four drawers, prismatic along +x.

Forms: "single" (a small cabinet with one drawer; families "chest", closed below it, "nightstand",
open below on side walls, "desktop", which it fills), "cabinet" (2 to 4 drawers, one above
another), "desk" (a writing desk with 1 to 3 drawers in a row below its top or stacked in a
pedestal), "organiser" (a box of plastic, wood or metal for a desk's top with 1 to 3 drawers).
The last three are families of their own.

Handles: "bar" (lying or upright), "knob", "ledge"; of the forms other than "single" also "cup",
"edge" (the front's upper or lower edge stands out as a lip) and, of organisers, "notch" (a piece
cut out of the front's upper edge, wide enough for a finger behind the front).

Drawers are numbered from top to bottom, then from left to right as the user sees them (-y to +y).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from artgym.objects.model import ArticulatedObject, Joint, Link, Material, Shape
from artgym.objects.procedural.handles import (
    HANDLE_MAKERS,
    bar_at,
    cup_at,
    knob_at,
    ledge_at,
    small_bar_at,
    small_knob_at,
)
from artgym.objects.procedural.shapes import (
    Interval,
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

FORMS = ("single", "cabinet", "desk", "organiser")
FAMILIES = ("chest", "nightstand", "desktop", "cabinet", "desk", "organiser")
HANDLES = ("bar", "knob", "ledge", "cup", "edge", "notch")

_FORM_SHARES = (0.5, 0.16, 0.14, 0.20)
#: Families and handles of the form "single"; objects made earlier depend on their order.
_SINGLE_FAMILIES = ("chest", "nightstand", "desktop")
_SINGLE_HANDLES = ("bar", "knob", "ledge")


def make_drawer(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """An object of 1 to 4 drawers; each opens by 55-85 % of its depth."""
    # A child's stream: "single" must find its own as if nothing had been drawn before it.
    form_rng = rng.spawn(1)[0]
    form = str(form_rng.choice(FORMS, p=_FORM_SHARES))
    if form == "single":
        return _single(object_id, rng)
    return _FORM_MAKERS[form](object_id, form_rng)


def _single(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A cabinet of 0.2-0.45 m a side with one drawer."""
    family = str(rng.choice(_SINGLE_FAMILIES))
    handle = str(rng.choice(_SINGLE_HANDLES, p=(0.5, 0.25, 0.25)))
    width, depth = uniform(rng, (0.20, 0.45)), uniform(rng, (0.20, 0.40))
    wall = uniform(rng, (0.008, 0.018))
    drawer_height = uniform(rng, (0.09, 0.16))
    if family == "desktop":
        drawer_height += 0.06
        height = drawer_height + 2 * wall
    else:
        height = drawer_height + 2 * wall + uniform(rng, (0.08, 0.20))
    body_material = wood(rng) if rng.random() < 0.6 else painted(rng)
    front_material = body_material if rng.random() < 0.4 else painted(rng)
    handle_material = metal(rng) if rng.random() < 0.7 else painted(rng)

    floor = height - 2 * wall - drawer_height
    body = _body(family, width, depth, height, floor, wall, body_material)
    # An inset front: framed by the walls, 2 mm free all round, its face up to 2 mm behind theirs.
    face_x = depth / 2 - uniform(rng, (0.0, 0.002))
    front_thickness = uniform(rng, (0.010, 0.020))
    front_low, front_high = floor + wall + 0.002, height - wall - 0.002
    half_front = width / 2 - wall - 0.002
    front = box_between(
        (face_x - front_thickness, -half_front, front_low),
        (face_x, half_front, front_high),
        front_material,
    )
    tray = _tray(width, depth, face_x - front_thickness, floor + wall, drawer_height, wall)
    grip = HANDLE_MAKERS[handle](
        rng,
        face_x,
        2 * half_front,
        (front_low + front_high) / 2,
        front_high - front_low,
        handle_material,
    )
    drawer_volume = sum(s.geometry.volume for s in (*tray, front, *grip))
    mass = uniform(rng, (0.4, 1.6))
    return ArticulatedObject(
        object_id=object_id,
        category="drawer",
        links=(
            Link(name="body", shapes=body, density=600.0),
            Link(
                name="drawer_1",
                shapes=(front, *tray, *grip),
                density=mass / drawer_volume,
                friction=uniform(rng, (0.6, 1.0)),
            ),
        ),
        joints=(
            Joint(
                name="slide_1",
                type="prismatic",
                parent="body",
                child="drawer_1",
                axis=(1.0, 0.0, 0.0),
                pivot=(0.0, 0.0, 0.0),
                closed=0.0,
                open=depth * uniform(rng, (0.55, 0.85)),
                friction=uniform(rng, (1.0, 6.0)),
                damping=uniform(rng, (2.0, 10.0)),
            ),
        ),
        attributes={"family": family, "handle": handle},
    )


def _body(
    family: str,
    width: float,
    depth: float,
    height: float,
    floor: float,
    wall: float,
    material: Material,
) -> tuple[Shape, ...]:
    """The cabinet around an opening between ``floor + wall`` and ``height - wall``."""
    x, y = depth / 2, width / 2
    shapes = [
        box_between((-x, -y, 0), (x, -y + wall, height), material),
        box_between((-x, y - wall, 0), (x, y, height), material),
        box_between((-x, -y + wall, height - wall), (x, y - wall, height), material),
        box_between((-x, -y + wall, floor), (x, y - wall, floor + wall), material),
        box_between((-x, -y + wall, floor + wall), (-x + wall, y - wall, height - wall), material),
    ]
    if family == "chest":
        panel = darker(material, 0.85)
        shapes.append(box_between((x - wall, -y + wall, 0), (x, y - wall, floor), panel))
        shapes.append(box_between((-x, -y + wall, 0), (-x + wall, y - wall, floor), panel))
    elif family == "nightstand":
        shapes.append(box_between((-x, -y + wall, 0.0), (x, y - wall, wall), material))
    return tuple(shapes)


def _tray(
    width: float, depth: float, front: float, bottom: float, height: float, wall: float
) -> tuple[Shape, ...]:
    """The drawer's box behind its front, 3 mm clear of the cabinet."""
    gap, thin = 0.003, 0.006
    material = Material(color=(0.75, 0.68, 0.55), roughness=0.8)
    y = width / 2 - wall - gap
    back = -depth / 2 + wall + gap
    low, high = bottom + gap, bottom + 0.8 * height
    return (
        box_between((back, -y, low), (front, y, low + thin), material),
        box_between((back, -y, low + thin), (front, -y + thin, high), material),
        box_between((back, y - thin, low + thin), (front, y, high), material),
        box_between((back, -y + thin, low + thin), (back + thin, y - thin, high), material),
    )


# -- forms of several drawers --------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class _Bay:
    """The opening of a carcass that a drawer fills, in y and z; metres."""

    left: float
    right: float
    low: float
    high: float


@dataclass(frozen=True, kw_only=True)
class _Style:
    """What the drawers of one object share; metres.

    Attributes:
        handle: one of ``HANDLES``.
        front, tray, grip: how fronts, the boxes behind them and handles look.
        thickness: of a front.
        overlay: how far a front covers the frame about its bay; negative for an inset front, which
            leaves a gap.
        wall: of the box behind the front.
        gap: between that box and the carcass.
        tray_height: height of the box's walls, as a share of the bay's.
        lip_low: whether the lip of an "edge" is the lower edge.
        field: "plain", "raised" (a field with slanted edges) or "framed" (a border around it).
    """

    handle: str
    front: Material
    tray: Material
    grip: Material
    thickness: float
    overlay: float
    wall: float
    gap: float
    tray_height: float
    lip_low: bool = False
    field: str = "plain"


@dataclass(frozen=True, kw_only=True)
class _Slides:
    """How the drawers of one object move.

    Attributes:
        mass: of a drawer, kilograms.
        travel: metres.
        friction: newtons.
        damping: N s/m.
    """

    mass: float
    travel: float
    friction: float
    damping: float


def _with_drawers(
    object_id: str,
    family: str,
    body: Sequence[Shape],
    drawers: Sequence[Sequence[Shape]],
    handle: str,
    slides: _Slides,
    friction: float,
) -> ArticulatedObject:
    """Puts body and drawers together."""
    links = [Link(name="body", shapes=tuple(body), density=600.0)]
    joints = []
    for i, shapes in enumerate(drawers, start=1):
        density = slides.mass / sum(s.geometry.volume for s in shapes)
        links.append(
            Link(name=f"drawer_{i}", shapes=tuple(shapes), density=density, friction=friction)
        )
        joints.append(
            Joint(
                name=f"slide_{i}",
                type="prismatic",
                parent="body",
                child=f"drawer_{i}",
                axis=(1.0, 0.0, 0.0),
                pivot=(0.0, 0.0, 0.0),
                closed=0.0,
                open=slides.travel,
                friction=slides.friction,
                damping=slides.damping,
            )
        )
    return ArticulatedObject(
        object_id=object_id,
        category="drawer",
        links=tuple(links),
        joints=tuple(joints),
        attributes={"family": family, "handle": handle, "drawers": len(drawers)},
    )


def _drawer(
    bay: _Bay, back: float, face: float, style: _Style, grip: tuple[Shape, ...]
) -> tuple[Shape, ...]:
    """Front, box and handle of one drawer.

    Args:
        bay: where it lies.
        back: x of the carcass's inner back.
        face: x of the front's face.
        style: shared by all drawers.
        grip: the handle about y = 0 and z = 0 of its anchor (``_anchor``); none for "notch".
    """
    o = style.overlay
    left, right, low, high = bay.left - o, bay.right + o, bay.low - o, bay.high + o
    inner = face - style.thickness
    if style.handle == "notch":
        fronts = _notched(inner, face, (left, right, low, high), style.front)
    else:
        fronts = _front(inner, face, (left, right, low, high), style)
    y = (left + right) / 2
    z = _anchor(style, low, high)
    # The box behind the front.
    g, w = style.gap, style.wall
    x0, y0, y1 = back + g, bay.left + g, bay.right - g
    z0 = bay.low + g
    z1 = z0 + style.tray_height * (bay.high - bay.low - 2 * g)
    tray = (
        box_between((x0, y0, z0), (inner, y1, z0 + w), style.tray),
        box_between((x0, y0, z0 + w), (inner, y0 + w, z1), style.tray),
        box_between((x0, y1 - w, z0 + w), (inner, y1, z1), style.tray),
        box_between((x0, y0 + w, z0 + w), (x0 + w, y1 - w, z1), style.tray),
    )
    return (*fronts, *tray, *(_shifted(s, y, z) for s in grip))


def _front(
    inner: float, face: float, outline: tuple[float, float, float, float], style: _Style
) -> tuple[Shape, ...]:
    """A front without a notch; what decorates it stands at most 3 mm out."""
    left, right, low, high = outline
    board = box_between((inner, left, low), (face, right, high), style.front)
    if style.field == "raised":
        corners = [
            (face + x, y, z)
            for x, m in ((0.0, 0.012), (0.003, 0.024))
            for y in (left + m, right - m)
            for z in (low + m, high - m)
        ]
        return board, convex(corners, style.front)
    if style.field == "framed":
        m, out = 0.018, face + 0.003
        return (
            board,
            box_between((face, left, low), (out, right, low + m), style.front),
            box_between((face, left, high - m), (out, right, high), style.front),
            box_between((face, left, low + m), (out, left + m, high - m), style.front),
            box_between((face, right - m, low + m), (out, right, high - m), style.front),
        )
    return (board,)


def _drawn_field(rng: np.random.Generator, handle: str, count: int) -> str:
    """The decoration of furniture's fronts; that of many drawers takes too many pieces."""
    field = str(rng.choice(("plain", "raised", "framed"), p=(0.6, 0.25, 0.15)))
    most = {"plain": 4, "raised": 3, "framed": 2}[field]
    return "plain" if handle == "edge" or count > most else field


def _anchor(style: _Style, low: float, high: float) -> float:
    """The height of a handle on a front from ``low`` to ``high``."""
    if style.handle != "edge":
        return (low + high) / 2
    return low if style.lip_low else high


def _shifted(shape: Shape, y: float, z: float) -> Shape:
    px, py, pz = shape.position
    return replace(shape, position=(px, py + y, pz + z))


def _notched(
    inner: float, face: float, outline: tuple[float, float, float, float], look: Material
) -> tuple[Shape, ...]:
    """A front whose upper edge lacks a piece in the middle; what is left of it is the handle."""
    left, right, low, high = outline
    y, half = (left + right) / 2, min(0.040, 0.36 * (right - left))
    depth = min(0.034, 0.55 * (high - low))
    middle = box_between((inner, y - half, low), (face, y + half, high - depth), look)
    return (
        box_between((inner, left, low), (face, y - half, high), look),
        box_between((inner, y + half, low), (face, right, high), look),
        *with_role("handle", (middle,)),
    )


def _lip(
    rng: np.random.Generator, face: float, length: float, below: bool, look: Material
) -> tuple[Shape, ...]:
    """A lip along a front's whole edge, about the edge's height: its upper or its lower."""
    thickness, reach = uniform(rng, (0.006, 0.012)), uniform(rng, (0.024, 0.034))
    low = 0.0 if below else -thickness
    return with_role(
        "handle",
        (box_between((face, -length / 2, low), (face + reach, length / 2, low + thickness), look),),
    )


def _grip(
    rng: np.random.Generator, style: _Style, face: float, width: float, height: float
) -> tuple[Shape, ...]:
    """A handle of furniture about the anchor of a front of this width and height."""
    look = style.grip
    if style.handle == "bar":
        if rng.random() < 0.15 and height > 0.13:
            return bar_at(rng, face, 0.0, 0.0, "z", min(height - 0.03, 0.12), look)
        longest = 0.32 if rng.random() < 0.3 else 0.16
        return bar_at(
            rng, face, 0.0, 0.0, "y", uniform(rng, (0.08, min(longest, width - 0.05))), look
        )
    if style.handle == "knob":
        return knob_at(rng, face, 0.0, 0.0, look)
    if style.handle == "cup":
        return cup_at(rng, face, 0.0, 0.0, uniform(rng, (0.058, 0.072)), look)
    if style.handle == "ledge":
        return ledge_at(rng, face, 0.0, 0.0, uniform(rng, (0.06, min(0.22, width - 0.04))), look)
    return _lip(rng, face, width, style.lip_low, style.front)


def _small_grip(
    rng: np.random.Generator, style: _Style, face: float, width: float, height: float
) -> tuple[Shape, ...]:
    """A handle of a desk-top box about the anchor of a front of this width and height."""
    look = style.grip
    if style.handle == "bar":
        upright = rng.random() < 0.3
        room = min(height - 0.012, 0.05) if upright else min(width - 0.03, 0.10)
        length = uniform(rng, (min(0.034, room), room))
        return small_bar_at(rng, face, 0.0, 0.0, "z" if upright else "y", length, look)
    if style.handle == "knob":
        return small_knob_at(rng, face, 0.0, 0.0, look)
    if style.handle == "ledge":
        return ledge_at(rng, face, 0.0, 0.0, uniform(rng, (0.024, min(0.066, 0.6 * width))), look)
    if style.handle == "edge":
        return _lip(rng, face, width, style.lip_low, style.front)
    return ()


def _stacked(
    left: float, right: float, low: float, heights: Sequence[float], rail: float
) -> tuple[_Bay, ...]:
    """Bays one above another, the first on top; ``heights`` from top to bottom."""
    bays, z = [], low
    for height in reversed(heights):
        bays.append(_Bay(left=left, right=right, low=z, high=z + height))
        z += height + rail
    return tuple(reversed(bays))


def _carcass(
    box: tuple[Interval, Interval, Interval],
    wall: float,
    bays: Sequence[_Bay],
    material: Material,
    *,
    top: bool = True,
) -> tuple[Shape, ...]:
    """A case about bays that are stacked or in a row, with rails or partitions between them.

    Args:
        box: its intervals in x, y and z; open towards +x.
        wall: thickness of its walls.
        bays: its openings, in order.
        material: how it looks.
        top: whether it has a top of its own.
    """
    (x0, x1), (y0, y1), (z0, z1) = box
    shapes = [
        box_between((x0, y0, z0), (x1, y0 + wall, z1), material),
        box_between((x0, y1 - wall, z0), (x1, y1, z1), material),
        box_between((x0, y0 + wall, z0), (x1, y1 - wall, z0 + wall), material),
        box_between((x0, y0 + wall, z0 + wall), (x0 + wall, y1 - wall, z1), material),
    ]
    if top:
        shapes.append(box_between((x0 + wall, y0 + wall, z1 - wall), (x1, y1 - wall, z1), material))
    for a, b in itertools.pairwise(bays):
        if b.high <= a.low:
            shapes.append(box_between((x0 + wall, a.left, b.high), (x1, a.right, a.low), material))
        else:
            shapes.append(box_between((x0 + wall, a.right, a.low), (x1, b.left, a.high), material))
    return tuple(shapes)


def _legs(
    rng: np.random.Generator,
    box: tuple[Interval, Interval],
    height: float,
    size: float,
    material: Material,
) -> tuple[Shape, ...]:
    """Four legs at the corners of intervals in x and y: square, round or tapered."""
    form = str(rng.choice(("square", "round", "tapered")))
    half = size / 2
    legs = []
    for x in (box[0][0] + half, box[0][1] - half):
        for y in (box[1][0] + half, box[1][1] - half):
            if form == "square":
                legs.append(
                    box_between((x - half, y - half, 0.0), (x + half, y + half, height), material)
                )
            elif form == "round":
                legs.append(cylinder_along("z", (x, y, height / 2), half, height, material))
            else:
                foot = 0.55 * half
                legs.append(
                    frustum("z", (x, y, 0.0), (foot, foot), (half, half), height, material, 10)
                )
    return tuple(legs)


def _cabinet(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A chest of 2 to 4 drawers, 0.35-0.85 m high, on a plinth, legs, castors or the floor."""
    count = int(rng.choice((2, 3, 4), p=(0.3, 0.45, 0.25)))
    base = str(rng.choice(("floor", "plinth", "legs", "castors"), p=(0.2, 0.3, 0.3, 0.2)))
    handle = str(rng.choice(("bar", "knob", "cup", "ledge", "edge"), p=(0.4, 0.2, 0.15, 0.1, 0.15)))
    inset = bool(rng.random() < 0.5)
    graduated = bool(rng.random() < 0.4)
    width, depth = uniform(rng, (0.32, 0.68)), uniform(rng, (0.32, 0.48))
    if base == "castors":
        width = uniform(rng, (0.34, 0.44))
    wall = uniform(rng, (0.014, 0.022))
    rail = uniform(rng, (0.012, 0.020)) if inset else 0.006
    ground = {
        "floor": 0.0,
        "plinth": uniform(rng, (0.03, 0.08)),
        "legs": uniform(rng, (0.06, 0.16)),
        "castors": 0.055,
    }[base]
    # Bays of 9 to 20 cm that leave the whole below 0.9 m.
    mean = uniform(rng, (0.12, 0.20 if count < 4 else 0.155))
    slope = uniform(rng, (0.10, 0.22)) if graduated else 0.0
    heights = mean * (1.0 + slope * np.linspace(-1.0, 1.0, count))
    height = ground + 2 * wall + float(heights.sum()) + (count - 1) * rail

    steel = base == "castors" and rng.random() < 0.5
    look = painted(rng) if steel or rng.random() < 0.45 else wood(rng)
    front = look if steel or rng.random() < 0.6 else painted(rng)
    grip_look = metal(rng) if rng.random() < 0.75 else painted(rng)
    x, y = depth / 2, width / 2
    bays = _stacked(-y + wall, y - wall, ground + wall, heights.tolist(), rail)
    body = [*_carcass(((-x, x), (-y, y), (ground, height)), wall, bays, look)]
    if not inset:
        # Rails would show as dark slits behind the fronts: there are none.
        body = body[:5]
    top = height
    if rng.random() < 0.5:
        slab, out = uniform(rng, (0.012, 0.028)), uniform(rng, (0.004, 0.018))
        top = height + slab
        top_look = look if rng.random() < 0.6 else darker(look, 0.7)
        body.append(box_between((-x, -y - out, height), (x + out + 0.02, y + out, top), top_look))
    body += _base(rng, base, (x, y), ground, look)

    style = _Style(
        handle=handle,
        front=front,
        tray=Material(color=(0.75, 0.68, 0.55), roughness=0.8),
        grip=grip_look,
        thickness=uniform(rng, (0.014, 0.020)),
        overlay=-0.002 if inset else 0.0015,
        wall=0.008,
        gap=0.003,
        tray_height=uniform(rng, (0.55, 0.85)),
        lip_low=bool(rng.random() < 0.3),
        field=_drawn_field(rng, handle, count),
    )
    face = x - uniform(rng, (0.0, 0.002)) if inset else x + 0.002 + style.thickness
    grip = _grip(
        rng, style, face, 2 * (y - wall + style.overlay), float(heights.min()) + 2 * style.overlay
    )
    slides = _Slides(
        mass=uniform(rng, (1.0, 3.0)),
        travel=depth * uniform(rng, (0.55, 0.85)),
        friction=uniform(rng, (1.0, 6.0)),
        damping=uniform(rng, (2.0, 10.0)),
    )
    drawers = [_drawer(bay, -x + wall, face, style, grip) for bay in bays]
    return _with_drawers(
        object_id, "cabinet", body, drawers, handle, slides, uniform(rng, (0.6, 1.0))
    )


def _base(
    rng: np.random.Generator,
    base: str,
    half: tuple[float, float],
    ground: float,
    look: Material,
) -> tuple[Shape, ...]:
    """What lies between the floor and a carcass of half extents x and y."""
    x, y = half
    if base == "plinth":
        return (
            box_between(
                (-x + 0.01, -y + 0.01, 0.0), (x - 0.03, y - 0.01, ground), darker(look, 0.6)
            ),
        )
    if base == "legs":
        leg = metal(rng) if rng.random() < 0.3 else darker(look, uniform(rng, (0.5, 1.0)))
        inset = uniform(rng, (0.0, 0.03))
        box = ((-x + inset, x - inset), (-y + inset, y - inset))
        return _legs(rng, box, ground, uniform(rng, (0.025, 0.05)), leg)
    if base == "castors":
        rubber = Material(color=(0.05, 0.05, 0.06), roughness=0.7)
        r = ground / 2 - 0.003
        places = [(sx * (x - 0.05), sy * (y - 0.04)) for sx in (-1.0, 1.0) for sy in (-1.0, 1.0)]
        wheels = [cylinder_along("y", (*place, r), r, 0.022, rubber) for place in places]
        stems = [
            cylinder_along("z", (*place, 0.75 * ground), 0.008, ground / 2, rubber)
            for place in places
        ]
        return (*wheels, *stems)
    return ()


def _desk(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A writing desk: a row of drawers below its top, or a pedestal of drawers at one side."""
    count = int(rng.integers(1, 4))
    pedestal = bool(count > 1 and rng.random() < 0.55)
    panels = bool(rng.random() < (0.7 if pedestal else 0.3))
    handle = str(rng.choice(("bar", "knob", "cup", "ledge", "edge"), p=(0.35, 0.3, 0.15, 0.1, 0.1)))
    inset = bool(pedestal or rng.random() < 0.6)
    width, depth = uniform(rng, (0.72, 0.92)), uniform(rng, (0.40, 0.52))
    height, slab = uniform(rng, (0.60, 0.76)), uniform(rng, (0.016, 0.030))
    leg_size = uniform(rng, (0.030, 0.055))
    wall = uniform(rng, (0.012, 0.018))
    out = uniform(rng, (0.0, 0.02))

    look = painted(rng) if rng.random() < 0.35 else wood(rng)
    top_look = look if rng.random() < 0.6 else wood(rng)
    leg_look = look if panels or rng.random() < 0.6 else metal(rng)
    front = look if rng.random() < 0.6 else painted(rng)
    grip_look = metal(rng) if rng.random() < 0.75 else painted(rng)
    style = _Style(
        handle=handle,
        front=front,
        tray=Material(color=(0.75, 0.68, 0.55), roughness=0.8),
        grip=grip_look,
        thickness=uniform(rng, (0.014, 0.020)),
        overlay=-0.002 if inset else 0.004,
        wall=0.008,
        gap=0.003,
        tray_height=uniform(rng, (0.6, 0.85)),
        lip_low=bool(rng.random() < 0.5),
        field=_drawn_field(rng, handle, count),
    )
    x, y = depth / 2, width / 2 - out
    under = height - slab
    # The case's front stands back, so that the top covers an overlaid front.
    case_x = x - 0.005 - (0.0 if inset else style.thickness)
    body = [box_between((-x - out, -width / 2, under), (x + out, width / 2, height), top_look)]
    if pedestal:
        case_width = uniform(rng, (0.26, 0.36))
        mean = uniform(rng, (0.12, 0.18))
        low = max(0.04, under - count * mean - 0.05) if rng.random() < 0.5 else 0.04
        high_bay = 0.10 if count == 3 else mean
        rail = wall
        room = under - low - 2 * wall - (count - 1) * rail
        # The lower drawers share what the first leaves, each at most 26 cm high.
        rest = min(0.26, (room - high_bay) / (count - 1))
        heights = [high_bay, *[rest] * (count - 1)]
        low = under - 2 * wall - (count - 1) * rail - sum(heights)
        side = 1.0 if rng.random() < 0.5 else -1.0
        y0, y1 = sorted((side * y, side * (y - case_width)))
        bays = _stacked(y0 + wall, y1 - wall, low + wall, heights, rail)
        body += _carcass(((-x, case_x), (y0, y1), (low, under)), wall, bays, look)
        other = (-y, -y + leg_size) if side > 0 else (y - leg_size, y)
        body += _support(rng, panels, (x, y), other, under, leg_size, leg_look)
        if low > 0.02:
            body += _legs(rng, ((-x, case_x), (y0, y1)), low, min(leg_size, 0.04), leg_look)
    else:
        case_height = uniform(rng, (0.10, 0.15))
        low = under - case_height
        y_in = y - leg_size
        total = 2 * y_in if count > 1 or rng.random() < 0.6 else uniform(rng, (0.32, 0.5))
        y0, y1 = -total / 2, total / 2
        each = (total - (count + 1) * wall) / count
        bays = tuple(
            _Bay(
                left=y0 + wall + i * (each + wall),
                right=y0 + wall + i * (each + wall) + each,
                low=low + wall,
                high=under - wall,
            )
            for i in range(count)
        )
        body += _carcass(((-x + 0.01, case_x), (y0, y1), (low, under)), wall, bays, look)
        for edge in ((-y, -y + leg_size), (y - leg_size, y)):
            body += _support(rng, panels, (x, y), edge, under, leg_size, leg_look)
        if total < 2 * y_in:
            # An apron behind a single narrow drawer ties the legs together.
            body.append(
                box_between((-x + 0.005, -y_in, under - 0.07), (-x + 0.02, y_in, under), look)
            )
    face = case_x - 0.001 if inset else case_x + 0.002 + style.thickness
    bay = min(bays, key=lambda b: b.high - b.low)
    grip = _grip(
        rng,
        style,
        face,
        bay.right - bay.left + 2 * style.overlay,
        bay.high - bay.low + 2 * style.overlay,
    )
    slides = _Slides(
        mass=uniform(rng, (0.8, 2.4)),
        travel=depth * uniform(rng, (0.55, 0.80)),
        friction=uniform(rng, (1.0, 6.0)),
        damping=uniform(rng, (2.0, 10.0)),
    )
    back = (-x if pedestal else -x + 0.01) + wall
    drawers = [_drawer(b, back, face, style, grip) for b in bays]
    return _with_drawers(object_id, "desk", body, drawers, handle, slides, uniform(rng, (0.6, 1.0)))


def _support(
    rng: np.random.Generator,
    panel: bool,
    half: tuple[float, float],
    y: Interval,
    height: float,
    size: float,
    look: Material,
) -> tuple[Shape, ...]:
    """One side of a desk: a panel, or a pair of legs, within an interval of y."""
    x = half[0]
    if panel:
        middle = (y[0] + y[1]) / 2
        thick = 0.5 * size
        return (box_between((-x, middle - thick / 2, 0.0), (x, middle + thick / 2, height), look),)
    return tuple(
        box_between((low, y[0], 0.0), (low + size, y[1], height), look) for low in (-x, x - size)
    )


def _organiser(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A box for a desk's top, 7-36 cm wide, 6-31 cm deep, 6-27 cm high."""
    count = int(rng.choice((1, 2, 3), p=(0.4, 0.2, 0.4)))
    handle = str(
        rng.choice(("knob", "bar", "ledge", "edge", "notch"), p=(0.25, 0.2, 0.2, 0.2, 0.15))
    )
    kind = str(rng.choice(("plastic", "wood", "metal"), p=(0.55, 0.3, 0.15)))
    inset = bool(rng.random() < 0.7)
    width = uniform(rng, (0.070, 0.24)) if count > 1 else uniform(rng, (0.070, 0.36))
    depth = uniform(rng, (0.065, 0.31))
    bay = uniform(rng, (0.039, 0.077)) if count > 1 else uniform(rng, (0.057, 0.095))
    if handle == "notch":
        # A finger must fit through it, and the hand in front of it.
        width, bay = max(width, 0.11), max(bay, 0.05)
    wall = uniform(rng, (0.002, 0.005)) if kind != "wood" else uniform(rng, (0.005, 0.009))
    feet = uniform(rng, (0.001, 0.006))
    height = feet + 2 * wall + count * bay + (count - 1) * wall

    look = {"plastic": painted, "wood": wood, "metal": metal}[kind](rng)
    front = look if rng.random() < 0.45 else painted(rng)
    tray = front if kind == "plastic" else Material(color=(0.75, 0.68, 0.55), roughness=0.8)
    grip_look = metal(rng) if rng.random() < 0.4 else painted(rng)
    x, y = depth / 2, width / 2
    bays = _stacked(-y + wall, y - wall, feet + wall, [bay] * count, wall)
    body = [
        *_carcass(((-x, x), (-y, y), (feet, height)), wall, bays, look),
        box_between((-0.85 * x, -0.85 * y, 0.0), (0.85 * x, 0.85 * y, feet), darker(look, 0.4)),
    ]
    if rng.random() < 0.3:
        body.append(_top_rim(rng, (x, y), height, darker(look, 0.8)))
    style = _Style(
        handle=handle,
        front=front,
        tray=tray,
        grip=grip_look,
        thickness=uniform(rng, (0.003, 0.006)) if kind != "wood" else uniform(rng, (0.006, 0.010)),
        overlay=-0.0015 if inset else min(wall, 0.005) / 2 - 0.001,
        wall=0.002 if kind != "wood" else 0.004,
        gap=0.0015,
        tray_height=uniform(rng, (0.6, 0.95)),
    )
    face = x if inset else x + 0.0015 + style.thickness
    grip = _small_grip(rng, style, face, width - 2 * (wall - style.overlay), bay)
    slides = _Slides(
        mass=uniform(rng, (0.08, 0.35)),
        travel=depth * uniform(rng, (0.55, 0.85)),
        friction=uniform(rng, (0.3, 1.5)),
        damping=uniform(rng, (0.5, 3.0)),
    )
    drawers = [_drawer(b, -x + wall, face, style, grip) for b in bays]
    if handle not in ("bar", "notch") and width > 0.12 and rng.random() < 0.35:
        drawers = [
            (*drawer, _label(b, face, handle)) for drawer, b in zip(drawers, bays, strict=True)
        ]
    return _with_drawers(
        object_id, "organiser", body, drawers, handle, slides, uniform(rng, (0.5, 0.9))
    )


def _label(bay: _Bay, face: float, handle: str) -> Shape:
    """A slip of paper on a front: in its middle under a lip, in its left half beside a handle."""
    width, height = bay.right - bay.left, bay.high - bay.low
    y = (bay.left + bay.right) / 2 - (0.0 if handle == "edge" else 0.29 * width)
    z, half = (bay.low + bay.high) / 2, min(0.14 * width, 0.025)
    return box_between(
        (face, y - half, z - 0.16 * height),
        (face + 0.0008, y + half, z + 0.16 * height),
        Material(color=(0.85, 0.84, 0.78), roughness=0.9),
    )


def _top_rim(
    rng: np.random.Generator, half: tuple[float, float], height: float, look: Material
) -> Shape:
    """A tray's raised back on top of a box."""
    x, y = half
    return box_between(
        (-x, -y, height), (-x + 0.004, y, height + uniform(rng, (0.006, 0.015))), look
    )


_FORM_MAKERS: dict[str, Callable[[str, np.random.Generator], ArticulatedObject]] = {
    "cabinet": _cabinet,
    "desk": _desk,
    "organiser": _organiser,
}
