"""The environments of one object: a robot, a table, a part to open or to close."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils import EzPickle
from numpy.typing import NDArray

from artgym.control import MAX_JOINT_TURN, MAX_ROTATION, MAX_TRANSLATION, MAX_WIDTH
from artgym.envs import arguments
from artgym.envs.observations import IMAGE_MODES, ObservationConfig, Observer, ObsMode
from artgym.envs.snapshot import Snapshot
from artgym.errors import InvalidArgumentError, NotReadyError
from artgym.geometry import quaternions, transforms
from artgym.geometry.hand import T_hand_tcp
from artgym.objects import catalog
from artgym.objects.model import ArticulatedObject
from artgym.sim.camera import RenderedCamera, View, ViewDistribution
from artgym.sim.contact import PartContact
from artgym.sim.renderer import own_render_system
from artgym.sim.robots import ACTION_SIZES, CONTROL_MODES, ControlMode, RobotName, hand_from_tcp
from artgym.sim.scene import ManipulationScene, PlacedObject, Reading
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
#: Control steps of an episode.
HORIZON = 300
#: The hand's target stays inside this box, metres.
WORKSPACE_LOW, WORKSPACE_HIGH = (-1.2, -1.2, 0.0), (1.5, 1.2, 2.2)
#: A joint or hand faster than this (m/s or rad/s), or a hand this far out, is a blow-up.
MAX_STABLE_SPEED, MAX_STABLE_DISTANCE = 90.0, 3.0
#: So is a part this far beyond an end of its range, as a share of it.
MAX_STABLE_OVERSHOOT = 0.5
#: An episode ends when the part has made this share of the way that was left, in success.
DONE_SHARE = 0.9
#: Open fraction at the start of a closing episode.
CLOSING_START = (0.6, 0.9)
#: What an episode draws at random besides its object and the part's start.
RANDOMISED = ("placement", "hand", "camera", "table", "lights")

#: Vertical field of view of cameras at given places, radians.
FIELD_OF_VIEW = 0.65
#: Objects drawn for an arm before it is an error that none is within its reach.
_DRAWS = 20

_T_TCP_HAND = transforms.invert(T_hand_tcp)
_PRETTY_SIZE = (480, 360)
_UNTOUCHED = PartContact(touched=False, pinched=False)
_REPORTED = tuple(f"{100 * travel:.0f}" for travel in REPORTED_TRAVELS)


class ArticulatedEnv(gymnasium.Env[Any, NDArray[np.float32]], EzPickle):
    """What the environments have in common; ``ArtOpenEnv`` describes it.

    Attributes:
        direction: 1 where the task is to open, -1 where it is to close.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012
    direction: ClassVar[float]

    def __init__(
        self,
        *,
        categories: Sequence[str] | None = None,
        split: str = "train",
        objects: Sequence[str] | None = None,
        target_part: int = 1,
        robot: RobotName = "hand",
        control_mode: ControlMode = "delta_pose",
        obs_mode: ObsMode = "state",
        camera_size: tuple[int, int] = (320, 240),
        num_cameras: int = 1,
        camera_poses: Sequence[Any] | None = None,
        segmentation: bool = False,
        num_points: int = 2048,
        reward_mode: RewardMode = "dense",
        randomised: Sequence[str] = RANDOMISED,
        horizon: int = HORIZON,
        render_mode: str | None = None,
        **unknown: Any,
    ) -> None:
        self._keep_arguments(
            {n: v for n, v in locals().items() if n not in ("self", "unknown", "__class__")}
        )
        for name in unknown:
            arguments.require_known("argument", name, tuple(self._arguments))
        arguments.require_known("obs_mode", obs_mode, ObsMode)
        arguments.require_known("reward_mode", reward_mode, RewardMode)
        arguments.require_known("robot", robot, RobotName)
        arguments.require_known("control_mode", control_mode, ControlMode)
        if control_mode not in CONTROL_MODES[robot]:
            raise InvalidArgumentError(
                f"control_mode={control_mode!r} does not fit robot={robot!r}, which knows "
                f"{', '.join(CONTROL_MODES[robot])}."
            )
        if render_mode is not None:
            arguments.require_known("render_mode", render_mode, self.metadata["render_modes"])
        randomised = arguments.require_names("randomised", randomised)
        for name in randomised:
            arguments.require_known("randomised", name, RANDOMISED)
        self.camera_size = arguments.require_camera_size(camera_size)
        num_points = arguments.require_between("num_points", num_points, 1, 100_000)
        num_cameras = arguments.require_between(
            "num_cameras", num_cameras, 1, arguments.MAX_CAMERAS
        )
        horizon = arguments.require_between("horizon", horizon, 1, 1_000_000)
        target_part = arguments.require_between("target_part", target_part, 1, 99)
        self._Ts_world_camera = None
        if camera_poses is not None:
            self._Ts_world_camera = arguments.require_camera_poses(camera_poses)
            num_cameras = len(self._Ts_world_camera)
        self._object_ids = arguments.drawable_ids(categories, split, objects, target_part)
        self.obs_mode = obs_mode
        self.reward_mode: RewardMode = reward_mode
        self.render_mode = render_mode
        self.target_part = target_part
        self.robot: RobotName = robot
        self.control_mode: ControlMode = control_mode
        self.horizon = horizon
        self._randomised = frozenset(randomised)
        self._observation_config = ObservationConfig(
            mode=obs_mode,
            robot=robot,
            camera_size=self.camera_size,
            num_cameras=num_cameras,
            segmentation=arguments.require_flag("segmentation", segmentation),
            num_points=num_points,
            num_parts=arguments.most_parts(self._object_ids),
        )
        self.observation_space = self._observation_config.space()
        self._action_size = ACTION_SIZES[control_mode]
        self.action_space = spaces.Box(-1.0, 1.0, (self._action_size,), np.float32)
        # One renderer serves observations and render(); other modes need none.
        self._needs_renderer = obs_mode in IMAGE_MODES or render_mode == "rgb_array"
        self._render_system = own_render_system() if self._needs_renderer else None
        self._scene: ManipulationScene | None = None
        self._closed = False
        # Why no step may follow; a blow-up leaves nothing else to ask for either.
        self._over = ""
        self._blown_up = False

    def _keep_arguments(self, more: Mapping[str, Any]) -> None:
        """Remembers what this environment is made with, for copies and for snapshots."""
        by_value = {name: arguments.plain(value) for name, value in more.items()}
        self._arguments: dict[str, Any] = {**getattr(self, "_arguments", {}), **by_value}
        EzPickle.__init__(self, **self._arguments)

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
    def T_world_base(self) -> Array | None:
        """Pose (4, 4) of an arm's base; None for a floating hand."""
        self._require_running("T_world_base")
        return self._T_world_base

    @property
    def progress(self) -> Progress:
        """The target joint's motion so far."""
        self._require_running("progress")
        return self._progress

    @property
    def view(self) -> View:
        """The first camera of the running episode."""
        self._require_running("view")
        return self._views[0]

    def joint_positions(self) -> Array:
        """Positions (K - 1,) of all joints, metres or radians."""
        return self._running_scene("joint_positions").body.positions()

    def arm_positions(self) -> Array:
        """Positions (7,) of an arm's joints, radians; (0,) of a floating hand."""
        hand = self._running_scene("arm_positions").hand
        assert hand is not None
        return np.array(hand.arm_positions())

    def tcp_pose(self) -> Array:
        """``T_world_tcp`` (4, 4)."""
        hand = self._running_scene("tcp_pose").hand
        assert hand is not None
        return hand.tcp_pose()

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
            InvalidArgumentError: an unknown option, an open fraction outside [0, 1], or no seed.
            UnknownNameError: an object id that is not in the catalogue.
            NotReadyError: the environment is closed.
        """
        if self._closed:
            raise NotReadyError("reset() after close(): make a new environment.")
        options = {} if options is None else options
        arguments.read_options(options)
        super().reset(seed=arguments.require_seed(seed))
        self._begin(options)
        contact = _UNTOUCHED
        return self._observe(), self._report(contact)

    def _begin(self, options: Mapping[str, Any]) -> None:
        """Draws an episode and builds its scene."""
        object_id, fraction = arguments.read_options(options)
        asked = None
        if object_id is not None:
            asked = catalog.load(object_id)
            asked.joint_of(self.target_part)
        rng = self.np_random
        begun_with = copy.deepcopy(rng.bit_generator.state), dict(options)

        def source(name: str) -> np.random.Generator:
            """What a thing is drawn from: what is not to vary is drawn alike every time."""
            return rng if name in self._randomised else np.random.default_rng(0)

        target, T_world_base, T_world_hand = self._draw_target(asked, fraction, source)
        obj, T_world_object, q = target.model, target.T_world_object, target.q
        others = self._surroundings(target, source("placement"))
        views = self._draw_views(obj, source("camera"))
        table = random_table(source("table"))
        light_seed = int(source("lights").integers(2**31))
        cloud_rng = np.random.default_rng(int(rng.integers(2**31)))

        # Whatever cannot be done has been refused by now, and the running episode left as it is.
        self._drop_scene()
        self._begun_with = begun_with
        self._object, self._T_world_object = obj, T_world_object
        self._T_world_base = T_world_base
        self._joint = obj.joint_of(self.target_part)
        self._views = views
        self._scene = scene = ManipulationScene(
            obj,
            T_world_object,
            q,
            T_world_hand=T_world_hand,
            T_world_base=T_world_base,
            width=0.5 * MAX_WIDTH,
            render_system=self._render_system,
            table_material=table,
            others=others,
        )
        if self._needs_renderer:
            add_lights(scene.sapien_scene, np.random.default_rng(light_seed))
        self._observer = Observer(
            self._observation_config,
            scene,
            obj,
            T_world_object,
            self.target_part,
            self._views,
            cloud_rng,
        )
        self._pretty_camera = (
            RenderedCamera(scene.sapien_scene, _pretty_view(self._views[0]))
            if self.render_mode == "rgb_array"
            else None
        )
        start_fraction = float(self._joint.open_fraction(q[self.target_part - 1]))
        self._progress = Progress.begin(start_fraction)
        # How far it would be to the end of the range.
        self._way = 1.0 - start_fraction if self.direction > 0 else start_fraction
        self._succeeds = self._succeeded_once = False
        self._actions: list[list[float]] = []
        self._over, self._blown_up = "", False
        self._look()

    def step(self, action: NDArray[np.float32]) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Moves the robot for one control step.

        Raises:
            InvalidArgumentError: the action has a wrong shape or is not finite.
            NotReadyError: no episode is running: none was begun, or it is over.
        """
        if self._scene is None or self._over:
            self._require_running("step")
            raise NotReadyError(f"step: {self._over}; call reset().")
        numbers = arguments.read_action(action, self._action_size)
        contact = self._advance(numbers)
        if contact is None:
            # Nothing of a blow-up is shown: the last sound state stands in for it.
            self._over, self._blown_up = "the physics of this episode became unstable", True
            info = copy.deepcopy(self._last_info) | {"unstable": True}
            return copy.deepcopy(self._last_observation), 0.0, False, True, info
        info = self._report(contact)
        reward = rewards.reward(self.reward_mode, info["reward_terms"], self._progress)
        terminated, truncated = self._end()
        return self._observe(), reward, terminated, truncated, info

    def _advance(self, numbers: list[float]) -> PartContact | None:
        """Does an action; how the hand then touches the part, or None after a blow-up."""
        scene = self._scene
        assert scene is not None
        self._actions.append(numbers)
        self._move(numbers)
        scene.step(SUBSTEPS)
        reading = scene.read(self.target_part)
        fraction = self._joint.open_fraction(reading.q[self.target_part - 1])
        if not (
            reading.is_sound(MAX_STABLE_SPEED, MAX_STABLE_DISTANCE)
            and -MAX_STABLE_OVERSHOOT <= fraction <= 1.0 + MAX_STABLE_OVERSHOOT
        ):
            return None
        self._reading = reading
        self._grip_point = self._observer.grip_point(reading)
        contact = scene.contact(self.target_part)
        self._progress = self._progress.advance(fraction, contact.touched, contact.pinched)
        self._succeeds = bool(self._progress.success)
        self._succeeded_once |= self._succeeds
        return contact

    def _end(self) -> tuple[bool, bool]:
        """Whether the episode is terminated, and whether it is truncated; then it is over."""
        terminated = bool(
            self._succeeds and self._progress.headway(self.direction) >= DONE_SHARE * self._way
        )
        truncated = len(self._actions) >= self.horizon
        if terminated or truncated:
            self._over = "the episode is over"
        return terminated, truncated

    def _move(self, action: list[float]) -> None:
        """Tells the robot where to go."""
        scene = self._scene
        assert scene is not None
        hand = scene.hand
        assert hand is not None
        *motion, jaws = action
        hand.open_jaws(0.5 * MAX_WIDTH * (1.0 + jaws))
        if self.control_mode == "delta_joint":
            hand.turn_joints([MAX_JOINT_TURN * turn for turn in motion])  # type: ignore[union-attr]
            return
        dx, dy, dz, rx, ry, rz = motion
        x, y, z = self._reading.tcp_position
        (x0, y0, z0), (x1, y1, z1) = WORKSPACE_LOW, WORKSPACE_HIGH
        turn = quaternions.quaternion_from_rotation_vector(
            MAX_ROTATION * rx, MAX_ROTATION * ry, MAX_ROTATION * rz
        )
        target = (
            min(max(x + MAX_TRANSLATION * dx, x0), x1),
            min(max(y + MAX_TRANSLATION * dy, y0), y1),
            min(max(z + MAX_TRANSLATION * dz, z0), z1),
        )
        hand.pull_to(
            hand_from_tcp(target, quaternions.product(turn, self._reading.hand_quaternion))
        )

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

    # -- snapshots -----------------------------------------------------------------------------

    def get_state(self) -> Snapshot:
        """The running episode, to be gone on with by ``set_state``; see ``Snapshot``.

        Raises:
            NotReadyError: no episode is running.
        """
        self._require_running("get_state")
        generator, options = self._begun_with
        return Snapshot(
            environment=(type(self).__name__, self._arguments),
            generator=copy.deepcopy(generator),
            options=dict(options),
            actions=np.array(self._actions).reshape(-1, self._action_size),
            cloud_generator=copy.deepcopy(self._observer.generator_before),
        )

    def set_state(self, state: Snapshot) -> tuple[Any, dict[str, Any]]:
        """Brings an episode back as it was, and gives its observation and info again.

        Every later step and reset is the same to the last bit as it was, or would have been,
        after ``get_state``. Takes as long as the steps up to there without their observations.

        Raises:
            InvalidArgumentError: it was taken of an environment made with other arguments.
            NotReadyError: the environment is closed.
        """
        if self._closed:
            raise NotReadyError("set_state() after close(): make a new environment.")
        if not isinstance(state, Snapshot) or state.environment != (
            type(self).__name__,
            self._arguments,
        ):
            raise InvalidArgumentError(
                "set_state(): expected what get_state() gave, of an environment of the same class "
                f"made with the same arguments; got {getattr(state, 'environment', state)!r}, this "
                f"is {(type(self).__name__, self._arguments)!r}."
            )
        self.np_random.bit_generator.state = copy.deepcopy(state.generator)
        self._begin(state.options)
        contact: PartContact | None = _UNTOUCHED
        for numbers in state.actions.tolist():
            contact = self._advance(numbers)
        if contact is None:
            raise InvalidArgumentError("set_state(): the actions of this state end in a blow-up.")
        self._end()
        self._observer.restore_generator(state.cloud_generator)
        return self._observe(), self._report(contact)

    # -- what tasks may change -----------------------------------------------------------------

    def _start_fraction(self, obj: ArticulatedObject) -> tuple[float, float]:
        """Interval of the open fraction at which an episode starts."""
        return catalog.category_of(obj).start_fraction if self.direction > 0 else CLOSING_START

    def _draw_object(self, rng: np.random.Generator) -> ArticulatedObject:
        """One of the objects that have the target part."""
        while True:
            object_id = self._object_ids[int(rng.integers(len(self._object_ids)))]
            obj = catalog.load(object_id)
            if self.target_part < obj.num_parts:
                return obj

    def _draw_views(self, obj: ArticulatedObject, rng: np.random.Generator) -> tuple[View, ...]:
        """The cameras: where they were asked to be, or in front of the table."""
        if self._Ts_world_camera is None:
            cameras = self._view_distribution(obj)
            count = self._observation_config.num_cameras
            return tuple(cameras.sample(rng, *self.camera_size) for _ in range(count))
        width, height = self.camera_size
        return tuple(
            View(T_world_camera=T, fov_y=FIELD_OF_VIEW, width=width, height=height)
            for T in self._Ts_world_camera
        )

    def _draw_target(
        self,
        asked: ArticulatedObject | None,
        fraction: float | None,
        source: Callable[[str], np.random.Generator],
    ) -> tuple[PlacedObject, Array | None, Array]:
        """The object to be moved as it stands, and ``_robot_start``.

        Of objects drawn at random those are passed over whose part is out of an arm's reach.
        """
        rng = self.np_random
        for left in reversed(range(_DRAWS)):
            obj = self._draw_object(rng) if asked is None else asked
            drawn = float(rng.uniform(*self._start_fraction(obj)))
            T_world_object = random_placement(source("placement"))
            q = obj.positions_with(self.target_part, drawn if fraction is None else fraction)
            target = PlacedObject(model=obj, T_world_object=T_world_object, q=q)
            try:
                return target, *self._robot_start(target, source("hand"))
            except InvalidArgumentError:
                if asked is not None or not left:
                    raise
        raise AssertionError("the last draw returns or raises")

    def _robot_start(
        self, target: PlacedObject, rng: np.random.Generator
    ) -> tuple[Array | None, Array]:
        """Where an arm's base stands, None for a floating hand; and where the hand starts."""
        if self.robot == "hand":
            highest = target.model.bounds_at(target.q)[1]
            return None, random_hand_start(rng, highest) @ _T_TCP_HAND
        # Compiled kinematics, which a floating hand does not need, take long to load.
        from artgym.sim.workplace import arm_workplace

        return arm_workplace(
            target.model,
            target.T_world_object,
            target.q,
            self.target_part,
            self.direction,
            rng,
        )

    def _surroundings(
        self, target: PlacedObject, rng: np.random.Generator
    ) -> Sequence[PlacedObject]:
        """What else stands on the table."""
        return ()

    def _view_distribution(self, obj: ArticulatedObject) -> ViewDistribution:
        """Where cameras stand."""
        return ViewDistribution.around(obj)

    # -- parts of a step -----------------------------------------------------------------------

    def _look(self) -> None:
        """Reads the scene as it stands."""
        scene = self._scene
        assert scene is not None
        self._reading: Reading = scene.read(self.target_part)
        self._grip_point = self._observer.grip_point(self._reading)

    def _observe(self) -> Any:
        self._last_observation = self._observer.observe(
            self._reading, self._grip_point, float(self._progress.fraction)
        )
        return self._last_observation

    def _report(self, contact: PartContact) -> dict[str, Any]:
        """``info`` of the state just read."""
        progress = self._progress
        speed = self._reading.velocities[self.target_part - 1]
        distance = math.dist(self._grip_point, self._reading.tcp_position)
        reached = map(bool, progress.successes_at(REPORTED_TRAVELS))
        self._last_info = info = {
            "object_id": self._object.object_id,
            "success": self._succeeds,
            "success_gripped": bool(progress.success_gripped),
            "success_once": self._succeeded_once,
            "success_at": dict(zip(_REPORTED, reached, strict=True)),
            "success_maniskill": maniskill_success(progress, speed),
            "success_where2act": where2act_success(progress, self._joint.range),
            "travel": progress.travel,
            "engaged": progress.engaged,
            "gripped": progress.gripped,
            "open_fraction": progress.fraction,
            "reward_terms": rewards.dense_terms(
                distance, contact.pinched, progress, self.direction
            ),
            "elapsed_steps": len(self._actions),
            "unstable": False,
        }
        return info

    def _require_running(self, what: str) -> None:
        if self._scene is None:
            reason = "after close(): make a new environment" if self._closed else "before reset()"
            raise NotReadyError(f"{what} {reason}.")
        if self._blown_up:
            raise NotReadyError(f"{what}: {self._over}; call reset().")

    def _running_scene(self, what: str) -> ManipulationScene:
        self._require_running(what)
        assert self._scene is not None
        return self._scene

    def _drop_scene(self) -> None:
        self._pretty_camera = None
        if self._scene is not None:
            self._scene.close()
            self._scene = None


def _pretty_view(view: View) -> View:
    """The observed camera's place with a wider picture."""
    width, height = _PRETTY_SIZE
    return View(
        T_world_camera=view.T_world_camera, fov_y=1.2 * view.fov_y, width=width, height=height
    )


class ArtOpenEnv(ArticulatedEnv):
    """Open a part of an articulated object.

    **Description.** An object stands on a table, nearly closed. The robot, a floating Panda hand
    or a Panda arm, shall take hold of the target part and move it through at least half of its
    joint's range.

    **Action.** ``Box(-1, 1, float32)`` at 20 Hz, by ``control_mode``; values beyond are clipped.

    - ``"delta_pose"``, (7,): translation (x, y, z; 1 is 0.02 m) and rotation vector (1 is 0.1 rad)
      of the hand's tool centre, both in the world frame and relative to where the hand is; jaw
      opening (-1 closed, 1 open by 0.08 m).

    **Observation.** By ``obs_mode``:

    - ``"state"``: a vector of the fields of ``observations.STATE_FIELDS``. Privileged.
    - ``"state_dict"``: the same fields by name.
    - ``"rgb"``: of each camera ``rgb`` uint8 (H, W, 3), ``intrinsics`` (9,) and
      ``T_world_camera`` (16,) with OpenCV axes; and ``T_world_tcp`` (16,), ``jaw_width`` (1,) and
      ``target_part``. The second camera's fields end in ``_1``, and so on. Needs a renderer.
    - ``"rgbd"``: the same and ``depth`` float32 (H * W,), metres along z, 0 where nothing was seen.
    - ``"pointcloud"``: ``points`` float32 (num_points * 3,), world frame, of everything but the
      table that the first camera sees, drawn with repetition where there are too few; and the
      hand's fields. By ray casting, without a graphics driver.

    **Reward.** Dense, in [0, 1]: 0.2 for nearness of the tool centre to the part's grip point,
    0.2 for having the part between the fingers, 0.6 for opening it by half of its range in
    contact. Sparse: 1 in success, else 0. ``info["reward_terms"]`` lists the terms.

    **Start.** Object at the table's middle +-5 cm, turned by up to 20 degrees; its open fraction
    in the category's start interval; the hand above it, an arm's hand before the part, half open;
    cameras in front.

    **End.** Terminated when the part has made 90 % of the way that was left to the end of its
    range, in success. Truncated after ``horizon`` steps, or when physics becomes unstable
    (``info["unstable"]``; the last sound observation is shown). ``info["success"]`` follows
    ``tasks.success``: travel >= 0.5 with >= 80 % of the motion made while touching the part;
    ``info["success_gripped"]`` asks that the part be between the fingers.

    **Arguments.**

    Args:
        categories: categories to draw objects from; by default all that have such a split and the
            target part.
        split: "train", "val" or "test".
        objects: ids to draw from instead of whole categories.
        target_part: index of the part to move.
        robot: "hand" floats; "panda" is an arm, whose base stands where it can take the part and
            carry it. An object asked for whose part no arm can carry is an error in ``reset``.
        control_mode: see Action.
        obs_mode: see Observation.
        camera_size: (width, height) of the observed pictures, pixels.
        num_cameras: how many cameras see the scene.
        camera_poses: where they stand, ``T_world_camera`` (4, 4) each with OpenCV axes, instead
            of at random places; their vertical field of view is 0.65 rad.
        segmentation: whether pictures and clouds come with ``segmentation``.
        num_points: of a point cloud.
        reward_mode: "dense" or "sparse".
        randomised: what an episode draws at random besides its object and the part's start:
            "placement", "hand", "camera", "table", "lights"; the rest is the same every time.
        horizon: control steps after which an episode is truncated.
        render_mode: None or "rgb_array".

    Options of ``reset``: ``object_id`` and ``open_fraction`` choose the episode's object and
    start. ``get_state`` and ``set_state`` bring an episode back, to the last bit.

    **Version history.** v0: first version.
    """

    direction = 1.0


class ArtCloseEnv(ArticulatedEnv):
    """Close a part of an articulated object.

    **Description.** As ``ArtOpenEnv``, but the part stands open and is to be closed by at least
    half of its range.

    **Action.** As ``ArtOpenEnv``.

    **Observation.** As ``ArtOpenEnv``.

    **Reward.** As ``ArtOpenEnv``; the last term pays for closing.

    **Start.** As ``ArtOpenEnv``; the open fraction is between 0.6 and 0.9.

    **End.** As ``ArtOpenEnv``: terminated when it is closed but for a tenth of the way.

    **Arguments.** As ``ArtOpenEnv``.

    **Version history.** v0: first version.
    """

    direction = -1.0
