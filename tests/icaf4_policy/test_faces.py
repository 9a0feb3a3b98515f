"""Directions of flat faces."""

from __future__ import annotations

import numpy as np
import pytest

from artgym.geometry.rotations import geodesic_angle, matrix_from_axis_angle
from icaf4_policy.anchors import AnchorConfig, anchors_from_config
from icaf4_policy.faces import face_directions, face_errors, has_walls, square_rotations
from icaf4_policy.targets import targets_from_sample
from tests.icaf4_policy.toy import toy_picture

R_BOX = matrix_from_axis_angle([0.4, -1.0, 0.3])


def normals_around(direction, count, spread, rng):
    """Unit vectors about a direction, radians."""
    vectors = np.asarray(direction) + rng.normal(scale=spread, size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def turned(angle, seed):
    """``R_BOX`` as a fit has it that is off by an angle."""
    axis = np.random.default_rng(seed).normal(size=3)
    return matrix_from_axis_angle(angle * axis / np.linalg.norm(axis)) @ R_BOX


def degrees_between(a, b):
    return np.degrees(np.arccos(np.clip(np.sum(a * b, axis=-1), -1.0, 1.0)))


@pytest.mark.parametrize("seed", range(5))
def test_faces_of_a_box_are_found_beside_edges_whichever_way_they_face(seed):
    rng = np.random.default_rng(seed)
    signs = rng.choice([-1.0, 1.0], 3)
    faces = [normals_around(s * R_BOX[:, i], 150, 0.01, rng) for i, s in enumerate(signs)]
    edges = normals_around(np.zeros(3), 150, 1.0, rng)
    off = turned(np.radians(8.0), seed)
    directions, found = face_directions(np.concatenate([*faces, edges]), off)
    assert found.all()
    assert degrees_between(directions, R_BOX.T).max() < 0.5
    assert np.all(np.sum(directions * off.T, axis=1) > 0)


def test_of_two_faces_near_an_axis_the_larger_counts():
    rng = np.random.default_rng(0)
    slope = matrix_from_axis_angle(np.radians(10.0) * R_BOX[:, 0]) @ R_BOX[:, 2]
    large, small = normals_around(R_BOX[:, 2], 200, 0.01, rng), normals_around(slope, 80, 0.01, rng)
    for normals, expected in ([large, small], R_BOX[:, 2]), ([large[:60], small], slope):
        directions, found = face_directions(np.concatenate(normals), R_BOX)
        assert found.tolist() == [False, False, True]
        assert degrees_between(directions[2], expected) < 0.5


def test_what_is_round_or_small_has_no_face_of_its_own():
    rng = np.random.default_rng(0)
    ball = normals_around(np.zeros(3), 2000, 1.0, rng)
    few = np.concatenate([normals_around(R_BOX[:, 1], 15, 0.01, rng), ball[:5]])
    for normals in (ball, few, np.zeros((0, 3))):
        directions, found = face_directions(normals, R_BOX)
        assert not found.any()
        assert not directions.any()


def test_a_face_far_from_the_axis_is_none_of_its():
    rng = np.random.default_rng(0)
    face = normals_around(R_BOX[:, 0], 300, 0.01, rng)
    _, found = face_directions(face, turned(np.radians(30.0), 1))
    assert not found[0]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("sides", [[0], [0, 1]])
def test_walls_tell_how_an_upright_box_is_turned_but_for_quarters(seed, sides):
    rng = np.random.default_rng(seed)
    up = R_BOX[:, 2]
    walls = [normals_around(rng.choice([-1, 1]) * R_BOX[:, i], 150, 0.01, rng) for i in sides]
    rest = [normals_around(up, 250, 0.01, rng), normals_around(np.zeros(3), 50, 1.0, rng)]
    rotations = square_rotations(np.concatenate([*walls, *rest]), up)
    assert np.degrees(geodesic_angle(rotations, R_BOX).min()) < 0.5
    np.testing.assert_allclose(np.linalg.det(rotations), 1.0)
    np.testing.assert_allclose(rotations[:, :, 2], np.tile(up, (4, 1)), atol=1e-12)
    np.testing.assert_allclose(rotations[1:, :, 0], rotations[:-1, :, 1], atol=1e-12)


def test_what_is_round_or_without_walls_is_turned_anyhow():
    rng = np.random.default_rng(0)
    up = R_BOX[:, 2]
    column = rng.normal(size=(500, 3)) @ (np.eye(3) - np.outer(up, up))
    column /= np.linalg.norm(column, axis=1, keepdims=True)
    lid = normals_around(up, 500, 0.01, rng)
    few = np.concatenate([lid, normals_around(R_BOX[:, 0], 80, 0.01, rng)])
    for normals in (column, lid, few, np.zeros((0, 3))):
        assert square_rotations(normals, up) is None


def test_walls_need_both_horizontal_axes():
    assert has_walls((0.001, 0.01, None))
    assert not has_walls((None, 0.001, 0.001))
    assert not has_walls((0.001, 0.03, 0.001))


@pytest.fixture(scope="module")
def targets():
    anchors = anchors_from_config(AnchorConfig())
    samples = [toy_picture(seed, num_points=2500).samples[0] for seed in range(40)]
    return [targets_from_sample(sample, ("toy",), anchors, 4096, "none") for sample in samples]


def test_errors_of_flat_parts_are_small_in_views_whose_boxes_are_known(targets):
    errors = face_errors(targets, 2)
    for of_part in errors:
        assert of_part[2] is not None
        assert np.degrees(of_part[2]) < 0.2


def test_few_views_tell_no_errors(targets):
    assert face_errors(targets[:19], 2) == ((None,) * 3,) * 2
    assert face_errors([], 1) == ((None,) * 3,)
