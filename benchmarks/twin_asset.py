"""What ``benchmarks.maniskill_twin`` is told of an object, as a file.

Objects are written by a process that has our packages and read by one that has not: ManiSkill is
measured without them.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

Vector = tuple[float, ...]

#: Episodes of ours from which the twin's starts are taken.
_STARTS = 8


@dataclass(frozen=True, kw_only=True)
class TwinAsset:
    """The URDF of an object, and what its task needs to know besides.

    Attributes:
        object_id: as in our catalogue.
        urdf: path of the exported file; joint positions in it are ours.
        part_name: link of the target part.
        joint_index: of the target part's joint among the object's.
        is_revolute: whether that joint turns.
        axis, pivot: of that joint, in the object's frame, metres.
        closed, open: ends of its range, metres or radians.
        grip_point: in the part's frame of the URDF, metres.
        part_size: extents, metres.
        frictions: dry friction of each joint, N or N m.
        slips: speed at which a joint that friction holds creeps, metres or radians a second.
        rest: joint positions at rest.
        start: interval of the target's joint position at the start, as in some episodes of ours.
        hand_start: lowest and highest position of the tool centre at the start, likewise, metres.
        placement: largest turn (radians) and shift (metres) of the object, likewise.
        table_half_size: metres; the table's surface is z = 0.
    """

    object_id: str
    urdf: str
    part_name: str
    joint_index: int
    is_revolute: bool
    axis: Vector
    pivot: Vector
    closed: float
    open: float
    grip_point: Vector
    part_size: Vector
    frictions: Vector
    slips: Vector
    rest: Vector
    start: Vector
    hand_start: tuple[Vector, Vector]
    placement: Vector
    table_half_size: Vector

    @classmethod
    def load(cls, file: str | Path) -> TwinAsset:
        """Reads what ``write`` wrote."""
        return cls(**json.loads(Path(file).read_text(encoding="utf-8")))


def write(object_id: str, folder: Path, part: int = 1) -> Path:
    """Exports an object of the catalogue for the twin.

    Args:
        object_id: of the object.
        folder: gets the URDF and its meshes, and the file beside them.
        part: the target.

    Returns:
        The file.
    """
    import gymnasium
    import numpy as np

    import artgym  # noqa: F401 registers the environment
    from artgym.objects.urdf_export import link_origins, write_urdf
    from artgym.sim.scene import JOINT_CREEP, TABLE_HALF_SIZE

    env = gymnasium.make("ArtOpen-v0", objects=(object_id,), target_part=part)
    inner: Any = env.unwrapped
    hands, placements, starts = [], [], []
    for seed in range(_STARTS):
        env.reset(seed=seed)
        hands.append(inner.tcp_pose()[:3, 3])
        (c, *_), (s, *_), *_ = T_world_object = inner.T_world_object
        placements.append([abs(np.arctan2(s, c)), np.abs(T_world_object[:2, 3]).max()])
        starts.append(inner.joint_positions()[part - 1])
    obj = inner.object
    env.close()
    joint, link = obj.joint_of(part), obj.links[part]
    urdf = write_urdf(obj, folder)
    asset = TwinAsset(
        object_id=object_id,
        urdf=str(urdf),
        part_name=link.name,
        joint_index=part - 1,
        is_revolute=joint.type == "revolute",
        axis=_vector(joint.axis),
        pivot=_vector(joint.pivot),
        closed=float(joint.closed),
        open=float(joint.open),
        grip_point=_vector(obj.grip_point(part) - link_origins(obj)[link.name]),
        part_size=_vector(np.ptp(link.bounds(), axis=0)),
        frictions=_vector([each.friction for each in obj.joints]),
        slips=_vector([JOINT_CREEP * abs(each.range) for each in obj.joints]),
        rest=_vector(obj.rest_positions),
        start=_vector([min(starts), max(starts)]),
        hand_start=(_vector(np.min(hands, axis=0)), _vector(np.max(hands, axis=0))),
        placement=_vector(np.max(placements, axis=0)),
        table_half_size=_vector(TABLE_HALF_SIZE),
    )
    file = urdf.with_suffix(".twin.json")
    file.write_text(json.dumps(asdict(asset)), encoding="utf-8")
    return file


def _vector(numbers: object) -> Vector:
    return tuple(float(x) for x in numbers)  # type: ignore[attr-defined]
