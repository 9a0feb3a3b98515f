"""The rule of success, as a truth table, for numbers, numpy and torch."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import numpy as np
import pytest
import torch

from artgym.tasks.success import (
    SHARE_THRESHOLD,
    TRAVEL_THRESHOLD,
    Progress,
    maniskill_success,
    where2act_success,
)

ROOT = Path(__file__).resolve().parents[2]

# Travel reached, and the shares of it made in touch and pinched.
TRUTH = [
    # (travel, engaged, gripped, success, success_gripped)
    (0.00, 0.0, 0.0, False, False),
    (0.49, 1.0, 1.0, False, False),
    (0.50, 1.0, 1.0, True, True),
    (0.50, 0.9, 0.7, True, False),
    (0.50, 0.7, 0.7, False, False),
    (0.90, 0.0, 0.0, False, False),
    (1.00, 0.8001, 0.0, True, False),
    (1.00, 0.7999, 0.0, False, False),
    (1.00, 0.8001, 0.8001, True, True),
]


def moved(start, travel, engaged, gripped, steps=1000):
    """The progress of a steady motion, in touch and pinched for the first shares of it."""
    progress = Progress.begin(start)
    for i in range(1, steps + 1):
        done = (i - 0.5) / steps
        progress = progress.advance(
            start + travel * i / steps, touched=done < engaged, pinched=done < gripped
        )
    return progress


@pytest.mark.parametrize(("travel", "engaged", "gripped", "success", "success_gripped"), TRUTH)
@pytest.mark.parametrize("direction", [1.0, -1.0], ids=["opening", "closing"])
def test_truth_table(travel, engaged, gripped, success, success_gripped, direction):
    start = 0.0 if direction > 0 else 1.0
    # A share on the edge of the bar takes 10,000 steps to tell.
    progress = moved(start, direction * (travel + 1e-9), engaged, gripped, steps=10_000)
    assert bool(progress.success) is success
    assert bool(progress.success_gripped) is success_gripped
    assert progress.travel == pytest.approx(travel, abs=1e-6)


def test_motion_to_and_fro_counts_as_path():
    progress = Progress.begin(0.0)
    # Shoved open without touch, and back; then pulled open by the hand.
    for fraction, touched in [(0.6, False), (0.0, False), (0.6, True)]:
        progress = progress.advance(fraction, touched, touched)
    assert progress.path == pytest.approx(1.8)
    assert progress.engaged == pytest.approx(1 / 3)
    assert not progress.success


def test_nothing_moved_is_no_division_by_zero():
    progress = Progress.begin(0.3)
    assert progress.travel == progress.engaged == progress.gripped == 0.0
    assert not progress.success
    assert not progress.success_at(0.0)


@pytest.mark.parametrize("library", [np, torch], ids=["numpy", "torch"])
def test_arrays_give_what_numbers_give(library):
    rows = np.array([row[:3] for row in TRUTH])
    rng = np.random.default_rng(0)
    starts = rng.uniform(0, 0.1, len(rows))
    asarray = np.asarray if library is np else torch.as_tensor
    batch = Progress.begin(asarray(starts))
    singles = [Progress.begin(float(s)) for s in starts]
    for i in range(1, 101):
        fraction = starts + rows[:, 0] * i / 100
        touched, pinched = i / 100 <= rows[:, 1], i / 100 <= rows[:, 2]
        batch = batch.advance(asarray(fraction), asarray(touched), asarray(pinched))
        singles = [
            p.advance(float(f), bool(t), bool(g))
            for p, f, t, g in zip(singles, fraction, touched, pinched, strict=True)
        ]
    assert type(batch.success) is type(asarray(starts))
    for name in ("success", "success_gripped"):
        got = [bool(x) for x in getattr(batch, name)]
        assert got == [bool(getattr(p, name)) for p in singles]
    for name in ("travel", "engaged", "gripped", "path"):
        np.testing.assert_allclose(
            np.asarray(getattr(batch, name)), [getattr(p, name) for p in singles], atol=1e-12
        )


def test_progress_is_not_changed_in_place():
    start = np.zeros(2)
    first = Progress.begin(start)
    second = first.advance(np.array([0.5, 0.6]), np.array([True, True]), np.array([True, False]))
    np.testing.assert_array_equal(first.path, 0.0)
    np.testing.assert_array_equal(start, 0.0)
    np.testing.assert_array_equal(second.gripped_path, [0.5, 0.0])


def test_other_papers_rules():
    progress = moved(0.0, 0.8, 0.0, 0.0)
    # Neither asks for contact.
    assert maniskill_success(progress, 0.1)
    assert not maniskill_success(progress, 0.6)
    assert not maniskill_success(moved(0.0, 0.7, 1.0, 1.0), 0.0)
    assert where2act_success(moved(0.0, 0.1, 0.0, 0.0), joint_range=-0.2)
    assert not where2act_success(moved(0.0, 0.1, 0.0, 0.0), joint_range=0.05)
    assert where2act_success(moved(0.0, 0.55, 0.0, 0.0), joint_range=0.01)


def test_the_thresholds_are_the_paper_s():
    assert (TRAVEL_THRESHOLD, SHARE_THRESHOLD) == (0.5, 0.8)


def thresholds_in(source: str) -> list[str]:
    """Comparisons of a travel or a share with one of the rule's numbers."""
    return [
        ast.unparse(node)
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Compare)
        and re.search(r"travel|engaged|gripped", ast.unparse(node))
        and any(
            isinstance(side, ast.Constant) and side.value in (TRAVEL_THRESHOLD, SHARE_THRESHOLD)
            for side in (node.left, *node.comparators)
        )
    ]


def test_the_rule_is_written_once():
    assert thresholds_in("if progress.travel >= 0.5: pass")
    packages = ("artgym", "icaf4_policy", "benchmarks")
    sources = [path for name in packages for path in (ROOT / name).rglob("*.py")]
    found = {str(p.relative_to(ROOT)): thresholds_in(p.read_text()) for p in sources}
    # Where2Act's rule stands beside ours, for comparison.
    assert {path: lines for path, lines in found.items() if lines} == {
        "artgym/tasks/success.py": ["progress.travel >= 0.5"]
    }
