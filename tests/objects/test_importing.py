"""The door for other people's objects: what is told apart, guessed, said, and asked for."""

from __future__ import annotations

import importlib.util
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from artgym import cli
from artgym.annotation.annotate import AnnotationConfig, annotate
from artgym.errors import AssetError, InvalidArgumentError, UnknownNameError
from artgym.geometry import transforms
from artgym.objects import catalog, store
from artgym.objects.description import write_description
from artgym.objects.importing import (
    TURNS,
    _category_in,
    guess_front,
    import_object,
    plausible_scale,
)
from artgym.objects.model import ArticulatedObject
from artgym.objects.urdf_export import write_urdf

needs_coacd = pytest.mark.skipif(
    importlib.util.find_spec("coacd") is None, reason="coacd is not installed: artgym[assets]"
)

# A drawer unit of 0.3 x 0.4 x 0.2 m that faces -y, of five boards and a tray with a bar.
BOARDS = [
    ((0.4, 0.3, 0.01), (0, 0, 0.005)),
    ((0.4, 0.3, 0.01), (0, 0, 0.195)),
    ((0.01, 0.3, 0.18), (-0.195, 0, 0.1)),
    ((0.01, 0.3, 0.18), (0.195, 0, 0.1)),
    ((0.38, 0.01, 0.18), (0, 0.145, 0.1)),
]
TRAY = [
    ((0.37, 0.01, 0.17), (0, -0.145, 0.1)),
    ((0.37, 0.27, 0.01), (0, 0, 0.03)),
    ((0.1, 0.01, 0.015), (0, -0.19, 0.1)),
    ((0.01, 0.035, 0.015), (-0.045, -0.1675, 0.1)),
    ((0.01, 0.035, 0.015), (0.045, -0.1675, 0.1)),
]


def pieces(tag: str, boxes: list, scale: float) -> str:
    def text(numbers: tuple[float, ...]) -> str:
        return " ".join(str(scale * n) for n in numbers)

    return "".join(
        f'<{tag}><origin xyz="{text(at)}"/><geometry><box size="{text(size)}"/></geometry></{tag}>'
        for size, at in boxes
    )


def urdf(*, scale: float = 1.0, visual: str = "", limits: str = 'lower="0" upper="0.2"') -> str:
    joint = "".join(
        [
            '<joint name="slide" type="prismatic"><parent link="case"/><child link="tray"/>',
            f'<axis xyz="0 -1 0"/><limit {limits}/></joint>',
        ]
    )
    return "".join(
        [
            '<robot name="nightstand">',
            f'<link name="case">{pieces("collision", BOARDS, scale)}</link>',
            f'<link name="tray">{visual}{pieces("collision", TRAY, scale)}</link>',
            f"{joint}</robot>",
        ]
    )


@pytest.fixture(autouse=True)
def folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ARTGYM_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv(store.FOLDER_VARIABLE, str(tmp_path / "objects"))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    folder = tmp_path / "unit"
    folder.mkdir()
    (folder / "unit.urdf").write_text(urdf())
    return folder / "unit.urdf"


def mentioned(notes: tuple[str, ...], start: str) -> str:
    return next((note for note in notes if note.startswith(start)), "")


def test_guesses_are_made_and_said(file):
    imported = import_object(file.parent)
    obj = imported.object
    assert (obj.object_id, obj.category) == ("unit", "drawer")
    assert obj.part_names == ("body", "drawer_1")
    assert obj.joints[0].axis == pytest.approx((1, 0, 0))
    assert mentioned(imported.notes, "category") == "category: taken to be 'drawer', from names"
    assert "-y" in mentioned(imported.notes, "front")
    assert "tray is 'drawer_1'" in mentioned(imported.notes, "parts")
    assert not mentioned(imported.notes, "size")


def test_what_is_told_is_not_guessed(file):
    imported = import_object(file, name="mine", category="other", front="+x")
    obj = imported.object
    assert (obj.object_id, obj.category) == ("mine", "other")
    assert obj.part_names == ("case", "tray")
    assert obj.joints[0].axis == pytest.approx((0, -1, 0))
    for start in ("category", "front", "parts"):
        assert not mentioned(imported.notes, start)


@pytest.mark.parametrize("front", list(TURNS))
def test_a_front_is_brought_to_x(file, front):
    axis = import_object(file, front=front).object.joints[0].axis
    angle = math.radians({"-y": 0, "+x": -90, "+y": 180, "-x": 90}[front])
    assert axis == pytest.approx((math.cos(angle), math.sin(angle), 0), abs=1e-9)


def test_scale(file):
    file.write_text(urdf(scale=1000.0, limits='lower="0" upper="200"'))
    with pytest.raises(AssetError, match=r"scale"):
        import_object(file)
    imported = import_object(file, scale="auto")
    assert "scaled by 0.001" in mentioned(imported.notes, "scaled")
    assert imported.object.rest_bounds[1, 2] == pytest.approx(0.2)
    file.write_text(urdf(scale=5.0))
    notes = import_object(file).notes
    assert "--scale auto" in mentioned(notes, "size")
    assert import_object(file, scale=0.2).object.rest_bounds[1, 2] == pytest.approx(0.2)


@pytest.mark.parametrize(
    ("largest", "category", "expected"),
    [
        (0.4, "drawer", 1.0),
        (400.0, "drawer", 0.001),
        (40.0, "drawer", 0.01),
        (1.0, "drawer", 0.95 * 0.98),
        (0.4, "other", 1.0),
    ],
)
def test_plausible_scales(largest, category, expected):
    assert plausible_scale(largest, category) == pytest.approx(expected)


def test_closed_where_the_object_is_smallest(file):
    # q = 0 is the open end here, and nearer to the upper limit.
    file.write_text(
        urdf(limits='lower="-0.2" upper="0"').replace(
            '<axis xyz="0 -1 0"/>', '<origin xyz="0 -0.2 0"/><axis xyz="0 -1 0"/>'
        )
    )
    imported = import_object(file)
    assert imported.object.joints[0].closed == pytest.approx(-0.2)
    assert "lower limit" in mentioned(imported.notes, "joint 'slide': closed")
    told = import_object(file, closed={"slide": "upper"})
    assert told.object.joints[0].closed == 0.0
    with pytest.raises(UnknownNameError, match="'slide'"):
        import_object(file, closed={"slid": "upper"})


@needs_coacd
def test_what_is_seen_collides_where_the_file_s_shapes_are_elsewhere(file):
    handle = trimesh.creation.box((0.1, 0.012, 0.02))
    handle.apply_translation((0, -0.22, 0.1))
    plate = trimesh.creation.box((0.37, 0.01, 0.17))
    plate.apply_translation((0, -0.145, 0.1))
    trimesh.util.concatenate([handle, plate]).export(file.parent / "tray.obj")
    visual = '<visual><geometry><mesh filename="tray.obj"/></geometry></visual>'
    file.write_text(urdf(visual=visual))
    imported = import_object(file)
    assert any("what is seen collides instead, which leaves 0.0 %" in n for n in imported.notes)
    tray = imported.object.links[1]
    assert len(tray.shapes) == 2
    kept = import_object(file, solid="collision").object.links[1]
    assert len(kept.shapes) == len(TRAY)
    # The base has no other geometry and stays.
    assert len(imported.object.links[0].shapes) == len(BOARDS)


@pytest.mark.parametrize(
    ("text", "category"),
    [
        ("Franka_slideCabinet", "cabinet"),
        ("object_12", None),
        ("orange", None),
        ("ss_range_0", "oven"),
        ("doors", "door"),
        ("microwave_door_handle", "microwave"),
        ("StorageFurniture", "cabinet"),
        ("gearbox", None),
        ("box2", "box"),
    ],
)
def test_words(text, category):
    assert _category_in(text) == category


@pytest.mark.parametrize(
    "category", ["cabinet", "dishwasher", "drawer", "laptop", "microwave", "suitcase", "toilet"]
)
def test_fronts_are_found(category):
    for object_id in catalog.all_ids(category, 3):
        obj = catalog.load(object_id)
        assert guess_front(obj) == "+x"
        assert guess_front(turned(obj, math.pi / 2)) == "+y"


def turned(obj: ArticulatedObject, angle: float) -> ArticulatedObject:
    """The object turned about z."""
    c, s = math.cos(angle), math.sin(angle)
    T = transforms.transform_from([[c, -s, 0], [s, c, 0], [0, 0, 1]], np.zeros(3))

    def moved(point) -> tuple[float, float, float]:
        return tuple(transforms.apply(T, np.asarray([point]))[0].tolist())

    def shape(old):
        rotation = T[:3, :3] @ np.asarray(old.rotation)
        return replace(
            old, position=moved(old.position), rotation=tuple(map(tuple, rotation.tolist()))
        )

    return replace(
        obj,
        links=tuple(
            replace(link, shapes=tuple(map(shape, link.shapes)), visuals=()) for link in obj.links
        ),
        joints=tuple(replace(j, axis=moved(j.axis), pivot=moved(j.pivot)) for j in obj.joints),
    )


def test_kinds_are_told_apart(file, tmp_path):
    obj = catalog.load("laptop/0002")
    assert import_object(write_description(obj, tmp_path / "exact"), name="l").object == replace(
        obj, object_id="l"
    )
    written = write_urdf(obj, tmp_path / "urdf")
    assert import_object(written).object.links == obj.links
    (file.parent / "second.urdf").write_text(urdf())
    with pytest.raises(AssetError, match="several descriptions"):
        import_object(file.parent)
    (tmp_path / "empty").mkdir()
    with pytest.raises(AssetError, match="no URDF or MJCF"):
        import_object(tmp_path / "empty")
    (tmp_path / "page.xml").write_text("<html/>")
    with pytest.raises(AssetError, match="neither URDF nor MJCF"):
        import_object(tmp_path / "page.xml")
    with pytest.raises(AssetError):
        import_object(tmp_path / "none.urdf")


def test_mjcf(file):
    pytest.importorskip("mujoco", reason="mujoco is not installed: artgym[mjcf]")
    boxes = "".join(
        '<geom type="box" size="{} {} {}" pos="{} {} {}"/>'.format(*np.divide(size, 2), *at)
        for size, at in TRAY
    )
    model = file.with_name("drawer_unit.xml")
    model.write_text(
        '<mujoco><worldbody><body name="case"><geom type="box" size="0.2 0.02 0.1" pos="0 0.15 0.1"'
        '/><body name="tray"><joint type="slide" axis="0 -1 0" range="0 0.2" limited="true"/>'
        f"{boxes}</body></body></worldbody></mujoco>"
    )
    file.unlink()
    obj = import_object(file.parent).object
    assert obj.category == "drawer"
    assert obj.joints[0].axis == pytest.approx((1, 0, 0))


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        ({"category": "drawr"}, UnknownNameError),
        ({"front": "+z"}, UnknownNameError),
        ({"scale": "automatic"}, InvalidArgumentError),
        ({"scale": -1.0}, InvalidArgumentError),
        ({"density": 0.0}, InvalidArgumentError),
    ],
)
def test_wrong_arguments(file, arguments, error):
    with pytest.raises(error):
        import_object(file, **arguments)


# -- command line ------------------------------------------------------------------------------


def test_imported_on_the_command_line(file, capsys):
    assert cli.main(["import", str(file), "--name", "mine", "--closed", "slide=lower"]) == 0
    out = capsys.readouterr().out
    assert "note  category: taken to be 'drawer'" in out
    assert "pass  graspable" in out
    assert "import/mine  drawer, parts 1 drawer_1" in out
    assert "not sound" not in out
    assert cli.main(["check", "import/mine", str(file)]) == 0
    assert "2 of 2 objects are sound." in capsys.readouterr().out
    assert store.names() == ("mine",)


@pytest.mark.parametrize(
    ("arguments", "mentioned"),
    [
        (["import", "none.urdf"], "none.urdf"),
        (["import", "FILE", "--name", "My Drawer"], "expected 1 to 64"),
        (["import", "FILE", "--category", "drawr"], "Nearest: 'drawer'"),
        (["import", "FILE", "--closed", "slide"], "JOINT=lower"),
        (["import", "FILE", "--closed", "slide=middle"], "lower"),
        (["check", "import/none"], "imported object"),
        (["annotate", "--object", "import/none", "--out", "x"], "imported object"),
        (["annotate", "--object", "drawer/0003"], "--out"),
        (["annotate", "--object", "drawer/0003", "--category", "drawer"], "either"),
    ],
)
def test_bad_command_lines(file, arguments, mentioned, capsys):
    assert cli.main([str(file) if a == "FILE" else a for a in arguments]) == 1
    assert mentioned in capsys.readouterr().err


def test_a_picture_of_what_is_not_sound(file, tmp_path, capsys, render_system):
    file.write_text(file.read_text().replace('upper="0.2"', 'upper="0.005"'))
    assert cli.main(["check", str(file), "--picture", str(tmp_path / "pictures")]) == 1
    assert "FAIL  movable" in capsys.readouterr().out
    assert (tmp_path / "pictures" / "unit.png").stat().st_size > 1000


def test_no_picture_without_a_renderer(file, tmp_path, capsys, monkeypatch):
    from artgym.errors import RendererUnavailableError
    from artgym.sim import thumbnail

    def refuse(*_: object, **__: object) -> None:
        raise RendererUnavailableError("no device here can render.")

    monkeypatch.setattr(thumbnail, "thumbnail", refuse)
    file.write_text(file.read_text().replace('upper="0.2"', 'upper="0.005"'))
    assert cli.main(["check", str(file), "--picture", str(tmp_path / "pictures")]) == 1
    assert "no picture of unit: no device here can render." in capsys.readouterr().out


def test_labels_of_an_imported_object(file):
    store.save(import_object(file).object, "mine")
    config = AnnotationConfig(start_states=1, open_states=0, trials=1, least_points=4, views=2)
    assert len(annotate("import/mine", config)["bits"]) >= 4
