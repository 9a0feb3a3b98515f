"""The simulator holds what the object's description says, and tells gripping from touching."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from artgym.geometry import transforms
from artgym.geometry.hand import HAND_BOXES, T_hand_grasp, T_hand_tcp
from artgym.geometry.rotations import geodesic_angle, matrix_from_axis_angle
from artgym.objects import catalog
from artgym.sim.contact import PartContact
from artgym.sim.conversion import pose_from_transform
from artgym.sim.scene import ManipulationScene
from tests.sim.poses import (
    CLOSING_ACROSS,
    CLOSING_UP,
    bar_bounds,
    drawer_with_lying_bar,
    hand_from_tcp,
)

IDS = [i for c in catalog.CATEGORIES for i in catalog.all_ids(c, 2)]
T_WORLD_OBJECT = transforms.transform_from(
    matrix_from_axis_angle([0.0, 0.0, 0.7]), [0.1, -0.05, 0.0]
)
ABOVE = transforms.transform_from(np.diag([1.0, -1.0, -1.0]), [0.1, 0.0, 0.7])


def assert_same_poses(got, expected):
    np.testing.assert_allclose(got[:, :3, 3], expected[:, :3, 3], atol=1e-5)
    assert geodesic_angle(got[:, :3, :3], expected[:, :3, :3]).max() < 1e-5


@pytest.mark.parametrize("object_id", IDS)
@pytest.mark.parametrize("fraction", [0.0, 0.35, 1.0])
def test_links_stand_where_the_description_puts_them(object_id, fraction):
    obj = catalog.load(object_id)
    q = np.array([j.position(fraction) for j in obj.joints])
    scene = ManipulationScene(obj, T_WORLD_OBJECT, q)
    np.testing.assert_allclose(scene.body.positions(), q, atol=1e-6)
    assert_same_poses(scene.body.link_poses(), T_WORLD_OBJECT @ obj.link_poses(q))
    joint = obj.joints[0]
    opening = np.sign(joint.range) * (1.0 if fraction < 1 else -1.0)
    effort = (2.0 * joint.friction + 20.0) * opening
    for _ in range(30):
        scene.body.push(np.full(len(q), effort))
        scene.sapien_scene.physx_system.step()
    moved = scene.body.positions()
    assert np.abs(moved - q).max() > 1e-3
    assert_same_poses(scene.body.link_poses(), T_WORLD_OBJECT @ obj.link_poses(moved))
    scene.close()


@pytest.mark.parametrize("object_id", IDS[::4])
def test_joints_stop_at_both_ends(object_id):
    obj = catalog.load(object_id)
    joint = obj.joints[0]
    for fraction, effort in ((0.95, 30.0), (0.05, -30.0)):
        scene = ManipulationScene(obj, np.eye(4), obj.positions_with(1, fraction))
        efforts = np.zeros(len(obj.joints))
        efforts[0] = np.sign(joint.range) * effort
        for _ in range(240):
            scene.body.push(efforts)
            scene.sapien_scene.physx_system.step()
        end = joint.open_fraction(scene.body.positions()[0])
        assert end == pytest.approx(float(fraction > 0.5), abs=0.01)
        scene.close()


def test_range_may_start_anywhere():
    obj = catalog.load("drawer/0003")
    joint = replace(obj.joints[0], closed=0.4, open=0.1, axis=(-1.0, 0.0, 0.0))
    moved = replace(obj, joints=(joint,))
    scene = ManipulationScene(moved, np.eye(4), [joint.position(0.5)])
    assert scene.body.positions()[0] == pytest.approx(0.25)
    assert_same_poses(scene.body.link_poses(), moved.link_poses([0.25]))
    scene.close()


def test_mass_is_the_description_s():
    obj = catalog.load("laptop/0001")
    scene = ManipulationScene(obj, np.eye(4), obj.rest_positions)
    for link, body in zip(obj.links, scene.body.links, strict=True):
        assert body.mass == pytest.approx(link.mass, rel=1e-5)
        np.testing.assert_allclose(
            np.sort(body.inertia), np.linalg.eigvalsh(link.inertia), rtol=1e-4
        )
        np.testing.assert_allclose(body.cmass_local_pose.p, link.center_of_mass, atol=1e-6)
    scene.close()


def closed_on_the_bar():
    obj = drawer_with_lying_bar()
    joint = obj.joints[0]
    q = [joint.position(0.03)]
    center = bar_bounds(obj).mean(axis=0) + q[0] * np.eye(3)[0]
    T_world_hand = hand_from_tcp(CLOSING_UP, center)
    scene = ManipulationScene(obj, np.eye(4), q, T_world_hand=T_world_hand)
    scene.hand.close_jaws()
    scene.step(60)
    return obj, scene, T_world_hand


def test_hand_closed_on_a_handle_pinches_it():
    obj, scene, T_world_hand = closed_on_the_bar()
    thickness = np.diff(bar_bounds(obj), axis=0)[0, 2]
    assert scene.hand.width() == pytest.approx(thickness, abs=1e-3)
    contact = scene.contact(1)
    assert contact.touched
    assert contact.pinched
    assert not scene.contact(0).touched
    # Held, the drawer follows the hand.
    before = scene.body.positions()[0]
    for i in range(60):
        pulled = transforms.translation([0.001 * (i + 1), 0, 0]) @ T_world_hand
        scene.hand.pull_to(pose_from_transform(pulled))
        scene.step(2)
    assert scene.contact(1).pinched
    assert scene.body.positions()[0] - before > 0.03
    scene.hand.open_jaws()
    scene.step(60)
    contact = scene.contact(1)
    assert not contact.pinched
    scene.close()


def test_the_same_contacts_twice():
    states = []
    for _ in range(2):
        _, scene, _ = closed_on_the_bar()
        states.append((scene.hand.pose().tobytes(), scene.body.positions().tobytes()))
        scene.close()
    assert states[0] == states[1]


def test_prying_with_closed_empty_jaws_is_no_grip():
    obj = catalog.load("laptop/0000")
    joint = obj.joints[0]
    q = [joint.position(0.1)]
    edge_rest = np.array([obj.links[1].bounds()[1, 0], 0.0, obj.links[1].bounds()[0, 2], 1.0])
    edge = (obj.link_poses(q)[1] @ edge_rest)[:3]
    T_world_hand = hand_from_tcp(CLOSING_ACROSS, edge - np.array([0.005, 0.0, 0.02]))
    scene = ManipulationScene(obj, np.eye(4), q, T_world_hand=T_world_hand, width=0.0)
    scene.step(10)
    looks = []
    for i in range(120):
        lifted = transforms.translation([0, 0, 0.0008 * (i + 1)]) @ T_world_hand
        scene.hand.pull_to(pose_from_transform(lifted))
        scene.step(2)
        looks.append(scene.contact(1))
    assert joint.open_fraction(scene.body.positions()[0]) > 0.15
    assert sum(look.touched for look in looks) > 40
    assert not any(look.pinched for look in looks)
    scene.close()


def test_a_hand_in_the_air_touches_nothing():
    obj = catalog.load("laptop/0000")
    scene = ManipulationScene(obj, np.eye(4), obj.rest_positions, T_world_hand=ABOVE)
    scene.hand.close_jaws()
    scene.step(60)
    assert scene.hand.width() < 1e-3
    assert scene.contact(1) == PartContact(touched=False, pinched=False)
    # Without gravity it stays where its spring holds it.
    np.testing.assert_allclose(scene.hand.pose(), ABOVE, atol=1e-4)
    scene.close()


def test_hand_geometry():
    tips = [b for b in HAND_BOXES if b.link == "left"]
    pad = tips[-1]
    # The pads' middle is the tool centre, their inner faces touch when closed.
    assert pad.center[1] - pad.half_size[1] == pytest.approx(0.0)
    assert T_hand_tcp[2, 3] > T_hand_grasp[2, 3]
