"""What trainings share: resumable epochs, a learning rate along a cosine, the choice of weights."""

from __future__ import annotations

import ctypes
import hashlib
import json
import math
import platform
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn
from tqdm import tqdm

from artgym.errors import DamagedFileError, InvalidArgumentError, MissingDependencyError
from icaf4_policy.checkpoint import load_tensors, save_model, save_tensors


def keep_freed_memory() -> None:
    """Tells glibc to reuse freed blocks: returning large ones costs a third of a step."""
    if platform.libc_ver()[0] == "glibc":
        libc = ctypes.CDLL(None)
        trim_threshold, mmap_max = -1, -4
        libc.mallopt(mmap_max, 0)
        libc.mallopt(trim_threshold, 2**31 - 1)


def cosine_rate(highest: float, step: int, total: int, warmup_share: float) -> float:
    """A learning rate that rises for a share of the steps and falls to zero along half a cosine.

    Args:
        highest: the rate at the end of the rise.
        step: counted from 0.
        total: number of steps.
        warmup_share: share of them that rises, in [0, 1).
    """
    warmup = warmup_share * total
    if step < warmup:
        return highest * (step + 1) / (warmup + 1)
    progress = (step - warmup) / max(total - warmup, 1)
    return highest * 0.5 * (1.0 + math.cos(math.pi * progress))


def resume_path(weights: Path) -> Path:
    """Where an unfinished run of ``weights`` is kept."""
    return weights.with_suffix(".resume.safetensors")


def _require_tensorboard() -> None:
    if find_spec("tensorboard") is None:
        raise MissingDependencyError(
            "log: TensorBoard is not installed: pip install 'artgym[train]', or go without --log."
        )


def _write_scalars(folder: Path, values: Mapping[str, float], epoch: int) -> None:
    """Adds values to a TensorBoard log, whole on disk when this returns."""
    from torch.utils.tensorboard import SummaryWriter

    with SummaryWriter(str(folder)) as writer:
        for name, value in values.items():
            writer.add_scalar(name, value, epoch)


class TrainingRun:
    """The state of a run between two epochs, in memory and on disk.

    Args:
        model: what is trained; its ``config`` says what it is.
        optimizer: Adam or AdamW over the model's parameters.
        facts: JSON-able, everything that the result follows from; a run is taken up again only
            with the same.
        loss_of: what a validation is judged by; the least is the best.
    """

    def __init__(
        self,
        model: nn.Module,
        optimizer: torch.optim.Optimizer,
        facts: Any,
        loss_of: Callable[[dict[str, float]], float],
    ) -> None:
        self.model = model
        self.optimizer = optimizer
        self.fingerprint = hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()
        self.loss_of = loss_of
        self.epoch = 0
        self.best: dict[str, Tensor] = {}
        self.best_epoch = -1
        self.history: list[dict[str, float]] = []
        #: Of the steps of this epoch.
        self._losses: list[float] = []

    def learn(self, loss: Tensor, learning_rate: float, gradient_limit: float) -> None:
        """One step down the gradient of a loss.

        Args:
            loss: a scalar.
            learning_rate: of this step.
            gradient_limit: the norm that gradients are clipped to.

        Raises:
            InvalidArgumentError: the loss is not finite.
        """
        if not torch.isfinite(loss):
            raise InvalidArgumentError(
                f"the loss is {loss.item()} in epoch {self.epoch + 1}: lower "
                f"learning_rate={learning_rate}, or look for bad samples with 'artgym check'."
            )
        for group in self.optimizer.param_groups:
            group["lr"] = learning_rate
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.model.parameters(), gradient_limit)
        self.optimizer.step()
        self._losses.append(loss.item())

    def consider(self, validation: dict[str, float]) -> None:
        """Notes a validation, and keeps the weights if it is the best so far."""
        self.history.append({"epoch": float(self.epoch), **validation})
        if self.loss_of(validation) <= min(map(self.loss_of, self.history)):
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

    def complete(
        self,
        weights: Path,
        *,
        epochs: int,
        stop_after_epoch: int | None,
        validate_every: int,
        train_epoch: Callable[[], None],
        validate: Callable[[], dict[str, float]],
        finish: Callable[[], None] = lambda: None,
        facts: dict[str, Any],
        log: Path | None = None,
    ) -> None:
        """Goes through all epochs that are left, and writes the weights that validate best.

        The model is left in evaluation mode with the best weights so far.

        Args:
            weights: path of the result, ``.safetensors``.
            epochs: of the whole run.
            stop_after_epoch: leave after this many, without a result.
            validate_every: epochs between validations; the last is always validated.
            train_epoch: trains for one epoch, which is number ``epoch``, counted from 0.
            validate: scores the model.
            finish: called with the best weights in the model, before they are written.
            facts: JSON-able facts for the result's description.
            log: folder for TensorBoard: the mean loss of each epoch and every validation.

        Raises:
            MissingDependencyError: a log is wanted, and TensorBoard is not installed.
        """
        if log is not None:
            _require_tensorboard()
        if resume_path(weights).exists():
            self.load(resume_path(weights))
        last = epochs if stop_after_epoch is None else min(stop_after_epoch, epochs)
        while self.epoch < last:
            self.model.train()
            self._losses.clear()
            train_epoch()
            self.epoch += 1
            values = {"training/loss": sum(self._losses) / max(len(self._losses), 1)}
            if self.epoch % validate_every == 0 or self.epoch == epochs:
                self.model.eval()
                self.consider(validate())
                shown = {name: round(value, 4) for name, value in self.history[-1].items()}
                tqdm.write(f"validation {shown}")
                values |= {f"validation/{name}": value for name, value in shown.items()}
            if log is not None:
                _write_scalars(log, values, self.epoch)
            self.save(resume_path(weights))
        if self.best:
            self.model.load_state_dict(self.best)
        self.model.eval()
        if self.epoch == epochs:
            finish()
            outcome = {"best_epoch": self.best_epoch, "validation": self.history}
            save_model(weights, self.model, facts | outcome)
            resume_path(weights).unlink(missing_ok=True)
