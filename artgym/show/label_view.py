"""`artgym show labels`: where an object can be gripped, and how."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from artgym.annotation.annotate import (
    Labels,
    label_file_name,
    labels_folder,
    positions_at,
    read_labels,
)
from artgym.annotation.trial import TRIAL_ENDS
from artgym.datasets.drawing import hand_lines
from artgym.errors import InvalidArgumentError
from artgym.files import write_file_whole
from artgym.geometry import transforms
from artgym.geometry.grasps import APPROACH_RINGS, NUM_CANDIDATES, NUM_ROLLS
from artgym.objects import catalog
from artgym.objects.model import ArticulatedObject
from artgym.show import colors
from artgym.show.cast import CastPicture, cast_picture, fitting_view, visible
from artgym.show.grasp_choice import spread_grasps
from artgym.show.object_view import joint_axis, joint_layers
from artgym.show.page import Layer, Page, PageRamp, object_layers, solid_layer, start_eye
from artgym.show.sheet import Overlay, Panel, Ramp, bar_chart, faded, sheet_png
from artgym.show.solids import hand
from artgym.sim.thumbnail import seen_points

Array = NDArray[np.floating]

#: Width and height of a picture on the sheet, and of a chart, pixels.
SIZE, CHART_SIZE = (480, 360), (480, 200)
_SHEET_GRASPS, _PAGE_GRASPS = 6, 12
#: The ring of approaches of each try.
_RING_OF_TRY = np.repeat(
    np.arange(len(APPROACH_RINGS)), [count * NUM_ROLLS for _, count in APPROACH_RINGS]
)
_FAILED = (120, 125, 140)


def show_labels(
    object_id: str, out: Path, *, root: Path | None = None, state: int | None = None
) -> tuple[Path, Path]:
    """Writes a sheet and a 3D page of the grasp labels of an object.

    Args:
        object_id: of the catalogue, or import/NAME.
        out: folder that gets "drawer_0012_labels.png" and ".html".
        root: folder that ``artgym annotate`` wrote; by default the labels inside the package.
        state: the joint state that is shown; by default the sheet shows all of them, and the page
            the one in which most tries succeed.

    Returns:
        Both files.

    Raises:
        UnknownNameError: no such object.
        InvalidArgumentError: it has no labels there, or not that state.
        DamagedFileError: its label file is damaged.
        FileNotWrittenError: the system refused.
    """
    obj = catalog.load(object_id)
    folder = labels_folder(object_id.partition("/")[0], catalog.split_of(object_id), root)
    if not (folder / label_file_name(object_id)).exists():
        elsewhere = " or name their folder with --labels" if root is None else ""
        raise InvalidArgumentError(
            f"{object_id} has no labels in {folder}: make them with `artgym annotate --object "
            f"{object_id} --out FOLDER`{elsewhere}."
        )
    labels = read_labels(object_id, root)
    states = len(labels.fractions)
    if state is not None and not 0 <= state < states:
        raise InvalidArgumentError(
            f"state={state}: the labels of {object_id} are of {states} joint states, 0 to "
            f"{states - 1}."
        )
    successes = labels.success.sum(axis=1)
    if state is None:
        chosen = int(np.argmax([successes[labels.state == s].sum() for s in range(states)]))
    else:
        chosen = state
    stem = f"{object_id.replace('/', '_')}_labels"
    stem += "" if state is None else f"_{state}"
    sheet, page = out / f"{stem}.png", out / f"{stem}.html"
    shown = range(states) if state is None else [state]
    write_file_whole(sheet, _sheet(obj, labels, shown))
    write_file_whole(page, _page(obj, labels, chosen).html())
    return sheet, page


def _shares(labels: Labels) -> Array:
    """The share (N,) of the tries at each point that succeed."""
    return labels.success.mean(axis=1)


def _highest(labels: Labels, states: Sequence[int]) -> float:
    """The largest share in some states, rounded up to 5 percent: what the colours end at."""
    shown = _shares(labels)[np.isin(labels.state, list(states))]
    return max(0.05, float(np.ceil(shown.max(initial=0.0) * 20) / 20))


def _successful_grasps(obj: ArticulatedObject, labels: Labels, rows: NDArray[np.integer]) -> Array:
    """The tries at points that succeeded, as T_object_grasp (n, 4, 4).

    Those at the point where most succeed come first.
    """
    success = labels.success
    order = rows[np.argsort(-success[rows].sum(axis=1), kind="stable")]
    poses = [labels.tries(obj, int(row))[1][success[row]] for row in order]
    return np.concatenate([np.empty((0, 4, 4)), *poses])


def _openings(obj: ArticulatedObject, labels: Labels, state: int) -> str:
    """How far the parts stand open in a state."""
    opened = ", ".join(
        f"{joint.child} {100 * fraction:.0f} %"
        for joint, fraction in zip(obj.joints, labels.fractions[state], strict=True)
    )
    return f"{opened} open"


def _sheet(obj: ArticulatedObject, labels: Labels, states: Sequence[int]) -> bytes:
    shares, success, highest = _shares(labels), labels.success, _highest(labels, states)
    rings = [np.flatnonzero(np.equal(_RING_OF_TRY, ring)) for ring in range(len(APPROACH_RINGS))]
    by_ring = {
        state: [float(success[labels.state == state][:, tries].mean()) for tries in rings]
        for state in states
    }
    top = max([0.01, *(share for each in by_ring.values() for share in each)])
    maps, grasps, charts = [], [], []
    for state in states:
        rows = np.flatnonzero(labels.state == state)
        q = positions_at(obj, labels.fractions[state])
        poses = _successful_grasps(obj, labels, rows)
        chosen = poses[spread_grasps(poses, _SHEET_GRASPS)]
        axes = [joint_axis(obj, part, q) for part in np.unique(labels.part[rows]).tolist()]
        hands = [line for T in chosen for line in hand_lines(T)]
        marks = [seen_points(obj, q), *hands, *(np.stack(axis) for axis in axes)]
        drawn = cast_picture(obj, q, fitting_view(np.concatenate(marks), SIZE))
        maps.append(
            Panel(
                heading=f"state {state}: where",
                image=_affordance_image(obj, labels, q, rows, drawn, shares / highest),
                legend=[
                    (None, _openings(obj, labels, state)),
                    Ramp(low="share of tries that succeed: above 0", high=f"{100 * highest:.0f} %"),
                    (
                        _FAILED,
                        f"none succeeds ({int((shares[rows] == 0).sum())} of {len(rows)} points)",
                    ),
                ],
            )
        )
        grasps.append(
            Panel(
                heading=f"state {state}: how",
                image=_grasp_image(drawn, axes, chosen),
                legend=[
                    (
                        colors.GRASP,
                        f"{len(chosen)} of {len(poses)} successful grasps, unlike one another",
                    ),
                    (colors.JOINT, "joint axis"),
                ],
            )
        )
        notes = [
            f"{100 * share:.1f} % of {len(rows) * count * NUM_ROLLS}"
            for share, (_, count) in zip(by_ring[state], APPROACH_RINGS, strict=True)
        ]
        names = [f"{tilt:.0f}°" for tilt, _ in APPROACH_RINGS]
        charts.append(
            Panel(
                heading=f"state {state}: success by tilt",
                image=bar_chart(CHART_SIZE, names, by_ring[state], notes, top),
                legend=[(None, _counts(labels, state))],
            )
        )
    text = (
        f"Which grasps move a part: {NUM_CANDIDATES} hand poses tried in physics at each of "
        f"{len(labels.part)} surface points, in {len(labels.fractions)} joint states. A try "
        "succeeds if it moves the part through half of its range, gripped between the fingers. "
        "Tilt is the angle between the hand's approach and the inward normal of the surface."
    )
    # One state is a row, several are columns.
    if len(states) == 1:
        rows_of_panels = [[maps[0], grasps[0], charts[0]]]
    else:
        rows_of_panels = [maps, grasps, charts]
    return sheet_png(f"{obj.object_id}: grasp labels", text, rows_of_panels)


def _affordance_image(
    obj: ArticulatedObject,
    labels: Labels,
    q: Array,
    rows: NDArray[np.integer],
    drawn: CastPicture,
    values: Array,
) -> NDArray[np.uint8]:
    """The labelled points that are seen over the object, coloured by values (N,) in [0, 1]."""
    poses = obj.link_poses(q)[labels.part[rows]]
    points = (poses[:, :3, :3] @ labels.points_part[rows, :, None])[..., 0] + poses[:, :3, 3]
    shown = visible(obj, q, drawn.view, points)
    overlay = _overlay(drawn)
    some = values[rows] > 0
    failed = np.tile(_FAILED, (len(rows), 1))
    overlay.dots(points[shown & ~some], failed[shown & ~some], 2.5)
    overlay.dots(points[shown & some], colors.ramp(values[rows])[shown & some], 5.0, rim=True)
    return overlay.image()


def _grasp_image(
    drawn: CastPicture, axes: Sequence[tuple[Array, Array]], Ts_object_grasp: Array
) -> NDArray[np.uint8]:
    """Grasps (n, 4, 4) as hands, and joints by the ends of their arrows."""
    overlay = _overlay(drawn)
    for axis in axes:
        overlay.arrow(*axis, colors.JOINT, 2.0)
    for T in Ts_object_grasp:
        overlay.hand(T, colors.GRASP)
    return overlay.image()


def _overlay(drawn: CastPicture) -> Overlay:
    T_camera_object = transforms.invert(drawn.view.T_world_camera)
    return Overlay(faded(drawn.rgb, 0.6), drawn.view.intrinsics, T_camera_object)


def _counts(labels: Labels, state: int) -> str:
    """What became of the tries of a state."""
    possible, *_ = labels.verdicts[state].tolist()
    ends = ", ".join(
        f"{count} {name.replace('_', ' ')}"
        for name, count in zip(TRIAL_ENDS, labels.ends[state].tolist(), strict=True)
        if count
    )
    total = int(labels.verdicts[state].sum())
    return f"{total} tries, {possible} of them possible by geometry; these ended: {ends or 'none'}."


def _page(obj: ArticulatedObject, labels: Labels, state: int) -> Page:
    rows = np.flatnonzero(labels.state == state)
    q = positions_at(obj, labels.fractions[state])
    shares, highest = _shares(labels), _highest(labels, [state])
    layers = [*object_layers(obj), *joint_layers(obj)]
    # Points and hands lie in the frames of their parts, so that they move with them.
    parts = np.unique(labels.part[rows]).tolist()
    for part in parts:
        name = obj.part_names[part]
        mine = rows[labels.part[rows] == part]
        some = shares[mine] > 0
        paint = np.where(some[:, None], colors.ramp(shares[mine] / highest), _FAILED)
        layers.append(
            Layer(
                name=f"labelled points on {name}",
                kind="points",
                positions=labels.points_part[mine],
                colors=paint.astype(np.uint8),
                size=0.009,
                link=part,
            )
        )
        poses = _successful_grasps(obj, labels, mine)
        chosen = spread_grasps(poses, max(3, _PAGE_GRASPS // len(parts)))
        T_part_object = transforms.invert(obj.link_poses(q)[part])
        layers.append(
            solid_layer(
                f"{len(chosen)} of {len(poses)} grasps that move {name}",
                [(hand(T_part_object @ poses[i]), colors.GRASP) for i in chosen],
                link=part,
                swatch=colors.GRASP,
            )
        )
    eye, target = start_eye(seen_points(obj, q))
    return Page(
        title=f"{obj.object_id}: grasp labels",
        text=f"State {state}: {_openings(obj, labels, state)}. {_counts(labels, state)}",
        layers=layers,
        eye=eye,
        target=target,
        obj=obj,
        fractions=labels.fractions[state],
        ramp=PageRamp(
            name="share of tries that succeed (grey: none)", low="0", high=f"{100 * highest:.0f} %"
        ),
    )
