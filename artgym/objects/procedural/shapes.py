"""Primitives and materials that the categories share."""

from __future__ import annotations

import colorsys
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import cast

import numpy as np

from artgym.geometry.rotations import cross, matrix_from_axis_angle
from artgym.objects.model import (
    Box,
    Convex,
    Cylinder,
    Material,
    Role,
    Shape,
    Texture,
    Vector,
)

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


def convex(points: Iterable[Iterable[float]], material: Material) -> Shape:
    """The convex hull of points (n, 3), n <= 64, in the link's frame, metres."""
    rows = points.tolist() if isinstance(points, np.ndarray) else points
    corners = cast(tuple[Vector, ...], tuple(tuple(map(float, p)) for p in rows))
    return Shape(geometry=Convex(points=corners), position=(0.0, 0.0, 0.0), material=material)


def prism(
    outline: Sequence[tuple[float, float]],
    axis: str,
    low: float,
    high: float,
    material: Material,
) -> Shape:
    """A convex outline swept along "x", "y" or "z" from ``low`` to ``high``; link's frame, metres.

    Outlines are in the other two axes, in the order x, y, z: (y, z), (x, z) or (x, y). At most 32
    points.
    """
    at = "xyz".index(axis)
    flat = np.asarray(outline, dtype=float)
    ends = [np.insert(flat, at, end, axis=1) for end in (low, high)]
    return convex(np.concatenate(ends), material)


def frustum(
    axis: str,
    foot: Iterable[float],
    low: tuple[float, float],
    high: tuple[float, float],
    length: float,
    material: Material,
    sides: int = 20,
) -> Shape:
    """A tapered round or oval body along "x", "y" or "z"; link's frame, metres.

    Args:
        axis: its direction.
        foot: the middle of its lower end.
        low: half axes of the lower ellipse, in the order of the other two axes.
        high: half axes of the upper one.
        length: from end to end.
        material: how it looks.
        sides: corners of each ellipse, at most 32.
    """
    at = "xyz".index(axis)
    angles = np.arange(sides) * 2 * np.pi / sides
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.concatenate(
        [
            np.insert(ring * np.asarray(low), at, 0.0, axis=1),
            np.insert(ring * np.asarray(high), at, length, axis=1),
        ]
    )
    return convex(points + np.asarray(tuple(foot), dtype=float), material)


def tube(
    path: Iterable[Iterable[float]],
    radii: float | Sequence[float],
    material: Material,
    sides: int = 14,
    flatness: float = 1.0,
) -> tuple[Shape, ...]:
    """A bent bar: one convex piece a stretch, mitred where two meet.

    Args:
        path: corners (n, 3) of its middle line, n >= 2, none of them a sharp turn back; metres.
        radii: at the corners, or one for all.
        material: how it looks.
        sides: corners of its cross-section, at most 32.
        flatness: height of the cross-section by its width; 1 is round. Flat sides lie across
            the plane of the first bend, or are level in a straight bar.
    """
    corners = np.asarray([tuple(point) for point in path], dtype=float)
    radius = np.broadcast_to(np.asarray(radii, dtype=float), len(corners))
    stretch = np.diff(corners, axis=0)
    along = stretch / np.linalg.norm(stretch, axis=1, keepdims=True)
    # Mitre planes: across the middle direction of the two stretches that meet.
    mitres = np.concatenate([along[:1], along[:-1] + along[1:], along[-1:]])
    across = _across(along)
    angles = (np.arange(sides) + 0.5) * 2 * np.pi / sides
    pieces = []
    for i, d in enumerate(along):
        up = cross(d, across)
        ring = np.cos(angles)[:, None] * across + flatness * np.sin(angles)[:, None] * up
        ends = []
        for at in (i, i + 1):
            n = mitres[at]
            arm = ring * radius[at]
            ends.append(corners[at] + arm - np.outer(arm @ n / (d @ n), d))
        pieces.append(convex(np.concatenate(ends), material))
        if i + 1 < len(along):
            across = _carried_over(across, d, along[i + 1])
    return tuple(pieces)


def _across(along: np.ndarray) -> np.ndarray:
    """Unit direction (3,) across the plane of the first bend of directions (n, 3)."""
    for d, e in pairwise(along):
        normal = cross(d, e)
        if np.linalg.norm(normal) > 1e-6:
            return normal / np.linalg.norm(normal)
    d = along[0]
    level = cross([0.0, 0.0, 1.0], d)
    if np.linalg.norm(level) < 1e-6:
        return np.array([0.0, 1.0, 0.0])
    return level / np.linalg.norm(level)


def _carried_over(across: np.ndarray, d: np.ndarray, e: np.ndarray) -> np.ndarray:
    """A direction across d, turned with d into e by the smallest turn."""
    middle = d + e
    # Reflected along the middle direction d becomes -e, reflected along e that becomes e.
    mirrored = across - 2 * (across @ middle) / (middle @ middle) * middle
    return mirrored - 2 * (mirrored @ e) * e


def arc(
    center: Iterable[float],
    start: Iterable[float],
    towards: Iterable[float],
    angle: float,
    count: int,
) -> np.ndarray:
    """Points (count + 1, 3) of a circular or elliptic arc, metres.

    Args:
        center: its centre.
        start: from the centre to its first point.
        towards: from the centre to the point a quarter turn on.
        angle: radians covered.
        count: stretches.
    """
    turn = np.linspace(0.0, angle, count + 1)[:, None]
    return (
        np.asarray(tuple(center), dtype=float)
        + np.cos(turn) * np.asarray(tuple(start), dtype=float)
        + np.sin(turn) * np.asarray(tuple(towards), dtype=float)
    )


def turned(shape: Shape, axis: Vector, pivot: Vector, angle: float) -> Shape:
    """The shape turned by ``angle`` radians about a line of its link's frame."""
    R = matrix_from_axis_angle(np.asarray(axis, dtype=float) * angle)
    pivot_ = np.asarray(pivot, dtype=float)
    position = pivot_ + R @ (np.asarray(shape.position, dtype=float) - pivot_)
    rotation = R @ np.asarray(shape.rotation, dtype=float)
    return replace(
        shape,
        position=cast(Vector, tuple(position.tolist())),
        rotation=cast("tuple[Vector, Vector, Vector]", tuple(map(tuple, rotation.tolist()))),
    )


def with_role(role: Role, shapes: Iterable[Shape]) -> tuple[Shape, ...]:
    """The shapes, marked as "handle", "stand" or "body"."""
    return tuple(replace(shape, role=role) for shape in shapes)


def uniform(rng: np.random.Generator, interval: Interval) -> float:
    """One number from an interval."""
    return float(rng.uniform(*interval))


def _color(hue: float, saturation: float, value: float) -> tuple[float, float, float]:
    r, g, b = colorsys.hsv_to_rgb(hue % 1.0, min(saturation, 1.0), min(value, 1.0))
    return (round(r, 4), round(g, 4), round(b, 4))


#: What may cover a material: pattern (None: plain), weight, and the interval of its tile, metres.
_Cover = tuple[str | None, float, Interval]

#: How many forms of each pattern are in use; each is drawn once a process.
_PATTERN_SEEDS = 12

_WOOD_COVERS: tuple[_Cover, ...] = (
    ("grain", 0.5, (0.18, 0.36)),
    ("fine_grain", 0.38, (0.15, 0.30)),
    (None, 0.12, (0.0, 0.0)),
)
_PAINT_COVERS: tuple[_Cover, ...] = (
    (None, 0.6, (0.0, 0.0)),
    ("speckle", 0.17, (0.07, 0.12)),
    ("orange_peel", 0.15, (0.08, 0.15)),
    ("worn", 0.08, (0.25, 0.45)),
)
_METAL_COVERS: tuple[_Cover, ...] = (
    (None, 0.45, (0.0, 0.0)),
    ("brushed", 0.4, (0.12, 0.25)),
    ("speckle", 0.08, (0.07, 0.12)),
    ("worn", 0.07, (0.2, 0.4)),
)


def _covered(material: Material, covers: Sequence[_Cover]) -> Material:
    """The material with a texture that follows from its numbers.

    Nothing is drawn for it: the forms of objects come from the same stream of random numbers.
    """
    number = zlib.crc32(repr((material.color, material.roughness)).encode())
    number, choice = divmod(number, 1000)
    number, seed = divmod(number, _PATTERN_SEEDS)
    share = choice / 1000
    for pattern, weight, (low, high) in covers:
        if share < weight:
            if pattern is None:
                return material
            tile = round(low + (high - low) * (number % 100) / 100, 4)
            return with_texture(material, pattern, tile, seed)
        share -= weight
    return material


def with_texture(material: Material, pattern: str, tile: float, seed: int = 0) -> Material:
    """The material with a pattern of ``textures.PATTERNS`` that repeats after ``tile`` metres."""
    return replace(material, texture=Texture(pattern=pattern, seed=seed, tile=tile))


def wood(rng: np.random.Generator) -> Material:
    """Brown to pale yellow, matt, most with grain."""
    color = _color(rng.uniform(0.04, 0.12), rng.uniform(0.25, 0.65), rng.uniform(0.25, 0.85))
    return _covered(Material(color=color, roughness=uniform(rng, (0.5, 0.9))), _WOOD_COVERS)


def painted(rng: np.random.Generator) -> Material:
    """Any hue, white and grey among them; most plain, some powder-coated or worn."""
    saturation = 0.0 if rng.random() < 0.35 else rng.uniform(0.1, 0.7)
    material = Material(
        color=_color(rng.random(), saturation, rng.uniform(0.15, 0.95)),
        roughness=uniform(rng, (0.3, 0.8)),
    )
    return _covered(material, _PAINT_COVERS)


def metal(rng: np.random.Generator) -> Material:
    """Steel, brass, dark anodised; plain or brushed."""
    warm = rng.random() < 0.25
    color = _color(
        0.11, rng.uniform(0.3, 0.6) if warm else rng.uniform(0, 0.06), rng.uniform(0.15, 0.85)
    )
    material = Material(
        color=color, roughness=uniform(rng, (0.25, 0.6)), metallic=uniform(rng, (0.3, 0.9))
    )
    return _covered(material, _METAL_COVERS)


def plastic(rng: np.random.Generator) -> Material:
    """Moulded: black, grey, white or bright, glossy to matt."""
    if rng.random() < 0.5:
        value = float(rng.choice((0.03, 0.06, 0.2, 0.5, 0.85))) * rng.uniform(0.9, 1.1)
        color = _color(0.6, rng.uniform(0.0, 0.08), value)
    else:
        color = _color(rng.random(), rng.uniform(0.45, 0.9), rng.uniform(0.25, 0.85))
    material = Material(color=color, roughness=uniform(rng, (0.25, 0.7)))
    covers = ((None, 0.6, (0.0, 0.0)), ("speckle", 0.3, (0.05, 0.08)), ("ribs", 0.1, (0.04, 0.08)))
    return _covered(material, covers)


def cardboard(rng: np.random.Generator) -> Material:
    """Brown corrugated board, sometimes bleached."""
    color = _color(rng.uniform(0.07, 0.10), rng.uniform(0.3, 0.55), rng.uniform(0.35, 0.65))
    if rng.random() < 0.15:
        color = _color(0.1, rng.uniform(0.02, 0.1), rng.uniform(0.7, 0.85))
    material = Material(color=color, roughness=uniform(rng, (0.85, 1.0)))
    return _covered(material, (("cardboard", 1.0, (0.12, 0.2)),))


def leather(rng: np.random.Generator) -> Material:
    """Brown, black, red or green, with creases."""
    hue = float(rng.choice((0.03, 0.06, 0.08, 0.99, 0.35)))
    color = _color(hue, rng.uniform(0.3, 0.7), rng.uniform(0.05, 0.45))
    material = Material(color=color, roughness=uniform(rng, (0.4, 0.65)))
    return _covered(material, (("leather", 1.0, (0.08, 0.14)),))


def fabric(rng: np.random.Generator) -> Material:
    """Woven or felted cloth of any hue, matt."""
    color = _color(rng.random(), rng.uniform(0.05, 0.6), rng.uniform(0.1, 0.75))
    material = Material(color=color, roughness=uniform(rng, (0.85, 1.0)))
    covers = (
        ("weave", 0.45, (0.05, 0.10)),
        ("twill", 0.3, (0.05, 0.10)),
        ("felt", 0.25, (0.08, 0.16)),
    )
    return _covered(material, covers)


def ceramic(rng: np.random.Generator) -> Material:
    """Glazed: white, cream, sometimes pastel or black; glossy."""
    kind = rng.random()
    if kind < 0.75:
        color = _color(0.12, rng.uniform(0.0, 0.10), rng.uniform(0.75, 0.92))
    elif kind < 0.9:
        color = _color(rng.random(), rng.uniform(0.1, 0.3), rng.uniform(0.55, 0.8))
    else:
        color = _color(0.6, rng.uniform(0.0, 0.1), rng.uniform(0.03, 0.08))
    return Material(color=color, roughness=uniform(rng, (0.15, 0.3)))


def stone(rng: np.random.Generator) -> Material:
    """Granite, marble, concrete, terrazzo."""
    color = _color(rng.uniform(0.05, 0.15), rng.uniform(0.0, 0.2), rng.uniform(0.12, 0.8))
    material = Material(color=color, roughness=uniform(rng, (0.2, 0.7)))
    covers = (
        ("granite", 0.35, (0.12, 0.22)),
        ("marble", 0.3, (0.3, 0.5)),
        ("concrete", 0.2, (0.3, 0.5)),
        ("terrazzo", 0.15, (0.2, 0.35)),
    )
    return _covered(material, covers)


def rubber(rng: np.random.Generator) -> Material:
    """Nearly black, matt."""
    value = rng.uniform(0.02, 0.08)
    return Material(color=_color(0.6, 0.05, value), roughness=uniform(rng, (0.8, 1.0)))


def dark_glass(rng: np.random.Generator) -> Material:
    """An oven's or a microwave's pane: nearly black, glossy."""
    color = _color(rng.uniform(0.5, 0.7), rng.uniform(0.0, 0.3), rng.uniform(0.015, 0.06))
    return Material(color=color, roughness=uniform(rng, (0.05, 0.15)))


def carbon_fiber(rng: np.random.Generator) -> Material:
    """Black twill under lacquer."""
    value = rng.uniform(0.04, 0.09)
    material = Material(color=_color(0.6, 0.03, value), roughness=uniform(rng, (0.2, 0.4)))
    return _covered(material, (("carbon", 1.0, (0.04, 0.07)),))


def wicker(rng: np.random.Generator) -> Material:
    """Woven cane: straw to dark brown."""
    color = _color(rng.uniform(0.06, 0.11), rng.uniform(0.3, 0.6), rng.uniform(0.2, 0.7))
    material = Material(color=color, roughness=uniform(rng, (0.7, 0.95)))
    return _covered(material, (("wicker", 1.0, (0.12, 0.2)),))


def darker(material: Material, factor: float) -> Material:
    """The same material with its colour scaled."""
    r, g, b = material.color
    return replace(material, color=(r * factor, g * factor, b * factor))
