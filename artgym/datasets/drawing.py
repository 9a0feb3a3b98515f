"""What is drawn over pictures of labels and of predictions: parts, lines, hands at grasps."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import ImageDraw

from artgym.control import MAX_WIDTH
from artgym.geometry import transforms
from artgym.geometry.camera import project
from artgym.geometry.grasps import GRASP_DEPTH

Array = NDArray[np.floating]
Color = tuple[int, int, int]

#: Colours of the parts in their order, RGB; they repeat beyond the last.
PART_COLORS: tuple[Color, ...] = (
    (90, 130, 200),
    (240, 160, 60),
    (110, 190, 110),
    (200, 90, 160),
    (150, 120, 90),
)
#: How far a drawn hand goes back from the palm, metres.
_STEM = 0.06
#: What comes nearer to the camera's plane is not drawn, metres.
_NEAREST = 0.01


def hand_lines(T_a_grasp: ArrayLike) -> tuple[Array, Array]:
    """An open hand at a grasp, as two lines in frame a: the jaws (4, 3) and the stem (2, 3)."""
    y, tip, palm = MAX_WIDTH / 2, GRASP_DEPTH, -GRASP_DEPTH
    jaws = [[0.0, -y, tip], [0.0, -y, palm], [0.0, y, palm], [0.0, y, tip]]
    stem = [[0.0, 0.0, palm], [0.0, 0.0, palm - _STEM]]
    return transforms.apply(T_a_grasp, jaws), transforms.apply(T_a_grasp, stem)


def draw_line(
    panel: ImageDraw.ImageDraw,
    points_camera: ArrayLike,
    intrinsics: ArrayLike,
    color: Color,
    width: int,
) -> None:
    """Draws a line through points (n, 3), metres; none that reaches behind the camera."""
    points_camera = np.asarray(points_camera)
    if points_camera[:, 2].min() > _NEAREST:
        corners = project(points_camera, intrinsics)
        panel.line([(u, v) for u, v in corners.tolist()], fill=color, width=width, joint="curve")
