"""Generated samples agree with the object, the camera and the labels they come from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from artgym import cli
from artgym.annotation.annotate import (
    MOVABLE_PART,
    label_file_name,
    labels_folder,
    read_labels,
    visible_points,
)
from artgym.datasets.generate import GenerationConfig, generate_split, make_samples
from artgym.datasets.sample import (
    AFFORDANCE_NO,
    AFFORDANCE_UNKNOWN,
    AFFORDANCE_YES,
    JOINT_NONE,
    JOINT_PRISMATIC,
    JOINT_REVOLUTE,
)
from artgym.errors import DamagedFileError, InvalidArgumentError
from artgym.files import write_arrays
from artgym.geometry import transforms
from artgym.geometry.camera import project
from artgym.geometry.grasps import NUM_CANDIDATES
from artgym.objects import catalog
from artgym.objects.model import canonical_box

FRACTIONS = np.array([0.05, 0.4])
CONFIG = GenerationConfig(views=2, camera_size=(160, 120), max_points=1500, min_points=200)
IDS = ("drawer/1001", "laptop/1000")

pytestmark = pytest.mark.usefixtures("render_system")


def write_labels(object_id: str, root: Path) -> None:
    """Labels with real points and random outcomes; the first half of the points has none."""
    obj, rng = catalog.load(object_id), np.random.default_rng(1)
    rows: list[tuple[np.ndarray, ...]] = []
    for fraction in FRACTIONS:
        q = obj.positions_with(MOVABLE_PART, fraction)
        points, normals = visible_points(obj, q, MOVABLE_PART, 150, 4, 0.35, rng)
        T_part_object = transforms.invert(obj.link_poses(q)[MOVABLE_PART])
        success = rng.random((150, NUM_CANDIDATES)) < 0.2
        success[:75] = False
        rows.append(
            (
                transforms.apply(T_part_object, points).astype(np.float32),
                transforms.rotate(T_part_object, normals).astype(np.float32),
                np.packbits(success, axis=-1, bitorder="little"),
            )
        )
    points_part, normals_part, bits = (np.stack(column) for column in zip(*rows, strict=True))
    folder = labels_folder(obj.category, catalog.split_of(object_id), root)
    folder.mkdir(parents=True, exist_ok=True)
    write_arrays(
        folder / label_file_name(object_id),
        {
            "fractions": FRACTIONS,
            "points_part": points_part,
            "normals_part": normals_part,
            "bits": bits,
            "verdicts": np.zeros((2, 3), np.int32),
            "ends": np.zeros((2, 4), np.int32),
        },
    )


@pytest.fixture(scope="module")
def labels(tmp_path_factory):
    root = tmp_path_factory.mktemp("labels")
    for object_id in (*IDS, "drawer/1002"):
        write_labels(object_id, root)
    return root


@pytest.fixture(scope="module", params=IDS)
def samples(request, labels):
    return make_samples(request.param, CONFIG, labels)


def test_one_sample_a_view_of_each_state(samples):
    assert len(samples) == CONFIG.views * len(FRACTIONS)
    for i, sample in enumerate(samples):
        assert sample.open_fraction[1] == pytest.approx(FRACTIONS[i // CONFIG.views], abs=1e-6)


def test_points_are_the_picture_s(samples):
    for sample in samples:
        pixels = project(sample.points_camera, sample.intrinsics)
        np.testing.assert_allclose(pixels % 1.0, 0.5, atol=1e-3)
        column, row = np.floor(pixels).astype(int).T
        np.testing.assert_allclose(sample.points_camera[:, 2], sample.depth[row, column])
        np.testing.assert_array_equal(sample.colors, sample.rgb[row, column])
        np.testing.assert_array_equal(sample.part, sample.part_mask[row, column] - 1)
        assert set(sample.part.tolist()) == {0, 1}
        assert CONFIG.min_points <= len(sample.points_camera) <= CONFIG.max_points


def test_coordinates_of_parts_and_of_the_object(samples):
    obj = catalog.load(samples[0].object_id)
    for sample in samples:
        for part, link in enumerate(obj.links):
            mine = sample.part == part
            assert np.all((sample.npcs[mine] > 0) & (sample.npcs[mine] < 1))
            points_part = (sample.npcs[mine] - 0.5) * sample.part_scales[
                part
            ] + sample.part_centers[part]
            low, high = link.bounds()
            # A point of a picture is off by its depth's millimetre.
            assert np.all((points_part > low - 0.006) & (points_part < high + 0.006))
            np.testing.assert_allclose(
                transforms.apply(sample.T_camera_parts[part], points_part),
                sample.points_camera[mine],
                atol=1e-5,
            )
        # In the rest state a part's points keep their coordinates.
        rest = (sample.naocs - 0.5) * sample.object_scale + sample.object_center
        scales, centers = sample.part_scales[sample.part, None], sample.part_centers[sample.part]
        np.testing.assert_allclose(rest, (sample.npcs - 0.5) * scales + centers, atol=1e-5)
        np.testing.assert_allclose(
            canonical_box(obj.rest_bounds)[1], sample.object_scale, rtol=1e-6
        )


def test_joints(samples):
    obj = catalog.load(samples[0].object_id)
    joint = obj.joints[0]
    for sample in samples:
        kind = JOINT_REVOLUTE if joint.type == "revolute" else JOINT_PRISMATIC
        assert sample.joint_type.tolist() == [JOINT_NONE, kind]
        T = sample.T_camera_object.astype(float)
        np.testing.assert_allclose(
            sample.joint_axis_camera[1], T[:3, :3] @ np.asarray(joint.axis), atol=1e-5
        )
        # The part's pose is the joint's motion of the object's.
        q = joint.position(float(sample.open_fraction[1]))
        np.testing.assert_allclose(sample.T_camera_parts[1], T @ joint.motion(q), atol=1e-5)
        np.testing.assert_allclose(sample.T_camera_parts[0], T, atol=1e-6)


def test_labels_are_the_nearest(samples, labels):
    known = read_labels(samples[0].object_id, labels)
    yes = 0
    for i, sample in enumerate(samples):
        state = i // CONFIG.views
        points_part = (sample.npcs - 0.5) * sample.part_scales[sample.part, None]
        points_part += sample.part_centers[sample.part]
        labelled = sample.grasp_row >= 0
        assert np.all(sample.part[labelled] == MOVABLE_PART)
        rows = sample.grasp_row[labelled]
        gap = np.linalg.norm(points_part[labelled] - known.points_part[state][rows], axis=1)
        assert gap.max() <= CONFIG.label_radius + 1e-5
        graspable = known.success[state].any(axis=1)
        np.testing.assert_array_equal(
            sample.affordance[labelled],
            np.where(graspable[rows], AFFORDANCE_YES, AFFORDANCE_NO),
        )
        assert np.all(sample.affordance[sample.part == 0] == AFFORDANCE_NO)
        assert np.all(sample.affordance[(sample.part == 1) & ~labelled] == AFFORDANCE_UNKNOWN)
        np.testing.assert_array_equal(sample.successful_tries(), known.success[state])
        yes += (sample.affordance == AFFORDANCE_YES).sum()
    assert yes > 50


def files(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in sorted(folder.iterdir())}


def test_same_bytes_however_made(labels, tmp_path):
    kwargs = {"config": CONFIG, "label_root": labels, "progress": False}
    generate_split("drawer", "val", tmp_path / "a", **kwargs)
    generate_split("drawer", "val", tmp_path / "b", workers=2, **kwargs)
    made = files(tmp_path / "a")
    assert set(made) == {"drawer_1001.h5", "drawer_1002.h5", "manifest.json"}
    assert files(tmp_path / "b") == made
    (tmp_path / "a" / "drawer_1002.h5").unlink()
    generate_split("drawer", "val", tmp_path / "a", **kwargs)
    assert files(tmp_path / "a") == made


def test_command_line(labels, tmp_path, capsys):
    command = [
        "generate", "--category", "laptop", "--split", "val", "--labels", str(labels),
        "--out", str(tmp_path), "--views", "1", "--camera-size", "160", "120",
    ]  # fmt: skip
    with pytest.raises(InvalidArgumentError, match=r"min_points=600.*larger picture"):
        make_samples("laptop/1000", GenerationConfig(camera_size=(32, 24)), labels)
    assert cli.main(command) == 0
    assert "2 samples in" in capsys.readouterr().out
    assert (tmp_path / "laptop" / "val" / "laptop_1000.h5").exists()


def test_without_labels(tmp_path):
    with pytest.raises(InvalidArgumentError, match="artgym annotate --category drawer"):
        generate_split("drawer", "val", tmp_path / "out", label_root=tmp_path)
    with pytest.raises(DamagedFileError, match="drawer_1001"):
        make_samples("drawer/1001", CONFIG, tmp_path)
    assert not (tmp_path / "out").exists()
