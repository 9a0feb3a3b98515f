"""Where an arm stands and its hand starts."""

from __future__ import annotations

import gymnasium
import numpy as np
import pytest

import artgym  # noqa: F401  registers the environments
from artgym.objects import catalog
from artgym.sim.workplace import arm_workplace


@pytest.mark.parametrize("object_id", ["drawer/0000", "cabinet/0000", "door/0004"])
@pytest.mark.parametrize(("direction", "fraction"), [(1.0, 0.1), (-1.0, 0.8)])
def test_the_hand_comes_from_outside_to_open_and_to_close(object_id, direction, fraction):
    obj = catalog.load(object_id)
    q = obj.positions_with(1, fraction)
    base, hand = arm_workplace(obj, np.eye(4), q, 1, direction, np.random.default_rng(0))
    part, joint = obj.link_poses(q)[1], obj.joint_of(1)
    # Where a point of the part goes when it opens a little more.
    ahead = obj.link_poses(obj.positions_with(1, fraction + 0.01))[1]
    grip = np.append(obj.grip_point(1), 1.0)
    opening = (ahead @ grip - part @ grip)[:3]
    assert hand[:3, 2] @ opening < 0.5 * np.linalg.norm(opening), joint.name
    assert base[2, 3] >= 0.0


@pytest.mark.parametrize("category", ["Drawer", "Cabinet"])
def test_nothing_is_in_the_way_of_an_arm_that_closes(category):
    env = gymnasium.make(f"ArtClose{category}-v0", robot="panda", control_mode="delta_joint")
    for seed in range(6):
        env.reset(seed=seed)
        *_, truncated, info = env.step(np.zeros(8, np.float32))
        assert not truncated, info["object_id"]
    env.close()
