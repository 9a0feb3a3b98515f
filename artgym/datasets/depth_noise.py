"""Depth as a structured-light or stereo sensor tells it: quantised, noisy, missing at edges.

Such a sensor measures disparity, which is inverse to depth: its steps and its noise grow with the
square of the distance. Where depth jumps, one of its two eyes sees nothing, and it gives up.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

#: Distance of the sensor's two eyes, metres, as of a hand-sized stereo camera.
_BASELINE = 0.05
#: Smallest step of disparity and its standard deviation, pixels.
_STEP, _DEVIATION = 1.0 / 16.0, 0.04
#: Depth that changes by more than this share from a pixel to the next is an edge.
_JUMP = 0.02
#: Share of the edge's pixels that are missing, and of all others.
_MISSING_AT_EDGES, _MISSING = 0.7, 0.002


def sensed_depth(
    depth: NDArray[np.float32], intrinsics: NDArray[np.floating], rng: np.random.Generator
) -> NDArray[np.float32]:
    """What the sensor says of a picture.

    Args:
        depth: (H, W), metres along z, 0 where nothing was seen.
        intrinsics: (3, 3) of the camera.
        rng: what the errors are drawn from.

    Returns:
        (H, W), metres, 0 where the sensor sees nothing.
    """
    seen = depth > 0
    focal_baseline = float(intrinsics[0, 0]) * _BASELINE
    disparity = focal_baseline / np.where(seen, depth, np.inf)
    disparity += rng.normal(0.0, _DEVIATION, depth.shape) * seen
    disparity = np.maximum(np.round(disparity / _STEP), 1.0) * _STEP
    sensed = np.where(seen, focal_baseline / disparity, 0.0)
    jump = maximum_filter(depth, 3) - minimum_filter(depth, 3) > _JUMP * depth
    missing = rng.random(depth.shape) < np.where(jump, _MISSING_AT_EDGES, _MISSING)
    return np.where(missing, 0.0, sensed).astype(np.float32)
