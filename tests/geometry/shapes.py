"""Random rotations and transforms of every batch shape and every size of angle."""

from __future__ import annotations

import numpy as np

BATCH_SHAPES = [(), (1,), (3, 2)]
#: Radians: nearly nothing, small, anything, nearly half a turn.
ANGLES = [1e-12, 1e-9, 1e-6, 1e-3, 1.0, np.pi - 1e-6]


def random_rotvec(rng: np.random.Generator, batch: tuple[int, ...], angle: float) -> np.ndarray:
    """Rotation vectors (*batch, 3) of a given angle in radians."""
    axis = rng.normal(size=(*batch, 3))
    return angle * axis / np.linalg.norm(axis, axis=-1, keepdims=True)
