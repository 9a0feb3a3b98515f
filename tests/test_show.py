"""Sheets and pages show what is there, stand alone, and say what is wrong with their input."""

from __future__ import annotations

import base64
import dataclasses
import io
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from artgym import cli
from artgym.annotation.annotate import (
    label_file_name,
    labels_folder,
    positions_at,
    read_labels,
    visible_points,
)
from artgym.datasets.picture_files import write_pictures
from artgym.datasets.sample import AFFORDANCE_YES, Picture
from artgym.errors import RendererUnavailableError
from artgym.files import Manifest, ShardEntry, write_arrays
from artgym.geometry import transforms
from artgym.geometry.grasps import NUM_CANDIDATES
from artgym.geometry.rotations import matrix_from_axis_angle
from artgym.objects import catalog
from artgym.objects.meshes import link_triangles
from artgym.show import solids
from artgym.show.cast import cast_picture, fitting_view, seen_points, visible
from artgym.show.grasp_choice import spread_grasps
from artgym.show.page import Layer, Page, object_layers
from artgym.show.sheet import GAP, Panel, Ramp, sheet_png
from tests.datasets.picture_factory import random_picture

DRAWER = "drawer/1000"
PANELS_WIDE = 3 * 480 + 4 * GAP
#: Points of each labelled part and state.
POINTS = 5


@pytest.fixture
def no_renderer(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise RendererUnavailableError("no device here can render")

    monkeypatch.setattr("artgym.sim.thumbnail.thumbnail", refuse)


@pytest.fixture
def labels(tmp_path: Path) -> Path:
    """A folder with labels of a drawer: real points, made-up outcomes, two states."""
    obj = catalog.load(DRAWER)
    rng = np.random.default_rng(0)
    fractions = np.array([[0.02] * len(obj.joints), [0.5] * len(obj.joints)])
    state, part, points, normals = [], [], [], []
    for s, each in enumerate(fractions):
        q = positions_at(obj, each)
        for k in range(1, obj.num_parts):
            p, n = visible_points(obj, q, k, POINTS, 3, 0.3, rng)
            T_part_object = transforms.invert(obj.link_poses(q)[k])
            points.append(transforms.apply(T_part_object, p).astype(np.float32))
            normals.append(transforms.rotate(T_part_object, n).astype(np.float32))
            state += [s] * POINTS
            part += [k] * POINTS
    success = rng.uniform(size=(len(part), NUM_CANDIDATES)) < 0.1
    success[::2] = False
    arrays = {
        "fractions": fractions,
        "state": np.array(state, dtype=np.uint8),
        "part": np.array(part, dtype=np.uint8),
        "points_part": np.concatenate(points),
        "normals_part": np.concatenate(normals),
        "bits": np.packbits(success, axis=-1, bitorder="little"),
        "verdicts": np.full((2, 3), 7, dtype=np.int32),
        "ends": np.full((2, 5), 3, dtype=np.int32),
    }
    root = tmp_path / "labels"
    folder = labels_folder("drawer", catalog.split_of(DRAWER), root)
    write_arrays(folder / label_file_name(DRAWER), arrays)
    return root


def picture() -> Picture:
    """A picture of two objects before a wall a metre away, with what is known of them made up."""
    made = random_picture(0, num_objects=2)
    rng = np.random.default_rng(0)
    T = np.tile(np.eye(4, dtype=np.float32), (3, 1, 1))
    T[:, 2, 3] = 1.0
    samples = []
    for i, sample in enumerate(made.samples):
        points = rng.uniform((-0.2, -0.1, 0.9), (0.2, 0.1, 1.0), sample.points_camera.shape)
        changed = {
            "points_camera": points.astype(np.float32),
            "box": np.array([4 + 8 * i, 6, 10, 9], dtype=np.float32),
            "T_camera_parts": T,
            "T_camera_object": T[0],
            "R_level_camera": np.array([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], dtype=np.float32),
            "object_scale": np.float32(0.3),
            "part_scales": np.full(3, 0.2, dtype=np.float32),
        }
        samples.append(dataclasses.replace(sample, **changed))
    return dataclasses.replace(
        made,
        depth=np.ones_like(made.depth),
        intrinsics=np.array([[30, 0, 16], [0, 30, 12], [0, 0, 1]], dtype=np.float32),
        samples=tuple(samples),
    )


@pytest.fixture
def pictures(tmp_path: Path) -> Path:
    folder = tmp_path / "set" / "val"
    write_pictures(folder / "shard.h5", [picture(), picture()])
    entry = ShardEntry.of(folder / "shard.h5", items=2)
    Manifest(config={}, planned=1, shards=(entry,)).write(folder)
    return folder


def show(*arguments: object) -> list[Path]:
    """Runs the command and returns the files in the folder --out."""
    words = [str(word) for word in arguments]
    assert cli.main(["show", *words]) == 0
    return sorted(Path(words[words.index("--out") + 1]).iterdir())


def complaint(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    assert cli.main(["show", *(str(word) for word in arguments)]) == 1
    return capsys.readouterr().err


def require_sheet(path: Path, width: int) -> None:
    image = np.asarray(Image.open(io.BytesIO(path.read_bytes())))
    assert image.shape[1] == width
    assert image.shape[0] > 360
    assert image.std() > 10


def scene_of(path: Path) -> dict:
    """What a page holds, once it is sure that it stands alone."""
    text = path.read_text()
    assert "http://" not in text
    assert "https://" not in text
    assert not re.search(r"<(?:script|link|img)[^>]*(?:src|href)=", text)
    assert path.stat().st_size < 5e6
    return json.loads(re.search(r'<script id="scene" [^>]*>(.*?)</script>', text)[1])


def decoded(layer: dict) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Positions (n, 3), colours (n, 3) and triangles (m, 3) of a layer."""

    def array(name: str, dtype: str) -> np.ndarray:
        return np.frombuffer(base64.b64decode(layer[name] or ""), dtype=dtype).reshape(-1, 3)

    return array("positions", "<f4"), array("colors", "u1"), array("indices", "<u4")


@pytest.mark.usefixtures("no_renderer")
def test_an_object_is_shown_without_a_renderer(tmp_path: Path) -> None:
    page, sheet = show("object", DRAWER, "--out", tmp_path / "out")
    assert (sheet.name, page.name) == ("drawer_1000.png", "drawer_1000.html")
    require_sheet(sheet, PANELS_WIDE)
    obj, scene = catalog.load(DRAWER), scene_of(page)
    layers = {layer["name"]: layer for layer in scene["layers"]}
    for link in obj.links:
        positions, colors, triangles = decoded(layers[link.name])
        expected = link_triangles(link)[0]
        assert len(positions) == len(colors)
        # The same triangles, in the same order.
        np.testing.assert_allclose(positions[triangles], expected, atol=1e-6)
    assert len(decoded(layers["canonical box of body"])[0]) == 24
    assert [joint["name"] for joint in scene["joints"]] == list(obj.part_names[1:])


@pytest.mark.usefixtures("render_system")
def test_an_object_is_shown_rendered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("artgym.show.object_view.SIZE", (160, 120))
    _, sheet = show("object", "laptop/1001", "--out", tmp_path / "out")
    require_sheet(sheet, 3 * 160 + 4 * GAP)


def test_labels_are_shown(tmp_path: Path, labels: Path) -> None:
    page, sheet = show("labels", DRAWER, "--labels", labels, "--out", tmp_path / "out")
    require_sheet(sheet, 2 * 480 + 3 * GAP)
    scene, known = scene_of(page), read_labels(DRAWER, labels)
    dots = [layer for layer in scene["layers"] if layer["kind"] == "points"]
    assert sum(len(decoded(layer)[0]) for layer in dots) == (known.state == 0).sum()
    some_row = np.flatnonzero((known.state == 1) & (known.part == 1))
    places = np.concatenate([decoded(layer)[0] for layer in dots if layer["link"] == 1])
    shown_in = 1 if np.allclose(places, known.points_part[some_row]) else 0
    successes = [known.success[known.state == s].sum() for s in (0, 1)]
    assert shown_in == np.argmax(successes)
    hands = [layer for layer in scene["layers"] if "grasps that move" in layer["name"]]
    assert len(hands) == catalog.load(DRAWER).num_parts - 1
    assert all(len(decoded(layer)[2]) > 0 for layer in hands)


def test_one_state_of_the_labels_is_shown(tmp_path: Path, labels: Path) -> None:
    options = ("--labels", labels, "--state", 1, "--out", tmp_path / "out")
    page, sheet = show("labels", DRAWER, *options)
    assert sheet.name == "drawer_1000_labels_1.png"
    require_sheet(sheet, PANELS_WIDE)
    assert {joint["fraction"] for joint in scene_of(page)["joints"]} == {0.5}


def test_a_picture_is_shown(tmp_path: Path, pictures: Path) -> None:
    page, sheet = show("sample", pictures, "--index", 1, "--out", tmp_path / "out")
    assert (sheet.name, page.name) == ("sample_000001.png", "sample_000001.html")
    require_sheet(sheet, PANELS_WIDE)
    again = show("sample", pictures, "--index", 1, "--out", tmp_path / "again")
    assert [path.read_bytes() for path in again] == [page.read_bytes(), sheet.read_bytes()]
    clouds = scene_of(page)["layers"]
    shown = picture()
    positions = [decoded(layer)[0] for layer in clouds[:2]]
    assert len(positions[0]) == (shown.instance_mask > 0).sum()
    assert len(positions[0]) + len(positions[1]) == shown.depth.size
    # A wall a metre before the camera, which looks along x here.
    np.testing.assert_allclose(np.concatenate(positions)[:, 0], 1.0, atol=1e-6)
    for i, sample in enumerate(shown.samples):
        mine = {layer["name"].partition(": ")[2]: layer for layer in clouds[2 + 6 * i : 8 + 6 * i]}
        graspable = decoded(mine["points where some grasp succeeds"])[0]
        assert len(graspable) == (sample.affordance == AFFORDANCE_YES).sum()
        assert len(decoded(mine["parts"])[0]) == len(sample.points_camera)


def test_bad_input_is_named(
    tmp_path: Path, labels: Path, pictures: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ("--out", tmp_path / "out")
    assert "unknown category 'drawr'. Nearest: 'drawer'" in complaint(
        capsys, "object", "drawr/1000", *out
    )
    said = complaint(capsys, "labels", "drawer/1001", "--labels", labels, *out)
    assert "drawer/1001 has no labels" in said
    assert "artgym annotate --object drawer/1001" in said
    said = complaint(capsys, "labels", DRAWER, "--labels", labels, "--state", 2, *out)
    assert "state=2" in said
    assert "0 to 1" in said
    said = complaint(capsys, "sample", pictures, "--index", 2, *out)
    assert "index=2" in said
    assert "0 to 1" in said
    said = complaint(capsys, "sample", pictures.parent, *out)
    assert f"{pictures.parent} is no set of pictures" in said
    assert f"Sets below it: {pictures}" in said
    assert "--state 1 does not go with `artgym show object`" in complaint(
        capsys, "object", DRAWER, "--state", 1, *out
    )
    assert not (tmp_path / "out").exists()


def test_a_drawing_is_filled_by_the_object() -> None:
    obj = catalog.load(DRAWER)
    view = fitting_view(seen_points(obj, obj.rest_positions), (120, 90))
    drawn = cast_picture(obj, obj.rest_positions, view)
    rows, columns = np.nonzero(drawn.body >= 0)
    fill = max(np.ptp(rows) / 90, np.ptp(columns) / 120)
    assert 0.84 < fill < 0.9
    assert abs((rows.min() + rows.max()) / 2 - 45) < 2
    # Sideways there is room to spare.
    assert abs((columns.min() + columns.max()) / 2 - 60) < 4
    u, v = drawn.middle_of(0)
    assert drawn.body[int(v), int(u)] == 0
    front = np.array([[obj.rest_bounds[1, 0], 0.0, obj.rest_bounds[1, 2] / 2]])
    back = front * [0.0, 1.0, 1.0] + [obj.rest_bounds[0, 0], 0.0, 0.0]
    assert visible(obj, obj.rest_positions, view, front)[0]
    assert not visible(obj, obj.rest_positions, view, back)[0]


def test_chosen_grasps_are_unlike_one_another() -> None:
    turned = matrix_from_axis_angle([0.0, 0.0, np.pi])
    poses = np.tile(np.eye(4), (4, 1, 1))
    poses[1, 0, 3] = 0.001
    # The same grasp with its fingers swapped.
    poses[2, :3, :3] = turned
    poses[3, 0, 3] = 0.3
    assert spread_grasps(poses, 2).tolist() == [0, 3]
    assert sorted(spread_grasps(poses, 9).tolist()) == [0, 1, 2, 3]
    assert spread_grasps(poses[:0], 3).tolist() == []


def test_solids_are_as_long_as_asked() -> None:
    vertices, faces = solids.arrow([0, 0, 0], [0, 0, 0.2], 0.004)
    assert vertices[:, 2].max() == pytest.approx(0.2)
    assert vertices[:, 2].min() == pytest.approx(0.0)
    assert faces.max() < len(vertices)
    edges = solids.box_edges([[0, 0, 0], [1, 2, 3]], np.eye(4)).reshape(12, 2, 3)
    lengths = np.linalg.norm(edges[:, 1] - edges[:, 0], axis=1)
    assert sorted(lengths.tolist()) == [1] * 4 + [2] * 4 + [3] * 4


def test_long_texts_are_wrapped_into_their_panel() -> None:
    image = np.zeros((50, 200, 3), dtype=np.uint8)
    short = Panel(heading="a", image=image, legend=[((255, 0, 0), "red"), Ramp(low="0", high="1")])
    long = Panel(heading="a", image=image, legend=[(None, "word " * 60)])
    heights = []
    for panel in (short, long):
        sheet = np.asarray(Image.open(io.BytesIO(sheet_png("title", "", [[panel]]))))
        assert sheet.shape[1] == 200 + 2 * GAP
        assert (sheet[:, -GAP:] == 255).all()
        heights.append(sheet.shape[0])
    assert heights[1] > heights[0] + 100


def test_a_page_cannot_be_ended_by_its_content() -> None:
    dot = Layer(
        name="</script><b>",
        kind="points",
        positions=np.zeros((1, 3)),
        colors=np.zeros((1, 3), dtype=np.uint8),
    )
    page = Page(title="<b>&", text="</script>", layers=[dot], eye=np.ones(3), target=np.zeros(3))
    text = page.html().decode()
    assert text.count("</script>") == 2
    assert "<title>&lt;b&gt;&amp;</title>" in text
    assert "\\u003c/script>" in text


@pytest.mark.skipif(shutil.which("node") is None, reason="no Node.js here to run the page's script")
@pytest.mark.parametrize("object_id", ["box/1002", DRAWER])
def test_a_page_moves_links_as_the_object_does(tmp_path: Path, object_id: str) -> None:
    obj = catalog.load(object_id)
    fractions = np.linspace(0.1, 0.9, len(obj.joints))
    page = Page(
        title="t",
        text="",
        layers=object_layers(obj),
        eye=np.ones(3),
        target=np.zeros(3),
        obj=obj,
        fractions=fractions,
    ).html()
    (tmp_path / "page.html").write_bytes(page)
    scene = scene_of(tmp_path / "page.html")
    script = re.findall(r"<script>(.*?)</script>", page.decode(), flags=re.DOTALL)[0]
    (tmp_path / "page.js").write_text(
        f"{script}\nconst scene = {json.dumps(scene)};\n"
        "const poses = linkPoses(scene.joints, scene.joints.map((joint) => joint.fraction));\n"
        "const points = decode(scene.layers[1].positions, Float32Array);\n"
        "console.log(JSON.stringify({ poses, points: Array.from(points) }));\n"
    )
    run = subprocess.run(
        ["node", str(tmp_path / "page.js")], capture_output=True, text=True, check=True
    )
    said = json.loads(run.stdout)
    # Columns, one after another.
    poses = np.array(said["poses"]).reshape(-1, 4, 4).swapaxes(1, 2)
    np.testing.assert_allclose(poses, obj.link_poses(positions_at(obj, fractions)), atol=1e-9)
    assert said["points"] == decoded(scene["layers"][1])[0].reshape(-1).tolist()
