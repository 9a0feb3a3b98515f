"""From an RGB-D picture to the objects in it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from artgym.errors import InvalidArgumentError
from icaf4_policy.checkpoint import load_network
from icaf4_policy.detector.config import DetectorConfig
from icaf4_policy.detector.model import DetectorNetwork
from icaf4_policy.detector.pictures import fitting_scale, network_input, shrunk
from icaf4_policy.detector.torchvision_ops import paste_masks_in_image


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
        depth = np.where(np.isfinite(depth), depth, np.float32(0.0))
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


def _network_from_json(fields: dict[str, Any]) -> DetectorNetwork:
    tuples: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in fields.items()}
    return DetectorNetwork(DetectorConfig(**tuples))
