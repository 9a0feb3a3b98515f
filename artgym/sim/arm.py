"""The Panda arm with the hand of ``robots``: construction and control.

Its links' collision shapes are the convex hulls of the description's collision meshes.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass, field

import numpy as np
import sapien
from numpy.typing import ArrayLike, NDArray
from sapien import physx

from artgym.errors import InvalidArgumentError
from artgym.geometry import transforms
from artgym.sim.conversion import pose_from_transform
from artgym.sim.kinematics import (
    ARM_LINKS,
    LIMIT_MARGIN,
    NUM_JOINTS,
    panda_chain,
    panda_description,
    solve,
)
from artgym.sim.robots import ROBOT_GROUPS, HandControl, PandaHand, mesh_visual, panda_meshes

Array = NDArray[np.floating]

SevenFloats = tuple[float, float, float, float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class ArmControl:
    """Gains of the springs in the arm's joints, and of its hand's fingers.

    The torque is what the robot's joints can give. The stiffness is near that of its own joint
    impedance control: a stiffer arm does not let the jaws centre themselves on what they grip.
    Damping over stiffness, in seconds, is how far the arm lags behind; with less of it, it
    overshoots.

    Attributes:
        stiffness: of each joint, N m/rad.
        damping: of each joint, N m s/rad.
        torque: most that each joint gives, N m.
        hand: gains of the fingers; the others are of no effect.
    """

    stiffness: SevenFloats = (4e3, 4e3, 4e3, 4e3, 2.5e3, 2.5e3, 2.5e3)
    damping: SevenFloats = (140.0, 140.0, 140.0, 140.0, 87.5, 87.5, 87.5)
    torque: SevenFloats = (87.0, 87.0, 87.0, 87.0, 12.0, 12.0, 12.0)
    hand: HandControl = field(default_factory=HandControl)


#: Half the length and the width of the column that a raised base stands on, and how far in front
#: of the column's middle the base's frame is, metres.
COLUMN_HALF_SIZE, COLUMN_OFFSET = (0.115, 0.1), 0.04

_FRICTION = 0.5
_COLUMN_COLOR = (0.25, 0.26, 0.28, 1.0)
# A revolute joint turns about the x axis of its frame: lay it along z.
_X_ALONG_Z = sapien.Pose(q=[np.sqrt(0.5), 0, -np.sqrt(0.5), 0])


class PandaArm(PandaHand):
    """A Panda on a fixed base, whose hand is pulled to a pose by the springs in its joints.

    A base above the table stands on a column.

    Args:
        scene: the scene it is built into.
        T_world_base: where ``panda_link0`` stands, (4, 4), upright; see ``choose_base``.
        T_world_hand: where the hand starts, (4, 4).
        width: opening of the jaws at the start, metres in [0, 0.08].
        visuals: whether to load what cameras see; needs the scene to have a renderer.
        control: gains.

    Attributes:
        links: the hand, the left and the right finger, ``panda_link0`` to ``panda_link7``.

    Raises:
        InvalidArgumentError: the hand cannot be at ``T_world_hand``.
    """

    def __init__(
        self,
        scene: sapien.Scene,
        T_world_base: Array,
        T_world_hand: Array,
        width: float,
        *,
        visuals: bool,
        control: ArmControl = ArmControl(),
    ) -> None:
        height = float(T_world_base[2, 3])
        T_base_world = transforms.invert(T_world_base)
        start = solve(T_base_world @ T_world_hand, floor=-height)
        if not start.reached:
            hand, base = T_world_hand[:3, 3].round(3), T_world_base[:3, 3].round(3)
            raise InvalidArgumentError(
                f"T_world_hand: the arm on its base at {base.tolist()} m comes no nearer to the "
                f"pose at {hand.tolist()} m than {start.position_error:.3f} m and "
                f"{start.rotation_error:.2f} rad; it reaches {panda_chain().radius:.2f} m from "
                "its shoulder: choose the base with choose_base"
            )
        chain = panda_chain()
        arm: list[physx.PhysxArticulationLinkComponent] = []
        entities = []
        for i, name in enumerate(ARM_LINKS):
            link = physx.PhysxArticulationLinkComponent(arm[-1] if arm else None)
            link.attach(_hull(name))
            link.name = name
            link.disable_gravity = True
            link.mass, moments, link.cmass_local_pose = _inertial(name)
            link.inertia = moments  # pyright: ignore[reportAttributeAccessIssue]
            joint = link.joint
            if i == 0:
                joint.type = "fixed"
            else:
                joint.type = "revolute_unwrapped"
                joint.pose_in_parent = _joint_pose(i - 1) * _X_ALONG_Z
                joint.pose_in_child = _X_ALONG_Z
                joint.limit = np.array([chain.lower[i - 1], chain.upper[i - 1]])
                joint.set_drive_property(
                    control.stiffness[i - 1], control.damping[i - 1], control.torque[i - 1]
                )
            entity = sapien.Entity()
            entity.name = name
            look = mesh_visual(name.removeprefix("panda_")) if visuals else None
            if i == 0 and height > 0.0:
                _add_column(link, look, height)
            entity.add_component(link)
            if look is not None:
                entity.add_component(look)
            arm.append(link)
            entities.append(entity)
        super().__init__(arm[-1], width, visuals=visuals, control=control.hand)
        self._hand.joint.type = "fixed"
        self._hand.joint.pose_in_parent = _joint_pose(NUM_JOINTS)
        entities[0].pose = pose_from_transform(T_world_base)
        for entity in (*entities, *self._hand_entities):
            scene.add_entity(entity)
        self._couple_jaws()
        self.links = (*self.links, *arm)
        self._joints = tuple(link.joint for link in arm[1:])
        self._base_from_world = pose_from_transform(T_base_world)
        self._articulation.qpos = np.concatenate([start.q, np.full(2, 0.5 * width)])
        self._drive_to(start.q)

    def pull_to(self, pose_world: sapien.Pose) -> None:
        """Sets where the springs pull the hand's frame to; out of reach, the pose nearest to it."""
        T_base_hand = (self._base_from_world * pose_world).to_transformation_matrix()
        self._drive_to(solve(T_base_hand, self._targets).q)

    def turn_joints(self, turns: ArrayLike) -> None:
        """Adds turns (7,), radians, to where the springs pull the joints to, inside their ranges.

        Raises:
            InvalidArgumentError: not seven finite numbers.
        """
        turns = np.asarray(turns, dtype=float)
        if turns.shape != (NUM_JOINTS,) or not np.isfinite(turns).all():
            raise InvalidArgumentError(f"turns: expected {NUM_JOINTS} finite numbers, got {turns}")
        chain = panda_chain()
        self._drive_to(
            np.clip(self._targets + turns, chain.lower + LIMIT_MARGIN, chain.upper - LIMIT_MARGIN)
        )

    def arm_positions(self) -> list[float]:
        """Of the seven joints, radians."""
        return self._articulation.qpos.tolist()[:NUM_JOINTS]

    def arm_velocities(self) -> list[float]:
        """Of the seven joints, rad/s."""
        return self._articulation.qvel.tolist()[:NUM_JOINTS]

    def _drive_to(self, q: Array) -> None:
        self._targets = q
        for joint, target in zip(self._joints, q.tolist(), strict=True):
            joint.set_drive_target(target)


@functools.cache
def _joint_pose(index: int) -> sapien.Pose:
    return pose_from_transform(panda_chain().frames[index])


@functools.cache
def _surface() -> physx.PhysxMaterial:
    return physx.PhysxMaterial(_FRICTION, _FRICTION, 0.0)


def _hull(name: str) -> physx.PhysxCollisionShapeConvexMesh:
    """The convex hull of a link; the simulator loads and cooks a file once a process."""
    file = panda_meshes().parent / "collision" / f"{name.removeprefix('panda_')}.stl"
    shape = physx.PhysxCollisionShapeConvexMesh(str(file), [1.0, 1.0, 1.0], _surface())
    shape.set_collision_groups(ROBOT_GROUPS)
    return shape


@functools.cache
def _inertial(name: str) -> tuple[float, Array, sapien.Pose]:
    """Mass, principal moments of inertia and their frame in the link."""
    (link,) = (each for each in panda_description().links if each.name == name)
    assert link.inertial is not None
    assert link.inertial.inertia is not None
    moments, axes = np.linalg.eigh(link.inertial.inertia)
    if np.linalg.det(axes) < 0:
        axes[:, 0] *= -1
    pose = pose_from_transform(transforms.transform_from(axes, link.inertial.center_of_mass))
    return link.inertial.mass, moments, pose


def _add_column(
    link: physx.PhysxArticulationLinkComponent,
    look: sapien.render.RenderBodyComponent | None,
    height: float,
) -> None:
    """Puts a column under the base, down to the table."""
    half_size = [*COLUMN_HALF_SIZE, 0.5 * height]
    shape = physx.PhysxCollisionShapeBox(half_size, _surface())
    shape.local_pose = sapien.Pose([-COLUMN_OFFSET, 0, -0.5 * height])
    shape.set_collision_groups(ROBOT_GROUPS)
    link.attach(shape)
    if look is not None:
        material = sapien.render.RenderMaterial(base_color=[*_COLUMN_COLOR], roughness=0.6)
        seen = sapien.render.RenderShapeBox(half_size, material)
        seen.local_pose = shape.local_pose
        look.attach(seen)
