"""What an observation holds in each mode, the spaces that say so, and how it is made.

Apart from uint8 images everything is a vector, since learning libraries take nothing else
without complaint: ``depth`` is the picture row by row, a transform its 16 numbers.
``datasets.frame.CameraFrame.from_observation`` gives them their shapes back.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal, get_args

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from artgym.envs.arguments import FARTHEST_PLACE
from artgym.geometry import quaternions, transforms
from artgym.objects.model import ArticulatedObject
from artgym.sim.camera import RenderedCamera, View
from artgym.sim.masks import MaskCodes
from artgym.sim.robots import RobotName
from artgym.sim.scene import ManipulationScene, Reading

Array = NDArray[np.floating]

ObsMode = Literal["state", "state_dict", "rgb", "rgbd", "pointcloud"]
OBS_MODES: tuple[ObsMode, ...] = get_args(ObsMode)
#: Modes that need a renderer.
IMAGE_MODES: tuple[ObsMode, ...] = ("rgb", "rgbd")

_HAND_FIELDS: Mapping[str, int] = MappingProxyType(
    {
        "tcp_position": 3,
        "tcp_x_axis": 3,
        "tcp_z_axis": 3,
        "tcp_linear_velocity": 3,
        "tcp_angular_velocity": 3,
        "jaw_width": 1,
        "open_fraction": 1,
        "joint_velocity": 1,
        "is_revolute": 1,
        "joint_axis": 3,
        "joint_pivot": 3,
        "grip_point": 3,
        "tcp_to_grip_point": 3,
        "part_x_axis": 3,
        "part_z_axis": 3,
        "part_size": 3,
        "grip_size": 3,
    }
)

#: Fields of the state vector by robot, in order, with their sizes. Metres, radians, world frame;
#: ``arm_*`` are the arm's joints.
STATE_FIELDS: Mapping[RobotName, Mapping[str, int]] = MappingProxyType(
    {
        "hand": _HAND_FIELDS,
        "panda": MappingProxyType({**_HAND_FIELDS, "arm_positions": 7, "arm_velocities": 7}),
    }
)

#: No coordinate, velocity or size in a scene that is still stable exceeds this.
LIMIT = 100.0


@dataclass(frozen=True, kw_only=True)
class ObservationConfig:
    """What determines the space of observations.

    Attributes:
        mode: which observation.
        robot: whose state it holds.
        camera_size: (width, height) of a picture, pixels.
        num_cameras: how many see the scene.
        segmentation: whether pictures and clouds come with labels.
        num_points: of a cloud.
        num_parts: most parts an object can have, the base included.
    """

    mode: ObsMode
    robot: RobotName
    camera_size: tuple[int, int]
    num_cameras: int
    segmentation: bool
    num_points: int
    num_parts: int

    def space(self) -> spaces.Space[Any]:
        """The space that holds every observation."""
        fields = STATE_FIELDS[self.robot]
        if self.mode == "state":
            return _vector(sum(fields.values()))
        if self.mode == "state_dict":
            return spaces.Dict({name: _vector(size) for name, size in fields.items()})
        found: dict[str, spaces.Space[Any]] = {
            "T_world_tcp": _vector(16, FARTHEST_PLACE),
            "jaw_width": spaces.Box(-0.01, 0.1, (1,), np.float32),
            "target_part": spaces.Discrete(self.num_parts),
        }
        if self.mode == "pointcloud":
            found["points"] = _vector(3 * self.num_points, FARTHEST_PLACE)
            if self.segmentation:
                found["segmentation"] = spaces.Box(0, 255, (self.num_points,), np.uint8)
            return spaces.Dict(found)
        width, height = self.camera_size
        for i in range(self.num_cameras):
            picture: dict[str, spaces.Space[Any]] = {
                "rgb": spaces.Box(0, 255, (height, width, 3), np.uint8),
                "intrinsics": spaces.Box(0.0, 1e4, (9,), np.float32),
                "T_world_camera": _vector(16, FARTHEST_PLACE),
            }
            if self.mode == "rgbd":
                picture["depth"] = spaces.Box(0.0, 10.0, (height * width,), np.float32)
            if self.segmentation:
                picture["segmentation"] = spaces.Box(0, 255, (height * width,), np.uint8)
            found |= {of_camera(name, i): space for name, space in picture.items()}
        return spaces.Dict(found)


def _vector(size: int, limit: float = LIMIT) -> spaces.Box:
    return spaces.Box(-limit, limit, (size,), np.float32)


def of_camera(name: str, camera: int) -> str:
    """The key of a camera's field: "rgb" of the first camera, "rgb_1" of the second, ...

    >>> of_camera("rgb", 1)
    'rgb_1'
    """
    return f"{name}_{camera}" if camera else name


class Observer:
    """Makes the observations of one episode.

    Args:
        config: which observations.
        scene: what is observed.
        obj: the object in it that is to be moved.
        target_part: index of the part to move.
        views: the cameras.
        rng: for the choice of a cloud's points.
    """

    def __init__(
        self,
        config: ObservationConfig,
        scene: ManipulationScene,
        obj: ArticulatedObject,
        T_world_object: Array,
        target_part: int,
        views: Sequence[View],
        rng: np.random.Generator,
    ) -> None:
        self.config = config
        self._rng = rng
        #: State of the generator when the last observation was begun.
        self.generator_before = rng.bit_generator.state
        self._scene = scene
        self._part = target_part
        self._views = tuple(views)
        self._cameras = (
            [RenderedCamera(scene.sapien_scene, view) for view in views]
            if config.mode in IMAGE_MODES
            else []
        )
        self._codes = MaskCodes(num_parts=tuple(body.model.num_parts for body in scene.bodies))
        if config.mode == "pointcloud":
            # Meshes and rays take long to load, and only clouds need them.
            from artgym.sim import rays

            self._cloud_camera = rays.PointCloudCamera(views[0], config.num_points)
            self._ray_bodies = [
                *(rays.link_body(link) for body in scene.bodies for link in body.model.links),
                *rays.robot_bodies(config.robot),
            ]
        joint = obj.joint_of(target_part)
        self._grip_point_part: list[float] = obj.grip_point(target_part).tolist()
        size = np.ptp(obj.links[target_part].bounds(), axis=0)
        axis = T_world_object[:3, :3] @ np.asarray(joint.axis)
        pivot = transforms.apply(T_world_object, np.asarray(joint.pivot, dtype=float)[None])[0]
        self._joint = (float(joint.type == "revolute"), *axis.tolist(), *pivot.tolist())
        self._sizes = (*size.tolist(), *obj.grip_size(target_part).tolist())

    def grip_point(self, reading: Reading) -> quaternions.Vector:
        """Where the part is best taken, world frame, metres: ``ArticulatedObject.grip_point``."""
        x, y, z = quaternions.rotate(reading.part_quaternion, self._grip_point_part)
        a, b, c = reading.part_position
        return a + x, b + y, c + z

    def restore_generator(self, state: Mapping[str, Any]) -> None:
        """Makes the next observation draw as the one did that began with this state."""
        self._rng.bit_generator.state = copy.deepcopy(dict(state))

    def observe(
        self, reading: Reading, grip_point: quaternions.Vector, open_fraction: float
    ) -> Any:
        """The observation of the scene as it stands.

        Args:
            reading: of the scene, just made.
            grip_point: of that reading.
            open_fraction: of the target part.
        """
        mode = self.config.mode
        if mode in ("state", "state_dict"):
            vector = self._state_vector(reading, grip_point, open_fraction)
            return vector if mode == "state" else self._fields(vector)
        robot = self._scene.hand
        assert robot is not None
        observation: dict[str, Any] = {
            "T_world_tcp": robot.tcp_pose().astype(np.float32).reshape(-1),
            "jaw_width": np.array([reading.jaw_width], dtype=np.float32),
            "target_part": np.int64(self._part),
        }
        if mode == "pointcloud":
            self.generator_before = self._rng.bit_generator.state
            return observation | self._cloud()
        for i, camera in enumerate(self._cameras):
            observation |= {of_camera(n, i): v for n, v in self._picture(camera).items()}
        return observation

    def _state_vector(
        self, reading: Reading, grip_point: quaternions.Vector, open_fraction: float
    ) -> NDArray[np.float32]:
        """The fields of ``STATE_FIELDS`` one after another."""
        tcp, turn = reading.tcp_position, reading.hand_quaternion
        numbers = (
            *tcp,
            *quaternions.x_axis(turn),
            *quaternions.z_axis(turn),
            *reading.linear_velocity,
            *reading.angular_velocity,
            reading.jaw_width,
            open_fraction,
            reading.velocities[self._part - 1],
            *self._joint,
            *grip_point,
            grip_point[0] - tcp[0],
            grip_point[1] - tcp[1],
            grip_point[2] - tcp[2],
            *quaternions.x_axis(reading.part_quaternion),
            *quaternions.z_axis(reading.part_quaternion),
            *self._sizes,
            *reading.arm_positions,
            *reading.arm_velocities,
        )
        # Faster than np.array, which looks at each number twice.
        return np.fromiter(numbers, np.float32, len(numbers))

    def _fields(self, vector: NDArray[np.float32]) -> dict[str, NDArray[np.float32]]:
        sizes = STATE_FIELDS[self.config.robot]
        ends = np.cumsum(list(sizes.values()))
        pieces = np.split(vector, ends[:-1])
        return {name: piece.copy() for name, piece in zip(sizes, pieces, strict=True)}

    def _picture(self, camera: RenderedCamera) -> dict[str, Any]:
        found: dict[str, Any] = {
            "intrinsics": camera.view.intrinsics.astype(np.float32).reshape(-1),
            "T_world_camera": camera.view.T_world_camera.astype(np.float32).reshape(-1),
        }
        if self.config.segmentation:
            rgb, depth, bodies = camera.take_with_bodies(self._scene.links())
            found["segmentation"] = self._codes.mask_from_bodies(bodies).reshape(-1)
        else:
            rgb, depth = camera.take()
        found["rgb"] = rgb
        if self.config.mode == "rgbd":
            found["depth"] = depth.reshape(-1)
        return found

    def _cloud(self) -> dict[str, Any]:
        """Points that the first camera sees, the table left out, world frame, flattened."""
        poses = self._scene.link_poses()
        points, bodies = self._cloud_camera.cloud(self._ray_bodies, poses, self._rng)
        found: dict[str, Any] = {"points": points.reshape(-1)}
        if self.config.segmentation:
            found["segmentation"] = self._codes.mask_from_bodies(bodies)
        return found
