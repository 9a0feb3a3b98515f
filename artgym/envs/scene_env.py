"""The environment of several objects on one table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from artgym.envs import arguments as checks
from artgym.envs.articulated_env import ArtOpenEnv
from artgym.errors import InvalidArgumentError
from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.geometry.transforms import apply, transform_from
from artgym.objects.model import ArticulatedObject
from artgym.sim.camera import ViewDistribution
from artgym.sim.scene import TABLE_HALF_SIZE, PlacedObject

Array = NDArray[np.floating]

#: What stands on a table among others is no longer, wider or higher than this at rest, metres.
MAX_EXTENT = 0.5
#: Clear space between two objects, wherever their parts are, metres.
CLEARANCE = 0.03
#: Tries to find an object that is small enough, and a place for one.
_TRIES = 200
#: How far beside objects stand open, at most.
_MOST_OPEN = 0.3


class ArtSceneEnv(ArtOpenEnv):
    """Open a part of one of several objects on a table.

    **Description.** Three to six objects stand on a table, one of them about its middle. The robot
    shall open that one's target part; the others are in the way of the eye and of the hand. Only
    objects that fit on a table among others take part: of at most 0.5 m.

    **Action.** As ``ArtOpenEnv``.

    **Observation.** As ``ArtOpenEnv``. The state modes tell of the target object alone; pictures
    and clouds show all of them.

    **Reward.** As ``ArtOpenEnv``.

    **Start.** As ``ArtOpenEnv``. The other objects stand anywhere on the table, turned anyhow,
    open by up to 0.3 of their ranges, clear of one another and of the way of the target's parts.

    **End.** As ``ArtOpenEnv``.

    **Arguments.**

    Args:
        num_objects: fewest and most objects, the target included.
        arguments: as ``ArtOpenEnv``.

    **Version history.** v0: first version.
    """

    def __init__(self, *, num_objects: tuple[int, int] = (3, 6), **arguments: Any) -> None:
        fewest, most = checks.require_range(
            "num_objects", num_objects, 1, 8, "the fewest and the most,"
        )
        if fewest > most:
            raise InvalidArgumentError(
                f"num_objects={num_objects!r}: expected the fewest first, then the most"
            )
        self._num_objects = fewest, most
        self._keep_arguments({"num_objects": num_objects})
        super().__init__(**arguments)

    def _draw_object(self, rng: np.random.Generator) -> ArticulatedObject:
        for _ in range(_TRIES):
            obj = super()._draw_object(rng)
            if _fits(obj):
                return obj
        raise InvalidArgumentError(
            f"among the objects given none of {_TRIES} drawn has part {self.target_part} and is "
            f"at most {MAX_EXTENT} m long, wide and high: give others, as laptops or staplers."
        )

    def _surroundings(
        self, target: PlacedObject, rng: np.random.Generator
    ) -> Sequence[PlacedObject]:
        fewest, most = self._num_objects
        count = int(rng.integers(fewest, most + 1))
        taken = [_disc(target, swept=True)]
        others: list[PlacedObject] = []
        for _ in range(_TRIES):
            if len(others) == count - 1:
                break
            other = self._draw_beside(rng)
            disc = _disc(other, swept=False)
            if _is_on_the_table(disc) and all(_apart(disc, each) for each in taken):
                taken.append(disc)
                others.append(other)
        return others

    def _draw_beside(self, rng: np.random.Generator) -> PlacedObject:
        """An object somewhere on the table."""
        obj = self._draw_object(rng)
        q = np.array([j.position(rng.uniform(0.0, _MOST_OPEN)) for j in obj.joints])
        turn = matrix_from_axis_angle([0.0, 0.0, rng.uniform(-np.pi, np.pi)])
        place = rng.uniform([-0.6, -0.6], [0.6, 0.6])
        return PlacedObject(model=obj, T_world_object=transform_from(turn, [*place, 0.0]), q=q)

    def _view_distribution(self, obj: ArticulatedObject) -> ViewDistribution:
        standard = ViewDistribution()
        near, far = standard.distance
        return ViewDistribution(distance=(1.4 * near, 1.4 * far))


def _fits(obj: ArticulatedObject) -> bool:
    """Whether an object is small enough to stand among others."""
    low, high = obj.rest_bounds
    return bool(np.all(high - low <= MAX_EXTENT))


def _disc(placed: PlacedObject, *, swept: bool) -> tuple[Array, float]:
    """Middle (2,) in the world and radius of a disc that holds an object seen from above.

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
    return middle, float(np.linalg.norm(seen - middle, axis=1).max())


def _is_on_the_table(disc: tuple[Array, float]) -> bool:
    middle, radius = disc
    return bool(np.all(np.abs(middle) + radius <= TABLE_HALF_SIZE[:2]))


def _apart(one: tuple[Array, float], other: tuple[Array, float]) -> bool:
    return bool(np.linalg.norm(one[0] - other[0]) >= one[1] + other[1] + CLEARANCE)
