"""The environment of several objects on one table."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from artgym.envs import arguments as checks
from artgym.envs.articulated_env import ArtOpenEnv
from artgym.errors import InvalidArgumentError
from artgym.objects.model import ArticulatedObject
from artgym.sim.camera import ViewDistribution
from artgym.sim.scene import PlacedObject
from artgym.sim.tabletop import MAX_EXTENT, fits_among_others, footprint, random_place

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
            if fits_among_others(obj):
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
        taken = [footprint(target, swept=True)]
        others: list[PlacedObject] = []
        for _ in range(_TRIES):
            if len(others) == count - 1:
                break
            other = self._draw_beside(rng)
            place = footprint(other, swept=False)
            if place.is_free(taken):
                taken.append(place)
                others.append(other)
        return others

    def _draw_beside(self, rng: np.random.Generator) -> PlacedObject:
        """An object somewhere on the table."""
        obj = self._draw_object(rng)
        q = np.array([j.position(rng.uniform(0.0, _MOST_OPEN)) for j in obj.joints])
        return PlacedObject(model=obj, T_world_object=random_place(rng, 0.6), q=q)

    def _view_distribution(self, obj: ArticulatedObject) -> ViewDistribution:
        standard = ViewDistribution()
        near, far = standard.distance
        return ViewDistribution(distance=(1.4 * near, 1.4 * far))
