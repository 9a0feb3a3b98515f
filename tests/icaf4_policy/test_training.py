import dataclasses
import json

import numpy as np
import pytest
import torch

from artgym.datasets.picture_files import SampleFolder, write_pictures
from artgym.datasets.sample import AFFORDANCE_UNKNOWN, AFFORDANCE_YES
from artgym.errors import DamagedFileError, InvalidArgumentError, MissingDependencyError
from artgym.files import Manifest, ShardEntry
from icaf4_policy import cli, commands, training_run
from icaf4_policy.anchors import anchors_from_config
from icaf4_policy.backbone.pointnet2 import BackboneConfig
from icaf4_policy.checkpoint import description_path, load_model, save_model
from icaf4_policy.faces import face_errors
from icaf4_policy.inference import Perception
from icaf4_policy.metrics import class_ious
from icaf4_policy.model import Icaf4, ModelConfig
from icaf4_policy.targets import targets_from_sample
from icaf4_policy.training import TrainingConfig, set_threshold, train
from icaf4_policy.training_run import resume_path
from tests.icaf4_policy.toy import toy_picture, toy_sample

CONFIG = TrainingConfig(
    category=("toy",),
    epochs=3,
    batch_size=2,
    num_points=512,
    num_grasp_points=32,
    validate_every=1,
    precision="float32",
)
SMALL = ModelConfig(
    categories=("toy",),
    num_parts=2,
    length_units=(0.25,),
    num_points=256,
    backbone=BackboneConfig(centers=(64, 16), neighbors=8),
)


@pytest.fixture(scope="module")
def samples():
    return [toy_sample(i) for i in range(4)], [toy_sample(100)]


def test_interrupted_training_ends_with_the_same_bytes(tmp_path, samples):
    straight, broken = tmp_path / "straight.safetensors", tmp_path / "broken.safetensors"
    train(CONFIG, *samples, straight)
    train(CONFIG, *samples, broken, stop_after_epoch=1)
    assert resume_path(broken).exists()
    assert not broken.exists()
    train(CONFIG, *samples, broken)
    assert not resume_path(broken).exists()
    assert broken.read_bytes() == straight.read_bytes()
    assert description_path(broken).read_text() == description_path(straight).read_text()


def test_a_log_has_every_epoch(tmp_path, samples, monkeypatch):
    events = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    train(CONFIG, *samples, tmp_path / "toy.safetensors", stop_after_epoch=2, log=tmp_path / "log")
    train(CONFIG, *samples, tmp_path / "toy.safetensors", log=tmp_path / "log")
    log = events.EventAccumulator(str(tmp_path / "log"))
    log.Reload()
    for name in ("training/loss", "validation/total"):
        assert [event.step for event in log.Scalars(name)] == [1, 2, 3]
    monkeypatch.setattr(training_run, "find_spec", lambda name: None)
    with pytest.raises(MissingDependencyError, match=r"artgym\[train\]"):
        train(CONFIG, *samples, tmp_path / "other.safetensors", log=tmp_path)


def test_global_random_state_is_left_alone_and_not_read(tmp_path, samples):
    config = dataclasses.replace(CONFIG, epochs=1)
    files = [tmp_path / "a.safetensors", tmp_path / "b.safetensors"]
    for seed, file in enumerate(files):
        torch.manual_seed(seed)
        np.random.seed(seed)  # noqa: NPY002
        before = torch.get_rng_state()
        train(config, *samples, file)
        assert torch.equal(before, torch.get_rng_state())
    assert files[0].read_bytes() == files[1].read_bytes()


def test_resuming_another_run_is_refused(tmp_path, samples):
    weights = tmp_path / "toy.safetensors"
    train(CONFIG, *samples, weights, stop_after_epoch=1)
    other = dataclasses.replace(CONFIG, learning_rate=1e-4)
    with pytest.raises(InvalidArgumentError, match=r"toy\.resume\.safetensors"):
        train(other, *samples, weights)


def test_damaged_resume_file_is_named(tmp_path, samples):
    weights = tmp_path / "toy.safetensors"
    train(CONFIG, *samples, weights, stop_after_epoch=1)
    whole = resume_path(weights).read_bytes()
    resume_path(weights).write_bytes(whole[: len(whole) // 2])
    with pytest.raises(DamagedFileError, match=r"toy\.resume\.safetensors"):
        train(CONFIG, *samples, weights)


def test_a_training_starts_from_earlier_weights(tmp_path, samples):
    first, again, turned = (tmp_path / f"{name}.safetensors" for name in ("a", "b", "c"))
    train(CONFIG, *samples, first)
    # So slowly that nothing is learnt: what comes out is what went in, but for the statistics.
    still = dataclasses.replace(CONFIG, epochs=1, learning_rate=1e-12, weight_decay=0.0)
    train(still, *samples, again, start=first)
    part = dataclasses.replace(CONFIG.anchors, frame="part")
    train(dataclasses.replace(still, anchors=part), *samples, turned, start=first)
    states = [dict(load_model(path)[0].named_parameters()) for path in (first, again, turned)]
    for name, tensor in states[0].items():
        assert torch.allclose(tensor, states[1][name], atol=1e-8)
        same = torch.allclose(tensor, states[2][name], atol=1e-8)
        assert same != name.startswith("grasp.")
    facts = load_model(turned)[1]["training"]
    assert facts["started_from_sha256"] == load_model(first)[1]["sha256"]
    other = dataclasses.replace(CONFIG, features="none")
    # Told before the first sample is read.
    unread = iter(()), iter(())
    with pytest.raises(InvalidArgumentError, match=r"a\.safetensors.*features=normals.*none"):
        train(other, *unread, tmp_path / "d.safetensors", start=first)
    with pytest.raises(DamagedFileError, match=r"missing\.json"):
        train(CONFIG, *unread, tmp_path / "d.safetensors", start=tmp_path / "missing.safetensors")


def test_both_splits_must_be_there(tmp_path, samples):
    with pytest.raises(InvalidArgumentError, match="0 validation samples"):
        train(CONFIG, samples[0], [], tmp_path / "toy.safetensors")


def test_one_network_learns_several_categories(tmp_path, samples):
    others = [
        [dataclasses.replace(s, object_id=s.object_id.replace("toy", "box")) for s in each]
        for each in samples
    ]
    both = [[*mine, *theirs] for mine, theirs in zip(samples, others, strict=True)]
    config = dataclasses.replace(CONFIG, category=("toy", "box"), epochs=1)
    weights = tmp_path / "both.safetensors"
    train(config, *both, weights)
    with pytest.raises(InvalidArgumentError, match=r"category: .*toy, box"):
        Perception.load(weights)
    seen = (samples[0][0].points_camera, samples[0][0].colors, samples[0][0].R_level_camera)
    told = [
        Perception.load(weights, category).predict(*seen, rng=np.random.default_rng(0))
        for category in config.category
    ]
    assert not np.allclose(told[0].part_probability, told[1].part_probability)


def test_objects_stand_upright_if_all_of_the_training_do(tmp_path, samples):
    standing, validation = samples
    # A tenth of a radian about x, before the object's pose.
    tilted = np.eye(4)
    tilted[1:3, 1:3] = [[np.cos(0.1), -np.sin(0.1)], [np.sin(0.1), np.cos(0.1)]]
    lean = dataclasses.replace(standing[0], T_camera_object=standing[0].T_camera_object @ tilted)
    for name, training, upright in (("all", standing, True), ("not", [lean, *standing], False)):
        weights = tmp_path / f"{name}.safetensors"
        train(dataclasses.replace(CONFIG, epochs=1), training, validation, weights)
        assert load_model(weights)[0].config.upright is upright


def test_faces_are_looked_at_as_they_are_in_training(tmp_path, samples):
    training, validation = samples
    many = [*training] * (20 // len(training) + 1)
    model = train(
        dataclasses.replace(CONFIG, epochs=1), many, validation, tmp_path / "toy.safetensors"
    )
    targets = [
        targets_from_sample(s, ("toy",), anchors_from_config(CONFIG.anchors), 4096) for s in many
    ]
    expected = face_errors(targets, 2)
    assert model.config.face_errors == (expected,)
    assert any(error is not None for of_part in expected for error in of_part)
    assert load_model(tmp_path / "toy.safetensors")[0].config == model.config


def test_points_are_called_graspable_where_that_agrees_best_with_the_validation(tmp_path, samples):
    model = train(dataclasses.replace(CONFIG, epochs=1), *samples, tmp_path / "toy.safetensors")
    assert load_model(tmp_path / "toy.safetensors")[0].config == model.config
    anchors = anchors_from_config(CONFIG.anchors)
    targets = [targets_from_sample(s, ("toy",), anchors, 512) for s in samples[0]]
    # Every point of such a cloud is drawn, in whatever order.
    assert {len(t.points_level) for t in targets} == {512}
    set_threshold(model, targets, CONFIG)
    ious = []
    for t in targets:
        with torch.inference_mode():
            given = (
                torch.from_numpy(a)[None] for a in (t.points_level, t.colors / np.float32(255))
            )
            outputs = model(*given, torch.zeros(1, dtype=torch.long), 1)
        probability = outputs.affordance[0].softmax(dim=-1)[:, 1].numpy()
        known, yes = t.affordance != AFFORDANCE_UNKNOWN, t.affordance == AFFORDANCE_YES
        ious.append(
            [class_ious((probability >= p)[known], yes[known], 2)[1] for p in np.arange(1, 20) / 20]
        )
    means = np.mean(ious, axis=0)
    chosen = round(20 * model.config.graspable_from) - 1
    assert means[chosen] == pytest.approx(means.max(), abs=0.02)
    assert means.max() > means.min() + 0.1


def test_samples_of_other_categories_are_refused(tmp_path, samples):
    config = dataclasses.replace(CONFIG, category=("box",))
    with pytest.raises(InvalidArgumentError, match=r"'toy/0000' among those of box"):
        train(config, *samples, tmp_path / "box.safetensors")


def test_a_device_that_is_not_there_is_named(tmp_path, capsys):
    with pytest.raises(InvalidArgumentError, match=r"device='cuda:99' cannot be used"):
        commands.train(CONFIG, data=tmp_path, out=tmp_path / "toy.safetensors", device="cuda:99")


@pytest.mark.skipif(not torch.cuda.is_available(), reason="no GPU here")
def test_a_gpu_learns_the_same(tmp_path, samples):
    here, there = tmp_path / "cpu.safetensors", tmp_path / "gpu.safetensors"
    train(CONFIG, *samples, here)
    train(CONFIG, *samples, there, device="cuda")
    losses = [
        [entry["total"] for entry in load_model(weights)[1]["training"]["validation"]]
        for weights in (here, there)
    ]
    np.testing.assert_allclose(losses[1], losses[0], rtol=0.05)


def write_splits(folder, parts):
    """Pictures to train with and to choose by, as sets in a folder."""
    for split, part in zip(("train", "val"), parts, strict=True):
        write_pictures(folder / split / "0000.h5", part)
        shard = ShardEntry.of(folder / split / "0000.h5", len(part))
        Manifest(config={}, planned=1, shards=(shard,)).write(folder / split)


def test_train_command(tmp_path, samples, capsys):
    pictures = [[toy_picture(int(sample.object_id[-4:])) for sample in part] for part in samples]
    write_splits(tmp_path / "data" / "toy", pictures)
    weights = tmp_path / "weights" / "toy.safetensors"
    arguments = ["train", "--category", "toy", "--data", str(tmp_path / "data")]
    arguments += ["--out", str(weights), "--epochs", "1", "--num-points", "512"]
    arguments += ["--num-grasp-points", "32", "--batch-size", "2", "--anchors.kind", "so3"]
    assert cli.main(arguments) == 0
    assert str(weights) in capsys.readouterr().out
    _, description = load_model(weights)
    facts = description["training"]
    assert facts["config"]["num_points"] == 512
    assert facts["config"]["anchors"]["kind"] == "so3"
    assert (facts["training_samples"], facts["validation_samples"]) == tuple(map(len, samples))


def test_a_missing_folder_is_told_before_samples_are_read(tmp_path, samples, monkeypatch):
    pictures = [[toy_picture(int(sample.object_id[-4:])) for sample in part] for part in samples]
    write_splits(tmp_path / "data" / "toy", pictures)
    monkeypatch.setattr(SampleFolder, "_item", lambda *_: pytest.fail("a sample was read"))
    with pytest.raises(DamagedFileError, match=r"scenes.train.manifest\.json"):
        commands.train(
            CONFIG,
            data=tmp_path / "data",
            out=tmp_path / "toy.safetensors",
            scenes=(tmp_path / "scenes",),
            device="cpu",
        )


def test_scenes_add_their_objects_of_the_category(tmp_path, samples, capsys):
    pictures = [[toy_picture(i) for i in part] for part in ((0, 1, 2), (3,))]
    write_splits(tmp_path / "data" / "toy", pictures)
    strange = [
        [
            dataclasses.replace(
                picture,
                samples=(dataclasses.replace(picture.samples[0], object_id=f"{name}/0000"),),
            )
            for name, picture in zip(("toy", "mug"), part * 2, strict=False)
        ]
        for part in pictures
    ]
    scenes = [tmp_path / "scenes", tmp_path / "more"]
    for folder in scenes:
        write_splits(folder, strange)
    weights = tmp_path / "toy.safetensors"
    arguments = ["train", "--category", "toy", "--data", str(tmp_path / "data")]
    arguments += ["--scenes", *map(str, scenes), "--out", str(weights), "--epochs", "1"]
    arguments += ["--num-points", "512", "--num-grasp-points", "32", "--batch-size", "2"]
    assert cli.main(arguments) == 0
    facts = load_model(weights)[1]["training"]
    assert (facts["training_samples"], facts["validation_samples"]) == (3 + 2, 1 + 2)


@pytest.fixture
def saved(tmp_path):
    torch.manual_seed(0)
    model = Icaf4(SMALL).eval()
    weights = tmp_path / "toy.safetensors"
    save_model(weights, model, {"note": "untrained"})
    return model, weights


def test_save_and_load_is_bit_exact(saved):
    model, weights = saved
    loaded, description = load_model(weights)
    assert loaded.config == model.config
    assert description["training"] == {"note": "untrained"}
    for name, tensor in model.state_dict().items():
        assert torch.equal(tensor, loaded.state_dict()[name]), name
    cloud = torch.randn(1, 256, 3, generator=torch.Generator().manual_seed(1))
    given = (cloud, cloud.sigmoid(), torch.tensor([0]))
    with torch.no_grad():
        a, b = model(*given), loaded(*given)
    assert torch.equal(a.residuals, b.residuals)


def cut_short(weights):
    weights.write_bytes(weights.read_bytes()[:-100])


def flip_a_bit(weights):
    data = bytearray(weights.read_bytes())
    data[-50] ^= 1
    weights.write_bytes(data)


def empty(weights):
    weights.write_bytes(b"")


@pytest.mark.parametrize("damage", [cut_short, flip_a_bit, empty, lambda w: w.unlink()])
def test_damaged_weights_are_named(saved, damage):
    _, weights = saved
    damage(weights)
    with pytest.raises(DamagedFileError, match=r"toy\.safetensors"):
        load_model(weights)


def without_format(description):
    del description["format"]


def of_the_future(description):
    description["format"] = 99


def of_another_network(description):
    description["model"]["num_parts"] = 5


def with_nonsense(description):
    description["model"]["backbone"] = "large"


@pytest.mark.parametrize(
    "damage", [without_format, of_the_future, of_another_network, with_nonsense]
)
def test_descriptions_that_do_not_fit_are_named(saved, damage):
    _, weights = saved
    description = json.loads(description_path(weights).read_text())
    damage(description)
    description_path(weights).write_text(json.dumps(description))
    with pytest.raises(DamagedFileError, match=r"toy\.(json|safetensors)"):
        load_model(weights)


def test_unreadable_description_is_named(saved):
    _, weights = saved
    description_path(weights).write_bytes(b"\xff{")
    with pytest.raises(DamagedFileError, match=r"toy\.json"):
        load_model(weights)


def test_objects_may_have_fewer_parts_than_their_category(tmp_path, samples):
    one = samples[0][0]
    arrays = {
        name: getattr(one, name)
        for name in (
            *("part_centers", "part_scales", "joint_type", "joint_axis_camera"),
            *("joint_pivot_camera", "open_fraction", "T_camera_parts", "T_object_rest_parts"),
        )
    }
    wider = {name: np.concatenate([array, array[-1:]]) for name, array in arrays.items()}
    mixed = [one, dataclasses.replace(one, **wider)]
    path = tmp_path / "mixed.safetensors"
    model = train(dataclasses.replace(CONFIG, epochs=1), mixed, samples[1], path)
    assert model.config.num_parts == 3


def test_a_sample_of_another_category_is_refused(tmp_path, samples):
    stray = dataclasses.replace(samples[0][0], object_id="mug/0001")
    with pytest.raises(InvalidArgumentError, match=r"mug/0001.*toy"):
        train(CONFIG, [stray], samples[1], tmp_path / "weights.safetensors")
