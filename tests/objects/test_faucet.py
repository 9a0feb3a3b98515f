"""Faucets: a spout that swings level, a handle that can be held, each shape family and handle."""

from __future__ import annotations

import numpy as np
import pytest

from artgym.objects import catalog
from artgym.objects.procedural import faucet

FAUCETS = [catalog.load(f"faucet/{n:04d}") for n in range(40)]


def test_every_family_and_handle_occurs():
    assert {f.attributes["family"] for f in FAUCETS} == set(faucet.FAMILIES)
    assert {f.attributes["handle"] for f in FAUCETS} == set(faucet.HANDLES)
    assert {f.attributes["stand"] for f in FAUCETS} == {"none", "slab", "sink"}


@pytest.mark.parametrize("obj", FAUCETS, ids=lambda o: o.object_id)
def test_parts_and_joints(obj):
    assert obj.part_names == ("base", "handle", "spout")
    handle, spout = obj.joints
    assert handle.parent == spout.parent == "base"
    np.testing.assert_allclose(np.abs(spout.axis), [0, 0, 1])
    assert np.radians(60) <= spout.range <= np.radians(150)
    assert np.radians(25) <= handle.range <= np.radians(130)
    level = abs(handle.axis[2]) < 0.5
    assert level or np.allclose(np.abs(handle.axis), [0, 0, 1])


@pytest.mark.parametrize("obj", FAUCETS, ids=lambda o: o.object_id)
def test_it_stands_on_the_table_and_faces_the_front(obj):
    low = obj.rest_bounds[0]
    assert low[2] == pytest.approx(0.0, abs=1e-9)
    body_low, body_high = obj.body_bounds
    assert np.abs((body_low + body_high)[0] / 2) < 0.06
    # At rest the spout points to the front, away from its axis.
    spout = obj.links[2].bounds()
    pivot = np.asarray(obj.joints[1].pivot)
    assert spout[1, 0] - pivot[0] > 0.08
    assert spout[1, 0] - pivot[0] > 2.5 * (pivot[0] - spout[0, 0])
    np.testing.assert_allclose(spout[:, 1].mean(), pivot[1], atol=1e-3)


@pytest.mark.parametrize("obj", FAUCETS, ids=lambda o: o.object_id)
def test_a_hand_has_a_lever_at_both_parts(obj):
    for part, joint in enumerate(obj.joints, start=1):
        arm = obj.grip_point(part) - np.asarray(joint.pivot)
        lever = np.linalg.norm(np.cross(joint.axis, arm))
        assert lever > 0.012
        assert joint.friction / lever < 25.0


@pytest.mark.parametrize("obj", FAUCETS, ids=lambda o: o.object_id)
def test_a_tilting_handle_does_not_fall(obj):
    joint = obj.joints[0]
    if abs(joint.axis[2]) > 0.5:
        return
    link = obj.links[1]
    arm = np.linalg.norm(link.center_of_mass - np.asarray(joint.pivot))
    assert joint.friction > 1.3 * link.mass * 9.81 * arm


def test_only_the_stand_counts_as_stand():
    for obj in FAUCETS:
        roles = {s.role for s in obj.links[0].shapes}
        assert ("stand" in roles) == (obj.attributes["stand"] != "none")
        assert all(s.role != "stand" for link in obj.links[1:] for s in link.shapes)
        assert any(s.role == "handle" for s in obj.links[1].shapes)
