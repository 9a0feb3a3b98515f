"""The real frame's labels, read in the frames of this project."""

from __future__ import annotations

import numpy as np
import pytest

from artgym.geometry.camera import points_from_depth
from artgym.geometry.transforms import apply, invert
from benchmarks.real_frame import FRAME, pose_rows, true_boxes
from icaf4_policy import drawing


@pytest.fixture(scope="module")
def points_camera():
    depth = drawing.read_depth(FRAME / "depth_000000.png", 0.001)
    return points_from_depth(depth, drawing.read_intrinsics(FRAME / "intrinsics.json"))


def test_seen_points_lie_on_the_labelled_boxes(points_camera):
    for T_camera_box, (low, high) in zip(*true_boxes(), strict=True):
        inside = apply(invert(T_camera_box), points_camera.reshape(-1, 3))
        near = np.all((inside > low - 0.01) & (inside < high + 0.01), axis=1)
        # At two thirds of a metre a square centimetre is some two hundred pixels.
        assert near.sum() > 5000


def test_the_lid_turns_about_the_back_edge_of_the_base():
    (T_base, T_lid), bounds = true_boxes()
    np.testing.assert_allclose(T_base[:3, 1], T_lid[:3, 1], atol=0.02)
    hinge_on_base = apply(T_base, np.array([[bounds[0][0][0], 0.0, bounds[0][1][2]]]))
    hinge_on_lid = apply(T_lid, np.array([[bounds[1][0][0], 0.0, 0.0]]))
    assert np.linalg.norm(hinge_on_base - hinge_on_lid) < 0.02


def test_the_truth_has_no_error_and_a_missing_part_no_row():
    class Fit:
        T_camera_box = true_boxes()[0][0]

    class Prediction:
        part_boxes = (Fit(), None)

    base, lid = pose_rows(Prediction())
    assert base == {"rotation_deg": pytest.approx(0.0, abs=1e-5), "translation_m": 0.0}
    assert lid is None
