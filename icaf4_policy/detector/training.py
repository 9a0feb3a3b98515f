"""Training of the detector: resumable, and the same bytes whether or not it was interrupted."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from artgym.datasets.sample import Picture
from artgym.errors import InvalidArgumentError
from icaf4_policy.detector.config import DetectorTrainingConfig
from icaf4_policy.detector.evaluation import evaluate
from icaf4_policy.detector.inference import Detector
from icaf4_policy.detector.model import DetectorNetwork
from icaf4_policy.detector.pictures import (
    ShrunkPicture,
    changed,
    network_input,
    network_target,
    prepare,
)
from icaf4_policy.training_run import TrainingRun, cosine_rate, keep_freed_memory


def train_detector(
    config: DetectorTrainingConfig,
    training_pictures: Iterable[Picture],
    validation_pictures: Iterable[Picture],
    weights: Path,
    *,
    stop_after_epoch: int | None = None,
) -> Detector:
    """Trains a detector and writes the weights whose masks have the highest mAP50.

    Killed at any moment and started again with the same arguments, it goes on from the last whole
    epoch and ends with the same bytes (same machine, one torch thread).

    Args:
        config: how to train.
        training_pictures: pictures of the training objects.
        validation_pictures: pictures of other objects, which are kept in memory; they choose the
            weights and nothing else.
        weights: path of the result, ``.safetensors``; its description lies beside it.
        stop_after_epoch: leave after this many epochs, as if interrupted there; the next call
            goes on.

    Returns:
        The detector with the weights that were written; after an early stop, with the best so
        far, and no result is written.

    Raises:
        InvalidArgumentError: no pictures, or some of an unknown category.
    """
    keep_freed_memory()
    validation = list(validation_pictures)
    training, training_digest = prepare(training_pictures, config.model, "training pictures")
    _, validation_digest = prepare(validation, config.model, "validation pictures")
    if not training or not validation:
        raise InvalidArgumentError(
            f"{len(training)} training and {len(validation)} validation pictures: both must be "
            "there. Generate more, with both splits."
        )
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        model = DetectorNetwork(config.model)
    optimizer = torch.optim.AdamW(
        model.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
    )
    settings = [asdict(config), training_digest, validation_digest]
    run = TrainingRun(model, optimizer, settings, lambda validation: -validation["mask/map50"])
    detector = Detector(model=model)
    run.complete(
        weights,
        epochs=config.epochs,
        stop_after_epoch=stop_after_epoch,
        validate_every=config.validate_every,
        train_epoch=lambda: _train_epoch(run, model, training, config),
        validate=lambda: {
            # The means over categories are enough to follow a training by.
            name: value
            for name, value in evaluate(detector, validation).items()
            if name.count("/") == 1
        },
        facts={
            "config": asdict(config),
            "training_pictures": len(training),
            "training_sha256": training_digest,
            "validation_pictures": len(validation),
            "validation_sha256": validation_digest,
        },
    )
    return detector


def _train_epoch(
    run: TrainingRun,
    model: DetectorNetwork,
    pictures: Sequence[ShrunkPicture],
    config: DetectorTrainingConfig,
) -> None:
    """One pass over the training pictures."""
    steps_an_epoch = max(len(pictures) // config.batch_size, 1)
    label = f"epoch {run.epoch + 1}/{config.epochs}"
    bar = tqdm(
        _batches(pictures, config, run.epoch),
        total=steps_an_epoch,
        desc=label,
        unit="batch",
        leave=False,
        disable=None,
    )
    with torch.random.fork_rng(devices=[]):
        # torchvision draws the regions to learn from with the global generator.
        torch.manual_seed(int(np.random.default_rng((config.seed, 3, run.epoch)).integers(2**62)))
        for number, (images, targets) in enumerate(bar):
            with torch.autocast(
                "cpu", dtype=torch.bfloat16, enabled=config.precision == "bfloat16"
            ):
                terms, _ = model(images, targets)
            loss = torch.stack(list(terms.values())).sum()
            step, total = run.epoch * steps_an_epoch + number, config.epochs * steps_an_epoch
            rate = cosine_rate(config.learning_rate, step, total, config.warmup_share)
            run.learn(loss, rate, config.gradient_limit)
            bar.set_postfix(loss=f"{loss.item():.3f}", refresh=False)


def _batches(
    pictures: Sequence[ShrunkPicture], config: DetectorTrainingConfig, epoch: int
) -> Iterator[tuple[Tensor, list[dict[str, Tensor]]]]:
    """Images and targets, as a function of (seed, epoch, index) alone."""
    order = np.random.default_rng((config.seed, 0, epoch)).permutation(len(pictures))
    stream = (config.seed, 2, epoch)
    # A last, smaller batch would skew the batch statistics.
    size = min(config.batch_size, len(order))
    for first in range(0, len(order) // size * size, size):
        batch = [
            changed(pictures[i], config.augmentation, np.random.default_rng((*stream, int(i))))
            for i in order[first : first + size]
        ]
        images = [network_input(each.rgb, each.depth, config.model) for each in batch]
        yield torch.stack(images), [network_target(each) for each in batch]
