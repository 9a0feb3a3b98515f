"""Directions of flat faces."""

from __future__ import annotations

import numpy as np
import pytest

from artgym.geometry.rotations import matrix_from_axis_angle
from icaf4_policy.anchors import AnchorConfig, anchors_from_config
from icaf4_policy.faces import face_directions, face_errors
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
