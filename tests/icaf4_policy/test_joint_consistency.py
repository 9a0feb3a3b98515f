"""Fits made to agree with joints."""

from __future__ import annotations

import numpy as np
import pytest

from artgym.datasets.sample import JOINT_NONE, JOINT_PRISMATIC, JOINT_REVOLUTE
from artgym.errors import InvalidArgumentError
from artgym.geometry.rotations import geodesic_angle, matrix_from_axis_angle
from artgym.geometry.screw import joint_motion
from artgym.geometry.transforms import apply, transform_from
from icaf4_policy.joint_consistency import AxisDirection, ConsistencyConfig, consistent_fits
from icaf4_policy.pose_fitting import fit_pose

R_CAMERA_BASE = matrix_from_axis_angle([0.3, 1.0, -2.0])
AXIS_BASE = np.array([0.0, 0.6, 0.8])
AXES_CAMERA = np.stack([np.zeros(3), R_CAMERA_BASE @ AXIS_BASE])
SCALE = 0.36
CODES = {"prismatic": JOINT_PRISMATIC, "revolute": JOINT_REVOLUTE}


def pair(joint_type, q, *, noise=0.0, distortion=0.0, seed=0):
    """Coordinates and points of base and part, and the true poses."""
    rng = np.random.default_rng(seed)
    T_camera_base = transform_from(R_CAMERA_BASE, [0.1, -0.2, 0.9])
    motion = joint_motion(joint_type, AXIS_BASE, [0.1, 0.0, 0.1], q)
    truth = [T_camera_base, T_camera_base @ motion]
    flat = rng.uniform(-0.5, 0.5, (2, 300, 3)) * [0.8, 0.5, 0.05]
    points = [apply(T, SCALE * x) for T, x in zip(truth, flat, strict=True)]
    nocs = [
        x @ (np.eye(3) + rng.normal(scale=distortion, size=(3, 3)))
        + rng.normal(scale=noise, size=x.shape)
        + 0.5
        for x in flat
    ]
    return nocs, points, truth


def along(camera, *, part=0, axis=2, error=1e-4):
    """That an axis points somewhere."""
    return [AxisDirection(part=part, axis=axis, camera=np.asarray(camera), error=error)]


def fits_of(nocs, points):
    return tuple(
        fit_pose(x, y, np.random.default_rng(i))
        for i, (x, y) in enumerate(zip(nocs, points, strict=True))
    )


def errors_deg(fits, truth):
    pairs = zip(fits, truth, strict=True)
    return [np.degrees(geodesic_angle(f.T_camera_box[:3, :3], T[:3, :3])) for f, T in pairs]


@pytest.mark.parametrize(("joint_type", "q"), [("prismatic", 0.3), ("revolute", 1.2)])
def test_exact_fits_stay_whatever_is_said_about_the_joint(joint_type, q):
    nocs, points, truth = pair(joint_type, q)
    fits = fits_of(nocs, points)
    wrong = matrix_from_axis_angle([0.2, 0.0, 0.1]) @ AXES_CAMERA[1]
    for code in CODES.values():
        for axis in (AXES_CAMERA[1], wrong):
            found = consistent_fits(fits, nocs, points, [JOINT_NONE, code], [np.zeros(3), axis])
            assert max(errors_deg(found, truth)) < 1e-3
            for fit, T in zip(found, truth, strict=True):
                np.testing.assert_allclose(fit.T_camera_box[:3, 3], T[:3, 3], atol=1e-5)


@pytest.mark.parametrize(("joint_type", "q"), [("prismatic", 0.2), ("revolute", 0.4)])
def test_fits_agree_with_the_joint_and_are_better_for_it(joint_type, q):
    before, after, joint_errors = [], [], []
    for seed in range(20):
        nocs, points, truth = pair(joint_type, q, noise=0.02, distortion=0.04, seed=seed)
        fits = fits_of(nocs, points)
        codes = [JOINT_NONE, CODES[joint_type]]
        found = consistent_fits(fits, nocs, points, codes, AXES_CAMERA)
        before += errors_deg(fits, truth)
        after += errors_deg(found, truth)
        R_relative = found[1].T_camera_box[:3, :3] @ found[0].T_camera_box[:3, :3].T
        if joint_type == "prismatic":
            joint_errors.append(geodesic_angle(R_relative, np.eye(3)))
    assert np.mean(after) < 0.95 * np.mean(before)
    assert np.max(joint_errors, initial=0.0) < 2e-3


def test_a_joint_that_the_points_contradict_is_left_out():
    nocs, points, truth = pair("revolute", 1.2, noise=0.02)
    fits = fits_of(nocs, points)
    found = consistent_fits(fits, nocs, points, [JOINT_NONE, JOINT_PRISMATIC], AXES_CAMERA)
    assert found == fits
    assert max(errors_deg(found, truth)) < 1.0


def test_only_the_wrong_joint_of_two_is_left_out():
    nocs, points, _ = pair("revolute", 1.2, noise=0.02, distortion=0.02)
    fits = fits_of(nocs, points)
    three = [(*a, a[1]) for a in (fits, nocs, points)]
    codes = [JOINT_NONE, JOINT_REVOLUTE, JOINT_PRISMATIC]
    found = consistent_fits(*three, codes, AXES_CAMERA[[0, 1, 1]])
    assert found[1] is not fits[1]
    assert found[2] is fits[1]


def test_parts_without_fit_or_joint_are_passed_through():
    nocs, points, _ = pair("revolute", 1.0, noise=0.02)
    fits = fits_of(nocs, points)
    for some in ((None, fits[1]), (fits[0], None)):
        codes = [JOINT_NONE, JOINT_REVOLUTE]
        assert consistent_fits(some, nocs, points, codes, AXES_CAMERA) == some
    assert consistent_fits(fits, nocs, points, [JOINT_NONE] * 2, AXES_CAMERA) == fits


@pytest.mark.parametrize(("joint_type", "q"), [("prismatic", 0.2), ("revolute", 0.4)])
def test_an_upright_base_stands_and_is_better_for_it(joint_type, q):
    up = R_CAMERA_BASE[:, 2]
    before, after = [], []
    for seed in range(20):
        nocs, points, truth = pair(joint_type, q, noise=0.02, distortion=0.04, seed=seed)
        fits = fits_of(nocs, points)
        given = (fits, nocs, points, [JOINT_NONE, CODES[joint_type]], AXES_CAMERA)
        found = consistent_fits(*given, directions=along(up))
        assert np.degrees(np.arccos(found[0].T_camera_box[:3, 2] @ up)) < 0.05
        before += errors_deg(consistent_fits(*given), truth)
        after += errors_deg(found, truth)
    assert np.mean(after) < 0.8 * np.mean(before)


def test_an_upright_base_needs_no_joints():
    nocs, points, truth = pair("revolute", 1.0, noise=0.02, distortion=0.04)
    fits = fits_of(nocs, points)
    upright = along(R_CAMERA_BASE[:, 2])
    found = consistent_fits(fits, nocs, points, [JOINT_NONE] * 2, AXES_CAMERA, directions=upright)
    assert errors_deg(found, truth)[0] < errors_deg(fits, truth)[0]
    assert found[1] is fits[1]


def test_a_vertical_that_the_points_contradict_is_left_out():
    nocs, points, truth = pair("revolute", 1.2, noise=0.02)
    fits = fits_of(nocs, points)
    lying = along(R_CAMERA_BASE[:, 1])
    codes = [JOINT_NONE, JOINT_REVOLUTE]
    found = consistent_fits(fits, nocs, points, codes, AXES_CAMERA, directions=lying)
    expected = consistent_fits(fits, nocs, points, codes, AXES_CAMERA)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one.T_camera_box, other.T_camera_box)
    assert max(errors_deg(found, truth)) < 1.0


def test_directions_of_one_part_help_the_other_across_a_slide():
    before, after = [], []
    for seed in range(20):
        nocs, points, truth = pair("prismatic", 0.2, noise=0.02, distortion=0.04, seed=seed)
        fits = fits_of(nocs, points)
        seen = along(truth[1][:3, 0], part=1, axis=0) + along(truth[1][:3, 1], part=1, axis=1)
        given = (fits, nocs, points, [JOINT_NONE, JOINT_PRISMATIC], AXES_CAMERA)
        before += errors_deg(consistent_fits(*given), truth)
        after += errors_deg(consistent_fits(*given, directions=seen), truth)
    assert np.mean(before) > 1.0
    assert np.max(after) < 0.1


def test_a_direction_counts_by_its_error():
    nocs, points, truth = pair("revolute", 1.0, noise=0.02, distortion=0.04)
    fits = fits_of(nocs, points)
    given = (fits, nocs, points, [JOINT_NONE] * 2, AXES_CAMERA)
    up = truth[0][:3, 2]
    off = [
        np.arccos(
            consistent_fits(*given, directions=along(up, error=error))[0].T_camera_box[:3, 2] @ up
        )
        for error in (1e-4, 0.02, 0.1, 10.0)
    ]
    assert np.all(np.diff(off) > 0)
    assert off[-1] == pytest.approx(np.arccos(fits[0].T_camera_box[:3, 2] @ up), rel=1e-2)


def test_directions_of_a_part_without_fit_are_passed_over():
    nocs, points, _ = pair("revolute", 1.0, noise=0.02)
    fits = (None, fits_of(nocs, points)[1])
    given = (fits, nocs, points, [JOINT_NONE, JOINT_REVOLUTE], AXES_CAMERA)
    assert consistent_fits(*given, directions=along(R_CAMERA_BASE[:, 2])) == fits


def test_lengths_are_checked():
    nocs, points, _ = pair("revolute", 1.0)
    with pytest.raises(InvalidArgumentError, match="same parts, not of 2, 2, 2, 1, 2"):
        consistent_fits(fits_of(nocs, points), nocs, points, [JOINT_NONE], AXES_CAMERA)


def test_bad_options():
    with pytest.raises(InvalidArgumentError, match="worse=nan"):
        ConsistencyConfig(worse=float("nan"))
