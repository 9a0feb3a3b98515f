"""Normals of a surface of which only points are known."""

from __future__ import annotations

import numpy as np

from artgym.geometry.normals import plane_normals, surface_normals
from artgym.geometry.rotations import matrix_from_axis_angle

CAMERA = np.array([0.4, -0.3, 1.0])


def seen_box(count=6000):
    """Points on the sides of a cube that a camera at ``CAMERA`` sees, and their normals."""
    rng = np.random.default_rng(0)
    axis = rng.integers(0, 3, count)
    normals = np.eye(3)[axis] * np.sign(CAMERA)[axis, None]
    points = rng.uniform(-0.1, 0.1, (count, 3))
    points[np.arange(count), axis] = 0.1 * np.sign(CAMERA)[axis]
    return points, normals


def test_normals_are_those_of_the_surface_on_the_cameras_side():
    points, normals = seen_box()
    at = np.arange(0, len(points), 3)
    found = surface_normals(points, at, CAMERA)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)
    inside = (np.sort(np.abs(points[at]), axis=1)[:, 1] < 0.08) & (np.abs(points[at]).max(1) > 0.09)
    assert inside.sum() > 500
    assert (np.sum(found * normals[at], axis=1)[inside] > 0.999).all()
    assert (np.sum(found * (CAMERA - points[at]), axis=1) >= 0).all()


def test_a_plane_is_the_one_from_which_its_points_are_least_far():
    rng = np.random.default_rng(3)
    turns = matrix_from_axis_angle(rng.normal(size=(60, 3)))
    for thick in ([1, 0.3, 0.01], [1, 1, 0], [1, 0.5, 0.49], [1, 1e-4, 1e-5], [1, 0, 0], [0] * 3):
        # As far away as a camera is, and as small as what is around a point.
        groups = 0.01 * (rng.normal(size=(60, 16, 3)) * thick) @ turns + 1.0
        found = rng.uniform(size=(60, 16)) < 0.8
        index = np.arange(60 * 16).reshape(60, 16)
        of_all = (np.repeat(a, 16, axis=0) for a in (index, found))
        normals = plane_normals(groups.reshape(-1, 3), *of_all, np.zeros(3))[::16]
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-9)
        for normal, group, used in zip(normals, groups, found, strict=True):
            offset = group[used] - group[used].mean(axis=0)
            values = np.linalg.eigvalsh(offset.T @ offset)
            least = normal @ offset.T @ offset @ normal
            assert least <= values[0] + 1e-7 * values[2] + 1e-20


def test_a_long_cloud_has_the_normals_of_some_of_its_points():
    points, _ = seen_box(9000)
    at = np.arange(9000)
    kept = np.linspace(0, 8999, 4096).round().astype(int)
    found = surface_normals(points, at, CAMERA)
    np.testing.assert_array_equal(
        found[kept], surface_normals(points[kept], np.arange(4096), CAMERA)
    )
    nearest = np.linalg.norm(points[:200, None] - points[kept], axis=-1).argmin(axis=1)
    np.testing.assert_array_equal(found[:200], found[kept[nearest]])


def test_normals_turn_with_the_cloud():
    points, _ = seen_box(1500)
    R, t = matrix_from_axis_angle([0.3, -0.8, 1.1]), np.array([0.2, 0.5, -3.0])
    here = surface_normals(points, np.arange(1500), CAMERA)
    there = surface_normals(points @ R.T + t, np.arange(1500), R @ CAMERA + t)
    # Where a plane is badly determined, rounding may choose another.
    assert np.quantile(np.linalg.norm(here @ R.T - there, axis=1), 0.99) < 1e-6
