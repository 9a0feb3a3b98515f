"""Toilets: a bowl with a seat, and an oval lid hinged behind it.

Families: "close_coupled" (a tank on the bowl), "wall_hung" (the bowl hangs on a panel), "skirted"
(closed sides down to the floor, a low tank), "valve" (no tank, a flushing pipe). Handles: "lip"
(the lid reaches forward over the seat), "tab" (a tongue at its front).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from artgym.objects.model import ArticulatedObject, Link, Material, Shape
from artgym.objects.procedural.lids import GAP, Outline, hinge, lid_link, lip, ring_wall
from artgym.objects.procedural.shapes import (
    box_between,
    ceramic,
    convex,
    cylinder_along,
    darker,
    painted,
    plastic,
    stone,
    uniform,
    with_texture,
    wood,
)

FAMILIES = ("close_coupled", "wall_hung", "skirted", "valve")
HANDLES = ("lip", "tab")

#: Panels around the basin and around the seat, corners of what is round without panels.
_PANELS, _SEAT_PANELS, _SIDES = 8, 10, 16
_CHROME = Material(color=(0.62, 0.63, 0.64), roughness=0.2, metallic=0.9)
_WATER = Material(color=(0.30, 0.42, 0.46), roughness=0.1)


def make_toilet(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A toilet of real size, about 0.38 x 0.68 x 0.75 m; the lid opens by 90-105 degrees."""
    family = str(rng.choice(FAMILIES, p=(0.4, 0.2, 0.25, 0.15)))
    handle = str(rng.choice(HANDLES, p=(0.65, 0.35)))
    width, length = uniform(rng, (0.34, 0.40)), uniform(rng, (0.40, 0.47))
    rim = uniform(rng, (0.36, 0.42))
    tank_depth = uniform(rng, (0.15, 0.19))
    clearance = uniform(rng, (0.055, 0.08))
    squareness = uniform(rng, (2.6, 4.0))
    porcelain = _porcelain(rng)
    seat_look = _seat_look(rng, porcelain)
    lid_look = seat_look if rng.random() < 0.85 else _seat_look(rng, porcelain)

    depth = length + clearance + tank_depth
    pivot_x = -depth / 2 + tank_depth + clearance
    oval = _Oval(
        center=pivot_x + 0.45 * length,
        front=0.55 * length,
        back=0.45 * length,
        half=width / 2,
        squareness=squareness,
    )
    overhang = uniform(rng, (0.022, 0.028)) if handle == "lip" else uniform(rng, (0.003, 0.006))
    seat = uniform(rng, (0.016, 0.024))
    top = rim + seat

    body = _bowl(rng, family, oval.inset(overhang), rim, -depth / 2 + 0.02, porcelain)
    body += _seat(oval.inset(overhang - 0.004), rim, top, seat_look)
    body += _hinge_blocks(pivot_x, rim, top, seat_look)
    behind = _back(rng, family, width, -depth / 2, tank_depth, rim, porcelain)
    low = top + GAP
    thickness = uniform(rng, (0.014, 0.026))
    lid = [oval.slab(low, low + thickness, uniform(rng, (0.004, 0.012)), lid_look)]
    if handle == "tab":
        lid += lip(
            rng,
            oval.center + oval.front - 0.006,
            low,
            uniform(rng, (0.05, 0.09)),
            lid_look,
            reach=(0.030, 0.038),
            thickness=(0.010, 0.014),
        )
    link = lid_link(rng, "lid", lid, (0.6, 1.4))
    opening = _opening(rng, behind, pivot_x, low, thickness, length)
    return ArticulatedObject(
        object_id=object_id,
        category="toilet",
        links=(Link(name="bowl", shapes=tuple(body + behind), density=900.0), link),
        joints=(hinge(rng, link, "bowl", (pivot_x, 0.0, low), opening),),
        attributes={"family": family, "handle": handle},
    )


@dataclass(frozen=True, kw_only=True)
class _Oval:
    """The outline of a bowl: a half ellipse in front, squarer behind; metres.

    Attributes:
        center: x of its widest place.
        front, back: how far it reaches from there.
        half: half width.
        squareness: of the back; 2 is an ellipse.
    """

    center: float
    front: float
    back: float
    half: float
    squareness: float

    def inset(self, amount: float) -> _Oval:
        """Smaller at the front and, by half as much, at the sides."""
        return replace(self, front=self.front - amount, half=self.half - 0.5 * amount)

    def scaled(self, scale: float, shift: float = 0.0) -> _Oval:
        """Shrunk about its middle, then moved along x."""
        middle = self.center + (self.front - self.back) / 2
        return replace(
            self,
            center=middle + scale * (self.center - middle) + shift,
            front=scale * self.front,
            back=scale * self.back,
            half=scale * self.half,
        )

    def outline(self, count: int, shrink: float = 0.0) -> Outline:
        """``count`` points (x, y), counter-clockwise; drawn in all round by ``shrink``."""
        angles = (np.arange(count) + 0.5) * 2 * np.pi / count
        points = []
        for c, s in zip(np.cos(angles), np.sin(angles), strict=True):
            power = 1.0 if c >= 0 else 2.0 / self.squareness
            reach = (self.front if c >= 0 else self.back) - shrink
            x = np.sign(c) * reach * abs(c) ** power
            y = np.sign(s) * (self.half - shrink) * abs(s) ** power
            points.append((float(self.center + x), float(y)))
        return points

    def hull(
        self, low: float, high: float, foot: _Oval, look: Material, sides: int = _SIDES
    ) -> Shape:
        """A body from ``foot``'s outline at z = low to this one, of ``sides``, at z = high."""
        points = [(x, y, low) for x, y in foot.outline(_SIDES)]
        return convex(points + [(x, y, high) for x, y in self.outline(sides)], look)

    def slab(self, low: float, high: float, bevel: float, look: Material) -> Shape:
        """A plate whose upper edge is bevelled."""
        edge = low + 0.45 * (high - low)
        points = [(x, y, low) for x, y in self.outline(20, 0.002)]
        points += [(x, y, edge) for x, y in self.outline(20)]
        return convex(points + [(x, y, high) for x, y in self.outline(20, bevel)], look)


def _bowl(
    rng: np.random.Generator, family: str, oval: _Oval, rim: float, back: float, look: Material
) -> list[Shape]:
    """A basin of panels with water in it, on a foot that stands or, wall-hung, does not."""
    oval = oval.inset(0.006)
    deep = uniform(rng, (0.08, 0.11))
    floor = rim - deep
    lower = oval.scaled(0.94, -0.01)
    thick = uniform(rng, (0.045, 0.055))
    basin = ring_wall(
        (lower.outline(_PANELS), lower.outline(_PANELS, 0.085)),
        (oval.outline(_PANELS), oval.outline(_PANELS, thick)),
        (floor, rim),
        look,
    )
    if family == "skirted":
        belly = oval.scaled(uniform(rng, (0.84, 0.92)), -0.025)
        feet = [lower.hull(0.0, floor, belly, look, _PANELS)]
        half = belly.half * 0.9
    elif family == "wall_hung":
        bottom = uniform(rng, (0.06, 0.12))
        belly = oval.scaled(uniform(rng, (0.50, 0.62)), -0.07)
        feet = [lower.hull(bottom, floor, belly, look, _PANELS)]
        half = belly.half
    else:
        waist = uniform(rng, (0.10, 0.16))
        neck = oval.scaled(uniform(rng, (0.52, 0.60)), -0.06)
        foot = oval.scaled(uniform(rng, (0.60, 0.70)), -0.05)
        feet = [lower.hull(waist, floor, neck, look, _PANELS), neck.hull(0.0, waist, foot, look)]
        half = neck.half
    # What joins the bowl to the tank or the wall.
    start = oval.center - 0.4 * oval.back
    under = 0.10 if family == "wall_hung" else 0.0
    neck_box = box_between((back, -half, under), (start, half, floor), look)
    ledge = box_between(
        (back, -0.8 * oval.half, floor),
        (oval.center - oval.back + 0.02, 0.8 * oval.half, rim),
        look,
    )
    pool = cylinder_along(
        "z", (oval.center - 0.02, 0.0, floor + 0.004), 0.62 * oval.half, 0.008, _WATER
    )
    return [*basin, *feet, neck_box, ledge, pool]


def _seat(oval: _Oval, rim: float, top: float, look: Material) -> list[Shape]:
    """A ring on the rim."""
    outer, inner = oval.outline(_SEAT_PANELS), oval.outline(_SEAT_PANELS, 0.062)
    return list(ring_wall((outer, inner), (outer, inner), (rim + 0.002, top), look))


def _hinge_blocks(pivot_x: float, rim: float, top: float, look: Material) -> list[Shape]:
    """Two blocks behind the seat that carry the hinge."""
    return [
        box_between(
            (pivot_x - 0.030, s * 0.075 - 0.018, rim),
            (pivot_x - 0.004, s * 0.075 + 0.018, top),
            look,
        )
        for s in (-1, 1)
    ]


def _back(
    rng: np.random.Generator,
    family: str,
    width: float,
    back: float,
    depth: float,
    rim: float,
    look: Material,
) -> list[Shape]:
    """Tank, panel or pipe behind the bowl; its front stands at ``back + depth`` or behind."""
    if family == "wall_hung":
        return _panel(rng, back, depth)
    if family == "valve":
        return _valve(rng, back, depth, rim)
    half = width / 2 * uniform(rng, (0.95, 1.1))
    tall = uniform(rng, (0.30, 0.37)) if family == "close_coupled" else uniform(rng, (0.20, 0.28))
    low, high = rim - 0.01, rim + tall
    front = back + depth
    cover = uniform(rng, (0.025, 0.04))
    shapes = [
        convex(
            [
                (x, y, z)
                for z, draw in ((low, 0.02), (high, 0.0))
                for x in (back, front - 0.4 * draw)
                for y in (-half + draw, half - draw)
            ],
            look,
        ),
        box_between(
            (back - 0.004, -half - 0.008, high),
            (front + 0.004, half + 0.008, high + cover),
            look,
        ),
    ]
    if family == "skirted":
        shapes.append(box_between((back, -0.7 * half, 0.0), (front - 0.02, 0.7 * half, low), look))
    if rng.random() < 0.6:
        shapes.append(
            cylinder_along(
                "z",
                (back + depth / 2, 0.0, high + cover + 0.003),
                uniform(rng, (0.018, 0.028)),
                0.008,
                _CHROME,
            )
        )
    else:
        y = -0.72 * half
        shapes += [
            cylinder_along("x", (front + 0.003, y, high - 0.05), 0.012, 0.018, _CHROME),
            box_between(
                (front + 0.008, y - 0.01, high - 0.057),
                (front + 0.016, y + 0.07, high - 0.043),
                _CHROME,
            ),
        ]
    return shapes


def _panel(rng: np.random.Generator, back: float, depth: float) -> list[Shape]:
    """The wall a bowl hangs on: tiles or a plain panel, a flush plate."""
    half, high = uniform(rng, (0.22, 0.30)), uniform(rng, (0.78, 0.92))
    look = painted(rng) if rng.random() < 0.5 else stone(rng)
    tiled = rng.random() < 0.5
    if tiled:
        look = with_texture(look, "tiles", uniform(rng, (0.3, 0.6)))
    front = back + depth
    plate = _CHROME if rng.random() < 0.6 else Material(color=(0.75, 0.75, 0.74), roughness=0.3)
    z = high - 0.12
    shapes = [
        box_between((back, -half, 0.0), (front, half, high), look),
        box_between((front, -0.11, z - 0.065), (front + 0.006, 0.11, z + 0.065), plate),
        box_between(
            (front + 0.006, -0.085, z - 0.04), (front + 0.009, -0.004, z + 0.04), darker(plate, 0.8)
        ),
        box_between(
            (front + 0.006, 0.004, z - 0.04), (front + 0.009, 0.085, z + 0.04), darker(plate, 0.8)
        ),
    ]
    if not tiled and rng.random() < 0.6:
        seam = darker(look, 0.6)
        shapes += [
            box_between((front, -half, h - 0.002), (front + 0.001, half, h + 0.002), seam)
            for h in np.arange(0.2, high - 0.2, 0.2).tolist()
        ]
    return shapes


def _valve(rng: np.random.Generator, back: float, depth: float, rim: float) -> list[Shape]:
    """A chrome pipe with a flush valve and its lever."""
    x, radius = back + 0.45 * depth, uniform(rng, (0.014, 0.018))
    high = rim + uniform(rng, (0.22, 0.34))
    return [
        cylinder_along("z", (x, 0.0, (rim + high) / 2), radius, high - rim, _CHROME),
        cylinder_along("z", (x, 0.0, high), 1.9 * radius, 0.09, _CHROME),
        cylinder_along("y", (x, 0.06, high), 0.6 * radius, 0.12, _CHROME),
        cylinder_along("x", (x + 0.05, 0.0, high - 0.01), 0.5 * radius, 0.09, _CHROME),
        cylinder_along("z", (x, 0.0, rim + 0.01), 2.2 * radius, 0.02, _CHROME),
    ]


def _opening(
    rng: np.random.Generator,
    behind: list[Shape],
    pivot_x: float,
    pivot_z: float,
    thickness: float,
    length: float,
) -> float:
    """Degrees: 90 to 105, less where the lid would lean into what stands behind it."""
    wanted = uniform(rng, (90.0, 105.0))
    leans = []
    for shape in behind:
        corners = shape.corners_link()
        front, high = corners[:, 0].max(), min(corners[:, 2].max() - pivot_z, length)
        if high > 0.05:
            leans.append(np.degrees(np.arctan2(pivot_x - front - thickness - 0.004, high)))
    return float(min([wanted, *(90.0 + lean for lean in leans)]))


def _porcelain(rng: np.random.Generator) -> Material:
    """White more often than other glazes."""
    if rng.random() < 0.6:
        return Material(color=(0.84, 0.84, 0.83), roughness=uniform(rng, (0.15, 0.3)))
    return ceramic(rng)


def _seat_look(rng: np.random.Generator, bowl: Material) -> Material:
    """As the bowl, wooden, or of coloured plastic."""
    kind = rng.random()
    if kind < 0.55:
        return bowl
    return wood(rng) if kind < 0.75 else plastic(rng)
