"""Do other programs see the objects that we see? `python -m benchmarks.exports`.

Each object is written as URDF and MJCF, loaded by yourdfpy and by MuJoCo, put into several joint
states, and its parts' poses, limits and masses are compared with ours. Then the URDF is imported
again: with its exact description, which must give the very same object, and without.
"""

from __future__ import annotations

import importlib
import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from artgym.errors import InvalidArgumentError, MissingDependencyError
from artgym.geometry.transforms import transform_from
from artgym.objects import catalog
from artgym.objects.mjcf_export import write_mjcf
from artgym.objects.model import ArticulatedObject
from artgym.objects.urdf import read_urdf
from artgym.objects.urdf_export import description_folder, link_origins, write_urdf
from benchmarks import record
from benchmarks.command import run
from benchmarks.parallel import results_in_order

Array = NDArray[np.floating]

#: Two numbers that differ by less are the same but for rounding.
SAME = 1e-9


@dataclass(frozen=True, kw_only=True)
class ExportsConfig:
    """What is written and loaded.

    Attributes:
        category: categories.
        objects: test objects of each.
        states: joint states of each object, the two ends among them.
        workers: processes.
        out: folder for ``exports.json``.
    """

    category: tuple[str, ...] = tuple(catalog.CATEGORIES)
    objects: int = 10
    states: int = 5
    workers: int = 2
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        for name in ("objects", "states", "workers"):
            least = 2 if name == "states" else 1
            if getattr(self, name) < least:
                raise InvalidArgumentError(f"{name}={getattr(self, name)}: expected {least}+")


@dataclass(frozen=True)
class ExportTask:
    """One object to write and load."""

    object_id: str
    states: int


@dataclass(frozen=True, kw_only=True)
class Loaded:
    """How a loader's object differs from ours.

    Attributes:
        same_names: links and joints have our names, kinds, parents and children.
        limits: largest difference of a limit, metres or radians.
        masses: largest relative difference of a mass.
        poses: largest difference of a link's position, metres, or of an entry of its rotation.
    """

    same_names: bool
    limits: float
    masses: float
    poses: float


@dataclass(frozen=True, kw_only=True)
class ObjectRecord:
    """What came of one object.

    Attributes:
        object_id: which.
        loaders: by the loader's name.
        comes_back: the URDF with its description gives an equal object with an equal hash.
        alone_joints, alone_masses: largest difference of joints (axis, pivot, ends, friction,
            damping), and of masses and their centres, of an import without the description.
        alone_shapes: share of pieces that such an import has as they were, within ``SAME``.
        alone_bounds: largest difference of a link's box, metres.
    """

    object_id: str
    loaders: Mapping[str, Loaded] = field(default_factory=dict)
    comes_back: bool
    alone_joints: float
    alone_masses: float
    alone_shapes: float
    alone_bounds: float


def examine(task: ExportTask) -> ObjectRecord:
    """Writes one object, loads it everywhere, and compares."""
    obj = catalog.load(task.object_id)
    rng = np.random.default_rng(0)
    inner = [[j.position(rng.random()) for j in obj.joints] for _ in range(task.states - 2)]
    states = [[j.closed for j in obj.joints], [j.open for j in obj.joints], *inner]
    with tempfile.TemporaryDirectory(prefix="artgym-export-") as name:
        folder = Path(name)
        urdf, mjcf = write_urdf(obj, folder), write_mjcf(obj, folder)
        loaders = {
            "yourdfpy": _with_yourdfpy(obj, urdf, states),
            "mujoco, URDF": _with_mujoco(obj, urdf, states),
            "mujoco, MJCF": _with_mujoco(obj, mjcf, states),
        }
        back = replace(read_urdf(urdf).object, object_id=obj.object_id)
        comes_back = back == obj and back.content_hash() == obj.content_hash()
        shutil.rmtree(description_folder(urdf))
        ends = {j.name: "lower" if j.closed < j.open else "upper" for j in obj.joints}
        alone = read_urdf(urdf, closed=ends).object  # pyright: ignore[reportArgumentType]
    return ObjectRecord(
        object_id=task.object_id, loaders=loaders, comes_back=comes_back, **_difference(obj, alone)
    )


def _expected_poses(obj: ArticulatedObject, q: Sequence[float]) -> dict[str, Array]:
    """Poses (4, 4) of the file's link frames, by the link's name."""
    poses = obj.link_poses(list(q))
    return {
        name: T @ transform_from(np.eye(3), origin)
        for T, (name, origin) in zip(poses, link_origins(obj).items(), strict=True)
    }


def _pose_error(
    obj: ArticulatedObject,
    states: Sequence[Sequence[float]],
    poses: Callable[[Sequence[float]], Mapping[str, Array]],
) -> float:
    errors = [0.0]
    for q in states:
        found = poses(q)
        for name, expected in _expected_poses(obj, q).items():
            errors.append(float(np.abs(found[name] - expected).max()))
    return max(errors)


def _with_yourdfpy(obj: ArticulatedObject, path: Path, states: Sequence[Sequence[float]]) -> Loaded:
    try:
        yourdfpy: Any = importlib.import_module("yourdfpy")
    except ImportError:
        raise _missing("yourdfpy", "dev") from None
    robot = yourdfpy.URDF.load(str(path))

    def poses(q: Sequence[float]) -> dict[str, Array]:
        robot.update_cfg({j.name: value for j, value in zip(obj.joints, q, strict=True)})
        return {name: robot.get_transform(name) for name in obj.part_names}

    theirs = robot.robot.joints
    return Loaded(
        same_names=list(robot.link_map) == list(obj.part_names)
        and [(j.name, j.type, j.parent, j.child) for j in theirs]
        == [(j.name, j.type, j.parent, j.child) for j in obj.joints],
        limits=max(
            float(
                np.abs(
                    np.subtract((t.limit.lower, t.limit.upper), sorted((j.closed, j.open)))
                ).max()
            )
            for t, j in zip(theirs, obj.joints, strict=True)
        ),
        masses=max(
            abs(robot.link_map[link.name].inertial.mass / link.mass - 1) for link in obj.links
        ),
        poses=_pose_error(obj, states, poses),
    )


def _with_mujoco(obj: ArticulatedObject, path: Path, states: Sequence[Sequence[float]]) -> Loaded:
    try:
        mujoco: Any = importlib.import_module("mujoco")
    except ImportError:
        raise _missing("mujoco", "mjcf") from None
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)

    def poses(q: Sequence[float]) -> dict[str, Array]:
        for joint, value in zip(obj.joints, q, strict=True):
            data.joint(joint.name).qpos = value
        mujoco.mj_kinematics(model, data)
        bodies = {name: data.body(name) for name in obj.part_names}
        return {n: transform_from(b.xmat.reshape(3, 3), b.xpos) for n, b in bodies.items()}

    names = {model.body(i).name for i in range(1, model.nbody)}
    same = names == set(obj.part_names) and model.njnt == model.nv == len(obj.joints)
    kinds = {"prismatic": mujoco.mjtJoint.mjJNT_SLIDE, "revolute": mujoco.mjtJoint.mjJNT_HINGE}
    limits = 0.0
    for joint in obj.joints:
        theirs = model.joint(joint.name)
        child = model.body(theirs.bodyid[0])
        same &= theirs.type[0] == kinds[joint.type] and child.name == joint.child
        same &= model.body(child.parentid[0]).name == joint.parent
        same &= bool(model.jnt_limited[theirs.id])
        ends = sorted((joint.closed, joint.open))
        limits = max(limits, float(np.abs(theirs.range - ends).max()))
    return Loaded(
        same_names=bool(same),
        limits=limits,
        masses=max(abs(float(model.body(k.name).mass[0]) / k.mass - 1) for k in obj.links),
        poses=_pose_error(obj, states, poses),
    )


def _missing(package: str, extra: str) -> MissingDependencyError:
    return MissingDependencyError(
        f"this benchmark compares with {package}: pip install 'artgym[{extra}]'"
    )


def _difference(obj: ArticulatedObject, other: ArticulatedObject) -> dict[str, Any]:
    """How far an import without description lies from the object, about their common origin."""
    # The importer puts its own origin under the middle of what collides.
    shift = other.links[0].center_of_mass - obj.links[0].center_of_mass
    joints, masses, bounds, same, pieces = [0.0], [0.0], [0.0], 0, 0
    for ours, theirs in zip(obj.joints, other.joints, strict=True):
        for name in ("axis", "closed", "open", "friction", "damping"):
            joints.append(
                float(np.abs(np.subtract(getattr(theirs, name), getattr(ours, name))).max())
            )
        if ours.type == "revolute":
            joints.append(float(np.abs(np.subtract(theirs.pivot, shift) - ours.pivot).max()))
    for ours, theirs in zip(obj.links, other.links, strict=True):
        masses.append(abs(theirs.mass - ours.mass))
        masses.append(float(np.abs(theirs.center_of_mass - shift - ours.center_of_mass).max()))
        masses.append(float(np.abs(theirs.inertia - ours.inertia).max()))
        bounds.append(float(np.abs(theirs.bounds() - shift - ours.bounds()).max()))
        pieces += len(ours.shapes)
        if len(ours.shapes) == len(theirs.shapes):
            same += sum(
                _same_box(a.corners_link(), b.corners_link() - shift)
                for a, b in zip(ours.shapes, theirs.shapes, strict=True)
            )
    return {
        "alone_joints": max(joints),
        "alone_masses": max(masses),
        "alone_bounds": max(bounds),
        "alone_shapes": same / pieces,
    }


def _same_box(one: Array, other: Array) -> bool:
    ends = [np.stack([p.min(axis=0), p.max(axis=0)]) for p in (one, other)]
    return bool(np.abs(ends[0] - ends[1]).max() < SAME)


def measure(config: ExportsConfig) -> dict[str, Any]:
    """Writes and loads all objects; the content of ``exports.json``."""
    tasks = [
        ExportTask(object_id, config.states)
        for category in config.category
        for object_id in catalog.object_ids(category, "test", config.objects)
    ]
    records = results_in_order(
        examine, tasks, workers=config.workers, description="exports", unit="object"
    )
    rows: dict[str, dict[str, Any]] = {}
    for category in config.category:
        chosen = [r for r in records if r.object_id.startswith(f"{category}/")]
        rows[category] = {
            "objects": len(chosen),
            "loaders": {
                name: {
                    "same": sum(
                        r.loaders[name].same_names
                        and r.loaders[name].limits < SAME
                        and r.loaders[name].masses < SAME
                        for r in chosen
                    ),
                    "poses": max(r.loaders[name].poses for r in chosen),
                }
                for name in chosen[0].loaders
            },
            "comes_back": sum(r.comes_back for r in chosen),
            "alone_joints": max(r.alone_joints for r in chosen),
            "alone_masses": max(r.alone_masses for r in chosen),
            "alone_bounds": max(r.alone_bounds for r in chosen),
            "alone_shapes": float(np.mean([r.alone_shapes for r in chosen])),
        }
    return {
        **record.provenance("benchmarks.exports"),
        "config": asdict(config),
        "rows": rows,
        "objects": [asdict(r) for r in records],
    }


def table_from_rows(rows: Mapping[str, Mapping[str, Any]]) -> Table:
    """A line for each category, and one for all."""
    table = Table(title="exported objects as other programs load them")
    loaders = list(next(iter(rows.values()))["loaders"])
    table.add_column("category", no_wrap=True)
    for name in (
        "objects",
        *(column for loader in loaders for column in (f"{loader}: same", "pose error")),
        "comes back equal",
        "URDF alone: joints",
        "masses",
        "boxes, m",
        "pieces kept",
    ):
        table.add_column(name, justify="right")
    total = {
        "objects": sum(r["objects"] for r in rows.values()),
        "loaders": {
            name: {
                "same": sum(r["loaders"][name]["same"] for r in rows.values()),
                "poses": max(r["loaders"][name]["poses"] for r in rows.values()),
            }
            for name in loaders
        },
        "comes_back": sum(r["comes_back"] for r in rows.values()),
        **{
            f"alone_{name}": max(r[f"alone_{name}"] for r in rows.values())
            for name in ("joints", "masses", "bounds")
        },
        "alone_shapes": float(np.mean([r["alone_shapes"] for r in rows.values()])),
    }
    for category, row in {**rows, "all": total}.items():
        cells = [str(row["objects"])]
        for name in loaders:
            cells += [str(row["loaders"][name]["same"]), f"{row['loaders'][name]['poses']:.0e}"]
        cells.append(str(row["comes_back"]))
        cells += [f"{row[f'alone_{name}']:.0e}" for name in ("joints", "masses", "bounds")]
        cells.append(f"{100 * row['alone_shapes']:.0f} %")
        table.add_row(category, *cells)
    return table


def report(config: ExportsConfig) -> list[Table]:
    """Measures, writes ``exports.json`` and gives the table."""
    result = measure(config)
    record.write_result(config.out / "exports.json", result)
    return [table_from_rows(result["rows"])]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("exports", ExportsConfig, report, arguments)


if __name__ == "__main__":
    sys.exit(main())
