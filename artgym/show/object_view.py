"""`artgym show object`: how an object looks, what its parts are and how they move."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.datasets.drawing import PART_COLORS, Color
from artgym.errors import RendererUnavailableError
from artgym.files import write_file_whole
from artgym.geometry import transforms
from artgym.objects import catalog
from artgym.objects.model import ArticulatedObject, Joint, canonical_box
from artgym.show import colors
from artgym.show.cast import cast_picture, fitting_view
from artgym.show.page import Layer, Page, object_layers, solid_layer, start_eye
from artgym.show.sheet import Legend, Overlay, Panel, faded, sheet_png
from artgym.show.solids import arrow, box_edges
from artgym.sim.camera import View
from artgym.sim.thumbnail import seen_points

Array = NDArray[np.floating]

#: Width and height of a picture on the sheet, pixels.
SIZE = (480, 360)
_STATES = (("closed", 0.0), ("half open", 0.5), ("open", 1.0))
#: Points on the path that a part's grip point takes.
_PATH_POINTS = 25


def show_object(object_id: str, out: Path) -> tuple[Path, Path]:
    """Writes a sheet and a 3D page of an object.

    Args:
        object_id: of the catalogue, or import/NAME.
        out: folder that gets "drawer_0012.png" and "drawer_0012.html".

    Returns:
        Both files.

    Raises:
        UnknownNameError: no such object.
        FileNotWrittenError: the system refused.
    """
    obj = catalog.load(object_id)
    stem = object_id.replace("/", "_")
    sheet, page = out / f"{stem}.png", out / f"{stem}.html"
    write_file_whole(sheet, _sheet(obj))
    write_file_whole(page, _page(obj).html())
    return sheet, page


def part_color(part: int) -> Color:
    """The colour of a part on all sheets and pages; they repeat beyond the last."""
    return PART_COLORS[part % len(PART_COLORS)]


def joint_axis(obj: ArticulatedObject, part: int, q: ArrayLike) -> tuple[Array, Array]:
    """Where a part's joint is drawn: start and end (2 x (3,)) of an arrow, object frame, metres.

    It points along the opening motion of a slide, from what a hand takes hold of through half of
    the range, and along the hinge, past both ends of the part, such that the part opens
    counter-clockwise about it.
    """
    joint = obj.joint_of(part)
    poses = obj.link_poses(np.asarray(q, dtype=float))
    T_object_parent = poses[obj.part_names.index(joint.parent)]
    axis = np.asarray(joint.axis, dtype=float) * np.sign(joint.range)
    direction = T_object_parent[:3, :3] @ axis
    if joint.type == "prismatic":
        start = transforms.apply(poses[part], obj.grip_point(part)[None])[0]
        return start, start + 0.5 * abs(joint.range) * direction
    pivot = np.asarray(joint.pivot, dtype=float)
    along = (obj.links[part].bounds() - pivot) @ axis
    margin = 0.15 * float(np.ptp(along)) + 0.01
    ends = pivot + np.outer([along.min() - margin, along.max() + margin], axis)
    start, end = transforms.apply(T_object_parent, ends)
    return start, end


def grip_path(obj: ArticulatedObject, part: int, q: ArrayLike) -> Array:
    """The way (n, 3) of what a hand takes a part by, from closed to open, object frame.

    Args:
        obj: the object.
        part: the part that moves.
        q: joint positions of all other parts.
    """
    positions = np.array(q, dtype=float)
    path = []
    for fraction in np.linspace(0.0, 1.0, _PATH_POINTS):
        positions[part - 1] = obj.joint_of(part).position(fraction)
        pose = obj.link_poses(positions)[part]
        path.append(transforms.apply(pose, obj.grip_point(part)[None])[0])
    return np.array(path)


def size_text(extents: ArrayLike) -> str:
    """Extents in metres, or in millimetres where all are small."""
    extents = np.asarray(extents, dtype=float)
    if extents.max() < 0.1:
        return " x ".join(f"{1000 * extent:.1f}" for extent in extents) + " mm"
    return " x ".join(f"{extent:.3f}" for extent in extents) + " m"


def joint_text(joint: Joint) -> str:
    """What a joint does, in a few words."""
    if joint.type == "prismatic":
        return f"{joint.child}: slide of {1000 * abs(joint.range):.0f} mm"
    return f"{joint.child}: hinge, {np.degrees(abs(joint.range)):.0f}° from closed to open"


def _positions(obj: ArticulatedObject, fraction: float) -> Array:
    return np.array([joint.position(fraction) for joint in obj.joints])


def _sheet(obj: ArticulatedObject) -> bytes:
    states = [(name, _positions(obj, fraction)) for name, fraction in _STATES]
    half_open = states[1][1]
    movable = range(1, obj.num_parts)
    marks = [np.stack(joint_axis(obj, part, half_open)) for part in movable]
    marks += [grip_path(obj, part, half_open) for part in movable]
    marks += [seen_points(obj, q) for _, q in states]
    view = fitting_view(np.concatenate(marks), SIZE)
    looks, note = _looks(obj, view)
    drawn = cast_picture(obj, half_open, view, [part_color(i) for i in range(obj.num_parts)])
    pale = faded(drawn.rgb, 0.45)
    T_camera_object = transforms.invert(view.T_world_camera)

    parts = Overlay(drawn.rgb, view.intrinsics, T_camera_object)
    for part in range(obj.num_parts):
        middle = drawn.middle_of(part)
        if middle is not None:
            parts.tag(middle, str(part), (60, 60, 70))
    joints = Overlay(pale, view.intrinsics, T_camera_object)
    for part in movable:
        joints.line(grip_path(obj, part, half_open), colors.PATH, 2.0)
        joints.arrow(*joint_axis(obj, part, half_open), colors.JOINT)

    part_legend: list[Legend] = [
        (
            part_color(i),
            f"{i} {link.name}: {size_text(np.ptp(link.bounds(), axis=0))}, {_mass(link.mass)}",
        )
        for i, link in enumerate(obj.links)
    ]
    joint_legend: list[Legend] = [
        (colors.JOINT, "joint axis (the part turns about it, or slides along it)"),
        (colors.PATH, "way of what a hand takes hold of, closed to open"),
        *((None, joint_text(joint)) for joint in obj.joints),
    ]
    box_legend: list[Legend] = [
        *((part_color(i), link.name) for i, link in enumerate(obj.links)),
        *zip(colors.AXES, ("x", "y", "z of the part's frame"), strict=True),
        (
            None,
            "diagonals (scale of NPCS): "
            + ", ".join(
                f"{name} {canonical_box(bounds)[1]:.3f} m"
                for name, bounds in zip(obj.part_names, obj.canonical_bounds, strict=True)
            ),
        ),
    ]
    return sheet_png(
        obj.object_id,
        _facts(obj) + note,
        [
            looks,
            [
                Panel(heading="parts (half open)", image=parts.image(), legend=part_legend),
                Panel(heading="joints", image=joints.image(), legend=joint_legend),
                Panel(
                    heading="canonical boxes and part frames",
                    image=_boxes_image(obj, half_open),
                    legend=box_legend,
                ),
            ],
        ],
    )


def _boxes_image(obj: ArticulatedObject, q: Array) -> NDArray[np.uint8]:
    """The canonical box and the frame of each part."""
    poses, length = obj.link_poses(q), _frame_length(obj)
    edges = [box_edges(link.bounds(), T) for link, T in zip(obj.links, poses, strict=True)]
    axes = [transforms.apply(T, length * np.eye(3)) for T in poses]
    view = fitting_view(np.concatenate([*edges, *axes]), SIZE)
    marks = Overlay(
        faded(cast_picture(obj, q, view).rgb, 0.45),
        view.intrinsics,
        transforms.invert(view.T_world_camera),
    )
    for part, pairs in enumerate(edges):
        for pair in pairs.reshape(-1, 2, 3):
            marks.line(pair, part_color(part), 1.5)
    for pose in poses:
        marks.frame(pose, length)
    return marks.image()


def _frame_length(obj: ArticulatedObject) -> float:
    """How long the axes of a part's frame are drawn, metres."""
    return 0.2 * float(np.linalg.norm(np.ptp(obj.rest_bounds, axis=0)))


def _looks(obj: ArticulatedObject, view: View) -> tuple[Sequence[Panel], str]:
    """Pictures of the object closed, half open and open, and what is to be said of them."""
    from artgym.sim.thumbnail import thumbnail

    try:
        return [
            Panel(heading=name, image=thumbnail(obj, SIZE, fraction)) for name, fraction in _STATES
        ], ""
    except RendererUnavailableError:
        return [
            Panel(heading=name, image=cast_picture(obj, _positions(obj, fraction), view).rgb)
            for name, fraction in _STATES
        ], " No renderer here: drawn by ray casting, without textures and shadows."


def _mass(mass: float) -> str:
    return f"{mass:.2f} kg" if mass >= 0.1 else f"{1000 * mass:.1f} g"


def _facts(obj: ArticulatedObject) -> str:
    """A line about the whole object."""
    size = size_text(np.ptp(obj.body_bounds, axis=0))
    kinds = ", ".join(
        f"{name.replace('_', ' ')}: {value:.3g}"
        if isinstance(value, float)
        else f"{name.replace('_', ' ')}: {value}"
        for name, value in sorted(obj.attributes.items())
    )
    moving = obj.num_parts - 1
    parts = f"{moving} movable part{'s' if moving != 1 else ''}"
    facts = f"{obj.category}, {size} (x to the front, y, z up), {parts}."
    return f"{facts} {kinds}." if kinds else facts


def _page(obj: ArticulatedObject) -> Page:
    layers = object_layers(obj)
    layers += joint_layers(obj)
    for part, link in enumerate(obj.links):
        edges = box_edges(link.bounds(), np.eye(4))
        layers.append(
            Layer(
                name=f"canonical box of {link.name}",
                kind="lines",
                positions=edges,
                colors=np.tile(np.array(part_color(part), dtype=np.uint8), (len(edges), 1)),
                link=part,
                visible=False,
                swatch=part_color(part),
            )
        )
    length = _frame_length(obj)
    for part, link in enumerate(obj.links):
        name = f"frame of {link.name}"
        layers.append(frame_layer(name, np.eye(4)[None], length, link=part, visible=False))
    eye, target = start_eye(seen_points(obj, _positions(obj, 0.5)))
    return Page(
        title=obj.object_id,
        text=_facts(obj),
        layers=layers,
        eye=eye,
        target=target,
        obj=obj,
        fractions=np.full(obj.num_parts - 1, 0.5),
    )


def joint_layers(obj: ArticulatedObject) -> list[Layer]:
    """A layer a joint: an arrow that moves with the link that holds it."""
    width = 0.008 * float(np.linalg.norm(np.ptp(obj.rest_bounds, axis=0)))
    return [
        solid_layer(
            f"joint of {joint.child}",
            [(arrow(*joint_axis(obj, part, obj.rest_positions), width), colors.JOINT)],
            link=obj.part_names.index(joint.parent),
            swatch=colors.JOINT,
        )
        for part, joint in enumerate(obj.joints, start=1)
    ]


def frame_layer(
    name: str, Ts_link_frame: Array, length: float, *, link: int = 0, visible: bool = True
) -> Layer:
    """The axes of frames (n, 4, 4), x red, y green, z blue; ``length`` in metres."""
    solids = [
        (arrow(T[:3, 3], T[:3, 3] + length * T[:3, i], 0.03 * length), color)
        for T in Ts_link_frame
        for i, color in enumerate(colors.AXES)
    ]
    return solid_layer(name, solids, link=link, visible=visible)
