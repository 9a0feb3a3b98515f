"""What appliances and cabinets are made of: hollow bodies, doors, hinges, grips, controls, racks.

Everything is in the object's frame, metres: the front faces +x, seen from there +y is on the right.
A rectangle of the front is ``(y_low, z_low, y_high, z_high)``. ``face`` is the x of the surface on
which a detail sits; details stand out of it or lie on it, and so never flicker against it.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from artgym.objects.model import Joint, Link, Material, Shape, Vector
from artgym.objects.procedural.shapes import (
    box_between,
    cylinder_along,
    darker,
    prism,
    turned,
    uniform,
    with_role,
    with_texture,
)

#: A rectangle of the front: y_low, z_low, y_high, z_high.
Rectangle = tuple[float, float, float, float]
#: How a bar is made: round or square on posts, or flat and bent back at its ends.
BarForm = Literal["round", "square", "strap"]

_GRAVITY = 9.81
#: How far flat details stand out of what they lie on, metres.
_PROUD = 0.001
#: How far above the ground a drop-down door stays, metres.
_GROUND_GAP = 0.004

BLACK = Material(color=(0.02, 0.02, 0.022), roughness=0.5)
RUBBER = Material(color=(0.04, 0.04, 0.04), roughness=0.9)
GLASS = Material(color=(0.015, 0.018, 0.022), roughness=0.08)
CHROME = Material(color=(0.62, 0.63, 0.64), roughness=0.2, metallic=0.9)
STEEL = Material(color=(0.42, 0.43, 0.44), roughness=0.35, metallic=0.7)


# -- bodies ------------------------------------------------------------------------------------


def hollow_body(
    low: Vector,
    high: Vector,
    opening: Rectangle,
    back: float,
    shell: Material,
    lining: Material | None = None,
    lining_thickness: float = 0.004,
    radius: float = 0.0,
) -> tuple[Shape, ...]:
    """Five walls around a room that is open to +x: 5 boxes, 10 with a lining.

    Args:
        low: the whole's least corner.
        high: its greatest corner.
        opening: the mouth of the room; the room keeps this cross-section all the way.
        back: x of the room's back wall.
        shell: how it looks from outside.
        lining: how the room looks; the shell's look by default.
        lining_thickness: of the lining; it must be less than each wall.
        radius: of the four long outer edges, at most the thinnest wall; 0 for sharp ones.
    """
    y_low, z_low, y_high, z_high = opening
    shapes: list[Shape] = []
    if lining is not None:
        t = lining_thickness
        shapes += [
            box_between((back, y_low - t, z_low), (high[0], y_low, z_high), lining),
            box_between((back, y_high, z_low), (high[0], y_high + t, z_high), lining),
            box_between((back, y_low - t, z_low - t), (high[0], y_high + t, z_low), lining),
            box_between((back, y_low - t, z_high), (high[0], y_high + t, z_high + t), lining),
            box_between((back - t, y_low - t, z_low - t), (back, y_high + t, z_high + t), lining),
        ]
        y_low, z_low, y_high, z_high = y_low - t, z_low - t, y_high + t, z_high + t
        back -= t
    r = radius
    side_low, side_high = (low[2] + r, high[2] - r) if r > 0 else (low[2], high[2])
    flat_low, flat_high = (low[1] + r, high[1] - r) if r > 0 else (y_low, y_high)
    shapes += [
        box_between((low[0], low[1], side_low), (high[0], y_low, side_high), shell),
        box_between((low[0], y_high, side_low), (high[0], high[1], side_high), shell),
        box_between((low[0], flat_low, low[2]), (high[0], flat_high, z_low), shell),
        box_between((low[0], flat_low, z_high), (high[0], flat_high, high[2]), shell),
        box_between((low[0], y_low, z_low), (back, y_high, z_high), shell),
    ]
    if r > 0:
        for y, z, start in (
            (low[1] + r, low[2] + r, np.pi),
            (high[1] - r, low[2] + r, 1.5 * np.pi),
            (high[1] - r, high[2] - r, 0.0),
            (low[1] + r, high[2] - r, 0.5 * np.pi),
        ):
            arc = _arc(y, z, r, start, 6)
            shapes.append(prism([(y, z), *arc], "x", low[0], high[0], shell))
    return tuple(shapes)


def rounded_slab(
    low: Vector, high: Vector, radius: float, axis: Literal["x", "z"], material: Material
) -> Shape:
    """A cuboid whose edges along "x" (all four) or along "z" (the front two) are rounded."""
    r = radius
    if axis == "x":
        outline = [
            *_arc(high[1] - r, high[2] - r, r, 0.0, 7),
            *_arc(low[1] + r, high[2] - r, r, 0.5 * np.pi, 7),
            *_arc(low[1] + r, low[2] + r, r, np.pi, 7),
            *_arc(high[1] - r, low[2] + r, r, 1.5 * np.pi, 7),
        ]
        return prism(outline, "x", low[0], high[0], material)
    outline = [
        (low[0], low[1]),
        *_arc(high[0] - r, low[1] + r, r, 1.5 * np.pi, 8),
        *_arc(high[0] - r, high[1] - r, r, 0.0, 8),
        (low[0], high[1]),
    ]
    return prism(outline, "z", low[2], high[2], material)


def _arc(
    u: float, v: float, radius: float, start: float, count: int
) -> tuple[tuple[float, float], ...]:
    """A quarter circle, counter-clockwise from ``start`` radians."""
    angles = start + np.linspace(0.0, 0.5 * np.pi, count)
    return tuple((u + radius * float(np.cos(a)), v + radius * float(np.sin(a))) for a in angles)


def feet(low: Vector, high: Vector, material: Material = RUBBER) -> tuple[Shape, ...]:
    """Four round feet from the ground to ``low[2]``, near the corners of a footprint."""
    inset = 0.1 * (high[1] - low[1])
    radius = min(0.022, 0.35 * inset)
    return tuple(
        cylinder_along("z", (x, y, low[2] / 2), radius, low[2], material)
        for x in (low[0] + inset, high[0] - inset)
        for y in (low[1] + inset, high[1] - inset)
    )


def plinth(low: Vector, high: Vector, setback: float, material: Material = BLACK) -> Shape:
    """A base from the ground to ``low[2]``, set back behind the front."""
    return box_between((low[0], low[1], 0.0), (high[0] - setback, high[1], low[2]), material)


# -- doors -------------------------------------------------------------------------------------


def door_panel(
    low: Vector,
    high: Vector,
    material: Material,
    window: Rectangle | None = None,
    glass: Material = GLASS,
    recess: float = 0.004,
) -> tuple[Shape, ...]:
    """A slab, or four boards around a pane that lies ``recess`` behind both faces."""
    if window is None:
        return (box_between(low, high, material),)
    y_low, z_low, y_high, z_high = window
    return (
        box_between(low, (high[0], high[1], z_low), material),
        box_between((low[0], low[1], z_high), high, material),
        box_between((low[0], low[1], z_low), (high[0], y_low, z_high), material),
        box_between((low[0], y_high, z_low), (high[0], high[1], z_high), material),
        box_between((low[0] + recess, y_low, z_low), (high[0] - recess, y_high, z_high), glass),
    )


def gravity_torque(link: Link, axis: Vector, pivot: Vector) -> float:
    """The most that a link's weight turns it about a horizontal axis, N m."""
    arm = link.center_of_mass - np.asarray(pivot)
    direction = np.asarray(axis, dtype=float)
    return _GRAVITY * link.mass * float(np.linalg.norm(arm - arm @ direction * direction))


def drop_hinge(
    rng: np.random.Generator,
    name: str,
    parent: str,
    door: Link,
    pivot: Vector,
    angles_deg: tuple[float, float],
) -> Joint:
    """A hinge at the lower front edge: the door comes down to the front and stays anywhere.

    Its range, drawn from ``angles_deg``, ends before the door or its grip meets the ground.
    """
    axis = (0.0, 1.0, 0.0)
    torque = gravity_torque(door, axis, pivot)
    angle = min(uniform(rng, angles_deg), _lowest_drop_deg(door, pivot))
    return Joint(
        name=name,
        type="revolute",
        parent=parent,
        child=door.name,
        axis=axis,
        pivot=pivot,
        closed=0.0,
        open=float(np.radians(angle)),
        friction=torque * uniform(rng, (1.3, 1.5)),
        damping=torque * uniform(rng, (0.05, 0.15)),
    )


def _lowest_drop_deg(door: Link, pivot: Vector) -> float:
    """The angle to which a drop-down door can turn and stay ``_GROUND_GAP`` above the ground."""
    corners = np.concatenate([shape.corners_link() for shape in door.shapes]) - np.asarray(pivot)
    angles_deg = np.arange(1.0, 120.0, 0.5)
    angles = np.radians(angles_deg)[:, None]
    heights = pivot[2] + corners[:, 2] * np.cos(angles) - corners[:, 0] * np.sin(angles)
    # Where it starts out lower, at its own foot, it may stay so.
    floor = min(_GROUND_GAP, float(heights[0].min()))
    low = heights.min(axis=1) < floor - 1e-9
    return float(angles_deg[int(np.argmax(low)) - 1]) if low.any() else float(angles_deg[-1])


def side_hinge(
    rng: np.random.Generator,
    name: str,
    parent: str,
    door: Link,
    pivot: Vector,
    side: Literal["left", "right"],
    angles_deg: tuple[float, float] = (95.0, 120.0),
    grip_force: tuple[float, float] = (1.5, 6.0),
) -> Joint:
    """An upright hinge on the side as seen from the front; "left" is -y.

    Args:
        rng: draws range, friction and damping.
        name: of the joint.
        parent: the link that carries the door.
        door: what turns; its extent across the hinge is the lever of a hand.
        pivot: a point of the axis.
        side: where the hinge is; the free edge is on the other.
        angles_deg: interval of the range.
        grip_force: interval of the force, newtons, that turns the door at its free edge.
    """
    low, high = door.bounds()
    lever = float(high[1] - pivot[1] if side == "left" else pivot[1] - low[1])
    # A door that is let go of comes to rest within a fraction of a second.
    inertia = door.mass * lever**2 / 3
    return Joint(
        name=name,
        type="revolute",
        parent=parent,
        child=door.name,
        axis=(0.0, 0.0, -1.0 if side == "left" else 1.0),
        pivot=pivot,
        closed=0.0,
        open=float(np.radians(uniform(rng, angles_deg))),
        friction=lever * uniform(rng, grip_force),
        damping=inertia * uniform(rng, (1.5, 3.0)),
    )


# -- grips -------------------------------------------------------------------------------------


def pull_bar(
    face: float,
    y: float,
    z: float,
    along: Literal["y", "z"],
    length: float,
    look: Material,
    *,
    thickness: float = 0.014,
    clearance: float = 0.034,
    form: BarForm = "round",
) -> tuple[Shape, ...]:
    """A bar before a front, marked as a handle: 3 shapes.

    Args:
        face: x of the front.
        y: of the bar's middle.
        z: of the bar's middle.
        along: its direction.
        length: from end to end.
        look: how it looks.
        thickness: from its front to its back; a strap is twice as wide.
        clearance: between bar and front; fingers need 24 mm.
        form: "round" and "square" bars stand on posts, a "strap" is bent back at its ends.
    """
    half = {"round": 0.5, "square": 0.5, "strap": 1.0}[form] * thickness
    near, far = face + clearance, face + clearance + thickness

    def block(x_low: float, x_high: float, start: float, end: float, width: float) -> Shape:
        if along == "y":
            corners = (x_low, y + start, z - width), (x_high, y + end, z + width)
        else:
            corners = (x_low, y - width, z + start), (x_high, y + width, z + end)
        return box_between(*corners, look)

    reach = length / 2
    if form == "round":
        middle = (face + clearance + thickness / 2, y, z)
        bar = cylinder_along(along, middle, thickness / 2, length, look)
        inset = reach - 1.5 * thickness
        posts = [
            cylinder_along(
                "x",
                (
                    face + (near - face + thickness / 2) / 2,
                    y + (side * inset if along == "y" else 0.0),
                    z + (side * inset if along == "z" else 0.0),
                ),
                0.38 * thickness,
                near - face + thickness / 2,
                look,
            )
            for side in (-1.0, 1.0)
        ]
    elif form == "square":
        bar = block(near, far, -reach, reach, half)
        inset, post = reach - 1.5 * thickness, 0.4 * thickness
        posts = [
            block(face, near, side * inset - post, side * inset + post, post)
            for side in (-1.0, 1.0)
        ]
    else:
        bar = block(near, far, -reach, reach, half)
        posts = [
            block(face, near, -reach, -reach + thickness, half),
            block(face, near, reach - thickness, reach, half),
        ]
    return with_role("handle", (bar, *posts))


def bar_form(rng: np.random.Generator, handle: str) -> BarForm:
    """The form of a handle named "bar", which is drawn, or "strap"."""
    if handle == "strap":
        return "strap"
    return "round" if rng.random() < 0.6 else "square"


def lip(
    face: float,
    y: float,
    z: float,
    along: Literal["y", "z"],
    length: float,
    look: Material,
    *,
    thickness: float = 0.010,
    reach: float = 0.034,
) -> tuple[Shape, ...]:
    """A blade that stands out of a front, tapering, marked as a handle: 1 shape.

    Args:
        face: x of the front.
        y: of the blade's middle.
        z: of the blade's middle.
        along: its direction.
        length: from end to end.
        look: how it looks.
        thickness: across the blade.
        reach: how far it stands out.
    """
    t = thickness / 2
    if along == "y":
        outline = [(face, z - t), (face + reach, z - 0.7 * t), (face + reach, z + t), (face, z + t)]
        blade = prism(outline, "y", y - length / 2, y + length / 2, look)
    else:
        outline = [(face, y - t), (face + reach, y - 0.8 * t), (face + reach, y + 0.8 * t)]
        blade = prism([*outline, (face, y + t)], "z", z - length / 2, z + length / 2, look)
    return with_role("handle", (blade,))


def latch(
    face: float,
    y: float,
    z: float,
    length: float,
    side: Literal["left", "right"],
    look: Material,
    *,
    thickness: float = 0.016,
    clearance: float = 0.030,
) -> tuple[Shape, ...]:
    """A lever across the front on one thick post, as on old refrigerators: a handle of 3 shapes.

    Args:
        face: x of the front.
        y: of the lever's middle.
        z: of the lever's middle.
        length: from end to end.
        side: towards which the free end points.
        look: how it looks.
        thickness: of the lever at its free end.
        clearance: between lever and front.
    """
    sign = 1.0 if side == "right" else -1.0
    root, tip = y - sign * length / 2, y + sign * length / 2
    post = root + sign * 1.2 * thickness
    near = face + clearance
    lever = prism(
        [
            (root, z - 0.9 * thickness),
            (tip, z - 0.4 * thickness),
            (tip, z + 0.4 * thickness),
            (root, z + 0.9 * thickness),
        ],
        "x",
        near,
        near + 0.8 * thickness,
        look,
    )
    stem = box_between(
        (face, post - 0.9 * thickness, z - 0.7 * thickness),
        (near, post + 0.9 * thickness, z + 0.7 * thickness),
        look,
    )
    plate = box_between(
        (face, post - 1.6 * thickness, z - 2.2 * thickness),
        (face + 0.004, post + 1.6 * thickness, z + 2.2 * thickness),
        look,
    )
    return with_role("handle", (lever, stem, plate))


# -- controls ----------------------------------------------------------------------------------


def control_knob(
    face: float,
    y: float,
    z: float,
    radius: float,
    material: Material,
    *,
    angle: float = 0.0,
    depth: float = 0.018,
    skirt: Material | None = None,
) -> tuple[Shape, ...]:
    """A turning knob with a pointer at ``angle`` radians from upright: 2 shapes, 3 with a skirt."""
    pointer = box_between(
        (face + depth, y - 0.08 * radius, z + 0.25 * radius),
        (face + depth + _PROUD, y + 0.08 * radius, z + 0.92 * radius),
        Material(color=(0.85, 0.85, 0.83)) if sum(material.color) < 1.2 else BLACK,
    )
    shapes = [
        cylinder_along("x", (face + depth / 2, y, z), radius, depth, material),
        turned(pointer, (1.0, 0.0, 0.0), (face, y, z), angle),
    ]
    if skirt is not None:
        shapes.append(cylinder_along("x", (face + 0.002, y, z), 1.25 * radius, 0.004, skirt))
    return tuple(shapes)


def display(face: float, area: Rectangle, color: Vector, digits: int = 4) -> tuple[Shape, ...]:
    """A dark pane with a row of lit digits: 1 + digits shapes."""
    y_low, z_low, y_high, z_high = area
    lit = Material(color=color, roughness=0.3)
    pane = box_between((face, y_low, z_low), (face + _PROUD, y_high, z_high), GLASS)
    pitch = 0.7 * (y_high - y_low) / max(digits, 1)
    start = (y_low + y_high - pitch * digits) / 2
    height = 0.25 * (z_high - z_low)
    middle = (z_low + z_high) / 2
    return (
        pane,
        *(
            box_between(
                (face + _PROUD, start + (i + 0.2) * pitch, middle - height),
                (face + 1.5 * _PROUD, start + (i + 0.8) * pitch, middle + height),
                lit,
            )
            for i in range(digits)
        ),
    )


def button_grid(
    face: float, area: Rectangle, rows: int, columns: int, material: Material
) -> tuple[Shape, ...]:
    """Flat keys, rows x columns shapes."""
    y_low, z_low, y_high, z_high = area
    pitch_y, pitch_z = (y_high - y_low) / columns, (z_high - z_low) / rows
    return tuple(
        box_between(
            (face, y_low + (c + 0.12) * pitch_y, z_low + (r + 0.15) * pitch_z),
            (face + 2 * _PROUD, y_low + (c + 0.88) * pitch_y, z_low + (r + 0.85) * pitch_z),
            material,
        )
        for r in range(rows)
        for c in range(columns)
    )


def badge(face: float, y: float, z: float, width: float, material: Material = CHROME) -> Shape:
    """A maker's plate."""
    return box_between(
        (face, y - width / 2, z - width / 9),
        (face + 1.5 * _PROUD, y + width / 2, z + width / 9),
        material,
    )


def groove(face: float, area: Rectangle) -> Shape:
    """A dark line or field on a front, such as the joint around a panel that does not move."""
    y_low, z_low, y_high, z_high = area
    return box_between((face, y_low, z_low), (face + 0.5 * _PROUD, y_high, z_high), BLACK)


# -- what is inside ----------------------------------------------------------------------------


def wire_rack(
    low: tuple[float, float],
    high: tuple[float, float],
    z: float,
    rods: int,
    material: Material = CHROME,
    thickness: float = 0.005,
) -> tuple[Shape, ...]:
    """A flat grid between two corners (x, y) at height z: two rails and rods from front to back."""
    t = thickness
    rails = [
        box_between((x, low[1], z), (x + t, high[1], z + t), material)
        for x in (low[0], high[0] - t)
    ]
    places = np.linspace(low[1], high[1] - t, rods)
    bars = [
        box_between((low[0] + t, float(y), z), (high[0] - t, float(y) + t, z + t), material)
        for y in places
    ]
    return (*rails, *bars)


# -- looks -------------------------------------------------------------------------------------


def finish(rng: np.random.Generator) -> Material:
    """Enamel or steel of a household appliance: white, cream, grey, black, stainless, a colour."""
    kind = rng.choice(("white", "steel", "black", "grey", "color"), p=(0.34, 0.3, 0.14, 0.1, 0.12))
    if kind == "white":
        v, warmth = uniform(rng, (0.72, 0.92)), uniform(rng, (0.86, 1.0))
        return Material(color=(v, v * (0.5 + 0.5 * warmth), v * warmth), roughness=0.35)
    if kind == "steel":
        v = uniform(rng, (0.3, 0.55))
        steel = Material(
            color=(v, v * 1.01, v * 1.02),
            roughness=uniform(rng, (0.3, 0.45)),
            metallic=uniform(rng, (0.5, 0.8)),
        )
        brushed = rng.random() < 0.6
        return with_texture(steel, "brushed", 0.2, int(rng.integers(12))) if brushed else steel
    if kind == "black":
        v = uniform(rng, (0.015, 0.05))
        return Material(color=(v, v, v * 1.05), roughness=uniform(rng, (0.2, 0.5)))
    if kind == "grey":
        v = uniform(rng, (0.15, 0.45))
        return Material(color=(v, v, v * 1.03), roughness=0.45)
    return enamel(rng)


def enamel(rng: np.random.Generator) -> Material:
    """The colours of the fifties: mint, cream, red, pale blue, pink, butter."""
    colors: tuple[Vector, ...] = (
        (0.42, 0.70, 0.58),
        (0.86, 0.78, 0.58),
        (0.55, 0.03, 0.03),
        (0.35, 0.58, 0.72),
        (0.85, 0.45, 0.45),
        (0.88, 0.68, 0.25),
        (0.05, 0.12, 0.30),
        (0.06, 0.22, 0.12),
    )
    r, g, b = colors[int(rng.integers(len(colors)))]
    shade = uniform(rng, (0.8, 1.05))
    return Material(
        color=(min(r * shade, 0.95), min(g * shade, 0.95), min(b * shade, 0.95)),
        roughness=uniform(rng, (0.2, 0.4)),
    )


def trim(rng: np.random.Generator, shell: Material) -> Material:
    """What handles and strips are made of: bright metal, dark plastic, or the shell, shaded."""
    kind = rng.choice(("chrome", "steel", "black", "shell"), p=(0.35, 0.3, 0.2, 0.15))
    value = sum(shell.color) / 3
    if kind == "steel" and 0.25 < value < 0.6:
        kind = "black"
    elif kind in ("black", "shell") and value < 0.1:
        kind = "chrome"
    if kind == "shell":
        return darker(shell, uniform(rng, (0.5, 0.8)))
    return {"chrome": CHROME, "steel": STEEL, "black": BLACK}[str(kind)]
