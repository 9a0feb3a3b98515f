"""Eyeglasses: a frame held at its bridge and two temples, revolute about near-vertical axes.

Laid out as worn: the lenses face +x, z is up, temple_1 hangs at the +y end, temple_2 at -y. At rest
both are folded behind the frame; they open backwards. Temple_1's hinge lies a little nearer to the
frame and higher than temple_2's, so that neither is in the other's way: at rest they lie one behind
the other, and when temple_1 opens alone it passes over temple_2.

Families: "rectangular", "round", "aviator" (drop-shaped, with a bar across), "cat_eye" (raised
outer corners), "half_rim" (a rim above the lenses only), "rimless". Handle: "temple" (the tips).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.objects.model import ArticulatedObject, Joint, Link, Material, Shape, Vector
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
from artgym.objects.procedural.stands import Mount, plate, post

Array = NDArray[np.floating]

FAMILIES = ("rectangular", "round", "aviator", "cat_eye", "half_rim", "rimless")
HANDLES = ("temple",)

#: Height of a lens as a share of its width.
_ASPECT = {
    "rectangular": (0.58, 0.74),
    "round": (0.90, 1.00),
    "aviator": (0.80, 0.92),
    "cat_eye": (0.66, 0.82),
    "half_rim": (0.56, 0.74),
    "rimless": (0.58, 0.80),
}
#: Squareness of the outline: 2 is an ellipse.
_SQUARENESS = {
    "rectangular": (4.0, 7.0),
    "round": (2.0, 2.1),
    "aviator": (2.3, 2.8),
    "cat_eye": (2.3, 3.0),
    "half_rim": (2.8, 5.0),
    "rimless": (2.3, 5.0),
}
#: Height of the hinges over the lens's middle, as a share of half its height.
_HINGE_HEIGHT = (0.50, 0.75)
#: Corners of a lens; few where the outline is nearly a rectangle.
_CORNERS = {"round": 12, "aviator": 12, "cat_eye": 12}
_FEW_CORNERS = 8


@dataclass(frozen=True, kw_only=True)
class _Form:
    """Sizes, metres; y from the middle plane, z from the lenses' middle, x from the lens's back.

    Attributes:
        half_width: of the whole front.
        lens_y: middle of a lens.
        lens: half width and half height of a lens.
        rim: thickness of the rim in the plane of the lenses; 0 without.
        depth: of the frame along x.
        hinges: (x, y, z) of temple_1's and of temple_2's, y counted outwards.
        temple: length of a temple along its bend.
        thickness: of a temple.
        root, tip: height of a temple at its two ends.
        drop: angle of its bent end, radians.
    """

    half_width: float
    lens_y: float
    lens: tuple[float, float]
    rim: float
    depth: float
    hinges: tuple[tuple[float, float, float], tuple[float, float, float]]
    temple: float
    thickness: float
    root: float
    tip: float
    drop: float


def make_eyeglasses(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """Glasses 0.125-0.150 m wide whose temples open by 85-95 degrees."""
    family = str(rng.choice(FAMILIES))
    wire = family in ("aviator", "rimless") or rng.random() < 0.4
    form = _draw_form(rng, family, wire)
    front = metal(rng) if wire else _plastic(rng)
    arms = front if rng.random() < 0.6 else (metal(rng) if wire else _plastic(rng))
    outline = _lens_outline(rng, family, form)
    frame = _frame(rng, family, form, outline, front)
    tips = _plastic(rng) if wire else darker(arms, 0.8)
    temples = [_temple(form, side, arms, tips) for side in (1.0, -1.0)]

    # Leaning forwards, the temples show above the frame.
    lean = matrix_from_axis_angle([0.0, uniform(rng, (0.0, 0.22)), 0.0])
    mount = Mount.over_origin((*frame, *temples[0], *temples[1]), lean, uniform(rng, (0.12, 0.17)))
    bridge = mount.point((0.5 * form.depth, 0.0, 0.3 * form.lens[1]))
    look = darker(metal(rng), 0.7)
    holder = with_role(
        "stand", (post(np.array(bridge), 0.0025, look), plate(rng, np.array(bridge), look))
    )

    friction = uniform(rng, (0.6, 1.0))
    links = [Link(name="frame", shapes=(*mount.shapes(frame), *holder), density=1500.0)]
    joints = []
    for k, (side, shapes) in enumerate(zip((1.0, -1.0), temples, strict=True), start=1):
        mass = uniform(rng, (0.010, 0.025))
        x, y, z = form.hinges[k - 1]
        links.append(
            Link(
                name=f"temple_{k}",
                shapes=mount.shapes(shapes),
                density=mass / sum(s.geometry.volume for s in shapes),
                friction=friction,
            )
        )
        joints.append(
            Joint(
                name=f"hinge_{k}",
                type="revolute",
                parent="frame",
                child=f"temple_{k}",
                axis=mount.direction((0.0, 0.0, -side)),
                pivot=mount.point((x, side * y, z)),
                closed=0.0,
                open=float(np.radians(uniform(rng, (85.0, 95.0)))),
                friction=uniform(rng, (0.6, 3.0)) * 0.9 * form.temple,
                damping=uniform(rng, (0.0005, 0.002)),
            )
        )
    return ArticulatedObject(
        object_id=object_id,
        category="eyeglasses",
        links=tuple(links),
        joints=tuple(joints),
        attributes={"family": family, "handle": "temple"},
    )


def _draw_form(rng: np.random.Generator, family: str, wire: bool) -> _Form:
    half_width = uniform(rng, (0.125, 0.148)) / 2
    rim = 0.0 if family == "rimless" else uniform(rng, (0.0014, 0.0024) if wire else (0.003, 0.006))
    bridge = uniform(rng, (0.015, 0.022))
    end = uniform(rng, (0.004, 0.010) if family == "round" else (0.003, 0.006))
    half_lens = (half_width - bridge / 2 - 2 * rim - end) / 2
    half_height = min(uniform(rng, _ASPECT[family]) * half_lens, 0.026)
    thickness = uniform(rng, (0.0018, 0.0026) if wire else (0.0026, 0.0040))
    root = uniform(rng, (0.003, 0.005) if wire else (0.005, 0.009))
    # One behind the other with 2 mm between.
    near = -0.0022 - thickness / 2
    far = near - thickness - 0.0020
    height = uniform(rng, _HINGE_HEIGHT) * half_height
    tip = uniform(rng, (0.003, 0.0045) if wire else (0.004, 0.006))
    # Temple_1 passes over temple_2.
    inset, apart = thickness / 2 + 0.001, 0.22 * (root + tip)
    return _Form(
        half_width=half_width,
        lens_y=bridge / 2 + rim + half_lens,
        lens=(half_lens, half_height),
        rim=rim,
        depth=uniform(rng, (0.0025, 0.0034) if wire else (0.0030, 0.0045)),
        hinges=(
            (near, half_width - inset, height + apart),
            (far, half_width - inset, height - apart),
        ),
        # The tips stand out beyond the frame's other end, where a hand can close around one.
        temple=float(np.clip(2 * half_width + uniform(rng, (0.006, 0.016)), 0.135, 0.150)),
        thickness=thickness,
        root=root,
        tip=tip,
        drop=uniform(rng, (0.35, 0.6)),
    )


def _lens_outline(rng: np.random.Generator, family: str, form: _Form) -> Array:
    """Corners (n, 2) of the lens at +y about its middle: y outwards, z up; convex."""
    a, b = form.lens
    count = _CORNERS.get(family, _FEW_CORNERS)
    angles = (np.arange(count) + 0.5) * 2 * np.pi / count
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.sign(circle) * np.abs(circle) ** (2.0 / uniform(rng, _SQUARENESS[family]))
    points /= np.abs(points).max(axis=0)
    y, z = points.T
    if family == "aviator":
        # Narrower below, and drawn outwards there.
        y = np.where(z < 0, y * (1 + 0.22 * z) - 0.12 * z, y)
    elif family == "cat_eye":
        z = z + np.where(z > 0, uniform(rng, (0.15, 0.3)) * y, 0.0)
    elif rng.random() < 0.5:
        y = y * (1 + uniform(rng, (0.0, 0.10)) * np.minimum(z, 0.0))
    return np.stack([a * y, b * z], axis=1)


def _frame(
    rng: np.random.Generator, family: str, form: _Form, outline: Array, look: Material
) -> tuple[Shape, ...]:
    """Lenses, rims, bridge, nose pads and the ends that bear the hinges."""
    glass = _glass(rng)
    middle, half_lens = form.depth / 2, min(0.0008, 0.3 * form.depth)
    shapes: list[Shape] = []
    for side, hinge in zip((1.0, -1.0), form.hinges, strict=True):
        corners = (outline + np.array([form.lens_y, 0.0])) * [side, 1.0]
        lens = [(float(y), float(z)) for y, z in corners]
        shapes.append(prism(lens, "x", middle - half_lens, middle + half_lens, glass))
        if family != "rimless":
            shapes += _rim(family, form, outline, side, look)
        shapes += _end(form, outline, hinge, side, look)
    shapes += _bridge(rng, family, form, look)
    pad = Material(color=(0.80, 0.78, 0.72), roughness=0.3)
    z = -0.4 * form.lens[1]
    for side in (1.0, -1.0):
        y = side * (form.lens_y - form.lens[0] - form.rim + 0.001)
        block = box_between((-0.005, y - 0.0012, z - 0.004), (0.0, y + 0.0012, z + 0.004), pad)
        shapes.append(turned(block, (1.0, 0.0, 0.0), (0.0, y, z), side * 0.35))
    return tuple(shapes)


def _rim(
    family: str, form: _Form, outline: Array, side: float, look: Material
) -> tuple[Shape, ...]:
    """Blocks around a lens, above its middle only for a half rim."""
    line = outline * (1 + form.rim / 2 / np.array(form.lens))
    pieces = []
    for start, end in zip(line, np.roll(line, -1, axis=0), strict=True):
        if family == "half_rim" and (start[1] + end[1]) / 2 < -0.1 * form.lens[1]:
            continue
        y, z = (start + end) / 2 * [side, 1.0] + [side * form.lens_y, 0.0]
        # Blocks that meet at an angle close the outer side of the bend.
        half_length = float(np.linalg.norm(end - start)) / 2 + 0.13 * form.rim
        block = box_between(
            (0.0, y - half_length, z - form.rim / 2),
            (form.depth, y + half_length, z + form.rim / 2),
            look,
        )
        along = (end - start) * [side, 1.0]
        angle = float(np.arctan2(along[1], along[0]))
        pieces.append(turned(block, (1.0, 0.0, 0.0), (0.0, float(y), float(z)), angle))
    return tuple(pieces)


def _end(
    form: _Form, outline: Array, hinge: Vector, side: float, look: Material
) -> tuple[Shape, ...]:
    """What joins a rim to its hinge: a piece outwards and one backwards."""
    hinge_x, hinge_y, hinge_z = hinge
    outer = outline[outline[:, 0] > 0.2 * form.lens[0]]
    outer = outer[np.argsort(outer[:, 1])]
    edge = form.lens_y + float(np.interp(hinge_z, outer[:, 1], outer[:, 0]))
    half = max(0.4 * form.root, 0.0012)
    pieces = (
        ((0.0, edge - 0.0015), (form.depth, form.half_width)),
        ((hinge_x - form.thickness / 2, hinge_y - 0.0010), (0.0005, form.half_width)),
    )
    shapes = []
    for (x0, y0), (x1, y1) in pieces:
        low, high = sorted((side * y0, side * y1))
        shapes.append(box_between((x0, low, hinge_z - half), (x1, high, hinge_z + half), look))
    return tuple(shapes)


def _bridge(
    rng: np.random.Generator, family: str, form: _Form, look: Material
) -> tuple[Shape, ...]:
    """A piece between the lenses; aviators have a second one along the upper rims."""
    inner = form.lens_y - 0.9 * form.lens[0]
    z, half = uniform(rng, (0.2, 0.45)) * form.lens[1], max(0.0012, 0.5 * form.rim)
    low, high = z - half, z + half
    shapes = [box_between((0.0, -inner, low), (form.depth, inner, high), look)]
    if family == "aviator":
        reach, z = form.lens_y - 0.2 * form.lens[0], 0.97 * form.lens[1] + form.rim / 2
        shapes.append(cylinder_along("y", (form.depth / 2, 0.0, z), 0.0012, 2 * reach, look))
    return tuple(shapes)


def _temple(form: _Form, side: float, look: Material, tips: Material) -> tuple[Shape, ...]:
    """A folded temple from its hinge towards the other end; its bent end is the handle."""
    x, y, z = form.hinges[0 if side > 0 else 1]
    low, high = x - form.thickness / 2, x + form.thickness / 2
    # Distance along the temple, height of its middle and half its height at the bends.
    straight, first = 0.68 * form.temple, 0.014
    rest = form.temple - straight - first
    waist = 0.6 * form.root + 0.4 * form.tip
    stations = [(0.0025, 0.0, form.root / 2), (straight, 0.0, waist / 2)]
    for length, slope, height in (
        (first, 0.5 * form.drop, form.tip),
        (rest, form.drop, 0.9 * form.tip),
    ):
        s, dz, _ = stations[-1]
        stations.append((s + length * np.cos(slope), dz - length * np.sin(slope), height / 2))
    pieces = []
    for (s0, z0, h0), (s1, z1, h1) in pairwise(stations):
        ends = [(s0, z0 - h0), (s1 + 0.0005, z1 - h1), (s1 + 0.0005, z1 + h1), (s0, z0 + h0)]
        outline = [(side * (y - s), z + dz) for s, dz in ends]
        pieces.append(prism(outline, "x", low, high, tips if len(pieces) else look))
    knuckle = cylinder_along(
        "z", (x, side * y, z), min(form.thickness / 2, 0.0016), form.root, darker(look, 0.5)
    )
    root = box_between(
        (low, *sorted((side * y, side * (y - 0.003)))[:1], z - 0.3 * form.root),
        (high, *sorted((side * y, side * (y - 0.003)))[1:], z + 0.3 * form.root),
        look,
    )
    return (knuckle, root, pieces[0], *with_role("handle", pieces[1:]))


def _plastic(rng: np.random.Generator) -> Material:
    """Black, the browns of horn and tortoiseshell, or a colour."""
    kind = rng.random()
    if kind < 0.45:
        shade = uniform(rng, (0.01, 0.05))
        return Material(color=(shade, shade, shade), roughness=0.3)
    if kind < 0.65:
        shade = uniform(rng, (0.08, 0.25))
        return Material(color=(shade, 0.5 * shade, 0.22 * shade), roughness=0.3)
    return painted(rng)


def _glass(rng: np.random.Generator) -> Material:
    """Dark or tinted as of sunglasses, or as pale as what lies behind clear ones."""
    kind = rng.random()
    if kind < 0.35:
        shade = uniform(rng, (0.01, 0.06))
        return Material(color=(shade, shade, shade), roughness=0.1)
    if kind < 0.5:
        shade = uniform(rng, (0.10, 0.30))
        return Material(color=(shade, 0.6 * shade, 0.3 * shade), roughness=0.1)
    shade = uniform(rng, (0.55, 0.8))
    return Material(color=(0.93 * shade, shade, 1.05 * shade), roughness=0.1)
