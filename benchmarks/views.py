"""The trained network against labelled views of one object."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from artgym.datasets.generate import GenerationConfig, make_pictures
from benchmarks.policies import load_perception


@dataclass(frozen=True, kw_only=True)
class ViewsTask:
    """Which object is looked at, from how many places.

    Attributes:
        category: chooses the weights.
        object_id: a labelled object.
        views: pictures of each labelled joint state.
        seed: of the views, the choice of points and the chance rows.
        label_root: folder of labels; None for the shipped ones.
        weights: folder with ``{category}.safetensors``; None for the shipped ones.
    """

    category: str
    object_id: str
    views: int
    seed: int
    label_root: Path | None = None
    weights: Path | None = None


def score_views(task: ViewsTask) -> list[dict[str, float]]:
    """A row of metrics a view: those of ``evaluate_sample``, and lengths in object diameters."""
    from icaf4_policy.evaluation import evaluate_sample

    perception = load_perception(task.category, task.weights)
    config = GenerationConfig(views=task.views, seed=task.seed)
    rows = []
    pictures = make_pictures(task.object_id, config, task.label_root)
    for number, sample in enumerate(s for picture in pictures for s in picture.samples):
        rng = np.random.default_rng([task.seed, zlib.crc32(task.object_id.encode()), number])
        row = evaluate_sample(perception, sample, rng)
        for name in ("part_translation", "object_translation", "joint_pivot"):
            metres = row.get(f"{name}_m", float("nan"))
            row[f"{name}_percent"] = 100.0 * metres / float(sample.object_scale)
        rows.append(row)
    return rows
