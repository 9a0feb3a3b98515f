"""Items for data loaders: the same with any number of workers, new points in each epoch."""

from __future__ import annotations

import functools

import numpy as np
import pytest
import torch
from torch.utils.data import DataLoader

from icaf4_policy.anchors import AnchorConfig, anchors_from_config
from icaf4_policy.dataset import EpochSampler, TrainingItems
from icaf4_policy.targets import DrawConfig, collate_items
from tests.icaf4_policy.toy import toy_sample

ANCHORS = anchors_from_config(AnchorConfig())
DRAW = DrawConfig(num_points=128, num_anchors=len(ANCHORS), num_grasp_points=32, color_jitter=0.2)


@pytest.fixture(scope="module")
def items() -> TrainingItems:
    return TrainingItems([toy_sample(i) for i in range(5)], ["toy"], ANCHORS, DRAW, seed=3)


def batches(items, workers, epochs=2):
    loader = DataLoader(
        items,
        batch_size=2,
        sampler=EpochSampler(len(items), seed=1),
        collate_fn=functools.partial(collate_items, config=DRAW),
        num_workers=workers,
        persistent_workers=workers > 0,
    )
    return [batch for _ in range(epochs) for batch in loader]


def test_any_number_of_workers_gives_the_same_batches(items):
    here = batches(items, 0)
    assert [len(batch.part) for batch in here] == [2, 2, 1] * 2
    for mine, theirs in zip(here, batches(items, 2), strict=True):
        for name, value in vars(mine).items():
            assert torch.equal(value, getattr(theirs, name)), name


def test_each_epoch_chooses_other_points_and_another_order(items):
    first, later = items[2], items[2 + len(items)]
    assert not np.array_equal(first["points_level"], later["points_level"])
    np.testing.assert_array_equal(first["points_level"], items[2]["points_level"])
    sampler = EpochSampler(5, seed=1)
    orders = [list(sampler), list(sampler)]
    assert sorted(orders[0]) == [0, 1, 2, 3, 4]
    assert sorted(orders[1]) == [5, 6, 7, 8, 9]
    assert [i % 5 for i in orders[1]] != orders[0]
    assert list(EpochSampler(5, seed=1, epoch=1)) == orders[1]


def test_a_sample_is_read_once():
    class Counted(list):
        asked = 0

        def __getitem__(self, index):
            Counted.asked += 1
            return super().__getitem__(index)

    items = TrainingItems(Counted([toy_sample(0)]), ["toy"], ANCHORS, DRAW)
    assert [len(items[i]["part"]) for i in (0, 1, 2)] == [128] * 3
    assert Counted.asked == 1
    with pytest.raises(IndexError, match="-1"):
        items[-1]
