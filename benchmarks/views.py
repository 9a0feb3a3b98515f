"""The trained network against labelled views of one object, and its best grasp in physics."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from artgym.annotation.annotate import positions_at
from artgym.annotation.trial import try_grasp
from artgym.datasets.generate import GenerationConfig, make_pictures
from artgym.datasets.sample import Sample
from artgym.geometry.transforms import invert, transform_from
from artgym.objects import catalog
from benchmarks.policies import load_perception

if TYPE_CHECKING:
    from icaf4_policy.inference import Prediction


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
    """A row of metrics a view.

    Those of ``evaluate_sample``, lengths in object diameters, and "executed": whether the
    network's best grasp, tried in physics as the labels were, moves the part that it names.
    """
    from icaf4_policy.evaluation import evaluate_sample

    perception = load_perception(task.category, task.weights)
    config = GenerationConfig(views=task.views, seed=task.seed)
    rows = []
    pictures = make_pictures(task.object_id, config, task.label_root)
    for number, sample in enumerate(s for picture in pictures for s in picture.samples):
        rng = np.random.default_rng([task.seed, zlib.crc32(task.object_id.encode()), number])
        row, prediction = evaluate_sample(perception, sample, rng)
        for name in ("part_translation", "object_translation", "joint_pivot"):
            metres = row.get(f"{name}_m", float("nan"))
            row[f"{name}_percent"] = 100.0 * metres / float(sample.object_scale)
        row["executed"] = float(_succeeds(prediction, sample))
        rows.append(row)
    return rows


def _succeeds(prediction: Prediction, sample: Sample) -> bool:
    """Whether the best grasp of a movable part succeeds; no grasp does not."""
    grasps = prediction.grasps
    movable = np.flatnonzero((grasps.parts > 0) & (grasps.parts < sample.num_parts))
    if not len(movable):
        return False
    best = movable[0]
    T_camera_grasp = transform_from(grasps.R_camera_grasp[best], grasps.points_camera[best])
    T_object_grasp = invert(sample.T_camera_object.astype(float)) @ T_camera_grasp
    obj = catalog.load(sample.object_id)
    q = positions_at(obj, sample.open_fraction[1:].astype(float))
    return try_grasp(obj, q, int(grasps.parts[best]), T_object_grasp).success
