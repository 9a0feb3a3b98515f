"""What the subcommands of `icaf4` do; their arguments are built from the signatures."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch
import tyro

from artgym.datasets.authors import AuthorsFolder, AuthorsSample
from artgym.datasets.picture_files import PictureFolder, SampleFolder
from artgym.datasets.sample import Picture, Sample
from artgym.errors import InvalidArgumentError
from icaf4_policy import drawing
from icaf4_policy.backbone.classical import DESCRIPTOR_CHANNELS
from icaf4_policy.checkpoint import description_path
from icaf4_policy.detector.config import DetectorTrainingConfig
from icaf4_policy.features import Features, described
from icaf4_policy.inference import Perception
from icaf4_policy.prediction import Prediction
from icaf4_policy.shipped import weights_path
from icaf4_policy.training import TrainingConfig
from icaf4_policy.training import train as run_training

Samples = Iterable[Sample | AuthorsSample]

#: Of the authors' training objects, every so many chooses the weights: theirs for that are those
#: of the test.
_AUTHORS_VALIDATION = 8

#: A config's own options are called `--epochs`, those of what it holds `--anchors.kind`.
_UNPREFIXED = tyro.conf.arg(name="")


def train(
    config: Annotated[TrainingConfig, _UNPREFIXED],
    *,
    data: Path,
    out: Path,
    scenes: tuple[Path, ...] = (),
    start: Path | None = None,
    log: Path | None = None,
    device: str = "auto",
    threads: int = 1,
) -> int:
    """Train on generated samples. Interrupted, the same command goes on where it stopped.

    Args:
        config: how to train.
        data: folder with `{category}/train` and `{category}/val`, made by `artgym generate`; or
            one of the authors' with `{category}/train.txt` and the listed files, of one category,
            where every eighth object of the list chooses the weights.
        out: weights to write, ending in .safetensors.
        scenes: folders with `train` and `val`, made by `artgym generate reartmix`, whose objects of
            the categories are learnt too: turned anyhow and partly hidden.
        start: weights to start from instead of random ones, for the same categories and features;
            grasps of other anchors are learnt afresh.
        log: folder for TensorBoard.
        device: cpu, cuda, cuda:1, ...; auto takes a GPU if there is one. Several GPUs train several
            networks at once, a command each. Only the CPU gives the same bytes again.
        threads: of torch; results are repeatable for the same number of them.
    """
    torch.set_num_threads(threads)
    if device == "auto":
        device = "cuda" if torch.cuda.is_available() else "cpu"
    device = _usable(device)
    samples = _training_samples(data, scenes, config.category, config.features)
    run_training(config, *samples, out, start=start, log=log, device=device)
    print(f"wrote {out} and {description_path(out)}")
    return 0


def _usable(device: str) -> str:
    """A device's name, once something could be put there."""
    try:
        torch.zeros(1, device=device)
    except (RuntimeError, AssertionError) as error:
        reason = str(error).splitlines()[0]
        raise InvalidArgumentError(
            f"device={device!r} cannot be used ({reason}): expected cpu, or cuda where torch finds "
            "a GPU."
        ) from error
    return device


def _training_samples(
    data: Path, scenes: Sequence[Path], categories: Sequence[str], features: Features
) -> tuple[Samples, Samples]:
    """Those to train with, and those of other objects that choose the weights."""
    listed = [c for c in categories if (data / c / "train.txt").is_file()]
    if not listed:
        training, validation = (
            _split(data, scenes, categories, split, features) for split in ("train", "val")
        )
        return training, validation
    if len(categories) > 1:
        raise InvalidArgumentError(
            f"category={', '.join(categories)}: {data / listed[0]} holds the authors' data, which "
            "is trained with one category at a time."
        )
    if features in DESCRIPTOR_CHANNELS:
        raise InvalidArgumentError(
            f"features={features!r}: {data / listed[0]} holds the authors' data, which has no "
            "pictures to describe points by. Train with other features, or on what 'artgym "
            "generate' makes."
        )
    if scenes:
        raise InvalidArgumentError(
            f"scenes={', '.join(map(str, scenes))}: {data / listed[0]} holds the authors' data, "
            "which is trained with alone."
        )
    samples = AuthorsFolder(data, listed[0], "train")
    numbers = [sample.urdf_id for sample in samples]
    chosen = set(sorted(set(numbers))[::_AUTHORS_VALIDATION])
    return (
        (samples[i] for i, number in enumerate(numbers) if number not in chosen),
        (samples[i] for i, number in enumerate(numbers) if number in chosen),
    )


def _split(
    data: Path, scenes: Sequence[Path], categories: Sequence[str], split: str, features: Features
) -> Iterator[Sample]:
    """The samples of a split, described; folders are opened at once, samples read one at a time."""
    own = _folders([data / category / split for category in categories], features)
    mixed = _folders([folder / split for folder in scenes], features, categories)
    return chain(own, mixed)


def _folders(
    paths: Sequence[Path], features: Features, categories: Sequence[str] | None = None
) -> Iterator[Sample]:
    """The samples of folders, described; of some categories, or all."""

    def wanted(sample: Sample) -> bool:
        return categories is None or sample.object_id.partition("/")[0] in categories

    if features in DESCRIPTOR_CHANNELS:
        pictures = [PictureFolder(path) for path in paths]
        return (
            described(picture, sample, features)
            for picture in chain(*pictures)
            for sample in filter(wanted, picture.samples)
        )
    # Pictures take far longer to read than samples.
    return filter(wanted, chain(*[SampleFolder(path) for path in paths]))


def train_detector(
    config: Annotated[DetectorTrainingConfig, _UNPREFIXED],
    *,
    data: Path,
    out: Path,
    threads: int = 1,
) -> int:
    """Train the detector on generated pictures. Interrupted, the same command goes on.

    Args:
        config: how to train.
        data: folder that holds, at any depth, folders `train` and `val` made by `artgym generate`.
        out: weights to write, ending in .safetensors.
        threads: of torch; results are repeatable for the same number of them.
    """
    # torchvision takes long to import, and only this command needs it.
    from icaf4_policy.detector.training import train_detector as run_detector_training

    torch.set_num_threads(threads)
    run_detector_training(config, _pictures(data, "train"), _pictures(data, "val"), out)
    print(f"wrote {out} and {description_path(out)}")
    return 0


def _pictures(data: Path, split: str) -> Iterator[Picture]:
    """The pictures of a split in all sets below a folder."""
    manifests = sorted(data.glob(f"**/{split}/manifest.json"))
    if not manifests:
        raise InvalidArgumentError(
            f"data={str(data)!r} has no pictures of the split {split!r}: make them with 'artgym "
            f"generate reartmix --out {data}'."
        )
    return chain.from_iterable(PictureFolder(manifest.parent) for manifest in manifests)


def predict(
    *,
    rgb: Path,
    depth: Path,
    intrinsics: Path,
    weights: Path | None = None,
    category: str | None = None,
    picture: Path = Path("prediction.png"),
    depth_unit_m: float = 0.001,
    grasps: int = 10,
    seed: int = 0,
) -> int:
    """Look at one RGB-D image: print what is there as JSON, and draw it.

    With a category or weights, what stands on the table is taken for one object of that category;
    without, the shipped detector says what is there.

    Args:
        rgb: colour image.
        depth: 16-bit image in units of depth_unit_m, or .npy in metres; 0 where unknown.
        intrinsics: text or JSON file with the 3x3 camera matrix.
        weights: trained weights of one object's network, .safetensors; by default the shipped ones.
        category: of the object; weights for a single one need none.
        picture: where to draw parts, affordance and the best grasps.
        depth_unit_m: metres of one unit of a depth image.
        grasps: how many proposals an object to print and draw.
        seed: of the fits and the choice of points.
    """
    torch.set_num_threads(1)
    if grasps < 0:
        raise InvalidArgumentError(f"grasps={grasps} must be at least 0.")
    image, K = drawing.read_rgb(rgb), drawing.read_intrinsics(intrinsics)
    metres, rng = drawing.read_depth(depth, depth_unit_m), np.random.default_rng(seed)
    objects: list[dict[str, Any]] = []
    if weights is None and category is None:
        # torchvision takes long to import, and only this way needs it.
        from icaf4_policy.scenes import ScenePerception

        seen = ScenePerception.load().look(image, metres, K, rng=rng)
        predictions = [each.prediction for each in seen]
        for each in seen:
            found = each.detection
            about = {"category": found.category, "score": found.score, "box": found.box.tolist()}
            objects.append(about | {"pixels": int((each.part_mask > 0).sum())})
    else:
        perception = Perception.load(weights or weights_path(category or ""), category)
        prediction, view = perception.perceive(image, metres, K, rng=rng)
        predictions = [prediction]
        objects.append({"category": perception.category, "pixels": int(view.mask.sum())})
    drawing.write_image(picture, drawing.draw_predictions(image, K, predictions, grasps))
    for about, prediction in zip(objects, predictions, strict=True):
        about |= _described(prediction, grasps)
    print(json.dumps({"picture": str(picture), "objects": objects}, indent=2))
    return 0


def _described(prediction: Prediction, grasps: int) -> dict[str, Any]:
    """What is printed of a prediction."""
    best = prediction.grasps
    parts = zip(
        prediction.part_boxes,
        prediction.joints,
        prediction.part_confidences().tolist(),
        prediction.pose_confidences().tolist(),
        strict=True,
    )
    return {
        "up_camera": prediction.R_level_camera[2].tolist(),
        "parts": [
            {
                "part": k,
                "points": int((prediction.part == k).sum()),
                "confidence": confidence,
                "box": None if box is None else _json_fields(box),
                "box_confidence": box_confidence,
                "joint": _json_fields(joint),
            }
            for k, (box, joint, confidence, box_confidence) in enumerate(parts)
        ],
        "grasps": [
            {
                "score": float(best.scores[i]),
                "part": int(best.parts[i]),
                "point_camera": best.points_camera[i].tolist(),
                "R_camera_grasp": best.R_camera_grasp[i].tolist(),
            }
            for i in range(min(grasps, len(best.scores)))
        ],
    }


def _json_fields(record: Any) -> dict[str, Any]:
    """The fields of a dataclass, arrays as lists."""
    values = {f.name: getattr(record, f.name) for f in dataclasses.fields(record)}
    return {n: v.tolist() if isinstance(v, np.ndarray) else v for n, v in values.items()}


COMMANDS: dict[str, Callable[..., int]] = {
    "train": train,
    "train-detector": train_detector,
    "predict": predict,
}
