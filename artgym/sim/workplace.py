"""Where an arm stands to open or to close a part, and where its hand starts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from artgym.errors import InvalidArgumentError
from artgym.geometry import transforms
from artgym.geometry.hand import T_hand_tcp
from artgym.geometry.rotations import frame_from_z
from artgym.objects.model import ArticulatedObject
from artgym.sim.kinematics import choose_base

Array = NDArray[np.floating]

#: Share of its range through which the arm shall be able to carry a part.
_CARRIED = 0.7
#: How far before the part, along its approach, the hand starts, metres; and how far beside.
_STANDOFF, _SPREAD = (0.18, 0.26), 0.04
#: Turns of the hand about its approach that are tried, radians.
_ROLLS = (0.0, np.pi / 2, np.pi / 4, -np.pi / 4)

_T_TCP_HAND = transforms.invert(T_hand_tcp)


def arm_workplace(
    obj: ArticulatedObject,
    T_world_object: Array,
    q: Array,
    part: int,
    direction: float,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """A place for an arm from which it can take a part where that is best taken and carry it.

    Which grasp it will be is not known: some that come against the way the part opens, or towards
    its axis, are tried, and the first for which there is a place counts. Those grasps close it too:
    from the other side the body is in the way.

    Args:
        obj: the object.
        T_world_object: its pose (4, 4).
        q: its joint positions at the start.
        part: index of the part to move.
        direction: 1 to open it, -1 to close it.
        rng: where the hand starts is drawn from it.

    Returns:
        ``T_world_base`` and ``T_world_hand`` (4, 4), the base and the hand at the start.

    Raises:
        InvalidArgumentError: there is no such place; the part's way is too long for an arm.
    """
    joint = obj.joint_of(part)
    T_world_part = T_world_object @ obj.link_poses(q)[part]
    start = joint.open_fraction(q[part - 1])
    end = np.clip(start + direction * _CARRIED, 0.0, 1.0)
    to_rest = transforms.invert(joint.motion(q[part - 1]))
    motions = joint.motion(joint.position(np.linspace(start, end, 6))) @ to_rest
    motions = T_world_object @ motions @ transforms.invert(T_world_object)
    point = transforms.apply(T_world_part, obj.grip_point(part)[None])[0]
    axis = T_world_object[:3, :3] @ np.asarray(joint.axis)
    way = np.sign(joint.range) * axis
    towards = [-way]
    if joint.type == "revolute":
        arm = point - transforms.apply(T_world_object, np.asarray(joint.pivot)[None])[0]
        arm -= (arm @ axis) * axis
        arm /= max(float(np.linalg.norm(arm)), 1e-9)
        way = np.cross(way, arm)
        towards = [-way, -(way + arm) / np.sqrt(2.0), -arm, (arm - way) / np.sqrt(2.0)]
    # And the same from above.
    lowered = [each - [0.0, 0.0, 1.0] for each in towards if each[2] > -0.9]
    towards += [each / np.linalg.norm(each) for each in lowered]
    bounds = _world_bounds(T_world_object, obj.bounds_at(q))
    standoff, beside = rng.uniform(*_STANDOFF), rng.uniform(-_SPREAD, _SPREAD, 3)
    for z in towards:
        for roll in _ROLLS:
            R = frame_from_z(z, roll)
            taken = transforms.transform_from(R, point) @ _T_TCP_HAND
            begun = transforms.transform_from(R, point - standoff * z + beside) @ _T_TCP_HAND
            try:
                base = choose_base(
                    np.concatenate([begun[None], motions @ taken]), object_bounds=bounds
                )
            except InvalidArgumentError:
                continue
            return base, begun
    raise InvalidArgumentError(
        f"{obj.object_id}: part {part} ({obj.links[part].name}) is out of an arm's reach on its "
        f'way from open fraction {start:.2f} to {end:.2f}: choose another object, or robot="hand".'
    )


def _world_bounds(T_world_object: Array, bounds: Array) -> Array:
    """The box (2, 3) in the world around a box in the object's frame."""
    corners = np.array(
        [[x, y, z] for x in bounds[:, 0] for y in bounds[:, 1] for z in bounds[:, 2]]
    )
    moved = transforms.apply(T_world_object, corners)
    return np.stack([moved.min(axis=0), moved.max(axis=0)])
