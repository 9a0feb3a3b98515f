"""How fast and how right are the poses of an object's parts, beside a joint-constrained optimizer?

Run ``python -m benchmarks.speed poses --help``. The clouds are synthetic, so that the truth is
exact: boxes seen from one side, linked by joints to a base, with coordinates that err as a
network's do.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.progress import track
from rich.table import Table

from artgym.datasets.sample import JOINT_NONE, JOINT_PRISMATIC, JOINT_REVOLUTE
from artgym.errors import InvalidArgumentError
from artgym.geometry import transforms
from artgym.geometry.rotations import matrix_from_axis_angle, matrix_from_quaternion
from artgym.geometry.screw import JointType, joint_motion
from benchmarks import record
from benchmarks.command import run
from benchmarks.constrained_fit import ConstrainedFitConfig, fit_parts
from icaf4_policy.joint_consistency import consistent_fits
from icaf4_policy.metrics import pose_errors
from icaf4_policy.pose_fitting import PoseFit, fit_pose

Array = NDArray[np.floating]

#: What is promised: the most milliseconds for two parts, and the least times the reference.
TARGETS = {"two_parts_ms": 3.0, "times_reference": 1000.0}

#: Points of a cloud, of all parts together, and at least of each.
_NUM_POINTS, _MIN_POINTS = 2048, 64
#: Standard deviations of a coordinate's own error, and of the entries of the matrix by which a
#: part's coordinates are all distorted, normalised units.
_NOISE, _DISTORTION = 0.02, 0.03
#: Largest share of points whose coordinates are anything.
_MAX_OUTLIERS = 0.4
#: Standard deviation of a predicted axis in each direction, radians.
_AXIS_ERROR = np.radians(2.0)

#: How the ways of fitting are called.
WAYS: Mapping[str, str] = {
    "alone": "ours, each part alone",
    "joints": "ours, agreeing with the joints",
    "reference": "joint-constrained optimizer",
}

_CODES: Mapping[JointType, int] = {"prismatic": JOINT_PRISMATIC, "revolute": JOINT_REVOLUTE}


@dataclass(frozen=True, kw_only=True)
class PoseSpeedConfig:
    """How fast and how right are the poses of an object's parts?

    Attributes:
        clouds: how many are fitted; of two, three and four parts in turn.
        reference: how many of them the reference fits too, the first; it takes seconds a joint,
            which makes 20 to 30 minutes for 300.
        hypotheses: that the reference tries for each joint.
        seed: of the clouds and of all fits.
        out: folder for pose_speed.json.
    """

    clouds: int = 300
    reference: int = 60
    hypotheses: int = ConstrainedFitConfig.hypotheses
    seed: int = 0
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        if not 3 <= self.reference <= self.clouds or self.hypotheses < 1:
            raise InvalidArgumentError(
                f"reference={self.reference}, clouds={self.clouds}, hypotheses={self.hypotheses}: "
                "expected 3 <= reference <= clouds, so that each number of parts occurs, and a "
                "hypothesis or more."
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class Cloud:
    """What a network says about an object of K parts (base = 0), and the truth.

    Attributes:
        nocs: of each part, (n, 3), 0.5 at the box's centre.
        points_camera: of each part, (n, 3), metres.
        joint_types: (K - 1,), of the joints between base and parts.
        axes_base: (K - 1, 3), predicted unit axes, frame of the base.
        axes_camera: (K - 1, 3), the same predictions, camera frame.
        T_camera_boxes: (K, 4, 4), the truth.
        diameter: metres, of the object's box at rest.
    """

    nocs: tuple[Array, ...]
    points_camera: tuple[Array, ...]
    joint_types: tuple[JointType, ...]
    axes_base: Array
    axes_camera: Array
    T_camera_boxes: Array
    diameter: float


def random_cloud(num_parts: int, rng: np.random.Generator) -> Cloud:
    """Boxes of any size and place, each seen from one side; all parts have the base's axes at rest.

    A joint turns by up to two right angles or slides by up to 0.4 m, about or along one of the
    base's axes.
    """
    R_camera_base = matrix_from_quaternion(rng.normal(size=4))
    T_camera_base = transforms.transform_from(R_camera_base, rng.normal(scale=0.1, size=3))
    T_camera_base[2, 3] += 1.0
    sizes = rng.uniform([0.1, 0.1, 0.02], 0.5, (num_parts, 3))
    centers = rng.uniform(-0.3, 0.3, (num_parts, 3))
    joint_types: list[JointType] = []
    axes = np.eye(3)[rng.integers(0, 3, num_parts - 1)] * rng.choice(
        [-1.0, 1.0], (num_parts - 1, 1)
    )
    T_camera_parts = [T_camera_base]
    for axis in axes:
        joint_type: JointType = "revolute" if rng.random() < 0.5 else "prismatic"
        q = rng.uniform(0.0, np.pi if joint_type == "revolute" else 0.4)
        pivot = rng.uniform(-0.3, 0.3, 3)
        T_camera_parts.append(T_camera_base @ joint_motion(joint_type, axis, pivot, q))
        joint_types.append(joint_type)
    T_camera_boxes = np.stack(T_camera_parts) @ transforms.translation(centers)

    shares = rng.dirichlet(np.full(num_parts, 3.0))
    counts = _MIN_POINTS + rng.multinomial(_NUM_POINTS - num_parts * _MIN_POINTS, shares)
    outliers = rng.uniform(0.0, _MAX_OUTLIERS)
    nocs, points_camera = [], []
    for size, T_camera_box, count in zip(sizes, T_camera_boxes, counts, strict=True):
        points = _seen_surface(size, T_camera_box, int(count), rng)
        points_camera.append(transforms.apply(T_camera_box, points))
        nocs.append(_predicted(points / np.linalg.norm(size), outliers, rng) + 0.5)
    corners = np.concatenate([centers - sizes / 2, centers + sizes / 2])
    tilts = matrix_from_axis_angle(rng.normal(scale=_AXIS_ERROR, size=(num_parts - 1, 3)))
    axes_base = (tilts @ axes[..., None])[..., 0]
    return Cloud(
        nocs=tuple(nocs),
        points_camera=tuple(points_camera),
        joint_types=tuple(joint_types),
        axes_base=axes_base,
        axes_camera=axes_base @ R_camera_base.T,
        T_camera_boxes=T_camera_boxes,
        diameter=float(np.linalg.norm(np.ptp(corners, axis=0))),
    )


def _seen_surface(size: Array, T_camera_box: Array, count: int, rng: np.random.Generator) -> Array:
    """Points (count, 3), box frame, even on the faces of a box that the camera sees."""
    eye = transforms.invert(T_camera_box)[:3, 3]
    # Of two opposite faces at most one is seen, and one of all six where the eye is inside.
    side = np.sign(eye)
    seen = np.abs(eye) > size / 2
    seen[np.argmax(np.abs(eye) / size)] = True
    area = np.where(seen, np.prod(size) / size, 0.0)
    axis = rng.choice(3, count, p=area / area.sum())
    points = rng.uniform(-0.5, 0.5, (count, 3))
    points[np.arange(count), axis] = 0.5 * side[axis]
    return points * size


def _predicted(coordinates: Array, outliers: float, rng: np.random.Generator) -> Array:
    """Coordinates (n, 3) about 0 as a network would give them.

    All are distorted alike, since neighbours err alike; each has an error of its own, and of some
    nothing is left.
    """
    distortion = np.eye(3) + rng.normal(scale=_DISTORTION, size=(3, 3))
    predicted = coordinates @ distortion.T + rng.normal(scale=_NOISE, size=coordinates.shape)
    lost = rng.random(len(predicted)) < outliers
    predicted[lost] = rng.uniform(-0.5, 0.5, (int(lost.sum()), 3))
    return predicted


def _fit_freely(cloud: Cloud, rng: np.random.Generator) -> tuple[PoseFit, ...]:
    return tuple(fit_pose(x, y, rng) for x, y in zip(cloud.nocs, cloud.points_camera, strict=True))


def _fit_with_joints(cloud: Cloud, rng: np.random.Generator) -> tuple[PoseFit | None, ...]:
    return consistent_fits(
        _fit_freely(cloud, rng),
        cloud.nocs,
        cloud.points_camera,
        [JOINT_NONE, *(_CODES[joint_type] for joint_type in cloud.joint_types)],
        np.concatenate([np.zeros((1, 3)), cloud.axes_camera]),
    )


def measure(config: PoseSpeedConfig) -> dict[str, Any]:
    """Fits every cloud in each way, one after the other; writes ``pose_speed.json``.

    Times are the processor's for this one thread: other work on the machine would count for the
    long solves of the reference, and hardly for the short ones.
    """
    slow = ConstrainedFitConfig(hypotheses=config.hypotheses)

    def reference(cloud: Cloud, rng: np.random.Generator) -> tuple[PoseFit, ...]:
        return fit_parts(
            cloud.nocs, cloud.points_camera, cloud.joint_types, cloud.axes_base, rng, slow
        )

    ways: dict[str, Callable[[Cloud, np.random.Generator], Sequence[PoseFit | None]]] = {
        "alone": _fit_freely,
        "joints": _fit_with_joints,
        "reference": reference,
    }
    # Compiled, or read from the compiler's cache, before the clock runs.
    _fit_with_joints(random_cloud(2, np.random.default_rng(config.seed)), np.random.default_rng(0))
    found: dict[str, list[dict[str, float]]] = {way: [] for way in ways}
    for i in track(range(config.clouds), description="clouds"):
        cloud = random_cloud(2 + i % 3, np.random.default_rng([config.seed, i]))
        for way, fit in ways.items():
            if way == "reference" and i >= config.reference:
                continue
            began = time.process_time()
            fits = fit(cloud, np.random.default_rng([config.seed, i, 1]))
            seconds = time.process_time() - began
            found[way].append({"parts": 2 + i % 3, "ms": 1000.0 * seconds, **_errors(fits, cloud)})
    result = {
        **record.provenance("benchmarks.speed"),
        "config": {name: value for name, value in asdict(config).items() if name != "out"},
        "targets": TARGETS,
        "ways": dict(WAYS),
        "rows": {
            str(parts): _row(
                {way: [r for r in rows if r["parts"] == parts] for way, rows in found.items()}
            )
            for parts in (2, 3, 4)
        },
        "all": _row(found),
    }
    record.write_result(config.out / "pose_speed.json", result)
    return result


def _errors(fits: Sequence[PoseFit | None], cloud: Cloud) -> dict[str, float]:
    """Mean over the parts: degrees, and share of the object's diameter."""
    Ts_camera_boxes = np.stack([fit.T_camera_box for fit in fits if fit is not None])
    rotation, translation = pose_errors(Ts_camera_boxes, cloud.T_camera_boxes)
    return {
        "rotation_deg": float(np.degrees(rotation).mean()),
        "translation": float(translation.mean()) / cloud.diameter,
    }


def _row(found: Mapping[str, list[dict[str, float]]]) -> dict[str, Any]:
    """Times and errors of each way; on the reference's own clouds also how it compares."""
    row: dict[str, Any] = {}
    for way, cases in found.items():
        ms = np.array([case["ms"] for case in cases])
        shared = cases[: len(found["reference"])]
        row[way] = {
            "clouds": len(cases),
            "ms": {"median": float(np.median(ms)), "p99": float(np.percentile(ms, 99))},
            "rotation_deg": float(np.mean([case["rotation_deg"] for case in cases])),
            "translation": float(np.mean([case["translation"] for case in cases])),
            "beside_reference": {
                "rotation_deg": float(np.mean([case["rotation_deg"] for case in shared])),
                "translation": float(np.mean([case["translation"] for case in shared])),
                "times": float(
                    np.median(
                        [
                            slow["ms"] / case["ms"]
                            for slow, case in zip(found["reference"], shared, strict=True)
                        ]
                    )
                ),
            },
        }
    return row


def tables_from_result(result: Mapping[str, Any]) -> list[Table]:
    """The tables for a person to read."""
    table = Table(title="poses of parts, 2,048 points, up to 40 % outliers, one thread")
    columns = ("parts", "fit", "clouds", "ms, median", "ms, p99", "rotation, deg")
    columns += ("translation, % of diameter", "on the optimizer's clouds: deg", "%", "times faster")
    for name in columns:
        table.add_column(name, justify="left" if name == "fit" else "right")
    for parts, row in [*result["rows"].items(), ("all", result["all"])]:
        for way, label in result["ways"].items():
            here = row[way]
            beside = here["beside_reference"]
            table.add_row(
                parts,
                label,
                f"{here['clouds']}",
                f"{here['ms']['median']:,.2f}",
                f"{here['ms']['p99']:,.2f}",
                f"{here['rotation_deg']:.2f}",
                f"{100 * here['translation']:.2f}",
                f"{beside['rotation_deg']:.2f}",
                f"{100 * beside['translation']:.2f}",
                f"{beside['times']:,.0f}",
            )
    bars = Table(title="what is promised, of the fit that agrees with the joints")
    for name in ("", "measured", "promised"):
        bars.add_column(name, justify="right" if name else "left")
    ours, theirs = result["all"]["joints"]["beside_reference"], result["all"]["reference"]
    promised = result["targets"]
    bars.add_row(
        "two parts, ms",
        f"{result['rows']['2']['joints']['ms']['median']:.2f}",
        f"<= {promised['two_parts_ms']:g}",
    )
    bars.add_row(
        "times the optimizer", f"{ours['times']:,.0f}", f">= {promised['times_reference']:,.0f}"
    )
    for label, key, factor in (
        ("rotation error, deg", "rotation_deg", 1),
        ("translation error, % of diameter", "translation", 100),
    ):
        bars.add_row(label, f"{factor * ours[key]:.2f}", f"<= {factor * theirs[key]:.2f}")
    return [table, bars]


def report(config: PoseSpeedConfig) -> list[Table]:
    """Measures, writes ``pose_speed.json`` and gives the tables."""
    return tables_from_result(measure(config))


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("pose_speed", PoseSpeedConfig, report, arguments)
