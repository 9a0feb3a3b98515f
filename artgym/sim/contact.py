"""The rule of contact: whether a hand touches a part, and whether it has it between its fingers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, NamedTuple


class PartContact(NamedTuple):
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
    closing: Callable[[], Sequence[float]],
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
        x = y = z = 0.0
        for point in contact.points:
            a, b, c = point.impulse.tolist()
            x, y, z = x + a, y + b, z + c
        if x == y == z == 0.0:
            continue
        touched = True
        if across is None:
            across = closing()
        push[link] += sign * (across[0] * x + across[1] * y + across[2] * z)
    # The part presses the left finger outwards along +y and the right one along -y.
    return PartContact(touched=touched, pinched=push[1] > 0.0 > push[2])
