"""Statistics of labels, on labels made by hand."""

import dataclasses

import numpy as np
import pytest

from artgym.annotation.annotate import Labels, labelled_ids, read_labels
from artgym.geometry.grasps import NUM_CANDIDATES, NUM_ROLLS
from artgym.objects import catalog
from benchmarks.labels import statistics


def labels(success):
    """One drawer in one state, its points on the front, with the given tries (G, C)."""
    normals = np.tile(np.float32([1, 0, 0]), (len(success), 1))
    return Labels(
        object_id="drawer/0000",
        fractions=np.zeros((1, catalog.load("drawer/0000").num_parts - 1)),
        state=np.zeros(len(success), np.uint8),
        part=np.ones(len(success), np.uint8),
        points_part=np.zeros((len(success), 3), np.float32),
        normals_part=normals,
        bits=np.packbits(success, axis=-1, bitorder="little"),
        verdicts=np.array([[30, 20, 350]], np.int32),
        ends=np.array([[8, 2, 15, 5, 0]], np.int32),
    )


def test_densities_and_counts():
    success = np.zeros((2, NUM_CANDIDATES), bool)
    success[0, :NUM_ROLLS] = True
    found = statistics([labels(success)], seed=0)
    assert found["successes"] == NUM_ROLLS
    assert found["density"] == pytest.approx(NUM_ROLLS / (2 * NUM_CANDIDATES))
    assert found["density_at_graspable_points"] == pytest.approx(NUM_ROLLS / NUM_CANDIDATES)
    assert found["graspable_points"] == 0.5
    assert found["verdicts"] == {"possible": 30, "nothing between": 20, "collision": 350}
    assert found["trial_ends"]["blocked"] == 15
    assert found["trials"] == 30
    assert [ring["density_at_graspable_points"] for ring in found["rings"]] == [1, 0, 0, 0]


def test_chance_along_the_normal_is_right_where_all_rolls_succeed():
    success = np.zeros((20, NUM_CANDIDATES), bool)
    success[:, :NUM_ROLLS] = True
    chance = statistics([labels(success)], seed=0)["chance_deg"]
    assert chance["normal_grid_roll"]["mean"] == pytest.approx(0, abs=1e-3)
    # Rolls lie 22.5 degrees apart: a random one is 5.6 from the nearest on average.
    assert chance["normal_random_roll"]["mean"] == pytest.approx(22.5 / 4, abs=0.7)
    # Half of all directions of a hemisphere lie more than 60 degrees from its axis.
    assert chance["random_hemisphere"]["mean"] > 50


def test_one_roll_alone_is_missed_by_45_degrees():
    success = np.zeros((1, NUM_CANDIDATES), bool)
    success[0, 0] = True
    chance = statistics([labels(success)], seed=0)["chance_deg"]
    assert chance["normal_grid_roll"]["mean"] == pytest.approx(45.0, abs=0.01)


def test_points_beside_are_tried_in_their_turn():
    lid = read_labels(labelled_ids("laptop", "val")[0])
    beside = statistics([lid], seed=0, beside=2)["beside"]
    assert beside == {
        "graspable": {"points": 1, "same": 1},
        "not graspable": {"points": 1, "same": 1},
    }
    # Labels that say the contrary everywhere are wrong everywhere.
    bits = np.where(lid.success.any(axis=1), 0, 255)[:, None].repeat(lid.bits.shape[1], axis=1)
    wrong = dataclasses.replace(lid, bits=bits.astype(np.uint8))
    beside = statistics([wrong], seed=0, beside=2)["beside"]
    assert [counts["same"] for counts in beside.values()] == [0, 0]


def test_where_no_camera_sees_a_point_beside_there_is_none():
    beside = statistics([labels(np.ones((2, NUM_CANDIDATES), bool))], seed=0, beside=4)["beside"]
    assert [counts["points"] for counts in beside.values()] == [0, 0]
