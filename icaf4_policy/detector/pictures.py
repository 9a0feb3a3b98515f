"""Pictures as the detector's input: shrunk, and for training changed at random."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass, replace

import cv2
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from tqdm import tqdm

from artgym.datasets.sample import Picture
from artgym.errors import InvalidArgumentError
from icaf4_policy.detector.config import AugmentationConfig, DetectorConfig

Array = NDArray[np.floating]

#: Of an object that the edge of a changed picture cuts, less than this share is left unlabelled.
_SMALLEST_SHARE = 0.25


@dataclass(frozen=True, kw_only=True, eq=False)
class ShrunkPicture:
    """A picture of the network's size, and the n objects in it.

    Attributes:
        rgb: uint8 (h, w, 3).
        depth: float32 (h, w), metres, 0 where unknown.
        instance_mask: uint8 (h, w), index of the object + 1.
        boxes: float32 (n, 4), left, top, right, bottom, pixels.
        labels: int64 (n,), index of the category + 1.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    instance_mask: NDArray[np.uint8]
    boxes: NDArray[np.float32]
    labels: NDArray[np.int64]


def shrunk(image: NDArray, size: tuple[int, int], interpolation: int) -> NDArray:
    """An image scaled to fit (width, height), in its upper left corner, and 0 in the rest."""
    scale = fitting_scale(image.shape[:2], size)
    height, width = (max(1, round(side * scale)) for side in image.shape[:2])
    fitted = cv2.resize(image, (width, height), interpolation=interpolation)
    whole = np.zeros((size[1], size[0], *image.shape[2:]), dtype=image.dtype)
    whole[:height, :width] = fitted
    return whole


def fitting_scale(shape: tuple[int, ...], size: tuple[int, int]) -> float:
    """What an image of ``shape`` (H, W) is scaled by to fit (width, height)."""
    return min(size[0] / shape[1], size[1] / shape[0])


def network_input(
    rgb: NDArray[np.uint8], depth: NDArray[np.float32], config: DetectorConfig
) -> Tensor:
    """Images of size ``config.input_size`` as the network wants them.

    Args:
        rgb: (h, w, 3).
        depth: (h, w), metres, 0 where unknown.
        config: of the network.

    Returns:
        float32 (C, h, w): red, green and blue in [0, 1] and, with ``use_depth``, depth.
    """
    channels = [rgb.astype(np.float32) / 255.0]
    if config.use_depth:
        channels.append(depth[..., None])
    return torch.from_numpy(np.concatenate(channels, axis=2)).permute(2, 0, 1)


def network_target(picture: ShrunkPicture) -> dict[str, Tensor]:
    """What the network should find, see ``DetectorNetwork.forward``."""
    each = np.arange(1, len(picture.labels) + 1, dtype=np.uint8)[:, None, None]
    return {
        "boxes": torch.from_numpy(picture.boxes),
        "labels": torch.from_numpy(picture.labels),
        "masks": torch.from_numpy((picture.instance_mask == each).astype(np.uint8)),
    }


def shrink(picture: Picture, config: DetectorConfig) -> ShrunkPicture:
    """A picture of the network's size.

    Raises:
        InvalidArgumentError: an object of a category that the network does not know.
    """
    size = config.input_size
    names = [sample.object_id.partition("/")[0] for sample in picture.samples]
    if strange := sorted(set(names) - set(config.categories)):
        raise InvalidArgumentError(
            f"pictures show {', '.join(strange)}, but the detector knows "
            f"{', '.join(config.categories)}: all must be among the training pictures."
        )
    boxes = np.array([sample.box for sample in picture.samples], dtype=np.float32).reshape(-1, 4)
    boxes[:, 2:] += boxes[:, :2]
    whole = ShrunkPicture(
        rgb=shrunk(picture.rgb, size, cv2.INTER_AREA),
        depth=shrunk(picture.depth, size, cv2.INTER_NEAREST_EXACT),
        instance_mask=shrunk(picture.instance_mask, size, cv2.INTER_NEAREST_EXACT),
        boxes=boxes * np.float32(fitting_scale(picture.depth.shape, size)),
        labels=np.array([config.categories.index(name) + 1 for name in names], dtype=np.int64),
    )
    return _without_the_unseen(whole, np.zeros(len(names)))


def prepare(
    pictures: Iterable[Picture], config: DetectorConfig, label: str
) -> tuple[list[ShrunkPicture], str]:
    """The pictures with objects, shrunk, 0.6 MB each at 320x240; and a digest of what went in.

    Args:
        pictures: decoded one at a time if they are lazy.
        config: of the network.
        label: what the progress bar says.
    """
    digest, prepared = hashlib.sha256(), []
    for picture in tqdm(pictures, desc=label, unit="picture", leave=False, disable=None):
        small = shrink(picture, config)
        for array in (picture.rgb, picture.depth, picture.instance_mask, small.labels):
            digest.update(np.ascontiguousarray(array).tobytes())
        # A step without any object has no masks to normalise.
        if len(small.labels):
            prepared.append(small)
    return prepared, digest.hexdigest()


def changed(
    picture: ShrunkPicture, config: AugmentationConfig, rng: np.random.Generator
) -> ShrunkPicture:
    """The picture mirrored, magnified, shifted and tinted at random, but never without objects."""
    height, width = picture.depth.shape
    zoom = float(np.exp(config.zoom * rng.uniform(-1.0, 1.0)))
    shift = config.shift * rng.uniform(-1.0, 1.0, 2)
    sign = -1.0 if rng.random() < config.flip else 1.0
    # About the middle: pixel centres lie at whole numbers plus a half.
    scale = np.array([sign * zoom, zoom])
    middle = 0.5 * np.array([width, height])
    offset = middle - scale * middle + shift * [width, height]
    matrix = np.column_stack([np.diag(scale), offset + 0.5 * scale - 0.5])

    def warped(image: NDArray, interpolation: int) -> NDArray:
        return cv2.warpAffine(image, matrix, (width, height), flags=interpolation)

    ends = picture.boxes.reshape(-1, 2, 2) * scale + offset
    boxes = np.concatenate([ends.min(axis=1), ends.max(axis=1)], axis=1).astype(np.float32)
    gain = (
        1.0
        + config.color_jitter * rng.uniform(-1.0, 1.0, 3)
        + 0.5 * rng.uniform(-config.color_jitter, config.color_jitter)
    )
    lift = 255.0 * config.color_jitter * rng.uniform(-1.0, 1.0)
    rgb = warped(picture.rgb, cv2.INTER_LINEAR) * gain + lift
    moved = replace(
        picture,
        rgb=rgb.clip(0.0, 255.0).astype(np.uint8),
        depth=warped(picture.depth, cv2.INTER_NEAREST) / np.float32(zoom),
        instance_mask=warped(picture.instance_mask, cv2.INTER_NEAREST),
        boxes=boxes,
    )
    pixels = np.bincount(picture.instance_mask.reshape(-1), minlength=len(boxes) + 1)[1:]
    kept = _without_the_unseen(moved, _SMALLEST_SHARE * pixels * zoom**2)
    return kept if len(kept.labels) else picture


def _without_the_unseen(picture: ShrunkPicture, least: Array) -> ShrunkPicture:
    """The objects with more than ``least`` (n,) pixels, their boxes cut to what is seen."""
    instance_mask, boxes, labels = np.zeros_like(picture.instance_mask), [], []
    for index, (box, label) in enumerate(zip(picture.boxes, picture.labels, strict=True)):
        mine = picture.instance_mask == index + 1
        if mine.sum() <= least[index]:
            continue
        rows, columns = (np.flatnonzero(mine.any(axis=axis)) for axis in (1, 0))
        # What is seen, to a pixel: the true box is finer, but knows nothing of the edge.
        seen = (columns[0] - 1, rows[0] - 1, columns[-1] + 2, rows[-1] + 2)
        inside = np.concatenate([np.maximum(box[:2], seen[:2]), np.minimum(box[2:], seen[2:])])
        if (inside[2:] - inside[:2] < 1.0).any():
            continue
        boxes.append(inside)
        labels.append(label)
        instance_mask[mine] = len(boxes)
    return replace(
        picture,
        instance_mask=instance_mask,
        boxes=np.array(boxes, dtype=np.float32).reshape(-1, 4),
        labels=np.array(labels, dtype=np.int64),
    )
