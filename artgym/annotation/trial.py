"""One attempt at one grasp in physics.

The hand comes straight along the approach, closes, and carries the part along its joint. The
attempt succeeds if the part moves through half its range held between the fingers
(``tasks.success``: ``success_gripped``).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from artgym.geometry import transforms
from artgym.objects.model import ArticulatedObject
from artgym.sim.conversion import poses_from_transforms
from artgym.sim.robots import T_hand_grasp
from artgym.sim.scene import ManipulationScene, PhysicsConfig
from artgym.tasks.success import TRAVEL_THRESHOLD, Progress

Array = NDArray[np.floating]

#: Joint creep during a trial, see ``sim.scene.JOINT_CREEP``. An attempt takes about a second, in
#: which this is nothing; the shipped labels were made with it, and their bits depend on it.
_JOINT_CREEP = 1e-4

_T_GRASP_HAND = transforms.invert(T_hand_grasp)


@dataclass(frozen=True, kw_only=True)
class TrialConfig:
    """How an attempt is carried out.

    Attributes:
        physics: time step, iterations, gains.
        standoff: where the hand starts, metres before the grasp along the approach.
        speed: of the hand, m/s, in the approach and along the joint.
        close_time: seconds given to the jaws.
        settle_time: seconds of rest after the approach and after the motion.
        empty_width: jaws narrower than this hold nothing, metres.
        overshoot: share of the range the hand goes beyond half of it, against the lag of its
            spring.
        miss: how far from the grasp pose the open hand may come to rest, metres.
        nudge: how far the approach may move the part, as a share of its range.
        stride: simulator steps between two looks at the contacts.
    """

    physics: PhysicsConfig = field(default_factory=PhysicsConfig)
    standoff: float = 0.06
    speed: float = 0.4
    close_time: float = 0.2
    settle_time: float = 0.1
    empty_width: float = 0.001
    overshoot: float = 0.1
    miss: float = 0.003
    nudge: float = 0.01
    stride: int = 4


@dataclass(frozen=True, kw_only=True)
class Trial:
    """How an attempt ended.

    Attributes:
        success: the part moved through half its range, gripped.
        progress: the joint's motion.
        end: "moved", "not moved", "blocked" (the open hand could not take the pose without
            pushing the part or being pushed away) or "empty" (the jaws closed on nothing).
        steps: simulator steps spent.
    """

    success: bool
    progress: Progress
    end: str
    steps: int


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
    joint = obj.joint_of(part)
    stride = config.stride
    tick = config.physics.timestep * stride
    T_object_hand = T_object_grasp @ _T_GRASP_HAND
    approach = _approach_path(T_object_hand, config.standoff, config.speed * tick)
    scene = ManipulationScene(
        obj,
        np.eye(4),
        q,
        T_world_hand=approach[0],
        T_world_base=T_object_base,
        config=config.physics,
        joint_creep=_JOINT_CREEP,
    )
    hand = scene.hand
    assert hand is not None
    progress = Progress.begin(float(joint.open_fraction(q[part - 1])))
    steps = 0

    def advance(count: int = stride) -> None:
        nonlocal steps, progress
        scene.step(count)
        steps += count
        contact = scene.contact(part)
        fraction = float(joint.open_fraction(scene.body.positions()[part - 1]))
        progress = progress.advance(fraction, contact.touched, contact.pinched)

    def finish(end: str) -> Trial:
        scene.close()
        return Trial(
            success=end == "moved" and bool(progress.success_gripped),
            progress=progress,
            end=end,
            steps=steps,
        )

    def misses(T_world_hand: Array) -> bool:
        return bool(np.linalg.norm(hand.pose()[:3, 3] - T_world_hand[:3, 3]) > config.miss)

    def rest(seconds: float) -> Iterator[None]:
        for _ in range(max(1, round(seconds / tick))):
            advance()
            yield

    advance(1)
    if misses(approach[0]):
        return finish("blocked")
    for target in poses_from_transforms(approach[1:]):
        hand.pull_to(target)
        advance()
    for _ in rest(config.settle_time):
        pass
    if misses(T_object_hand) or progress.path > config.nudge:
        return finish("blocked")
    hand.close_jaws()
    for _ in rest(config.close_time):
        pass
    if hand.width() < config.empty_width:
        return finish("empty")
    for target in poses_from_transforms(_carry_path(obj, q, part, T_object_hand, config)):
        hand.pull_to(target)
        advance()
        if progress.travel >= TRAVEL_THRESHOLD:
            return finish("moved")
    for _ in rest(config.settle_time):
        if progress.travel >= TRAVEL_THRESHOLD:
            return finish("moved")
    return finish("not moved")


def _approach_path(T_object_hand: Array, standoff: float, step: float) -> Array:
    """Hand poses (n, 4, 4) from ``standoff`` metres before the pose to the pose itself."""
    count = int(np.ceil(standoff / step))
    back = np.linspace(standoff, 0.0, count + 1)[:, None] * [0.0, 0.0, -1.0]
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
    tick = config.physics.timestep * config.stride
    count = max(2, int(np.ceil(length / (config.speed * tick))))
    return hand_at(np.linspace(start, goal, count + 1)[1:])
