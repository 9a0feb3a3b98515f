"""Colours that stand for numbers and names; all are sRGB bytes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.datasets.drawing import Color
from artgym.objects.model import Link

#: From little to much: dark blue over green to yellow, equally bright steps.
_RAMP = np.array(
    [
        (68, 1, 84),
        (71, 44, 122),
        (59, 81, 139),
        (44, 113, 142),
        (33, 144, 141),
        (39, 173, 129),
        (92, 200, 99),
        (170, 220, 50),
        (253, 231, 37),
    ],
    dtype=float,
)

#: Affordance: a point where some try succeeds, where none does, and where nothing is known.
GRASPABLE: Color = (235, 60, 30)
NOT_GRASPABLE: Color = (40, 80, 220)
UNKNOWN: Color = (150, 150, 150)

GRASP: Color = (0, 150, 70)
JOINT: Color = (230, 90, 0)
PATH: Color = (120, 60, 200)
#: x, y and z of a frame.
AXES: tuple[Color, ...] = ((220, 40, 40), (40, 160, 40), (40, 80, 230))
#: Objects of a picture in their order; they repeat beyond the last.
INSTANCES: tuple[Color, ...] = (
    (0, 158, 115),
    (213, 94, 0),
    (0, 114, 178),
    (204, 121, 167),
    (230, 190, 0),
)


def ramp(values: ArrayLike) -> NDArray[np.uint8]:
    """Colours (..., 3) of numbers (...), from 0, dark blue, to 1, yellow; others are clipped."""
    places = np.clip(np.asarray(values, dtype=float), 0.0, 1.0) * (len(_RAMP) - 1)
    known = np.arange(len(_RAMP))
    channels = [np.interp(places, known, _RAMP[:, c]) for c in range(3)]
    return np.stack(channels, axis=-1).round().astype(np.uint8)


def piece_colors(link: Link) -> NDArray[np.uint8]:
    """Colours (n, 3) of the pieces of a link, in the order of ``meshes.link_triangles``."""
    linear = np.array([piece.material.color for piece in link.visuals or link.shapes], dtype=float)
    return (np.clip(linear, 0.0, 1.0) ** (1 / 2.2) * 255).round().astype(np.uint8)
