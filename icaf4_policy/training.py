"""Training on labelled samples: resumable, and the same bytes whether or not it was interrupted."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from tqdm import tqdm

from artgym.datasets.authors import AuthorsSample
from artgym.datasets.sample import AFFORDANCE_UNKNOWN, AFFORDANCE_YES, Sample
from artgym.errors import InvalidArgumentError, UnknownNameError
from icaf4_policy.anchors import AnchorConfig, anchors_from_config
from icaf4_policy.authors_targets import targets_from_authors
from icaf4_policy.checkpoint import load_model
from icaf4_policy.dataset import SPARE_POINTS
from icaf4_policy.faces import face_errors
from icaf4_policy.features import (
    CHANNELS,
    DEFAULT_FEATURES,
    Features,
    given_channels,
    has_color,
)
from icaf4_policy.losses import LossWeights, SegmentationLoss, loss_terms, total_loss
from icaf4_policy.model import Icaf4, ModelConfig, Scale
from icaf4_policy.targets import (
    Batch,
    DrawConfig,
    Targets,
    collate_items,
    draw_item,
    targets_from_sample,
)
from icaf4_policy.training_run import TrainingRun, cosine_rate, keep_freed_memory

#: What ``ModelConfig.graspable_from`` is chosen from.
_THRESHOLDS = tuple(round(0.05 * i, 2) for i in range(1, 20))
#: A base whose z axis is nearer to the vertical stands upright, radians.
UPRIGHT = math.radians(1.0)


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """How to train.

    Attributes:
        category: one or several, which the network is then told apart by.
        epochs: passes over the training samples.
        batch_size: clouds a step.
        learning_rate: of Adam, at its highest.
        weight_decay: of Adam.
        schedule: "cosine" warms up for warmup_share of the steps and falls to zero along half a
            cosine: better than steps when there are few epochs; "step" is the paper's: times
            step_factor every step_epochs.
        step_epochs: epochs between two drops of the "step" schedule.
        step_factor: each drop of the "step" schedule.
        warmup_share: share of the steps of the "cosine" schedule that rise, in [0, 1).
        gradient_limit: the norm that gradients are clipped to.
        num_points: points of a cloud.
        learn_points: points of a cloud that are learnt in a step, the others being their
            surroundings: neighbours say much the same, and a step with all takes twice as long.
        num_grasp_points: points of a cloud whose grasps are learnt in a step.
        anchors: what grasps are refined from.
        scale: what one network unit is, see ``ModelConfig``.
        features: what is given of each point beside where it is, see ``features.Features``.
        precision: of the products while training; "bfloat16" is a quarter faster where the
            processor has it, and predictions and coordinates stay in float32 all the same.
        color_jitter: spread of the random change of colours.
        segmentation_loss: of the parts: "cross_entropy" as in the paper, or one minus the
            "soft_iou" of each cloud's parts, as in its released code.
        validate_every: epochs between validations; the last epoch is always validated.
        seed: of the weights, the order of samples and the choice of points.
        losses: weight of each loss.
    """

    category: tuple[str, ...]
    epochs: int = 40
    batch_size: int = 8
    learning_rate: float = 1e-3
    weight_decay: float = 1e-4
    schedule: Literal["cosine", "step"] = "cosine"
    step_epochs: int = 20
    step_factor: float = 0.5
    warmup_share: float = 0.03
    gradient_limit: float = 10.0
    num_points: int = 2048
    learn_points: int = 512
    num_grasp_points: int = 384
    anchors: AnchorConfig = field(default_factory=AnchorConfig)
    features: Features = DEFAULT_FEATURES
    scale: Scale = "cloud"
    precision: Literal["float32", "bfloat16"] = "bfloat16"
    color_jitter: float = 0.2
    segmentation_loss: SegmentationLoss = "cross_entropy"
    validate_every: int = 2
    seed: int = 0
    losses: LossWeights = field(default_factory=LossWeights)

    def __post_init__(self) -> None:
        if not self.category or len(set(self.category)) < len(self.category):
            raise InvalidArgumentError(
                f"category={self.category}: expected one or more, each of them once."
            )
        for name in (
            "epochs",
            "batch_size",
            "num_points",
            "learn_points",
            "num_grasp_points",
            "step_epochs",
            "validate_every",
        ):
            if getattr(self, name) < 1:
                raise InvalidArgumentError(f"{name}={getattr(self, name)} must be at least 1.")
        for name in ("learning_rate", "gradient_limit", "step_factor"):
            if not 0 < getattr(self, name) < math.inf:
                raise InvalidArgumentError(
                    f"{name}={getattr(self, name)} must be positive and finite."
                )
        if self.features not in CHANNELS:
            raise UnknownNameError("features", self.features, CHANNELS)
        if self.num_grasp_points > self.num_points:
            raise InvalidArgumentError(
                f"num_grasp_points={self.num_grasp_points} exceeds num_points={self.num_points}."
            )
        if not 0 <= self.warmup_share < 1:
            raise InvalidArgumentError(f"warmup_share={self.warmup_share} must be in [0, 1).")


def prepare(
    samples: Iterable[Sample | AuthorsSample], config: TrainingConfig, label: str
) -> tuple[list[Targets], str]:
    """Targets of all samples, and a digest of what went in.

    Args:
        samples: decoded one at a time if they are lazy, and described if ``config.features`` are
            descriptors; those of the authors do not tell their category, and are of the only one.
        config: of the training.
        label: what the progress bar says.

    Raises:
        InvalidArgumentError: a sample of another category, or with other features.
    """
    anchors = anchors_from_config(config.anchors)
    digest = hashlib.sha256()
    prepared = []
    most = SPARE_POINTS * config.num_points
    for sample in tqdm(samples, desc=label, unit="sample", leave=False, disable=None):
        if isinstance(sample, AuthorsSample):
            name, grasps = str(sample.urdf_id), sample.R_camera_grasps
            prepared.append(targets_from_authors(sample, anchors, most, config.features))
        else:
            name, grasps = sample.object_id, sample.grasp_bits
            channels = sample.colors.shape[1]
            if channels != given_channels(config.features):
                raise InvalidArgumentError(
                    f"{name}: its points have {channels} channels, expected the "
                    f"{given_channels(config.features)} that features={config.features!r} are made "
                    "of. Describe samples with icaf4_policy.features.described."
                )
            prepared.append(
                targets_from_sample(sample, config.category, anchors, most, config.features)
            )
        digest.update(name.encode())
        digest.update(np.ascontiguousarray(sample.points_camera).tobytes())
        digest.update(np.ascontiguousarray(grasps).tobytes())
    return prepared, digest.hexdigest()


def _model_config(config: TrainingConfig, targets: Sequence[Targets]) -> ModelConfig:
    units = []
    for index in range(len(config.category)):
        clouds = [t.points_level for t in targets if t.category == index]
        diagonals = [np.linalg.norm(np.ptp(cloud, axis=0)) for cloud in clouds]
        units.append(round(float(np.median(diagonals)) / 2.0, 3))
    return ModelConfig(
        categories=config.category,
        # Objects have the first so many of their category's parts.
        num_parts=max(len(t.joint_type) for t in targets),
        length_units=tuple(units),
        num_points=config.num_points,
        anchors=config.anchors,
        features=config.features,
        scale=config.scale,
        upright=all(t.tilt < UPRIGHT for t in targets),
    )


def _learning_rate(config: TrainingConfig, step: int, steps_an_epoch: int) -> float:
    """The rate at a step, counted from 0 over all epochs."""
    if config.schedule == "step":
        drops = step // steps_an_epoch // config.step_epochs
        return config.learning_rate * config.step_factor**drops
    total = config.epochs * steps_an_epoch
    return cosine_rate(config.learning_rate, step, total, config.warmup_share)


def _batches(
    targets: Sequence[Targets], draw: DrawConfig, batch_size: int, *, seed: int, epoch: int | None
) -> Iterable[Batch]:
    """Batches as a function of (seed, epoch, index) alone; in order where ``epoch`` is None."""
    if epoch is None:
        order, stream = np.arange(len(targets)), (seed, 1)
        stop = len(order)
    else:
        order, stream = (
            np.random.default_rng((seed, 0, epoch)).permutation(len(targets)),
            (seed, 2, epoch),
        )
        # A last, smaller batch would skew the batch statistics.
        stop = max(len(order) // batch_size * batch_size, min(len(order), batch_size))
    for first in range(0, stop, batch_size):
        index = order[first : first + batch_size]
        items = [
            draw_item(targets[i], draw, np.random.default_rng((*stream, int(i)))) for i in index
        ]
        yield collate_items(items, draw)


@torch.no_grad()
def _validate(
    model: Icaf4, targets: Sequence[Targets], draw: DrawConfig, config: TrainingConfig
) -> dict[str, float]:
    """Mean loss terms over the validation samples, and their weighted "total"."""
    sums: dict[str, float] = {}
    device = model.length_units.device
    for drawn in _batches(targets, draw, config.batch_size, seed=config.seed, epoch=None):
        batch = drawn.to(device)
        outputs = model(batch.points_level, batch.colors, batch.category, batch.grasp_points)
        terms = loss_terms(outputs, batch, config.segmentation_loss)
        terms["total"] = total_loss(terms, config.losses)
        for name, term in terms.items():
            sums[name] = sums.get(name, 0.0) + float(term) * len(batch.part)
    return {name: value / len(targets) for name, value in sums.items()}


def _plain_draw(model: Icaf4, config: TrainingConfig) -> DrawConfig:
    """All points as they are."""
    return DrawConfig(
        num_points=config.num_points,
        num_anchors=model.grasp.shape[0],
        num_grasp_points=config.num_grasp_points,
    )


@torch.no_grad()
def set_threshold(model: Icaf4, targets: Sequence[Targets], config: TrainingConfig) -> None:
    """Sets from which probability on the network calls a point graspable.

    It is the one with the best intersection over union with what the samples say is graspable, on
    average over those where something is. Few points are: one half would leave out too many.

    Args:
        model: in evaluation mode.
        targets: of the validation samples.
        config: of the training.
    """
    draw, device = _plain_draw(model, config), model.length_units.device
    ious = []
    for drawn in _batches(targets, draw, config.batch_size, seed=config.seed, epoch=None):
        batch = drawn.to(device)
        outputs = model(batch.points_level, batch.colors, batch.category, batch.grasp_points)
        probability = outputs.affordance.softmax(dim=-1)[..., 1]
        for p, truth in zip(probability, batch.affordance, strict=True):
            known, yes = truth != AFFORDANCE_UNKNOWN, truth == AFFORDANCE_YES
            if yes.any():
                called = (p >= torch.tensor(_THRESHOLDS, device=device)[:, None]) & known
                either = (called | yes).sum(dim=1)
                ious.append((called & yes).sum(dim=1) / either)
    if ious:
        best = int(torch.stack(ious).mean(dim=0).argmax())
        model.config = replace(model.config, graspable_from=_THRESHOLDS[best])


def set_face_errors(model: Icaf4, targets: Sequence[Targets]) -> None:
    """Sets how well the faces of parts tell the axes of their boxes, see ``faces``.

    Args:
        model: the network.
        targets: of the training samples.
    """
    config = model.config
    errors = tuple(
        face_errors([t for t in targets if t.category == index], config.num_parts)
        for index in range(len(config.categories))
    )
    model.config = replace(config, face_errors=errors)


def train(
    config: TrainingConfig,
    training_samples: Iterable[Sample | AuthorsSample],
    validation_samples: Iterable[Sample | AuthorsSample],
    weights: Path,
    *,
    start: Path | None = None,
    stop_after_epoch: int | None = None,
    log: Path | None = None,
    device: str = "cpu",
) -> Icaf4:
    """Trains a network and writes the weights that validate best.

    Killed at any moment and started again with the same arguments, it goes on from the last whole
    epoch and ends with the same bytes (same machine, one torch thread).

    Args:
        config: how to train.
        training_samples: views of the training objects.
        validation_samples: views of other objects; they choose the weights and nothing else.
        weights: path of the result, ``.safetensors``; its description lies beside it.
        start: weights to start from instead of random ones, of a network that takes the same and
            tells the same parts apart; its length units are kept, and heads of other anchors start
            afresh.
        stop_after_epoch: leave after this many epochs, as if interrupted there; the next call
            goes on.
        log: folder for TensorBoard.
        device: where the network is trained, as torch calls it: "cpu", "cuda", "cuda:1".

    Returns:
        The network with the weights that were written, in evaluation mode; after an early stop,
        with the best so far, and no result is written.
    """
    keep_freed_memory()
    earlier = None if start is None else _Earlier(start)
    if earlier is not None:
        earlier.require(categories=config.category, features=config.features, scale=config.scale)
    training, training_digest = prepare(training_samples, config, "training samples")
    validation, validation_digest = prepare(validation_samples, config, "validation samples")
    for index, category in enumerate(config.category):
        counts = [sum(t.category == index for t in each) for each in (training, validation)]
        if not all(counts):
            raise InvalidArgumentError(
                f"{counts[0]} training and {counts[1]} validation samples of {category!r}: both "
                "must be there. Generate more, with both splits."
            )
    model_config = _model_config(config, training)
    started_from = None
    if earlier is not None:
        earlier.require(num_parts=model_config.num_parts, backbone=model_config.backbone)
        model_config = replace(model_config, length_units=earlier.model.config.length_units)
        started_from = earlier.sha256
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        model = Icaf4(model_config)
    if earlier is not None:
        earlier.give(model)
    model = model.to(device)
    optimizer = torch.optim.Adam(
        model.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
    )
    settings = [asdict(config), training_digest, validation_digest, started_from]
    run = TrainingRun(model, optimizer, settings, lambda validation: validation["total"])
    draw_plain = _plain_draw(model, config)
    jitter = config.color_jitter if has_color(config.features) else 0.0
    draw = replace(draw_plain, color_jitter=jitter, learn_points=config.learn_points)

    def finish() -> None:
        set_threshold(model, validation, config)
        set_face_errors(model, training)

    run.complete(
        weights,
        epochs=config.epochs,
        stop_after_epoch=stop_after_epoch,
        validate_every=config.validate_every,
        train_epoch=lambda: _train_epoch(run, model, training, draw, config),
        validate=lambda: _validate(model, validation, draw_plain, config),
        finish=finish,
        facts={
            "config": asdict(config),
            "started_from_sha256": started_from,
            "training_samples": len(training),
            "training_sha256": training_digest,
            "validation_samples": len(validation),
            "validation_sha256": validation_digest,
        },
        log=log,
    )
    return model.cpu()


class _Earlier:
    """Weights that a training starts from.

    Raises:
        DamagedFileError: they are missing or damaged.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.model, description = load_model(path)
        self.sha256 = str(description["sha256"])

    def require(self, **settings: object) -> None:
        """Raises InvalidArgumentError unless the network has just these settings."""
        for name, ours in settings.items():
            theirs = getattr(self.model.config, name)
            if theirs != ours:
                raise InvalidArgumentError(
                    f"start={str(self._path)!r} has {name}={theirs}, and this training {ours}: "
                    "start from weights of the same, or train with theirs."
                )

    def give(self, model: Icaf4) -> None:
        """Copies all weights, but those of the grasp head of other anchors."""
        same_grasps = self.model.config.anchors == model.config.anchors
        kept = {
            name: tensor
            for name, tensor in self.model.state_dict().items()
            if same_grasps or not name.startswith("grasp.")
        }
        model.load_state_dict({**model.state_dict(), **kept})


def _train_epoch(
    run: TrainingRun,
    model: Icaf4,
    targets: Sequence[Targets],
    draw: DrawConfig,
    config: TrainingConfig,
) -> None:
    """One pass over the training samples."""
    steps_an_epoch = max(len(targets) // config.batch_size, 1)
    batches = _batches(targets, draw, config.batch_size, seed=config.seed, epoch=run.epoch)
    label = f"epoch {run.epoch + 1}/{config.epochs}"
    bar = tqdm(batches, total=steps_an_epoch, desc=label, unit="batch", leave=False, disable=None)
    device, low = model.length_units.device, config.precision == "bfloat16"
    for number, drawn in enumerate(bar):
        batch = drawn.to(device)
        with torch.autocast(device.type, dtype=torch.bfloat16, enabled=low):
            outputs = model(
                batch.points_level,
                batch.colors,
                batch.category,
                batch.grasp_points,
                asked=batch.part.shape[1],
            )
        terms = loss_terms(outputs, batch, config.segmentation_loss)
        loss = total_loss(terms, config.losses)
        step = run.epoch * steps_an_epoch + number
        rate = _learning_rate(config, step, steps_an_epoch)
        run.learn(loss, rate, config.gradient_limit)
        bar.set_postfix(loss=f"{loss.item():.3f}", refresh=False)
