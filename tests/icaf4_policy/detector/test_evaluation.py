import dataclasses

import numpy as np
import pytest

from icaf4_policy.detector.evaluation import average_precision, outlines, true_detections
from tests.icaf4_policy.detector.scene import scene

TRUTHS = [outlines(true_detections(scene(i))) for i in range(3)]


def test_the_truth_scores_one():
    row = average_precision(TRUTHS, TRUTHS)
    assert set(row) >= {"box/map50", "box/map75", "mask/map", "mask/map50/mug", "box/map/pan"}
    assert all(value == pytest.approx(1.0) for value in row.values())


def test_nothing_found_and_nothing_there_score_zero():
    assert average_precision(TRUTHS, [[]] * 3)["box/map50"] == 0.0
    assert average_precision([[]], [[]])["mask/map"] == 0.0


def test_a_missed_category_halves_the_mean():
    mugs = [[each for each in objects if each.category == "mug"] for objects in TRUTHS]
    row = average_precision(TRUTHS, mugs)
    assert row["mask/map50/mug"] == pytest.approx(1.0)
    assert row["mask/map50/pan"] == 0.0
    assert row["mask/map50"] == pytest.approx(0.5)


def test_loose_boxes_count_at_the_lower_overlap_only():
    loose = [
        [dataclasses.replace(x, box=x.box * np.float32([1, 1, 1, 0.65])) for x in objects]
        for objects in TRUTHS
    ]
    row = average_precision(TRUTHS, loose)
    assert row["box/map50"] == pytest.approx(1.0)
    assert row["box/map75"] == 0.0
    # Overlaps 0.50, 0.55, 0.60 and 0.65 of ten; at the last, rounding decides.
    assert row["box/map"] == pytest.approx(0.35, abs=0.06)
    assert row["mask/map"] == pytest.approx(1.0)


def test_strange_categories_and_doubles_do_not_raise_the_score():
    extra = [
        [
            *objects,
            dataclasses.replace(objects[0], category="pot"),
            dataclasses.replace(objects[0], score=0.4),
        ]
        for objects in TRUTHS
    ]
    assert average_precision(TRUTHS, extra)["box/map50"] == pytest.approx(1.0)
