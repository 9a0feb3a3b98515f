"""Drawers: a cabinet on a table with one drawer, prismatic along +x.

Families: "chest" (closed below the drawer), "nightstand" (open below, on side walls), "desktop"
(the drawer fills the height). Handles: "bar" (lying or upright), "knob", "ledge".
"""

from __future__ import annotations

import numpy as np

from artgym.objects.model import ArticulatedObject, Joint, Link, Material, Shape
from artgym.objects.procedural.shapes import (
    box_between,
    cylinder_along,
    darker,
    metal,
    painted,
    uniform,
    wood,
)

FAMILIES = ("chest", "nightstand", "desktop")
HANDLES = ("bar", "knob", "ledge")


def make_drawer(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A drawer of 0.2-0.45 m a side; the opening range is 55-85 % of its depth."""
    family = str(rng.choice(FAMILIES))
    handle = str(rng.choice(HANDLES, p=(0.5, 0.25, 0.25)))
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
    grip = _HANDLE_MAKERS[handle](
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
                name="drawer",
                shapes=(front, *tray, *grip),
                density=mass / drawer_volume,
                friction=uniform(rng, (0.6, 1.0)),
            ),
        ),
        joints=(
            Joint(
                name="slide",
                type="prismatic",
                parent="body",
                child="drawer",
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


def _bar(
    rng: np.random.Generator, face: float, width: float, z: float, height: float, look: Material
) -> tuple[Shape, ...]:
    """A bar on two posts."""
    upright = rng.random() < 0.3
    room = height - 0.03 if upright else width - 0.05
    length = min(uniform(rng, (0.07, 0.18)), room)
    thickness = uniform(rng, (0.008, 0.014))
    # At least 24 mm from the front's face to the bar's far side leave room for fingertips.
    center = face + uniform(rng, (0.024, 0.036)) + thickness / 2
    y = 0.0 if upright else uniform(rng, (-0.2, 0.2)) * (width - length)
    along = np.array([0.0, 0.0, 1.0] if upright else [0.0, 1.0, 0.0])
    middle = np.array([center, y, z])
    if rng.random() < 0.5:
        bar = cylinder_along("z" if upright else "y", middle, thickness / 2, length, look)
    else:
        half = np.full(3, thickness / 2) + along * (length - thickness) / 2
        bar = box_between(tuple(middle - half), tuple(middle + half), look)
    posts = []
    for side in (-1.0, 1.0):
        foot = middle + along * side * (length / 2 - thickness)
        reach = center - face
        posts.append(
            cylinder_along("x", (face + reach / 2, foot[1], foot[2]), 0.4 * thickness, reach, look)
        )
    return (bar, *posts)


def _knob(
    rng: np.random.Generator, face: float, width: float, z: float, height: float, look: Material
) -> tuple[Shape, ...]:
    """A disc or a block on a stem."""
    stem, head = uniform(rng, (0.016, 0.026)), uniform(rng, (0.010, 0.018))
    radius = uniform(rng, (0.011, 0.020))
    y = uniform(rng, (-0.15, 0.15)) * width
    stem_shape = cylinder_along("x", (face + stem / 2, y, z), 0.5 * radius, stem, look)
    if rng.random() < 0.6:
        head_shape = cylinder_along("x", (face + stem + head / 2, y, z), radius, head, look)
    else:
        r = 0.85 * radius
        head_shape = box_between(
            (face + stem, y - r, z - r), (face + stem + head, y + r, z + r), look
        )
    return (head_shape, stem_shape)


def _ledge(
    rng: np.random.Generator, face: float, width: float, z: float, height: float, look: Material
) -> tuple[Shape, ...]:
    """A plate that stands out of the front, at the middle or above it."""
    length = min(uniform(rng, (0.08, 0.25)), width - 0.02)
    thickness, reach = uniform(rng, (0.006, 0.012)), uniform(rng, (0.026, 0.040))
    z = z + uniform(rng, (0.0, 0.3)) * height
    return (
        box_between(
            (face, -length / 2, z - thickness / 2),
            (face + reach, length / 2, z + thickness / 2),
            look,
        ),
    )


_HANDLE_MAKERS = {"bar": _bar, "knob": _knob, "ledge": _ledge}
