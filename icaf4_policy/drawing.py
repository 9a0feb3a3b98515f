"""Image files in, pictures of predictions out."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw

from artgym.datasets.drawing import PART_COLORS, draw_line, hand_lines
from artgym.errors import DamagedFileError, InvalidArgumentError
from artgym.geometry.camera import project
from artgym.geometry.transforms import transform_from
from icaf4_policy.prediction import Prediction

_AXIS_COLOR, _BEST_COLOR, _GRASP_COLOR = (255, 255, 0), (0, 255, 0), (0, 170, 220)
#: Half the length of a drawn axis, metres.
_AXIS_HALF_LENGTH = 0.1


def _read(path: Path) -> Image.Image:
    try:
        with Image.open(path) as image:
            image.load()
            return image
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise DamagedFileError(f"{path} cannot be read as an image ({error}).") from error


def read_rgb(path: Path) -> NDArray[np.uint8]:
    """A colour image, uint8 (H, W, 3)."""
    return np.asarray(_read(path).convert("RGB"))


def read_depth(path: Path, depth_unit_m: float) -> NDArray[np.float32]:
    """Depth (H, W) in metres from a one-channel image in ``depth_unit_m``, or .npy in metres."""
    if path.suffix == ".npy":
        try:
            return np.load(path, allow_pickle=False).astype(np.float32)
        except (OSError, ValueError, EOFError) as error:
            raise DamagedFileError(f"{path} cannot be read as an array ({error}).") from error
    image = np.asarray(_read(path))
    if image.ndim != 2:
        raise InvalidArgumentError(
            f"depth={str(path)!r} has shape {image.shape}: expected an image with one channel."
        )
    return image.astype(np.float32) * np.float32(depth_unit_m)


def read_intrinsics(path: Path) -> NDArray[np.float64]:
    """A 3x3 camera matrix from a JSON or whitespace-separated text file."""
    try:
        text = path.read_text(encoding="utf-8")
        values = json.loads(text) if path.suffix == ".json" else text.split()
        matrix = np.array(values, dtype=float).reshape(3, 3)
    except (OSError, ValueError, TypeError) as error:
        raise DamagedFileError(f"{path} does not hold a 3x3 camera matrix ({error}).") from error
    if not np.isfinite(matrix).all() or matrix[0, 0] <= 0 or matrix[1, 1] <= 0:
        raise InvalidArgumentError(
            f"intrinsics={str(path)!r} holds {matrix.tolist()}: expected finite numbers and "
            "positive focal lengths."
        )
    return matrix


def write_image(path: Path, image: NDArray[np.uint8]) -> None:
    """Writes a colour image; its format follows from the name's ending."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(image).save(path)
    except (OSError, ValueError) as error:
        raise InvalidArgumentError(f"picture={str(path)!r} cannot be written ({error}).") from error


def draw_predictions(
    rgb: ArrayLike, intrinsics: ArrayLike, predictions: Sequence[Prediction], num_grasps: int
) -> NDArray[np.uint8]:
    """Three panels side by side: parts, affordance, best grasps and joint axes.

    Args:
        rgb: uint8 (H, W, 3), the image that was looked at.
        intrinsics: (3, 3).
        predictions: what is drawn, an object each.
        num_grasps: how many of the proposals of each.

    Returns:
        uint8 (H, 3 W, 3). The best grasp of an object is green, joint axes are yellow.
    """
    rgb = np.asarray(rgb, dtype=np.uint8)
    panels = [Image.fromarray(rgb // 2) for _ in range(3)]
    drawn = [ImageDraw.Draw(panel) for panel in panels]
    for prediction in predictions:
        _draw(drawn, np.asarray(intrinsics), prediction, num_grasps, max(1, rgb.shape[1] // 200))
    return np.concatenate([np.asarray(panel) for panel in panels], axis=1)


def _draw(
    panels: Sequence[ImageDraw.ImageDraw],
    intrinsics: NDArray[np.floating],
    prediction: Prediction,
    num_grasps: int,
    width: int,
) -> None:
    """One object into the three panels."""
    parts, affordance, grasps = panels
    corners = project(prediction.points_camera, intrinsics)
    for (u, v), part, value in zip(
        corners.tolist(), prediction.part, prediction.affordance, strict=True
    ):
        dot = (u - width, v - width, u + width, v + width)
        parts.ellipse(dot, fill=PART_COLORS[part % len(PART_COLORS)])
        affordance.ellipse(dot, fill=(int(255 * value), 60, int(255 * (1 - value))))
    for joint in prediction.joints:
        if np.any(joint.axis_camera):
            reach = np.array([[-_AXIS_HALF_LENGTH], [_AXIS_HALF_LENGTH]]) * joint.axis_camera
            draw_line(grasps, joint.pivot_camera + reach, intrinsics, _AXIS_COLOR, width)
    proposals = prediction.grasps
    for i in reversed(range(min(num_grasps, len(proposals.scores)))):
        T_camera_grasp = transform_from(proposals.R_camera_grasp[i], proposals.points_camera[i])
        for line in hand_lines(T_camera_grasp):
            draw_line(grasps, line, intrinsics, _GRASP_COLOR if i else _BEST_COLOR, width)
