"""From an RGB-D picture to the objects in it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import distance_transform_edt

from artgym.errors import InvalidArgumentError
from icaf4_policy.checkpoint import load_network
from icaf4_policy.detector.config import DetectorConfig
from icaf4_policy.detector.model import DetectorNetwork
from icaf4_policy.detector.pictures import fitting_scale, network_input, shrunk
from icaf4_policy.detector.torchvision_ops import paste_masks_in_image

#: Where more of a picture than this share is unknown in one piece, there is no hole but nothing.
_LARGEST_HOLE = 0.02


@dataclass(frozen=True, kw_only=True, eq=False)
class Detection:
    """One object in a picture.

    Attributes:
        category: "drawer", ...
        score: probability of it, in [0, 1].
        box: float32 (4,), left, top, width and height in pixels, as ``Sample.box``.
        mask: bool (H, W), the object's pixels.
    """

    category: str
    score: float
    box: NDArray[np.float32]
    mask: NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True, eq=False)
class Detector:
    """A trained detector, ready to look.

    Attributes:
        model: in evaluation mode.
    """

    model: DetectorNetwork

    @classmethod
    def load(cls, weights: str | Path) -> Detector:
        """Loads trained weights (``.safetensors``, description beside it).

        Raises:
            DamagedFileError: either file is missing, damaged or does not match.
        """
        model, _ = load_network(Path(weights), DetectorNetwork, _network_from_json)
        return cls(model=model)

    @torch.inference_mode()
    def detect(
        self, rgb: ArrayLike, depth: ArrayLike | None = None, *, min_score: float = 0.5
    ) -> list[Detection]:
        """The objects in a picture, best first.

        Args:
            rgb: uint8 (H, W, 3).
            depth: (H, W), metres along z, 0 or not finite where unknown; a detector of colours
                alone (``config.use_depth``) does without.
            min_score: objects with a lower score are left out.

        Raises:
            InvalidArgumentError: shapes or types do not fit, or depth is missing.
        """
        config = self.model.config
        if not 0 <= min_score <= 1:
            raise InvalidArgumentError(f"min_score={min_score} must be in [0, 1].")
        rgb = np.asarray(rgb)
        if depth is None:
            if config.use_depth:
                raise InvalidArgumentError(
                    "depth is missing: this detector was trained with it. Give depth, or train "
                    "with --no-use-depth."
                )
            depth = np.zeros(rgb.shape[:2])
        depth = np.asarray(depth, dtype=np.float32)
        if depth.ndim != 2 or not depth.size or rgb.shape != (*depth.shape, 3):
            raise InvalidArgumentError(
                f"depth {depth.shape} must be (H, W) and rgb {rgb.shape} (H, W, 3) of the same "
                "size."
            )
        if rgb.dtype != np.uint8:
            raise InvalidArgumentError(f"rgb is of dtype {rgb.dtype}: expected uint8.")
        depth = without_holes(np.where(np.isfinite(depth), depth, np.float32(0.0)))
        image = network_input(
            shrunk(rgb, config.input_size, cv2.INTER_AREA),
            shrunk(depth, config.input_size, cv2.INTER_NEAREST_EXACT),
            config,
        )
        _, (found,) = self.model(image[None])
        height, width = depth.shape
        boxes = found["boxes"] / fitting_scale(depth.shape, config.input_size)
        # Beside a picture of other proportions the network's input is empty.
        boxes = boxes.minimum(torch.tensor([width, height, width, height]))
        sure = (found["scores"] >= min_score) & (boxes[:, 2:] - boxes[:, :2] >= 1.0).all(dim=1)
        found, boxes = {name: values[sure] for name, values in found.items()}, boxes[sure]
        masks = paste_masks_in_image(found["masks"], boxes, (height, width))[:, 0] > 0.5
        boxes[:, 2:] -= boxes[:, :2]
        return [
            Detection(
                category=config.categories[int(label) - 1],
                score=float(score),
                box=box.numpy(),
                mask=mask.numpy(),
            )
            for label, score, box, mask in zip(
                found["labels"], found["scores"], boxes, masks, strict=True
            )
        ]


def without_holes(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Depth whose holes have the depth of the nearest pixel that is known.

    A real sensor gives nothing back from edges, shiny and dark things; simulated depth, which
    detectors learn from, is unknown only where nothing is: of that, too large for a hole, nothing
    is filled.

    Args:
        depth: (H, W), metres, 0 where unknown.
    """
    unknown = depth <= 0
    _, pieces = cv2.connectedComponents(unknown.astype(np.uint8), connectivity=4)
    piece = pieces.astype(np.int64)
    is_hole = np.bincount(piece.ravel()) < _LARGEST_HOLE * depth.size
    # Piece 0 is what is known.
    is_hole[0] = False
    if not is_hole.any():
        return depth
    row, column = np.asarray(
        distance_transform_edt(unknown, return_distances=False, return_indices=True)
    )
    return np.where(is_hole[piece], depth[row, column], depth)


def _network_from_json(fields: dict[str, Any]) -> DetectorNetwork:
    tuples: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in fields.items()}
    return DetectorNetwork(DetectorConfig(**tuples))
