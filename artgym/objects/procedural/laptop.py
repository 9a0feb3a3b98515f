"""Laptops: a base and a lid hinged at the back, revolute about -y (the front edge goes up)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from artgym.objects.model import ArticulatedObject, Joint, Link, Material, Shape, Vector
from artgym.objects.procedural.shapes import (
    Interval,
    box_between,
    cylinder_along,
    darker,
    metal,
    painted,
    prism,
    uniform,
    with_role,
)

#: Plain ones are two slabs; the others have a form of their own.
PLAIN_FAMILIES = ("thin", "office", "thick")
SHAPED_FAMILIES = ("rounded", "netbook", "gaming", "rugged")
FAMILIES = PLAIN_FAMILIES + SHAPED_FAMILIES
GRIPS = ("edge", "tab", "notch")

_BASE_THICKNESS = {"thin": (0.010, 0.014), "office": (0.014, 0.020), "thick": (0.020, 0.030)}
_LID_THICKNESS = {"thin": (0.005, 0.007), "office": (0.006, 0.009), "thick": (0.009, 0.014)}
#: Width, base and lid thickness of the shaped families, metres.
_SHAPED_SIZES: dict[str, tuple[Interval, Interval, Interval]] = {
    "rounded": ((0.28, 0.36), (0.010, 0.016), (0.005, 0.008)),
    "netbook": ((0.22, 0.28), (0.018, 0.030), (0.010, 0.016)),
    "gaming": ((0.35, 0.42), (0.022, 0.032), (0.008, 0.012)),
    "rugged": ((0.29, 0.36), (0.030, 0.045), (0.014, 0.022)),
}
_GAP = 0.0015


def make_laptop(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A laptop of 10 to 17 inches; the lid opens by 110-140 degrees."""
    # Drawn apart from what follows, so that the families do not share one stream of numbers.
    form = rng.spawn(1)[0]
    if form.random() < 0.5:
        return _plain(object_id, rng)
    return _shaped(object_id, str(form.choice(SHAPED_FAMILIES)), rng)


def _plain(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """Two slabs, the lid's edge to grip."""
    family = str(rng.choice(PLAIN_FAMILIES))
    width = uniform(rng, (0.26, 0.40))
    depth = width * uniform(rng, (0.62, 0.76))
    base_top = uniform(rng, _BASE_THICKNESS[family])
    lid_thickness = uniform(rng, _LID_THICKNESS[family])
    shell = metal(rng) if rng.random() < 0.5 else painted(rng)
    lid_shell = shell if rng.random() < 0.7 else painted(rng)
    dark = Material(color=(0.03, 0.03, 0.04), roughness=0.4)

    x, y = depth / 2, width / 2
    # The lid may be a little smaller than the base; it closes onto the keyboard's frame.
    inset = uniform(rng, (0.0, 0.006))
    hinge = (-x + uniform(rng, (0.004, 0.012)), 0.0, base_top + _GAP)
    base = [
        box_between((-x, -y, 0.002), (x, y, base_top), shell),
        *_keyboard(rng, x, y, base_top, dark, darker(shell, 0.8)),
        *_feet(x, y, dark),
    ]
    low = base_top + _GAP
    lid = [
        box_between(
            (hinge[0], -y + inset, low + 0.001),
            (x - inset, y - inset, low + lid_thickness),
            lid_shell,
        ),
        # The screen lies in the lid's underside, 1 mm proud.
        box_between(
            (hinge[0] + 0.10 * depth, -y + inset + 0.012, low),
            (x - inset - 0.012, y - inset - 0.012, low + 0.001),
            Material(color=_screen_color(rng), roughness=0.2),
        ),
        cylinder_along("y", hinge, uniform(rng, (0.003, 0.005)), 0.7 * width, darker(shell, 0.6)),
    ]
    if rng.random() < 0.5:
        lid.append(_logo(rng, x, low + lid_thickness, painted(rng)))
    return _hinged(object_id, rng, base, lid, hinge, depth, {"family": family, "handle": "edge"})


def _shaped(object_id: str, family: str, rng: np.random.Generator) -> ArticulatedObject:
    """One of the families with a form of their own, the lid gripped by an edge, tab or notch."""
    widths, bases, lids = _SHAPED_SIZES[family]
    width = uniform(rng, widths)
    depth = width * uniform(rng, (0.62, 0.76))
    base_top, lid_thickness = uniform(rng, bases), uniform(rng, lids)
    grip = str(rng.choice(GRIPS))
    shell = metal(rng) if rng.random() < 0.4 else painted(rng)
    trim = darker(shell, 0.5) if rng.random() < 0.6 else painted(rng)
    dark = Material(color=(0.03, 0.03, 0.04), roughness=0.4)
    radius = uniform(rng, (0.02, 0.04)) if family == "rounded" else uniform(rng, (0.004, 0.012))

    x, y = depth / 2, width / 2
    # Behind the hinge of a gaming laptop the base goes on, with its vents.
    behind = uniform(rng, (0.025, 0.045)) if family == "gaming" else 0.006
    low = base_top + _GAP
    hinge = (-x + behind, 0.0, low)
    notch = 0.012 if grip == "notch" else 0.0
    base = [
        _slab(-x, x, y, radius, 0.002, base_top, shell),
        *_keyboard(rng, x, y, base_top, dark, darker(shell, 0.8)),
        *_feet(x, y, dark),
    ]
    # A notch: the base ends short of the lid's front edge.
    lid_front = x + notch
    lid = [
        _slab(hinge[0], lid_front, y - 0.001, radius, low + 0.001, low + lid_thickness, shell),
        box_between(
            (hinge[0] + 0.10 * depth, -y + 0.016, low),
            (lid_front - 0.016 - notch, y - 0.016, low + 0.001),
            Material(color=_screen_color(rng), roughness=0.2),
        ),
        cylinder_along("y", hinge, uniform(rng, (0.003, 0.005)), 0.7 * width, trim),
        _logo(rng, x, low + lid_thickness, trim),
    ]
    if grip == "tab":
        reach, half = uniform(rng, (0.010, 0.018)), uniform(rng, (0.015, 0.035))
        tab = box_between(
            (lid_front - 0.002, -half, low + 0.001),
            (lid_front + reach, half, low + min(lid_thickness, 0.008)),
            trim,
        )
        lid += with_role("handle", [tab])
    if family == "gaming":
        base += _vents(rng, x, y, behind, base_top, trim, dark)
    elif family == "rugged":
        base += _bumpers(rng, x, y, base_top, trim)
    return _hinged(object_id, rng, base, lid, hinge, depth, {"family": family, "handle": grip})


def _hinged(
    object_id: str,
    rng: np.random.Generator,
    base: Sequence[Shape],
    lid: Sequence[Shape],
    hinge: Vector,
    depth: float,
    attributes: Mapping[str, str | float],
) -> ArticulatedObject:
    """Base and lid with the hinge between them."""
    lid_volume = sum(s.geometry.volume for s in lid)
    lid_mass = uniform(rng, (0.25, 0.7))
    # A hinge holds its lid level: its friction exceeds the largest torque of gravity.
    gravity_torque = lid_mass * 9.81 * depth / 2
    return ArticulatedObject(
        object_id=object_id,
        category="laptop",
        links=(
            Link(name="base", shapes=tuple(base), density=1200.0),
            Link(
                name="lid",
                shapes=tuple(lid),
                density=lid_mass / lid_volume,
                friction=uniform(rng, (0.6, 1.0)),
            ),
        ),
        joints=(
            Joint(
                name="hinge",
                type="revolute",
                parent="base",
                child="lid",
                axis=(0.0, -1.0, 0.0),
                pivot=hinge,
                closed=0.0,
                open=float(np.radians(uniform(rng, (110.0, 140.0)))),
                friction=gravity_torque * uniform(rng, (1.3, 1.8)),
                damping=uniform(rng, (0.01, 0.05)),
            ),
        ),
        attributes=attributes,
    )


def _slab(
    back: float, front: float, y: float, radius: float, low: float, high: float, look: Material
) -> Shape:
    """A plate with rounded corners from ``back`` to ``front``, 2 y wide."""
    corners = ((front, y, 0.0), (back, y, 0.5), (back, -y, 1.0), (front, -y, 1.5))
    outline = []
    for corner_x, corner_y, turn in corners:
        center_x = corner_x - np.sign(corner_x - (back + front) / 2) * radius
        center_y = corner_y - np.sign(corner_y) * radius
        for angle in np.pi * (turn + np.linspace(0.0, 0.5, 5)):
            outline.append((center_x + radius * np.cos(angle), center_y + radius * np.sin(angle)))
    return prism(outline, "z", low, high, look)


def _vents(
    rng: np.random.Generator,
    x: float,
    y: float,
    behind: float,
    top: float,
    trim: Material,
    dark: Material,
) -> tuple[Shape, ...]:
    """A raised block behind the hinge with slots in its back."""
    height = uniform(rng, (0.004, 0.008))
    block = box_between((-x, -0.85 * y, top), (-x + behind - 0.008, 0.85 * y, top + height), trim)
    slots = [
        box_between(
            (-x - 0.001, side * 0.45 * y - 0.2 * y, 0.4 * top),
            (-x, side * 0.45 * y + 0.2 * y, 0.85 * top),
            dark,
        )
        for side in (-1.0, 1.0)
    ]
    return (block, *slots)


def _bumpers(
    rng: np.random.Generator, x: float, y: float, top: float, trim: Material
) -> tuple[Shape, ...]:
    """Rubber at the corners, and on some a carrying handle below the lid's front."""
    r = 0.4 * top
    corners = [
        box_between((sx * x - r, sy * y - r, 0.001), (sx * x + r, sy * y + r, 0.8 * top), trim)
        for sx in (-1.0, 1.0)
        for sy in (-1.0, 1.0)
    ]
    if rng.random() < 0.5:
        return tuple(corners)
    reach, half = uniform(rng, (0.030, 0.040)), 0.35 * y
    arms = [
        box_between((x, s * half - 0.008, 0.004), (x + reach, s * half + 0.008, 0.6 * top), trim)
        for s in (-1.0, 1.0)
    ]
    bar = box_between((x + reach - 0.014, -half, 0.004), (x + reach, half, 0.6 * top), trim)
    return (*corners, *arms, bar)


def _keyboard(
    rng: np.random.Generator, x: float, y: float, top: float, dark: Material, pad: Material
) -> tuple[Shape, ...]:
    """Rows of keys and a touch pad, 1 mm proud of the base."""
    rows = int(rng.integers(4, 7))
    keys_back, keys_front = -0.62 * x, 0.15 * x
    pitch = (keys_front - keys_back) / rows
    keys = [
        box_between(
            (keys_back + i * pitch, -0.86 * y, top),
            (keys_back + (i + 0.82) * pitch, 0.86 * y, top + 0.001),
            dark,
        )
        for i in range(rows)
    ]
    touch_pad = box_between((0.3 * x, -0.3 * y, top), (0.85 * x, 0.3 * y, top + 0.0005), pad)
    return (*keys, touch_pad)


def _feet(x: float, y: float, material: Material) -> tuple[Shape, ...]:
    """Two strips of rubber, 2 mm high."""
    return tuple(
        box_between(
            (s * 0.8 * x - 0.008, -0.8 * y, 0.0), (s * 0.8 * x + 0.008, 0.8 * y, 0.002), material
        )
        for s in (-1.0, 1.0)
    )


def _logo(rng: np.random.Generator, x: float, top: float, material: Material) -> Shape:
    """A disc or a block in the middle of the lid, half a millimetre proud."""
    r = uniform(rng, (0.010, 0.022))
    if rng.random() < 0.5:
        return cylinder_along("z", (0.0, 0.0, top), r, 0.001, material)
    return box_between((-r, -1.5 * r, top), (r, 1.5 * r, top + 0.0005), material)


def _screen_color(rng: np.random.Generator) -> tuple[float, float, float]:
    """Black, or the blue of a lit desktop."""
    if rng.random() < 0.6:
        return (0.02, 0.02, 0.025)
    return (round(rng.uniform(0.05, 0.2), 3), round(rng.uniform(0.2, 0.4), 3), 0.6)
