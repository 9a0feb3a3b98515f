"""The networks of the paper's baselines, trained where they are missing.

FPFH and DAISY: each point's descriptor alone goes to the heads of ICAF-4. AH-Where: the network of
ICAF-4 with a grasp head that regresses one pose a point, as Where2Act does, on its frozen features;
its poses are fitted by the optimizer of ``benchmarks.constrained_fit``, as ANCSH does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import torch

from artgym.datasets.picture_files import PictureFolder, SampleFolder
from artgym.datasets.sample import Sample
from artgym.files import MANIFEST_NAME, file_sha256
from benchmarks.command import require_positive
from benchmarks.grasp_heads import HeadKind, HeadTrainingConfig, train_heads
from benchmarks.policies import load_perception
from icaf4_policy.anchors import AnchorConfig
from icaf4_policy.features import Features, described
from icaf4_policy.training import TrainingConfig, train

#: What each descriptor's row is called, and what it reads.
DESCRIPTORS: dict[str, Features] = {"daisy": "daisy", "fpfh": "fpfh"}

#: The row whose grasps are regressed directly.
DIRECT = "ah_where"


@dataclass(frozen=True, kw_only=True)
class BaselinesConfig:
    """How the baselines are trained.

    Attributes:
        pictures: of the training split, evenly spaced, that descriptors are worked out for, which
            takes a fifth of a second each; a quarter as many choose the weights.
        epochs: passes over them.
        heads: how the direct grasp head is trained.
        seed: of everything.
    """

    pictures: int = 240
    epochs: int = 10
    heads: HeadTrainingConfig = field(default_factory=HeadTrainingConfig)
    seed: int = 0

    def __post_init__(self) -> None:
        require_positive(self, "pictures", "epochs")


def train_baselines(
    category: str, data: Path, work: Path, weights: Path | None, config: BaselinesConfig
) -> None:
    """Writes ``{work}/{method}/{category}.safetensors`` for every baseline that is missing.

    Args:
        category: of objects.
        data: folder with ``{category}/train`` and ``{category}/val``, made by `artgym generate`.
        work: folder of the networks.
        weights: folder with the network of ICAF-4; None for the shipped one.
        config: how they are trained.

    Raises:
        DamagedFileError: the data are missing or damaged.
        MissingDependencyError: scikit-image, which DAISY takes, is not installed.
    """
    torch.set_num_threads(1)
    icaf4 = load_perception(category, weights).model
    for method, features in DESCRIPTORS.items():
        path = work / method / f"{category}.safetensors"
        if not path.exists():
            training = TrainingConfig(
                category=(category,),
                epochs=config.epochs,
                features=features,
                # Where poses are as far off as theirs, the part's frame would spoil grasps as well.
                anchors=replace(icaf4.config.anchors, frame="level"),
                seed=config.seed,
            )
            path.parent.mkdir(parents=True, exist_ok=True)
            train(
                training,
                _described(data / category / "train", config.pictures, features),
                _described(data / category / "val", max(config.pictures // 4, 1), features),
                path,
            )
    folder = SampleFolder(data / category / "train")
    train_heads(
        icaf4,
        folder,
        {DIRECT: HeadKind(anchors=AnchorConfig(kind="direct"))},
        work,
        config.heads,
        samples_sha256=file_sha256(folder.folder / MANIFEST_NAME),
    )


def _described(folder: Path, count: int, features: Features) -> Iterator[Sample]:
    """Samples of ``count`` pictures of a folder, evenly spaced, described."""
    pictures = PictureFolder(folder)
    chosen = np.linspace(0, len(pictures) - 1, min(count, len(pictures))).round().astype(int)
    for i in chosen.tolist():
        picture = pictures[i]
        for sample in picture.samples:
            yield described(picture, sample, features)
