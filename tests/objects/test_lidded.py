"""Objects with lids about horizontal hinges: boxes, suitcases, toilets, trash cans."""

from __future__ import annotations

import time

import numpy as np
import pytest

from artgym.geometry import transforms
from artgym.objects import catalog
from artgym.objects.procedural import box, generator, suitcase, toilet, trash_can

MODULES = {"box": box, "suitcase": suitcase, "toilet": toilet, "trash_can": trash_can}
CATEGORIES = list(MODULES)
COUNT = 40

#: Measured parts of eight real flat boxes, metres: body and lid, each sorted.
REAL_BOXES = np.array(
    [
        [[0.0346, 0.0843, 0.2300], [0.0129, 0.0763, 0.2248]],
        [[0.0326, 0.0906, 0.2432], [0.0076, 0.0850, 0.2379]],
        [[0.0332, 0.0925, 0.2312], [0.0071, 0.0849, 0.2270]],
        [[0.0235, 0.0741, 0.2094], [0.0152, 0.0746, 0.2140]],
        [[0.0331, 0.0942, 0.2322], [0.0093, 0.0876, 0.2281]],
        [[0.0339, 0.0939, 0.2265], [0.0142, 0.0892, 0.2225]],
        [[0.0376, 0.0817, 0.2001], [0.0224, 0.0834, 0.2005]],
        [[0.0364, 0.0830, 0.2009], [0.0191, 0.0820, 0.2007]],
    ]
)


def objects(category: str, count: int = COUNT):
    """The first objects of a category."""
    return [catalog.load(f"{category}/{n:04d}") for n in range(count)]


@pytest.mark.parametrize("category", CATEGORIES)
def test_parts(category):
    names = catalog.category(category).parts
    for obj in objects(category):
        assert 2 <= obj.num_parts <= len(names), obj.object_id
        assert obj.part_names == names[: obj.num_parts], obj.object_id
        assert all(joint.parent == names[0] for joint in obj.joints), obj.object_id


def test_boxes_have_one_two_or_four_lids():
    assert {obj.num_parts - 1 for obj in objects("box")} == {1, 2, 4}


@pytest.mark.parametrize("category", CATEGORIES)
def test_lids_go_up(category):
    for obj in objects(category):
        for part, joint in enumerate(obj.joints, start=1):
            assert joint.type == "revolute"
            assert joint.axis[2] == 0.0
            assert joint.open > joint.closed == 0.0
            grip = obj.grip_point(part)
            q = obj.rest_positions
            q[part - 1] = joint.position(0.1)
            raised = transforms.apply(obj.link_poses(q)[part], grip[None])[0]
            assert raised[2] > grip[2] + 0.003, f"{obj.object_id} {joint.name}"


@pytest.mark.parametrize("category", CATEGORIES)
def test_lids_stay_where_they_are_left_and_yield_to_a_hand(category):
    for obj in objects(category):
        for part, joint in enumerate(obj.joints, start=1):
            lid = obj.links[part]
            arm = lid.center_of_mass - np.asarray(joint.pivot)
            gravity = lid.mass * 9.81 * np.linalg.norm(np.cross(joint.axis, arm))
            lever = np.linalg.norm(
                np.cross(joint.axis, obj.grip_point(part) - np.asarray(joint.pivot))
            )
            assert joint.friction >= 1.3 * gravity - 1e-9, obj.object_id
            assert (joint.friction + gravity) / lever < 25.0, obj.object_id


@pytest.mark.parametrize("category", CATEGORIES)
def test_attributes(category):
    module = MODULES[category]
    found = [obj.attributes for obj in objects(category, 120)]
    assert {a["family"] for a in found} == set(module.FAMILIES)
    assert {a["handle"] for a in found} == set(module.HANDLES)


@pytest.mark.parametrize("category", CATEGORIES)
def test_same_seed_same_object(category):
    make = generator(category)
    hashes = [
        make(f"{category}/0000", np.random.default_rng(seed)).content_hash()
        for seed in (0, 0, 1, 2)
    ]
    assert hashes[0] == hashes[1]
    assert len(set(hashes)) == 3


@pytest.mark.parametrize("category", CATEGORIES)
def test_sizes(category):
    smallest, largest = catalog.category(category).size
    for obj in objects(category):
        low, high = obj.body_bounds
        assert smallest <= (high - low).min(), obj.object_id
        assert (high - low).max() <= largest, obj.object_id
        assert low[2] == pytest.approx(0.0, abs=0.004), obj.object_id
        assert np.all(np.abs((low + high)[:2] / 2) < 0.06), obj.object_id


def test_real_boxes_lie_within_the_range_of_flat_ones():
    cases = [o for o in objects("box", 300) if o.attributes["family"] == "case"]
    extents = np.array(
        [[np.sort(np.diff(link.bounds(), axis=0)[0]) for link in o.links] for o in cases]
    )
    assert np.all(extents.min(axis=0) < REAL_BOXES.min(axis=0))
    assert np.all(extents.max(axis=0) > REAL_BOXES.max(axis=0))


def test_open_case_lies_side_by_side():
    cases = [o for o in objects("box", 200) if o.joints[0].open > np.radians(170)]
    flat = [o for o in cases if o.attributes["family"] == "case"]
    assert flat
    for obj in flat:
        lid = transforms.apply(
            obj.link_poses([np.pi])[1],
            np.concatenate([s.corners_link() for s in obj.links[1].shapes]),
        )
        assert lid[:, 2].min() > 0.0, obj.object_id
        assert lid[:, 0].max() < obj.links[0].bounds()[0, 0] + 0.003, obj.object_id


@pytest.mark.parametrize("category", CATEGORIES)
def test_hollow(category):
    """Seen from above with the lid away, the middle is lower than the rim."""
    for obj in objects(category, 20):
        rim = max(s.corners_link()[:, 2].max() for s in obj.links[0].shapes)
        lid = obj.links[1].bounds()
        middle = lid.mean(axis=0)[:2]
        if category == "box":
            middle = np.zeros(2)
        over = [
            s.corners_link()[:, 2].max()
            for s in obj.links[0].shapes
            if np.all(s.corners_link()[:, :2].min(axis=0) < middle)
            and np.all(s.corners_link()[:, :2].max(axis=0) > middle)
        ]
        assert max(over) < min(rim, lid[0, 2]) - 0.01, obj.object_id


@pytest.mark.parametrize("category", CATEGORIES)
def test_quickly_made(category):
    make = generator(category)
    start = time.perf_counter()
    for seed in range(100):
        make(f"{category}/0000", np.random.default_rng(seed))
    assert time.perf_counter() - start < 3.0
