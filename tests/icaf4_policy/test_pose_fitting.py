import numpy as np
import pytest

from artgym.errors import InvalidArgumentError
from artgym.geometry.rotations import geodesic_angle, matrix_from_axis_angle
from icaf4_policy.pose_fitting import fit_pose, umeyama

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


def test_umeyama_broadcasts_and_weighs():
    nocs, points = correspondences()
    wrong = points.copy()
    wrong[:100] += 1.0
    weights = np.ones(len(nocs))
    weights[:100] = 0.0
    s, _, _ = umeyama(np.stack([nocs, nocs]), np.stack([points, wrong]), weights)
    np.testing.assert_allclose(s, [SCALE, SCALE])


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


def test_points_without_any_pose_give_a_finite_fit():
    fit = fit_pose(np.full((10, 3), 0.5), np.zeros((10, 3)), np.random.default_rng(0))
    assert np.isfinite(fit.T_camera_box).all()
    assert np.isfinite(fit.scale)


def test_shapes_are_checked():
    with pytest.raises(InvalidArgumentError, match=r"nocs \(3, 3\)"):
        fit_pose(np.zeros((3, 3)), np.zeros((3, 3)), np.random.default_rng(0))
