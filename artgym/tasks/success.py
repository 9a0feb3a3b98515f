"""The rule of success, defined here and nowhere else.

``travel`` is how far the open fraction has come from its start. A share of the motion counts as
*engaged* while the hand touches the target part, and as *gripped* while the part is between the
fingers. Success needs half the range, four fifths of it engaged; a successful grasp needs four
fifths of it gripped (paper, Section 4: "grasp the target point and move the part through 50 % of
its motion range").

Everything is arithmetic on scalars, numpy arrays or torch tensors alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

#: Least travel of a success, as a share of the joint's range.
TRAVEL_THRESHOLD = 0.5
#: Least share of the motion made engaged (success) or gripped (successful grasp).
SHARE_THRESHOLD = 0.8
#: Travels reported in ``info["success_at"]``.
REPORTED_TRAVELS = (0.10, 0.25, 0.50, 0.75, 0.90)

_EPSILON = 1e-9


class Progress(NamedTuple):
    """How the target joint has moved since the start of an episode or a trial.

    Attributes:
        start: open fraction at the start.
        fraction: open fraction now.
        path: length of all motion so far, back and forth, in open fraction.
        engaged_path: the part of ``path`` made while the hand touched the target part.
        gripped_path: the part of ``path`` made with the target part between the fingers.
    """

    start: Any
    fraction: Any
    path: Any
    engaged_path: Any
    gripped_path: Any

    @classmethod
    def begin(cls, fraction: Any) -> Progress:
        """Nothing has moved yet."""
        zero = fraction * 0.0
        return cls(fraction, fraction, zero, zero, zero)

    def advance(self, fraction: Any, touched: Any, pinched: Any) -> Progress:
        """Adds the motion since the last call, credited by the contact at its end."""
        moved = abs(fraction - self.fraction)
        return Progress(
            self.start,
            fraction,
            self.path + moved,
            self.engaged_path + moved * touched,
            self.gripped_path + moved * pinched,
        )

    @property
    def travel(self) -> Any:
        """Distance from the start, as a share of the range."""
        return abs(self.fraction - self.start)

    def headway(self, direction: float) -> Any:
        """Distance from the start towards open (direction 1) or closed (-1); negative back."""
        return direction * (self.fraction - self.start)

    @property
    def engaged(self) -> Any:
        """Share of the motion made while touching the part; 0 before any motion."""
        return self.engaged_path / (self.path + _EPSILON)

    @property
    def gripped(self) -> Any:
        """Share of the motion made with the part between the fingers; 0 before any motion."""
        return self.gripped_path / (self.path + _EPSILON)

    def successes_at(self, travels: Sequence[float]) -> list[Any]:
        """Success with other thresholds on the travel, one each."""
        here, is_engaged = self.travel, self.engaged >= SHARE_THRESHOLD
        return [(here >= travel) & is_engaged for travel in travels]

    def success_at(self, travel: float) -> Any:
        """Success with another threshold on the travel."""
        return self.successes_at((travel,))[0]

    @property
    def success(self) -> Any:
        """Half the range, engaged."""
        return self.success_at(TRAVEL_THRESHOLD)

    @property
    def success_gripped(self) -> Any:
        """Half the range, gripped: the paper's successful grasp."""
        return (self.travel >= TRAVEL_THRESHOLD) & (self.gripped >= SHARE_THRESHOLD)

    @property
    def gripped_is_lost(self) -> Any:
        """Too much was moved ungripped: gripped and straight on, what is left cannot make up."""
        path = self.path + TRAVEL_THRESHOLD - self.travel
        return self.path - self.gripped_path > (1.0 - SHARE_THRESHOLD) * path + _EPSILON


def maniskill_success(progress: Progress, joint_speed: float) -> bool:
    """ManiSkill 3's rule for opening cabinets: 75 % of the range reached and nearly at rest.

    Contact plays no part in it. For comparison only.
    """
    return bool((progress.fraction >= 0.75) & (abs(joint_speed) < 0.5))


def where2act_success(progress: Progress, joint_range: float) -> bool:
    """Where2Act's rule: the joint moved by 0.01 (m or rad) or by half its range.

    For comparison only.
    """
    moved = progress.travel * abs(joint_range)
    return bool((moved > 0.01) | (progress.travel >= 0.5))
