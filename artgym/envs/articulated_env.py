"""The single-object environment: a hand, a table, one articulated object."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import Any, get_args

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from artgym.control import MAX_ROTATION, MAX_TRANSLATION, MAX_WIDTH
from artgym.envs.observations import STATE_FIELDS, ObsMode, observation_space
from artgym.errors import InvalidArgumentError, NotReadyError, UnknownNameError
from artgym.geometry import transforms
from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.objects import catalog
from artgym.objects.model import ArticulatedObject
from artgym.sim import rays
from artgym.sim.camera import RenderedCamera, View, ViewDistribution
from artgym.sim.conversion import pose_from_transform
from artgym.sim.renderer import own_render_system
from artgym.sim.robots import T_hand_tcp
from artgym.sim.scene import ManipulationScene, PartContact, PhysicsConfig
from artgym.sim.setting import add_lights, random_hand_start, random_placement, random_table
from artgym.tasks import rewards
from artgym.tasks.rewards import RewardMode
from artgym.tasks.success import (
    REPORTED_TRAVELS,
    Progress,
    maniskill_success,
    where2act_success,
)

Array = NDArray[np.floating]

#: Simulator steps in one control step: 20 Hz.
SUBSTEPS = 6
#: The hand's target stays inside this box, metres.
WORKSPACE_LOW, WORKSPACE_HIGH = np.array([-1.2, -1.2, 0.0]), np.array([1.5, 1.2, 2.2])
#: A joint faster than this (m/s or rad/s), or a hand this far out, is a blow-up.
MAX_STABLE_SPEED, MAX_STABLE_DISTANCE = 40.0, 3.0
#: An episode ends when the part has travelled this far in success.
DONE_TRAVEL = 0.9

_T_TCP_HAND = transforms.invert(T_hand_tcp)
_PRETTY_SIZE = (480, 360)


class ArtOpenEnv(gymnasium.Env[Any, NDArray[np.float32]], EzPickle):
    """Open a part of an articulated object with a floating Panda hand.

    **Description.** An object stands on a table, nearly closed. The hand shall take hold of the
    target part and move it through at least half of its joint's range.

    **Action.** ``Box(-1, 1, (7,), float32)``, at 20 Hz: translation (x, y, z; 1 is 0.02 m) and
    rotation vector (1 is 0.1 rad) of the hand's tool centre, both in the world frame and relative
    to where the hand is; jaw opening (-1 closed, 1 open by 0.08 m). Values beyond are clipped.

    **Observation.** By ``obs_mode``:

    - ``"state"``: a vector of the fields of ``observations.STATE_FIELDS``. Privileged.
    - ``"rgbd"``: ``rgb`` uint8 (H, W, 3), ``depth`` float32 (H * W,) metres along z with 0 where
      nothing was seen, ``intrinsics`` (9,), ``T_world_camera`` (16,) with OpenCV axes,
      ``T_world_tcp`` (16,), ``jaw_width`` (1,) and ``target_part``. Needs a renderer.
    - ``"pointcloud"``: ``points`` float32 (num_points * 3,), world frame, of everything but the
      table that the camera sees, drawn with repetition; and the hand's fields. By ray casting,
      without a graphics driver.

    **Reward.** Dense, in [0, 1]: 0.2 for nearness of the tool centre to the part's grip point,
    0.2 for having the part between the fingers, 0.6 for travel up to half of the range made in
    contact. Sparse: 1 in success, else 0. ``info["reward_terms"]`` lists the terms.

    **Start.** Object at the table's middle +-5 cm, turned by up to 20 degrees; its open fraction
    in the category's start interval; the hand above it, half open; a camera in front.

    **End.** Terminated when the part has travelled 90 % of its range in success. Truncated after
    the horizon (300 steps), or when physics becomes unstable (``info["unstable"]``).
    ``info["success"]`` follows ``tasks.success``: travel >= 0.5 with >= 80 % of the motion made
    while touching the part; ``info["success_gripped"]`` asks that the part be between the fingers.

    **Arguments.**

    Args:
        categories: categories to draw objects from; by default all that have such a split.
        split: "train", "val" or "test".
        objects: ids to draw from instead of whole categories.
        obs_mode: see above.
        reward_mode: "dense" or "sparse".
        camera_size: (width, height) of the observed picture, pixels.
        num_points: of a point cloud.
        target_part: index of the part to move.
        render_mode: None or "rgb_array".

    Options of ``reset``: ``object_id`` and ``open_fraction`` choose the episode's object and
    start.

    **Version history.** v0: first version.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012

    def __init__(
        self,
        *,
        categories: Sequence[str] | None = None,
        split: str = "train",
        objects: Sequence[str] | None = None,
        obs_mode: ObsMode = "state",
        reward_mode: RewardMode = "dense",
        camera_size: tuple[int, int] = (320, 240),
        num_points: int = 2048,
        target_part: int = 1,
        render_mode: str | None = None,
    ) -> None:
        EzPickle.__init__(
            self,
            categories=categories,
            split=split,
            objects=objects,
            obs_mode=obs_mode,
            reward_mode=reward_mode,
            camera_size=camera_size,
            num_points=num_points,
            target_part=target_part,
            render_mode=render_mode,
        )
        _require_known("obs_mode", obs_mode, get_args(ObsMode))
        _require_known("reward_mode", reward_mode, get_args(RewardMode))
        if render_mode is not None:
            _require_known("render_mode", render_mode, self.metadata["render_modes"])
        self._object_ids = _drawable_ids(categories, split, objects, target_part)
        _require_sizes(camera_size, num_points)
        self.obs_mode = obs_mode
        self.reward_mode: RewardMode = reward_mode
        self.render_mode = render_mode
        self.target_part = target_part
        self.camera_size = camera_size
        self.num_points = num_points
        self.action_space = spaces.Box(-1.0, 1.0, (7,), np.float32)
        num_parts = max(_most_parts(i) for i in self._object_ids)
        self.observation_space = observation_space(obs_mode, camera_size, num_points, num_parts)
        # One renderer serves observations and render(); state mode alone needs none.
        self._needs_renderer = obs_mode == "rgbd" or render_mode == "rgb_array"
        self._render_system = own_render_system() if self._needs_renderer else None
        self._scene: ManipulationScene | None = None
        self._closed = False

    # -- what others may ask -------------------------------------------------------------------

    @property
    def object(self) -> ArticulatedObject:
        """The object of the running episode."""
        self._require_running("object")
        return self._object

    @property
    def T_world_object(self) -> Array:
        """Pose (4, 4) of the object's root."""
        self._require_running("T_world_object")
        return self._T_world_object

    @property
    def progress(self) -> Progress:
        """The target joint's motion so far."""
        self._require_running("progress")
        return self._progress

    @property
    def view(self) -> View:
        """The camera of the running episode."""
        self._require_running("view")
        return self._view

    def joint_positions(self) -> Array:
        """Positions (K - 1,) of all joints, metres or radians."""
        return self._running_scene("joint_positions").body.positions()

    def tcp_pose(self) -> Array:
        """``T_world_tcp`` (4, 4)."""
        return self._hand_pose() @ T_hand_tcp

    def jaw_width(self) -> float:
        """Opening of the jaws, metres."""
        hand = self._running_scene("jaw_width").hand
        assert hand is not None
        return hand.width()

    # -- Gymnasium -----------------------------------------------------------------------------

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Starts an episode; the same seed gives the same bytes.

        Raises:
            InvalidArgumentError: an unknown option, or an open fraction outside [0, 1].
            UnknownNameError: an object id that is not in the catalogue.
        """
        super().reset(seed=seed)
        if self._closed:
            raise NotReadyError("reset() after close(): make a new environment.")
        object_id, fraction = self._read_options(options or {})
        rng = self.np_random
        drawn = self._draw_object(rng)
        self._object = drawn if object_id is None else catalog.load(object_id)
        category = catalog.category_of(self._object)
        drawn_fraction = float(rng.uniform(*category.start_fraction))
        self._T_world_object = random_placement(rng)
        self._joint = self._object.joint_of(self.target_part)
        q = self._object.positions_with(
            self.target_part, drawn_fraction if fraction is None else fraction
        )
        T_world_tcp = random_hand_start(rng, self._object)
        self._view = ViewDistribution.around(self._object).sample(rng, *self.camera_size)
        table = random_table(rng)
        light_seed = int(rng.integers(2**31))
        self._cloud_rng = np.random.default_rng(int(rng.integers(2**31)))

        self._drop_scene()
        self._scene = ManipulationScene(
            self._object,
            self._T_world_object,
            q,
            T_world_hand=T_world_tcp @ _T_TCP_HAND,
            width=0.5 * MAX_WIDTH,
            config=PhysicsConfig(),
            render_system=self._render_system,
            table_material=table,
        )
        if self._needs_renderer:
            add_lights(self._scene.sapien_scene, np.random.default_rng(light_seed))
        self._camera = (
            RenderedCamera(self._scene.sapien_scene, self._view)
            if self.obs_mode == "rgbd"
            else None
        )
        self._pretty_camera = (
            RenderedCamera(self._scene.sapien_scene, _pretty_view(self._view))
            if self.render_mode == "rgb_array"
            else None
        )
        self._progress = Progress.begin(float(self._joint.open_fraction(q[self.target_part - 1])))
        self._succeeded_once = False
        return self._observe(), self._info(
            PartContact(touched=False, pinched=False), unstable=False
        )

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Moves the hand for one control step.

        Raises:
            InvalidArgumentError: the action has a wrong shape or is not finite.
            NotReadyError: no episode is running.
        """
        scene = self._running_scene("step")
        hand = scene.hand
        assert hand is not None
        action = _checked_action(action)
        T_target = self.tcp_pose()
        T_target[:3, 3] = np.clip(
            T_target[:3, 3] + MAX_TRANSLATION * action[:3], WORKSPACE_LOW, WORKSPACE_HIGH
        )
        T_target[:3, :3] = matrix_from_axis_angle(MAX_ROTATION * action[3:6]) @ T_target[:3, :3]
        hand.pull_to(pose_from_transform(T_target @ _T_TCP_HAND))
        hand.open_jaws(0.5 * MAX_WIDTH * (1.0 + float(action[6])))
        scene.step(SUBSTEPS)

        if self._is_unstable():
            # Nothing of a blow-up is shown: the last sound state stands in for it.
            info = copy.deepcopy(self._last_info) | {"unstable": True}
            return copy.deepcopy(self._last_observation), 0.0, False, True, info
        contact = scene.contact(self.target_part)
        q = float(scene.body.positions()[self.target_part - 1])
        self._progress = self._progress.advance(
            float(self._joint.open_fraction(q)), contact.touched, contact.pinched
        )
        self._succeeded_once |= bool(self._progress.success)
        info = self._info(contact, unstable=False)
        reward = rewards.reward(self.reward_mode, info["reward_terms"], self._progress)
        terminated = bool(self._progress.success_at(DONE_TRAVEL))
        return self._observe(), reward, terminated, False, info

    def render(self) -> NDArray[np.uint8] | None:
        """A picture (360, 480, 3) uint8 if ``render_mode`` is "rgb_array"."""
        if self.render_mode is None:
            gymnasium.logger.warn(
                'render() without a render mode: pass render_mode="rgb_array" to gym.make.'
            )
            return None
        self._running_scene("render")
        assert self._pretty_camera is not None
        return self._pretty_camera.take()[0]

    def close(self) -> None:
        """Frees the scene; may be called again."""
        self._drop_scene()
        self._closed = True

    def _draw_object(self, rng: np.random.Generator) -> ArticulatedObject:
        """One of the objects that have the target part."""
        while True:
            object_id = self._object_ids[int(rng.integers(len(self._object_ids)))]
            obj = catalog.load(object_id)
            if self.target_part < obj.num_parts:
                return obj

    # -- parts of a step -----------------------------------------------------------------------

    def _observe(self) -> Any:
        if self.obs_mode == "state":
            observation: Any = self._state_vector()
        else:
            observation = {
                "T_world_tcp": self.tcp_pose().astype(np.float32).reshape(-1),
                "jaw_width": np.array([self.jaw_width()], dtype=np.float32),
                "target_part": np.int64(self.target_part),
            }
            if self.obs_mode == "pointcloud":
                observation["points"] = self._point_cloud()
            else:
                assert self._camera is not None
                rgb, depth = self._camera.take()
                observation["rgb"] = rgb
                observation["depth"] = depth.reshape(-1)
                observation["intrinsics"] = self._view.intrinsics.astype(np.float32).reshape(-1)
                observation["T_world_camera"] = self._view.T_world_camera.astype(
                    np.float32
                ).reshape(-1)
        self._last_observation = observation
        return observation

    def _state_vector(self) -> NDArray[np.float32]:
        scene = self._running_scene("observe")
        assert scene.hand is not None
        T_world_tcp = self.tcp_pose()
        velocity = scene.hand.velocity()
        link_pose = scene.body.link_poses()[self.target_part]
        joint = self._joint
        R_world_object = self._T_world_object[:3, :3]
        pivot = self._T_world_object @ np.append(joint.pivot, 1.0)
        grip = self._grip_point_world(link_pose)
        bounds = self._object.links[self.target_part].bounds()
        fields = {
            "tcp_position": T_world_tcp[:3, 3],
            "tcp_x_axis": T_world_tcp[:3, 0],
            "tcp_z_axis": T_world_tcp[:3, 2],
            "tcp_linear_velocity": velocity[:3],
            "tcp_angular_velocity": velocity[3:],
            "jaw_width": [scene.hand.width()],
            "open_fraction": [self._progress.fraction],
            "joint_velocity": [scene.body.velocities()[self.target_part - 1]],
            "is_revolute": [float(joint.type == "revolute")],
            "joint_axis": R_world_object @ np.asarray(joint.axis),
            "joint_pivot": pivot[:3],
            "grip_point": grip,
            "tcp_to_grip_point": grip - T_world_tcp[:3, 3],
            "part_size": bounds[1] - bounds[0],
        }
        return np.concatenate([fields[name] for name in STATE_FIELDS]).astype(np.float32)

    def _point_cloud(self) -> NDArray[np.float32]:
        """Points the camera sees, the table left out, world frame, flattened."""
        scene = self._running_scene("observe")
        view = self._view
        width, height = view.width // 2, view.height // 2
        intrinsics = view.intrinsics * [[0.5], [0.5], [1.0]]
        links = self._object.links
        bodies = [*(rays.link_body(link) for link in links), *rays.hand_bodies()]
        hand_poses = rays.hand_poses(self._hand_pose(), self.jaw_width())
        poses = np.concatenate([scene.body.link_poses(), hand_poses])
        directions = rays.camera_rays(intrinsics, width, height, view.T_world_camera)
        eye = view.T_world_camera[:3, 3]
        hits = rays.cast(bodies, poses, eye, directions)
        seen = np.flatnonzero(hits.body >= 0)
        if not len(seen):
            return np.tile(eye, self.num_points).astype(np.float32)
        chosen = self._cloud_rng.choice(seen, self.num_points, replace=len(seen) < self.num_points)
        points = eye + hits.distance[chosen, None] * directions[chosen]
        return points.astype(np.float32).reshape(-1)

    def _info(self, contact: PartContact, *, unstable: bool) -> dict[str, Any]:
        progress = self._progress
        link_pose = self._running_scene("info").body.link_poses()[self.target_part]
        distance = np.linalg.norm(self._grip_point_world(link_pose) - self.tcp_pose()[:3, 3])
        speed = float(self._running_scene("info").body.velocities()[self.target_part - 1])
        info = {
            "object_id": self._object.object_id,
            "success": bool(progress.success),
            "success_gripped": bool(progress.success_gripped),
            "success_once": self._succeeded_once,
            "success_at": {
                f"{100 * t:.0f}": bool(progress.success_at(t)) for t in REPORTED_TRAVELS
            },
            "success_maniskill": maniskill_success(progress, speed),
            "success_where2act": where2act_success(progress, self._joint.range),
            "travel": float(progress.travel),
            "engaged": float(progress.engaged),
            "gripped": float(progress.gripped),
            "open_fraction": float(progress.fraction),
            "reward_terms": rewards.dense_terms(float(distance), contact.pinched, progress),
            "unstable": unstable,
        }
        self._last_info = info
        return info

    def _grip_point_world(self, T_world_part: Array) -> Array:
        point = self._object.grip_point(self.target_part)
        return T_world_part[:3, :3] @ point + T_world_part[:3, 3]

    def _hand_pose(self) -> Array:
        hand = self._running_scene("hand").hand
        assert hand is not None
        return hand.pose()

    def _is_unstable(self) -> bool:
        scene = self._running_scene("step")
        assert scene.hand is not None
        state = np.concatenate(
            [scene.body.positions(), scene.body.velocities(), scene.hand.pose()[:3, 3]]
        )
        if not np.all(np.isfinite(state)):
            return True
        too_fast = np.abs(scene.body.velocities()).max() > MAX_STABLE_SPEED
        velocity = np.abs(scene.hand.velocity()).max()
        away = np.abs(scene.hand.pose()[:3, 3]).max() > MAX_STABLE_DISTANCE
        return bool(too_fast or away or not velocity < MAX_STABLE_SPEED)

    # -- checks --------------------------------------------------------------------------------

    def _read_options(self, options: Mapping[str, Any]) -> tuple[str | None, float | None]:
        for key in options:
            _require_known("reset option", key, ("object_id", "open_fraction"))
        asked = options.get("open_fraction")
        try:
            fraction = None if asked is None else float(asked)
        except (TypeError, ValueError):
            fraction = np.nan
        if fraction is not None and not 0.0 <= fraction <= 1.0:
            raise InvalidArgumentError(
                f"options['open_fraction']={asked!r}: expected 0 (closed) to 1 (open)"
            )
        return options.get("object_id"), fraction

    def _require_running(self, what: str) -> None:
        if self._scene is None:
            reason = "after close(): make a new environment" if self._closed else "before reset()"
            raise NotReadyError(f"{what} {reason}.")

    def _running_scene(self, what: str) -> ManipulationScene:
        self._require_running(what)
        assert self._scene is not None
        return self._scene

    def _drop_scene(self) -> None:
        self._camera = self._pretty_camera = None
        if self._scene is not None:
            self._scene.close()
            self._scene = None


def _drawable_ids(
    categories: Sequence[str] | None,
    split: str,
    objects: Sequence[str] | None,
    target_part: int,
) -> tuple[str, ...]:
    """Ids to draw from, each known and, where it is named, with the asked part."""
    if objects is not None:
        ids = (objects,) if isinstance(objects, str) else tuple(objects)
        for object_id in ids:
            catalog.load(object_id).joint_of(target_part)
    else:
        names = catalog.categories_with(split) if categories is None else categories
        names = (names,) if isinstance(names, str) else tuple(names)
        for name in names:
            parts = catalog.category(name).parts
            if not 1 <= target_part < len(parts):
                raise InvalidArgumentError(
                    f"target_part={target_part}: category {name!r} has the movable parts "
                    + ", ".join(f"{i} ({part})" for i, part in enumerate(parts) if i)
                )
        ids = tuple(i for name in names for i in catalog.object_ids(name, split))  # type: ignore[arg-type]
    if not ids:
        raise InvalidArgumentError("no objects to draw from: give categories or objects.")
    return ids


def _most_parts(object_id: str) -> int:
    """The most parts that an object of this kind can have."""
    name = object_id.partition("/")[0]
    if name in catalog.CATEGORIES:
        return len(catalog.CATEGORIES[name].parts)
    return catalog.load(object_id).num_parts


def _require_known(kind: str, name: object, known: Sequence[str]) -> None:
    if name not in known:
        raise UnknownNameError(kind, name, known)


def _require_sizes(camera_size: tuple[int, int], num_points: int) -> None:
    width, height = camera_size
    if not (16 <= width <= 4096 and 16 <= height <= 4096):
        raise InvalidArgumentError(
            f"camera_size={camera_size}: expected (width, height) of 16 to 4096 pixels"
        )
    if not 1 <= num_points <= 100_000:
        raise InvalidArgumentError(f"num_points={num_points}: expected 1 to 100,000")


def _checked_action(action: NDArray[np.float32]) -> Array:
    """The action as finite numbers in [-1, 1], (7,)."""
    try:
        numbers = np.asarray(action, dtype=float)
    except (TypeError, ValueError) as error:
        raise InvalidArgumentError(f"action={action!r}: expected 7 numbers in [-1, 1]") from error
    if numbers.shape != (7,):
        raise InvalidArgumentError(
            f"action of shape {numbers.shape}: expected (7,): translation, rotation, jaws"
        )
    if not np.all(np.isfinite(numbers)):
        raise InvalidArgumentError(f"action={numbers.tolist()}: expected finite numbers in [-1, 1]")
    return np.clip(numbers, -1.0, 1.0)


def _pretty_view(view: View) -> View:
    """The observed camera's place with a wider picture."""
    width, height = _PRETTY_SIZE
    return View(
        T_world_camera=view.T_world_camera, fov_y=1.2 * view.fov_y, width=width, height=height
    )
