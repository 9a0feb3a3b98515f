"""Rates and intervals against numbers known from elsewhere."""

from dataclasses import replace

import pytest

from artgym.errors import InvalidArgumentError
from benchmarks.episodes import EpisodeRecord
from benchmarks.rates import aggregate, wilson_interval

FAILURE = EpisodeRecord(
    policy="zero",
    category="drawer",
    object_id="drawer/1200",
    part=1,
    episode=0,
    seed=1,
    success=False,
    success_gripped=False,
    success_once=False,
    success_at={"50": False, "90": False},
    success_maniskill=False,
    success_where2act=False,
    travel=0.0,
    engaged=0.0,
    gripped=0.0,
    open_fraction=0.0,
    steps=300,
    unstable=False,
    seconds=1.0,
)
SUCCESS = replace(
    FAILURE,
    success=True,
    success_once=True,
    success_at={"50": True, "90": False},
    travel=0.8,
    engaged=1.0,
    gripped=0.4,
    steps=100,
    seconds=3.0,
)


# Newcombe, Statistics in Medicine 17 (1998), Table I, method 3.
@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    [
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_interval_is_the_published_one(successes, trials, low, high):
    assert wilson_interval(successes, trials) == pytest.approx((low, high), abs=1e-4)


def test_aggregate_counts_the_ends_of_episodes():
    row = aggregate([SUCCESS, FAILURE, FAILURE, FAILURE])
    assert row["episodes"] == 4
    assert row["success"] == row["success_once"] == 0.25
    assert row["success_gripped"] == 0.0
    assert row["success_at"] == {"50": 0.25, "90": 0.0}
    assert row["success_interval"] == wilson_interval(1, 4)
    assert row["travel"] == 0.2
    assert row["seconds"] == 1.5


def test_shares_are_over_episodes_in_which_something_moved():
    row = aggregate([SUCCESS, FAILURE])
    assert row["engaged"] == 1.0
    assert row["gripped"] == 0.4


def test_no_episodes_are_refused():
    with pytest.raises(InvalidArgumentError, match="no episodes"):
        aggregate([])
