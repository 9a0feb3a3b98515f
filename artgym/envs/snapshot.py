"""An episode written down, so that it can be gone on with from any of its steps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Snapshot:
    """Where an episode stands: how it began and what was done since.

    The simulator keeps contacts from step to step that nobody can read or set, so an episode is
    brought back by doing the same again in a new scene: to the last bit, mid-grasp too.

    Attributes:
        environment: class and arguments of the environment it was taken of.
        generator: state of its random generator before the reset.
        options: of that reset.
        actions: (n, A) float64, all that was done since.
        cloud_generator: state of the generator that draws the points of clouds, before the last
            observation.
    """

    environment: tuple[str, Mapping[str, Any]]
    generator: Mapping[str, Any]
    options: Mapping[str, Any]
    actions: NDArray[np.float64]
    cloud_generator: Mapping[str, Any]
