"""Grasp heads with different anchors, trained side by side on the features of one network.

The backbone and the other heads stay as they are: what a head scores can then only come from its
anchors, and the points that its network sees, finds graspable and is asked at are those of every
other.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import asdict, dataclass, field, replace
from itertools import accumulate
from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional as F
from tqdm import tqdm

from artgym.datasets.sample import Sample
from artgym.errors import DamagedFileError, InvalidArgumentError
from artgym.geometry.rotations import quaternion_from_matrix
from icaf4_policy.anchors import AnchorConfig, anchors_from_config
from icaf4_policy.backbone.classical import DESCRIPTOR_CHANNELS
from icaf4_policy.checkpoint import load_model, save_model
from icaf4_policy.dataset import SPARE_POINTS
from icaf4_policy.features import has_color
from icaf4_policy.heads.grasp import GraspHead
from icaf4_policy.losses import LossWeights, grasp_terms, total_loss
from icaf4_policy.model import Icaf4
from icaf4_policy.targets import (
    GRASP_FIELDS,
    DrawConfig,
    GraspTargets,
    Item,
    Targets,
    collate_grasps,
    collate_items,
    draw_item,
    grasp_matches,
    mean_angles,
    successful_grasps,
    targets_from_sample,
)
from icaf4_policy.training_run import TrainingRun, cosine_rate, keep_freed_memory

#: The anchors that ``LossWeights.anchors`` is meant for: as the loss is a mean over anchors, of
#: which hardly more match where there are many, the weight grows with their number.
_WEIGHED_FOR = len(anchors_from_config(AnchorConfig(kind="axis", step_deg=45)))

#: Of a residual of any kind.
_MOST_NUMBERS = 4


@dataclass(frozen=True, kw_only=True)
class HeadTrainingConfig:
    """How grasp heads are trained on frozen features.

    Attributes:
        samples: views that are learnt from, each with at least one successful grasp.
        draws: choices of points and colours of a view, whose features are worked out once; epochs
            take them in turn.
        epochs: passes over the samples.
        batch_size: clouds a step.
        num_grasp_points: S, points of a cloud whose grasps are learnt.
        learning_rate: of Adam, at its highest; see ``cosine_rate``.
        weight_decay: of Adam.
        warmup_share: share of the steps that rise, in [0, 1).
        gradient_limit: the norm that each head's gradients are clipped to.
        color_jitter: spread of the random change of colours.
        seed: of the heads' first weights, the samples, their order and the choice of points.
        losses: weights of the two losses; that of the anchors holds for 72 of them, and grows with
            their number.
    """

    samples: int = 800
    draws: int = 2
    epochs: int = 10
    batch_size: int = 8
    num_grasp_points: int = 64
    learning_rate: float = 1e-3
    weight_decay: float = 1e-4
    warmup_share: float = 0.03
    gradient_limit: float = 10.0
    color_jitter: float = 0.2
    seed: int = 0
    losses: LossWeights = field(default_factory=LossWeights)

    def __post_init__(self) -> None:
        for name in ("samples", "draws", "epochs", "batch_size", "num_grasp_points"):
            if getattr(self, name) < 1:
                raise InvalidArgumentError(f"{name}={getattr(self, name)} must be at least 1.")
        for name in ("learning_rate", "gradient_limit"):
            if not 0 < getattr(self, name) < float("inf"):
                raise InvalidArgumentError(
                    f"{name}={getattr(self, name)} must be positive and finite."
                )
        if not 0 <= self.warmup_share < 1:
            raise InvalidArgumentError(f"warmup_share={self.warmup_share} must be in [0, 1).")


@dataclass(frozen=True, kw_only=True)
class HeadKind:
    """What tells one head from another. Each departure stands for what the released code does.

    Attributes:
        anchors: what grasps are refined from.
        sign_blind: anchors are matched by the plain distance between quaternions, as if q and -q,
            and a grasp with its jaws swapped, were others; axis anchors only.
        one_pose: of all successful grasps of a point the most central alone is learnt.
        softmax: the anchors' loss is the cross-entropy of one right anchor, points without any
            left out; takes one pose.
        all_residuals: residuals are learnt at all anchors, matched or not; takes one pose and axis
            anchors.
    """

    anchors: AnchorConfig
    sign_blind: bool = False
    one_pose: bool = False
    softmax: bool = False
    all_residuals: bool = False

    def __post_init__(self) -> None:
        if (self.softmax or self.all_residuals) and not self.one_pose:
            raise InvalidArgumentError("softmax and all_residuals take one_pose=True.")
        if (self.sign_blind or self.all_residuals) and self.anchors.kind != "axis":
            raise InvalidArgumentError(
                f"kind={self.anchors.kind!r}: sign_blind and all_residuals take axis anchors."
            )


def head_path(folder: Path, name: str, category: str) -> Path:
    """Where the network with the head ``name`` is kept: ``{folder}/{name}/{category}``."""
    return folder / name / f"{category}.safetensors"


def train_heads(
    model: Icaf4,
    samples: Sequence[Sample],
    kinds: Mapping[str, HeadKind],
    folder: Path,
    config: HeadTrainingConfig,
    *,
    samples_sha256: str,
) -> list[Path]:
    """Trains a fresh grasp head a name, and writes each as the whole network it belongs to.

    All heads take the same steps on the same features; a head does not depend on which others are
    trained beside it. Files that an earlier call with the same network, samples and config left
    are kept, others replaced.

    Args:
        model: a trained network of one category, not one of descriptors; not changed.
        samples: training views, read lazily and in a random order.
        kinds: what each head is, by name.
        folder: where the networks are written, see ``head_path``.
        config: how to train.
        samples_sha256: tells these samples from others.

    Returns:
        The paths of the networks, in the order of ``kinds``.

    Raises:
        InvalidArgumentError: a network of several categories or of descriptors; samples of
            another category, or none with a successful grasp; no names; more grasp points than
            points; a loss that is not finite.
    """
    category = _only_category(model)
    if not kinds:
        raise InvalidArgumentError("kinds is empty: expected one head or more.")
    if config.num_grasp_points > model.config.num_points:
        raise InvalidArgumentError(
            f"num_grasp_points={config.num_grasp_points} exceeds the network's "
            f"num_points={model.config.num_points}."
        )
    facts = {"network_sha256": _state_sha256(model), "samples_sha256": samples_sha256}
    heads = [_Head(name, kind, model, config, facts) for name, kind in kinds.items()]
    paths = [head_path(folder, head.name, category) for head in heads]
    missing = [
        (head, path)
        for head, path in zip(heads, paths, strict=True)
        if not _is_kept(path, head.run.fingerprint)
    ]
    if not missing:
        return paths
    count = _learn(model, samples, [head for head, _ in missing], config)
    shared = {**facts, "config": asdict(config), "training_samples": count}
    for head, path in missing:
        own = {"fingerprint": head.run.fingerprint, "loss": head.losses}
        save_model(path, head.network(model), shared | own)
    return paths


def _only_category(model: Icaf4) -> str:
    if len(model.config.categories) > 1:
        raise InvalidArgumentError(
            f"a network for {', '.join(model.config.categories)}: expected one for a single "
            "category."
        )
    if model.config.features in DESCRIPTOR_CHANNELS:
        raise InvalidArgumentError(
            f"a network that is given features={model.config.features!r}: expected one that needs "
            "no pictures."
        )
    return next(iter(model.config.categories))


def _state_sha256(model: Icaf4) -> str:
    """A digest of all weights."""
    digest = hashlib.sha256()
    for name, tensor in sorted(model.state_dict().items()):
        digest.update(name.encode())
        digest.update(tensor.contiguous().numpy().tobytes())
    return digest.hexdigest()


def _is_kept(path: Path, fingerprint: str) -> bool:
    """Whether a network that was trained just so is there, whole."""
    try:
        _, description = load_model(path)
    except DamagedFileError:
        return False
    return description["training"].get("fingerprint") == fingerprint


class _Head:
    """One head in training."""

    def __init__(
        self,
        name: str,
        kind: HeadKind,
        model: Icaf4,
        config: HeadTrainingConfig,
        facts: Mapping[str, str],
    ) -> None:
        self.name, self.kind = name, kind
        self.anchors = anchors_from_config(kind.anchors)
        self._quaternions = torch.from_numpy(quaternion_from_matrix(self.anchors.rotations)).float()
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(config.seed)
            self.head = GraspHead(
                model.config.backbone.width_out, len(self.anchors), self.anchors.residual_size
            )
        # Direct regression has nothing to choose from.
        of_anchors = config.losses.anchors * len(self.anchors) / _WEIGHED_FOR
        self.weights = replace(
            config.losses, anchors=0.0 if kind.anchors.kind == "direct" else of_anchors
        )
        adam = torch.optim.Adam(
            self.head.parameters(), lr=config.learning_rate, weight_decay=config.weight_decay
        )
        settings = [asdict(kind), asdict(config), facts]
        self.run = TrainingRun(self.head, adam, settings, lambda validation: 0.0)
        #: Mean loss of each epoch.
        self.losses: list[float] = []

    def loss(self, features: Tensor, truth: GraspTargets) -> Tensor:
        """At features (B, S, C)."""
        logits, residuals = self.head.at_matches(features, truth.match_index)
        terms = grasp_terms(logits, residuals, truth)
        if self.kind.softmax:
            terms["anchors"] = self._cross_entropy(logits, truth)
        if self.kind.all_residuals:
            terms["residuals"] = self._residuals_everywhere(features, truth)
        return total_loss(terms, self.weights)

    def _cross_entropy(self, logits: Tensor, truth: GraspTargets) -> Tensor:
        """Of the right anchor, over L as a mean over anchors is: the weight stays what it is."""
        point, anchor = self._matches(truth)
        return F.cross_entropy(logits.flatten(0, 1)[point], anchor) / len(self.anchors)

    def _residuals_everywhere(self, features: Tensor, truth: GraspTargets) -> Tensor:
        """Squared error of the residuals from all anchors to the one grasp of a point."""
        point, anchor = self._matches(truth)
        _, residuals = self.head(features)  # (B, S, L, 4)
        grasp = self._quaternions[anchor] + truth.match_residual  # (n, 4)
        wanted = grasp[:, None] - self._quaternions  # (n, L, 4)
        errors = (residuals.flatten(0, 1)[point] - wanted).square().sum(dim=-1)
        return errors.sum() / max(errors.numel(), 1)

    def _matches(self, truth: GraspTargets) -> tuple[Tensor, Tensor]:
        """Point, of all in the batch, and anchor of each match."""
        count = len(self.anchors)
        return truth.match_index // count, truth.match_index % count

    def matches(
        self, sample: Sample
    ) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.floating]]:
        """What the head should say of a sample, as ``targets.grasp_matches`` gives it."""
        if not (self.kind.one_pose or self.kind.sign_blind):
            return grasp_matches(sample, self.anchors)
        row, R_grasps = successful_grasps(sample, self.anchors.frame)
        if self.kind.one_pose:
            central = np.lexsort((mean_angles(row, R_grasps), row))
            first = central[np.unique(row[central], return_index=True)[1]]
            row, R_grasps = row[first], R_grasps[first]
        if not self.kind.sign_blind:
            return row, *self.anchors.match(R_grasps)
        q = quaternion_from_matrix(R_grasps)
        q_anchors = quaternion_from_matrix(self.anchors.rotations)
        distance = np.linalg.norm(q[:, None] - q_anchors, axis=-1)  # (n, L)
        matched = np.argmin(distance, axis=-1)
        order = np.lexsort((distance.min(axis=-1), matched, row))
        _, first = np.unique(np.stack([row, matched])[:, order], axis=1, return_index=True)
        kept = order[first]
        return row[kept], matched[kept], (q - q_anchors[matched])[kept]

    def network(self, model: Icaf4) -> Icaf4:
        """A copy of the network with this head."""
        changed = Icaf4(replace(model.config, anchors=self.kind.anchors))
        shared = {k: v for k, v in model.state_dict().items() if not k.startswith("grasp.")}
        own = {f"grasp.{k}": v for k, v in self.head.state_dict().items()}
        changed.load_state_dict(deepcopy(shared | own))
        return changed.eval()


def _learn(
    model: Icaf4, samples: Sequence[Sample], heads: Sequence[_Head], config: HeadTrainingConfig
) -> int:
    """Trains the heads, all on the same batches, and says on how many samples."""
    keep_freed_memory()
    # The anchors of all heads stand in one row, so that a sample is drawn once for all.
    starts = [0, *accumulate(len(head.anchors) for head in heads)]
    draw = DrawConfig(
        num_points=model.config.num_points,
        num_anchors=starts[-1],
        num_grasp_points=config.num_grasp_points,
        color_jitter=config.color_jitter if has_color(model.config.features) else 0.0,
    )
    targets = _targets(model, samples, heads, starts, config)
    drawn = [_drawn(model, targets, draw, config, number) for number in range(config.draws)]
    batch = min(config.batch_size, len(targets))
    steps = len(targets) // batch
    for head in heads:
        head.head.train()
    bar = tqdm(range(config.epochs), desc="grasp heads", unit="epoch", leave=False, disable=None)
    for epoch in bar:
        features, items = drawn[epoch % config.draws]
        order = np.random.default_rng((config.seed, 0, epoch)).permutation(len(targets))
        sums = np.zeros(len(heads))
        for number in range(steps):
            # A last, smaller batch would skew the batch statistics.
            index = order[number * batch : (number + 1) * batch]
            truth = collate_grasps([items[i] for i in index], draw)
            seen = features[torch.from_numpy(index)]
            step, total = epoch * steps + number, config.epochs * steps
            rate = cosine_rate(config.learning_rate, step, total, config.warmup_share)
            for h, head in enumerate(heads):
                loss = head.loss(seen, _part_of(truth, starts[h], head))
                head.run.learn(loss, rate, config.gradient_limit)
                sums[h] += loss.item()
        for head, mean in zip(heads, sums / steps, strict=True):
            head.losses.append(float(mean))
    return len(targets)


def _targets(
    model: Icaf4,
    samples: Sequence[Sample],
    heads: Sequence[_Head],
    starts: Sequence[int],
    config: HeadTrainingConfig,
) -> list[Targets]:
    """Targets of samples with successful grasps, the heads' anchors counted on in one row."""
    kept: list[Targets] = []
    most = SPARE_POINTS * model.config.num_points
    order = np.random.default_rng((config.seed, 1)).permutation(len(samples))
    with tqdm(total=config.samples, desc="targets", unit="view", leave=False, disable=None) as bar:
        for i in order.tolist():
            if len(kept) == config.samples:
                break
            sample = samples[i]
            if not sample.successful_tries().any():
                continue
            shared = targets_from_sample(
                sample, model.config.categories, heads[0].anchors, most, model.config.features
            )
            kept.append(_with_all_matches(shared, sample, heads, starts))
            bar.update()
    if not kept:
        raise InvalidArgumentError(
            f"none of {len(samples)} samples has a successful grasp: generate them from labelled "
            "objects."
        )
    return kept


def _with_all_matches(
    shared: Targets, sample: Sample, heads: Sequence[_Head], starts: Sequence[int]
) -> Targets:
    """The same targets with the matches of all heads, residuals filled up to four numbers."""
    rows, matched, residuals = [], [], []
    # The last of ``starts`` is where one more head's anchors would begin.
    for head, start in zip(heads, starts, strict=False):
        row, anchor, residual = head.matches(sample)
        rows.append(row)
        matched.append(anchor + start)
        residuals.append(np.pad(residual, ((0, 0), (0, _MOST_NUMBERS - residual.shape[1]))))
    row = np.concatenate(rows)
    order = np.argsort(row, kind="stable")
    counted = np.searchsorted(row[order], np.arange(len(shared.match_start)))
    return replace(
        shared,
        match_start=counted.astype(np.int32),
        match_anchor=np.concatenate(matched)[order].astype(np.int16),
        match_residual=np.concatenate(residuals)[order].astype(np.float16),
    )


def _drawn(
    model: Icaf4,
    targets: Sequence[Targets],
    draw: DrawConfig,
    config: HeadTrainingConfig,
    number: int,
) -> tuple[Tensor, list[Item]]:
    """Features (n, S, C) at the points drawn of every sample, and ``GRASP_FIELDS`` of these."""
    features: list[Tensor] = []
    kept: list[Item] = []
    # What the grasp head is given are the backbone's features at the points that it is asked for.
    hook = model.grasp.register_forward_pre_hook(lambda _, given: features.append(given[0]))
    label = f"features, draw {number + 1}/{config.draws}"
    firsts = range(0, len(targets), config.batch_size)
    try:
        for first in tqdm(firsts, desc=label, unit="batch", leave=False, disable=None):
            items = [
                draw_item(targets[i], draw, np.random.default_rng((config.seed, 2, number, i)))
                for i in range(first, min(first + config.batch_size, len(targets)))
            ]
            batch = collate_items(items, draw)
            with torch.no_grad():
                model(batch.points_level, batch.colors, batch.category, batch.grasp_points)
            kept += [{name: item[name] for name in GRASP_FIELDS} for item in items]
    finally:
        hook.remove()
    return torch.cat(features), kept


def _part_of(truth: GraspTargets, start: int, head: _Head) -> GraspTargets:
    """Of what all heads should say, what one should."""
    count, all_heads = len(head.anchors), truth.anchor_mask.shape[-1]
    row, anchor = truth.match_index // all_heads, truth.match_index % all_heads - start
    own = (anchor >= 0) & (anchor < count)
    return GraspTargets(
        grasp_weight=truth.grasp_weight,
        anchor_mask=truth.anchor_mask[..., start : start + count],
        match_index=row[own] * count + anchor[own],
        match_residual=truth.match_residual[own, : head.anchors.residual_size],
    )
