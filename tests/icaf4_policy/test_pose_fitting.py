import numpy as np
import pytest

from artgym.errors import InvalidArgumentError
from artgym.geometry.rotations import geodesic_angle, matrix_from_axis_angle
from artgym.geometry.transforms import apply, transform_from
from icaf4_policy.pose_fitting import _from_triangle, fit_pose, fit_turned, umeyama

R_CAMERA_BOX = matrix_from_axis_angle([0.3, 1.0, -2.0])
T_BOX = np.array([0.1, -0.2, 0.9])
SCALE = 0.36


def correspondences(count=400, seed=0):
    rng = np.random.default_rng(seed)
    nocs = rng.uniform(size=(count, 3)) * [0.8, 0.5, 0.1] + [0.1, 0.25, 0.45]
    return nocs, SCALE * (nocs - 0.5) @ R_CAMERA_BOX.T + T_BOX


def test_umeyama_is_exact():
    nocs, points = correspondences()
    s, R, t = umeyama(nocs, points, np.ones(len(nocs)))
    np.testing.assert_allclose(s, SCALE)
    np.testing.assert_allclose(R, R_CAMERA_BOX, atol=1e-12)
    np.testing.assert_allclose(s * nocs @ R.T + t, points, atol=1e-12)


def test_umeyama_never_mirrors():
    nocs, points = correspondences()
    _, R, _ = umeyama(nocs, points * [1, 1, -1], np.ones(len(nocs)))
    np.testing.assert_allclose(np.linalg.det(R), 1.0)


def test_umeyama_weighs():
    nocs, points = correspondences()
    points[:100] += 1.0
    weights = np.ones(len(nocs))
    weights[:100] = 0.0
    s, _, _ = umeyama(nocs, points, weights)
    assert s == pytest.approx(SCALE)


@pytest.mark.parametrize("share", [0.0, 0.2, 0.4])
def test_fit_is_exact_despite_outliers(share):
    nocs, points = correspondences()
    rng = np.random.default_rng(1)
    bad = rng.permutation(len(nocs))[: int(share * len(nocs))]
    points[bad] += rng.uniform(0.1, 0.4, (len(bad), 3)) * rng.choice([-1, 1], (len(bad), 3))
    fit = fit_pose(nocs, points, rng)
    assert geodesic_angle(fit.T_camera_box[:3, :3], R_CAMERA_BOX) < 1e-9
    # The box frame's origin is where the normalised coordinates are 0.5.
    np.testing.assert_allclose(fit.T_camera_box[:3, 3], T_BOX, atol=1e-9)
    assert fit.scale == pytest.approx(SCALE)
    assert fit.inlier_share == pytest.approx(1 - share, abs=0.02)


def test_same_seed_same_fit():
    nocs, points = correspondences()
    points += np.random.default_rng(2).normal(scale=0.01, size=points.shape)
    first, second = (fit_pose(nocs, points, np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first.T_camera_box, second.T_camera_box)


def test_a_moved_cloud_gives_a_moved_fit():
    nocs, points = correspondences()
    points += np.random.default_rng(2).normal(scale=0.005, size=points.shape)
    T_moved_camera = transform_from(matrix_from_axis_angle([2.0, -0.4, 0.5]), [0.3, 0.1, -0.7])
    fit, moved = (
        fit_pose(nocs, cloud, np.random.default_rng(3))
        for cloud in (points, apply(T_moved_camera, points))
    )
    np.testing.assert_allclose(moved.T_camera_box, T_moved_camera @ fit.T_camera_box, atol=1e-9)
    assert moved.scale == pytest.approx(fit.scale)


def test_three_points_are_fitted_as_umeyama_does():
    rng = np.random.default_rng(4)
    for _ in range(20):
        source, target = rng.normal(size=(2, 3, 3))
        M, t = np.empty((3, 3)), np.empty(3)
        assert _from_triangle(source, target, np.arange(3), M, t)
        s, R, t_umeyama = umeyama(source, target, np.ones(3))
        np.testing.assert_allclose(M, s * R, atol=1e-9)
        np.testing.assert_allclose(t, t_umeyama, atol=1e-9)


@pytest.mark.parametrize("count", [4, 400])
def test_a_flat_part_has_one_pose(count):
    nocs, points = correspondences(count)
    points -= SCALE * (nocs[:, 2:] - 0.5) * R_CAMERA_BOX[:, 2]
    nocs[:, 2] = 0.5
    fit = fit_pose(nocs, points, np.random.default_rng(0))
    assert geodesic_angle(fit.T_camera_box[:3, :3], R_CAMERA_BOX) < 1e-9


def test_repeated_points_do_no_harm():
    nocs, points = correspondences(20)
    nocs, points = np.repeat(nocs, 50, axis=0), np.repeat(points, 50, axis=0)
    fit = fit_pose(nocs, points, np.random.default_rng(0))
    np.testing.assert_allclose(fit.T_camera_box[:3, 3], T_BOX, atol=1e-9)


@pytest.mark.parametrize("line", [np.zeros((50, 1)), np.linspace(-0.4, 0.4, 50)[:, None]])
def test_points_on_a_line_or_in_one_place_give_a_fit_that_suits_them(line):
    nocs = line * [1.0, 0.0, 0.0] + 0.5
    points = SCALE * line * R_CAMERA_BOX[:, 0] + T_BOX
    fit = fit_pose(nocs, points, np.random.default_rng(0))
    box = SCALE * (nocs - 0.5) @ fit.T_camera_box[:3, :3].T + fit.T_camera_box[:3, 3]
    np.testing.assert_allclose(box, points, atol=1e-9)
    np.testing.assert_allclose(np.linalg.det(fit.T_camera_box), 1.0)


def test_points_without_any_pose_give_a_finite_fit():
    fit = fit_pose(np.full((10, 3), 0.5), np.zeros((10, 3)), np.random.default_rng(0))
    assert np.isfinite(fit.T_camera_box).all()
    assert np.isfinite(fit.scale)


def test_shapes_are_checked():
    with pytest.raises(InvalidArgumentError, match=r"nocs \(3, 3\)"):
        fit_pose(np.zeros((3, 3)), np.zeros((3, 3)), np.random.default_rng(0))
    with pytest.raises(InvalidArgumentError, match=r"weights \(3,\)"):
        umeyama(np.zeros((4, 3)), np.zeros((4, 3)), np.ones(3))


def test_values_that_are_not_finite_are_named():
    nocs, points = correspondences(10)
    points[7, 1] = np.nan
    with pytest.raises(InvalidArgumentError, match=r"points_camera\[7\] is .*nan.*leave out"):
        fit_pose(nocs, points, np.random.default_rng(0))


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_a_known_rotation_leaves_place_and_size(share):
    nocs, points = correspondences()
    wrong = np.random.default_rng(1).random(len(nocs)) < share
    points[wrong] += np.random.default_rng(2).normal(scale=0.5, size=(int(wrong.sum()), 3))
    fit = fit_turned(nocs, points, R_CAMERA_BOX)
    assert fit.scale == pytest.approx(SCALE, rel=0.02)
    np.testing.assert_allclose(fit.T_camera_box[:3, 3], T_BOX, atol=0.005)
    assert fit.inlier_share == pytest.approx(1.0 - share, abs=0.06)


def test_a_rotation_that_coordinates_run_against_has_no_size():
    nocs, points = correspondences()
    half_turn = matrix_from_axis_angle([0.0, 0.0, np.pi])
    fit = fit_turned(nocs, points, R_CAMERA_BOX @ half_turn)
    assert (fit.scale, fit.inlier_share) == (0.0, 0.0)
    assert np.isfinite(fit.T_camera_box).all()
