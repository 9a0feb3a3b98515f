"""Rates of making pictures and reading items, from a folder that is there already."""

from __future__ import annotations

import dataclasses

import pytest

from artgym.datasets.picture_files import write_pictures
from artgym.errors import InvalidArgumentError
from artgym.files import Manifest, ShardEntry
from benchmarks import dataset_speed
from benchmarks.dataset_speed import DatasetSpeedConfig
from tests.icaf4_policy.toy import toy_picture


def pictures_of_the_toy(category, split, folder, **_):
    """In place of the renderer: more than one batch of them."""
    assert (category, split) == ("laptop", "val")
    pictures = []
    for number in range(11):
        picture = toy_picture(number)
        sample = dataclasses.replace(picture.samples[0], object_id=f"laptop/{number:04d}")
        pictures.append(dataclasses.replace(picture, samples=(sample,)))
    write_pictures(folder / "a.h5", pictures)
    shard = ShardEntry.of(folder / "a.h5", 11)
    manifest = Manifest(config={}, planned=1, shards=(shard,))
    manifest.write(folder)
    return manifest


def test_every_epoch_is_timed(tmp_path, monkeypatch):
    monkeypatch.setattr(dataset_speed, "generate_artimage", pictures_of_the_toy)
    config = DatasetSpeedConfig(category=("laptop",), epochs=2, out=tmp_path)
    (table,) = dataset_speed.report(config)
    assert table.row_count == 1
    row = dataset_speed.measure(config)["rows"]["laptop"]
    assert row["pictures"] == 11
    assert len(row["items_a_second"]) == 2
    assert min(row["items_a_second"]) > 0
    assert (tmp_path / "dataset_speed.json").exists()


def test_bad_options():
    with pytest.raises(InvalidArgumentError, match="epochs=1"):
        DatasetSpeedConfig(epochs=1)
