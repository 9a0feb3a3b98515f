"""The Panda hand's shape.

The hand's frame is ``panda_hand`` of the Franka description: z is the approach direction, y the
closing direction. Its collision shapes are boxes; ``HAND_BOXES`` is their only definition.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from artgym.geometry import transforms
from artgym.geometry.grasps import T_GRASP_TCP
from artgym.geometry.rotations import matrix_from_axis_angle

Array = NDArray[np.floating]


@dataclass(frozen=True, kw_only=True)
class HandBox:
    """One collision cuboid of the hand.

    Attributes:
        link: "hand", "left" (moves along +y) or "right" (moves along -y).
        half_size: metres.
        center: in the frame of its link; a closed finger's origin lies at ``FINGER_ORIGIN``.
        tilt: turn about the link's x axis, radians.
    """

    link: str
    half_size: tuple[float, float, float]
    center: tuple[float, float, float]
    tilt: float = 0.0

    @property
    def T_link_box(self) -> Array:
        """Pose (4, 4) of the box in its link."""
        return transforms.transform_from(matrix_from_axis_angle([self.tilt, 0.0, 0.0]), self.center)


def _finger_boxes(link: str, side: float) -> tuple[HandBox, ...]:
    """Mount, slide, shank and rubber pad of one finger; ``side`` is the sign of y."""
    return (
        HandBox(link=link, half_size=(0.011, 0.0075, 0.010), center=(0, side * 0.0185, 0.011)),
        HandBox(link=link, half_size=(0.011, 0.0044, 0.0019), center=(0, side * 0.0068, 0.0022)),
        HandBox(
            link=link,
            half_size=(0.00875, 0.0035, 0.01175),
            center=(0, side * 0.0159, 0.02835),
            tilt=side * np.pi / 6,
        ),
        HandBox(
            link=link, half_size=(0.00875, 0.0076, 0.00925), center=(0, side * 0.0076, 0.04525)
        ),
    )


#: Where a finger's frame lies in the hand's when the jaws are closed, metres along z.
FINGER_ORIGIN = 0.0584
#: Largest travel of one finger; the jaws open to twice this, metres.
FINGER_TRAVEL = 0.04
#: The tool centre point, the middle of the pads, metres along z.
TCP = 0.1034

HAND_BOXES: tuple[HandBox, ...] = (
    HandBox(link="hand", half_size=(0.0316, 0.1025, 0.033), center=(0, 0, 0.033)),
    *_finger_boxes("left", 1.0),
    *_finger_boxes("right", -1.0),
)

T_hand_tcp: Array = transforms.translation([0.0, 0.0, TCP])
T_hand_grasp: Array = T_hand_tcp @ transforms.invert(T_GRASP_TCP)


def open_hand_boxes() -> tuple[Array, Array, Array]:
    """The open hand in the frame of the grasp that it takes.

    Returns:
        Rotations (b, 3, 3), centres (b, 3) and half sizes (b, 3) of its boxes, metres.
    """
    T_grasp_hand = transforms.invert(T_hand_grasp)
    offsets = {
        "hand": (0.0, 0.0, 0.0),
        "left": (0.0, FINGER_TRAVEL, FINGER_ORIGIN),
        "right": (0.0, -FINGER_TRAVEL, FINGER_ORIGIN),
    }
    T = np.stack(
        [T_grasp_hand @ transforms.translation(offsets[b.link]) @ b.T_link_box for b in HAND_BOXES]
    )
    return T[:, :3, :3], T[:, :3, 3], np.array([b.half_size for b in HAND_BOXES])
