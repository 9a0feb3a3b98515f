"""One episode's world: a table, an articulated object, a hand.

A scene is always built anew: reusing one changes the outcome of identical contacts, and building
costs about a millisecond.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
import sapien
from numpy.typing import NDArray
from sapien import physx

from artgym.geometry import quaternions
from artgym.geometry.rotations import cross
from artgym.geometry.transforms import transform_from
from artgym.objects.contents import Image
from artgym.objects.model import (
    ArticulatedObject,
    Box,
    Cylinder,
    Geometry,
    Link,
    Material,
    Shape,
    Texture,
    Vector,
    Visual,
)
from artgym.objects.textures import texture_pixels
from artgym.sim.contact import PartContact, part_contact
from artgym.sim.conversion import (
    numbers_from_pose,
    pose_from_transform,
    transform_from_pose,
)
from artgym.sim.robots import FloatingHand, HandControl, tcp_from_hand
from artgym.sim.surfaces import flat_surface, piece_surface

if TYPE_CHECKING:
    from artgym.sim.arm import PandaArm

Array = NDArray[np.floating]

#: Half the side and half the thickness of the table's top, metres. Its surface is z = 0.
TABLE_HALF_SIZE = (0.75, 0.75, 0.02)
_TABLE_POSE = sapien.Pose([0, 0, -TABLE_HALF_SIZE[2]])

#: A joint's dry friction is a damper whose force saturates: under a load that the friction holds,
#: the joint creeps by less than this share of its range a second.
JOINT_CREEP = 1e-8


#: Joints slower than this, m/s or rad/s, are not damped.
STILL = 1e-5


@dataclass(frozen=True, kw_only=True)
class PhysicsConfig:
    """How the simulator steps.

    Attributes:
        timestep: seconds of one step.
        position_iterations: of the contact solver.
        contact_offset: how near two shapes come before the solver hears of it, metres. Less is
            faster, and must be more than shapes come nearer in one step; None is the simulator's.
        hand: gains of the hand.
    """

    timestep: float = 1.0 / 120.0
    position_iterations: int = 15
    contact_offset: float | None = None
    hand: HandControl = field(default_factory=HandControl)


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedObject:
    """An object somewhere in the world.

    Attributes:
        model: the object.
        T_world_object: pose (4, 4) of its root.
        q: its joint positions (K - 1,).
    """

    model: ArticulatedObject
    T_world_object: Array
    q: Array


class Reading(NamedTuple):
    """What a scene says of its hand and of one part at one instant, in plain floats.

    World frame, metres, radians, seconds; quaternions wxyz.
    """

    tcp_position: quaternions.Vector
    hand_quaternion: quaternions.Quaternion
    linear_velocity: list[float]
    angular_velocity: list[float]
    jaw_width: float
    q: list[float]
    velocities: list[float]
    part_position: quaternions.Vector
    part_quaternion: quaternions.Quaternion
    arm_positions: list[float]
    arm_velocities: list[float]

    def is_sound(self, fastest: float, farthest: float) -> bool:
        """Whether all is finite, no joint or hand faster and the hand no farther than given.

        Metres and radians, a second.
        """
        speeds = (
            *self.velocities,
            *self.linear_velocity,
            *self.angular_velocity,
            *self.arm_velocities,
        )
        places = (*self.tcp_position, *self.part_position)
        if math.hypot(*speeds) < fastest and math.hypot(*places) < farthest:
            # What is true of all together is true of each, and never of NaN.
            return math.isfinite(sum(self.q))
        return (
            -fastest < min(speeds)
            and max(speeds) < fastest
            and -farthest < min(places)
            and max(places) < farthest
            # NaN hides from the least and the greatest, not from a sum.
            and math.isfinite(sum(speeds) + sum(places) + sum(self.q))
        )


class ArticulatedBody:
    """An object's articulation in a scene, its root fixed to the world."""

    def __init__(
        self,
        scene: sapien.Scene,
        obj: ArticulatedObject,
        T_world_object: Array,
        q: Sequence[float] | Array,
        *,
        visuals: bool,
        position_iterations: int,
        joint_creep: float = JOINT_CREEP,
        group: int = 0,
    ) -> None:
        self.model = obj
        self.links: list[physx.PhysxArticulationLinkComponent] = []
        index = {name: i for i, name in enumerate(obj.part_names)}
        entities = []
        for i, link in enumerate(obj.links):
            joint = obj.joints[i - 1] if i else None
            parent = self.links[index[joint.parent]] if joint else None
            body = physx.PhysxArticulationLinkComponent(parent)
            _attach_shapes(body, link, group)
            body.name = link.name
            entity = sapien.Entity()
            entity.name = link.name
            entity.add_component(body)
            if visuals:
                entity.add_component(link_visual(link))
            if joint is None:
                body.joint.type = "fixed"
            else:
                body.joint.name = joint.name
                body.joint.type = "revolute_unwrapped" if joint.type == "revolute" else "prismatic"
                frame = _joint_frame(joint.axis, joint.pivot)
                body.joint.pose_in_parent = body.joint.pose_in_child = frame
                low, high = sorted((joint.closed, joint.open))
                body.joint.limit = np.array([low, high]) - joint.closed
                # The damper's force saturates at the dry friction, so the joint stays where it
                # is left and yields to any larger force.
                slip = joint_creep * abs(joint.range)
                body.joint.set_drive_property(0.0, joint.friction / slip, joint.friction)
            self.links.append(body)
            entities.append(entity)
        entities[0].pose = pose_from_transform(T_world_object)
        for entity in entities:
            scene.add_entity(entity)
        self._articulation = self.links[0].articulation
        self._articulation.set_solver_position_iterations(position_iterations)
        # The simulator counts q from the rest state, where all link frames coincide.
        self._offset = obj.rest_positions
        self._articulation.qpos = np.asarray(q, dtype=float) - self._offset
        self._rests = False
        self._resistance = np.array([-joint.damping for joint in obj.joints])

    def positions(self) -> Array:
        """Joint positions (K - 1,), metres or radians."""
        return self._articulation.qpos + self._offset

    def velocities(self) -> Array:
        """Joint velocities (K - 1,)."""
        return self._articulation.qvel

    def push(self, efforts: Array) -> None:
        """Applies joint efforts (K - 1,), N or N m, during the coming step."""
        self._articulation.qf = efforts + self._resistance * self._articulation.qvel

    def resist(self) -> None:
        """Applies the joints' damping, and nothing else, during the coming step."""
        velocities = self._articulation.qvel
        for speed in velocities.tolist():
            if not -STILL < speed < STILL:
                self._articulation.qf = self._resistance * velocities
                self._rests = False
                return
        if not self._rests:
            # Once only: an effort, even of nothing, would keep awake what could sleep.
            self._articulation.qf = np.zeros(len(velocities))
            self._rests = True

    def link_poses(self) -> Array:
        """``Ts_world_link`` (K, 4, 4)."""
        return np.stack([transform_from_pose(link.entity_pose) for link in self.links])


class ManipulationScene:
    """A table, one object, others beside it, and a robot: a floating hand, or an arm with a base.

    Args:
        obj: the object.
        T_world_object: its pose, (4, 4).
        q: its joint positions.
        T_world_hand: start of the robot's hand, or None for a scene without a robot.
        T_world_base: where the base of an arm stands; without it the hand floats.
        width: opening of the jaws at the start, metres.
        config: physics.
        render_system: shared renderer; without one the scene has nothing to be seen.
        table_material: how the table looks.
        joint_creep: share of its range by which a held joint may creep, a second.
        others: objects beside it, which keep clear of one another.
    """

    def __init__(
        self,
        obj: ArticulatedObject,
        T_world_object: Array,
        q: Sequence[float] | Array,
        *,
        T_world_hand: Array | None = None,
        T_world_base: Array | None = None,
        width: float = 0.08,
        config: PhysicsConfig = PhysicsConfig(),
        render_system: sapien.render.RenderSystem | None = None,
        table_material: Material | None = None,
        joint_creep: float = JOINT_CREEP,
        others: Sequence[PlacedObject] = (),
    ) -> None:
        self.config = config
        systems: list[sapien.System] = [physx.PhysxCpuSystem()]
        if render_system is not None:
            systems.append(render_system)
        self.sapien_scene = sapien.Scene(systems)
        self._system = cast(physx.PhysxCpuSystem, self.sapien_scene.physx_system)
        self._system.timestep = config.timestep
        visuals = render_system is not None
        self._add_table()
        placed = PlacedObject(model=obj, T_world_object=T_world_object, q=np.asarray(q))
        self.bodies = tuple(
            ArticulatedBody(
                self.sapien_scene,
                each.model,
                each.T_world_object,
                each.q,
                visuals=visuals,
                position_iterations=config.position_iterations,
                joint_creep=joint_creep,
                group=group,
            )
            for group, each in enumerate((placed, *others))
        )
        #: The object that the scene is about.
        self.body = self.bodies[0]
        self.hand: FloatingHand | PandaArm | None = None
        self._hand_links: dict[physx.PhysxRigidBaseComponent, int] = {}
        if T_world_hand is not None:
            self.hand = self._robot(T_world_base, T_world_hand, width, visuals)
            # Of an arm only the hand and its fingers count as touching.
            self._hand_links = {link: i for i, link in enumerate(self.hand.links[:3])}
        if config.contact_offset is not None:
            for link in self.links():
                for shape in link.collision_shapes:
                    shape.contact_offset = config.contact_offset
        if visuals and table_material is not None:
            # Drawn last, what others hide of it costs nothing.
            self._show_table(table_material)

    def _robot(
        self, T_world_base: Array | None, T_world_hand: Array, width: float, visuals: bool
    ) -> FloatingHand | PandaArm:
        scene, control = self.sapien_scene, self.config.hand
        if T_world_base is None:
            return FloatingHand(scene, T_world_hand, width, visuals=visuals, control=control)
        # Compiled kinematics, which a floating hand does not need, take long to load.
        from artgym.sim.arm import ArmControl, PandaArm

        return PandaArm(
            scene,
            T_world_base,
            T_world_hand,
            width,
            visuals=visuals,
            control=ArmControl(hand=control),
        )

    def _add_table(self) -> None:
        entity = sapien.Entity()
        entity.name = "table"
        body = physx.PhysxRigidStaticComponent()
        body.attach(physx.PhysxCollisionShapeBox(TABLE_HALF_SIZE, _surface(0.8)))
        entity.add_component(body)
        entity.pose = _TABLE_POSE
        self.sapien_scene.add_entity(entity)

    def _show_table(self, material: Material) -> None:
        shape = Shape(
            geometry=Box(half_size=TABLE_HALF_SIZE), position=(0, 0, 0), material=material
        )
        entity = sapien.Entity()
        entity.name = "table's looks"
        entity.add_component(visual_body((shape,)))
        entity.pose = _TABLE_POSE
        self.sapien_scene.add_entity(entity)

    def set_timestep(self, seconds: float) -> None:
        """Changes how long a step is, from the next one on."""
        self._system.timestep = seconds

    def step(self, count: int = 1) -> None:
        """Advances physics by ``count`` steps."""
        for _ in range(count):
            for body in self.bodies:
                body.resist()
            self._system.step()

    def read(self, part: int) -> Reading:
        """The hand and a part as they are now."""
        hand = self.hand
        assert hand is not None
        position, quaternion = numbers_from_pose(hand.pose_world())
        part_position, part_quaternion = numbers_from_pose(self.body.links[part].entity_pose)
        return Reading(
            tcp_from_hand(position, quaternion),
            quaternion,
            hand.linear_velocity(),
            hand.angular_velocity(),
            hand.width(),
            self.body.positions().tolist(),
            self.body.velocities().tolist(),
            part_position,
            part_quaternion,
            hand.arm_positions(),
            hand.arm_velocities(),
        )

    def links(self) -> list[physx.PhysxArticulationLinkComponent]:
        """Links of the objects, one object after another, and of the robot: see ``masks``."""
        robot = self.hand.links if self.hand is not None else ()
        return [*(link for body in self.bodies for link in body.links), *robot]

    def link_poses(self) -> Array:
        """``Ts_world_link`` (n, 4, 4) of ``links``."""
        return np.stack([transform_from_pose(link.entity_pose) for link in self.links()])

    def contact(self, part: int) -> PartContact:
        """How the hand touches a part, from the last step's contacts."""
        assert self.hand is not None
        return part_contact(
            self._system.get_contacts(), self.body.links[part], self._hand_links, self._closing
        )

    def _closing(self) -> quaternions.Vector:
        """The direction (3,) in the world along which the fingers close."""
        assert self.hand is not None
        return quaternions.y_axis(numbers_from_pose(self.hand.pose_world())[1])

    def close(self) -> None:
        """Takes everything out of the scene; a shared renderer keeps nothing of it."""
        self.sapien_scene.clear()


@functools.lru_cache(maxsize=1024)
def _joint_frame(axis: Vector, pivot: Vector) -> sapien.Pose:
    """A frame at the pivot whose x is the joint's axis: the simulator's convention."""
    x = np.asarray(axis, dtype=float)
    helper = np.eye(3)[np.argmin(np.abs(x))]
    y = cross(x, helper)
    y = y / np.linalg.norm(y)
    R = np.stack([x, y, cross(x, y)], axis=-1)
    return pose_from_transform(transform_from(R, pivot))


def _surface(friction: float) -> physx.PhysxMaterial:
    return physx.PhysxMaterial(friction, friction, 0.0)


_NO_SCALE = [1.0, 1.0, 1.0]


def _collision_shape(
    geometry: Geometry, material: physx.PhysxMaterial
) -> physx.PhysxCollisionShape:
    if isinstance(geometry, Box):
        return physx.PhysxCollisionShapeBox(geometry.half_size, material)
    if isinstance(geometry, Cylinder):
        return physx.PhysxCollisionShapeCylinder(geometry.radius, geometry.half_length, material)
    points = geometry.corners().astype(np.float32)
    return physx.PhysxCollisionShapeConvexMesh(points, _NO_SCALE, material)


def _attach_shapes(body: physx.PhysxArticulationLinkComponent, link: Link, group: int) -> None:
    material = _surface(link.friction)
    for piece, quaternion in zip(link.shapes, link.shape_quaternions, strict=True):
        shape = _collision_shape(piece.geometry, material)
        shape.local_pose = sapien.Pose(piece.position, quaternion)
        # Links of one object share a bit and never collide with each other.
        shape.set_collision_groups([1, 1, 1 << 2, group])
        body.attach(shape)
    moments, quaternion = link.principal_inertia
    body.mass = link.mass
    body.inertia = moments  # pyright: ignore[reportAttributeAccessIssue]
    body.cmass_local_pose = sapien.Pose(link.center_of_mass, quaternion)  # pyright: ignore[reportArgumentType]


def link_visual(link: Link) -> sapien.render.RenderBodyComponent:
    """What cameras see of a link: its visuals, or else its shapes."""
    if not link.visuals:
        return visual_body(link.shapes)
    body = sapien.render.RenderBodyComponent()
    for visual in link.visuals:
        body.attach(_mesh_shape(visual))
    return body


def visual_body(shapes: Sequence[Shape]) -> sapien.render.RenderBodyComponent:
    """What cameras see of shapes: one mesh of all that look alike, since each costs a picture."""
    body = sapien.render.RenderBodyComponent()
    alike: dict[Material, list[Shape]] = {}
    for piece in shapes:
        alike.setdefault(piece.material, []).append(piece)
    for look, pieces in alike.items():
        body.attach(_joined_shape(pieces, look))
    return body


def _joined_shape(pieces: Sequence[Shape], look: Material) -> sapien.render.RenderShapeTriangleMesh:
    """Pieces of one material as one mesh in their link's frame."""
    vertices, normals, uv = [], [], []
    for piece in pieces:
        surface = piece_surface(piece.geometry)
        R = np.asarray(piece.rotation, dtype=float)
        position = np.asarray(piece.position, dtype=float)
        vertices.append(surface.vertices @ R.T + position)
        normals.append(surface.normals @ R.T)
        if isinstance(look.texture, Texture):
            # Neighbours that are parallel share one picture that runs on from piece to piece.
            uv.append(surface.uv(position @ R, look.texture.tile))
    return _triangle_shape(
        np.concatenate(vertices),
        np.concatenate(normals),
        np.concatenate(uv) if uv else None,
        _render_material(look),
    )


def _mesh_shape(visual: Visual) -> sapien.render.RenderShapeTriangleMesh:
    """A mesh with its picture; a picture for which the mesh has no place gives way to colour."""
    mesh, look = visual.mesh, visual.material
    if isinstance(look.texture, Image) and mesh.uv is None:
        look = replace(look, texture=None)
    surface = flat_surface(mesh.vertices[mesh.faces])
    uv = None
    if isinstance(look.texture, Texture):
        uv = surface.uv(np.zeros(3), look.texture.tile)
    elif mesh.uv is not None:
        uv = mesh.uv[mesh.faces].reshape(-1, 2)
    return _triangle_shape(surface.vertices, surface.normals, uv, _render_material(look))


def _render_material(look: Material) -> sapien.render.RenderMaterial:
    material = sapien.render.RenderMaterial(
        base_color=[*look.color, 1.0], roughness=look.roughness, metallic=look.metallic
    )
    if look.texture is not None:
        material.base_color_texture = _render_texture(look.texture, look.color)
    return material


@functools.lru_cache(maxsize=64)
def _render_texture(texture: Texture | Image, color: Vector) -> sapien.render.RenderTexture2D:
    """The picture that takes the place of a material's colour; scenes share it."""
    pixels = texture.pixels if isinstance(texture, Image) else texture_pixels(texture, color)
    height, width, _ = pixels.shape
    opaque = np.full((height, width, 4), 255, dtype=np.uint8)
    opaque[..., :3] = pixels
    levels = int(np.log2(max(2, min(height, width))))
    return sapien.render.RenderTexture2D(opaque, "R8G8B8A8Unorm", mipmap_levels=levels, srgb=True)


def _triangle_shape(
    vertices: Array, normals: Array, uv: Array | None, material: sapien.render.RenderMaterial
) -> sapien.render.RenderShapeTriangleMesh:
    """Triangles by their corners (3 n, 3); uv (3 n, 2) are picture coordinates, v upwards."""
    if uv is None:
        uv = np.zeros((len(vertices), 2))
    # The renderer counts a picture's rows from the top.
    uv = uv * [1.0, -1.0] + [0.0, 1.0]
    return sapien.render.RenderShapeTriangleMesh(
        vertices.astype(np.float32),
        np.arange(len(vertices), dtype=np.uint32).reshape(-1, 3),
        normals.astype(np.float32),
        uv.astype(np.float32),
        material,
    )
