"""Scissors: two halves that cross at a screw; half_1 is held by a stand, half_2 turns about it.

Laid out flat: blades along +x, the screw at the origin, thickness along z. Half_1 lies in the lower
layer with its ring towards -y, half_2 in the upper one with its ring towards +y (or mirrored);
half_2's ring swings outwards about the z axis. The rings are as thick as both layers.

Families: "office" (moulded rings, often one longer than the other), "kitchen" (large rings, stout
blades), "child" (small round rings, blunt tips), "tailor" (long blades, large bows), "steel" (all
of one metal, thin rings). Held "flat", "leaning" or "upright". Handle: "ring".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.objects.model import ArticulatedObject, Joint, Link, Material, Shape
from artgym.objects.procedural.shapes import (
    box_between,
    cylinder_along,
    darker,
    metal,
    painted,
    prism,
    turned,
    uniform,
    with_role,
)
from artgym.objects.procedural.stands import Mount, stand

Array = NDArray[np.floating]

FAMILIES = ("office", "kitchen", "child", "tailor", "steel")
HANDLES = ("ring",)
HELD = ("flat", "leaning", "upright")

_LENGTH = {
    "office": (0.125, 0.185),
    "kitchen": (0.165, 0.215),
    "child": (0.115, 0.140),
    "tailor": (0.170, 0.215),
    "steel": (0.120, 0.180),
}
#: The blades' share of the length, from the screw to the tip.
_BLADE_SHARE = {
    "office": (0.50, 0.58),
    "kitchen": (0.46, 0.53),
    "child": (0.44, 0.50),
    "tailor": (0.53, 0.60),
    "steel": (0.48, 0.58),
}
#: Width of a ring over all, and length over width.
_RING_WIDTH = {
    "office": (0.024, 0.036),
    "kitchen": (0.032, 0.047),
    "child": (0.024, 0.032),
    "tailor": (0.030, 0.044),
    "steel": (0.024, 0.034),
}
_RING_ASPECT = {
    "office": (1.1, 1.7),
    "kitchen": (1.4, 1.9),
    "child": (1.0, 1.25),
    "tailor": (1.2, 1.8),
    "steel": (1.05, 1.5),
}
_THICKNESS = {
    "office": (0.0085, 0.0150),
    "kitchen": (0.0100, 0.0205),
    "child": (0.0080, 0.0130),
    "tailor": (0.0105, 0.0205),
    "steel": (0.0078, 0.0110),
}
#: Half the gap between the two layers.
_SLIT = 0.0003
_RING_PIECES = 10


@dataclass(frozen=True, kw_only=True)
class _Form:
    """Sizes that both halves share, metres.

    Attributes:
        blade: from the screw to the tip.
        handle: from the screw to the rings' far end.
        blade_width: at the screw.
        overlap: how far a blade's edge reaches beyond the middle line.
        sheet: thickness of a blade.
        thickness: of a ring.
        rise: how far the rings stand away from the middle layer, half_2's up, half_1's down.
        tip: width of the blunt tip.
    """

    blade: float
    handle: float
    blade_width: float
    overlap: float
    sheet: float
    thickness: float
    rise: float
    tip: float


@dataclass(frozen=True, kw_only=True)
class _Ring:
    """An oval of which one end lies at the screw's side; metres, radians."""

    width: float
    length: float
    bar: float
    squareness: float
    splay: float


def make_scissors(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """Scissors 0.115-0.215 m long that open by 50-90 degrees."""
    family = str(rng.choice(FAMILIES))
    held = str(rng.choice(HELD))
    # Left-handed scissors are the mirror image: ``side`` is where half_2's ring lies.
    side = -1.0 if rng.random() < 0.3 else 1.0
    form = _draw_form(rng, family)
    ring_1, ring_2 = _draw_rings(rng, family, form)
    blade_look = _blade_look(rng)
    grip_1, grip_2 = _grip_looks(rng, family, blade_look)
    half_1 = (
        *_half(form, ring_1, -side, -1.0, blade_look, grip_1),
        *_screw(rng, form, blade_look),
    )
    half_2 = _half(form, ring_2, side, 1.0, blade_look, grip_2)

    R_object_layout, low = _attitude(rng, held)
    mount = Mount.over_origin((*half_1, *half_2), R_object_layout, low)
    held_at = (
        uniform(rng, (0.10, 0.25)) * form.blade,
        0.3 * side * form.blade_width,
        -form.sheet - _SLIT,
    )
    holder = stand(rng, mount.point(held_at), mount.direction((0.0, 0.0, -1.0)), 0.0035)

    mass = uniform(rng, (0.02, 0.06))
    moving = Link(
        name="half_2",
        shapes=mount.shapes(half_2),
        density=mass / sum(s.geometry.volume for s in half_2),
        friction=uniform(rng, (0.6, 1.0)),
    )
    pivot = mount.point((0.0, 0.0, 0.0))
    gravity_torque = mass * 9.81 * float(np.linalg.norm(moving.center_of_mass - np.array(pivot)))
    return ArticulatedObject(
        object_id=object_id,
        category="scissors",
        links=(
            Link(name="half_1", shapes=(*mount.shapes(half_1), *holder), density=3000.0),
            moving,
        ),
        joints=(
            Joint(
                name="screw",
                type="revolute",
                parent="half_1",
                child="half_2",
                axis=mount.direction((0.0, 0.0, -side)),
                pivot=pivot,
                closed=0.0,
                open=float(np.radians(uniform(rng, (50.0, 90.0)))),
                friction=1.3 * gravity_torque + uniform(rng, (0.8, 5.0)) * 0.6 * form.handle,
                damping=uniform(rng, (0.0005, 0.003)),
            ),
        ),
        attributes={"family": family, "handle": "ring", "held": held},
        R_object_canonical=mount.R_object_layout,
    )


def _draw_form(rng: np.random.Generator, family: str) -> _Form:
    length = uniform(rng, _LENGTH[family])
    blade = uniform(rng, _BLADE_SHARE[family]) * length
    blade_width = uniform(rng, (0.055, 0.075)) * length
    thickness = uniform(rng, _THICKNESS[family])
    blunt = family == "child" or rng.random() < 0.2
    return _Form(
        blade=blade,
        handle=length - blade,
        blade_width=blade_width,
        overlap=uniform(rng, (0.15, 0.3)) * blade_width,
        sheet=min(uniform(rng, (0.0014, 0.0030)), 0.25 * thickness),
        thickness=thickness,
        rise=uniform(rng, (0.0, 0.0015)),
        tip=uniform(rng, (0.004, 0.006)) if blunt else 0.001,
    )


def _draw_rings(rng: np.random.Generator, family: str, form: _Form) -> tuple[_Ring, _Ring]:
    """Half_1's and half_2's ring; many scissors have one for the thumb and a longer one."""
    width = uniform(rng, _RING_WIDTH[family])
    longest = form.handle - 0.024
    first = min(uniform(rng, _RING_ASPECT[family]) * width, longest)
    second = first
    if family in ("office", "kitchen", "tailor") and rng.random() < 0.6:
        second = max(min(0.95 * first, width), uniform(rng, (0.65, 0.9)) * first)
    if rng.random() < 0.5:
        first, second = second, first
    bar = (
        uniform(rng, (0.0035, 0.005))
        if family == "steel"
        else uniform(rng, (0.005, 0.0085 if family in ("kitchen", "tailor") else 0.0072))
    )
    squareness = uniform(rng, (2.0, 3.2))
    splay = uniform(rng, (0.0, 0.3))
    rings = [
        _Ring(width=min(width, 1.1 * n), length=n, bar=bar, squareness=squareness, splay=splay)
        for n in (first, second)
    ]
    return rings[0], rings[1]


def _half(
    form: _Form, ring: _Ring, side: float, layer: float, blade_look: Material, grip_look: Material
) -> tuple[Shape, ...]:
    """Blade, shank and ring of a half whose ring lies towards ``side`` and layer ``layer`` z."""
    inner, outer = side * form.overlap, -side * (form.blade_width - form.overlap)
    blunt = min(form.tip / 2, 0.4 * form.blade_width)
    blade = [
        (-0.010, 0.8 * inner),
        (0.3 * form.blade, inner),
        (form.blade, side * 0.4 * blunt),
        (form.blade - 0.4 * blunt, -side * 1.6 * blunt),
        (0.45 * form.blade, 0.85 * outer),
        (0.0, outer),
        (-0.010, 0.6 * outer),
    ]
    middle = _ring_outline(form, ring, side)
    front = middle[np.argsort(middle[:, 0])[-3:]]
    half = form.thickness / 2 + form.rise
    tang = [(0.0, 0.7 * inner), (0.0, 0.7 * outer), *map(tuple, front)]
    neck = [(-0.012, side * 0.006), (-0.012, -side * 0.002), *map(tuple, front)]
    return (
        _in_layer(blade, layer, form.sheet, blade_look),
        _in_layer(tang, layer, form.sheet, blade_look),
        # The grip encloses the tang: it comes nearer to the other layer.
        _in_layer(neck, layer, 0.85 * half, grip_look, 0.3 * _SLIT),
        *with_role("handle", _ring_pieces(form, ring, middle, layer, grip_look)),
    )


def _in_layer(
    outline: list[tuple[float, float]],
    layer: float,
    thickness: float,
    look: Material,
    slit: float = _SLIT,
) -> Shape:
    low, high = sorted((layer * slit, layer * thickness))
    return prism(outline, "z", low, high, look)


def _ring_outline(form: _Form, ring: _Ring, side: float) -> Array:
    """The middle line (n, 2) of a ring's bar, free of the other half's ring."""
    angles = (np.arange(_RING_PIECES) + 0.5) * 2 * np.pi / _RING_PIECES
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    oval = np.sign(circle) * np.abs(circle) ** (2.0 / ring.squareness)
    points = oval * (np.array([ring.length, ring.width]) - ring.bar) / 2
    # The far end leans outwards.
    c, s = np.cos(ring.splay), np.sin(ring.splay)
    points = points @ np.array([[c, -s], [s, c]])
    points -= points.min(axis=0) - ring.bar / 2
    # Half a millimetre more than the bar's half, for the corners of its pieces.
    points += [-form.handle, 0.0013]
    return points * [1.0, side]


def _ring_pieces(
    form: _Form, ring: _Ring, middle: Array, layer: float, look: Material
) -> tuple[Shape, ...]:
    """Blocks along the middle line."""
    pieces = []
    for start, end in zip(middle, np.roll(middle, -1, axis=0), strict=True):
        x, y = (start + end) / 2
        # Blocks that meet at an angle close the outer side of the bend.
        half_length = np.linalg.norm(end - start) / 2 + 0.13 * ring.bar
        half = (half_length, ring.bar / 2, form.thickness / 2)
        z = layer * form.rise
        block = box_between(
            (x - half[0], y - half[1], z - half[2]), (x + half[0], y + half[1], z + half[2]), look
        )
        along = end - start
        angle = float(np.arctan2(along[1], along[0]))
        pieces.append(turned(block, (0.0, 0.0, 1.0), (float(x), float(y), z), angle))
    return tuple(pieces)


def _screw(rng: np.random.Generator, form: _Form, blade_look: Material) -> tuple[Shape, ...]:
    """The screw's head and end, and its slot."""
    radius, half = uniform(rng, (0.0028, 0.0046)), form.sheet + uniform(rng, (0.0006, 0.0015))
    head = cylinder_along("z", (0.0, 0.0, 0.0), radius, 2 * half, darker(blade_look, 0.8))
    slot = box_between(
        (-0.8 * radius, -0.0005, half - 0.0005),
        (0.8 * radius, 0.0005, half + 0.0002),
        darker(blade_look, 0.25),
    )
    return head, slot


def _attitude(rng: np.random.Generator, held: str) -> tuple[Array, float]:
    """``R_object_layout`` and the height of the lowest point.

    Lying flat the rings come to the front, else to the top.
    """
    if held == "flat":
        turn, pitch = np.pi + uniform(rng, (-1.2, 1.2)), uniform(rng, (-0.1, 0.2))
        low = uniform(rng, (0.12, 0.18))
    elif held == "leaning":
        turn, pitch = uniform(rng, (-0.7, 0.7)), uniform(rng, (0.5, 1.0))
        low = uniform(rng, (0.06, 0.11))
    else:
        turn, pitch = uniform(rng, (-0.7, 0.7)), uniform(rng, (1.3, 1.6))
        low = uniform(rng, (0.04, 0.09))
    R_pitch = matrix_from_axis_angle([0.0, pitch, 0.0])
    return R_pitch @ matrix_from_axis_angle([0.0, 0.0, turn]), low


def _blade_look(rng: np.random.Generator) -> Material:
    shade = uniform(rng, (0.5, 0.75))
    if rng.random() < 0.12:
        shade = 0.06
    return Material(
        color=(shade, shade, 1.02 * shade),
        roughness=uniform(rng, (0.2, 0.4)),
        metallic=uniform(rng, (0.6, 0.9)),
    )


def _grip_looks(
    rng: np.random.Generator, family: str, blade_look: Material
) -> tuple[Material, Material]:
    """Of half_1's and half_2's grip."""
    if family == "steel":
        look = blade_look if rng.random() < 0.6 else metal(rng)
        return look, look
    if family == "tailor" or rng.random() < 0.3:
        shade = uniform(rng, (0.015, 0.06))
        look = Material(color=(shade, shade, shade), roughness=0.5)
    else:
        look = painted(rng)
    if family == "child" and rng.random() < 0.4:
        return look, painted(rng)
    return look, look
