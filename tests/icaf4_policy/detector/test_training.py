import dataclasses
import json

import numpy as np
import pytest
import torch

from artgym.datasets.picture_files import write_pictures
from artgym.errors import DamagedFileError, InvalidArgumentError
from artgym.files import Manifest, ShardEntry
from icaf4_policy import cli
from icaf4_policy.checkpoint import description_path, load_model, save_model
from icaf4_policy.detector.config import (
    AugmentationConfig,
    DetectorConfig,
    DetectorTrainingConfig,
)
from icaf4_policy.detector.evaluation import evaluate
from icaf4_policy.detector.inference import Detector
from icaf4_policy.detector.model import DetectorNetwork
from icaf4_policy.detector.training import train_detector
from icaf4_policy.training_run import resume_path
from tests.icaf4_policy.detector.scene import HEIGHT, WIDTH, scene

TINY = DetectorConfig(
    categories=("mug", "pan"),
    input_size=(128, 96),
    widths=(8, 12, 16, 24),
    blocks=(1, 1, 1, 1),
    pyramid_channels=16,
    box_channels=32,
)
CONFIG = DetectorTrainingConfig(
    model=TINY, epochs=2, batch_size=2, precision="float32", validate_every=1
)


@pytest.fixture(scope="module", autouse=True)
def one_thread():
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(scope="module")
def pictures():
    return [scene(i) for i in range(4)], [scene(100)]


def test_interrupted_training_ends_with_the_same_bytes(tmp_path, pictures):
    straight, broken = tmp_path / "straight.safetensors", tmp_path / "broken.safetensors"
    train_detector(CONFIG, *pictures, straight)
    train_detector(CONFIG, *pictures, broken, stop_after_epoch=1)
    assert not broken.exists()
    # The global generator is neither read nor changed.
    torch.manual_seed(7)
    before = torch.get_rng_state()
    train_detector(CONFIG, *pictures, broken)
    assert torch.equal(before, torch.get_rng_state())
    assert not resume_path(broken).exists()
    assert broken.read_bytes() == straight.read_bytes()
    assert description_path(broken).read_text() == description_path(straight).read_text()


def test_one_picture_is_learnt_by_heart(tmp_path):
    config = DetectorTrainingConfig(
        model=dataclasses.replace(TINY, widths=(16, 24, 32, 32), pyramid_channels=32),
        epochs=100,
        batch_size=1,
        learning_rate=2e-3,
        validate_every=100,
        precision="float32",
        augmentation=AugmentationConfig(flip=0, zoom=0, shift=0, color_jitter=0),
    )
    picture = scene()
    detector = train_detector(config, [picture], [picture], tmp_path / "one.safetensors")
    row = evaluate(detector, [picture])
    assert row["box/map50"] == pytest.approx(1.0)
    assert row["mask/map50"] == pytest.approx(1.0)
    found = detector.detect(picture.rgb, picture.depth)
    # So short a training leaves smaller finds inside the true ones.
    assert {each.category for each in found} == {"mug", "pan"}


def test_command_trains_on_all_sets_of_a_folder(tmp_path, pictures, capsys):
    for split, part in zip(("train", "val"), pictures, strict=True):
        for index, some in enumerate((part[: len(part) // 2], part[len(part) // 2 :])):
            folder = tmp_path / "data" / f"set{index}" / split
            write_pictures(folder / "0000.h5", some)
            shard = ShardEntry.of(folder / "0000.h5", len(some))
            Manifest(config={}, planned=1, shards=(shard,)).write(folder)
    weights = tmp_path / "detector.safetensors"
    arguments = ["train-detector", "--data", str(tmp_path / "data"), "--out", str(weights)]
    arguments += [
        "--model.categories",
        "mug",
        "pan",
        "--model.input-size",
        "128",
        "96",
        "--epochs",
        "1",
    ]
    arguments += ["--model.widths", "8", "8", "8", "8", "--model.blocks", "1", "1", "1", "1"]
    assert cli.main(arguments) == 0
    assert str(weights) in capsys.readouterr().out
    description = json.loads(description_path(weights).read_text())
    assert description["training"]["training_pictures"] == 4
    assert description["model"]["categories"] == ["mug", "pan"]
    assert Detector.load(weights).model.config.input_size == (128, 96)


def test_command_without_pictures_says_how_to_make_them(tmp_path, capsys):
    arguments = [
        "train-detector",
        "--data",
        str(tmp_path),
        "--out",
        str(tmp_path / "w.safetensors"),
    ]
    assert cli.main(arguments) == 1
    assert "artgym generate reartmix" in capsys.readouterr().err


def test_both_splits_must_be_there(tmp_path, pictures):
    with pytest.raises(InvalidArgumentError, match="0 validation pictures"):
        train_detector(CONFIG, pictures[0], [], tmp_path / "w.safetensors")


@pytest.fixture
def saved(tmp_path):
    torch.manual_seed(0)
    model = DetectorNetwork(TINY).eval()
    weights = tmp_path / "toy.safetensors"
    save_model(weights, model, {})
    return model, weights


def test_save_and_load_is_bit_exact(saved):
    model, weights = saved
    loaded = Detector.load(weights).model
    assert loaded.config == model.config
    assert not loaded.training
    for name, tensor in model.state_dict().items():
        assert torch.equal(tensor, loaded.state_dict()[name]), name


def test_damaged_weights_are_named(saved):
    _, weights = saved
    data = bytearray(weights.read_bytes())
    data[-50] ^= 1
    weights.write_bytes(data)
    with pytest.raises(DamagedFileError, match=r"toy\.safetensors"):
        Detector.load(weights)
    weights.unlink()
    with pytest.raises(DamagedFileError, match=r"toy\.safetensors"):
        Detector.load(weights)


def test_weights_of_another_kind_are_refused(saved):
    with pytest.raises(DamagedFileError, match="DetectorNetwork, expected Icaf4"):
        load_model(saved[1])


def test_detections_have_the_size_of_the_picture(saved):
    picture = scene()
    wide = np.concatenate([picture.rgb] * 2, axis=1)
    depth = np.concatenate([picture.depth] * 2, axis=1)
    depth[:10] = np.nan
    found = Detector(model=saved[0]).detect(wide, depth, min_score=0.0)
    assert 0 < len(found) <= TINY.detections
    scores = [each.score for each in found]
    assert scores == sorted(scores, reverse=True)
    for each in found:
        assert each.category in TINY.categories
        assert each.mask.shape == (HEIGHT, 2 * WIDTH)
        assert each.mask.dtype == bool
        assert each.box.dtype == np.float32
        left, top, width, height = each.box
        assert min(left, top) >= 0
        assert min(width, height) > 0
        assert left + width <= 2 * WIDTH + 1e-3
        assert top + height <= HEIGHT + 1e-3


@pytest.mark.parametrize(
    ("rgb", "depth", "message"),
    [
        (np.zeros((4, 5, 3), np.uint8), None, "depth is missing"),
        (np.zeros((4, 5, 3), np.uint8), np.zeros((5, 4)), r"depth \(5, 4\)"),
        (np.zeros((4, 5)), np.zeros((4, 5)), r"rgb \(4, 5\)"),
        (np.zeros((0, 5, 3), np.uint8), np.zeros((0, 5)), r"depth \(0, 5\)"),
        (np.zeros((4, 5, 3)), np.zeros((4, 5)), "float64"),
    ],
)
def test_pictures_that_do_not_fit_are_refused(saved, rgb, depth, message):
    with pytest.raises(InvalidArgumentError, match=message):
        Detector(model=saved[0]).detect(rgb, depth)


def test_colours_alone_need_no_depth():
    model = DetectorNetwork(dataclasses.replace(TINY, use_depth=False)).eval()
    assert isinstance(Detector(model=model).detect(scene().rgb), list)


def test_default_network_is_small():
    model = DetectorNetwork(DetectorConfig(categories=tuple("abcdefgh")))
    assert sum(p.numel() for p in model.parameters()) * 4 < 12e6


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("categories", ()),
        ("categories", ("a", "a")),
        ("input_size", (20, 20)),
        ("widths", (8,)),
        ("proposals", 0),
        ("blocks", (1, 1, 0, 1)),
    ],
)
def test_configurations_are_checked(field, value):
    with pytest.raises(InvalidArgumentError, match=field):
        dataclasses.replace(TINY, **{field: value})
