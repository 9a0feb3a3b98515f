"""Rewards lie in [0, 1] and grow with what is wanted."""

from __future__ import annotations

import itertools

import pytest

from artgym.tasks.rewards import GRIP, MOVE, REACH, dense_terms, reward
from artgym.tasks.success import Progress


def progress(travel: float, engaged: float) -> Progress:
    return Progress(0.0, travel, travel, travel * engaged, 0.0)


def dense(distance: float, pinched: bool, travel: float, engaged: float) -> float:
    state = progress(travel, engaged)
    return reward("dense", dense_terms(distance, pinched, state, 1.0), state)


def test_weights_add_up_to_one():
    assert pytest.approx(1.0) == REACH + GRIP + MOVE
    assert dense(0.0, True, 1.0, 1.0) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(
    ("distance", "pinched", "travel", "engaged"),
    list(itertools.product([0.0, 0.1, 9.0], [False, True], [0.0, 0.3, 1.2], [0.0, 0.5, 1.0])),
)
def test_between_zero_and_one(distance, pinched, travel, engaged):
    assert 0.0 <= dense(distance, pinched, travel, engaged) <= 1.0


def test_each_term_grows():
    base = dense(0.3, False, 0.1, 0.5)
    assert dense(0.2, False, 0.1, 0.5) > base
    assert dense(0.3, True, 0.1, 0.5) > base
    assert dense(0.3, False, 0.2, 0.5) > base
    assert dense(0.3, False, 0.1, 0.8) > base


def test_motion_without_contact_pays_nothing():
    assert dense(0.3, False, 1.0, 0.0) == pytest.approx(dense(0.3, False, 0.0, 0.0))


@pytest.mark.parametrize(("travel", "engaged", "expected"), [(0.6, 1.0, 1.0), (0.6, 0.5, 0.0)])
def test_sparse_is_success(travel, engaged, expected):
    state = progress(travel, engaged)
    assert reward("sparse", dense_terms(0.0, True, state, 1.0), state) == expected


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_only_the_asked_direction_pays(direction):
    there = Progress(0.5, 0.5 + 0.3 * direction, 0.3, 0.3, 0.3)
    back = Progress(0.5, 0.5 - 0.3 * direction, 0.3, 0.3, 0.3)
    assert dense_terms(0.1, True, there, direction)["move"] == pytest.approx(0.6 * MOVE)
    assert dense_terms(0.1, True, back, direction)["move"] == 0.0
