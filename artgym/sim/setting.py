"""What is random about a scene besides its object: placement, table, lights.

Episodes and pictures draw from here, so that a network meets in one what it saw in the other.
"""

from __future__ import annotations

import numpy as np
import sapien
from numpy.typing import NDArray

from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.geometry.transforms import transform_from
from artgym.objects.model import Material

Array = NDArray[np.floating]

#: Largest turn of an object about the vertical, radians, and largest shift along x and y, metres.
MAX_YAW, MAX_SHIFT = 0.35, 0.05


def random_placement(rng: np.random.Generator) -> Array:
    """``T_world_object`` (4, 4) of an object that stands about the table's middle, facing +x."""
    yaw = rng.uniform(-MAX_YAW, MAX_YAW)
    shift = rng.uniform(-MAX_SHIFT, MAX_SHIFT, 2)
    return transform_from(matrix_from_axis_angle([0.0, 0.0, yaw]), [*shift, 0.0])


def random_table(rng: np.random.Generator) -> Material:
    """How the table looks: any colour, matt."""
    red, green, blue = rng.uniform(0.2, 0.8, 3).tolist()
    return Material(color=(red, green, blue), roughness=0.8)


def add_lights(scene: sapien.Scene, rng: np.random.Generator) -> None:
    """Ambient light and one or two lamps from random directions above."""
    ambient = rng.uniform(0.25, 0.5)
    scene.set_ambient_light([ambient] * 3)
    for _ in range(int(rng.integers(1, 3))):
        azimuth, height = rng.uniform(-np.pi, np.pi), rng.uniform(0.6, 1.5)
        strength = rng.uniform(0.6, 1.6)
        warmth = rng.uniform(0.85, 1.0)
        scene.add_directional_light(
            [np.cos(azimuth), np.sin(azimuth), -height], [strength, strength, strength * warmth]
        )
