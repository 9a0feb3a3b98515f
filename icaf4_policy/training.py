"""Training on labelled samples: resumable, and the same bytes whether or not it was interrupted."""

from __future__ import annotations

import ctypes
import hashlib
import json
import math
import platform
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from artgym.datasets.sample import Sample
from artgym.errors import DamagedFileError, InvalidArgumentError
from icaf4_policy.anchors import AnchorConfig, anchors_from_config
from icaf4_policy.checkpoint import load_tensors, save_model, save_tensors
from icaf4_policy.dataset import SPARE_POINTS
from icaf4_policy.losses import LossWeights, loss_terms, total_loss
from icaf4_policy.model import Icaf4, ModelConfig
from icaf4_policy.targets import (
    Batch,
    DrawConfig,
    Targets,
    collate_items,
    draw_item,
    targets_from_sample,
)


@dataclass(frozen=True, kw_only=True)
class TrainingConfig:
    """How to train.

    Attributes:
        category: "laptop", ...
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
        num_grasp_points: points of a cloud whose grasps are learnt in a step.
        anchors: what grasps are refined from.
        precision: of the products while training; "bfloat16" is a quarter faster where the
            processor has it, and predictions and coordinates stay in float32 all the same.
        color_jitter: spread of the random change of colours.
        validate_every: epochs between validations; the last epoch is always validated.
        seed: of the weights, the order of samples and the choice of points.
        losses: weight of each loss.
    """

    category: str
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
    num_grasp_points: int = 384
    anchors: AnchorConfig = field(default_factory=AnchorConfig)
    precision: Literal["float32", "bfloat16"] = "bfloat16"
    color_jitter: float = 0.2
    validate_every: int = 2
    seed: int = 0
    losses: LossWeights = field(default_factory=LossWeights)

    def __post_init__(self) -> None:
        for name in (
            "epochs",
            "batch_size",
            "num_points",
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
        if self.num_grasp_points > self.num_points:
            raise InvalidArgumentError(
                f"num_grasp_points={self.num_grasp_points} exceeds num_points={self.num_points}."
            )
        if not 0 <= self.warmup_share < 1:
            raise InvalidArgumentError(f"warmup_share={self.warmup_share} must be in [0, 1).")


def _keep_freed_memory() -> None:
    """Tells glibc to reuse freed blocks: returning large ones costs a third of a step."""
    if platform.libc_ver()[0] == "glibc":
        libc = ctypes.CDLL(None)
        trim_threshold, mmap_max = -1, -4
        libc.mallopt(mmap_max, 0)
        libc.mallopt(trim_threshold, 2**31 - 1)


def prepare(
    samples: Iterable[Sample], config: TrainingConfig, label: str
) -> tuple[list[Targets], str]:
    """Targets of all samples, and a digest of what went in.

    Args:
        samples: decoded one at a time if they are lazy.
        config: of the training.
        label: what the progress bar says.

    Raises:
        InvalidArgumentError: a sample of another category.
    """
    anchors = anchors_from_config(config.anchors)
    digest = hashlib.sha256()
    prepared = []
    for sample in tqdm(samples, desc=label, unit="sample", leave=False, disable=None):
        if sample.object_id.partition("/")[0] != config.category:
            raise InvalidArgumentError(
                f"a sample of {sample.object_id!r} among those of {config.category!r}: train each "
                "category on its own samples."
            )
        digest.update(sample.object_id.encode())
        digest.update(np.ascontiguousarray(sample.points_camera).tobytes())
        digest.update(np.ascontiguousarray(sample.grasp_bits).tobytes())
        prepared.append(targets_from_sample(sample, anchors, SPARE_POINTS * config.num_points))
    return prepared, digest.hexdigest()


def _model_config(config: TrainingConfig, targets: Sequence[Targets]) -> ModelConfig:
    diagonals = [np.linalg.norm(np.ptp(t.points_level, axis=0)) for t in targets]
    return ModelConfig(
        category=config.category,
        # Objects have the first so many of their category's parts.
        num_parts=max(len(t.joint_type) for t in targets),
        length_unit=round(float(np.median(diagonals)) / 2.0, 3),
        num_points=config.num_points,
        anchors=config.anchors,
    )


def _learning_rate(config: TrainingConfig, step: int, steps_an_epoch: int) -> float:
    """The rate at a step, counted from 0 over all epochs."""
    if config.schedule == "step":
        drops = step // steps_an_epoch // config.step_epochs
        return config.learning_rate * config.step_factor**drops
    total = config.epochs * steps_an_epoch
    warmup = config.warmup_share * total
    if step < warmup:
        return config.learning_rate * (step + 1) / (warmup + 1)
    progress = (step - warmup) / max(total - warmup, 1)
    return config.learning_rate * 0.5 * (1.0 + math.cos(math.pi * progress))


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
    model.eval()
    sums: dict[str, float] = {}
    for batch in _batches(targets, draw, config.batch_size, seed=config.seed, epoch=None):
        outputs = model(batch.points_level, batch.colors, batch.grasp_points)
        terms = loss_terms(outputs, batch, model.config.length_unit)
        terms["total"] = total_loss(terms, config.losses)
        for name, term in terms.items():
            sums[name] = sums.get(name, 0.0) + float(term) * len(batch.part)
    model.train()
    return {name: value / len(targets) for name, value in sums.items()}


class _Progress:
    """The state of a run between two epochs, in memory and on disk."""

    def __init__(self, model: Icaf4, config: TrainingConfig, fingerprint: str) -> None:
        self.model = model
        self.optimizer = torch.optim.Adam(
            model.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
        )
        self.fingerprint = fingerprint
        self.epoch = 0
        self.best: dict[str, Tensor] = {}
        self.best_epoch = -1
        self.history: list[dict[str, float]] = []

    def consider(self, validation: dict[str, float]) -> None:
        """Notes a validation, and keeps the weights if it is the best so far."""
        self.history.append({"epoch": float(self.epoch), **validation})
        if validation["total"] <= min(entry["total"] for entry in self.history):
            self.best_epoch = self.epoch
            self.best = {name: t.clone() for name, t in self.model.state_dict().items()}

    def save(self, path: Path) -> None:
        """Writes everything that the rest of the run depends on."""
        tensors = {f"model.{name}": t for name, t in self.model.state_dict().items()}
        tensors |= {f"best.{name}": t for name, t in self.best.items()}
        for index, state in self.optimizer.state_dict()["state"].items():
            tensors |= {f"adam.{index}.{name}": t for name, t in state.items()}
        facts = {
            "fingerprint": self.fingerprint,
            "epoch": self.epoch,
            "best_epoch": self.best_epoch,
            "history": self.history,
        }
        save_tensors(path, tensors, facts)

    def load(self, path: Path) -> None:
        """Takes up the run that ``save`` left."""
        tensors, facts = load_tensors(path)
        if facts.get("fingerprint") != self.fingerprint:
            raise InvalidArgumentError(
                f"{path} belongs to a run with another configuration or other samples. "
                "Delete it to start afresh, or give another output path."
            )
        groups: dict[str, dict[str, Tensor]] = {"model": {}, "best": {}, "adam": {}}
        for name, tensor in tensors.items():
            group, _, rest = name.partition(".")
            groups[group][rest] = tensor
        adam: dict[int, dict[str, Tensor]] = {}
        for name, tensor in groups["adam"].items():
            index, _, slot = name.partition(".")
            adam.setdefault(int(index), {})[slot] = tensor
        try:
            self.model.load_state_dict(groups["model"])
            self.optimizer.load_state_dict({**self.optimizer.state_dict(), "state": adam})
        except (RuntimeError, ValueError, KeyError) as error:
            raise DamagedFileError(f"{path} does not hold this network ({error}).") from error
        self.best = groups["best"]
        self.epoch, self.best_epoch = int(facts["epoch"]), int(facts["best_epoch"])
        self.history = list(facts["history"])


def resume_path(weights: Path) -> Path:
    """Where an unfinished run of ``weights`` is kept."""
    return weights.with_suffix(".resume.safetensors")


def train(
    config: TrainingConfig,
    training_samples: Iterable[Sample],
    validation_samples: Iterable[Sample],
    weights: Path,
    *,
    stop_after_epoch: int | None = None,
) -> Icaf4:
    """Trains a network and writes the weights that validate best.

    Killed at any moment and started again with the same arguments, it goes on from the last whole
    epoch and ends with the same bytes (same machine, one torch thread).

    Args:
        config: how to train.
        training_samples: views of the training objects.
        validation_samples: views of other objects; they choose the weights and nothing else.
        weights: path of the result, ``.safetensors``; its description lies beside it.
        stop_after_epoch: leave after this many epochs, as if interrupted there; the next call
            goes on.

    Returns:
        The network with the weights that were written, in evaluation mode; after an early stop,
        with the best so far, and no result is written.
    """
    _keep_freed_memory()
    training, training_digest = prepare(training_samples, config, "training samples")
    validation, validation_digest = prepare(validation_samples, config, "validation samples")
    if not training or not validation:
        raise InvalidArgumentError(
            f"{len(training)} training and {len(validation)} validation samples of "
            f"{config.category!r}: both must be there. Generate more, with both splits."
        )
    model_config = _model_config(config, training)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(config.seed)
        model = Icaf4(model_config)
    settings = json.dumps([asdict(config), training_digest, validation_digest], sort_keys=True)
    progress = _Progress(model, config, hashlib.sha256(settings.encode()).hexdigest())
    if resume_path(weights).exists():
        progress.load(resume_path(weights))

    draw = DrawConfig(
        num_points=config.num_points,
        num_anchors=model.grasp.shape[0],
        num_grasp_points=config.num_grasp_points,
        color_jitter=config.color_jitter,
    )
    draw_plain = DrawConfig(
        num_points=config.num_points,
        num_anchors=model.grasp.shape[0],
        num_grasp_points=config.num_grasp_points,
    )
    last = config.epochs if stop_after_epoch is None else min(stop_after_epoch, config.epochs)
    while progress.epoch < last:
        _train_epoch(progress, training, draw, config)
        progress.epoch += 1
        if progress.epoch % config.validate_every == 0 or progress.epoch == config.epochs:
            progress.consider(_validate(model, validation, draw_plain, config))
            shown = {name: round(value, 4) for name, value in progress.history[-1].items()}
            tqdm.write(f"validation {shown}")
        progress.save(resume_path(weights))

    if progress.best:
        model.load_state_dict(progress.best)
    model.eval()
    if progress.epoch == config.epochs:
        facts: dict[str, Any] = {
            "config": asdict(config),
            "training_samples": len(training),
            "training_sha256": training_digest,
            "validation_samples": len(validation),
            "validation_sha256": validation_digest,
            "best_epoch": progress.best_epoch,
            "validation": progress.history,
        }
        save_model(weights, model, facts)
        resume_path(weights).unlink(missing_ok=True)
    return model


def _train_epoch(
    progress: _Progress, targets: Sequence[Targets], draw: DrawConfig, config: TrainingConfig
) -> None:
    """One pass over the training samples."""
    model, optimizer = progress.model, progress.optimizer
    model.train()
    steps_an_epoch = max(len(targets) // config.batch_size, 1)
    batches = _batches(targets, draw, config.batch_size, seed=config.seed, epoch=progress.epoch)
    label = f"epoch {progress.epoch + 1}/{config.epochs}"
    bar = tqdm(batches, total=steps_an_epoch, desc=label, unit="batch", leave=False, disable=None)
    for number, batch in enumerate(bar):
        step = progress.epoch * steps_an_epoch + number
        for group in optimizer.param_groups:
            group["lr"] = _learning_rate(config, step, steps_an_epoch)
        with torch.autocast("cpu", dtype=torch.bfloat16, enabled=config.precision == "bfloat16"):
            outputs = model(batch.points_level, batch.colors, batch.grasp_points)
        loss = total_loss(loss_terms(outputs, batch, model.config.length_unit), config.losses)
        if not torch.isfinite(loss):
            raise InvalidArgumentError(
                f"the loss is {loss.item()} in epoch {progress.epoch + 1}, step {number + 1}: "
                f"lower learning_rate={config.learning_rate}, or look for bad samples with "
                "'artgym check'."
            )
        optimizer.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), config.gradient_limit)
        optimizer.step()
        bar.set_postfix(loss=f"{loss.item():.3f}", refresh=False)
