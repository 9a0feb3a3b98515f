"""What a detector is given of depth that has holes."""

from __future__ import annotations

import numpy as np

from icaf4_policy.detector.inference import without_holes


def steps():
    """Two planes side by side, 60x80."""
    depth = np.full((60, 80), 1.0, dtype=np.float32)
    depth[:, 40:] = 2.0
    return depth


def test_holes_have_the_depth_of_what_is_nearest():
    whole = steps()
    holed = whole.copy()
    holed[10:14, 20:26] = holed[30:34, 36:39] = holed[50, 41:45] = holed[0, 0] = 0.0
    np.testing.assert_array_equal(without_holes(holed), whole)


def test_where_nothing_is_nothing_is_filled():
    depth = steps()
    depth[:20] = 0.0
    depth[40:42, 10] = 0.0
    filled = without_holes(depth)
    assert not filled[:20].any()
    np.testing.assert_array_equal(filled[20:], steps()[20:])
    np.testing.assert_array_equal(without_holes(np.zeros_like(depth)), np.zeros_like(depth))


def test_depth_without_holes_stays():
    whole = steps()
    assert without_holes(whole) is whole
