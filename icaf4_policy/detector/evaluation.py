"""Average precision of a detector's boxes and masks, as COCO defines it."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pycocotools import mask as run_lengths
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval
from tqdm import tqdm

from artgym.datasets.sample import Picture
from icaf4_policy.detector.inference import Detection, Detector

#: Detections less certain than this do not count.
LOWEST_SCORE = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class Outline:
    """What average precision needs to know of an object, its mask run-length encoded.

    Attributes:
        category: "drawer", ...
        score: probability of it, in [0, 1]; 1 of what is there.
        box: float32 (4,), left, top, width and height in pixels.
        size: (height, width) of the picture.
        runs: of the mask, as pycocotools writes them.
    """

    category: str
    score: float
    box: NDArray[np.float32]
    size: tuple[int, int]
    runs: Any


def outlines(detections: Iterable[Detection]) -> list[Outline]:
    """Those of the detections of one picture."""
    return [
        Outline(
            category=each.category,
            score=each.score,
            box=each.box,
            size=(each.mask.shape[0], each.mask.shape[1]),
            runs=run_lengths.encode(np.asfortranarray(each.mask, dtype=np.uint8)),
        )
        for each in detections
    ]


def evaluate(detector: Detector, pictures: Iterable[Picture]) -> dict[str, float]:
    """``average_precision`` over pictures.

    Args:
        detector: looks at each of them.
        pictures: decoded one at a time if they are lazy, such as a ``PictureFolder``.
    """
    truths, found = [], []
    for picture in tqdm(pictures, desc="evaluation", unit="picture", leave=False, disable=None):
        truths.append(outlines(true_detections(picture)))
        detections = detector.detect(picture.rgb, picture.depth, min_score=LOWEST_SCORE)
        found.append(outlines(detections))
    return average_precision(truths, found)


def true_detections(picture: Picture) -> list[Detection]:
    """The objects that are in a picture."""
    return [
        Detection(
            category=sample.object_id.partition("/")[0],
            score=1.0,
            box=sample.box,
            mask=picture.instance_mask == index + 1,
        )
        for index, sample in enumerate(picture.samples)
    ]


def average_precision(
    truths: Sequence[Sequence[Outline]], found: Sequence[Sequence[Outline]]
) -> dict[str, float]:
    """Average precision over the recall levels, the categories and the overlaps.

    Args:
        truths: what is in each picture.
        found: what was found in each.

    Returns:
        "box/map50", "box/map75" and "box/map", the mean over overlaps from 0.50 to 0.95; the same
        for "mask/..."; and each for one category, "mask/map50/drawer". In [0, 1]; a category that
        no picture shows is left out, and without any object all are 0.
    """
    categories = sorted({each.category for objects in truths for each in objects})
    row = {}
    kinds: dict[str, Literal["bbox", "segm"]] = {"box": "bbox", "mask": "segm"}
    for kind, iou_type in kinds.items():
        # (overlaps, categories)
        precision = np.zeros((10, max(len(categories), 1)))
        if categories:
            # It prints as it works.
            with contextlib.redirect_stdout(io.StringIO()):
                judge = COCOeval(_coco(truths, categories), _coco(found, categories), iou_type)
                judge.evaluate()
                judge.accumulate()
            # (overlaps, recalls, categories, areas, limits): objects of all sizes.
            precision = judge.eval["precision"][:, :, :, 0, -1].mean(axis=1)
        for name, overlaps in (("map50", [0]), ("map75", [5]), ("map", range(10))):
            per_category = precision[list(overlaps)].mean(axis=0)
            row[f"{kind}/{name}"] = float(per_category.mean())
            for category, value in zip(categories, per_category, strict=False):
                row[f"{kind}/{name}/{category}"] = float(value)
    return row


def _coco(pictures: Sequence[Sequence[Outline]], categories: Sequence[str]) -> COCO:
    """Detections as a COCO data set; those of other categories count for nothing."""
    images: list[Any] = []
    annotations: list[Any] = []
    for image, objects in enumerate(pictures):
        height, width = objects[0].size if objects else (0, 0)
        images.append({"id": image, "height": height, "width": width})
        for each in objects:
            if each.category not in categories:
                continue
            annotations.append(
                {
                    "id": len(annotations) + 1,
                    "image_id": image,
                    "category_id": categories.index(each.category),
                    "bbox": each.box.tolist(),
                    "segmentation": each.runs,
                    "area": float(run_lengths.area(each.runs)),
                    "iscrowd": 0,
                    "score": each.score,
                }
            )
    dataset: Any = {
        "images": images,
        "annotations": annotations,
        "categories": [{"id": i, "name": name} for i, name in enumerate(categories)],
    }
    data = COCO()
    data.dataset = dataset
    data.createIndex()
    return data
