"""What is random about a scene besides its object: placement, table, lights.

Episodes and pictures draw from here, so that a network meets in one what it saw in the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import sapien
from numpy.typing import NDArray

from artgym.geometry.rotations import frame_from_z, matrix_from_axis_angle
from artgym.geometry.transforms import transform_from
from artgym.objects.model import Box, Cylinder, Material, Shape, Texture
from artgym.sim.conversion import pose_from_transform
from artgym.sim.scene import visual_body
from artgym.sim.tabletop import Footprint

Array = NDArray[np.floating]

#: Largest turn of an object about the vertical, radians, and largest shift along x and y, metres.
MAX_YAW, MAX_SHIFT = 0.35, 0.05
#: A hand starts in front of objects taller than this, and this far from any object, metres.
_TALL, _CLEARANCE = 0.5, 0.2

#: What covers tables that are not plain: patterns, and the interval of their tile, metres.
_TABLES: dict[str, tuple[tuple[str, ...], tuple[float, float]]] = {
    "wood": (("grain", "fine_grain", "planks", "planks", "parquet"), (0.3, 0.65)),
    "stone": (("granite", "marble", "concrete", "terrazzo"), (0.3, 0.7)),
    "cloth": (("weave", "twill", "stripes", "gingham", "felt"), (0.1, 0.3)),
    "tiles": (("tiles", "bricks"), (0.3, 0.7)),
}
#: How many forms of each pattern tables have.
_TABLE_SEEDS = 12


def random_placement(rng: np.random.Generator) -> Array:
    """``T_world_object`` (4, 4) of an object that stands about the table's middle, facing +x."""
    yaw = rng.uniform(-MAX_YAW, MAX_YAW)
    shift = rng.uniform(-MAX_SHIFT, MAX_SHIFT, 2)
    return transform_from(matrix_from_axis_angle([0.0, 0.0, yaw]), [*shift, 0.0])


def random_hand_start(rng: np.random.Generator, highest: Array) -> Array:
    """``T_world_tcp`` (4, 4) of a hand that points down, clear of the object.

    Above the object and in front of its middle; well in front of what is taller than a hand's
    reach above a table.

    Args:
        rng: what it is drawn from.
        highest: (3,) the upper corner of the object's box, object frame, metres.
    """
    rotation = frame_from_z([0.0, 0.0, -1.0], rng.uniform(-np.pi / 2, np.pi / 2))
    position = rng.uniform([0.05, -0.2, 0.62], [0.25, 0.2, 0.72])
    front, _, top = highest
    if top > _TALL:
        position += [max(0.0, front + _CLEARANCE), 0.0, 0.2]
    else:
        position[2] += max(0.0, top + _CLEARANCE - 0.62)
    return transform_from(rotation, position)


def random_table(rng: np.random.Generator) -> Material:
    """How the table looks: plain, boards, cloth, stone or tiles, of any colour, matt."""
    red, green, blue = rng.uniform(0.2, 0.8, 3).tolist()
    plain = Material(color=(red, green, blue), roughness=0.8)
    kind = rng.choice(("plain", *_TABLES), p=(0.4, 0.25, 0.1, 0.15, 0.1))
    seed, share, choice = int(rng.integers(_TABLE_SEEDS)), rng.random(), rng.random()
    if kind == "plain":
        return plain
    patterns, (shortest, longest) = _TABLES[str(kind)]
    texture = Texture(
        pattern=patterns[int(choice * len(patterns))],
        seed=seed,
        tile=round(shortest + share * (longest - shortest), 3),
    )
    if kind == "wood":
        # From a brown as dark as its red to one as pale.
        paleness = 0.35 + 0.5 * green
        color = (red, red * (0.45 + 0.4 * paleness), red * (0.15 + 0.6 * paleness * blue))
        plain = replace(plain, color=color)
    return replace(plain, texture=texture)


def add_clutter(scene: sapien.Scene, rng: np.random.Generator, taken: Sequence[Footprint]) -> None:
    """Up to four blocks and cans on the table beside objects, for the eye alone.

    Args:
        scene: has a renderer.
        rng: what they are drawn from.
        taken: where objects stand.
    """
    places = list(taken)
    for _ in range(int(rng.integers(0, 5))):
        half = rng.uniform(0.015, 0.05, 3)
        center, yaw = rng.uniform(-0.4, 0.4, 2), rng.uniform(-np.pi, np.pi)
        upright, pattern = rng.random() < 0.5, rng.random() < 0.5
        red, green, blue = rng.uniform(0.05, 0.95, 3).tolist()
        look = Material(color=(red, green, blue), roughness=float(rng.uniform(0.3, 0.9)))
        if pattern:
            name = str(rng.choice(("stripes", "gingham", "granite", "twill")))
            look = replace(look, texture=Texture(pattern=name, seed=0, tile=0.1))
        place = Footprint(center, float(np.linalg.norm(half[:2])))
        if not place.is_free(places):
            continue
        places.append(place)
        block = Box(half_size=tuple(half.tolist()))
        can = Cylinder(radius=float(half[0]), half_length=float(half[2]))
        # A cylinder lies along x: stand it up.
        x, y, z = matrix_from_axis_angle([0.0, -np.pi / 2 if upright else 0.0, 0.0]).tolist()
        T_world_thing = transform_from(
            matrix_from_axis_angle([0.0, 0.0, yaw]), [*center, float(half[2])]
        )
        entity = sapien.Entity()
        entity.name = "clutter"
        shape = Shape(
            geometry=can if upright else block,
            position=(0.0, 0.0, 0.0),
            rotation=(tuple(x), tuple(y), tuple(z)),
            material=look,
        )
        entity.add_component(visual_body((shape,)))
        entity.pose = pose_from_transform(T_world_thing)
        scene.add_entity(entity)


def add_lights(scene: sapien.Scene, rng: np.random.Generator) -> None:
    """Ambient light and one or two lamps from random directions above.

    Most rooms are lit evenly and nearly white; some are dim or glaring, some lamps coloured.
    """
    ambient = rng.uniform(0.25, 0.5)
    mood = rng.random()
    if mood < 0.1:
        ambient *= 0.5
    tint = rng.uniform(0.8, 1.0, 3) if rng.random() < 0.2 else np.ones(3)
    scene.set_ambient_light((ambient * tint).tolist())
    for _ in range(int(rng.integers(1, 3))):
        azimuth, height = rng.uniform(-np.pi, np.pi), rng.uniform(0.6, 1.5)
        strength = rng.uniform(0.6, 1.6) * (1.35 if mood > 0.9 else 1.0)
        warmth = rng.uniform(0.85, 1.0)
        color = strength * np.array([1.0, 1.0, warmth])
        if rng.random() < 0.15:
            color *= rng.uniform(0.65, 1.0, 3)
        scene.add_directional_light([np.cos(azimuth), np.sin(azimuth), -height], color.tolist())
