"""Every rule of soundness can be broken, and no object of the catalogue breaks one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from artgym import cli
from artgym.annotation.filter import Verdict as GraspVerdict
from artgym.annotation.filter import judge
from artgym.objects import catalog
from artgym.objects.contents import TriangleMesh
from artgym.objects.model import ArticulatedObject, Box, Inertial, Shape, Visual
from artgym.sim import soundness
from artgym.sim.soundness import check

CATEGORIES = list(catalog.CATEGORIES)


def broken_rules(obj: ArticulatedObject, grasp_judge: soundness.GraspJudge = judge) -> set[str]:
    return {v.rule for v in check(obj, grasp_judge).failures}


def with_joint(object_id: str, **changes: float) -> ArticulatedObject:
    obj = catalog.load(object_id)
    return replace(obj, joints=(replace(obj.joints[0], **changes),))


def with_part(object_id: str, **changes: object) -> ArticulatedObject:
    obj = catalog.load(object_id)
    return replace(obj, links=(obj.links[0], replace(obj.links[1], **changes)))


def require_sound(ids: tuple[str, ...]) -> None:
    found = [check(catalog.load(object_id), judge) for object_id in ids]
    assert {f.object_id: [str(v) for v in f.failures] for f in found if not f.passed} == {}


@pytest.mark.parametrize("category", CATEGORIES)
def test_objects_are_sound(category):
    require_sound(catalog.all_ids(category)[::400])


@pytest.mark.slow
@pytest.mark.parametrize("category", CATEGORIES)
def test_two_hundred_objects_are_sound(category):
    require_sound(catalog.all_ids(category, 200))


def test_without_a_movable_part():
    obj = catalog.load("drawer/0003")
    fixed = replace(obj, links=obj.links[:1], joints=())
    found = check(fixed, judge)
    assert not found["movable"].passed
    assert found["movable"].note == "no movable part"
    assert found["opens"].note == "not measured: nothing moves"
    assert len(found.verdicts) == len(check(obj, judge).verdicts)


@pytest.mark.parametrize("opened", [0.0, 1e-4, float("nan"), float("inf")])
def test_without_a_range(opened):
    found = check(with_joint("drawer/0003", open=opened), judge)
    assert not found["movable"].passed
    assert found["movable"].note == catalog.load("drawer/0003").joints[0].name


@pytest.mark.parametrize("density", [0.0, -1.0, float("nan"), float("inf")])
def test_without_a_mass(density):
    found = check(with_part("laptop/0000", density=density), judge)
    assert not found["mass"].passed
    assert found["mass"].note == "lid"


@pytest.mark.parametrize("object_id", ["drawer/0003", "laptop/0000"])
def test_too_stiff_for_a_hand(object_id):
    assert broken_rules(with_joint(object_id, friction=100.0)) == {"opens", "no jam"}


def test_a_lid_that_falls():
    rules = broken_rules(with_joint("laptop/0000", friction=0.0))
    assert {"no drift", "stays put"} <= rules
    assert "opens" not in rules


def test_wrong_size():
    obj = catalog.load("laptop/0000")
    bed = Shape(
        geometry=Box(half_size=(1.0, 0.1, 0.002)),
        position=(0.0, 0.0, 0.002),
        material=obj.links[0].shapes[0].material,
    )
    long = replace(obj.links[0], shapes=(*obj.links[0].shapes, bed))
    found = check(replace(obj, links=(long, obj.links[1])), judge)
    assert not found["size"].passed
    assert found["size"].note.startswith("2.000 x")


@pytest.mark.parametrize(("depth", "broken"), [(0.002, False), (0.005, True)])
def test_links_inside_each_other(depth, broken):
    obj = catalog.load("drawer/0003")
    tray = obj.links[1]
    side = obj.links[0].bounds()[1, 1]
    # A fin that sticks out sideways through the cabinet's wall.
    fin = Shape(
        geometry=Box(half_size=(0.03, 0.01, 0.01)),
        position=(0.0, side + 0.01 - depth, 0.2),
        material=tray.shapes[0].material,
    )
    found = check(
        replace(obj, links=(obj.links[0], replace(tray, shapes=(*tray.shapes, fin)))), judge
    )
    assert found["penetration"].passed is not broken
    assert found["penetration"].value == pytest.approx(depth, abs=1e-4)


def test_collision_shapes_other_than_the_object_s(monkeypatch):
    original = soundness._shape_triangles

    def shifted(link):
        return [triangles + np.array([0.0, 0.0, 0.005]) for triangles in original(link)]

    monkeypatch.setattr(soundness, "_shape_triangles", shifted)
    assert "collision shape" in broken_rules(catalog.load("drawer/0003"))


def seen_as(obj: ArticulatedObject, shift: tuple[float, float, float]) -> ArticulatedObject:
    """The object with its drawer seen, as a mesh, beside where it collides."""
    part = obj.links[1]
    triangles = soundness._shape_triangles(part)
    vertices = np.concatenate(triangles).reshape(-1, 3) + np.array(shift)
    mesh = TriangleMesh(vertices, np.arange(len(vertices)).reshape(-1, 3))
    visual = Visual(mesh=mesh, material=part.shapes[0].material)
    return replace(obj, links=(obj.links[0], replace(part, visuals=(visual,)), *obj.links[2:]))


@pytest.mark.parametrize(
    ("shift", "broken"),
    [
        ((0.0, 0.0, 0.0), False),
        # Seen in front of what collides, and buried in it.
        ((0.004, 0.0, 0.0), True),
        ((-0.004, 0.0, 0.0), True),
    ],
)
def test_what_is_seen_lies_on_what_collides(shift, broken):
    found = check(seen_as(catalog.load("drawer/0003"), shift), judge)["collision shape"]
    assert found.passed is not broken
    if broken:
        assert found.note.endswith("what is seen")
        assert found.value == pytest.approx(0.004, abs=0.001)


def test_nothing_to_grip():
    def all_collide(obj, q, part, points, rotations):
        return np.full(rotations.shape[:2], GraspVerdict.COLLISION)

    assert broken_rules(catalog.load("drawer/0003"), all_collide) == {"graspable"}


def test_a_category_of_no_catalogue():
    found = check(replace(catalog.load("drawer/0003"), category="wine cooler"), judge)
    assert found["size"].passed
    assert found["graspable"].passed


@pytest.mark.parametrize("mass", [1e30, 5e4])
def test_an_absurd_mass(mass):
    inertia = tuple(map(tuple, (mass * np.eye(3)).tolist()))
    heavy = Inertial(mass=mass, center_of_mass=(0, 0, 0), inertia=inertia)
    found = check(with_part("laptop/0000", inertial=heavy), judge)
    assert not found["mass"].passed
    assert found["opens"].note == "not measured: no mass, or no body's mass"


def test_deep_inside_each_other():
    obj = catalog.load("drawer/0003")
    block = replace(obj.links[0].shapes[0], geometry=Box(half_size=(0.1, 0.1, 0.1)))
    links = tuple(replace(link, shapes=(*link.shapes, block)) for link in obj.links)
    found = check(replace(obj, links=links), judge)
    assert found["penetration"].value > 0.05
    assert len(found.verdicts) == 10


def test_what_the_simulator_refuses(monkeypatch):
    def refuse(*_: object, **__: object) -> None:
        raise RuntimeError("hull too thin")

    monkeypatch.setattr(soundness, "ManipulationScene", refuse)
    found = check(catalog.load("drawer/0003"), judge)
    assert found["opens"].note == "not measured: the simulator refuses it: hull too thin"
    assert not found["opens"].passed


def test_the_verdict_tells_value_bar_and_place():
    text = str(check(catalog.load("laptop/0000"), judge)["opens"])
    assert text.startswith("pass  opens")
    assert "<= 40 N" in text
    assert "(hinge)" in text


def test_command_line(capsys, monkeypatch):
    assert cli.main(["check", "drawer/0003"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 11
    assert lines[-1] == "1 of 1 objects are sound."
    stiff = with_joint("drawer/0003", friction=100.0)
    monkeypatch.setattr(catalog, "load", lambda object_id: stiff)
    assert cli.main(["check", "--all", "--category", "drawer", "--count", "2"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[:3] for line in lines[:-1]] == [
        [i, "FAIL", rule] for i in ("drawer/0000", "drawer/0001") for rule in ("opens", "no")
    ]
    assert lines[-1] == "0 of 2 objects are sound."


@pytest.mark.parametrize(
    ("arguments", "mentioned"),
    [
        (["check"], "give ids"),
        (["check", "drawer/0001", "--all"], "give ids"),
        (["check", "drawer/0001", "--count", "2"], "--all"),
        (["check", "drawer/0001", "drawer/1"], "Nearest: 'drawer/0001'"),
        (["check", "--all", "--category", "labtop"], "Nearest: 'laptop'"),
        (["check", "--all", "--split", "tests"], "Nearest: 'test'"),
        (["objects", "--count", "0"], "count=0"),
        (["generate", "artimage", "--split", "tain", "--out", "x"], "Nearest: 'train'"),
        (["generate", "reartmix", "--category", "drwer", "--out", "x"], "Nearest: 'drawer'"),
        (["annotate", "--category", "drawr", "--out", "x"], "Nearest: 'drawer'"),
    ],
)
def test_bad_command_lines(arguments, mentioned, capsys):
    assert cli.main(arguments) == 1
    captured = capsys.readouterr()
    assert mentioned in captured.err
    assert captured.out == ""


def test_objects_are_listed(capsys):
    assert cli.main(["objects", "--category", "laptop", "--split", "val", "--count", "3"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["laptop/1000", "laptop/1001", "laptop/1002"]
    assert "lid" in lines[0]
    assert "rad" in lines[0]
