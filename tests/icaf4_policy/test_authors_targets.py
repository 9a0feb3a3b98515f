import dataclasses

import numpy as np
import pytest

from artgym.datasets.authors import AuthorsSample
from artgym.datasets.sample import AFFORDANCE_YES, JOINT_NONE, JOINT_REVOLUTE
from artgym.errors import DamagedFileError
from artgym.geometry.rotations import grasp_angle, quaternion_from_matrix
from icaf4_policy import cli
from icaf4_policy.anchors import AnchorConfig, anchors_from_config
from icaf4_policy.authors_targets import _R_LEVEL_CAMERA, targets_from_authors
from icaf4_policy.checkpoint import load_model
from icaf4_policy.targets import targets_from_sample
from tests.datasets.authors_factory import write_authors_file, write_authors_list
from tests.icaf4_policy.toy import toy_sample

ANCHORS = anchors_from_config(AnchorConfig())


def as_the_authors(sample, number=1):
    """A sample as the authors would have released it, the joints exact."""
    R_camera_object = sample.T_camera_object[:3, :3]
    scale = float(sample.object_scale)
    axis_object = R_camera_object.T @ sample.joint_axis_camera[1]
    pivot_camera = sample.joint_pivot_camera[1] - sample.T_camera_object[:3, 3]
    pivot_naocs = (R_camera_object.T @ pivot_camera - sample.object_center) / scale + 0.5
    to_pivot = pivot_naocs - sample.naocs
    to_axis = to_pivot - (to_pivot @ axis_object)[:, None] * axis_object
    distance = np.linalg.norm(to_axis, axis=1)
    affordance = (sample.affordance == 1).astype(np.uint8)
    grasps = np.zeros((len(affordance), 3, 3), dtype=np.float32)
    R_camera_tries = R_camera_object @ sample.tried_rotations()
    for point in np.flatnonzero(affordance):
        row = sample.grasp_row[point]
        grasps[point] = R_camera_tries[row, np.argmax(sample.successful_tries()[row])]
    return AuthorsSample(
        image_id=f"{number:06d}",
        urdf_id=number,
        points_camera=sample.points_camera,
        normals_camera=None,
        part=sample.part,
        npcs=sample.npcs,
        naocs=sample.naocs,
        joint=(distance < 0.2).astype(np.uint8),
        joint_axis_naocs=np.tile(axis_object.astype(np.float32), (len(affordance), 1)),
        direction_to_joint_naocs=(to_axis / distance[:, None]).astype(np.float32),
        joint_nearness=(1.0 - distance / 0.2).clip(0.0).astype(np.float32),
        affordance=affordance,
        R_camera_grasps=grasps,
        joint_type=np.array([JOINT_NONE, JOINT_REVOLUTE], dtype=np.int8),
    )


@pytest.fixture(scope="module")
def sample():
    return toy_sample(2)


def test_joints_and_coordinates_are_those_of_our_own_sample(sample):
    theirs = targets_from_authors(as_the_authors(sample), ANCHORS, 512)
    ours = targets_from_sample(sample, ["toy"], ANCHORS, 512)
    for name in ("part", "npcs", "naocs", "joint_type"):
        np.testing.assert_array_equal(getattr(theirs, name), getattr(ours, name))
    R_camera_ours = sample.R_level_camera.T
    axis_camera = R_camera_ours @ ours.axis_level[1]
    np.testing.assert_allclose(_R_LEVEL_CAMERA.T @ theirs.axis_level[1], axis_camera, atol=1e-4)
    # A point of the same axis, seen from the same point of the object.
    apart = _R_LEVEL_CAMERA.T @ (theirs.pivot_level[1] - theirs.points_level[0])
    apart = apart - R_camera_ours @ (ours.pivot_level[1] - ours.points_level[0])
    assert np.linalg.norm(np.cross(apart, axis_camera)) < 1e-3


def test_each_graspable_point_has_its_grasp(sample):
    authors = as_the_authors(sample)
    targets = targets_from_authors(authors, ANCHORS, len(authors.part))
    for point, affordance in enumerate(targets.affordance):
        block = slice(*targets.match_start[point : point + 2])
        assert block.stop - block.start == affordance
        if affordance:
            index, residual = targets.match_anchor[block], targets.match_residual[block]
            R_level_grasp = _R_LEVEL_CAMERA @ authors.R_camera_grasps[point]
            assert grasp_angle(ANCHORS.grasps(index, residual)[0], R_level_grasp) < 0.01


def test_grasps_turn_with_parts_that_enough_is_seen_of(sample):
    authors = as_the_authors(sample)
    anchors = anchors_from_config(AnchorConfig(frame="part"))
    targets = targets_from_authors(authors, anchors, len(authors.part))
    R_lid_camera = sample.T_camera_parts[1, :3, :3].T
    graspable = np.flatnonzero(targets.affordance)
    assert len(graspable)
    for point in graspable:
        block = slice(*targets.match_start[point : point + 2])
        index, residual = targets.match_anchor[block], targets.match_residual[block]
        R_lid_grasp = R_lid_camera @ authors.R_camera_grasps[point]
        assert grasp_angle(anchors.grasps(index, residual)[0], R_lid_grasp) < 0.01
    lid = np.flatnonzero(authors.part == 1)
    few = dataclasses.replace(
        authors, part=np.where(np.isin(np.arange(len(authors.part)), lid[3:]), 0, authors.part)
    )
    hidden = targets_from_authors(few, anchors, len(authors.part))
    assert (hidden.affordance[few.part == 1] != AFFORDANCE_YES).all()


def test_a_hidden_base_is_named(sample):
    hidden = dataclasses.replace(as_the_authors(sample), part=np.ones_like(sample.part))
    with pytest.raises(DamagedFileError, match="000001: 0 points"):
        targets_from_authors(hidden, ANCHORS, 512)


def released(folder, count):
    """A folder of the authors' with one image an object."""
    for number in range(count):
        each = as_the_authors(toy_sample(number), number)
        quaternions = np.zeros((len(each.part), 4), dtype=np.float32)
        graspable = each.affordance == 1
        wxyz = quaternion_from_matrix(each.R_camera_grasps[graspable].astype(float))
        quaternions[graspable] = np.roll(wxyz, -1, axis=1)
        arrays = {
            "camcs_per_point": each.points_camera,
            "seg_per_point": each.part,
            "npcs_per_point": each.npcs,
            "naocs_per_point": each.naocs,
            "joint_cls_per_point": each.joint,
            "axis_per_point": each.joint_axis_naocs,
            "unitvec_per_point": each.direction_to_joint_naocs,
            "heatmap_per_point": each.joint_nearness,
            "quats_per_point": quaternions,
            "grasp_cls_per_point": each.affordance,
            "joint_type": each.joint_type,
            "urdf_id": np.array(each.urdf_id),
        }
        write_authors_file(folder / "toy" / f"{each.image_id}.h5", arrays)
    ids = [f"{number:06d}" for number in range(count)]
    write_authors_list(folder / "toy" / "train.txt", ids)


def test_train_command_takes_the_authors_folder(tmp_path):
    released(tmp_path, 9)
    weights = tmp_path / "toy.safetensors"
    arguments = ["train", "--category", "toy", "--data", str(tmp_path), "--out", str(weights)]
    arguments += ["--epochs", "1", "--num-points", "512", "--num-grasp-points", "32"]
    assert cli.main([*arguments, "--batch-size", "2"]) == 0
    facts = load_model(weights)[1]["training"]
    # Of nine objects, the first and the ninth choose the weights.
    assert (facts["training_samples"], facts["validation_samples"]) == (7, 2)


def test_the_authors_data_are_of_one_category(tmp_path, capsys):
    released(tmp_path, 2)
    arguments = ["train", "--category", "toy", "box", "--data", str(tmp_path)]
    assert cli.main([*arguments, "--out", str(tmp_path / "both.safetensors")]) != 0
    assert "one category at a time" in capsys.readouterr().err
