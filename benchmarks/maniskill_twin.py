"""The scene of ``ArtOpen-v0`` as a ManiSkill environment, to compare speeds with.

It is written as a competitor would write it, by ManiSkill's own means and without handicap; where
there was a choice, the one that is faster for ManiSkill was taken:

- Backend: ``physx_cpu`` with one environment, as a single environment is run. In state mode
  ``render_backend="none"``: ManiSkill's default would load meshes and textures that nobody sees.
- Time: control at 20 Hz, six substeps of 1/120 s; solver settings are ManiSkill's defaults (15
  position iterations, one of velocity: ours has 15 for the object too).
- Hand: ManiSkill's own ``floating_panda_gripper``, gains and force limits as they come, steps of
  the action reduced to ours (0.02 m, 0.1 rad). It hangs on six joints and has
  ``pd_ee_delta_pose`` (inverse kinematics, as ours turn in the world) and ``pd_joint_delta_pos``
  (targets of the six joints, without kinematics: the cheapest controller there is). Both are
  measured.
- Object: our URDF export, written before anything is timed, read by ManiSkill's URDF loader as its
  tasks read PartNet-Mobility. Our textures are not in it: its pictures are simpler to draw. Dry
  friction is the drive that ours has; links do not collide with each other, as with ours.
  What nothing touches may go to sleep, as ManiSkill has it by default.
- Table: a box as ours. No ground, no second table.
- Success and reward: ours, on tensors: travel, and the shares of it made while touched and while
  pinched; reach, grip and move terms. The contacts are gone through once, by identity of bodies;
  ManiSkill's ``get_pairwise_contact_forces`` would go through them three times. ``info`` is
  shorter than ours.
- State: what its robots report of themselves (positions and velocities of the joints), pose of the
  tool centre, joint, grip point, and constants made once an episode: as much as ours.
- Pictures: ``rgb+depth`` of one camera with the ``minimal`` shader, its default and fastest, no
  shadows, default lights, at the pose of our camera; depth stays in int16 millimetres as it comes.
  The renderer is the one that ours uses.
- Reset: draws as ours does; the scene stays, which is ManiSkill's way. Another object takes
  ``options=dict(reconfigure=True)``: ManiSkill builds its scene anew then.

Only what ManiSkill imports anyway and the rules of contact, reward and success are imported here,
so that it does not pay for our packages.
"""

from __future__ import annotations

import math
from copy import deepcopy
from typing import Any

import numpy as np
import torch
from mani_skill.agents.registration import register_agent
from mani_skill.agents.robots.floating_panda_gripper import FloatingPandaGripper
from mani_skill.envs.sapien_env import BaseEnv
from mani_skill.sensors.camera import CameraConfig
from mani_skill.utils.registration import register_env
from mani_skill.utils.structs import Link, Pose
from mani_skill.utils.structs.types import SimConfig

from artgym.sim.contact import part_contact
from artgym.tasks.rewards import GRIP, MOVE, REACH, REACH_SCALE
from artgym.tasks.success import TRAVEL_THRESHOLD, Progress
from benchmarks.twin_asset import TwinAsset

#: Largest move of the hand in one control step: metres and radians at an action of 1.
MAX_TRANSLATION, MAX_ROTATION = 0.02, 0.1

_OBJECT_BIT = 29


@register_agent()
class TwinGripper(FloatingPandaGripper):
    """ManiSkill's floating Panda gripper with steps as long as ours."""

    uid = "artgym_twin_gripper"

    @property
    def _controller_configs(self) -> dict[str, Any]:
        configs: dict[str, Any] = deepcopy(super()._controller_configs)
        reach = [MAX_TRANSLATION] * 3 + [MAX_ROTATION] * 3
        pose, joints = configs["pd_ee_delta_pose"]["root"], configs["pd_joint_delta_pos"]["root"]
        pose.pos_lower, pose.pos_upper = -MAX_TRANSLATION, MAX_TRANSLATION
        pose.rot_lower, pose.rot_upper = -MAX_ROTATION, MAX_ROTATION
        joints.lower, joints.upper = [-r for r in reach], reach
        kept = {name: configs[name] for name in ("pd_ee_delta_pose", "pd_joint_delta_pos")}
        for config in kept.values():
            # What the controller takes for granted anyway, with a warning for each scene.
            left, right = config["gripper"].joint_names
            config["gripper"].mimic = {left: {"joint": right}}
        return kept


@register_env("ArtOpenTwin-v0", max_episode_steps=300)
class OpenTwinEnv(BaseEnv):
    """Open a part of an articulated object with ManiSkill's floating Panda gripper.

    Args:
        asset: the object.
        camera: ``T_world_simcam`` as position and quaternion (7,), vertical field of view in
            radians, and (width, height); None for no camera.
        more: of ``BaseEnv``.
    """

    SUPPORTED_ROBOTS = [TwinGripper.uid]  # noqa: RUF012

    def __init__(
        self,
        *,
        asset: TwinAsset,
        camera: tuple[list[float], float, tuple[int, int]] | None = None,
        **more: Any,
    ) -> None:
        self._asset = asset
        self._camera = camera
        self._rng = np.random.default_rng(0)
        super().__init__(robot_uids=TwinGripper.uid, num_envs=1, sim_backend="physx_cpu", **more)

    @property
    def _default_sim_config(self) -> SimConfig:
        return SimConfig(sim_freq=120, control_freq=20)

    @property
    def _default_sensor_configs(self) -> list[CameraConfig]:
        if self._camera is None:
            return []
        pose, fov, (width, height) = self._camera
        return [
            CameraConfig(
                uid="camera",
                pose=Pose.create_from_pq(torch.tensor(pose[:3]), torch.tensor(pose[3:])),
                width=width,
                height=height,
                fov=fov,
                near=0.05,
                far=6.0,
                shader_pack="minimal",
            )
        ]

    def _load_agent(self, options: dict[str, Any]) -> None:  # pyright: ignore
        super()._load_agent(options, Pose.create_from_pq(torch.zeros(3)).sp)

    def _load_scene(self, options: dict[str, Any]) -> None:
        self._asset = asset = options.get("asset", self._asset)
        table = self.scene.create_actor_builder()
        table.add_box_collision(half_size=asset.table_half_size)
        if self.scene.can_render():
            table.add_box_visual(half_size=asset.table_half_size)
        below = torch.tensor([0.0, 0.0, -asset.table_half_size[2]])
        table.initial_pose = Pose.create_from_pq(below)
        table.build_static("table")

        loader = self.scene.create_urdf_loader()
        loader.fix_root_link = True
        builder = loader.parse(asset.urdf)["articulation_builders"][0]
        builder.initial_pose = Pose.create_from_pq(torch.zeros(3))
        self.object = builder.build("object")
        for link in self.object.links:
            link.set_collision_group_bit(group=2, bit_idx=_OBJECT_BIT, bit=1)
        joints = self.object.active_joints
        for joint, friction, slip in zip(joints, asset.frictions, asset.slips, strict=True):
            joint.set_drive_properties(0.0, friction / slip, friction)
        self.part = self.object.links_map[asset.part_name]
        child = joints[asset.joint_index].child_link
        assert child is not None
        assert child.name == asset.part_name
        self._bodies = {
            link._bodies[0]: i
            for i, link in enumerate(
                (self._hand, self.agent.finger1_link, self.agent.finger2_link)  # pyright: ignore
            )
        }
        self._target_body = self.part._bodies[0]
        self._grip_point_part = torch.tensor([asset.grip_point])

    @property
    def _hand(self) -> Link:
        return self.agent.robot.links_map["panda_hand"]

    def _initialize_episode(self, env_idx: torch.Tensor, options: dict[str, Any]) -> None:
        asset, rng = self._asset, self._rng
        max_yaw, max_shift = asset.placement
        yaw = float(rng.uniform(-max_yaw, max_yaw))
        shift = rng.uniform(-max_shift, max_shift, 2)
        c, s = math.cos(yaw), math.sin(yaw)
        position = torch.tensor([[shift[0], shift[1], 0.0]], dtype=torch.float32)
        turn = torch.tensor([[math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)]])
        placement: Any = Pose.create_from_pq(position, turn)
        self.object.set_pose(placement)
        q = list(asset.rest)
        low, high = asset.start
        q[asset.joint_index] = float(rng.uniform(low, high))
        self.object.set_qpos(torch.tensor([q], dtype=torch.float32))
        # Pointing down: the hand's frame lies above its tool centre.
        lowest, highest = asset.hand_start
        x, y, z = rng.uniform(lowest, highest)
        roll = rng.uniform(-np.pi / 2, np.pi / 2)
        qpos = torch.tensor([[x, y, z + 0.1034, 0.0, np.pi, roll, 0.02, 0.02]])
        self.agent.robot.set_qpos(qpos.to(torch.float32))
        R = torch.tensor([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        axis = R @ torch.tensor(asset.axis)
        pivot = R @ torch.tensor(asset.pivot) + position[0]
        kind = torch.tensor([float(asset.is_revolute)])
        self._constants = torch.cat([kind, axis, pivot, torch.tensor(asset.part_size)])[None]
        self._progress = Progress.begin(self._open_fraction())

    def _open_fraction(self) -> torch.Tensor:
        asset = self._asset
        q = self.object.get_qpos()[:, asset.joint_index]
        return (q - asset.closed) / (asset.open - asset.closed)

    def _closing(self) -> Any:
        return self._hand.pose.sp.to_transformation_matrix()[:3, 1].tolist()

    def evaluate(self) -> dict[str, Any]:
        """Success by our rule, and what reward and observation need of it."""
        contact = part_contact(
            self.scene.get_contacts(), self._target_body, self._bodies, self._closing
        )
        self._progress = progress = self._progress.advance(
            self._open_fraction(), contact.touched, contact.pinched
        )
        part = self.part.pose
        grip_point = (part * Pose.create_from_pq(self._grip_point_part)).p
        return {
            "success": progress.success,
            "success_gripped": progress.success_gripped,
            "travel": progress.travel,
            "engaged": progress.engaged,
            "open_fraction": progress.fraction,
            "pinched": contact.pinched,
            "grip_point": grip_point,
        }

    def _get_obs_extra(self, info: dict[str, Any]) -> dict[str, Any]:
        tcp = self.agent.tcp.pose  # pyright: ignore[reportAttributeAccessIssue]
        extra = {"tcp_pose": tcp.raw_pose}
        if "state" in self.obs_mode:
            index = self._asset.joint_index
            extra |= {
                "open_fraction": info["open_fraction"],
                "joint_velocity": self.object.get_qvel()[:, index],
                "grip_point": info["grip_point"],
                "tcp_to_grip_point": info["grip_point"] - tcp.p,
                "constants": self._constants,
            }
        return extra

    def compute_dense_reward(
        self, obs: Any, action: torch.Tensor, info: dict[str, Any]
    ) -> torch.Tensor:
        """Ours: reach, grip and move; in [0, 1]."""
        tcp = self.agent.tcp.pose.p  # pyright: ignore[reportAttributeAccessIssue]
        distance = torch.linalg.norm(info["grip_point"] - tcp, dim=1)
        moved = torch.clamp(info["travel"] / TRAVEL_THRESHOLD, max=1.0)
        reach = REACH * (1.0 - torch.tanh(distance / REACH_SCALE))
        return reach + GRIP * info["pinched"] + MOVE * moved * info["engaged"]

    def compute_normalized_dense_reward(
        self, obs: Any, action: torch.Tensor, info: dict[str, Any]
    ) -> torch.Tensor:
        """The dense reward, which lies in [0, 1] already."""
        return self.compute_dense_reward(obs=obs, action=action, info=info)
