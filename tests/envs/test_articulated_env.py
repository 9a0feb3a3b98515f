"""What is particular to the single-object environment."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from artgym.control import MAX_ROTATION, MAX_TRANSLATION
from artgym.envs import articulated_env
from artgym.envs.articulated_env import ArtOpenEnv
from artgym.envs.observations import STATE_FIELDS
from artgym.geometry import transforms
from artgym.geometry.camera import look_at
from artgym.geometry.rotations import axis_angle_from_matrix
from artgym.objects import catalog
from artgym.objects.surface import grid_points
from artgym.sim.conversion import pose_from_transform

CATEGORIES = list(catalog.CATEGORIES)
#: What single precision makes of a joint at rest, as a share of its range.
ROUNDING = 1e-6


def fields(observation):
    ends = np.cumsum(list(STATE_FIELDS["hand"].values()))
    return dict(zip(STATE_FIELDS["hand"], np.split(observation, ends[:-1]), strict=True))


def require_idle_does_nothing(ids, steps):
    env = ArtOpenEnv(objects=ids)
    for seed, object_id in enumerate(ids):
        env.reset(seed=seed, options={"object_id": object_id})
        for _ in range(steps):
            _, reward, terminated, truncated, info = env.step(np.zeros(7, np.float32))
            assert not terminated
            assert not truncated
        assert info["travel"] < ROUNDING, object_id
        assert info["engaged"] == info["gripped"] == 0.0
        assert not any(info["success_at"].values())
        for rule in ("success", "success_gripped", "success_once", "success_maniskill"):
            assert not info[rule], rule
        assert info["reward_terms"]["move"] == info["reward_terms"]["grip"] == 0.0
        assert reward <= 0.2
    env.close()


@pytest.mark.parametrize("category", CATEGORIES)
def test_doing_nothing_moves_nothing(category):
    require_idle_does_nothing(catalog.all_ids(category, 5), steps=60)


@pytest.mark.slow
@pytest.mark.parametrize("category", CATEGORIES)
def test_doing_nothing_moves_none_of_two_hundred(category):
    require_idle_does_nothing(catalog.all_ids(category, 200), steps=300)


def test_state_vector():
    env = ArtOpenEnv()
    for seed, object_id in enumerate(["drawer/0003", "laptop/0003"]):
        observation, info = env.reset(seed=seed, options={"object_id": object_id})
        state, T_world_tcp = fields(observation), env.tcp_pose()
        joint = env.object.joint_of(1)
        np.testing.assert_allclose(state["tcp_position"], T_world_tcp[:3, 3], atol=1e-6)
        np.testing.assert_allclose(state["tcp_x_axis"], T_world_tcp[:3, 0], atol=1e-6)
        np.testing.assert_allclose(state["tcp_z_axis"], T_world_tcp[:3, 2], atol=1e-6)
        assert state["open_fraction"][0] == pytest.approx(info["open_fraction"])
        assert state["jaw_width"][0] == pytest.approx(0.04, abs=1e-4)
        assert state["is_revolute"][0] == float(joint.type == "revolute")
        axis = env.T_world_object[:3, :3] @ np.asarray(joint.axis)
        np.testing.assert_allclose(state["joint_axis"], axis, atol=1e-6)
        np.testing.assert_allclose(
            state["tcp_to_grip_point"], state["grip_point"] - state["tcp_position"], atol=1e-6
        )
    env.close()


def test_point_cloud_lies_on_the_object_and_the_hand():
    env = ArtOpenEnv(obs_mode="pointcloud", num_points=1000)
    observation, _ = env.reset(seed=0, options={"object_id": "drawer/0004", "open_fraction": 0.5})
    points = observation["points"].reshape(-1, 3)
    Ts = env.T_world_object @ env.object.link_poses(env.joint_positions())
    surface = np.concatenate(
        [
            transforms.apply(T, grid_points(link, 0.008))
            for T, link in zip(Ts, env.object.links, strict=True)
        ]
    )
    gap, _ = cKDTree(surface).query(points)
    from_hand = np.linalg.norm(points - env.tcp_pose()[:3, 3], axis=1)
    on_object, on_hand = gap < 0.008, from_hand < 0.2
    assert np.all(on_object | on_hand)
    assert on_object.mean() > 0.3
    env.close()


def test_actions_move_the_tool_in_the_world_frame():
    for axis in range(6):
        env = ArtOpenEnv()
        env.reset(seed=0)
        before, action = env.tcp_pose(), np.zeros(7, np.float32)
        action[axis] = 1.0
        for _ in range(10):
            env.step(action)
        for _ in range(10):
            env.step(np.zeros(7, np.float32))
        after = env.tcp_pose()
        shift = after[:3, 3] - before[:3, 3]
        turn = axis_angle_from_matrix(after[:3, :3] @ before[:3, :3].T)
        moved = np.concatenate([shift / MAX_TRANSLATION, turn / MAX_ROTATION])
        # Lag makes it somewhat less or more than ten full steps, in no other direction.
        assert 4.0 < moved[axis] < 12.0
        assert np.abs(np.delete(moved, axis)).max() < 0.5
        env.close()


def test_jaws():
    env = ArtOpenEnv()
    env.reset(seed=0)
    for value, width in ((1.0, 0.08), (-1.0, 0.0), (0.0, 0.04)):
        action = np.zeros(7, np.float32)
        action[6] = value
        for _ in range(10):
            env.step(action)
        assert env.jaw_width() == pytest.approx(width, abs=2e-3)
    env.close()


@pytest.mark.parametrize("category", CATEGORIES)
def test_start_states(category):
    split = "test" if catalog.category(category).held_out else "train"
    env = ArtOpenEnv(categories=(category,), split=split)
    low, high = catalog.category(category).start_fraction
    seen = set()
    for seed in range(30):
        _, info = env.reset(seed=seed)
        assert low - 1e-6 <= info["open_fraction"] <= high + 1e-6
        assert info["object_id"].startswith(f"{category}/")
        assert catalog.split_of(info["object_id"]) == split
        assert np.abs(env.T_world_object[:2, 3]).max() <= 0.05
        assert env.tcp_pose()[2, 3] > 0.6
        seen.add(info["object_id"])
    assert len(seen) > 25
    env.close()


def test_objects_are_drawn_from_those_given():
    env = ArtOpenEnv(objects=["drawer/0005", "laptop/1203"])
    drawn = {env.reset(seed=seed)[1]["object_id"] for seed in range(20)}
    assert drawn == {"drawer/0005", "laptop/1203"}
    env.close()


@pytest.mark.parametrize("obs_mode", ["state", "pointcloud"])
def test_a_blow_up_ends_the_episode_and_leaves_no_trace(obs_mode):
    env = ArtOpenEnv(obs_mode=obs_mode, num_points=64)
    rest, _ = env.reset(seed=1)
    env.reset(seed=0)
    last, *_ = env.step(np.zeros(7, np.float32))
    far_away = pose_from_transform(transforms.translation([0.0, 0.0, 10.0]))
    env._scene.hand._articulation.root_pose = far_away
    observation, reward, terminated, truncated, info = env.step(np.zeros(7, np.float32))
    assert truncated
    assert info["unstable"]
    assert (reward, terminated) == (0.0, False)
    assert env.observation_space.contains(observation)
    pairs = [(observation, last)] if obs_mode == "state" else [
        (observation[k], last[k]) for k in observation
    ]  # fmt: skip
    for shown, before in pairs:
        np.testing.assert_array_equal(shown, before)
        assert not np.shares_memory(shown, before)
    again, info = env.reset(seed=1)
    assert not info["unstable"]
    np.testing.assert_array_equal(
        again if obs_mode == "state" else again["points"],
        rest if obs_mode == "state" else rest["points"],
    )
    env.close()


def test_a_part_far_beyond_its_range_is_a_blow_up(monkeypatch):
    env = ArtOpenEnv()
    env.reset(seed=0)
    # Shrinks what is tolerated, so that a part that stands nearly closed is beyond it.
    monkeypatch.setattr(articulated_env, "MAX_STABLE_OVERSHOOT", -0.2)
    _, reward, terminated, truncated, info = env.step(np.zeros(7, np.float32))
    assert (reward, terminated, truncated, info["unstable"]) == (0.0, False, True, True)
    assert info["travel"] == 0.0
    env.close()


def test_open_environments_do_not_see_each_other(render_system):
    def picture(env):
        observation, _ = env.reset(seed=0, options={"object_id": "laptop/0000"})
        return observation["rgb"], observation["depth"]

    first, second = (
        ArtOpenEnv(obs_mode="rgbd", render_mode="rgb_array", camera_size=(64, 48)) for _ in range(2)
    )
    alone = picture(first)
    second.reset(seed=1, options={"object_id": "drawer/0003", "open_fraction": 1.0})
    for before, now in zip(alone, picture(first), strict=True):
        np.testing.assert_array_equal(before, now)
    second.render()
    first.close()
    second.close()


def test_sparse_reward_is_success():
    env = ArtOpenEnv(reward_mode="sparse")
    env.reset(seed=0)
    for _ in range(10):
        _, reward, *_, info = env.step(np.zeros(7, np.float32))
        assert reward == float(info["success"]) == 0.0
    env.close()


def test_cameras_stand_where_they_are_asked_to(render_system):
    poses = [look_at([1.0, y, 0.8], [0.0, 0.0, 0.1]) for y in (-0.3, 0.3)]
    env = ArtOpenEnv(obs_mode="rgbd", camera_poses=poses, camera_size=(64, 48))
    for seed in range(2):
        observation, _ = env.reset(seed=seed)
        assert env.observation_space.contains(observation)
        for name, pose in zip(("T_world_camera", "T_world_camera_1"), poses, strict=True):
            np.testing.assert_allclose(observation[name].reshape(4, 4), pose, atol=1e-6)
        assert not np.array_equal(observation["rgb"], observation["rgb_1"])
    env.close()


def test_what_is_not_randomised_is_the_same_every_time():
    env = ArtOpenEnv(objects=("drawer/0003",), randomised=())
    starts = [env.reset(seed=seed)[0] for seed in range(2)]
    places = [fields(start) for start in starts]
    for name in ("tcp_position", "joint_axis", "joint_pivot"):
        np.testing.assert_array_equal(places[0][name], places[1][name])
    assert places[0]["open_fraction"] != places[1]["open_fraction"]
    env.close()
