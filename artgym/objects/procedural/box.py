"""Boxes: hollow, open above, with one to four hinged lids.

Families: "gift" (a lid whose rim laps over the body), "carton" (two or four flaps that open
outwards), "case" (small and flat, the lid folds over to lie beside the body), "chest" (a wooden
chest under a flat or a curved lid). Handles: "knob", "bow", "lip", "tab" (a loose end that stands
forward), "tongue" (a strip of a flap's edge, folded up), "edge" (flaps that leave an opening in
the middle), "bar".
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from artgym.objects.model import ArticulatedObject, Joint, Link, Material, Shape
from artgym.objects.procedural.handles import bar_at, knob_at
from artgym.objects.procedural.lids import (
    GAP,
    cap,
    hinge,
    lid_link,
    lip,
    on_top,
    tray,
)
from artgym.objects.procedural.shapes import (
    box_between,
    cardboard,
    darker,
    fabric,
    leather,
    metal,
    painted,
    prism,
    turned,
    uniform,
    wicker,
    with_role,
    with_texture,
    wood,
)

FAMILIES = ("gift", "carton", "case", "chest")
HANDLES = ("knob", "bow", "lip", "tab", "tongue", "edge", "bar")

#: How far printed labels, tape and ribbons stand out, metres.
_PROUD = 0.0008


def make_box(object_id: str, rng: np.random.Generator) -> ArticulatedObject:
    """A box of 0.08-0.45 m; lids open by 95-110 degrees, flaps by 125-200, cases by 140-180."""
    family = str(rng.choice(FAMILIES, p=(0.22, 0.36, 0.20, 0.22)))
    build = {"gift": _gift, "carton": _carton, "case": _case, "chest": _chest}[family]
    body, lids, joints, handle = build(rng)
    return ArticulatedObject(
        object_id=object_id,
        category="box",
        links=(Link(name="body", shapes=tuple(body), density=300.0), *lids),
        joints=tuple(joints),
        attributes={"family": family, "handle": handle, "lids": float(len(lids))},
    )


#: Shapes of the body, movable links, their joints, kind of handle.
_Parts = tuple[list[Shape], list[Link], list[Joint], str]


# -- gift box ----------------------------------------------------------------------------------


def _gift(rng: np.random.Generator) -> _Parts:
    """A lid with a rim over the body, hinged at the rim's lower back edge."""
    handle = str(rng.choice(("bow", "knob", "tab", "lip"), p=(0.4, 0.15, 0.25, 0.2)))
    y = uniform(rng, (0.065, 0.17))
    x = y * uniform(rng, (0.65, 1.0))
    height = uniform(rng, (0.06, 0.20))
    rim = min(uniform(rng, (0.022, 0.060)), 0.6 * height)
    wall = uniform(rng, (0.003, 0.005))
    paper = _paper(rng)
    lid_paper = paper if rng.random() < 0.4 else _paper(rng)
    ribbon = painted(rng)

    body = [*tray((x, y), 0.0, height, wall, wall, paper)]
    reach = GAP + wall
    outer = (x + reach, y + reach)
    low, high = height - rim, height + GAP + wall
    lid = [*cap(outer, low, high, wall, wall, lid_paper)]
    if handle == "bow" or rng.random() < 0.3:
        half = uniform(rng, (0.006, 0.014))
        body += _ribbon(x, y, 0.0, low - 0.001, half, ribbon)
        lid += _ribbon(*outer, low, high, half, ribbon)
        top = high + _PROUD
        lid += [
            box_between((-outer[0], -half, high), (outer[0], half, top), ribbon),
            box_between((-half, -outer[1], high), (half, outer[1], top), ribbon),
        ]
    if handle == "bow":
        lid += _bow(rng, high, ribbon)
    elif handle == "knob":
        spot = uniform(rng, (0.0, 0.5)) * x
        lid += on_top(knob_at, rng, high, spot, 0.0, metal(rng))
    elif handle == "tab":
        lid += lip(rng, outer[0], low, uniform(rng, (0.03, 0.06)), ribbon, thickness=(0.003, 0.005))
    else:
        lid += lip(rng, outer[0], low, 2 * outer[1], lid_paper, thickness=(0.003, 0.005))
    link = lid_link(rng, "lid_1", lid, (0.08, 0.35))
    joint = hinge(
        rng,
        link,
        "body",
        (-outer[0], 0.0, low),
        uniform(rng, (95.0, 110.0)),
        name="hinge_1",
    )
    return body, [link], [joint], handle


def _ribbon(
    x: float, y: float, low: float, high: float, half: float, look: Material
) -> list[Shape]:
    """A ribbon down the four sides."""
    return [
        box_between((s * x - _PROUD, -half, low), (s * x + _PROUD, half, high), look)
        for s in (-1, 1)
    ] + [
        box_between((-half, s * y - _PROUD, low), (half, s * y + _PROUD, high), look)
        for s in (-1, 1)
    ]


def _bow(rng: np.random.Generator, top: float, look: Material) -> tuple[Shape, ...]:
    """Two loops and a knot between them, on the lid's middle."""
    half = uniform(rng, (0.010, 0.016))
    span, rise = uniform(rng, (0.028, 0.042)), uniform(rng, (0.028, 0.040))
    knot = box_between(
        (-half - 0.002, -0.008, top), (half + 0.002, 0.008, top + 0.7 * rise), darker(look, 0.8)
    )
    loops = []
    for s in (-1, 1):
        outline = [
            (s * 0.004, top + 0.35 * rise),
            (s * 0.55 * span, top + 0.15 * rise),
            (s * span, top + 0.45 * rise),
            (s * 0.95 * span, top + 0.9 * rise),
            (s * 0.6 * span, top + rise),
        ]
        loops.append(prism(outline, "x", -half, half, look))
    return with_role("handle", (knot, *loops))


# -- carton ------------------------------------------------------------------------------------


def _carton(rng: np.random.Generator) -> _Parts:
    """Flaps at the upper edges of a cardboard box; they do not cover one another."""
    count = int(rng.choice((2, 4)))
    handle = str(rng.choice(("tongue", "edge"), p=(0.55, 0.45)))
    x, y = uniform(rng, (0.09, 0.17)), uniform(rng, (0.11, 0.20))
    height = uniform(rng, (0.10, 0.30))
    wall = uniform(rng, (0.003, 0.006))
    board = cardboard(rng)
    inside = darker(board, 0.85)
    opening = 0.0 if handle == "tongue" else uniform(rng, (0.038, 0.052))

    body = [*tray((x, y), 0.0, height, wall, wall, board)]
    body += _prints(rng, x, y, height, board)
    if count == 4:
        plans = _four_flaps(rng, x, y, opening)
    else:
        across = bool(rng.random() < 0.5)
        plans = _two_flaps(rng, x, y, opening, across)
        if handle == "tongue" and rng.random() < 0.6:
            body += _inner_flaps(rng, x, y, height, wall, across, inside)
    tongue = uniform(rng, (0.026, 0.036)), uniform(rng, (0.035, 0.055))
    tongue_turn = np.radians(uniform(rng, (65.0, 95.0)))
    links, joints = [], []
    for number, (quarter, outline) in enumerate(plans, start=1):
        low, high = height + GAP, height + GAP + wall
        pieces = [prism(outline, "z", low, high, board if number % 2 else inside)]
        tip = max(p[0] for p in outline)
        tip_half = max(abs(p[1]) for p in outline if p[0] > tip - 1e-9)
        if handle == "tongue":
            rise, half = tongue[0], min(tongue[1] / 2, 0.8 * tip_half)
            # Tongues of opposite flaps stand apart, so that a finger fits behind each.
            side = 0.5 * tip_half + 0.1 * half if tip_half > 0.07 else tip_half - half
            strip = box_between(
                (tip - wall, side - half, low), (tip + rise, side + half, high), inside
            )
            strip = turned(strip, (0.0, 1.0, 0.0), (tip - wall, 0.0, low), -tongue_turn)
            pieces += with_role("handle", (strip,))
        turn = quarter * np.pi / 2
        link = lid_link(
            rng,
            f"lid_{number}",
            [turned(p, (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), turn) for p in pieces],
            (0.05, 0.15),
        )
        c, s = round(float(np.cos(turn))), round(float(np.sin(turn)))
        edge = min(p[0] for p in outline)
        joints.append(
            hinge(
                rng,
                link,
                "body",
                (c * edge, s * edge, height),
                uniform(rng, (125.0, 200.0)),
                (float(s), float(-c), 0.0),
                f"hinge_{number}",
            )
        )
        links.append(link)
    return body, links, joints, handle


#: Quarter turn from the back, and the flap's outline (x, y) as if it were hinged at the back.
_Flap = tuple[int, list[tuple[float, float]]]


def _two_flaps(
    rng: np.random.Generator, x: float, y: float, opening: float, across: bool
) -> list[_Flap]:
    """Flaps at front and back, or ``across`` at the sides, that meet in the middle."""
    depth, half = (y, x) if across else (x, y)
    tip = -max(opening, 0.001)
    cut = 0.0 if rng.random() < 0.5 else uniform(rng, (0.005, 0.02))
    outline = [(-depth, -half), (-depth, half), (tip, half - cut), (tip, cut - half)]
    return [(q, outline) for q in ((3, 1) if across else (0, 2))]


def _inner_flaps(
    rng: np.random.Generator,
    x: float,
    y: float,
    height: float,
    wall: float,
    across: bool,
    look: Material,
) -> list[Shape]:
    """The other two flaps, folded in; they lie beneath and stay there."""
    share = uniform(rng, (0.3, 0.75))
    a, b = (x, y) if across else (y, x)
    shapes = []
    for s in (-1, 1):
        low, high = sorted((s * a, s * (1 - share) * a))
        first, last = (low, -b), (high, b)
        if not across:
            first, last = first[::-1], last[::-1]
        shapes.append(box_between((*first, height - wall), (*last, height), look))
    return shapes


def _four_flaps(rng: np.random.Generator, x: float, y: float, opening: float) -> list[_Flap]:
    """Flaps along all edges: mitred like a hipped roof, or two between the other two."""
    tip = max(opening, 0.001)
    # Flaps along the long edges come first and reach farthest.
    a, b = min(x, y), max(x, y)
    long_, short = [(-a, -b), (-a, b)], [(-b, -a), (-b, a)]
    if rng.random() < 0.5:
        reach = a - tip
        # Seams at 45 degrees; without an opening the short flaps stop before the seams meet.
        end = reach if opening else reach - 0.02
        long_ += [(-tip, b - reach), (-tip, reach - b)]
        short += [(-b + end, a - end), (-b + end, end - a)]
    else:
        end = uniform(rng, (0.55, 0.85)) * (b - max(0.055, opening))
        inner = b - end - 0.002
        long_ = [(-a, -inner), (-a, inner), (-tip, inner), (-tip, -inner)]
        short += [(-b + end, a), (-b + end, -a)]
    first, second = ((0, 2), (3, 1)) if x <= y else ((3, 1), (0, 2))
    return [(q, long_) for q in first] + [(q, short) for q in second]


def _prints(
    rng: np.random.Generator, x: float, y: float, height: float, board: Material
) -> list[Shape]:
    """A label, bars of print or tape on the outside."""
    shapes: list[Shape] = []
    ink = painted(rng) if rng.random() < 0.5 else darker(board, 0.35)
    if rng.random() < 0.6:
        tall, wide = uniform(rng, (0.25, 0.5)) * height, uniform(rng, (0.4, 0.9)) * y
        low = uniform(rng, (0.15, 0.4)) * height
        left = uniform(rng, (-0.85, -0.1)) * y
        shapes += _label(rng, x, (left, left + wide), (low, low + tall))
    if rng.random() < 0.6:
        half = uniform(rng, (0.015, 0.03))
        tape = Material(color=(0.52, 0.36, 0.16), roughness=0.25)
        for s in (-1, 1):
            shapes.append(
                box_between(
                    (s * x - _PROUD / 2, -half, 0.6 * height),
                    (s * x + _PROUD / 2, half, height),
                    tape,
                )
            )
    if rng.random() < 0.5:
        low = uniform(rng, (0.1, 0.6)) * height
        for s in (-1, 1):
            shapes.append(
                box_between(
                    (-0.5 * x, s * y - _PROUD, low),
                    (0.5 * x, s * y + _PROUD, low + 0.12 * height),
                    ink,
                )
            )
    return shapes


def _label(
    rng: np.random.Generator, face: float, y: tuple[float, float], z: tuple[float, float]
) -> list[Shape]:
    """White paper with lines and a block of print, on a front."""
    white = Material(color=(0.8, 0.8, 0.78), roughness=0.6)
    ink = Material(color=(0.05, 0.05, 0.06), roughness=0.7)
    shapes = [box_between((face, y[0], z[0]), (face + _PROUD, y[1], z[1]), white)]
    wide, tall = y[1] - y[0], z[1] - z[0]
    for k in range(int(rng.integers(2, 4))):
        at = z[1] - (0.2 + 0.22 * k) * tall
        length = uniform(rng, (0.3, 0.8)) * wide
        shapes.append(
            box_between(
                (face + _PROUD, y[0] + 0.1 * wide, at - 0.05 * tall),
                (face + 1.5 * _PROUD, y[0] + 0.1 * wide + length, at + 0.05 * tall),
                ink,
            )
        )
    return shapes


# -- case --------------------------------------------------------------------------------------


def _case(rng: np.random.Generator) -> _Parts:
    """A flat box for pens, phones, games: two shells that lie side by side when open."""
    handle = str(rng.choice(("lip", "tab", "knob"), p=(0.4, 0.4, 0.2)))
    scale = 1.0 if rng.random() < 0.6 else uniform(rng, (1.0, 1.5))
    x, y = scale * uniform(rng, (0.034, 0.0485)), scale * uniform(rng, (0.095, 0.126))
    height = scale * uniform(rng, (0.018, 0.0395))
    # Open, the lid lies beside the body and must not reach the table.
    thickness = min(scale * uniform(rng, (0.005, 0.026)), height - 0.004)
    wall = 0.0025
    shell = _paper(rng)
    lid_shell = shell if rng.random() < 0.6 else _paper(rng)
    lining = fabric(rng)

    body = [*tray((x, y), 0.0, height, wall, wall, shell)]
    body.append(
        box_between((-x + wall, -y + wall, wall), (x - wall, y - wall, 0.25 * height), lining)
    )
    low, high = height + GAP / 2, height + GAP / 2 + thickness
    half = (x, y + uniform(rng, (-0.002, 0.002)))
    if thickness > 0.012:
        lid = [*cap(half, low, high, wall, wall, lid_shell)]
    else:
        lid = [box_between((-x, -half[1], low), (x, half[1], high), lid_shell)]
    look = metal(rng) if rng.random() < 0.5 else painted(rng)
    if handle == "lip":
        lid += lip(rng, x, low, 2 * half[1], lid_shell, (0.006, 0.010), (0.003, 0.006))
    elif handle == "tab":
        lid += lip(rng, x, low, uniform(rng, (0.02, 0.05)), look, (0.014, 0.022), (0.002, 0.004))
    else:
        lid += on_top(knob_at, rng, high, 0.5 * x, 0.0, look)
    if rng.random() < 0.7:
        lid += _lid_print(rng, x, y, high, painted(rng))
    link = lid_link(rng, "lid_1", lid, (0.05, 0.15))
    # A knob would meet the table.
    widest = (105.0, 130.0) if handle == "knob" else (140.0, 180.0)
    joint = hinge(rng, link, "body", (-x, 0.0, height), uniform(rng, widest), name="hinge_1")
    return body, [link], [joint], handle


def _lid_print(
    rng: np.random.Generator, x: float, y: float, top: float, look: Material
) -> list[Shape]:
    """A block of colour on a lid, and often a line beside it."""
    low, high = sorted(uniform(rng, (-0.8, 0.8)) * y for _ in range(2))
    high = max(high, low + 0.2 * y)
    shapes = [box_between((-0.6 * x, low, top), (0.1 * x, high, top + 0.0005), look)]
    if rng.random() < 0.6:
        shapes.append(
            box_between(
                (0.3 * x, -0.8 * y, top), (0.4 * x, 0.8 * y, top + 0.0005), darker(look, 0.5)
            )
        )
    return shapes


# -- chest -------------------------------------------------------------------------------------


def _chest(rng: np.random.Generator) -> _Parts:
    """A wooden or painted chest with metal fittings."""
    handle = str(rng.choice(("lip", "knob", "bar"), p=(0.45, 0.25, 0.30)))
    curved = bool(rng.random() < 0.6)
    y = uniform(rng, (0.09, 0.20))
    x = y * uniform(rng, (0.55, 0.85))
    height = uniform(rng, (0.08, 0.20))
    wall = uniform(rng, (0.006, 0.012))
    kind = rng.random()
    timber = wood(rng) if kind < 0.7 else wicker(rng) if kind < 0.82 else painted(rng)
    fitting = metal(rng) if rng.random() < 0.7 else darker(timber, 0.4)

    body = [*tray((x, y), 0.0, height, wall, wall, timber)]
    band = uniform(rng, (0.012, 0.022))
    body += _bands(rng, x, y, height, band, fitting)
    if rng.random() < 0.6:
        plate = uniform(rng, (0.014, 0.024))
        body.append(
            box_between((x, -plate, height - 2.2 * plate), (x + 0.003, plate, height), fitting)
        )
    low = height + GAP
    if curved:
        lid = _curved_lid(rng, x, y, low, wall, timber, fitting)
    else:
        high = low + uniform(rng, (0.03, 0.07))
        lid = [*cap((x, y), low, high, wall, wall, timber)]
        lid += [
            box_between(
                (-x, s * (y - band) - band, high), (x, s * (y - band) + band, high + 0.002), fitting
            )
            for s in (-1, 1)
        ]
    if handle == "lip":
        lid += lip(rng, x, low, uniform(rng, (0.3, 1.0)) * 2 * y, fitting)
    elif handle == "knob":
        lid += knob_at(rng, x - 0.001, 0.0, low + 0.018, fitting)
    else:
        lid += bar_at(rng, x - 0.001, 0.0, low + 0.016, "y", uniform(rng, (0.07, 0.12)), fitting)
    link = lid_link(rng, "lid_1", lid, (0.25, 0.8))
    joint = hinge(rng, link, "body", (-x, 0.0, low), uniform(rng, (90.0, 110.0)), name="hinge_1")
    return body, [link], [joint], handle


def _bands(
    rng: np.random.Generator, x: float, y: float, height: float, band: float, look: Material
) -> list[Shape]:
    """Fittings up the corners, at times along the lower edges of front and back."""
    half = band / 2
    shapes = []
    for sx in (-1, 1):
        for sy in (-1, 1):
            # 2 mm proud of both walls.
            u, v = sx * (x - half + 0.002), sy * (y - half + 0.002)
            shapes.append(
                box_between((u - half, v - half, 0.0), (u + half, v + half, height - 0.002), look)
            )
    if rng.random() < 0.5:
        shapes += [
            box_between((sx * x - 0.0015, -y, 0.0), (sx * x + 0.0015, y, band), look)
            for sx in (-1, 1)
        ]
    return shapes


def _curved_lid(
    rng: np.random.Generator,
    x: float,
    y: float,
    low: float,
    wall: float,
    timber: Material,
    fitting: Material,
) -> list[Shape]:
    """Staves over an arch with solid ends, on an upright edge."""
    rise = x * uniform(rng, (0.55, 0.95))
    staves = 7
    angles = np.linspace(0.0, np.pi, staves + 1)
    foot = uniform(rng, (0.028, 0.035))

    def arch(shrink: float) -> list[tuple[float, float]]:
        return [
            (
                float((x - shrink) * np.cos(a)),
                float(low + foot + (rise - shrink) * np.sin(a)),
            )
            for a in angles
        ]

    outer, inner = arch(0.0), arch(wall)
    shapes = [
        prism([outer[k], outer[k + 1], inner[k + 1], inner[k]], "y", -y, y, timber)
        for k in range(staves)
    ]
    shapes += [
        box_between(
            (s * (x - wall / 2) - wall / 2, -y, low),
            (s * (x - wall / 2) + wall / 2, y, low + foot),
            timber,
        )
        for s in (-1, 1)
    ]
    end = uniform(rng, (0.012, 0.020))
    proud = [(x + 0.002, low), *arch(-0.002), (-x - 0.002, low)]
    shapes += [
        prism(proud, "y", first, first + end, fitting) for first in (-y - 0.002, y + 0.002 - end)
    ]
    return shapes


# -- looks -------------------------------------------------------------------------------------


def _paper(rng: np.random.Generator) -> Material:
    """Brown board, plain coloured paper, or paper with stripes or checks."""
    kind = rng.random()
    if kind < 0.25:
        return cardboard(rng)
    plain = replace(painted(rng), texture=None)
    if kind < 0.45:
        pattern = "stripes" if rng.random() < 0.5 else "gingham"
        return with_texture(plain, pattern, uniform(rng, (0.06, 0.14)), int(rng.integers(8)))
    return leather(rng) if kind < 0.52 else plain
