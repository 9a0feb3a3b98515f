"""Generated pictures agree with the object, the camera and the labels they come from."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

from artgym import cli
from artgym.annotation.annotate import (
    joint_states,
    label_file_name,
    labels_folder,
    positions_at,
    read_labels,
    visible_points,
)
from artgym.annotation.filter import FilterConfig, Verdict, judge
from artgym.datasets import generate
from artgym.datasets.depth_noise import sensed_depth
from artgym.datasets.generate import (
    GenerationConfig,
    generate_artimage,
    generate_reartmix,
    make_pictures,
    make_scenes,
)
from artgym.datasets.picture_files import PictureFolder
from artgym.datasets.sample import (
    AFFORDANCE_NO,
    AFFORDANCE_UNKNOWN,
    AFFORDANCE_YES,
    JOINT_NONE,
    JOINT_PRISMATIC,
    JOINT_REVOLUTE,
)
from artgym.errors import InvalidArgumentError
from artgym.files import write_arrays
from artgym.geometry import transforms
from artgym.geometry.camera import project
from artgym.geometry.grasps import NUM_CANDIDATES
from artgym.objects import catalog
from artgym.objects.model import canonical_box
from icaf4_policy.anchors import AnchorConfig, anchors_from_config
from icaf4_policy.targets import DrawConfig, draw_item, targets_from_sample

FRACTIONS = (0.05, 0.4)
CONFIG = GenerationConfig(
    views=2,
    camera_size=(160, 120),
    max_points=1500,
    min_points=200,
    min_scene_points=40,
    label_radius=0.012,
)
IDS = ("drawer/1001", "laptop/1000")

pytestmark = pytest.mark.usefixtures("render_system")


def write_labels(object_id: str, root: Path) -> None:
    """Labels with real points and random outcomes; every other point has none."""
    obj, rng = catalog.load(object_id), np.random.default_rng(1)
    fractions = np.repeat(np.array(FRACTIONS)[:, None], obj.num_parts - 1, axis=1)
    columns: list[list[np.ndarray]] = [[], [], [], []]
    for state, each in enumerate(fractions):
        q = positions_at(obj, each)
        for part in range(1, obj.num_parts):
            points, normals = visible_points(obj, q, part, 100, 4, 0.35, rng)
            T_part_object = transforms.invert(obj.link_poses(q)[part])
            columns[0].append(np.full(len(points), state, np.uint8))
            columns[1].append(np.full(len(points), part, np.uint8))
            columns[2].append(transforms.apply(T_part_object, points).astype(np.float32))
            columns[3].append(transforms.rotate(T_part_object, normals).astype(np.float32))
    state_part_points_normals = [np.concatenate(column) for column in columns]
    success = rng.random((len(state_part_points_normals[0]), NUM_CANDIDATES)) < 0.5
    success[::2] = False
    folder = labels_folder(obj.category, catalog.split_of(object_id), root)
    folder.mkdir(parents=True, exist_ok=True)
    names = ("state", "part", "points_part", "normals_part")
    write_arrays(
        folder / label_file_name(object_id),
        {
            "fractions": fractions,
            **dict(zip(names, state_part_points_normals, strict=True)),
            "bits": np.packbits(success, axis=-1, bitorder="little"),
            "verdicts": np.zeros((2, 3), np.int32),
            "ends": np.zeros((2, 5), np.int32),
        },
    )


@pytest.fixture(scope="module")
def labels(tmp_path_factory):
    root = tmp_path_factory.mktemp("labels")
    for object_id in (*IDS, "drawer/1002"):
        write_labels(object_id, root)
    return root


@pytest.fixture(scope="module", params=IDS)
def pictures(request, labels):
    return make_pictures(request.param, CONFIG, labels)


@pytest.fixture(scope="module")
def samples(pictures):
    return [picture.samples[0] for picture in pictures]


def require_the_picture_s_points(picture):
    """Every point of every object lies in a pixel that shows it."""
    for number, sample in enumerate(picture.samples, start=1):
        pixels = project(sample.points_camera, picture.intrinsics)
        np.testing.assert_allclose(pixels % 1.0, 0.5, atol=1e-3)
        column, row = np.floor(pixels).astype(int).T
        np.testing.assert_allclose(sample.points_camera[:, 2], picture.depth[row, column])
        np.testing.assert_array_equal(sample.colors, picture.rgb[row, column])
        np.testing.assert_array_equal(sample.part, picture.part_mask[row, column] - 1)
        assert np.all(picture.instance_mask[row, column] == number)
        left, top, width, height = sample.box
        mask = picture.instance_mask == number
        assert mask.sum() == mask[int(top) : int(top + height), int(left) : int(left + width)].sum()
        assert mask.any(axis=1).sum() <= height
        assert mask.any(axis=0).sum() <= width
    np.testing.assert_array_equal(picture.part_mask > 0, picture.instance_mask > 0)


def test_one_picture_a_view_of_each_state(samples):
    assert len(samples) == CONFIG.views * len(FRACTIONS)
    for i, sample in enumerate(samples):
        expected = [0.0] + [FRACTIONS[i // CONFIG.views]] * (sample.num_parts - 1)
        np.testing.assert_allclose(sample.open_fraction, expected, atol=1e-6)


def test_points_are_the_picture_s(pictures):
    for picture in pictures:
        require_the_picture_s_points(picture)
        (sample,) = picture.samples
        assert {0, 1} <= set(sample.part.tolist())
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
    for sample in samples:
        T = sample.T_camera_object.astype(float)
        assert sample.joint_type[0] == JOINT_NONE
        for part, joint in enumerate(obj.joints, start=1):
            kind = JOINT_REVOLUTE if joint.type == "revolute" else JOINT_PRISMATIC
            assert sample.joint_type[part] == kind
            axis = T[:3, :3] @ np.asarray(joint.axis) * np.sign(joint.range)
            np.testing.assert_allclose(sample.joint_axis_camera[part], axis, atol=1e-5)
            # The part's pose is the joint's motion of the object's.
            q = joint.position(float(sample.open_fraction[part]))
            np.testing.assert_allclose(sample.T_camera_parts[part], T @ joint.motion(q), atol=1e-5)
        np.testing.assert_allclose(sample.T_camera_parts[0], T, atol=1e-6)


def test_labels_are_the_nearest(samples, labels):
    known = read_labels(samples[0].object_id, labels)
    yes = 0
    for i, sample in enumerate(samples):
        rows = np.flatnonzero(known.state == i // CONFIG.views)
        np.testing.assert_array_equal(sample.grasp_points_part, known.points_part[rows])
        points_part = (sample.npcs - 0.5) * sample.part_scales[sample.part, None]
        points_part += sample.part_centers[sample.part]
        labelled = sample.grasp_row >= 0
        row = sample.grasp_row[labelled]
        np.testing.assert_array_equal(sample.part[labelled], sample.grasp_part[row])
        gap = np.linalg.norm(points_part[labelled] - sample.grasp_points_part[row], axis=1)
        assert gap.max() <= CONFIG.label_radius + 1e-5
        carried, success = sample.successful_tries(), known.success[rows]
        assert not np.any(carried & ~success)
        expected = np.where(
            carried.any(axis=1),
            AFFORDANCE_YES,
            np.where(success.any(axis=1), AFFORDANCE_UNKNOWN, AFFORDANCE_NO),
        )
        np.testing.assert_array_equal(sample.affordance[labelled], expected[row])
        assert np.all(sample.affordance[sample.part == 0] == AFFORDANCE_NO)
        assert np.all(sample.affordance[(sample.part > 0) & ~labelled] == AFFORDANCE_UNKNOWN)
        yes += (sample.affordance == AFFORDANCE_YES).sum()
    assert yes > 20


def test_carried_successes_keep_clear_of_everything(samples, labels):
    obj, known = catalog.load(samples[0].object_id), read_labels(samples[0].object_id, labels)
    for i, sample in enumerate(samples[:: CONFIG.views]):
        carried, rows = sample.successful_tries(), np.flatnonzero(known.state == i)
        for g, c in np.argwhere(carried)[::7]:
            q, poses = known.tries(obj, rows[g])
            np.testing.assert_allclose(poses[c, :3, :3], sample.tried_rotations()[g, c], atol=1e-5)
            verdict = judge(
                obj,
                q,
                int(known.part[rows[g]]),
                poses[:1, :3, 3],
                poses[None, [c], :3, :3],
                FilterConfig(penetration=0.0),
            )
            assert verdict[0, 0] == Verdict.POSSIBLE


def test_parts_with_successes_at_the_brink_alone_are_told_them_on_request():
    object_id = "eyeglasses/1001"
    known = read_labels(object_id)
    generous = dataclasses.replace(CONFIG, brink_grasps=True)
    pictures = (make_pictures(object_id, config) for config in (CONFIG, generous))
    doubted = sure_parts = 0
    for i, pair in enumerate(zip(*pictures, strict=True)):
        sample, told = (picture.samples[0] for picture in pair)
        np.testing.assert_array_equal(told.grasp_row, sample.grasp_row)
        success = known.success[known.state == i // CONFIG.views]
        carried, everything = sample.successful_tries(), told.successful_tries()
        assert not np.any(everything & ~success)
        for part in np.unique(told.grasp_part):
            rows = np.flatnonzero(told.grasp_part == part)
            points = np.isin(told.grasp_row, rows)
            if carried[rows].any():
                sure_parts += 1
                np.testing.assert_array_equal(everything[rows], carried[rows])
                np.testing.assert_array_equal(told.affordance[points], sample.affordance[points])
                continue
            offers = np.any(success, axis=1)
            np.testing.assert_array_equal(everything[rows].any(axis=1), offers[rows])
            expected = np.where(offers[told.grasp_row[points]], AFFORDANCE_YES, AFFORDANCE_NO)
            np.testing.assert_array_equal(told.affordance[points], expected)
            doubted += (sample.affordance[points] == AFFORDANCE_UNKNOWN).sum()
    assert doubted > 0
    assert sure_parts > 0


def test_an_object_without_labels_is_pictured_without_grasps(labels):
    pictures = make_pictures("drawer/1003", CONFIG, labels)
    states = joint_states("drawer/1003")
    assert len(pictures) == len(states)
    for picture, fractions in zip(pictures, states, strict=True):
        (sample,) = picture.samples
        np.testing.assert_allclose(sample.open_fraction[1:], fractions, atol=1e-5)
        assert len(sample.grasp_part) == 0
        known = sample.affordance != AFFORDANCE_UNKNOWN
        np.testing.assert_array_equal(known, sample.part == 0)
        targets = targets_from_sample(sample, ["drawer"], anchors_from_config(AnchorConfig()), 500)
        draw = DrawConfig(num_points=256, num_anchors=72, num_grasp_points=16)
        assert not draw_item(targets, draw, np.random.default_rng(0))["grasp_weight"].any()


def test_scenes_show_several_objects_that_do_not_touch(labels):
    scenes = make_scenes(["drawer/1001", "drawer/1002", "laptop/1000"], 5, 3, CONFIG, labels)
    assert len(scenes) == 3
    assert max(len(scene.samples) for scene in scenes) >= 2
    for scene in scenes:
        require_the_picture_s_points(scene)
        for sample in scene.samples:
            assert len(sample.points_camera) >= CONFIG.min_scene_points


def test_noisy_pictures_tell_the_truth_of_noisy_points(labels):
    config = dataclasses.replace(CONFIG, depth_noise=True, views=1)
    for picture in make_pictures("laptop/1000", config, labels):
        require_the_picture_s_points(picture)
        (sample,) = picture.samples
        points_part = (sample.npcs - 0.5) * sample.part_scales[sample.part, None]
        points_part += sample.part_centers[sample.part]
        true = transforms.apply(sample.T_camera_parts[sample.part], points_part[:, None])[:, 0]
        error = np.abs(true[:, 2] - sample.points_camera[:, 2])
        assert 0.0005 < np.median(error) < 0.02


def test_noisy_depth_is_that_of_a_sensor():
    intrinsics = np.array([[600.0, 0, 320], [0, 600, 240], [0, 0, 1]])
    depth = np.full((480, 640), 1.0, np.float32)
    depth[:, 320:] = 0.5
    depth[:10] = 0.0
    sensed = sensed_depth(depth, intrinsics, np.random.default_rng(0))
    assert np.all(sensed[:9] == 0)
    near, far = (sensed[20:, part][sensed[20:, part] > 0] for part in (np.s_[330:], np.s_[:310]))
    # Errors grow with the square of the distance.
    assert 3.0 < np.std(far) / np.std(near) < 5.0
    assert abs(np.median(far) - 1.0) < 0.003
    assert 0.5 < np.mean(sensed[20:, 319:321] == 0) < 0.9
    assert np.mean(sensed[20:, 330:] == 0) < 0.01


def files(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in sorted(folder.iterdir())}


def test_same_bytes_however_made(labels, tmp_path):
    kwargs = {"config": CONFIG, "label_root": labels, "progress": False}
    generate_artimage("drawer", "val", tmp_path / "a", **kwargs)
    generate_artimage("drawer", "val", tmp_path / "b", workers=2, **kwargs)
    made = files(tmp_path / "a")
    assert set(made) == {"drawer_1001.h5", "drawer_1002.h5", "manifest.json"}
    assert files(tmp_path / "b") == made
    (tmp_path / "a" / "drawer_1002.h5").unlink()
    generate_artimage("drawer", "val", tmp_path / "a", **kwargs)
    assert files(tmp_path / "a") == made
    kwargs["categories"] = ["drawer"]
    generate_reartmix("val", tmp_path / "c", 17, **kwargs)
    generate_reartmix("val", tmp_path / "d", 17, workers=2, **kwargs)
    assert files(tmp_path / "c") == files(tmp_path / "d")
    assert len(PictureFolder(tmp_path / "c")) == 17


def test_command_line(labels, tmp_path, capsys):
    command = [
        "generate", "artimage", "--category", "laptop", "--split", "val", "--labels", str(labels),
        "--out", str(tmp_path), "--views", "1", "--camera-size", "160", "120",
    ]  # fmt: skip
    with pytest.raises(InvalidArgumentError, match=r"min_points=600.*larger picture"):
        make_pictures("laptop/1000", GenerationConfig(camera_size=(32, 24)), labels)
    assert cli.main(command) == 0
    assert "2 pictures in" in capsys.readouterr().out
    assert (tmp_path / "laptop" / "val" / "laptop_1000.h5").exists()


@pytest.mark.parametrize("set_name", ["artimage", "reartmix"])
def test_more_objects_than_a_split_has_are_told_before_the_first_picture(
    set_name, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr(generate, "run_shards", lambda *_, **__: pytest.fail("began"))
    command = ["generate", set_name, "--category", "drawer", "--out", str(tmp_path / "out")]
    assert cli.main([*command, "--objects", "1000"]) == 1
    assert "count=1000 objects of drawer/val: expected 1 to 200" in capsys.readouterr().err


def test_more_objects_than_are_labelled(labels, tmp_path):
    manifest = generate_artimage(
        "drawer", "val", tmp_path, objects=3, config=CONFIG, label_root=labels, progress=False
    )
    names = [shard.name for shard in manifest.shards]
    assert names == ["drawer_1000.h5", "drawer_1001.h5", "drawer_1002.h5"]
    # Two labelled states from two places; four states of the first drawer from one.
    assert [shard.items for shard in manifest.shards] == [4, 4, 4]
    with pytest.raises(InvalidArgumentError, match="objects=0"):
        generate_artimage("drawer", "val", tmp_path, objects=0, label_root=labels)


def test_without_labels(tmp_path):
    with pytest.raises(InvalidArgumentError, match="artgym annotate --category drawer"):
        generate_artimage("drawer", "val", tmp_path / "out", label_root=tmp_path)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "wrong",
    [
        {"views": 0},
        {"camera_size": (640, 0)},
        {"seed": -1},
        {"min_points": 0},
        {"label_radius": -0.001},
        {"label_margin": float("nan")},
    ],
)
def test_wrong_settings_are_named(wrong):
    with pytest.raises(InvalidArgumentError, match=next(iter(wrong))):
        GenerationConfig(**wrong)
