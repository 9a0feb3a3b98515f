"""Objects that look the same from behind."""

import dataclasses

import numpy as np
import pytest

from artgym.datasets.sample import Picture, Sample
from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.geometry.screw import joint_motion
from artgym.geometry.transforms import apply, invert, transform_from
from icaf4_policy.naming import (
    faces_camera,
    half_turn_parts,
    named_from_view,
    picture_named_from_view,
)
from icaf4_policy.targets import successful_grasps, true_object_boxes, true_part_boxes
from tests.icaf4_policy.toy import toy_picture, toy_sample

#: Base, back and front flap, and those at the left and right: middles and sizes of their boxes at
#: rest, their hinges.
MIDDLES = np.array(
    [[0.0, 0.0, 0.1], [-0.1, 0.0, 0.21], [0.1, 0.0, 0.21], [0.0, 0.1, 0.21], [0.0, -0.1, 0.21]]
)
SIZES = np.array(
    [[0.4, 0.3, 0.2], [0.2, 0.3, 0.02], [0.2, 0.3, 0.02], [0.4, 0.1, 0.02], [0.4, 0.1, 0.02]]
)
PIVOTS = np.array(
    [[0.0, 0.0, 0.0], [-0.2, 0.0, 0.2], [0.2, 0.0, 0.2], [0.0, 0.15, 0.2], [0.0, -0.15, 0.2]]
)
AXES = np.array(
    [[0.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]
)
OPEN = np.array([0.0, 1.0, 0.3, 0.7, 0.5])
#: Which of the parts above a carton with two or four flaps has, and which is like which.
TWO, FOUR = [0, 1, 2], [0, 1, 2, 3, 4]
TWINS = np.array([0, 2, 1, 4, 3])
#: From the canonical axes to those of the object.
TURNED = matrix_from_axis_angle([0.0, 0.0, 0.5])


def carton(yaw: float, rows: list[int] = TWO, quarters: int = 0) -> Sample:
    """A carton; at yaw 0 its front is turned towards the camera.

    Args:
        yaw: radians.
        rows: of the tables above, one a part, in the order of their numbers.
        quarters: turns of the axes along which the same carton is described.
    """
    described = matrix_from_axis_angle([0.0, 0.0, quarters * np.pi / 2])
    middles, pivots, axes = (table[rows] @ described for table in (MIDDLES, PIVOTS, AXES))
    sizes = np.abs(SIZES[rows] @ described)
    R_object_canonical = TURNED @ described
    T_canonical_parts = np.stack(
        [
            joint_motion("revolute", axis, pivot, q) if q else np.eye(4)
            for axis, pivot, q in zip(axes, pivots, OPEN[rows], strict=True)
        ]
    )
    turn = transform_from(R_object_canonical, np.zeros(3))
    T_object_parts = turn @ T_canonical_parts @ invert(turn)
    # The camera looks along its z axis; the object's z is up, its canonical x axis towards it.
    R_camera_canonical = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
    R_camera_canonical = R_camera_canonical @ matrix_from_axis_angle([0.0, 0.0, yaw])
    T_camera_object = transform_from(R_camera_canonical @ TURNED.T, [0.0, 0.2, 1.0])
    T_camera_parts = T_camera_object @ T_object_parts

    toy, rng = toy_sample(), np.random.default_rng(0)
    here = rng.permutation(
        np.resize(sorted(rows), 600)
    )  # rows of the tables: the same points, however
    part = np.array([rows.index(row) for row in here])
    rest = (MIDDLES[here] + SIZES[here] * rng.uniform(-0.5, 0.5, (600, 3))) @ described
    scales, size = np.linalg.norm(sizes, axis=1), np.linalg.norm([0.4, 0.3, 0.22])
    center = np.array([0.0, 0.0, 0.11])
    R_camera_base = T_camera_object[:3, :3] @ R_object_canonical
    labels = np.array([rows.index(row) for row in rng.choice(TWO, len(toy.grasp_part))])
    return dataclasses.replace(
        toy,
        points_camera=apply(T_camera_parts[part], (rest @ R_object_canonical.T)[:, None])[
            :, 0
        ].astype("f4"),
        colors=np.zeros((600, 3), np.uint8),
        part=part.astype(np.uint8),
        npcs=((rest - middles[part]) / scales[part, None] + 0.5).astype("f4"),
        naocs=((rest - center) / size + 0.5).astype("f4"),
        affordance=np.ones(600, np.uint8),
        grasp_row=rng.integers(0, len(labels), 600).astype(np.int32),
        grasp_part=labels.astype(np.uint8),
        T_camera_parts=T_camera_parts.astype("f4"),
        R_object_canonical=R_object_canonical.astype("f4"),
        part_centers=middles.astype("f4"),
        part_scales=scales.astype("f4"),
        T_camera_object=T_camera_object.astype("f4"),
        T_object_rest_parts=np.tile(np.eye(4, dtype="f4"), (len(rows), 1, 1)),
        object_center=center.astype("f4"),
        object_scale=np.asarray(size, "f4"),
        joint_type=np.array([-1, 1, 1, 1, 1], np.int8)[: len(rows)],
        joint_axis_camera=(axes @ R_camera_base.T).astype("f4"),
        joint_pivot_camera=(pivots @ R_camera_base.T + T_camera_object[:3, 3]).astype("f4"),
        open_fraction=OPEN[rows].astype("f4"),
    )


@pytest.mark.parametrize("rows", [TWO, FOUR])
@pytest.mark.parametrize("yaw", [0.0, 1.2, -1.2])
def test_a_front_that_is_seen_stays(yaw, rows):
    sample = carton(yaw, rows)
    assert faces_camera(sample)
    assert half_turn_parts(sample).tolist() == TWINS[rows].tolist()
    assert named_from_view(sample) is sample


@pytest.mark.parametrize("rows", [TWO, FOUR])
@pytest.mark.parametrize("yaw", [np.pi, 2.0, -2.0])
def test_the_side_towards_the_camera_becomes_the_front(yaw, rows):
    sample = carton(yaw, rows)
    named = named_from_view(sample)
    assert not faces_camera(sample)
    assert faces_camera(named)
    assert named_from_view(named) is named
    np.testing.assert_array_equal(named.part, TWINS[sample.part])
    np.testing.assert_allclose(named.open_fraction, OPEN[TWINS[rows]], atol=1e-6)
    # From the other side and so named, all of it is what a carton in front is.
    other = carton(yaw - np.pi, rows)
    np.testing.assert_allclose(named.joint_axis_camera[1:], other.joint_axis_camera[1:], atol=1e-6)
    np.testing.assert_allclose(true_part_boxes(named)[0], true_part_boxes(other)[0], atol=1e-6)
    # The coordinates are those of the boxes, and so are all boxes where points are.
    for boxes, coordinates, scale in (
        (true_part_boxes(named), named.npcs, named.part_scales[named.part]),
        (true_object_boxes(named), named.naocs, np.full(600, named.object_scale)),
    ):
        local = (coordinates - 0.5) * scale[:, None]
        there = apply(boxes[named.part], local[:, None])[:, 0]
        np.testing.assert_allclose(there, sample.points_camera, atol=1e-5)


@pytest.mark.parametrize("yaw", [0.3, 1.4, 2.9, -1.7])
@pytest.mark.parametrize("quarters", [0, 1, 2, 3])
@pytest.mark.parametrize("rows", [TWO, FOUR, [0, 2, 1], [0, 2, 1, 3, 4], [0, 1, 2, 4, 3]])
def test_however_it_is_described_it_is_named_alike(yaw, quarters, rows):
    named = named_from_view(carton(yaw, rows, quarters))
    usual = named_from_view(carton(yaw, sorted(rows)))
    for field in dataclasses.fields(Sample):
        mine, theirs = getattr(named, field.name), getattr(usual, field.name)
        if field.name != "object_id":
            np.testing.assert_allclose(mine, theirs, atol=2e-6, err_msg=field.name)


def test_grasps_stay_where_they_are():
    sample = carton(np.pi)
    for mine, theirs in zip(
        successful_grasps(named_from_view(sample), "level"),
        successful_grasps(sample, "level"),
        strict=True,
    ):
        np.testing.assert_allclose(mine, theirs, atol=1e-6)


def test_what_differs_keeps_its_front():
    sample = carton(np.pi)
    assert half_turn_parts(toy_sample()) is None
    for change in (
        {"part_scales": sample.part_scales * np.array([1.0, 1.1, 1.0], "f4")},
        {"part_centers": sample.part_centers + np.array([[0], [0.02], [0.0]], np.float32)},
        {"joint_pivot_camera": sample.joint_pivot_camera + np.array([[0], [0.02], [0]], "f4")},
        {"joint_axis_camera": sample.joint_axis_camera * np.array([[0], [-1], [1]], "f4")},
        {"joint_type": np.array([-1, 0, 1], np.int8)},
    ):
        other = dataclasses.replace(sample, **change)
        assert half_turn_parts(other) is None, list(change)
        assert named_from_view(other) is other


def test_masks_are_numbered_alike():
    toy = toy_picture()
    samples = (carton(np.pi), toy.samples[0], carton(0.0))
    instance_mask = np.arange(4, dtype=np.uint8).repeat(3).reshape(1, 12)
    part_mask = np.array([[0, 0, 0, 1, 2, 3, 1, 2, 2, 1, 2, 3]], np.uint8)
    picture = Picture(
        rgb=np.zeros((1, 12, 3), np.uint8),
        depth=np.ones((1, 12), np.float32),
        instance_mask=instance_mask,
        part_mask=part_mask,
        intrinsics=toy.intrinsics,
        samples=samples,
    )
    named = picture_named_from_view(picture)
    assert named.part_mask.tolist() == [[0, 0, 0, 1, 3, 2, 1, 2, 2, 1, 2, 3]]
    assert [faces_camera(s) for s in named.samples[::2]] == [True, True]
    assert named.samples[1] is toy.samples[0]
    assert part_mask[0, 4] == 2
