"""What numbers say of what a camera sees, be the picture rendered or cast.

A *body map* (h, w) int32 holds for each pixel the index of the rigid body it shows, ``NOTHING`` or
``TABLE``. Bodies are counted in the order: parts of the first object, parts of the others one
object after another, links of the robot.

A *part mask* (h, w) uint8 is what observations and samples hold: ``BACKGROUND`` for the table and
for nothing, 1 + part index for the first object, further objects' parts counting on from there,
and ``ROBOT`` for all links of the robot.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from artgym.errors import InvalidArgumentError

#: In a body map: no body, and the table.
NOTHING, TABLE = -1, -2
#: In a part mask: neither an object nor the robot, and the robot.
BACKGROUND, ROBOT = 0, 255


@dataclass(frozen=True, kw_only=True)
class MaskCodes:
    """The numbers of a part mask.

    Attributes:
        num_parts: of each object, bases included.

    Raises:
        InvalidArgumentError: more parts than uint8 has numbers for.
    """

    num_parts: tuple[int, ...]

    def __post_init__(self) -> None:
        if sum(self.num_parts) >= ROBOT:
            raise InvalidArgumentError(
                f"objects of {self.num_parts} parts: a part mask tells {ROBOT - 1} apart in all"
            )

    def code(self, part: int, obj: int = 0) -> int:
        """The number of a part of an object, both counted from 0.

        >>> MaskCodes(num_parts=(3, 2)).code(1, obj=1)
        5
        """
        return 1 + sum(self.num_parts[:obj]) + part

    def mask_from_bodies(self, body: NDArray[np.int32]) -> NDArray[np.uint8]:
        """Part mask of a body map, or labels of points, of any shape.

        >>> codes = MaskCodes(num_parts=(3, 2))
        >>> codes.mask_from_bodies(np.array([NOTHING, TABLE, 0, 4, 5, 7])).tolist()
        [0, 0, 1, 5, 255, 255]
        """
        total = sum(self.num_parts)
        codes = np.empty(total + 3, dtype=np.uint8)
        codes[:total] = np.arange(1, total + 1)
        codes[total] = ROBOT
        # Negative numbers count from the end.
        codes[[NOTHING, TABLE]] = BACKGROUND
        return codes[np.minimum(body, total)]
