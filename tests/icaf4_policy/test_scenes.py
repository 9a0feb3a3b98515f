"""A scene whose objects are detected without error: what the networks say lands on their pixels."""

from __future__ import annotations

import dataclasses

import cv2
import numpy as np
import pytest

from icaf4_policy.detector.evaluation import true_detections
from icaf4_policy.inference import Perception
from icaf4_policy.scenes import ScenePerception
from tests.icaf4_policy.toy import toy_network, toy_picture


class TruthfulDetector:
    """Finds what is there."""

    def __init__(self, picture) -> None:
        self.found = true_detections(picture)

    def detect(self, rgb, depth, *, min_score):
        assert rgb.shape == (*depth.shape, 3)
        return [each for each in self.found if each.score >= min_score]


@pytest.fixture(scope="module")
def picture():
    return toy_picture(3, num_points=2500)


def perception():
    return Perception(model=toy_network(), category="toy")


def look(picture, perceptions, detector=None):
    detector = TruthfulDetector(picture) if detector is None else detector
    scene = ScenePerception(detector=detector, perceptions=perceptions)
    rng = np.random.default_rng(0)
    return scene.look(picture.rgb, picture.depth, picture.intrinsics, rng=rng)


def test_every_pixel_of_an_object_is_told_its_part(picture):
    (seen,) = look(picture, {"toy": perception()})
    mask = seen.detection.mask
    assert seen.part_mask.shape == seen.affordance.shape == picture.depth.shape
    assert not seen.part_mask[~mask].any()
    assert not seen.affordance[~mask].any()
    # All but what lies so low that it might be the table.
    assert (seen.part_mask[mask] > 0).mean() > 0.9
    assert seen.part_mask.max() <= 2
    assert len(seen.prediction.part_boxes) == 2


def test_depth_gives_a_blunt_mask_its_outline(picture):
    detector = TruthfulDetector(picture)
    (whole,) = look(picture, {"toy": perception()}, detector)
    (found,) = detector.found
    blunt = cv2.erode(found.mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    detector.found = [dataclasses.replace(found, mask=blunt)]
    (seen,) = look(picture, {"toy": perception()}, detector)
    wanted = (whole.part_mask > 0) & found.mask
    assert (wanted & ~blunt).sum() > 100
    assert (seen.part_mask > 0)[wanted].mean() > 0.99
    # What another mask covers stays with the other.
    taken = found.mask & ~blunt
    detector.found.append(dataclasses.replace(found, category="unknown", mask=taken))
    (seen,) = look(picture, {"toy": perception()}, detector)
    assert not seen.part_mask[taken].any()


def test_what_stands_before_an_object_is_no_crumb_of_it(picture):
    detector = TruthfulDetector(picture)
    (found,) = detector.found
    crumb = np.zeros_like(found.mask)
    row, column = (int(np.median(index)) for index in np.nonzero(found.mask))
    crumb[row - 1 : row + 2, column - 2 : column + 3] = True
    assert (crumb & found.mask).sum() == crumb.sum() < 0.05 * found.mask.sum()
    depth = np.where(crumb, picture.depth - 0.1, picture.depth)
    (seen,) = look(dataclasses.replace(picture, depth=depth), {"toy": perception()}, detector)
    assert not seen.part_mask[crumb].any()
    assert (seen.part_mask[found.mask & ~crumb] > 0).mean() > 0.9


def test_a_mask_on_the_bare_table_is_no_object(picture):
    detector = TruthfulDetector(picture)
    (found,) = detector.found
    far = cv2.dilate(found.mask.astype(np.uint8), np.ones((25, 25), np.uint8)) == 0
    detector.found = [dataclasses.replace(found, mask=far & (picture.depth > 0))]
    assert detector.found[0].mask.sum() > 1000
    assert look(picture, {"toy": perception()}, detector) == []


def test_the_same_scene_gives_the_same(picture):
    first, second = (look(picture, {"toy": perception()})[0] for _ in range(2))
    np.testing.assert_array_equal(first.part_mask, second.part_mask)
    np.testing.assert_array_equal(first.affordance, second.affordance)


def test_a_category_without_a_network_is_passed_over(picture):
    assert look(picture, {}) == []
