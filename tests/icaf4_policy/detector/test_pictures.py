import cv2
import numpy as np
import pytest

from artgym.errors import InvalidArgumentError
from icaf4_policy.detector.config import DetectorConfig
from icaf4_policy.detector.pictures import (
    AugmentationConfig,
    changed,
    network_input,
    network_target,
    shrink,
    shrunk,
)
from tests.icaf4_policy.detector.scene import scene

CONFIG = DetectorConfig(categories=("mug", "pan"), input_size=(128, 96))
STILL = AugmentationConfig(flip=0.0, zoom=0.0, shift=0.0, color_jitter=0.0)


def test_boxes_enclose_masks_however_a_picture_is_changed():
    wild, rng = AugmentationConfig(zoom=0.6, shift=0.4), np.random.default_rng(0)
    seen = 0
    for seed in range(40):
        picture = changed(shrink(scene(seed), CONFIG), wild, rng)
        masks = network_target(picture)["masks"].numpy()
        assert len(masks) == len(picture.boxes) == len(picture.labels)
        for mask, box in zip(masks, picture.boxes, strict=True):
            rows, columns = np.nonzero(mask)
            tight = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
            # A pixel of the shrunk mask, magnified.
            np.testing.assert_allclose(box, tight, atol=1.9)
            seen += 1
    assert seen > 40


def test_a_change_of_nothing_changes_nothing():
    picture = shrink(scene(), CONFIG)
    same = changed(picture, STILL, np.random.default_rng(0))
    for name in ("rgb", "depth", "instance_mask", "labels"):
        np.testing.assert_array_equal(getattr(same, name), getattr(picture, name))
    np.testing.assert_allclose(same.boxes, picture.boxes, atol=1e-4)


def test_mirroring_moves_the_left_object_to_the_right():
    picture = shrink(scene(), CONFIG)
    flipped = changed(
        picture,
        AugmentationConfig(flip=1.0, zoom=0, shift=0, color_jitter=0),
        np.random.default_rng(0),
    )
    np.testing.assert_array_equal(flipped.instance_mask, picture.instance_mask[:, ::-1])
    np.testing.assert_array_equal(flipped.depth, picture.depth[:, ::-1])
    np.testing.assert_allclose(flipped.boxes[:, 0], 128 - picture.boxes[:, 2], atol=1e-4)


def test_other_proportions_are_kept():
    wide = np.full((50, 200), 7, dtype=np.uint8)
    fitted = shrunk(wide, (128, 96), cv2.INTER_NEAREST_EXACT)
    assert fitted.shape == (96, 128)
    assert (fitted[:32] == 7).all()
    assert (fitted[32:] == 0).all()


def test_input_has_depth_in_metres():
    picture = shrink(scene(), CONFIG)
    image = network_input(picture.rgb, picture.depth, CONFIG)
    assert image.shape == (4, 96, 128)
    np.testing.assert_array_equal(image[3], picture.depth)


def test_a_change_never_loses_all_objects():
    wild, rng = AugmentationConfig(zoom=1.0, shift=1.0), np.random.default_rng(0)
    assert all(len(changed(shrink(scene(i), CONFIG), wild, rng).labels) for i in range(30))


def test_an_unknown_category_is_named():
    with pytest.raises(InvalidArgumentError, match="pan"):
        shrink(scene(), DetectorConfig(categories=("mug",)))


def test_shares_are_checked():
    with pytest.raises(InvalidArgumentError, match=r"flip=1\.5"):
        AugmentationConfig(flip=1.5)
