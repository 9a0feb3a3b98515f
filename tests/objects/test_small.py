"""Small objects on stands: eyeglasses, scissors, cutters, staplers."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from artgym.geometry import transforms
from artgym.objects import catalog
from artgym.objects.model import ArticulatedObject
from artgym.objects.procedural import generator

CATEGORIES = ("cutter", "eyeglasses", "scissors", "stapler")
FRACTIONS = (0.0, 0.3, 0.6, 1.0)

#: Smallest and largest extents (thickness, width, length; sorted) of 25 real objects, metres:
#: of the whole, of the fixed part, of the moving part, each in the joint state it was measured in.
REAL_EXTENTS = {
    "scissors": (
        ((0.0105, 0.1248, 0.1251), (0.0207, 0.1704, 0.1715)),
        ((0.0096, 0.0337, 0.1248), (0.0189, 0.0446, 0.1715)),
        ((0.0083, 0.0329, 0.1250), (0.0151, 0.0440, 0.1711)),
    ),
    "cutter": (
        ((0.0143, 0.0222, 0.1821), (0.0228, 0.0339, 0.2419)),
        ((0.0106, 0.0222, 0.1052), (0.0197, 0.0339, 0.1632)),
        ((0.0033, 0.0124, 0.0778), (0.0129, 0.0222, 0.1337)),
    ),
    "stapler": (
        ((0.0335, 0.0776, 0.2205), (0.0416, 0.0916, 0.2930)),
        ((0.0284, 0.0335, 0.1199), (0.0353, 0.0416, 0.1616)),
        ((0.0271, 0.0634, 0.1100), (0.0323, 0.0774, 0.1424)),
    ),
}


@functools.cache
def objects(category: str, count: int) -> tuple[ArticulatedObject, ...]:
    """The first objects of the training split."""
    return tuple(catalog.load(i) for i in catalog.object_ids(category, "train", count))


@pytest.mark.parametrize("category", CATEGORIES)
def test_parts_and_attributes(category):
    module = __import__(f"artgym.objects.procedural.{category}", fromlist=["FAMILIES"])
    seen = objects(category, 60)
    for obj in seen:
        assert obj.part_names == catalog.category(category).parts
        assert all(joint.parent == obj.part_names[0] for joint in obj.joints)
        assert all(np.isfinite(obj.grip_point(k)).all() for k in range(1, obj.num_parts))
        assert len(obj.links[0].shapes) + len(obj.links[1].shapes) <= 60
    assert {obj.attributes["family"] for obj in seen} == set(module.FAMILIES)
    assert {obj.attributes["handle"] for obj in seen} == set(module.HANDLES)


@pytest.mark.parametrize("category", CATEGORIES)
def test_same_seed_same_object(category):
    make = generator(category)
    first, again, other = (make("x/0", np.random.default_rng(seed)) for seed in (5, 5, 6))
    assert first.content_hash() == again.content_hash() != other.content_hash()


@pytest.mark.parametrize("category", CATEGORIES)
def test_size_without_the_stand(category):
    smallest, largest = catalog.category(category).size
    for obj in objects(category, 60):
        low, high = obj.body_bounds
        assert smallest <= (high - low).min()
        assert (high - low).max() <= largest
        assert obj.rest_bounds[0, 2] == pytest.approx(0.0, abs=1e-6)
        assert np.abs(low + high)[:2].max() < 0.01


@pytest.mark.parametrize("category", CATEGORIES)
def test_only_the_fixed_link_has_a_stand(category):
    for obj in objects(category, 60):
        assert all(s.role != "stand" for link in obj.links[1:] for s in link.shapes)
        assert all(any(s.role == "handle" for s in link.shapes) for link in obj.links[1:])
        on_stand = any(s.role == "stand" for s in obj.links[0].shapes)
        assert on_stand == (category != "stapler")


def test_temples_fold_behind_the_lenses_and_open_backwards():
    for obj in objects("eyeglasses", 60):
        for part, side in ((1, 1.0), (2, -1.0)):
            joint = obj.joint_of(part)
            assert abs(joint.axis[2]) > 0.95
            assert 85.0 <= np.degrees(joint.range) <= 95.0
            assert joint.pivot[1] * side > 0.05
            folded = obj.grip_point(part)
            opened = transforms.apply(joint.motion(joint.open), [folded])[0]
            assert folded[1] * side < -0.03
            assert opened[0] < folded[0] - 0.10
            assert opened[1] * side > 0.04


def test_scissors_rings_part():
    for obj in objects("scissors", 60):
        joint = obj.joint_of(1)
        assert 50.0 <= np.degrees(joint.range) <= 90.0
        ring_1 = obj.links[0].bounds(roles=("handle",)).mean(axis=0)
        ring_2 = obj.grip_point(1)
        opened = transforms.apply(joint.motion(joint.open), [ring_2])[0]
        assert np.linalg.norm(opened - ring_1) > np.linalg.norm(ring_2 - ring_1) + 0.02
        # The halves lie in two layers across the axis.
        thickness = 2 * max(
            np.abs((s.corners_link() - joint.pivot) @ joint.axis).max()
            for link in obj.links
            for s in link.shapes
            if s.role == "handle"
        )
        assert 0.007 < thickness < 0.03


def test_cutters_slider_moves_along_the_body_and_the_blade_comes_out():
    for obj in objects("cutter", 60):
        joint = obj.joint_of(1)
        assert 0.05 <= joint.range <= 0.10
        axis = np.asarray(joint.axis)
        assert np.linalg.norm(axis) == pytest.approx(1.0)
        body, slider = (
            np.concatenate([s.corners_link() for s in link.shapes if s.role != "stand"]) @ axis
            for link in obj.links
        )
        assert slider.min() > body.min()
        # A blade that is held by its tip stands out of the nose from the start.
        out = 0.035 if obj.attributes["handle"] == "blade" else 0.006
        assert slider.max() < body.max() + out
        assert slider.max() + joint.range > body.max() + 0.04


def test_staplers_nose_goes_up():
    for obj in objects("stapler", 60):
        joint = obj.joint_of(1)
        assert 60.0 <= np.degrees(joint.range) <= 160.0
        assert joint.axis == (0.0, -1.0, 0.0)
        assert joint.pivot[0] < -0.03
        nose = obj.grip_point(1)
        assert nose[0] > 0.02
        assert transforms.apply(joint.motion(0.3), [nose])[0, 2] > nose[2]


@pytest.mark.parametrize("category", REAL_EXTENTS)
def test_real_sizes_lie_within_the_range_of_sizes(category):
    margin = 1.01
    extents = np.concatenate([_extents(obj) for obj in objects(category, 160)])
    for k, (smallest, largest) in enumerate(REAL_EXTENTS[category]):
        name = ("whole", "fixed part", "moving part")[k]
        least, most = extents[:, k].min(axis=0), extents[:, k].max(axis=0)
        assert np.all(least * margin <= smallest), f"{name}: from {least}, real {smallest}"
        assert np.all(most >= np.multiply(largest, margin)), f"{name}: to {most}, real {largest}"


def _extents(obj: ArticulatedObject) -> np.ndarray:
    """Sorted extents (states, 3, 3) of whole, fixed and moving part along the object's own axes."""
    R_object_layout = np.asarray(obj.links[0].shapes[0].rotation)
    fixed, moving = (
        np.concatenate([s.corners_link() for s in link.shapes if s.role != "stand"])
        for link in obj.links
    )
    joint, rows = obj.joints[0], []
    for fraction in FRACTIONS:
        moved = transforms.apply(joint.motion(joint.position(fraction)), moving)
        bodies = (np.concatenate([fixed, moved]), fixed, moved)
        rows.append([np.sort(np.ptp(body @ R_object_layout, axis=0)) for body in bodies])
    return np.array(rows)


@pytest.mark.parametrize(("category", "along"), [("cutter", 0), ("scissors", 2)])
def test_canonical_boxes_lie_along_the_tool_however_it_is_held(category, along):
    axes = []
    for obj in objects(category, 20):
        R = np.asarray(obj.R_object_canonical)
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-9)
        axis = np.asarray(obj.joints[0].axis)
        axes.append(axis)
        np.testing.assert_allclose(np.abs(axis @ R), np.eye(3)[along], atol=1e-9)
        for link, (low, high) in zip(obj.links, obj.canonical_bounds, strict=True):
            corners = np.concatenate([s.corners_link() for s in link.shapes]) @ R
            np.testing.assert_allclose([corners.min(axis=0), corners.max(axis=0)], [low, high])
    # Along the object's own axes it would lie anyhow.
    assert np.ptp(axes, axis=0).max() > 0.5


def test_what_stands_upright_has_its_own_axes():
    for obj in objects("stapler", 5):
        np.testing.assert_array_equal(obj.R_object_canonical, np.eye(3))
        np.testing.assert_allclose(obj.canonical_bounds[0], obj.links[0].bounds())
