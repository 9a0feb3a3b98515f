"""Ids, splits and lookups."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from artgym.errors import InvalidArgumentError, UnknownNameError
from artgym.objects import catalog

ROOT = Path(__file__).resolve().parents[2]
CATEGORIES = list(catalog.CATEGORIES)
SAMPLE_IDS = [f"{c}/{n:04d}" for c in CATEGORIES for n in (0, 1, 17, 999, 1000, 1200, 1599)]


def test_same_id_same_object_in_a_fresh_process():
    script = (
        "import json, sys; from artgym.objects import catalog\n"
        "ids = json.loads(sys.argv[1])\n"
        "print(json.dumps({i: catalog.load(i).content_hash() for i in reversed(ids)}))"
    )
    process = subprocess.run(
        [sys.executable, "-c", script, json.dumps(SAMPLE_IDS)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(process.stdout) == {i: catalog.load(i).content_hash() for i in SAMPLE_IDS}


@pytest.mark.parametrize("category", CATEGORIES)
def test_splits_are_disjoint_and_objects_differ(category):
    splits = [s for s in catalog.SPLITS if category in catalog.categories_with(s)]
    ids = {split: set(catalog.object_ids(category, split)) for split in splits}
    together = set().union(*ids.values())
    assert len(together) == sum(map(len, ids.values()))
    assert all(catalog.split_of(i) == split for split in ids for i in ids[split])
    hashes = {catalog.load(i).content_hash() for i in sorted(together)[::16]}
    assert len(hashes) == len(sorted(together)[::16])


def test_first_ids_of_a_split():
    assert catalog.object_ids("drawer", "val", 2) == ("drawer/1000", "drawer/1001")


def test_start_states_are_nearly_closed():
    for category in catalog.CATEGORIES.values():
        low, high = category.start_fraction
        assert 0.0 <= low < high <= 0.1


@pytest.mark.parametrize("category", CATEGORIES)
def test_parts_are_the_category_s(category):
    parts = catalog.category(category).parts
    for object_id in catalog.all_ids(category, 10):
        obj = catalog.load(object_id)
        assert obj.object_id == object_id
        assert obj.category == category
        assert 2 <= obj.num_parts <= len(parts)
        assert obj.part_names == parts[: obj.num_parts]


@pytest.mark.parametrize("category", CATEGORIES)
def test_every_part_occurs(category):
    objects = [catalog.load(i) for i in catalog.all_ids(category, 40)]
    assert max(obj.num_parts for obj in objects) == len(catalog.category(category).parts)


def test_held_out_categories_are_for_tests_alone():
    held_out = [c.name for c in catalog.CATEGORIES.values() if c.held_out]
    assert len(held_out) == 4
    assert set(catalog.categories_with("test")) == set(CATEGORIES)
    assert set(catalog.categories_with("train")) == set(CATEGORIES) - set(held_out)
    for category in held_out:
        assert {catalog.split_of(i) for i in catalog.all_ids(category)} == {"test"}
        assert catalog.object_ids(category, "test") == catalog.all_ids(category)
        for split in ("train", "val"):
            with pytest.raises(InvalidArgumentError, match="held out"):
                catalog.object_ids(category, split)


@pytest.mark.parametrize(
    ("object_id", "nearest"),
    [
        ("drawr/0001", "drawer"),
        ("labtop/0001", "laptop"),
        ("drawer/1", "drawer/0001"),
        ("drawer/00012", "drawer/0012"),
        ("laptop/9999", "laptop/"),
        ("laptop/-001", "laptop/"),
        ("laptop/x", "laptop/"),
        ("laptop", "laptop/"),
        ("drawer/²²²²", "drawer/"),
        ("", "'"),
        ("../etc/passwd", "'"),
    ],
)
def test_unknown_id_names_the_nearest(object_id, nearest):
    with pytest.raises(UnknownNameError, match=f"Nearest: .*{nearest}") as error:
        catalog.load(object_id)
    assert repr(object_id) in str(error.value) or object_id.partition("/")[0] in str(error.value)


def test_unknown_category_split_and_count():
    with pytest.raises(UnknownNameError, match="Nearest: 'laptop'"):
        catalog.object_ids("laptops", "train")
    with pytest.raises(UnknownNameError, match="Nearest: 'train'"):
        catalog.object_ids("laptop", "tran")
    for count in (0, -1, 1001):
        with pytest.raises(InvalidArgumentError, match=f"count={count}.*1 to 1000"):
            catalog.object_ids("laptop", "train", count)


@pytest.mark.parametrize("category", CATEGORIES)
def test_variety(category):
    objects = [catalog.load(i) for i in catalog.all_ids(category, 60)]
    assert len({o.attributes["family"] for o in objects}) >= 3
    colors = {s.material.color for o in objects for link in o.links for s in link.shapes}
    assert len(colors) > 60
