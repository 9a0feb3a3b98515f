"""The Panda arm goes where it is pulled, holds still, and grips as the floating hand does."""

from __future__ import annotations

import numpy as np
import pytest

from artgym.errors import InvalidArgumentError
from artgym.geometry import transforms
from artgym.geometry.hand import HAND_BOXES
from artgym.geometry.rotations import geodesic_angle, matrix_from_axis_angle
from artgym.objects import catalog
from artgym.sim.arm import PandaArm
from artgym.sim.conversion import pose_from_transform, transform_from_pose
from artgym.sim.kinematics import REST, choose_base, link_poses, panda_chain
from artgym.sim.scene import ManipulationScene
from tests.sim.poses import CLOSING_UP, bar_bounds, drawer_with_lying_bar, hand_from_tcp

#: A base behind the table's middle, turned a little.
T_WORLD_BASE = transforms.transform_from(matrix_from_axis_angle([0.0, 0.0, 0.4]), [-0.4, -0.3, 0.0])
T_WORLD_HAND = T_WORLD_BASE @ link_poses(REST)[-1]
#: Simulator steps in a control step.
SUBSTEPS = 6


def empty_scene(**kwargs):
    """A table with an object well away from the arm, in reach of nothing."""
    T_world_object = transforms.translation([-3.0, 0.0, 0.0])
    obj = catalog.load("drawer/0003")
    return ManipulationScene(obj, T_world_object, obj.rest_positions, **kwargs)


def arm_in(scene, T_world_base=T_WORLD_BASE, T_world_hand=T_WORLD_HAND, **kwargs):
    arm = PandaArm(scene.sapien_scene, T_world_base, T_world_hand, 0.06, visuals=False, **kwargs)
    return arm


def gap(T_a, T_b):
    return np.array(
        [np.linalg.norm(T_a[:3, 3] - T_b[:3, 3]), geodesic_angle(T_a[:3, :3], T_b[:3, :3])]
    )


def assert_inside_ranges(arm, slack=2e-3):
    chain, q = panda_chain(), np.array(arm.arm_positions())
    assert (q >= chain.lower - slack).all()
    assert (q <= chain.upper + slack).all()


def test_links_are_where_the_chain_puts_them():
    scene = empty_scene()
    arm = arm_in(scene)
    chain, rng = panda_chain(), np.random.default_rng(0)
    links = (*arm.links[3:], arm.links[0])
    for _ in range(100):
        q = rng.uniform(chain.lower, chain.upper)
        arm.links[0].articulation.qpos = np.concatenate([q, [0.03, 0.03]])
        np.testing.assert_allclose(arm.arm_positions(), q, atol=1e-6)
        got = np.stack([transform_from_pose(link.entity_pose) for link in links])
        expected = T_WORLD_BASE @ link_poses(q)
        np.testing.assert_allclose(got[:, :3, 3], expected[:, :3, 3], atol=1e-5)
        assert geodesic_angle(got[:, :3, :3], expected[:, :3, :3]).max() < 1e-5
    scene.close()


def test_starts_where_it_is_told():
    scene = empty_scene()
    arm = arm_in(scene)
    assert gap(arm.pose(), T_WORLD_HAND).max() < 1e-5
    assert arm.width() == pytest.approx(0.06, abs=1e-6)
    assert [link.name for link in arm.links[:3]] == ["panda_hand", "panda_left", "panda_right"]
    assert len(arm.links[0].collision_shapes) == sum(box.link == "hand" for box in HAND_BOXES)
    scene.close()


def test_refuses_a_start_out_of_reach():
    scene = empty_scene()
    far = transforms.translation([-2.0, 0.0, 0.0]) @ T_WORLD_HAND
    with pytest.raises(InvalidArgumentError, match=r"T_world_hand: .* comes no nearer"):
        arm_in(scene, T_world_hand=far)
    scene.close()


def shifted(share):
    return transforms.translation(share * np.array([0.0, 0.2, 0.0])) @ T_WORLD_HAND


def turned(share):
    return T_WORLD_HAND @ transforms.transform_from(
        matrix_from_axis_angle([0.0, 0.0, 0.5 * np.pi * share]), np.zeros(3)
    )


def tilted(share):
    return (
        transforms.translation([0.0, 0.0, 0.1])
        @ T_WORLD_HAND
        @ transforms.transform_from(
            matrix_from_axis_angle([0.5 * np.pi * share, 0.0, 0.0]), np.zeros(3)
        )
    )


@pytest.mark.parametrize("path", [shifted, turned, tilted])
def test_follows(path):
    scene = empty_scene()
    arm = arm_in(scene, T_world_hand=path(0.0))
    for share in np.linspace(0.0, 1.0, 41):
        target = path(share)
        arm.pull_to(pose_from_transform(target))
        scene.step(SUBSTEPS)
        position_error, rotation_error = gap(arm.pose(), target)
        assert position_error < 0.005
        assert rotation_error < 0.05
    scene.step(60)
    assert gap(arm.pose(), path(1.0)).max() < 5e-4
    scene.close()


@pytest.mark.parametrize("commanded", [False, True])
def test_holds_still(commanded):
    scene = empty_scene()
    # Away from the rest posture.
    T_world_hand = transforms.translation([0.1, 0.15, 0.1]) @ T_WORLD_HAND
    arm = arm_in(scene, T_world_hand=T_world_hand)
    start = np.array(arm.arm_positions())
    for _ in range(40):
        if commanded:
            arm.pull_to(pose_from_transform(T_world_hand))
        scene.step(SUBSTEPS)
        assert np.linalg.norm(arm.pose()[:3, 3] - T_world_hand[:3, 3]) < 1e-4
    assert np.abs(np.array(arm.arm_positions()) - start).max() < 3e-3
    assert np.abs(arm.arm_velocities()).max() < 1e-3
    scene.close()


def test_identical_runs_are_bit_identical():
    runs = []
    for _ in range(2):
        rng = np.random.default_rng(7)
        scene = empty_scene()
        arm = arm_in(scene)
        target, states = T_WORLD_HAND, []
        for i in range(40):
            move = transforms.transform_from(
                matrix_from_axis_angle(rng.uniform(-0.1, 0.1, 3)), rng.uniform(-0.02, 0.02, 3)
            )
            target = target @ move
            if i % 4 == 3:
                arm.turn_joints(rng.uniform(-0.05, 0.05, 7))
            else:
                arm.pull_to(pose_from_transform(target))
            arm.open_jaws(0.08 * rng.random())
            scene.step(SUBSTEPS)
            states.append([*arm.arm_positions(), *arm.arm_velocities(), arm.width()])
        runs.append(np.array(states))
        scene.close()
    np.testing.assert_array_equal(runs[0], runs[1])
    assert np.ptp(runs[0], axis=0).min() > 0.0


def test_joints_turn_and_stop_at_their_ends():
    scene = empty_scene()
    height = transforms.translation([0.0, 0.0, 0.8])
    arm = arm_in(scene, height @ T_WORLD_BASE, height @ T_WORLD_HAND)
    before = np.array(arm.arm_positions())
    turns = np.array([0.1, -0.05, 0.08, 0.1, -0.1, 0.05, 0.2])
    arm.turn_joints(turns)
    scene.step(120)
    np.testing.assert_allclose(arm.arm_positions(), before + turns, atol=1e-3)
    chain = panda_chain()
    for sign, ends in ((1.0, chain.upper), (-1.0, chain.lower)):
        for _ in range(100):
            arm.turn_joints(np.full(7, sign * 0.1))
            scene.step(2)
            assert_inside_ranges(arm)
        scene.step(240)
        assert np.abs(ends - arm.arm_positions()).max() < 0.03
    with pytest.raises(InvalidArgumentError, match="turns: expected 7 finite numbers"):
        arm.turn_joints(np.zeros(6))
    scene.close()


def test_target_out_of_reach_leaves_it_finite():
    scene = empty_scene()
    arm = arm_in(scene)
    ahead = T_WORLD_BASE[:3, 0]
    for _ in range(60):
        arm.pull_to(pose_from_transform(transforms.translation(2.0 * ahead) @ T_WORLD_HAND))
        scene.step(SUBSTEPS)
        assert np.isfinite(arm.arm_positions()).all()
        assert np.isfinite(arm.pose()).all()
        assert_inside_ranges(arm)
    assert np.abs(arm.arm_velocities()).max() < 0.05
    reach = np.dot(arm.pose()[:3, 3] - T_WORLD_BASE[:3, 3], ahead)
    assert reach > 0.75
    # It comes back.
    for _ in range(40):
        arm.pull_to(pose_from_transform(T_WORLD_HAND))
        scene.step(SUBSTEPS)
    assert gap(arm.pose(), T_WORLD_HAND).max() < 1e-3
    scene.close()


def test_table_stops_the_arm():
    scene = empty_scene()
    arm = arm_in(scene)
    for depth in np.linspace(0.0, 0.3, 40):
        arm.pull_to(pose_from_transform(transforms.translation([0, 0, -depth]) @ T_WORLD_HAND))
        scene.step(SUBSTEPS)
    tips = arm.tcp_pose()[2, 3]
    assert -0.002 < tips < 0.02
    scene.close()


def test_base_rests_on_its_column_without_contact():
    T_world_base = transforms.translation([0.0, 0.0, 0.45]) @ T_WORLD_BASE
    scene = empty_scene()
    arm = arm_in(scene, T_world_base, transforms.translation([0.0, 0.0, 0.45]) @ T_WORLD_HAND)
    scene.step(30)
    shapes = arm.links[3].collision_shapes
    assert len(shapes) == 2
    column = shapes[1]
    bottom = (arm.links[3].entity_pose * column.local_pose).p[2] - column.half_size[2]
    assert bottom == pytest.approx(0.0, abs=1e-6)
    links = set(arm.links)
    for contact in scene.sapien_scene.physx_system.get_contacts():
        assert not links & set(contact.bodies)
    scene.close()


def test_jaws_close_as_one():
    scene = empty_scene()
    arm = arm_in(scene)
    arm.close_jaws()
    scene.step(60)
    assert arm.width() < 1e-3
    arm.open_jaws(0.05)
    scene.step(60)
    left, right = arm.links[0].articulation.qpos[-2:]
    assert left == pytest.approx(right, abs=1e-4)
    assert arm.width() == pytest.approx(0.05, abs=1e-3)
    scene.close()


def test_pulls_a_drawer_by_its_bar():
    obj = drawer_with_lying_bar()
    joint = obj.joints[0]
    q = [joint.position(0.03)]
    center = bar_bounds(obj).mean(axis=0) + q[0] * np.eye(3)[0]
    T_grasp = hand_from_tcp(CLOSING_UP, center)
    path = transforms.translation([[0.08 - 0.01 * i, 0, 0] for i in range(9)]) @ T_grasp
    pulled = transforms.translation([[0.005 * i, 0, 0] for i in range(41)]) @ T_grasp
    T_world_base = choose_base(np.concatenate([path, pulled]), object_bounds=obj.rest_bounds)
    scene = ManipulationScene(obj, np.eye(4), q)
    arm = arm_in(scene, T_world_base, path[0])
    scene.hand = arm
    scene._hand_links = {link: i for i, link in enumerate(arm.links[:3])}
    for T_world_hand in path:
        arm.pull_to(pose_from_transform(T_world_hand))
        scene.step(SUBSTEPS)
    arm.close_jaws()
    scene.step(60)
    assert scene.contact(1).pinched
    start = scene.body.positions()[0]
    for T_world_hand in pulled:
        arm.pull_to(pose_from_transform(T_world_hand))
        scene.step(SUBSTEPS)
    assert scene.contact(1).pinched
    assert scene.body.positions()[0] - start == pytest.approx(0.2, abs=0.02)
    scene.close()


def test_cameras_see_the_arm_and_its_column(render_system):
    scene = empty_scene(render_system=render_system)
    raised = transforms.translation([0.0, 0.0, 0.3])
    arm = PandaArm(
        scene.sapien_scene, raised @ T_WORLD_BASE, raised @ T_WORLD_HAND, 0.06, visuals=True
    )
    for link in arm.links:
        (look,) = (c for c in link.entity.components if hasattr(c, "render_shapes"))
        assert len(look.render_shapes) == (2 if link is arm.links[3] else 1)
    scene.close()
