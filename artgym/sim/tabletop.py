"""Where several objects have room on one table."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.geometry.transforms import apply, transform_from
from artgym.objects.model import ArticulatedObject
from artgym.sim.scene import TABLE_HALF_SIZE, PlacedObject

Array = NDArray[np.floating]

#: What stands on a table among others is no longer, wider or higher than this at rest, metres.
MAX_EXTENT = 0.5
#: Clear space between two objects, wherever their parts are, metres.
CLEARANCE = 0.03


class Footprint(NamedTuple):
    """A disc that holds an object seen from above: middle (2,) in the world and radius, metres."""

    middle: Array
    radius: float

    def is_free(self, taken: Iterable[Footprint]) -> bool:
        """Whether it lies on the table, clear of others."""
        on_table = np.all(np.abs(self.middle) + self.radius <= TABLE_HALF_SIZE[:2])
        return bool(on_table) and all(
            np.linalg.norm(self.middle - other.middle) >= self.radius + other.radius + CLEARANCE
            for other in taken
        )


def footprint(placed: PlacedObject, *, swept: bool) -> Footprint:
    """The disc below an object.

    Args:
        placed: the object.
        swept: wherever its parts may come to, else where they are.
    """
    obj = placed.model
    states = [placed.q]
    if swept:
        states += [np.array([j.position(f) for j in obj.joints]) for f in (0.0, 0.5, 1.0)]
    corners = np.concatenate(
        [
            apply(T, shape.corners_link())
            for q in states
            for T, link in zip(obj.link_poses(q), obj.links, strict=True)
            for shape in link.shapes
        ]
    )
    seen = apply(placed.T_world_object, corners)[:, :2]
    middle = (seen.min(axis=0) + seen.max(axis=0)) / 2
    return Footprint(middle, float(np.linalg.norm(seen - middle, axis=1).max()))


def fits_among_others(obj: ArticulatedObject) -> bool:
    """Whether an object is small enough to stand among others."""
    low, high = obj.rest_bounds
    return bool(np.all(high - low <= MAX_EXTENT))


def random_place(rng: np.random.Generator, half_side: float) -> Array:
    """``T_world_object`` (4, 4) of an object turned anyhow in a square of the table, metres."""
    turn = matrix_from_axis_angle([0.0, 0.0, rng.uniform(-np.pi, np.pi)])
    return transform_from(turn, [*rng.uniform([-half_side] * 2, [half_side] * 2), 0.0])
