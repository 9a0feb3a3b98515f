"""The floating Panda hand: construction, control. Its shape is that of ``artgym.geometry.hand``."""

from __future__ import annotations

import functools
import importlib.util
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import sapien
from numpy.typing import NDArray
from sapien import physx

from artgym.errors import MissingDependencyError
from artgym.geometry import quaternions
from artgym.geometry.hand import FINGER_ORIGIN, FINGER_TRAVEL, HAND_BOXES, TCP, T_hand_tcp
from artgym.sim.conversion import pose_from_transform, transform_from_pose

Array = NDArray[np.floating]

#: A hand that floats, or one at the end of an arm that stands before the object.
RobotName = Literal["hand", "panda"]
#: How a robot is told to move; what each takes stands in ``envs.articulated_env.ArtOpenEnv``.
ControlMode = Literal["delta_pose", "delta_joint"]
CONTROL_MODES: dict[RobotName, tuple[ControlMode, ...]] = {
    "hand": ("delta_pose",),
    "panda": ("delta_pose", "delta_joint"),
}
#: Numbers in an action of each mode, the jaws included.
ACTION_SIZES: dict[ControlMode, int] = {"delta_pose": 7, "delta_joint": 8}


def tcp_from_hand(position: Sequence[float], quaternion: Sequence[float]) -> quaternions.Vector:
    """Where the tool centre of a hand at a pose is, metres; it has the hand's axes."""
    (x, y, z), (i, j, k) = position, quaternions.z_axis(quaternion)
    return x + TCP * i, y + TCP * j, z + TCP * k


def hand_from_tcp(position: Sequence[float], quaternion: Sequence[float]) -> sapien.Pose:
    """The hand's pose that brings its tool centre to a position, with axes as given."""
    (x, y, z), (i, j, k) = position, quaternions.z_axis(quaternion)
    return sapien.Pose([x - TCP * i, y - TCP * j, z - TCP * k], tuple(quaternion))


@dataclass(frozen=True, kw_only=True)
class HandControl:
    """Gains of the spring that pulls the hand, and of its fingers.

    Force limits are what an arm can give at its flange and what the Panda's jaws can give.
    """

    linear_stiffness: float = 4e3
    linear_damping: float = 1.2e2
    linear_force: float = 80.0
    angular_stiffness: float = 4e2
    angular_damping: float = 1.2e1
    angular_torque: float = 12.0
    finger_stiffness: float = 1e4
    finger_damping: float = 1e2
    finger_force: float = 35.0


_MASS = {"hand": 0.73, "left": 0.05, "right": 0.05}
_INERTIA = {
    "hand": (0.0025, 0.001, 0.0017),
    "left": (2e-5, 2e-5, 1e-5),
    "right": (2e-5, 2e-5, 1e-5),
}
_PAD_FRICTION = 1.2

#: Collision groups of a robot's shapes. They share a bit: none collides with another.
ROBOT_GROUPS = [1, 1, 1 << 1, 0]


class PandaHand:
    """A Panda hand: its links and jaws, whatever carries it.

    Args:
        carrier: the link that it sits on, None if its own root is the articulation's.
        width: opening of the jaws at the start, metres in [0, 0.08].
        visuals: whether to load what cameras see.
        control: gains.

    Attributes:
        links: first the hand, the left and the right finger; then those of an arm.
    """

    links: tuple[physx.PhysxArticulationLinkComponent, ...]

    def __init__(
        self,
        carrier: physx.PhysxArticulationLinkComponent | None,
        width: float,
        *,
        visuals: bool,
        control: HandControl,
    ) -> None:
        pads = physx.PhysxMaterial(_PAD_FRICTION, _PAD_FRICTION, 0.0)
        entities = [sapien.Entity() for _ in range(3)]
        links: list[physx.PhysxArticulationLinkComponent] = []
        for name, entity in zip(("hand", "left", "right"), entities, strict=True):
            link = physx.PhysxArticulationLinkComponent(links[0] if links else carrier)
            for half_size, pose in _placed_boxes(name):
                shape = physx.PhysxCollisionShapeBox(half_size, pads)
                shape.local_pose = pose
                shape.set_collision_groups(ROBOT_GROUPS)
                link.attach(shape)
            link.mass = _MASS[name]
            link.inertia = _INERTIA[name]  # pyright: ignore[reportAttributeAccessIssue]
            link.cmass_local_pose = sapien.Pose([0, 0, 0.03])
            link.disable_gravity = True
            entity.add_component(link)
            if visuals:
                entity.add_component(mesh_visual(name))
            entity.name = link.name = f"panda_{name}"
            links.append(link)
        for link, side in zip(links[1:], (1.0, -1.0), strict=True):
            joint = link.joint
            joint.type = "prismatic"
            # A prismatic joint slides along the x axis of its frame: lay it along +y or -y.
            frame = sapien.Pose(q=[np.sqrt(0.5), 0, 0, side * np.sqrt(0.5)])
            joint.pose_in_parent = sapien.Pose([0, 0, FINGER_ORIGIN]) * frame
            joint.pose_in_child = frame
            joint.limit = np.array([0.0, FINGER_TRAVEL])
            joint.set_drive_property(
                control.finger_stiffness, control.finger_damping, control.finger_force
            )
            joint.set_drive_target(0.5 * width)
        self.links = tuple(links)
        self._hand = links[0]
        self._hand_entities = tuple(entities)
        self._fingers = tuple(link.joint for link in links[1:])

    def _couple_jaws(self) -> None:
        """Makes the fingers move as one; the hand must be in its scene."""
        self._articulation = self._hand.articulation
        self._articulation.create_fixed_tendon(
            list(self.links[:3]), [0, -1, 1], [0, -1, 1], rest_length=0.0, stiffness=1e5
        )

    def open_jaws(self, width: float = 2 * FINGER_TRAVEL) -> None:
        """Lets the fingers go to a width, metres."""
        for joint in self._fingers:
            joint.set_drive_target(0.5 * width)

    def close_jaws(self) -> None:
        """Lets the fingers close, on whatever lies between them."""
        self.open_jaws(0.0)

    def pose(self) -> Array:
        """``T_world_hand`` (4, 4)."""
        return transform_from_pose(self.pose_world())

    def tcp_pose(self) -> Array:
        """``T_world_tcp`` (4, 4)."""
        return self.pose() @ T_hand_tcp

    def pose_world(self) -> sapien.Pose:
        """The hand's pose as the simulator has it."""
        return self._hand.entity_pose

    def linear_velocity(self) -> list[float]:
        """Of the hand's frame in the world, m/s."""
        return self._hand.linear_velocity.tolist()

    def angular_velocity(self) -> list[float]:
        """Of the hand in the world, rad/s."""
        return self._hand.angular_velocity.tolist()

    def width(self) -> float:
        """Opening of the jaws, metres."""
        *_, left, right = self._articulation.qpos.tolist()
        return left + right


class FloatingHand(PandaHand):
    """A Panda hand with a free root, pulled towards a target pose by a six-axis spring.

    Args:
        scene: the scene it is built into.
        T_world_hand: where it starts, (4, 4).
        width: opening of the jaws at the start, metres in [0, 0.08].
        visuals: whether to load what cameras see; needs the scene to have a renderer.
        control: gains.
    """

    def __init__(
        self,
        scene: sapien.Scene,
        T_world_hand: Array,
        width: float,
        *,
        visuals: bool,
        control: HandControl,
    ) -> None:
        super().__init__(None, width, visuals=visuals, control=control)
        self._hand.joint.type = "undefined"  # pyright: ignore[reportAttributeAccessIssue]
        self._hand_entities[0].pose = pose_from_transform(T_world_hand)
        for entity in self._hand_entities:
            scene.add_entity(entity)
        self._couple_jaws()
        self._articulation.qpos = np.full(2, 0.5 * width)
        self._drive = physx.PhysxDriveComponent(self._hand)
        self._drive.parent = None  # pyright: ignore[reportAttributeAccessIssue]
        for set_property in (
            self._drive.set_drive_property_x,
            self._drive.set_drive_property_y,
            self._drive.set_drive_property_z,
        ):
            set_property(control.linear_stiffness, control.linear_damping, control.linear_force)
        self._drive.set_drive_property_slerp(
            control.angular_stiffness, control.angular_damping, control.angular_torque
        )
        self._hand_entities[0].add_component(self._drive)
        self.pull_to(self._hand_entities[0].pose)

    def pull_to(self, pose_world: sapien.Pose) -> None:
        """Sets where the spring pulls the hand's frame to."""
        self._drive.set_drive_target(pose_world)

    def arm_positions(self) -> list[float]:
        """Of an arm's joints: a floating hand has none."""
        return []

    def arm_velocities(self) -> list[float]:
        """Of an arm's joints: a floating hand has none."""
        return []


@functools.cache
def _placed_boxes(link: str) -> tuple[tuple[tuple[float, float, float], sapien.Pose], ...]:
    """Half sizes and poses of a link's collision boxes."""
    boxes = [box for box in HAND_BOXES if box.link == link]
    return tuple((box.half_size, pose_from_transform(box.T_link_box)) for box in boxes)


@functools.cache
def panda_meshes() -> Path:
    """Folder of the Panda's visual meshes, inside the installed mani_skill package.

    Raises:
        MissingDependencyError: mani_skill is not installed.
    """
    spec = importlib.util.find_spec("mani_skill")
    if spec is None or spec.origin is None:
        raise MissingDependencyError(
            "the Panda's meshes come with the package mani_skill, which is not installed; "
            "pip install mani-skill"
        )
    robots = Path(spec.origin).parent / "assets" / "robots"
    return robots / "panda" / "franka_description" / "meshes" / "visual"


@functools.cache
def _visual_shape(name: str) -> sapien.render.RenderShapeTriangleMesh:
    """The mesh of one link, loaded once a process."""
    mesh = "finger" if name in ("left", "right") else name
    shape = sapien.render.RenderShapeTriangleMesh(str(panda_meshes() / f"{mesh}.glb"))
    if name == "right":
        shape.local_pose = sapien.Pose(q=[0, 0, 0, 1])
    return shape


def mesh_visual(name: str) -> sapien.render.RenderBodyComponent:
    """What cameras see of a link: "hand", "left", "right", or "link0" to "link7" of an arm."""
    body = sapien.render.RenderBodyComponent()
    body.attach(_visual_shape(name).clone())
    return body
