"""Primitives and materials that the categories share."""

from __future__ import annotations

import colorsys
from collections.abc import Iterable
from typing import cast

import numpy as np

from artgym.objects.model import Box, Cylinder, Material, Shape, Vector

Interval = tuple[float, float]

#: Rows of a rotation that lays a cylinder's axis (x) along the named axis.
_CYLINDER_AXES: dict[str, tuple[Vector, Vector, Vector]] = {
    "x": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "y": ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    "z": ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
}


def box_between(low: tuple[float, ...], high: tuple[float, ...], material: Material) -> Shape:
    """A cuboid given by two opposite corners in the link's frame, metres."""
    low_, high_ = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    half = (high_ - low_) / 2
    center = (high_ + low_) / 2
    return Shape(
        geometry=Box(half_size=tuple(half.tolist())),
        position=tuple(center.tolist()),
        material=material,
    )


def cylinder_along(
    axis: str, center: Iterable[float], radius: float, length: float, material: Material
) -> Shape:
    """A cylinder along "x", "y" or "z" of the link's frame, metres."""
    return Shape(
        geometry=Cylinder(radius=float(radius), half_length=float(length) / 2),
        position=cast(Vector, tuple(float(c) for c in center)),
        rotation=_CYLINDER_AXES[axis],
        material=material,
    )


def uniform(rng: np.random.Generator, interval: Interval) -> float:
    """One number from an interval."""
    return float(rng.uniform(*interval))


def _color(hue: float, saturation: float, value: float) -> tuple[float, float, float]:
    r, g, b = colorsys.hsv_to_rgb(hue % 1.0, min(saturation, 1.0), min(value, 1.0))
    return (round(r, 4), round(g, 4), round(b, 4))


def wood(rng: np.random.Generator) -> Material:
    """Brown to pale yellow, matt."""
    color = _color(rng.uniform(0.04, 0.12), rng.uniform(0.25, 0.65), rng.uniform(0.25, 0.85))
    return Material(color=color, roughness=uniform(rng, (0.5, 0.9)))


def painted(rng: np.random.Generator) -> Material:
    """Any hue, white and grey among them."""
    saturation = 0.0 if rng.random() < 0.35 else rng.uniform(0.1, 0.7)
    return Material(
        color=_color(rng.random(), saturation, rng.uniform(0.15, 0.95)),
        roughness=uniform(rng, (0.3, 0.8)),
    )


def metal(rng: np.random.Generator) -> Material:
    """Steel, brass, dark anodised."""
    warm = rng.random() < 0.25
    color = _color(
        0.11, rng.uniform(0.3, 0.6) if warm else rng.uniform(0, 0.06), rng.uniform(0.15, 0.85)
    )
    return Material(
        color=color, roughness=uniform(rng, (0.25, 0.6)), metallic=uniform(rng, (0.3, 0.9))
    )


def darker(material: Material, factor: float) -> Material:
    """The same material with its colour scaled."""
    r, g, b = material.color
    return Material(
        color=(r * factor, g * factor, b * factor),
        roughness=material.roughness,
        metallic=material.metallic,
    )
