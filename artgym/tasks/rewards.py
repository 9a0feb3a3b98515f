"""Rewards in [0, 1], as pure functions of state; each term is reported in ``info``."""

from __future__ import annotations

import math
from typing import Literal

from artgym.tasks.success import TRAVEL_THRESHOLD, Progress

RewardMode = Literal["dense", "sparse"]

#: Weights of the dense terms; they add up to one.
REACH, GRIP, MOVE = 0.2, 0.2, 0.6

#: Distance at which the reach term has fallen to about a quarter, metres.
REACH_SCALE = 0.2


def dense_terms(
    distance: float, pinched: bool, progress: Progress, direction: float
) -> dict[str, float]:
    """The terms of the dense reward.

    Args:
        distance: from the tool centre to the part's grip point, metres.
        pinched: the part is between the fingers now.
        progress: the joint's motion; only motion made in contact counts.
        direction: 1 to open, -1 to close.
    """
    moved = min(max(float(progress.headway(direction)) / TRAVEL_THRESHOLD, 0.0), 1.0)
    return {
        "reach": REACH * (1.0 - math.tanh(distance / REACH_SCALE)),
        "grip": GRIP * float(pinched),
        "move": MOVE * moved * float(progress.engaged),
    }


def reward(mode: RewardMode, terms: dict[str, float], progress: Progress) -> float:
    """The sum of the dense terms, or 1 in success and else 0."""
    if mode == "sparse":
        return float(progress.success)
    return sum(terms.values())
