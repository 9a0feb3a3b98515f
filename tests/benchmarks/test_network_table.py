"""The rows of the table: what they differ in, training where it is missing, what is printed."""

from __future__ import annotations

import json
from dataclasses import asdict, replace

import pytest

from artgym.datasets.picture_files import write_pictures
from artgym.errors import InvalidArgumentError, UnknownNameError
from artgym.files import Manifest, ShardEntry
from benchmarks import record
from benchmarks.network_table import (
    CHOICES,
    COLUMNS,
    NetworkTableConfig,
    TrainingTask,
    table_of,
    train_network,
)
from benchmarks.report import network_table_block
from icaf4_policy.anchors import AnchorConfig
from icaf4_policy.checkpoint import load_model
from icaf4_policy.inference import Perception
from icaf4_policy.training import TrainingConfig
from tests.icaf4_policy.toy import toy_picture


@pytest.fixture
def task(tmp_path):
    for category, first in (("toy", 0), ("other", 50)):
        for split, count in (("train", 6), ("val", 2)):
            pictures = []
            for seed in range(first, first + count):
                picture = toy_picture(seed)
                (sample,) = picture.samples
                sample = replace(sample, object_id=f"{category}/{seed:04d}")
                pictures.append(replace(picture, samples=(sample,)))
            folder = tmp_path / "data" / category / split
            write_pictures(folder / "0000.h5", pictures)
            Manifest(
                config={}, planned=1, shards=(ShardEntry.of(folder / "0000.h5", count),)
            ).write(folder)
    training = TrainingConfig(
        category=("toy", "other"),
        epochs=1,
        num_points=512,
        num_grasp_points=16,
        batch_size=2,
        anchors=AnchorConfig(kind="so3", count=12),
    )
    return TrainingTask(
        training=training, data=tmp_path / "data", samples=4, folder=tmp_path / "work"
    )


def test_rows_differ_from_the_first_in_one_choice(tmp_path):
    config = NetworkTableConfig(data=tmp_path, work=tmp_path, seed=5)
    first = asdict(config.training("one_each", ("laptop",)))
    assert first["seed"] == 5
    for row, changes in CHOICES.items():
        other = asdict(config.training(row, ("laptop",)))
        assert {k for k in first if first[k] != other[k]} == set(changes)
    assert config.training("another_seed", ("laptop",)).seed == 6


def test_one_network_serves_every_category_and_is_trained_once(task):
    assert train_network(task) > 0
    for category in task.training.category:
        path = task.folder / f"{category}.safetensors"
        assert Perception.load(path, category).model.config.categories == ("toy", "other")
        # Four training samples and one to choose, of each category.
        facts = load_model(path)[1]["training"]
        assert (facts["training_samples"], facts["validation_samples"]) == (8, 2)
    assert train_network(task) is None
    other = replace(task, training=replace(task.training, epochs=2))
    with pytest.raises(InvalidArgumentError, match=r"toy\.safetensors was trained otherwise"):
        train_network(other)


def test_table_and_page(tmp_path):
    rows = {row: {name: 0.125 + i for name in COLUMNS} for i, row in enumerate(CHOICES)}
    rows["normals"]["executed"] = float("nan")
    assert table_of("mean", rows).row_count == len(CHOICES)
    result = {
        "config": {"category": ["laptop"], "split": "val", "samples": 9, "epochs": 2},
        "columns": dict(COLUMNS),
        "metrics": {"mean": rows},
        "training_seconds": dict.fromkeys(CHOICES, 90.0) | {"normals": None},
        "views": {"laptop": 7},
    }
    record.write_result(tmp_path / "network_table.json", result)
    page = network_table_block(json.loads((tmp_path / "network_table.json").read_text()))
    assert "| one for all | 2.125 |" in page
    assert "| 2 |" in page
    assert "| - |  |" in page
    assert "7 views of val objects" in page


def test_wrong_options(tmp_path):
    places = {"data": tmp_path, "work": tmp_path}
    with pytest.raises(InvalidArgumentError, match="epochs=0"):
        NetworkTableConfig(**places, epochs=0)
    with pytest.raises(UnknownNameError, match="no_color"):
        NetworkTableConfig(**places, rows=("no_colour",))
