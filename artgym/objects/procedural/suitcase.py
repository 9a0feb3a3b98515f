"""Suitcases: a shell that lies on its side, its lid hinged at the back.

Families: "trolley" (rounded hard shell with ribs and wheels), "briefcase" (flat, with locks),
"toolbox" (low lid on a deep body), "flight" (panels between metal edges). Handles: "bar" (a
carrying handle on the lid's front), "strap" (one on its top), "lip" (a ledge along the front),
"latch" (two tongues at the front; the carrying handle belongs to the body).
"""

from __future__ import annotations

import numpy as np

from artgym.objects.model import ArticulatedObject, Link, Material, Shape
from artgym.objects.procedural.handles import bar_at
from artgym.objects.procedural.lids import (
    GAP,
    cap,
    hinge,
    lid_link,
    lip,
    on_top,
    rounded_plate,
    rounded_walls,
    tray,
)
from artgym.objects.procedural.shapes import (
    Interval,
    box_between,
    cylinder_along,
    darker,
    fabric,
    leather,
    metal,
    painted,
    plastic,
    uniform,
)

FAMILIES = ("trolley", "briefcase", "toolbox", "flight")
HANDLES = ("bar", "strap", "lip", "latch")

_DARK = Material(color=(0.025, 0.025, 0.028), roughness=0.6)

#: Along x, along y, whole height, metres; the lid's share of the height.
_SIZES: dict[str, tuple[Interval, Interval, Interval, Interval]] = {
    "trolley": ((0.32, 0.48), (0.48, 0.70), (0.17, 0.28), (0.42, 0.52)),
    "briefcase": ((0.27, 0.36), (0.38, 0.48), (0.09, 0.14), (0.35, 0.5)),
    "toolbox": ((0.19, 0.28), (0.36, 0.55), (0.18, 0.28), (0.22, 0.34)),
    "flight": ((0.28, 0.48), (0.38, 0.68), (0.18, 0.34), (0.25, 0.45)),
}
_HANDLE_SHARES = {
    "trolley": (0.4, 0.15, 0.2, 0.25),
    "briefcase": (0.5, 0.0, 0.2, 0.3),
    "toolbox": (0.1, 0.6, 0.15, 0.15),
    "flight": (0.35, 0.2, 0.25, 0.2),
}


def make_suitcase(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A case of 0.2-0.7 m; the lid opens by 90-110 degrees."""
    family = str(rng.choice(FAMILIES))
    handle = str(rng.choice(HANDLES, p=_HANDLE_SHARES[family]))
    depth, width, height, lid_share = (uniform(rng, interval) for interval in _SIZES[family])
    half = depth / 2, width / 2
    split = height * (1 - lid_share)
    shell, fitting = _looks(rng, family)

    build = _rounded_shells if family in ("trolley", "briefcase") else _square_shells
    body, lid = build(rng, family, half, split, height, shell, fitting)
    low = split + GAP
    body += _carrying_handle(rng, half[0], split, _DARK) if handle == "latch" else []
    body += _latches(rng, half, split, fitting)
    lid += _grip(rng, handle, half, low, height, fitting)
    if family == "trolley":
        _add_wheels(rng, half, split, height, body, lid)
    link = lid_link(rng, "lid", lid, (0.35, 0.75) if handle == "strap" else (0.5, 1.3))
    return ArticulatedObject(
        object_id=object_id,
        category="suitcase",
        links=(Link(name="body", shapes=tuple(body), density=250.0), link),
        joints=(hinge(rng, link, "body", (-half[0], 0.0, low), uniform(rng, (90.0, 110.0))),),
        attributes={"family": family, "handle": handle},
    )


def _looks(rng: np.random.Generator, family: str) -> tuple[Material, Material]:
    """Of the shell and of its fittings."""
    if family == "briefcase":
        return leather(rng) if rng.random() < 0.7 else metal(rng), metal(rng)
    if family == "flight":
        shell = _DARK if rng.random() < 0.6 else darker(plastic(rng), 0.6)
        return shell, Material(color=(0.55, 0.56, 0.57), roughness=0.35, metallic=0.7)
    if family == "toolbox":
        shell = plastic(rng) if rng.random() < 0.6 else painted(rng)
        return shell, metal(rng) if rng.random() < 0.6 else _DARK
    kind = rng.random()
    shell = fabric(rng) if kind < 0.3 else plastic(rng) if kind < 0.7 else painted(rng)
    return shell, _DARK if rng.random() < 0.6 else darker(shell, 0.5)


_Shells = tuple[list[Shape], list[Shape]]


def _rounded_shells(
    rng: np.random.Generator,
    family: str,
    half: tuple[float, float],
    split: float,
    height: float,
    shell: Material,
    fitting: Material,
) -> _Shells:
    """Body and lid with round corners; ribs on a trolley, metal frames on a briefcase."""
    wall = 0.005
    radius = uniform(rng, (0.03, 0.055)) if family == "trolley" else uniform(rng, (0.012, 0.025))
    low = split + GAP
    # The outer faces fall back a little, as moulded shells do.
    inset = (half[0] - 0.012, half[1] - 0.012)
    body = [
        rounded_plate(inset, radius - 0.005, 0.0, 0.008, shell),
        *rounded_walls(half, radius, 0.008, split, wall, shell),
    ]
    lid = [
        rounded_plate(inset, radius - 0.005, height - 0.001, height + 0.006, shell),
        rounded_plate(half, radius, height - 0.008, height - 0.001, shell),
        *rounded_walls(half, radius, low, height - 0.008, wall, shell),
    ]
    cloth = fabric(rng)
    within = (half[0] - wall, half[1] - wall)
    body.append(
        rounded_plate(within, radius - wall, 0.008, uniform(rng, (0.3, 0.6)) * split, cloth)
    )
    frame = 0.006
    for shapes, bottom in ((body, split - frame), (lid, low)):
        shapes += [
            box_between(
                (s * half[0] - 0.002, -half[1] + radius, bottom),
                (s * half[0] + 0.002, half[1] - radius, bottom + frame),
                fitting,
            )
            for s in (-1, 1)
        ]
    if family == "trolley":
        count = int(rng.integers(4, 8))
        along = bool(rng.random() < 0.5)
        span = half[0] if along else half[1]
        reach = (half[1] if along else half[0]) - 0.05
        for at in np.linspace(-0.72 * span, 0.72 * span, count):
            rib = 0.36 * span / count
            first, last = ((at - rib, -reach), (at + rib, reach))
            if not along:
                first, last = first[::-1], last[::-1]
            lid.append(
                box_between((*first, height + 0.006), (*last, height + 0.009), darker(shell, 0.85))
            )
    return body, lid


def _square_shells(
    rng: np.random.Generator,
    family: str,
    half: tuple[float, float],
    split: float,
    height: float,
    shell: Material,
    fitting: Material,
) -> _Shells:
    """Body and lid with sharp edges; a flight case has metal along them."""
    wall = 0.007
    low = split + GAP
    lid_shell = shell if family == "flight" or rng.random() < 0.6 else painted(rng)
    body = [*tray(half, 0.0, split, wall, wall, shell)]
    lid = [*cap(half, low, height, wall, wall, lid_shell)]
    x, y = half
    if family == "flight":
        profile = uniform(rng, (0.014, 0.022))
        body += _edges(x, y, 0.0, split, profile, fitting)
        lid += _edges(x, y, low, height, profile, fitting)
        for sx in (-1, 1):
            for sy in (-1, 1):
                lid.append(
                    cylinder_along(
                        "z",
                        (sx * (x - 0.02), sy * (y - 0.02), height + 0.002),
                        0.028,
                        0.008,
                        fitting,
                    )
                )
    else:
        rib = uniform(rng, (0.010, 0.020))
        body.append(box_between((-x - 0.004, -y - 0.004, 0.0), (x + 0.004, y + 0.004, rib), _DARK))
        # A tray for small things under the lid.
        body.append(
            box_between(
                (-x + wall, -y + wall, 0.55 * split),
                (x - wall, y - wall, 0.6 * split),
                darker(painted(rng), 0.7),
            )
        )
        inset = uniform(rng, (0.02, 0.04))
        lid.append(
            box_between(
                (-x + inset, -y + inset, height),
                (x - inset, y - inset, height + uniform(rng, (0.004, 0.012))),
                darker(lid_shell, 0.85),
            )
        )
    return body, lid


def _edges(
    x: float, y: float, low: float, high: float, profile: float, look: Material
) -> list[Shape]:
    """Metal along the upper and the lower edges."""
    proud, p = 0.002, profile
    shapes = [
        box_between((s * x - proud, -y - proud, z), (s * x + proud, y + proud, z + p), look)
        for s in (-1, 1)
        for z in (low, high - p)
    ]
    shapes += [
        box_between((-x, s * y - proud, z), (x, s * y + proud, z + p), look)
        for s in (-1, 1)
        for z in (low, high - p)
    ]
    return shapes


def _carrying_handle(
    rng: np.random.Generator, front: float, split: float, look: Material
) -> list[Shape]:
    """A handle that belongs to the body, well below the lid's tongues."""
    z = max(0.3 * split, 0.02)
    length = uniform(rng, (0.10, 0.15))
    return [
        box_between(
            (front + 0.026, -length / 2, z - 0.008), (front + 0.040, length / 2, z + 0.008), look
        )
    ] + [
        box_between(
            (front, s * length / 2 - 0.008, z - 0.006),
            (front + 0.034, s * length / 2 + 0.008, z + 0.006),
            look,
        )
        for s in (-1, 1)
    ]


def _latches(
    rng: np.random.Generator,
    half: tuple[float, float],
    split: float,
    look: Material,
) -> list[Shape]:
    """Lock plates under the seam."""
    y = uniform(rng, (0.45, 0.7)) * half[1]
    wide, tall = uniform(rng, (0.012, 0.022)), min(uniform(rng, (0.02, 0.04)), 0.6 * split)
    return [
        box_between(
            (half[0], s * y - wide, split - tall),
            (half[0] + 0.005, s * y + wide, split - 0.001),
            look,
        )
        for s in (-1, 1)
    ]


def _grip(
    rng: np.random.Generator,
    handle: str,
    half: tuple[float, float],
    low: float,
    height: float,
    fitting: Material,
) -> list[Shape]:
    """What opens the lid."""
    x, y = half
    if handle == "bar":
        z = low + max(0.012, 0.35 * (height - low))
        return [*bar_at(rng, x - 0.001, 0.0, z, "y", uniform(rng, (0.10, 0.15)), _DARK)]
    if handle == "strap":
        spot = uniform(rng, (0.0, 0.25)) * x
        length = uniform(rng, (0.12, 0.2))
        return [*on_top(bar_at, rng, height + 0.004, spot, 0.0, "y", length, _DARK)]
    if handle == "lip":
        return [*lip(rng, x, low, uniform(rng, (0.5, 1.7)) * y, fitting)]
    place, wide = uniform(rng, (0.45, 0.7)) * y, uniform(rng, (0.030, 0.045))
    size = {"reach": (0.024, 0.024), "thickness": (0.007, 0.007)}
    return [
        *lip(rng, x, low, wide, fitting, y=place, **size),
        *lip(rng, x, low, wide, fitting, y=-place, **size),
    ]


def _add_wheels(
    rng: np.random.Generator,
    half: tuple[float, float],
    split: float,
    height: float,
    body: list[Shape],
    lid: list[Shape],
) -> None:
    """Wheels at one end, a pull-out handle at the other."""
    x, y = half
    radius = uniform(rng, (0.018, 0.026))
    end = float(rng.choice((-1.0, 1.0)))
    heights = [(body, radius + 0.006)]
    if rng.random() < 0.6:
        heights.append((lid, height - radius - 0.006))
    for shapes, z in heights:
        for s in (-1, 1):
            shapes.append(
                cylinder_along(
                    "x", (s * (x - 0.06), end * (y + 0.6 * radius), z), radius, 0.02, _DARK
                )
            )
            shapes.append(
                box_between(
                    (s * (x - 0.06) - 0.016, end * y - 0.006, z - 0.014),
                    (s * (x - 0.06) + 0.016, end * y + 0.006, z + 0.014),
                    _DARK,
                )
            )
    z = 0.5 * split
    body.append(
        box_between(
            (-0.4 * x, -end * y - 0.012, z - 0.012), (0.4 * x, -end * y + 0.012, z + 0.012), _DARK
        )
    )
