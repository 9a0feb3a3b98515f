"""Trained networks against labelled views of one object, and their best grasps in physics."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from artgym.annotation.annotate import labelled_ids, positions_at
from artgym.annotation.trial import try_grasp
from artgym.datasets.generate import GenerationConfig, make_pictures
from artgym.datasets.sample import JOINT_NONE, JOINT_PRISMATIC, Picture, Sample
from artgym.errors import InvalidArgumentError
from artgym.geometry.transforms import invert, transform_from
from artgym.objects import catalog
from benchmarks.constrained_fit import ConstrainedFitConfig, fit_parts
from benchmarks.policies import load_perception

if TYPE_CHECKING:
    from icaf4_policy.pose_fitting import PoseFit
    from icaf4_policy.prediction import Prediction


#: The one method whose parts are fitted by the joint-constrained optimizer, and without a pose of
#: the object; and the one whose boxes are not turned to the faces that are seen. What else tells
#: the methods apart stands in their weights.
_OPTIMIZED, _FACELESS = "ah_where", "no_faces"

#: It takes a second or so a view.
_OPTIMIZER = ConstrainedFitConfig(hypotheses=50)


@dataclass(frozen=True, kw_only=True)
class ViewsTask:
    """Which object is looked at, from how many places, by whom.

    Attributes:
        category: chooses the weights.
        object_id: a labelled object.
        views: pictures of each labelled joint state.
        seed: of the views, the choice of points and the chance rows.
        label_root: folder of labels; None for the shipped ones.
        methods: of ``paper.METHOD_LABELS``, the folder with ``{category}.safetensors`` of each;
            None for the shipped weights.
        depth_noise: whether depth has the errors of a real sensor.
    """

    category: str
    object_id: str
    views: int
    seed: int
    label_root: Path | None
    methods: Mapping[str, Path | None]
    depth_noise: bool


class ViewsOptions(Protocol):
    """Options of a benchmark that looks at labelled objects."""

    @property
    def split(self) -> catalog.Split:
        """Of the objects."""
        ...

    @property
    def objects(self) -> int | None:
        """How many at most; None for all."""
        ...

    @property
    def views(self) -> int:
        """Pictures of each labelled joint state."""
        ...

    @property
    def seed(self) -> int:
        """Of the views, the choice of points and the chance rows."""
        ...

    @property
    def labels(self) -> Path | None:
        """Folder of labels; None for the shipped ones."""
        ...


def require_labelled(category: str, config: ViewsOptions) -> Sequence[str]:
    """Ids of the labelled objects that are to be looked at, at least one.

    Raises:
        InvalidArgumentError: there is none.
    """
    ids = labelled_ids(category, config.split, config.labels)[: config.objects]
    if not ids:
        raise InvalidArgumentError(
            f"no labels for {category}/{config.split}: run `artgym annotate --category "
            f"{category} --split {config.split}` first."
        )
    return ids


def views_tasks(
    category: str,
    config: ViewsOptions,
    methods: Mapping[str, Path | None],
    *,
    depth_noise: bool = False,
) -> list[ViewsTask]:
    """A task an object.

    Args:
        category: of the objects and the networks.
        config: which objects, and how they are looked at.
        methods: see ``ViewsTask``.
        depth_noise: see ``ViewsTask``.

    Raises:
        InvalidArgumentError: no such object has labels.
    """
    return [
        ViewsTask(
            category=category,
            object_id=object_id,
            views=config.views,
            seed=config.seed,
            label_root=config.labels and config.labels.absolute(),
            methods=methods,
            depth_noise=depth_noise,
        )
        for object_id in require_labelled(category, config)
    ]


def score_views(task: ViewsTask) -> dict[str, list[dict[str, float]]]:
    """For each method a row of metrics a view, the views being the same for all.

    The metrics are those of ``evaluate_sample``, lengths in object diameters, and "executed":
    whether the best grasp, tried in physics as the labels were, moves the part that it names.
    """
    config = GenerationConfig(views=task.views, depth_noise=task.depth_noise, seed=task.seed)
    pictures = make_pictures(task.object_id, config, task.label_root)
    return {
        method: [
            _score(load_perception(task.category, weights), picture, method, task, number)
            for number, picture in enumerate(pictures)
        ]
        for method, weights in task.methods.items()
    }


def _score(
    perception: Any, picture: Picture, method: str, task: ViewsTask, number: int
) -> dict[str, float]:
    from icaf4_policy.evaluation import evaluate_sample
    from icaf4_policy.features import described

    rng = np.random.default_rng([task.seed, zlib.crc32(task.object_id.encode()), number])
    (sample,) = picture.samples
    sample = described(picture, sample, perception.model.config.features)
    if method == _FACELESS:
        consistency = replace(perception.consistency, faces=False)
        perception = replace(perception, consistency=consistency)
    refit = (lambda prediction: _optimized(prediction, rng)) if method == _OPTIMIZED else None
    row, prediction = evaluate_sample(perception, sample, rng, refit=refit)
    for name in ("part_translation", "object_translation", "joint_pivot"):
        metres = row.get(f"{name}_m", float("nan"))
        row[f"{name}_percent"] = 100.0 * metres / float(sample.object_scale)
    row["executed"] = float(_succeeds(prediction, sample))
    return row


def _optimized(prediction: Prediction, rng: np.random.Generator) -> Prediction:
    """The same with its parts fitted by the optimizer, as far as base and joints were found."""
    boxes: list[PoseFit | None] = list(prediction.part_boxes)
    base = boxes[0]
    parts = [
        k
        for k, (box, joint) in enumerate(zip(boxes, prediction.joints, strict=True))
        if box is not None and (k == 0 or joint.joint_type != JOINT_NONE)
    ]
    if base is not None and len(parts) > 1:
        on_part = [prediction.part == k for k in parts]
        joints = [prediction.joints[k] for k in parts[1:]]
        R_camera_base = base.T_camera_box[:3, :3]
        fits = fit_parts(
            [prediction.npcs[on] for on in on_part],
            [prediction.points_camera[on] for on in on_part],
            ["prismatic" if j.joint_type == JOINT_PRISMATIC else "revolute" for j in joints],
            np.stack([joint.axis_camera for joint in joints]) @ R_camera_base,
            rng,
            _OPTIMIZER,
        )
        for k, fit in zip(parts, fits, strict=True):
            boxes[k] = fit
    return replace(prediction, part_boxes=tuple(boxes), object_boxes=(None,) * len(boxes))


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
