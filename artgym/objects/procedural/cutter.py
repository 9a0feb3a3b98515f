"""Cutters: a handle with a channel in which a slider moves that bears a blade, prismatic.

Laid out flat: the nose points along +x, the thumb's side is +z, a tab's side is +y. The slider goes
towards the nose and the blade comes out of it.

Families: "slim" (narrow, with a metal nose), "heavy" (wide, rubber at its sides), "trapeze" (a body
that narrows to the rear, a blade without breaking lines), "box" (blunt, for cartons). What a hand
can take: a "knob" or a "wheel" high enough to be pinched above the body, a "saddle" a little wider
than the body, the "blade" itself where it stands out (the button is then as low as most real ones),
or, in "box", a "tab" at the edge or a "cap" a little thicker than the edge.
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

FAMILIES = ("slim", "heavy", "trapeze", "box")
HANDLES = ("knob", "saddle", "wheel", "blade", "tab", "cap")
_HANDLES_OF = {
    "slim": ("saddle", "blade", "knob"),
    "heavy": ("knob", "wheel", "saddle", "blade"),
    "trapeze": ("knob", "wheel", "saddle", "blade"),
    "box": ("tab", "tab", "cap"),
}

_LENGTH = {
    "slim": (0.095, 0.150),
    "heavy": (0.135, 0.170),
    "trapeze": (0.120, 0.165),
    "box": (0.095, 0.168),
}
#: Width over all and thickness of the body.
_WIDTH = {
    "slim": (0.0130, 0.0230),
    "heavy": (0.028, 0.036),
    "trapeze": (0.026, 0.036),
    "box": (0.022, 0.036),
}
_THICKNESS = {
    "slim": (0.0095, 0.015),
    "heavy": (0.013, 0.022),
    "trapeze": (0.014, 0.022),
    "box": (0.0095, 0.020),
}
#: Width of the blade as a share of the body's.
_BLADE_SHARE = {
    "slim": (0.50, 0.62),
    "heavy": (0.55, 0.66),
    "trapeze": (0.52, 0.64),
    "box": (0.48, 0.60),
}
#: How far the thumb's piece stands out of the body.
_RISE = {
    "knob": (0.0150, 0.0190),
    "saddle": (0.0060, 0.0110),
    "wheel": (0.0150, 0.0190),
    "blade": (0.0010, 0.0035),
    "tab": (0.0165, 0.0200),
    "cap": (0.0050, 0.0100),
}
#: How far saddles and caps stand out beyond both sides of the body.
_OVERHANG = (0.0028, 0.0044)
_RUBBER = Material(color=(0.03, 0.03, 0.035), roughness=0.9)
_STEEL = Material(color=(0.66, 0.67, 0.69), roughness=0.3, metallic=0.8)
#: Between slider and channel.
_PLAY = 0.0005
#: Of a blade: jaws that hold one must not take it for nothing.
_BLADE, _HELD_BLADE = 0.0012, 0.0024
#: How far the tip stands out at rest, of a blade that is held and of others.
_HELD_TIP, _TIP = (0.024, 0.032), (-0.002, 0.004)
#: The rear cap fills the channel up to here; the slot ends this far from the nose.
_CAP, _NOSE_END = 0.0065, 0.010

Outline = list[tuple[float, float]]


@dataclass(frozen=True, kw_only=True)
class _Form:
    """Sizes, metres; x from the rear end of the body, z from its underside.

    Attributes:
        length, width, thickness: of the body.
        rear_width: its width at the rear.
        shoulder: x where it begins to taper towards the nose.
        blade_width: also the channel's, but for the play.
        floor, ceiling: z of the channel.
        slot: half the width of the slot through which the thumb's piece stands out.
        grip: length of the thumb's piece.
        rise: how far it stands out.
        travel: the slider's range.
        tail, tip: x of the slider's ends at rest.
    """

    length: float
    width: float
    thickness: float
    rear_width: float
    shoulder: float
    blade_width: float
    floor: float
    ceiling: float
    slot: float
    grip: float
    rise: float
    travel: float
    tail: float
    tip: float

    @property
    def channel(self) -> float:
        """Half the channel's width."""
        return self.blade_width / 2 + _PLAY

    @property
    def nose(self) -> float:
        """Half the body's width at its front end."""
        return self.channel + 0.0013

    @property
    def middle(self) -> float:
        """Z of the channel's middle."""
        return (self.floor + self.ceiling) / 2

    @property
    def slot_rear(self) -> float:
        """X of the slot's rear end."""
        return self.tail + 0.002

    @property
    def slot_front(self) -> float:
        """X of the slot's front end."""
        return self.slot_rear + self.grip + self.travel + 0.002


def make_cutter(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A cutter 0.095-0.17 m long with its blade in; the slider moves by 0.05-0.10 m."""
    family = str(rng.choice(FAMILIES))
    handle = str(rng.choice(_HANDLES_OF[family]))
    form = _draw_form(rng, family, handle)
    shell = metal(rng) if family == "trapeze" and rng.random() < 0.6 else painted(rng)
    accent = _RUBBER if rng.random() < 0.5 else painted(rng)
    body = _body(rng, family, handle, form, shell, accent)
    slider = _slider(rng, family, handle, form, accent)

    R_object_layout, low = _attitude(rng, handle)
    mount = Mount.over_origin((*body, *slider), R_object_layout, low)
    held_at = (uniform(rng, (0.010, 0.020)), 0.0, 0.0)
    holder = stand(rng, mount.point(held_at), mount.direction((0.0, 0.0, -1.0)))

    mass = uniform(rng, (0.02, 0.05))
    return ArticulatedObject(
        object_id=object_id,
        category="cutter",
        links=(
            Link(name="body", shapes=(*mount.shapes(body), *holder), density=1500.0),
            Link(
                name="slider",
                shapes=mount.shapes(slider),
                density=mass / sum(s.geometry.volume for s in slider),
                friction=uniform(rng, (0.6, 1.0)),
            ),
        ),
        joints=(
            Joint(
                name="slide",
                type="prismatic",
                parent="body",
                child="slider",
                axis=mount.direction((1.0, 0.0, 0.0)),
                pivot=mount.point((0.0, 0.0, 0.0)),
                closed=0.0,
                open=form.travel,
                # The slider's weight is held at any slope.
                friction=1.3 * mass * 9.81 + uniform(rng, (0.5, 6.0)),
                damping=uniform(rng, (0.5, 4.0)),
            ),
        ),
        attributes={"family": family, "handle": handle},
        R_object_canonical=mount.R_object_layout,
    )


def _draw_form(rng: np.random.Generator, family: str, handle: str) -> _Form:
    length, width = uniform(rng, _LENGTH[family]), uniform(rng, _WIDTH[family])
    thickness = uniform(rng, _THICKNESS[family])
    floor = uniform(rng, (0.22, 0.32)) * thickness
    grip = uniform(rng, (0.011, 0.020))
    room = length - _NOSE_END - grip - _CAP - 0.005
    travel = float(np.clip(uniform(rng, (0.4, 1.0)) * room, 0.05, 0.10))
    return _Form(
        length=length,
        width=width,
        thickness=thickness,
        rear_width=uniform(rng, (0.78, 0.9)) * width if family == "trapeze" else width,
        shoulder=length - (_NOSE_END - 0.001 if family == "box" else 0.7 * width),
        blade_width=max(uniform(rng, _BLADE_SHARE[family]) * width, 0.0090),
        floor=floor,
        ceiling=floor + max(0.0036, uniform(rng, (0.32, 0.42)) * thickness),
        slot=uniform(rng, (0.0009, 0.0014)),
        grip=grip,
        rise=uniform(rng, _RISE[handle]),
        travel=travel,
        # The slot often ends at the nose: the slider is then as short as it can be.
        tail=_CAP + 0.001 + min(uniform(rng, (0.0, 1.6)), 1.0) * (room - travel),
        tip=length + uniform(rng, _HELD_TIP if handle == "blade" else _TIP),
    )


def _outline(form: _Form, corner: float, margin: float = 0.0) -> Outline:
    """The body seen from above, larger by a margin at its sides."""
    y, rear = form.width / 2 + margin, form.rear_width / 2 + margin
    side = [(0.0, rear - corner), (corner, rear), (form.shoulder, y), (form.length, form.nose)]
    return [*side, *((px, -py) for px, py in reversed(side))]


def _body(
    rng: np.random.Generator,
    family: str,
    handle: str,
    form: _Form,
    shell: Material,
    accent: Material,
) -> tuple[Shape, ...]:
    """Floor, rails, a top (with a slot, or a rail has one), a rear cap and what adorns them."""
    y, corner = form.width / 2, uniform(rng, (0.15, 0.6)) * form.rear_width / 2
    outline = _outline(form, corner)
    top, front, channel = form.thickness, form.length - 0.0005, form.channel
    shapes = [prism(outline, "z", 0.0, form.floor, shell)]
    shapes.append(_rail(form, corner, -1.0, shell))
    if handle == "tab":
        shapes += [
            *_slotted_rail(form, corner, shell),
            prism(outline, "z", form.ceiling, top, shell),
        ]
    else:
        slot = form.slot + _PLAY
        shapes.append(_rail(form, corner, 1.0, shell))
        shapes += [
            box_between((x0, low, form.ceiling), (x1, high, top), shell)
            for x0, x1, low, high in (
                (_CAP, front, -channel, -slot),
                (_CAP, front, slot, channel),
                (_CAP, form.slot_rear, -slot, slot),
                (form.slot_front, front, -slot, slot),
            )
        ]
    shapes.append(_cap(form, corner, accent if rng.random() < 0.6 else darker(shell, 0.6)))
    if family == "heavy" or (family == "box" and rng.random() < 0.5):
        low, high = 0.15 * top, 0.85 * top
        sides = (-1.0,) if family == "box" else (-1.0, 1.0)
        for side in sides:
            inner, outer = sorted((side * (y - 0.001), side * (y + 0.0006)))
            reach = (0.22 * form.length, 0.62 * form.length)
            shapes.append(box_between((reach[0], inner, low), (reach[1], outer, high), accent))
    if family == "slim" or rng.random() < 0.3:
        # Sheet metal about the nose.
        sheet = _sheet(form)
        shapes += [
            prism(sheet, "z", -0.0004, 0.5 * form.floor, _STEEL),
            prism(sheet, "z", top - 0.0005, top + 0.0004, _STEEL),
        ]
    return tuple(shapes)


def _rail(form: _Form, corner: float, side: float, shell: Material) -> Shape:
    """One side of the channel, from the floor to the top."""
    y, rear, start = form.width / 2, form.rear_width / 2, 0.5 * _CAP
    outline = [
        (start, side * form.channel),
        (form.length - 0.0005, side * form.channel),
        (form.length - 0.0005, side * form.nose),
        (form.shoulder, side * y),
        (max(corner, start), side * rear),
        (start, side * (rear - max(corner - start, 0.0))),
    ]
    return prism(outline, "z", form.floor, form.thickness, shell)


def _slotted_rail(form: _Form, corner: float, shell: Material) -> tuple[Shape, ...]:
    """The side of the channel with a slot for a tab; the body is straight along it."""
    y, channel, start = form.width / 2, form.channel, 0.5 * _CAP
    rear, front = form.slot_rear, form.slot_front
    low, high = form.middle - form.slot - _PLAY, form.middle + form.slot + _PLAY
    end = form.length - 0.0005
    rear_block = [
        (start, channel),
        (start, y - max(corner - start, 0.0)),
        (min(max(corner, start), rear - 0.0005), y),
        (rear, y),
        (rear, channel),
    ]
    front_block = [
        (front, channel),
        (front, y),
        (form.shoulder, y),
        (end, form.nose),
        (end, channel),
    ]
    return (
        prism(rear_block, "z", form.floor, form.thickness, shell),
        prism(front_block, "z", form.floor, form.thickness, shell),
        box_between((rear, channel, form.floor), (front, y, low), shell),
        box_between((rear, channel, high), (front, y, form.thickness), shell),
    )


def _cap(form: _Form, corner: float, look: Material) -> Shape:
    """The rear end, a little proud."""
    rear = form.rear_width / 2 + 0.0004
    side = [(-0.001, rear - corner), (min(corner, _CAP - 0.001), rear), (_CAP, rear)]
    outline = [*side, *((px, -py) for px, py in reversed(side))]
    return prism(outline, "z", -0.0004, form.thickness + 0.0004, look)


def _sheet(form: _Form) -> Outline:
    """Outline of the metal about the nose: the front of the body's, a little larger."""
    rear = max(form.slot_front + 0.001, form.shoulder - 0.004)
    margin = 0.0003
    if rear < form.shoulder:
        side = [(rear, form.width / 2 + margin), (form.shoulder, form.width / 2 + margin)]
    else:
        share = (rear - form.shoulder) / (form.length - form.shoulder)
        side = [(rear, (1 - share) * form.width / 2 + share * form.nose + margin)]
    side.append((form.length + margin, form.nose + margin))
    return [*side, *((px, -py) for px, py in reversed(side))]


def _slider(
    rng: np.random.Generator, family: str, handle: str, form: _Form, accent: Material
) -> tuple[Shape, ...]:
    """Carrier, blade and the thumb's piece, which is the handle."""
    b = form.blade_width / 2
    z = form.floor + 0.0004
    grip_rear = form.slot_rear + 0.001
    grip_front = grip_rear + form.grip
    carrier_top = min(z + 0.0026, form.ceiling - 0.0003)
    holder = darker(accent, 0.6)
    carrier = box_between((form.tail, -b, z), (grip_front + 0.004, b, carrier_top), holder)
    slant = uniform(rng, (0.5, 0.9)) * form.blade_width
    low = z + 0.0002
    high = low + (_HELD_BLADE if handle == "blade" else _BLADE)
    seam = form.length + 0.001 if handle == "blade" else form.tip - slant - 0.002
    tip = [(seam, -b), (form.tip, -b), (form.tip - slant, b), (seam, b)]
    blade = (prism(tip, "z", low, high, _STEEL),)
    if family != "trapeze":
        blade += _breaking_lines(form, slant, high)
    shapes = [carrier, box_between((grip_front, -b, low), (seam, b, high), _STEEL)]
    if handle == "blade":
        button = _knob(rng, form, handle, grip_rear, carrier_top, accent)
        return (*shapes, *button, *with_role("handle", blade))
    shapes += blade
    if family == "box":
        grip = _tab(rng, form, handle, grip_rear, accent)
    elif handle == "wheel":
        grip = _wheel(rng, form, grip_rear, carrier_top, accent)
    else:
        grip = _knob(rng, form, handle, grip_rear, carrier_top, accent)
    return (*shapes, *with_role("handle", grip))


def _breaking_lines(form: _Form, slant: float, top: float) -> tuple[Shape, ...]:
    """Scored lines along which a blunt piece snaps off, on the part that comes out."""
    pitch, b = 0.5 * form.blade_width + 0.003, form.blade_width / 2
    angle = float(np.arctan2(slant, form.blade_width))
    count = min(4, int((form.travel - slant) / pitch))
    look = darker(_STEEL, 0.35)
    lines = []
    for k in range(1, count + 1):
        middle = (form.tip - slant / 2 - k * pitch, 0.0, top)
        reach = 0.96 * b / np.cos(angle)
        line = box_between(
            (middle[0] - 0.0003, -reach, top - 0.0003),
            (middle[0] + 0.0003, reach, top + 0.0001),
            look,
        )
        lines.append(turned(line, (0.0, 0.0, 1.0), middle, angle))
    return tuple(lines)


def _knob(
    rng: np.random.Generator,
    form: _Form,
    handle: str,
    rear: float,
    stem_low: float,
    look: Material,
) -> tuple[Shape, ...]:
    """A block or a wedge with ridges, on a stem in the slot."""
    front, half = rear + form.grip, uniform(rng, (0.005, 0.0075))
    if handle == "saddle":
        half = form.width / 2 + uniform(rng, _OVERHANG)
    low, high = form.thickness + 0.0006, form.thickness + form.rise
    stem = box_between((rear, -form.slot, stem_low), (front, form.slot, low), darker(look, 0.7))
    pad = look if rng.random() < 0.5 else darker(look, 0.6)
    low_end = high - (uniform(rng, (0.001, 0.002)) if rng.random() < 0.5 else 0.0)
    profile = [(rear, low), (front, low), (front - 0.0015, low_end), (rear + 0.001, high)]
    ridges = [
        box_between((x - 0.0008, -half, low_end - 0.002), (x + 0.0008, half, high + 0.0006), pad)
        for x in np.linspace(rear + 0.002, front - 0.002, 5)
    ]
    return (prism(profile, "y", -half, half, look), stem, *ridges)


def _wheel(
    rng: np.random.Generator, form: _Form, rear: float, stem_low: float, look: Material
) -> tuple[Shape, ...]:
    """A flat screw that clamps the blade."""
    radius = uniform(rng, (0.0090, 0.0115))
    low, high = form.thickness + 0.0006, form.thickness + form.rise
    x = rear + form.grip / 2
    stem = box_between(
        (rear, -form.slot, stem_low), (rear + form.grip, form.slot, low), darker(look, 0.7)
    )
    seam = low + 0.65 * (high - low)
    disc = cylinder_along("z", (x, 0.0, (low + seam) / 2), radius, seam - low, look)
    rim = cylinder_along("z", (x, 0.0, (seam + high) / 2), 0.93 * radius, high - seam, look)
    cross = [
        box_between((x - a, -b, high - 0.001), (x + a, b, high + 0.0008), darker(look, 0.6))
        for a, b in ((0.85 * radius, 0.0012), (0.0012, 0.85 * radius))
    ]
    return (disc, rim, stem, *cross)


def _tab(
    rng: np.random.Generator, form: _Form, handle: str, rear: float, look: Material
) -> tuple[Shape, ...]:
    """A plate that stands out of the edge, as thin as its neck or thickened to a pad."""
    front, z = rear + form.grip, form.middle
    low, high = z - form.slot, z + form.slot
    if handle == "cap":
        low = -uniform(rng, _OVERHANG)
        high = form.thickness + uniform(rng, _OVERHANG)
    elif rng.random() < 0.6:
        half = min(uniform(rng, (0.0016, 0.0050)), 0.45 * form.thickness)
        low, high = z - half, z + half
    neck_low, neck_high = max(low, z - form.slot), min(high, z + form.slot)
    edge = form.width / 2
    neck = box_between(
        (rear, form.blade_width / 2 - 0.002, neck_low), (front, edge + 0.001, neck_high), look
    )
    outline = [
        (rear, edge + 0.0008),
        (front, edge + 0.0008),
        (front - 0.0015, edge + form.rise),
        (rear + 0.0015, edge + form.rise),
    ]
    ridges = [
        box_between(
            (x - 0.0008, edge + 0.4 * form.rise, low - 0.0005),
            (x + 0.0008, edge + form.rise + 0.0004, high + 0.0005),
            darker(look, 0.75),
        )
        for x in np.linspace(rear + 0.003, front - 0.003, 4)
    ]
    return (prism(outline, "z", low, high, look), neck, *ridges)


def _attitude(rng: np.random.Generator, handle: str) -> tuple[Array, float]:
    """``R_object_layout`` and the height of the lowest point: the thumb's piece is on top."""
    if handle in ("tab", "cap"):
        turn, roll = uniform(rng, (-1.4, 0.1)), uniform(rng, (-0.25, 0.15))
    else:
        turn, roll = uniform(rng, (-1.2, 1.2)), uniform(rng, (-0.35, 0.35))
    pitch = uniform(rng, (-0.4, 0.25))
    R_turn = matrix_from_axis_angle([0.0, 0.0, turn])
    R_pitch = matrix_from_axis_angle([0.0, pitch, 0.0])
    return R_turn @ R_pitch @ matrix_from_axis_angle([roll, 0.0, 0.0]), uniform(rng, (0.06, 0.12))
