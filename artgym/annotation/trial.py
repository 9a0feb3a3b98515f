"""One attempt at one grasp in physics.

The hand comes straight along the approach, closes, and carries the part along its joint. The
attempt succeeds if the part moves through half its range held between the fingers
(``tasks.success``: ``success_gripped``), provided that the open hand took the grasp's pose without
being pushed away and without pushing any part.

An attempt waits for nothing that rests and stops as soon as its outcome is known; ``REFERENCE``
does neither, steps more finely and solves contacts more exactly: the slow judge of what is done
here fast.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from artgym.errors import InvalidArgumentError
from artgym.geometry import transforms
from artgym.geometry.hand import T_hand_grasp
from artgym.objects.model import ArticulatedObject
from artgym.sim.contact import PartContact
from artgym.sim.conversion import pose_from_transform, poses_from_transforms
from artgym.sim.scene import ManipulationScene, PhysicsConfig
from artgym.tasks.success import TRAVEL_THRESHOLD, Progress

Array = NDArray[np.floating]

_T_GRASP_HAND = transforms.invert(T_hand_grasp)


#: The cheapest settings that keep the outcomes of ``REFERENCE`` (``benchmarks.speed labels``).
_FAST = PhysicsConfig(timestep=1.0 / 240.0, contact_offset=0.003)


@dataclass(frozen=True, kw_only=True)
class TrialConfig:
    """How an attempt is carried out.

    Attributes:
        physics: time step of the approach and of the carrying, iterations, gains.
        close_timestep: seconds of a step while the jaws close, where contacts are hardest.
        standoff: where the hand starts, metres before the grasp along the approach.
        speed: of the hand, m/s, in the approach and along the joint.
        close_time: seconds given to the jaws.
        settle_time: seconds of rest after the approach and after the motion.
        rest: the open hand and the jaws are not waited for any longer once they are slower than
            this, m/s; at 0 they are given all their time.
        overshoot: share of the range the hand goes beyond half of it, against the lag of its
            spring.
        miss: how far from the grasp pose the open hand may come to rest, metres.
        nudge: how far the approach may move a part, as a share of its range.
        look_time: seconds between two looks at the contacts, a whole number of steps.
        early_stop: whether an attempt ends as soon as it cannot succeed any more.
        slip_time: seconds without touching the part after which an early stop calls it lost.
    """

    physics: PhysicsConfig = _FAST
    close_timestep: float = 1.0 / 480.0
    standoff: float = 0.06
    speed: float = 0.4
    close_time: float = 0.2
    settle_time: float = 0.1
    rest: float = 0.01
    overshoot: float = 0.1
    miss: float = 0.003
    nudge: float = 0.01
    look_time: float = 1.0 / 120.0
    early_stop: bool = True
    slip_time: float = 0.1

    def __post_init__(self) -> None:
        for step in (self.physics.timestep, self.close_timestep):
            steps = self.look_time / step if step > 0 else 0.0
            if steps < 0.5 or abs(steps - round(steps)) > 1e-6 * steps:
                raise InvalidArgumentError(
                    f"look_time={self.look_time} with steps of {step} s: expected a whole number "
                    "of steps, one or more."
                )


#: The judge of the fast settings: fine steps all the way, three times the iterations, contacts
#: known from far, all rests waited out, no early stop.
REFERENCE = TrialConfig(
    physics=PhysicsConfig(timestep=1.0 / 480.0, position_iterations=50),
    rest=0.0,
    early_stop=False,
)

#: How an attempt ends: the part "moved" through half its range, gripped or not; the hand was at the
#: end of its way and the part had "not moved" so far; the open hand was "blocked": it could not
#: take the pose without pushing a part or being pushed away; the jaws closed on something else or
#: nothing and stayed "empty"; the part was "lost": it moved too far ungripped, or slipped away.
TRIAL_ENDS = ("moved", "not moved", "blocked", "empty", "lost")


@dataclass(frozen=True, kw_only=True)
class Trial:
    """How an attempt ended.

    Attributes:
        success: the part moved through half its range, gripped.
        progress: the joint's motion.
        end: one of ``TRIAL_ENDS``.
    """

    success: bool
    progress: Progress
    end: str


def try_grasp(
    obj: ArticulatedObject,
    q: Array,
    part: int,
    T_object_grasp: Array,
    config: TrialConfig = TrialConfig(),
    *,
    T_object_base: Array | None = None,
) -> Trial:
    """Tries one grasp of a part, the object standing on a table.

    The part is moved in whichever direction has half the range left.

    Args:
        obj: the object.
        q: its joint positions at the start.
        part: index of the part to move.
        T_object_grasp: the grasp's pose (4, 4) in the object's frame.
        config: how to try.
        T_object_base: where the base of the arm stands that carries the hand, (4, 4); without it
            the hand floats.

    Raises:
        InvalidArgumentError: the arm cannot bring the hand to where the approach begins.
    """
    T_object_hand = T_object_grasp @ _T_GRASP_HAND
    approach = _approach_path(T_object_hand, config)
    scene = ManipulationScene(
        obj,
        np.eye(4),
        q,
        T_world_hand=approach[0],
        T_world_base=T_object_base,
        config=config.physics,
    )
    attempt = _Attempt(scene, obj, part, q, config)
    try:
        end = attempt.run(approach, lambda: _carry_path(obj, q, part, T_object_hand, config))
    finally:
        scene.close()
    return Trial(
        success=end == "moved" and bool(attempt.progress.success_gripped),
        progress=attempt.progress,
        end=end,
    )


class _Attempt:
    """The course of an attempt in its scene."""

    def __init__(
        self,
        scene: ManipulationScene,
        obj: ArticulatedObject,
        part: int,
        q: Array,
        config: TrialConfig,
    ) -> None:
        assert scene.hand is not None
        self._scene, self._hand = scene, scene.hand
        self._part, self._config = part, config
        self._closed_and_range = [(joint.closed, joint.range) for joint in obj.joints]
        #: Open fraction of each part, at the start and now.
        self._start = self._now = self._fractions(map(float, q))
        self.progress = Progress.begin(self._start[part - 1])
        #: Simulator steps between two looks.
        self._stride = 1
        #: Looks since the part was last touched.
        self._untouched = 0

    def run(self, approach: Array, carry: Callable[[], Array]) -> str:
        """One of ``TRIAL_ENDS``.

        Args:
            approach: the hand's poses (n, 4, 4) before the jaws close.
            carry: gives those after.
        """
        config = self._config
        self._set_timestep(config.physics.timestep)
        blocked = self._approach_is_blocked(approach)
        if blocked and config.early_stop:
            return "blocked"
        self._set_timestep(config.close_timestep)
        end = self._close()
        if end is None:
            self._set_timestep(config.physics.timestep)
            end = self._carry(carry())
        return "blocked" if blocked else end

    def _approach_is_blocked(self, approach: Array) -> bool:
        """Brings the open hand to the grasp: whether it was pushed away, or pushed a part."""
        config = self._config
        self._advance(1)
        blocked = self._misses(approach[0])
        target = pose_from_transform(approach[0])
        for position in approach[1:, :3, 3]:
            if blocked and config.early_stop:
                return True
            target.p = position
            self._hand.pull_to(target)
            self._advance(self._stride)
            blocked |= self._has_pushed()
        for _ in range(self._looks(config.settle_time)):
            if blocked and config.early_stop:
                return True
            self._advance(self._stride)
            blocked |= self._has_pushed()
            if math.hypot(*self._hand.linear_velocity()) < config.rest:
                break
        return blocked or self._misses(approach[-1])

    def _close(self) -> str | None:
        """Closes the jaws; how the attempt ends if it does so here."""
        config = self._config
        self._hand.close_jaws()
        width = self._hand.width()
        for _ in range(self._looks(config.close_time)):
            self._advance(self._stride, look=True)
            if config.early_stop and self.progress.gripped_is_lost:
                return "lost"
            before, width = width, self._hand.width()
            if abs(width - before) < config.rest * config.look_time:
                break
        return "empty" if config.early_stop and self._is_out_of_touch() else None

    def _carry(self, path: Array) -> str:
        """Takes the hand along the poses (n, 4, 4)."""
        config = self._config
        resting = [None] * self._looks(config.settle_time)
        for target in (*poses_from_transforms(path), *resting):
            if target is not None:
                self._hand.pull_to(target)
            self._advance(self._stride, look=True)
            if self.progress.travel >= TRAVEL_THRESHOLD:
                return "moved"
            if config.early_stop and (self._is_out_of_touch() or self.progress.gripped_is_lost):
                return "lost"
        return "not moved"

    def _set_timestep(self, seconds: float) -> None:
        self._scene.set_timestep(seconds)
        self._stride = round(self._config.look_time / seconds)

    def _looks(self, seconds: float) -> int:
        return max(1, round(seconds / self._config.look_time))

    def _fractions(self, q: Iterable[float]) -> list[float]:
        return [
            (position - closed) / reach
            for position, (closed, reach) in zip(q, self._closed_and_range, strict=True)
        ]

    def _advance(self, steps: int, *, look: bool = False) -> None:
        """Steps, and adds the part's motion; an open hand's contacts are not looked at."""
        self._scene.step(steps)
        contact = self._scene.contact(self._part) if look else PartContact(False, False)
        self._now = self._fractions(self._scene.body.positions().tolist())
        self.progress = self.progress.advance(
            self._now[self._part - 1], contact.touched, contact.pinched
        )
        self._untouched = 0 if contact.touched else self._untouched + 1

    def _is_out_of_touch(self) -> bool:
        return self._untouched >= self._looks(self._config.slip_time)

    def _misses(self, T_world_hand: Array) -> bool:
        offset = self._hand.pose()[:3, 3] - T_world_hand[:3, 3]
        return bool(np.linalg.norm(offset) > self._config.miss)

    def _has_pushed(self) -> bool:
        nudge = self._config.nudge
        return self.progress.path > nudge or any(
            abs(now - start) > nudge for now, start in zip(self._now, self._start, strict=True)
        )


def _approach_path(T_object_hand: Array, config: TrialConfig) -> Array:
    """Hand poses (n, 4, 4), one a look, from the standoff to the pose itself."""
    count = int(np.ceil(config.standoff / (config.speed * config.look_time)))
    back = np.linspace(config.standoff, 0.0, count + 1)[:, None] * [0.0, 0.0, -1.0]
    return T_object_hand @ transforms.translation(back)


def _carry_path(
    obj: ArticulatedObject, q: Array, part: int, T_object_hand: Array, config: TrialConfig
) -> Array:
    """Hand poses (n, 4, 4), one a look, that move with the part through half its range."""
    joint = obj.joint_of(part)
    start = float(joint.open_fraction(q[part - 1]))
    goal = start + (TRAVEL_THRESHOLD + config.overshoot) * (1.0 if start <= 0.5 else -1.0)
    T_now_rest = transforms.invert(joint.motion(q[part - 1]))

    def hand_at(fractions: Array) -> Array:
        return joint.motion(joint.position(fractions)) @ T_now_rest @ T_object_hand

    coarse = hand_at(np.linspace(start, goal, 9))
    length = np.linalg.norm(np.diff(coarse[:, :3, 3], axis=0), axis=1).sum()
    count = max(2, int(np.ceil(length / (config.speed * config.look_time))))
    return hand_at(np.linspace(start, goal, count + 1)[1:])
