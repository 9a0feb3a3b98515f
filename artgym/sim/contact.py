"""The rule of contact: whether a hand touches a part, and whether it has it between its fingers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class PartContact:
    """How the hand touches a part at one instant.

    Attributes:
        touched: some link of the hand presses on the part.
        pinched: both fingers press on it, from opposite sides.
    """

    touched: bool
    pinched: bool


def part_contact(
    contacts: Iterable[Any],
    part: object,
    hand_links: Mapping[Any, int],
    closing: Callable[[], NDArray[np.floating]],
) -> PartContact:
    """How the hand touches a part, from the contacts of a simulator's step.

    Args:
        contacts: of the step, each with two ``bodies`` and ``points`` with an ``impulse`` (3,) on
            the first of them, N s, world frame.
        part: the part's body.
        hand_links: bodies of the hand: 0 the hand itself, 1 its left finger, 2 the right one.
        closing: gives the y axis (3,) of the hand in the world; asked only if needed.
    """
    touched, push = False, [0.0, 0.0, 0.0]
    across = None
    for contact in contacts:
        first, second = contact.bodies
        if first is part:
            link, sign = hand_links.get(second), -1.0
        elif second is part:
            link, sign = hand_links.get(first), 1.0
        else:
            continue
        if link is None:
            continue
        impulse = sum(point.impulse for point in contact.points)
        if not np.any(impulse):
            continue
        touched = True
        if across is None:
            across = closing()
        push[link] += sign * float(across @ impulse)
    # The part presses the left finger outwards along +y and the right one along -y.
    return PartContact(touched=touched, pinched=push[1] > 0.0 > push[2])
