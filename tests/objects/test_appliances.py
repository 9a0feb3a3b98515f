"""What every dishwasher, oven, microwave and refrigerator must be, whatever its seed."""

from __future__ import annotations

import importlib
import zlib

import numpy as np
import pytest

from artgym.geometry import transforms
from artgym.objects import catalog
from artgym.objects.model import ArticulatedObject

APPLIANCES = ("dishwasher", "microwave", "oven", "refrigerator")
#: Building one takes milliseconds.
NUMBERS = range(12)


def made(category: str, number: int) -> ArticulatedObject:
    """The object of an id, built anew."""
    module = importlib.import_module(f"artgym.objects.procedural.{category}")
    rng = np.random.default_rng([zlib.crc32(category.encode()), number])
    return getattr(module, f"make_{category}")(f"{category}/{number:04d}", rng)


@pytest.fixture(scope="module", params=APPLIANCES)
def objects(request: pytest.FixtureRequest) -> list[ArticulatedObject]:
    return [made(request.param, number) for number in NUMBERS]


def test_parts_are_the_first_of_the_category(objects: list[ArticulatedObject]) -> None:
    for obj in objects:
        parts = catalog.category(obj.category).parts
        assert obj.num_parts >= 2
        assert obj.part_names == parts[: obj.num_parts], obj.object_id


def test_opening_brings_the_grip_to_the_front(objects: list[ArticulatedObject]) -> None:
    for obj in objects:
        for part in range(1, obj.num_parts):
            joint = obj.joint_of(part)
            assert joint.type == "revolute"
            assert joint.open > joint.closed == 0.0
            grip = obj.grip_point(part)
            moved = transforms.apply(joint.motion(joint.position(0.05)), grip[None])[0]
            assert moved[0] - grip[0] > 0.005, f"{obj.object_id} {joint.name}"


def test_hinges_lie_as_the_category_says(objects: list[ArticulatedObject]) -> None:
    for obj in objects:
        for joint in obj.joints:
            axis = np.asarray(joint.axis)
            if obj.category in ("dishwasher", "oven"):
                # Small ones cannot open farther than the ground allows.
                assert axis == pytest.approx([0, 1, 0])
                assert 60 <= np.degrees(joint.open) <= 95, obj.object_id
            else:
                assert np.abs(axis) == pytest.approx([0, 0, 1])
                assert 95 <= np.degrees(joint.open) <= 120, obj.object_id
            if obj.category == "microwave":
                assert axis[2] == -1
                assert joint.pivot[1] < 0


def test_a_lowered_door_stays_above_the_ground() -> None:
    for category in ("dishwasher", "oven"):
        for obj in (made(category, number) for number in NUMBERS):
            pose = obj.joints[0].motion(obj.joints[0].open)
            corners = np.concatenate([shape.corners_link() for shape in obj.links[1].shapes])
            assert transforms.apply(pose, corners)[:, 2].min() > 0.0, obj.object_id


def test_attributes_name_family_and_handle(objects: list[ArticulatedObject]) -> None:
    module = importlib.import_module(f"artgym.objects.procedural.{objects[0].category}")
    for obj in objects:
        assert obj.attributes["family"] in module.FAMILIES
        assert obj.attributes["handle"] in module.HANDLES


def test_size_is_in_the_categorys_interval(objects: list[ArticulatedObject]) -> None:
    for obj in objects:
        smallest, largest = catalog.category(obj.category).size
        low, high = obj.body_bounds
        assert low[2] == pytest.approx(0.0, abs=1e-6), "stands on the ground"
        assert smallest <= (high - low).min(), obj.object_id
        assert (high - low).max() <= largest, obj.object_id


def test_handles_are_on_the_doors(objects: list[ArticulatedObject]) -> None:
    for obj in objects:
        roles = [{shape.role for shape in link.shapes} for link in obj.links]
        assert roles[0] == {"body"}
        assert all("handle" in on_door for on_door in roles[1:]), obj.object_id


def test_doors_are_light_and_the_description_is_small(objects: list[ArticulatedObject]) -> None:
    for obj in objects:
        assert sum(len(link.shapes) for link in obj.links) <= 64, obj.object_id
        assert all(0.05 <= link.mass <= 6.0 for link in obj.links[1:]), obj.object_id


def test_same_seed_same_object(objects: list[ArticulatedObject]) -> None:
    for obj in objects[:3]:
        again = made(obj.category, int(obj.object_id[-4:]))
        assert again.content_hash() == obj.content_hash()
    assert len({obj.content_hash() for obj in objects}) == len(objects)


@pytest.mark.parametrize("category", APPLIANCES)
def test_every_family_and_handle_occurs(category: str) -> None:
    module = importlib.import_module(f"artgym.objects.procedural.{category}")
    attributes = [made(category, number).attributes for number in range(60)]
    assert {a["family"] for a in attributes} == set(module.FAMILIES)
    assert {a["handle"] for a in attributes} == set(module.HANDLES)
