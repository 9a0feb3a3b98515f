"""Staplers: a base and an arm hinged at its rear, revolute about -y (the nose goes up).

Families: "desktop" (a rounded cover over the magazine), "mini" (short and tall), "heavy_duty"
(large, with a lever over the magazine), "retro" (pressed steel, a low magazine and a press button).
Some open far beyond upright, for tacking. Handles: "edge" (the nose), "lever", "button".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from artgym.objects.model import ArticulatedObject, Joint, Link, Material, Shape
from artgym.objects.procedural.shapes import (
    box_between,
    convex,
    cylinder_along,
    darker,
    metal,
    painted,
    prism,
    turned,
    uniform,
    with_role,
)

FAMILIES = ("desktop", "mini", "heavy_duty", "retro")
HANDLES = ("edge", "lever", "button")

_LENGTH = {
    "desktop": (0.115, 0.150),
    "mini": (0.110, 0.120),
    "heavy_duty": (0.140, 0.172),
    "retro": (0.120, 0.160),
}
_WIDTH = {
    "desktop": (0.032, 0.040),
    "mini": (0.031, 0.036),
    "heavy_duty": (0.037, 0.044),
    "retro": (0.032, 0.040),
}
#: Height of the arm's cover over its own lower edge.
_COVER = {
    "desktop": (0.018, 0.026),
    "mini": (0.020, 0.026),
    "heavy_duty": (0.018, 0.024),
    "retro": (0.008, 0.012),
}
_RUBBER = Material(color=(0.03, 0.03, 0.035), roughness=0.9)
#: Between what moves and what does not.
_GAP = 0.0016


@dataclass(frozen=True, kw_only=True)
class _Form:
    """Sizes, metres; the hinge's axis goes through (hinge_x, hinge_z)."""

    length: float
    width: float
    arm_width: float
    rear_width: float
    plate: float
    cheek: float
    cheek_height: float
    hinge_x: float
    hinge_z: float
    nose: float
    cover: float

    @property
    def cheek_front(self) -> float:
        """X where the cheeks end and the cover may be wide."""
        return self.hinge_x + 0.022


def make_stapler(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A stapler 0.11-0.17 m long; the arm opens by 60-120 degrees, a tacker's by up to 160."""
    family = str(rng.choice(FAMILIES, p=(0.4, 0.2, 0.2, 0.2)))
    tacker = rng.random() < 0.4
    form = _draw_form(rng, family)
    steel = Material(color=(0.62, 0.63, 0.65), roughness=0.35, metallic=0.8)
    shell = _shell(rng, family)
    base_look = shell if rng.random() < 0.4 else _base_look(rng)
    accent = _RUBBER if rng.random() < 0.5 else painted(rng)

    base = _base(rng, form, base_look, steel)
    flat_arm, handle = _arm(rng, family, form, shell, steel, accent)
    # At rest the nose stands a little above the base.
    pivot = (form.hinge_x, 0.0, form.hinge_z)
    lift = np.radians(uniform(rng, (1.5, 5.0)))
    arm = tuple(turned(s, (0.0, -1.0, 0.0), pivot, float(lift)) for s in flat_arm)

    mass = uniform(rng, (0.08, 0.22))
    reach = form.nose - form.hinge_x
    gravity_torque = mass * 9.81 * 0.6 * reach
    spring = uniform(rng, (0.5, 4.0)) * reach
    degrees = uniform(rng, (125.0, 160.0)) if tacker else uniform(rng, (60.0, 120.0))
    return ArticulatedObject(
        object_id=object_id,
        category="stapler",
        links=(
            Link(name="base", shapes=base, density=2500.0),
            Link(
                name="arm",
                shapes=arm,
                density=mass / sum(s.geometry.volume for s in arm),
                friction=uniform(rng, (0.6, 1.0)),
            ),
        ),
        joints=(
            Joint(
                name="hinge",
                type="revolute",
                parent="base",
                child="arm",
                axis=(0.0, -1.0, 0.0),
                pivot=pivot,
                closed=0.0,
                open=float(np.radians(degrees)),
                friction=1.3 * gravity_torque + spring,
                damping=uniform(rng, (0.002, 0.01)),
            ),
        ),
        attributes={"family": family, "handle": handle},
    )


def _draw_form(rng: np.random.Generator, family: str) -> _Form:
    length, width = uniform(rng, _LENGTH[family]), uniform(rng, _WIDTH[family])
    cheek = uniform(rng, (0.0015, 0.0025))
    arm_width = width - uniform(rng, (0.002, 0.008))
    cheeks_outside = width - uniform(rng, (0.0, 0.006))
    hinge_x = -length / 2 + uniform(rng, (0.012, 0.018))
    cheek_height = uniform(rng, (0.027, 0.037))
    return _Form(
        length=length,
        width=width,
        arm_width=arm_width,
        rear_width=cheeks_outside - 2 * (cheek + _GAP),
        plate=uniform(rng, (0.006, 0.010)),
        cheek=cheek,
        cheek_height=cheek_height,
        hinge_x=hinge_x,
        hinge_z=cheek_height - uniform(rng, (0.006, 0.009)),
        nose=length / 2 - uniform(rng, (0.001, 0.010)),
        cover=uniform(rng, _COVER[family]),
    )


def _base(
    rng: np.random.Generator, form: _Form, look: Material, steel: Material
) -> tuple[Shape, ...]:
    """A plate with rounded ends on rubber feet, an anvil, and cheeks that hold the hinge."""
    x, y = form.length / 2, form.width / 2
    corner = uniform(rng, (0.2, 0.6)) * y
    outline = [(-x, -0.8 * y), (-0.9 * x, -y), (x - corner, -y), (x, -y + corner)]
    outline += [(px, -py) for px, py in reversed(outline)]
    outside = form.rear_width / 2 + _GAP + form.cheek
    shapes = [prism(outline, "z", 0.0015, form.plate, look)]
    if rng.random() < 0.5:
        # A metal bed lies in the plate, half a millimetre proud.
        low, high = (form.cheek_front, -0.7 * y), (0.86 * x, 0.7 * y)
        shapes.append(
            box_between(
                (*low, form.plate - 0.001), (*high, form.plate + 0.0005), darker(steel, 0.7)
            )
        )
    anvil = form.nose - 0.012
    shapes.append(
        box_between(
            (anvil - 0.006, -0.5 * y, form.plate - 0.001),
            (anvil + 0.006, 0.5 * y, form.plate + 0.0012),
            steel,
        )
    )
    shapes += [
        box_between((s * 0.7 * x - 0.009, -0.75 * y, 0), (s * 0.7 * x + 0.009, 0.75 * y, 0.0015), m)
        for s, m in ((-1.0, _RUBBER), (1.0, _RUBBER))
    ]
    rear = form.hinge_x - 0.009
    cheek = [
        (rear, form.plate - 0.001),
        (form.cheek_front - 0.001, form.plate - 0.001),
        (form.cheek_front - 0.006, form.cheek_height),
        (rear + 0.003, form.cheek_height),
    ]
    cheek_look = look if rng.random() < 0.5 else steel
    for side in (-1.0, 1.0):
        inner, outer = sorted((side * outside, side * (outside - form.cheek)))
        shapes.append(prism(cheek, "y", inner, outer, cheek_look))
        shapes.append(
            cylinder_along("y", (form.hinge_x, side * outside, form.hinge_z), 0.003, 0.001, steel)
        )
    return tuple(shapes)


def _arm(
    rng: np.random.Generator,
    family: str,
    form: _Form,
    shell: Material,
    steel: Material,
    accent: Material,
) -> tuple[tuple[Shape, ...], str]:
    """Magazine, cover and nose as if the arm lay level, and the kind of handle."""
    magazine_low = form.hinge_z - uniform(rng, (0.005, 0.007))
    magazine_top = magazine_low + uniform(rng, (0.008, 0.011))
    half = min(uniform(rng, (0.006, 0.009)), form.rear_width / 2)
    nose = form.nose
    rear = form.hinge_x - 0.007
    magazine = box_between((rear, -half, magazine_low), (nose - 0.004, half, magazine_top), steel)
    # Between the cheeks the cover is narrow.
    low, top = magazine_low + uniform(rng, (0.003, 0.006)), magazine_top + form.cover
    rear_top = max(form.hinge_z + 0.008, magazine_top + uniform(rng, (0.35, 0.75)) * form.cover)
    neck = prism(
        [
            (rear, form.hinge_z),
            (rear + 0.004, rear_top - 0.003),
            (form.cheek_front + 0.004, rear_top),
            (form.cheek_front + 0.004, low + 0.002),
            (form.hinge_x, low),
        ],
        "y",
        -form.rear_width / 2,
        form.rear_width / 2,
        shell,
    )
    if family == "heavy_duty":
        cover, grip = _lever(rng, form, (low, magazine_top, rear_top, top), shell, accent)
        return (magazine, neck, *cover, *with_role("handle", grip)), "lever"
    if family == "retro":
        cover, grip = _press(rng, form, (low, rear_top, top), shell, steel, accent)
        return (magazine, neck, *cover, *with_role("handle", grip)), "button"
    cover, grip = _cover(rng, form, (low, rear_top, top), shell, accent)
    return (magazine, neck, *cover, *with_role("handle", grip)), "edge"


def _rounded(profile: list[tuple[float, float, float]], width: float, look: Material) -> Shape:
    """A body along x, narrower at the top: stations of x, lower and upper z."""
    y = width / 2
    points = []
    for x, low, high in profile:
        shoulder = high - 0.3 * (high - low)
        for side in (-1.0, 1.0):
            points += [
                (x, side * 0.94 * y, low),
                (x, side * y, low + 0.3 * (high - low)),
                (x, side * 0.93 * y, shoulder),
                (x, side * 0.62 * y, high),
            ]
    return convex(points, look)


def _cover(
    rng: np.random.Generator,
    form: _Form,
    heights: tuple[float, float, float],
    shell: Material,
    accent: Material,
) -> tuple[tuple[Shape, ...], tuple[Shape, ...]]:
    """A bowed cover; its nose, the handle, may be of another colour and bears a rubber pad."""
    low, rear_top, top = heights
    x0, x1 = form.cheek_front + _GAP, form.nose
    length = x1 - x0
    seam = x1 - uniform(rng, (0.24, 0.36)) * length
    crest = uniform(rng, (0.35, 0.6))
    droop = uniform(rng, (0.15, 0.5)) * (top - low)
    back = _rounded(
        [
            (x0, low, rear_top),
            (x0 + crest * (seam - x0), low, top),
            (seam, low, top - 0.25 * droop),
        ],
        form.arm_width,
        shell,
    )
    nose = _rounded(
        [
            (seam, low, top - 0.25 * droop),
            (x1 - 0.006, low, top - 0.75 * droop),
            (x1, low + 0.003, top - droop - 0.002),
        ],
        form.arm_width,
        shell if rng.random() < 0.5 else accent,
    )
    grip = [nose]
    if rng.random() < 0.6:
        slope = float(np.arctan2(0.5 * droop, x1 - 0.006 - seam))
        middle = ((seam + x1 - 0.006) / 2, 0.0, top - 0.5 * droop)
        half = (0.35 * (x1 - seam), 0.22 * form.arm_width, 0.0009)
        pad = box_between(
            tuple(m - h for m, h in zip(middle, half, strict=True)),
            tuple(m + h for m, h in zip(middle, half, strict=True)),
            _RUBBER,
        )
        grip.append(turned(pad, (0.0, 1.0, 0.0), middle, slope))
    rest = [back]
    if rng.random() < 0.4:
        # A band along both sides.
        y = form.arm_width / 2
        middle_z = low + 0.35 * (rear_top - low)
        rest.append(
            box_between(
                (x0 + 0.004, -y - 0.0004, middle_z - 0.0015),
                (seam - 0.004, y + 0.0004, middle_z + 0.0015),
                accent,
            )
        )
    return tuple(rest), tuple(grip)


def _lever(
    rng: np.random.Generator,
    form: _Form,
    heights: tuple[float, float, float, float],
    shell: Material,
    accent: Material,
) -> tuple[tuple[Shape, ...], tuple[Shape, ...]]:
    """A block over the magazine and a long lever that rises to the front."""
    low, magazine_top, rear_top, top = heights
    x0, x1 = form.cheek_front + _GAP, form.nose
    block_top = magazine_top + 0.35 * form.cover
    block = _rounded(
        [(x0, low, max(block_top, rear_top - 0.004)), (x1, low, block_top)],
        0.92 * form.arm_width,
        darker(shell, 0.7),
    )
    thickness = uniform(rng, (0.009, 0.013))
    rise = uniform(rng, (0.004, 0.014))
    front = x1 - uniform(rng, (0.0, 0.015))
    seam = x0 + uniform(rng, (0.5, 0.7)) * (front - x0)
    share = (seam - x0) / (front - x0)
    rear_low = max(rear_top - 0.006, block_top - 0.002)
    front_low = max(top - thickness + rise, block_top + 0.006)
    seam_low = rear_low + share * (front_low - rear_low)
    arm = _rounded(
        [(x0, rear_low, rear_low + thickness), (seam, seam_low, seam_low + thickness)],
        form.arm_width,
        shell,
    )
    grip = _rounded(
        [
            (seam, seam_low - 0.001, seam_low + thickness + 0.001),
            (front - 0.006, front_low, front_low + thickness + 0.001),
            (front, front_low + 0.003, front_low + thickness - 0.003),
        ],
        form.arm_width + 0.001,
        accent,
    )
    # The press foot carries the lever's force to the magazine.
    foot = box_between(
        (seam - 0.012, -0.2 * form.arm_width, block_top - 0.002),
        (seam + 0.002, 0.2 * form.arm_width, seam_low + 0.004),
        darker(shell, 0.5),
    )
    return (block, arm, foot), (grip,)


def _press(
    rng: np.random.Generator,
    form: _Form,
    heights: tuple[float, float, float],
    shell: Material,
    steel: Material,
    accent: Material,
) -> tuple[tuple[Shape, ...], tuple[Shape, ...]]:
    """A low steel cover, a head over the nose and a round button on it."""
    low, rear_top, top = heights
    x0, x1 = form.cheek_front + _GAP, form.nose
    radius = uniform(rng, (0.011, 0.015))
    head_rear = x1 - 2 * radius - uniform(rng, (0.0, 0.006))
    cover = _rounded(
        [(x0, low, rear_top), (head_rear + 0.002, low, top)], 0.85 * form.arm_width, shell
    )
    head = box_between(
        (head_rear, -form.arm_width / 2, low), (x1, form.arm_width / 2, top + 0.003), shell
    )
    x = (head_rear + x1) / 2
    stem, cap = uniform(rng, (0.008, 0.014)), uniform(rng, (0.007, 0.011))
    stem_low = top + 0.003
    grip = [
        cylinder_along("z", (x, 0.0, stem_low + stem / 2), 0.45 * radius, stem, steel),
        cylinder_along("z", (x, 0.0, stem_low + stem + cap / 2), radius, cap, accent),
    ]
    return (cover, head), tuple(grip)


def _shell(rng: np.random.Generator, family: str) -> Material:
    if family == "retro" and rng.random() < 0.6:
        return metal(rng)
    if rng.random() < 0.35:
        shade = uniform(rng, (0.02, 0.10))
        return Material(color=(shade, shade, shade * 1.1), roughness=0.4)
    return painted(rng)


def _base_look(rng: np.random.Generator) -> Material:
    if rng.random() < 0.6:
        shade = uniform(rng, (0.03, 0.2))
        return Material(color=(shade, shade, shade), roughness=0.6)
    return metal(rng)
