"""Laptops: a base and a lid hinged at the back, revolute about -y (the front edge goes up)."""

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
)

FAMILIES = ("thin", "office", "thick")

_BASE_THICKNESS = {"thin": (0.010, 0.014), "office": (0.014, 0.020), "thick": (0.020, 0.030)}
_LID_THICKNESS = {"thin": (0.005, 0.007), "office": (0.006, 0.009), "thick": (0.009, 0.014)}


def make_laptop(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A laptop of 11 to 17 inches; the lid opens by 110-140 degrees."""
    family = str(rng.choice(FAMILIES))
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
    gap = 0.0015
    hinge = (-x + uniform(rng, (0.004, 0.012)), 0.0, base_top + gap)
    base = [
        box_between((-x, -y, 0.002), (x, y, base_top), shell),
        *_keyboard(rng, x, y, base_top, dark, darker(shell, 0.8)),
        *_feet(x, y, dark),
    ]
    low = base_top + gap
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
        attributes={"family": family, "handle": "edge"},
    )


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
