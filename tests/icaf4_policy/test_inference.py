import copy
import dataclasses
import json

import numpy as np
import pytest
import torch
from PIL import Image
from scipy.spatial import cKDTree

from artgym.datasets.sample import AFFORDANCE_UNKNOWN, JOINT_NONE
from artgym.errors import InvalidArgumentError, NothingSeenError
from artgym.geometry.rotations import geodesic_angle, grasp_angle, matrix_from_axis_angle
from icaf4_policy import cli
from icaf4_policy.checkpoint import save_model
from icaf4_policy.cloud import level_points
from icaf4_policy.drawing import read_rgb
from icaf4_policy.evaluation import evaluate_grasps, evaluate_sample
from icaf4_policy.inference import MIN_PART_POINTS, Perception
from icaf4_policy.joint_consistency import ConsistencyConfig, consistent_fits
from icaf4_policy.proposals import ProposalConfig
from icaf4_policy.tabletop import fit_table, segment_object
from icaf4_policy.targets import true_part_boxes
from tests.icaf4_policy.toy import toy_network, toy_picture, toy_sample


@pytest.fixture(scope="module")
def picture():
    return toy_picture(3, num_points=2500)


@pytest.fixture(scope="module")
def sample(picture):
    return picture.samples[0]


@pytest.fixture(scope="module")
def perception():
    proposals = ProposalConfig(points=64, count=16)
    return Perception(model=toy_network(), category="toy", proposals=proposals)


def rng():
    return np.random.default_rng(0)


def test_table_is_found_among_outliers():
    generator = np.random.default_rng(0)
    up = matrix_from_axis_angle([2.4, 0.1, 0.0]) @ [0, 0, 1.0]
    plane = generator.uniform(-0.5, 0.5, (2000, 3))
    plane -= (plane @ up)[:, None] * up
    clutter = generator.uniform(-0.3, 0.3, (900, 3))
    clutter += np.maximum(0.05 - clutter @ up, 0)[:, None] * up
    points = np.concatenate([plane, clutter]) + np.array([0, 0, 1.0])
    normal, origin = fit_table(points, generator)
    assert np.degrees(np.arccos(min(normal @ up, 1))) < 0.5
    assert abs((origin - [0, 0, 1.0]) @ up) < 1e-3
    with pytest.raises(NothingSeenError, match="up_camera_hint"):
        fit_table(points, generator, -up)


def test_large_top_of_an_object_is_not_the_table():
    generator = np.random.default_rng(0)
    up = np.array([0, -1.0, 0])
    table = generator.uniform(-0.5, 0.5, (1000, 3)) * [1, 0, 1] + [0, 0.3, 1.2]
    top = generator.uniform(-0.3, 0.3, (1600, 3)) * [1, 0, 1] + [0, 0.1, 1.2]
    _, origin = fit_table(np.concatenate([table, top]), generator, up)
    assert origin[1] == pytest.approx(0.3, abs=1e-3)


def test_object_is_separated_from_the_table(picture, sample):
    view = segment_object(picture.depth, picture.intrinsics, picture.rgb, rng=rng())
    truth = picture.part_mask > 0
    assert np.sum(view.mask & truth) / np.sum(view.mask | truth) > 0.85
    np.testing.assert_allclose(view.up_camera, sample.R_level_camera[2], atol=0.01)
    assert view.points_camera.shape == (view.mask.sum(), 3)
    np.testing.assert_array_equal(view.colors, picture.rgb[view.mask])


def test_excluded_pixels_stay_out(picture):
    exclude = np.zeros(picture.depth.shape, bool)
    exclude[:, :60] = True
    view = segment_object(
        picture.depth, picture.intrinsics, picture.rgb, exclude_mask=exclude, rng=rng()
    )
    assert not (view.mask & exclude).any()


def test_empty_table_is_refused(picture, sample):
    points_up = sample.R_level_camera[2]
    v, u = np.mgrid[: picture.depth.shape[0], : picture.depth.shape[1]] + 0.5
    K = picture.intrinsics
    rays = np.stack([(u - K[0, 2]) / K[0, 0], (v - K[1, 2]) / K[1, 1], np.ones_like(u)], axis=-1)
    depth = -0.5 / (rays @ points_up)
    depth[(depth < 0) | (depth > 3)] = 0
    with pytest.raises(InvalidArgumentError, match="stand out above the table"):
        segment_object(depth, K, picture.rgb, rng=rng())


def test_blind_camera_is_refused(picture):
    with pytest.raises(NothingSeenError, match="0 valid pixels"):
        segment_object(np.zeros_like(picture.depth), picture.intrinsics, picture.rgb, rng=rng())


def test_images_of_different_sizes_are_refused(picture):
    with pytest.raises(InvalidArgumentError, match="same size"):
        segment_object(picture.depth[:-1], picture.intrinsics, picture.rgb, rng=rng())


def test_prediction_is_complete_and_repeatable(perception, picture):
    first, view = perception.perceive(picture.rgb, picture.depth, picture.intrinsics, rng=rng())
    again, _ = perception.perceive(picture.rgb, picture.depth, picture.intrinsics, rng=rng())
    np.testing.assert_array_equal(first.grasps.scores, again.grasps.scores)
    np.testing.assert_array_equal(first.points_camera, view.points_camera[first.point_index])
    np.testing.assert_allclose(first.part_probability.sum(axis=1), 1.0, rtol=1e-5)
    assert len(first.part_boxes) == len(first.object_boxes) == len(first.joints) == 2
    grasps = first.grasps
    assert 0 < len(grasps.scores) <= 16
    assert (np.diff(grasps.scores) <= 0).all()
    assert ((grasps.scores >= 0) & (grasps.scores <= 1)).all()
    np.testing.assert_allclose(np.linalg.det(grasps.R_camera_grasp), 1.0)
    assert set(grasps.of_part(1).parts) <= {1}
    assert first.part_confidences().shape == (2,)
    assert 0 <= first.affordance_confidence() <= 1


def test_a_box_is_less_sure_where_two_estimates_of_its_axes_differ(perception, sample):
    seen = (sample.points_camera, sample.colors, sample.R_level_camera)
    prediction = perception.predict(*seen, rng=rng())
    found = np.array([box is not None for box in prediction.part_boxes])
    assert found.any()
    agreed = dataclasses.replace(prediction, object_boxes=prediction.part_boxes)
    shares = np.array([box.inlier_share if box else 0.0 for box in prediction.part_boxes])
    sure = agreed.pose_confidences()
    np.testing.assert_allclose(sure, agreed.part_confidences() * shares)
    turn = np.eye(4)
    turn[:3, :3] = matrix_from_axis_angle([0.0, np.radians(5.0), 0.0])
    turned = [
        box and dataclasses.replace(box, T_camera_box=box.T_camera_box @ turn)
        for box in prediction.part_boxes
    ]
    unsure = dataclasses.replace(agreed, object_boxes=tuple(turned)).pose_confidences()
    np.testing.assert_allclose(unsure[found], sure[found] / np.e)


def test_a_part_that_is_known_to_be_there_is_found(perception, sample):
    seen = (sample.points_camera, sample.colors, sample.R_level_camera)
    asked = perception.predict(*seen, part=1, rng=rng())
    assert set(asked.grasps.parts) == {1}
    assert (np.diff(asked.grasps.scores) <= 0).all()

    blind = copy.deepcopy(perception.model)
    with torch.no_grad():
        list(blind.segmentation.parameters())[-1][0] += 100.0
    blinded = dataclasses.replace(perception, model=blind)
    overlooked = blinded.predict(*seen, rng=rng())
    assert overlooked.part_boxes[1] is None
    assert overlooked.joints[1].joint_type == JOINT_NONE
    found = blinded.predict(*seen, part=1, rng=rng())
    assert (found.part == 1).sum() == MIN_PART_POINTS
    assert found.part_boxes[1] is not None
    assert found.joints[1].joint_type != JOINT_NONE


@pytest.mark.parametrize("part", [-1, 0, 2])
def test_a_part_that_does_not_move_is_refused(perception, sample, part):
    seen = (sample.points_camera, sample.colors, sample.R_level_camera)
    with pytest.raises(InvalidArgumentError, match=f"part={part}: .* movable parts 1 to 1"):
        perception.predict(*seen, part=part, rng=rng())


def test_boxes_are_made_to_agree_with_the_joints_unless_told_not_to(perception, sample):
    seen = (sample.points_camera, sample.colors, sample.R_level_camera)
    agreed = perception.predict(*seen, rng=rng())
    alone = dataclasses.replace(perception, consistency=None).predict(*seen, rng=rng())
    places = [agreed.part == k for k in range(2)]
    expected = consistent_fits(
        alone.part_boxes,
        [agreed.npcs[on_part] for on_part in places],
        [agreed.points_camera[on_part] for on_part in places],
        [joint.joint_type for joint in agreed.joints],
        [joint.axis_camera for joint in agreed.joints],
    )
    for box, same in zip(agreed.part_boxes, expected, strict=True):
        assert (box is None) == (same is None)
        if box is not None:
            np.testing.assert_array_equal(box.T_camera_box, same.T_camera_box)


def with_coordinates(model, sample, distortion, noise):
    """A network that knows the parts of a sample, and their coordinates but for errors."""
    points_level, _ = level_points(sample.points_camera, sample.R_level_camera)
    tree, tell = cKDTree(points_level), model.forward
    npcs = (sample.npcs.astype(float) - 0.5) @ distortion + 0.5
    npcs += rng().normal(scale=noise, size=npcs.shape)

    def forward(points, *given, **options):
        at = tree.query(points[0].numpy())[1]
        outputs = tell(points, *given, **options)
        segmentation = 20.0 * np.eye(2)[sample.part[at]]
        return dataclasses.replace(
            outputs,
            segmentation=torch.from_numpy(segmentation[None]).float(),
            npcs=torch.from_numpy(npcs[at][None, :, None].repeat(2, axis=2)).float(),
        )

    model.forward = forward
    return model


@pytest.mark.parametrize("features", ["none", "normals"])
def test_faces_of_parts_turn_their_boxes(perception, sample, features):
    distortion = np.eye(3)
    distortion[0, 2] = 0.1
    model = with_coordinates(toy_network(features), sample, distortion, noise=0.02)
    knowing = dataclasses.replace(perception, model=model)
    seen = (sample.points_camera, sample.colors, sample.R_level_camera)
    plain, off = model.config, {}
    for name, errors in (("not looked at", ()), ("tops", (((None, None, 0.001),) * 2,))):
        model.config = dataclasses.replace(plain, face_errors=errors)
        boxes = knowing.predict(*seen, rng=rng()).part_boxes
        true = true_part_boxes(sample)
        off[name] = [
            np.degrees(np.arccos(box.T_camera_box[:3, 2] @ T[:3, 2]))
            for box, T in zip(boxes, true, strict=True)
        ]
    told = knowing.predict(*seen, rng=rng()).part_boxes
    for without in (ConsistencyConfig(faces=False), ConsistencyConfig(worst_face=0.0005)):
        deaf = dataclasses.replace(knowing, consistency=without)
        for box, turned in zip(deaf.predict(*seen, rng=rng()).part_boxes, told, strict=True):
            apart = np.arccos(box.T_camera_box[:3, 2] @ turned.T_camera_box[:3, 2])
            assert np.degrees(apart) > 3.0
    assert min(off["not looked at"]) > 4.0
    assert max(off["tops"]) < 1.0


@pytest.mark.parametrize(
    ("errors", "is_squared"),
    [((0.001, 0.001, 0.001), True), ((None, 0.001, 0.001), False), ((0.1, 0.001, 0.001), False)],
)
def test_a_base_lies_along_its_walls_where_coordinates_do_not(perception, errors, is_squared):
    sample = toy_sample(0, 8000)
    # Of what is seen of the base, half is walls.
    height = np.abs(sample.npcs[:, 2] - 0.5)
    keep = (sample.part == 1) | (height < 0.9 * height[sample.part == 0].max())
    keep[::4] = True
    per_point = ("points_camera", "colors", "part", "npcs", "naocs", "affordance", "grasp_row")
    sample = dataclasses.replace(
        sample, **{name: getattr(sample, name)[keep] for name in per_point}
    )
    third = matrix_from_axis_angle([0.0, 0.0, np.radians(30.0)])
    model = with_coordinates(toy_network("none"), sample, third, noise=0.01)
    model.config = dataclasses.replace(model.config, upright=True, face_errors=((errors,) * 2,))
    knowing = dataclasses.replace(perception, model=model)
    seen = (sample.points_camera, sample.colors, sample.R_level_camera)
    base = knowing.predict(*seen, rng=rng()).part_boxes[0]
    off = geodesic_angle(base.T_camera_box[:3, :3], true_part_boxes(sample)[0][:3, :3])
    assert np.degrees(off) < 1.0 if is_squared else np.degrees(off) > 20.0
    assert np.linalg.norm(base.T_camera_box[:3, 3] - true_part_boxes(sample)[0][:3, 3]) < 0.02


def test_proposals_differ_from_one_another(perception, picture):
    prediction, _ = perception.perceive(picture.rgb, picture.depth, picture.intrinsics, rng=rng())
    grasps, config = prediction.grasps, perception.proposals
    apart = np.linalg.norm(grasps.points_camera[:, None] - grasps.points_camera, axis=-1)
    turned = grasp_angle(grasps.R_camera_grasp[:, None], grasps.R_camera_grasp[None])
    near = (apart < config.distance) & (turned < config.angle)
    assert near.sum() == len(grasps.scores)  # each with itself


def test_point_grasps_and_ranked_grasps_agree(perception, sample):
    seen = (sample.points_camera, sample.colors, sample.R_level_camera)
    keeps_all = dataclasses.replace(perception.proposals, collisions=None)
    ranked = dataclasses.replace(perception, proposals=keeps_all).predict(*seen, rng=rng()).grasps
    everywhere = perception.point_grasps(*seen, top=1, rng=rng())
    scores = everywhere.affordance * everywhere.scores[:, 0]
    best = int(np.argmax(scores))
    assert ranked.scores[0] == pytest.approx(scores[best], rel=1e-4)
    assert grasp_angle(ranked.R_camera_grasp[0], everywhere.R_camera_grasp[best, 0]) < 1e-3


@pytest.fixture(scope="module")
def turning(perception):
    """The same network, its anchors taken to turn with the parts."""
    model = copy.deepcopy(perception.model)
    anchors = dataclasses.replace(model.config.anchors, frame="part")
    model.config = dataclasses.replace(model.config, anchors=anchors)
    return dataclasses.replace(perception, model=model)


def test_anchors_turn_with_the_box_of_the_likeliest_part_that_was_found(
    perception, turning, sample
):
    seen = (sample.points_camera, sample.colors, sample.R_level_camera)
    level = perception.point_grasps(*seen, top=3, rng=rng())
    turned = turning.point_grasps(*seen, top=3, rng=rng())
    prediction = turning.predict(*seen, rng=rng())
    found = [k for k, box in enumerate(prediction.part_boxes) if box is not None]
    R_camera_boxes = np.stack([prediction.part_boxes[k].T_camera_box[:3, :3] for k in found])
    likeliest = prediction.part_probability[:, found].argmax(axis=1)
    R_level_grasps = sample.R_level_camera @ level.R_camera_grasp
    expected = R_camera_boxes[likeliest][:, None] @ R_level_grasps
    assert grasp_angle(turned.R_camera_grasp, expected).max() < 1e-5
    np.testing.assert_array_equal(turned.scores, level.scores)


def test_anchors_turn_with_the_part_that_is_wanted(perception, turning, sample):
    seen = (sample.points_camera, sample.colors, sample.R_level_camera)
    free = dataclasses.replace(perception.proposals, collisions=None)
    level, turned = (
        dataclasses.replace(network, proposals=free).predict(*seen, part=1, rng=rng())
        for network in (perception, turning)
    )
    R_camera_box = turned.part_boxes[1].T_camera_box[:3, :3]
    expected = R_camera_box @ sample.R_level_camera @ level.grasps.R_camera_grasp
    # All turn alike, so that the same ones are kept.
    assert grasp_angle(turned.grasps.R_camera_grasp, expected).max() < 1e-5
    np.testing.assert_array_equal(turned.grasps.points_camera, level.grasps.points_camera)


def test_few_points_are_refused(perception, sample):
    with pytest.raises(InvalidArgumentError, match=r"shape \(10, 3\)"):
        perception.predict(
            sample.points_camera[:10], sample.colors[:10], sample.R_level_camera, rng=rng()
        )


def test_points_that_are_nowhere_are_refused(perception, sample):
    points = sample.points_camera.copy()
    points[7, 2], points[9] = np.nan, np.inf
    with pytest.raises(InvalidArgumentError, match=r"points_camera\[7\] .* nan\].*, 2 here"):
        perception.predict(points, sample.colors, sample.R_level_camera, rng=rng())
    with pytest.raises(InvalidArgumentError, match=r"shape \(\d+, 2\)"):
        perception.predict(points[:, :2], sample.colors, sample.R_level_camera, rng=rng())


def test_a_small_cloud_is_filled_up(perception, sample):
    prediction = perception.predict(
        sample.points_camera[:200], sample.colors[:200], sample.R_level_camera, rng=rng()
    )
    assert len(prediction.points_camera) == 512
    assert set(prediction.point_index) == set(range(200))


def test_evaluation_gives_every_metric(perception, sample):
    row, prediction = evaluate_sample(perception, sample, rng())
    assert len(prediction.grasps.scores)
    assert 0 <= row["part_miou"] <= 1
    assert 0 <= row["affordance_miou"] <= 1
    for source in ("network", "normal_grid_roll", "normal_random_roll", "random_hemisphere"):
        calls, right = (row[f"{name}/{source}/precision@20"] for name in ("grasp_calls", "grasp"))
        assert 0 <= calls <= right <= 1
    assert 0 < row["label_density"] <= row["label_density_graspable"] <= 1


def test_a_view_without_grasp_labels_has_the_other_metrics(perception, sample):
    labelled = ("grasp_bits", "grasp_points_part", "grasp_normals_part", "grasp_part")
    bare = dataclasses.replace(
        sample,
        **{name: getattr(sample, name)[:0] for name in labelled},
        grasp_row=np.full_like(sample.grasp_row, -1),
        affordance=np.full_like(sample.affordance, AFFORDANCE_UNKNOWN),
    )
    row, _ = evaluate_sample(perception, bare, rng())
    whole, _ = evaluate_sample(perception, sample, rng())
    assert row["part_miou"] == whole["part_miou"]
    assert not any(name.startswith("grasp") for name in row)


def test_grasps_can_be_evaluated_alone(perception, sample):
    every, _ = evaluate_sample(perception, sample, rng())
    alone = evaluate_grasps(perception, sample, rng())
    assert set(alone) == {n for n in every if n.startswith(("grasp", "affordance"))}
    # A network's own metrics do not depend on whether chance stands beside them.
    bare = evaluate_grasps(perception, sample, rng(), chance=False)
    own = {n: v for n, v in alone.items() if n.count("/") < 2 or "/network/" in n}
    np.testing.assert_equal(bare, own)


def test_predict_command(perception, picture, tmp_path, capsys):
    weights = tmp_path / "toy.safetensors"
    save_model(weights, perception.model, {})
    Image.fromarray(picture.rgb).save(tmp_path / "rgb.png")
    depth_mm = (picture.depth * 1000).round().astype(np.uint16)
    Image.fromarray(depth_mm).save(tmp_path / "depth.png")
    (tmp_path / "K.json").write_text(json.dumps(picture.intrinsics.tolist()))
    arguments = ["predict", "--weights", weights, "--rgb", tmp_path / "rgb.png"]
    arguments += ["--depth", tmp_path / "depth.png", "--intrinsics", tmp_path / "K.json"]
    arguments += ["--picture", tmp_path / "seen.png", "--grasps", 3]
    assert cli.main([str(a) for a in arguments]) == 0
    (seen,) = json.loads(capsys.readouterr().out)["objects"]
    assert seen["category"] == "toy"
    assert len(seen["grasps"]) == 3
    for name in ("confidence", "box_confidence"):
        assert [0 <= part[name] <= 1 for part in seen["parts"]] == [True, True]
    assert read_rgb(tmp_path / "seen.png").shape == (120, 480, 3)


def test_predict_command_names_what_it_cannot_read(tmp_path, capsys):
    (tmp_path / "rgb.png").write_bytes(b"no image")
    arguments = ["predict", "--weights", "w.safetensors", "--rgb", str(tmp_path / "rgb.png")]
    arguments += ["--depth", "d.npy", "--intrinsics", "K.txt"]
    assert cli.main(arguments) == 1
    assert "rgb.png" in capsys.readouterr().err
