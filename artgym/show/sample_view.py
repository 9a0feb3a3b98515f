"""`artgym show sample`: one picture of a set, and all that is known of what it shows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from artgym.datasets.drawing import Color
from artgym.datasets.picture_files import PictureFolder
from artgym.datasets.sample import (
    AFFORDANCE_NO,
    AFFORDANCE_UNKNOWN,
    AFFORDANCE_YES,
    JOINT_NONE,
    JOINT_PRISMATIC,
    Picture,
    Sample,
)
from artgym.errors import InvalidArgumentError
from artgym.files import MANIFEST_NAME, write_file_whole
from artgym.geometry import transforms
from artgym.geometry.camera import points_from_depth
from artgym.show import colors
from artgym.show.grasp_choice import spread_grasps
from artgym.show.object_view import frame_layer, part_color
from artgym.show.page import Layer, Page, solid_layer
from artgym.show.sheet import Legend, Overlay, Panel, Ramp, blended, faded, sheet_png
from artgym.show.solids import arrow, hand

Array = NDArray[np.floating]

#: How wide a picture is drawn on the sheet, pixels.
_WIDTH = 480
#: A box around all objects is so many times larger than they are.
_ROOM = 1.5
_SHEET_GRASPS, _PAGE_GRASPS = 6, 12
#: Points of a page's cloud, of objects and of the rest.
_MAX_POINTS = 60_000
#: Diameter of a labelled point on a page, metres.
_DOT = 0.006
#: Half the length of a drawn joint axis, as a share of the part's box; its length where it slides.
_HALF_AXIS = 0.6


def show_sample(folder: Path, out: Path, *, index: int = 0) -> tuple[Path, Path]:
    """Writes a sheet and a 3D page of a picture of a set.

    Args:
        folder: what ``artgym generate`` wrote: a folder with a manifest. It need not be complete.
        out: folder that gets "sample_000003.png" and ".html".
        index: of the picture.

    Returns:
        Both files.

    Raises:
        InvalidArgumentError: the folder is no set, or has fewer pictures.
        DamagedFileError: its manifest or the picture's shard is damaged.
        FileNotWrittenError: the system refused.
    """
    if not (folder / MANIFEST_NAME).exists():
        below = sorted(str(path.parent) for path in folder.glob(f"*/**/{MANIFEST_NAME}"))
        hint = f" Sets below it: {', '.join(below[:6])}." if below else ""
        raise InvalidArgumentError(
            f"{folder} is no set of pictures: it holds no {MANIFEST_NAME}. Name a folder that "
            f"`artgym generate` wrote.{hint}"
        )
    pictures = PictureFolder(folder, allow_incomplete=True)
    if not 0 <= index < len(pictures):
        known = f"0 to {len(pictures) - 1}" if len(pictures) else "none"
        raise InvalidArgumentError(
            f"index={index}: {folder} holds {len(pictures)} pictures; expected {known}."
        )
    picture = pictures[index]
    title = f"{folder.resolve().name}: picture {index}"
    stem = f"sample_{index:06d}"
    sheet, page = out / f"{stem}.png", out / f"{stem}.html"
    write_file_whole(sheet, _sheet(picture, title, len(pictures)))
    write_file_whole(page, _page(picture, title).html())
    return sheet, page


def instance_color(index: int) -> Color:
    """The colour of an object of a picture; they repeat beyond the last."""
    return colors.INSTANCES[index % len(colors.INSTANCES)]


def joint_arrow(sample: Sample, part: int) -> tuple[Array, Array]:
    """Start and end (2 x (3,)) of an arrow along a part's joint axis, camera frame, metres."""
    axis, scale = sample.joint_axis_camera[part], float(sample.part_scales[part])
    center_part = sample.R_object_canonical @ sample.part_centers[part]
    center = transforms.apply(sample.T_camera_parts[part], center_part[None])[0]
    if sample.joint_type[part] == JOINT_PRISMATIC:
        return center, center + scale * axis
    # The place on the axis that is nearest to the part's middle.
    pivot = sample.joint_pivot_camera[part]
    middle = pivot + axis * float((center - pivot) @ axis)
    return middle - _HALF_AXIS * scale * axis, middle + _HALF_AXIS * scale * axis


def carried_grasps(sample: Sample) -> Array:
    """All grasps (n, 4, 4) that are said to succeed at points seen, camera frame.

    Those at the point where most do come first.
    """
    success = sample.successful_tries()
    rows = np.unique(sample.grasp_row[sample.grasp_row >= 0])
    rows = rows[np.argsort(-success[rows].sum(axis=1), kind="stable")]
    if not len(rows):
        return np.empty((0, 4, 4))
    R_camera_grasp = sample.T_camera_object[:3, :3].astype(float) @ sample.tried_rotations()
    T_camera_part = sample.T_camera_parts[sample.grasp_part].astype(float)
    points = (T_camera_part[:, :3, :3] @ sample.grasp_points_part[..., None])[..., 0]
    points = points + T_camera_part[:, :3, 3]
    return np.concatenate(
        [transforms.transform_from(R_camera_grasp[r][success[r]], points[r]) for r in rows]
    )


def _movable(sample: Sample) -> list[int]:
    return np.flatnonzero(sample.joint_type != JOINT_NONE).tolist()


def _affordance_colors(sample: Sample) -> NDArray[np.uint8]:
    table = np.tile(np.array(colors.UNKNOWN, dtype=np.uint8), (256, 1))
    table[AFFORDANCE_NO], table[AFFORDANCE_YES] = colors.NOT_GRASPABLE, colors.GRASPABLE
    table[AFFORDANCE_UNKNOWN] = colors.UNKNOWN
    return table[sample.affordance]


# --- The sheet -----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class _Cut:
    """A part of a picture in the size in which it is drawn.

    Attributes:
        rgb: uint8 (h, w, 3).
        intrinsics: (3, 3) of these pixels.
        instance_mask, part_mask: uint8 (h, w).
        depth: float32 (h, w), metres.
        corner: (2,) of the picture, column and row, where it begins.
        scale: how many times larger its pixels are.
    """

    rgb: NDArray[np.uint8]
    intrinsics: Array
    instance_mask: NDArray[np.uint8]
    part_mask: NDArray[np.uint8]
    depth: NDArray[np.float32]
    corner: Array
    scale: float

    @classmethod
    def of(cls, picture: Picture, box: Array) -> _Cut:
        """What lies in a box: left, top, width, height, pixels."""
        left, top, width, height = box.tolist()
        scale = _WIDTH / width
        columns = np.arange(_WIDTH)
        rows = np.arange(max(1, round(height * scale)))
        # The pixels under the centres of those that are drawn.
        v = np.clip(((rows + 0.5) / scale + top).astype(int), 0, picture.rgb.shape[0] - 1)
        u = np.clip(((columns + 0.5) / scale + left).astype(int), 0, picture.rgb.shape[1] - 1)
        where = v[:, None], u
        image = Image.fromarray(picture.rgb).resize(
            (len(columns), len(rows)),
            Image.Resampling.BILINEAR,
            box=(left, top, left + width, top + height),
        )
        placed = np.array([[scale, 0, -scale * left], [0, scale, -scale * top], [0, 0, 1]])
        return cls(
            rgb=np.asarray(image),
            intrinsics=placed @ picture.intrinsics,
            instance_mask=picture.instance_mask[where],
            part_mask=picture.part_mask[where],
            depth=picture.depth[where],
            corner=np.array([left, top]),
            scale=scale,
        )


def _box_around(picture: Picture) -> Array:
    """A box with all objects in its middle and as wide for its height as the picture."""
    size = np.array(picture.depth.shape[::-1], dtype=float)
    boxes = np.array([sample.box for sample in picture.samples], dtype=float).reshape(-1, 4)
    boxes = boxes[(boxes[:, 2:] > 0).all(axis=1)]
    if not len(boxes):
        return np.array([0.0, 0.0, *size])
    low = np.clip(boxes[:, :2].min(axis=0), 0, size - 1)
    high = np.clip((boxes[:, :2] + boxes[:, 2:]).max(axis=0), low + 1, size)
    share = min(1.0, _ROOM * float(((high - low) / size).max()))
    corner = np.clip((low + high - share * size) / 2, 0, (1 - share) * size)
    return np.concatenate([corner, share * size])


def _sheet(picture: Picture, title: str, count: int) -> bytes:
    height, width = picture.depth.shape
    whole = _Cut.of(picture, np.array([0.0, 0.0, width, height]))
    cut = _Cut.of(picture, _box_around(picture))
    pale = faded(cut.rgb, 0.45)

    def overlay(draw: Callable[[Overlay, Sample], None]) -> NDArray[np.uint8]:
        marks = Overlay(pale, cut.intrinsics, np.eye(4))
        for sample in picture.samples:
            draw(marks, sample)
        return marks.image()

    def frames(marks: Overlay, sample: Sample) -> None:
        for T_camera_part in sample.T_camera_parts:
            marks.frame(T_camera_part, 0.3 * abs(float(sample.object_scale)))

    def joints(marks: Overlay, sample: Sample) -> None:
        for part in _movable(sample):
            marks.arrow(*joint_arrow(sample, part), colors.JOINT)

    def affordance(marks: Overlay, sample: Sample) -> None:
        paint, graspable = _affordance_colors(sample), sample.affordance == AFFORDANCE_YES
        marks.dots(sample.points_camera[~graspable], paint[~graspable], 1.4)
        marks.dots(sample.points_camera[graspable], paint[graspable], 2.6)

    def npcs(marks: Overlay, sample: Sample) -> None:
        paint = (255 * np.clip(sample.npcs, 0, 1)).astype(np.uint8)
        marks.dots(sample.points_camera, paint, 1.6)

    counts: list[str] = []

    def hands(marks: Overlay, sample: Sample) -> None:
        grasps = carried_grasps(sample)
        counts.append(f"{sample.object_id} {len(grasps)}")
        for g in spread_grasps(grasps, _SHEET_GRASPS):
            marks.hand(grasps[g], colors.GRASP)

    gripped = overlay(hands)
    named: list[Legend] = [
        (instance_color(i), f"{i + 1} {s.object_id}") for i, s in enumerate(picture.samples)
    ]
    most_parts = max([1, int(picture.part_mask.max(initial=0)), *map(_num_parts, picture.samples)])
    depth, low, high = _depth_image(whole.depth)
    rows = [
        [
            Panel(heading="RGB and boxes", image=_boxed(picture, whole), legend=named),
            Panel(
                heading="depth",
                image=depth,
                legend=[
                    Ramp(low=f"near {low:.2f} m", high=f"far {high:.2f} m"),
                    ((0, 0, 0), "none measured"),
                ],
            ),
            Panel(
                heading="instance mask",
                image=_masked(whole.rgb, whole.instance_mask, instance_color),
                legend=named,
            ),
        ],
        [
            Panel(
                heading="part mask",
                image=_masked(cut.rgb, cut.part_mask, part_color),
                legend=[
                    (part_color(i), f"part {i}" + (" (base)" if i == 0 else ""))
                    for i in range(most_parts)
                ],
            ),
            Panel(
                heading="part frames",
                image=overlay(frames),
                legend=list(zip(colors.AXES, ("x", "y", "z of each part"), strict=True)),
            ),
            Panel(
                heading="joint axes",
                image=overlay(joints),
                legend=[(colors.JOINT, "axis, towards open"), *_openings(picture)],
            ),
        ],
        [
            Panel(
                heading="affordance of the points kept",
                image=overlay(affordance),
                legend=_affordance_legend(picture),
            ),
            Panel(
                heading="grasps carried to the points",
                image=gripped,
                legend=[(colors.GRASP, f"a few of those that succeed: {', '.join(counts)}")],
            ),
            Panel(
                heading="NPCS of the points kept",
                image=overlay(npcs),
                legend=[(None, "x, y, z in the part's canonical box as red, green, blue")],
            ),
        ],
    ]
    shown = ", ".join(s.object_id for s in picture.samples) or "no object"
    text = (
        f"One of {count} pictures (0 to {count - 1}), {width} x {height} pixels: {shown}. The "
        "second and third row are cut to the objects."
    )
    return sheet_png(title, text, rows)


def _num_parts(sample: Sample) -> int:
    return sample.num_parts


def _boxed(picture: Picture, whole: _Cut) -> NDArray[np.uint8]:
    marks = Overlay(whole.rgb, whole.intrinsics, np.eye(4))
    for i, sample in enumerate(picture.samples):
        box = sample.box * whole.scale
        marks.rectangle(box, instance_color(i))
        marks.tag((float(box[0]), float(box[1])), str(i + 1), instance_color(i))
    return marks.image()


def _masked(
    rgb: NDArray[np.uint8], mask: NDArray[np.uint8], color_of: Callable[[int], Color]
) -> NDArray[np.uint8]:
    """A picture in grey, tinted where a mask is not 0, by what it says."""
    table = np.array([(0, 0, 0), *map(color_of, range(int(mask.max(initial=0))))])
    return blended(rgb, table[mask], mask > 0)


def _depth_image(depth: NDArray[np.float32]) -> tuple[NDArray[np.uint8], float, float]:
    """Depth in colours, and the depths, metres, at which they start and end."""
    known = depth > 0
    low, high = np.percentile(depth[known], [1, 99]).tolist() if known.any() else (0.0, 1.0)
    image = colors.ramp((depth - low) / max(high - low, 1e-6))
    image[~known] = 0
    return image, low, high


def _openings(picture: Picture) -> list[Legend]:
    return [
        (
            None,
            f"{sample.object_id}: "
            + ", ".join(
                f"part {part} is {100 * sample.open_fraction[part]:.0f} % open"
                for part in _movable(sample)
            ),
        )
        for sample in picture.samples
    ]


def _affordance_legend(picture: Picture) -> list[Legend]:
    affordance = np.concatenate([[], *(s.affordance for s in picture.samples)])
    return [
        (color, f"{name} ({int((affordance == code).sum())} points)")
        for code, color, name in (
            (AFFORDANCE_YES, colors.GRASPABLE, "some grasp succeeds"),
            (AFFORDANCE_NO, colors.NOT_GRASPABLE, "none does"),
            (AFFORDANCE_UNKNOWN, colors.UNKNOWN, "not known"),
        )
    ]


# --- The page ------------------------------------------------------------------------------------


def _page(picture: Picture, title: str) -> Page:
    # The camera stays at the origin, z becomes up and the camera looks along x.
    if picture.samples:
        R_level_camera = picture.samples[0].R_level_camera.astype(float)
    else:
        R_level_camera = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    T_level_camera = transforms.transform_from(R_level_camera, np.zeros(3))
    seen = picture.depth > 0
    on_object = seen & (picture.instance_mask > 0)
    layers = [
        _cloud_layer("objects, back-projected", picture, on_object, T_level_camera),
        _cloud_layer("the rest, back-projected", picture, seen & ~on_object, T_level_camera),
    ]
    for i, sample in enumerate(picture.samples):
        layers += _sample_layers(sample, f"{i + 1} {sample.object_id}: ", T_level_camera)
    places = [layer.positions for layer in layers[:2] if len(layer.positions)]
    target = np.median(places[0], axis=0) if places else np.array([1.0, 0.0, 0.0])
    names = ", ".join(f"{i + 1} {s.object_id}" for i, s in enumerate(picture.samples))
    return Page(
        title=title,
        text=f"Seen from the camera that took it. {names or 'No object'}. Affordance: red where "
        "some grasp succeeds; blue where none does and grey where nothing is known, switched off "
        "at first.",
        layers=layers,
        eye=np.zeros(3),
        target=target,
    )


def _cloud_layer(
    name: str, picture: Picture, chosen: NDArray[np.bool_], T_level_camera: Array
) -> Layer:
    """Pixels (H, W) as points in their colours; of too many only every so many-th each way."""
    step = 1
    while np.count_nonzero(chosen[::step, ::step]) > _MAX_POINTS:
        step += 1
    grid = np.zeros_like(chosen)
    grid[::step, ::step] = chosen[::step, ::step]
    points_camera = points_from_depth(picture.depth, picture.intrinsics)[grid]
    # As large as the gaps between points at a middling distance.
    distance = float(np.median(points_camera[:, 2])) if len(points_camera) else 0.0
    return Layer(
        name=name,
        kind="points",
        positions=transforms.apply(T_level_camera, points_camera),
        colors=picture.rgb[grid],
        size=1.3 * step * distance / abs(float(picture.intrinsics[0, 0])),
    )


def _sample_layers(sample: Sample, prefix: str, T_level_camera: Array) -> list[Layer]:
    scale = abs(float(sample.object_scale))
    grasps = carried_grasps(sample)
    chosen = spread_grasps(grasps, _PAGE_GRASPS)
    joints = [
        transforms.apply(T_level_camera, np.stack(joint_arrow(sample, part)))
        for part in _movable(sample)
    ]
    points = transforms.apply(T_level_camera, sample.points_camera)
    parts = np.array([part_color(i) for i in range(sample.num_parts)], dtype=np.uint8)
    paint, graspable = _affordance_colors(sample), sample.affordance == AFFORDANCE_YES

    def dots(
        name: str,
        chosen: NDArray[np.bool_],
        paint: NDArray[np.uint8],
        visible: bool,
        swatch: Color | None = None,
    ) -> Layer:
        return Layer(
            name=prefix + name,
            kind="points",
            positions=points[chosen],
            colors=paint[chosen],
            size=_DOT,
            visible=visible,
            swatch=swatch,
        )

    return [
        dots("parts", np.ones(len(points), dtype=bool), parts[sample.part], False),
        dots("points where some grasp succeeds", graspable, paint, True, colors.GRASPABLE),
        dots("points where none does, or not known", ~graspable, paint, False),
        frame_layer(f"{prefix}part frames", T_level_camera @ sample.T_camera_parts, 0.3 * scale),
        solid_layer(
            f"{prefix}joint axes",
            [(arrow(start, end, 0.012 * scale), colors.JOINT) for start, end in joints],
            swatch=colors.JOINT,
        ),
        solid_layer(
            f"{prefix}{len(chosen)} of {len(grasps)} grasps",
            [(hand(T_level_camera @ grasps[g]), colors.GRASP) for g in chosen],
            swatch=colors.GRASP,
        ),
    ]
