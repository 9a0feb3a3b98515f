"""Handles of drawers and doors: they stand out of a front that faces +x.

Fingertips are about 22 mm wide and 14 mm thick, so a bar's far side stands at least 24 mm clear.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from artgym.objects.model import Material, Shape
from artgym.objects.procedural.shapes import box_between, cylinder_along, uniform, with_role


def bar_at(
    rng: np.random.Generator,
    face: float,
    y: float,
    z: float,
    along: Literal["y", "z"],
    length: float,
    look: Material,
) -> tuple[Shape, ...]:
    """A round or square bar on two posts.

    Args:
        rng: draws thickness, clearance and form.
        face: x of the front's face, metres.
        y: of the bar's middle.
        z: of the bar's middle.
        along: its direction.
        length: from end to end.
        look: how it looks.
    """
    return _bar(rng, face, y, z, along, length, uniform(rng, (0.008, 0.014)), look)


def _bar(
    rng: np.random.Generator,
    face: float,
    y: float,
    z: float,
    along: Literal["y", "z"],
    length: float,
    thickness: float,
    look: Material,
    center: float | None = None,
) -> tuple[Shape, ...]:
    if center is None:
        center = face + uniform(rng, (0.024, 0.036)) + thickness / 2
    direction = np.array([0.0, 0.0, 1.0] if along == "z" else [0.0, 1.0, 0.0])
    middle = np.array([center, y, z])
    if rng.random() < 0.5:
        bar = cylinder_along(along, middle, thickness / 2, length, look)
    else:
        half = np.full(3, thickness / 2) + direction * (length - thickness) / 2
        bar = box_between(tuple(middle - half), tuple(middle + half), look)
    posts = []
    for side in (-1.0, 1.0):
        foot = middle + direction * side * (length / 2 - thickness)
        reach = center - face
        posts.append(
            cylinder_along("x", (face + reach / 2, foot[1], foot[2]), 0.4 * thickness, reach, look)
        )
    return with_role("handle", (bar, *posts))


def knob_at(
    rng: np.random.Generator, face: float, y: float, z: float, look: Material
) -> tuple[Shape, ...]:
    """A disc or a block on a stem; arguments as of ``bar_at``."""
    return _knob(rng, face, y, z, _knob_sizes(rng), look)


def _knob_sizes(rng: np.random.Generator) -> tuple[float, float, float]:
    """Lengths of stem and head, radius of the head, metres."""
    stem, head = uniform(rng, (0.016, 0.026)), uniform(rng, (0.010, 0.018))
    return stem, head, uniform(rng, (0.011, 0.020))


def _knob(
    rng: np.random.Generator,
    face: float,
    y: float,
    z: float,
    sizes: tuple[float, float, float],
    look: Material,
) -> tuple[Shape, ...]:
    stem, head, radius = sizes
    stem_shape = cylinder_along("x", (face + stem / 2, y, z), 0.5 * radius, stem, look)
    if rng.random() < 0.6:
        head_shape = cylinder_along("x", (face + stem + head / 2, y, z), radius, head, look)
    else:
        r = 0.85 * radius
        head_shape = box_between(
            (face + stem, y - r, z - r), (face + stem + head, y + r, z + r), look
        )
    return with_role("handle", (head_shape, stem_shape))


def cup_at(
    rng: np.random.Generator, face: float, y: float, z: float, length: float, look: Material
) -> tuple[Shape, ...]:
    """A shell that is open below: a front plate, two cheeks and a roof; arguments as ``bar_at``."""
    reach, height = uniform(rng, (0.026, 0.034)), uniform(rng, (0.028, 0.040))
    wall = uniform(rng, (0.003, 0.005))
    low, high = z - height / 2, z + height / 2
    left, right = y - length / 2, y + length / 2
    return with_role(
        "handle",
        (
            box_between((face + reach - wall, left, low), (face + reach, right, high), look),
            box_between((face, left, low), (face + reach - wall, left + wall, high), look),
            box_between((face, right - wall, low), (face + reach - wall, right, high), look),
            box_between(
                (face, left + wall, high - wall), (face + reach - wall, right - wall, high), look
            ),
        ),
    )


def bar(
    rng: np.random.Generator, face: float, width: float, z: float, height: float, look: Material
) -> tuple[Shape, ...]:
    """A bar about the front's middle, lying or upright."""
    upright = rng.random() < 0.3
    room = height - 0.03 if upright else width - 0.05
    length = min(uniform(rng, (0.07, 0.18)), room)
    thickness = uniform(rng, (0.008, 0.014))
    center = face + uniform(rng, (0.024, 0.036)) + thickness / 2
    y = 0.0 if upright else uniform(rng, (-0.2, 0.2)) * (width - length)
    return _bar(rng, face, y, z, "z" if upright else "y", length, thickness, look, center)


def knob(
    rng: np.random.Generator, face: float, width: float, z: float, height: float, look: Material
) -> tuple[Shape, ...]:
    """A knob about the front's middle."""
    sizes = _knob_sizes(rng)
    y = uniform(rng, (-0.15, 0.15)) * width
    return _knob(rng, face, y, z, sizes, look)


def ledge(
    rng: np.random.Generator, face: float, width: float, z: float, height: float, look: Material
) -> tuple[Shape, ...]:
    """A plate that stands out of the front, at the middle or above it."""
    length = min(uniform(rng, (0.08, 0.25)), width - 0.02)
    thickness, reach = uniform(rng, (0.006, 0.012)), uniform(rng, (0.026, 0.040))
    z = z + uniform(rng, (0.0, 0.3)) * height
    plate = box_between(
        (face, -length / 2, z - thickness / 2), (face + reach, length / 2, z + thickness / 2), look
    )
    return with_role("handle", (plate,))


#: Makes a handle of a drawer: random numbers, x of the front's face, the front's width, the height
#: of its middle, its height, and how the handle looks.
HandleMaker = Callable[
    [np.random.Generator, float, float, float, float, Material], tuple[Shape, ...]
]

HANDLE_MAKERS: dict[str, HandleMaker] = {"bar": bar, "knob": knob, "ledge": ledge}


def ledge_at(
    rng: np.random.Generator, face: float, y: float, z: float, length: float, look: Material
) -> tuple[Shape, ...]:
    """A plate that stands out of the front, with or without a small rim; arguments as ``bar_at``.

    One of up to 70 mm can also be taken by its two ends.
    """
    thickness, reach = uniform(rng, (0.005, 0.010)), uniform(rng, (0.026, 0.036))
    left, right = y - length / 2, y + length / 2
    low, high = z - thickness / 2, z + thickness / 2
    shapes = [box_between((face, left, low), (face + reach, right, high), look)]
    if rng.random() < 0.5:
        rim = uniform(rng, (0.003, 0.007))
        shapes.append(
            box_between((face + reach - 0.005, left, low - rim), (face + reach, right, low), look)
        )
    return with_role("handle", shapes)


def small_knob_at(
    rng: np.random.Generator, face: float, y: float, z: float, look: Material
) -> tuple[Shape, ...]:
    """A knob for a desk-top drawer, 12 to 22 mm across; arguments as of ``bar_at``."""
    sizes = uniform(rng, (0.014, 0.020)), uniform(rng, (0.009, 0.013)), uniform(rng, (0.006, 0.011))
    return _knob(rng, face, y, z, sizes, look)


def small_bar_at(
    rng: np.random.Generator,
    face: float,
    y: float,
    z: float,
    along: Literal["y", "z"],
    length: float,
    look: Material,
) -> tuple[Shape, ...]:
    """A bar for a desk-top drawer, 5 to 8 mm thick; arguments as of ``bar_at``."""
    thickness = uniform(rng, (0.005, 0.008))
    center = face + uniform(rng, (0.022, 0.028)) + thickness / 2
    return _bar(rng, face, y, z, along, length, thickness, look, center)
