"""How many grasp verdicts a second, and are they those of slow, fine physics?

A verdict says of one object, joint state, surface point and pose whether the grasp succeeds: by the
geometric filter where that rules it out, else by a trial. Run
``python -m benchmarks.speed labels --help``.
"""

from __future__ import annotations

import functools
import tempfile
import time
import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from artgym.annotation.annotate import positions_at, tried_poses, visible_points
from artgym.annotation.filter import Verdict, judge
from artgym.annotation.trial import REFERENCE, TRIAL_ENDS, TrialConfig, try_grasp
from artgym.datasets.sets import SETS
from artgym.geometry import transforms
from artgym.geometry.grasps import NUM_CANDIDATES
from artgym.geometry.hand import T_hand_grasp
from artgym.objects import catalog
from artgym.objects.urdf_export import write_urdf
from artgym.sim.setting import MAX_YAW
from benchmarks import record
from benchmarks.command import require_positive, run
from benchmarks.parallel import results_in_order
from benchmarks.where2act_protocol import ProtocolTask, run_protocol

#: What is promised: verdicts a second on two cores, and times Where2Act's protocol; agreement and
#: kappa against the reference; filter rejects that physics accepts.
TARGETS: Mapping[str, float] = {
    "verdicts_a_second": 1000.0,
    "times_where2act": 1000.0,
    "agreement": 0.99,
    "kappa": 0.95,
    "wrong_rejects": 0.0,
}

#: Cameras from which surface points are seen.
_VIEWS = 8


@dataclass(frozen=True, kw_only=True)
class LabelSpeedConfig:
    """How many grasp verdicts a second, and are they those of slow, fine physics?

    Attributes:
        category: categories of objects; by default those of the paper.
        objects: of each category, from the split; half as an episode begins, half open anyhow.
        split: whose objects; by default those nobody was tuned on.
        points: surface points an object, from its movable parts in turn; 200 poses each.
        compared: random (object, point, pose) that the slow reference judges too.
        rejected: poses that the filter rejects, tried in physics nevertheless.
        protocol_trials: trials by Where2Act's protocol, each a process.
        seed: of all of it.
        workers: processes.
        out: folder for label_speed.json.
    """

    category: tuple[str, ...] = tuple(sorted({c for names in SETS.values() for c in names}))
    objects: int = 2
    split: catalog.Split = "test"
    points: int = 20
    compared: int = 6000
    rejected: int = 20_000
    protocol_trials: int = 8
    seed: int = 0
    workers: int = 2
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        require_positive(
            self, "objects", "points", "compared", "rejected", "protocol_trials", "workers"
        )
        for category in self.category:
            catalog.object_ids(category, self.split, self.objects)


@dataclass(frozen=True, kw_only=True)
class PointTask:
    """The 200 poses of one surface point.

    Attributes:
        object_id: of the catalogue.
        state: open fraction of each movable part.
        part: index of the part with the point.
        point, normal: in the part's frame, metres.
    """

    object_id: str
    state: tuple[float, ...]
    part: int
    point: tuple[float, ...]
    normal: tuple[float, ...]

    @property
    def category(self) -> str:
        """Of the object."""
        return self.object_id.partition("/")[0]


@dataclass(frozen=True, kw_only=True)
class PointVerdicts:
    """What was found at one point.

    Attributes:
        verdicts: (C,) of the filter.
        success: (C,) of the trials.
        ends: how many trials ended how.
        filter_seconds, trial_seconds: what it took.
        trial_seconds_by_end: the same by how trials ended.
    """

    verdicts: NDArray[np.int8]
    success: NDArray[np.bool_]
    ends: dict[str, int]
    filter_seconds: float
    trial_seconds: float
    trial_seconds_by_end: dict[str, float]


def point_tasks(config: LabelSpeedConfig) -> list[PointTask]:
    """The points of all objects; a function of the config alone."""
    tasks = []
    for category in config.category:
        for index, object_id in enumerate(
            catalog.object_ids(category, config.split, config.objects)
        ):
            obj = catalog.load(object_id)
            rng = np.random.default_rng([config.seed, zlib.crc32(object_id.encode())])
            interval = catalog.category(category).start_fraction if index % 2 == 0 else (0.0, 1.0)
            state = rng.uniform(*interval, len(obj.joints))
            q = positions_at(obj, state)
            Ts_part_object = transforms.invert(obj.link_poses(q))
            seen = {}
            for part in range(1, obj.num_parts):
                points, normals = visible_points(obj, q, part, config.points, _VIEWS, MAX_YAW, rng)
                if len(points):
                    T = Ts_part_object[part]
                    seen[part] = transforms.apply(T, points), transforms.rotate(T, normals)
            for k in range(config.points):
                part = sorted(seen)[k % len(seen)]
                points_part, normals_part = seen[part]
                tasks.append(
                    PointTask(
                        object_id=object_id,
                        state=tuple(state.tolist()),
                        part=part,
                        point=tuple(points_part[k].tolist()),
                        normal=tuple(normals_part[k].tolist()),
                    )
                )
    return tasks


def _posed(task: PointTask) -> tuple[Any, NDArray[np.floating], NDArray[np.floating]]:
    """The object, its joint positions, and the tried poses (C, 4, 4) in its frame."""
    obj = catalog.load(task.object_id)
    q = positions_at(obj, np.array(task.state))
    poses = tried_poses(obj, q, task.part, np.array(task.point), np.array(task.normal))
    return obj, q, poses


def judge_point(task: PointTask) -> PointVerdicts:
    """All verdicts of a point, as annotation makes them."""
    obj, q, poses = _posed(task)
    began = time.perf_counter()
    verdicts = judge(obj, q, task.part, poses[:1, :3, 3], poses[None, :, :3, :3])[0]
    filtered = time.perf_counter()
    success = np.zeros(len(poses), dtype=bool)
    ends: Counter[str] = Counter()
    by_end: Counter[str] = Counter()
    for candidate in np.flatnonzero(verdicts == Verdict.POSSIBLE):
        start = time.perf_counter()
        trial = try_grasp(obj, q, task.part, poses[candidate])
        success[candidate] = trial.success
        ends[trial.end] += 1
        by_end[trial.end] += time.perf_counter() - start  # type: ignore[assignment]
    return PointVerdicts(
        verdicts=verdicts,
        success=success,
        ends=dict(ends),
        filter_seconds=filtered - began,
        trial_seconds=time.perf_counter() - filtered,
        trial_seconds_by_end=dict(by_end),
    )


def try_poses(job: tuple[PointTask, Sequence[int], TrialConfig]) -> list[bool]:
    """Whether some poses of a point succeed in physics, whatever the filter says."""
    task, candidates, config = job
    obj, q, poses = _posed(task)
    return [try_grasp(obj, q, task.part, poses[c], config).success for c in candidates]


def kappa(table: NDArray[np.integer]) -> float:
    """Cohen's kappa of a 2 x 2 table of counts; NaN where chance alone agrees always.

    >>> round(kappa(np.array([[90, 0], [0, 10]])), 3), round(kappa(np.array([[25, 25], [25, 25]])))
    (1.0, 0)
    """
    share = table / table.sum()
    by_chance = float(share.sum(axis=0) @ share.sum(axis=1))
    return (float(np.trace(share)) - by_chance) / (1.0 - by_chance) if by_chance < 1 else np.nan


def measure(config: LabelSpeedConfig) -> dict[str, Any]:
    """Measures everything and writes ``label_speed.json``."""
    tasks = point_tasks(config)
    in_order = functools.partial(results_in_order, unit="point")
    began = time.perf_counter()
    found = in_order(judge_point, tasks, workers=config.workers, description="verdicts")
    several = time.perf_counter() - began
    began = time.perf_counter()
    in_order(judge_point, tasks, workers=1, description="verdicts, one core")
    one = time.perf_counter() - began
    rng = np.random.default_rng(config.seed)
    agreement = _agreement(config, tasks, found, rng)
    rejects = _rejects(config, tasks, found, rng)
    protocol = _protocol(config, tasks, rng)
    total = NUM_CANDIDATES * len(tasks)
    result = {
        **record.provenance("benchmarks.speed"),
        "config": {name: value for name, value in asdict(config).items() if name != "out"},
        "targets": dict(TARGETS),
        "verdicts": total,
        "objects": len({task.object_id for task in tasks}),
        "verdicts_a_second": total / several,
        "verdicts_a_second_one_core": total / one,
        "categories": {
            category: _category_row(
                [f for t, f in zip(tasks, found, strict=True) if t.category == category]
            )
            for category in config.category
        },
        "all": _category_row(found),
        "agreement": agreement,
        "rejects": rejects,
        "protocol": protocol,
        "times_where2act": total / several * protocol["without_pictures"] / config.workers,
    }
    record.write_result(config.out / "label_speed.json", result)
    return result


def _category_row(found: Sequence[PointVerdicts]) -> dict[str, Any]:
    """Shares and costs of some points."""
    verdicts = np.concatenate([f.verdicts for f in found])
    seconds = {
        "filter": sum(f.filter_seconds for f in found),
        **{end: sum(f.trial_seconds_by_end.get(end, 0.0) for f in found) for end in TRIAL_ENDS},
    }
    return {
        "verdicts": len(verdicts),
        "verdicts_a_second_one_core": len(verdicts)
        / sum(f.filter_seconds + f.trial_seconds for f in found),
        "decided_by_filter": float(np.mean(verdicts != Verdict.POSSIBLE)),
        "ends": {end: sum(f.ends.get(end, 0) for f in found) for end in TRIAL_ENDS},
        "successes": int(sum(f.success.sum() for f in found)),
        "seconds": seconds,
    }


def _agreement(
    config: LabelSpeedConfig,
    tasks: Sequence[PointTask],
    found: Sequence[PointVerdicts],
    rng: np.random.Generator,
) -> dict[str, Any]:
    """Our verdicts on random poses against those of the slow reference, without a filter."""
    chosen = rng.choice(
        len(tasks) * NUM_CANDIDATES, min(config.compared, len(tasks) * NUM_CANDIDATES), False
    )
    numbers, candidates = np.divmod(np.sort(chosen), NUM_CANDIDATES)
    jobs = [(tasks[n], candidates[numbers == n].tolist(), REFERENCE) for n in np.unique(numbers)]
    judged = results_in_order(
        try_poses, jobs, workers=config.workers, description="reference", unit="point"
    )
    ours = np.array([found[n].success[c] for n, c in zip(numbers, candidates, strict=True)])
    theirs = np.array([success for row in judged for success in row])

    def row(here: NDArray[np.bool_]) -> dict[str, Any]:
        table = np.array(
            [[np.sum((theirs == a) & (ours == b) & here) for b in (False, True)] for a in (0, 1)]
        )
        return {
            "compared": int(table.sum()),
            "table": table.tolist(),
            "agreement": float(np.trace(table) / table.sum()),
            "kappa": kappa(table),
        }

    of_category = np.array([tasks[n].category for n in numbers])
    return {
        "all": row(np.ones(len(ours), dtype=bool)),
        "categories": {c: row(of_category == c) for c in config.category},
    }


def _rejects(
    config: LabelSpeedConfig,
    tasks: Sequence[PointTask],
    found: Sequence[PointVerdicts],
    rng: np.random.Generator,
) -> dict[str, Any]:
    """Poses that the filter rejects, in physics."""
    rejected = np.concatenate([f.verdicts != Verdict.POSSIBLE for f in found])
    everyone = np.flatnonzero(rejected)
    chosen = np.sort(rng.choice(everyone, min(config.rejected, len(everyone)), replace=False))
    numbers, candidates = np.divmod(chosen, NUM_CANDIDATES)
    jobs = [
        (tasks[n], candidates[numbers == n].tolist(), TrialConfig()) for n in np.unique(numbers)
    ]
    judged = results_in_order(
        try_poses, jobs, workers=config.workers, description="rejected", unit="point"
    )
    wrong = [
        {**asdict(task), "candidate": c}
        for (task, tried, _), row in zip(jobs, judged, strict=True)
        for c, success in zip(tried, row, strict=True)
        if success
    ]
    return {"tried": len(chosen), "wrong": len(wrong), "which": wrong}


def _protocol(
    config: LabelSpeedConfig, tasks: Sequence[PointTask], rng: np.random.Generator
) -> dict[str, float]:
    """Median seconds of a trial by Where2Act's protocol, and of what it spends them on.

    Its pictures are left out of the comparison: it had a GPU for them.
    """
    T_grasp_hand = transforms.invert(T_hand_grasp)
    with tempfile.TemporaryDirectory() as folder:
        trials = []
        for n in rng.choice(len(tasks), config.protocol_trials):
            obj, q, poses = _posed(tasks[n])
            T_object_hand = poses[int(rng.integers(NUM_CANDIDATES))] @ T_grasp_hand
            trials.append(
                ProtocolTask(
                    urdf=str(write_urdf(obj, folder)),
                    q=(q - obj.rest_positions).tolist(),
                    hand=T_object_hand.tolist(),
                    pull=(-T_object_hand[:3, 2]).tolist(),
                )
            )
        rows = results_in_order(
            run_protocol, trials, workers=config.workers, description="Where2Act", unit="trial"
        )
    for row in rows:
        row["without_pictures"] = row["process"] - row["pictures"]
    return {name: float(np.median([row[name] for row in rows])) for name in rows[0]}


def tables_from_result(result: Mapping[str, Any]) -> list[Table]:
    """The tables for a person to read."""
    rates = Table(title="grasp verdicts: who decides them, and how they agree with the reference")
    for name in ("category", "verdicts/s, 1 core", "filter decides", *TRIAL_ENDS, "succeed"):
        rates.add_column(name, justify="left" if name == "category" else "right")
    for name in ("compared", "agreement", "kappa"):
        rates.add_column(name, justify="right")
    agreement = result["agreement"]
    rows = [(c, row, agreement["categories"][c]) for c, row in result["categories"].items()]
    for category, row, agreed in [*rows, ("all", result["all"], agreement["all"])]:
        rates.add_row(
            category,
            f"{row['verdicts_a_second_one_core']:,.0f}",
            f"{100 * row['decided_by_filter']:.1f} %",
            *(f"{row['ends'][end]:,}" for end in TRIAL_ENDS),
            f"{row['successes']:,}",
            f"{agreed['compared']:,}",
            f"{100 * agreed['agreement']:.2f} %",
            f"{agreed['kappa']:.3f}",
        )
    bars = Table(title="what is promised")
    for name in ("", "measured", "promised"):
        bars.add_column(name, justify="right" if name else "left")
    workers, rejects = result["config"]["workers"], result["rejects"]
    promised = result["targets"]
    for label, value, target in (
        (
            f"verdicts a second, {workers} cores",
            f"{result['verdicts_a_second']:,.0f}",
            f">= {promised['verdicts_a_second']:,.0f}",
        ),
        ("verdicts a second, 1 core", f"{result['verdicts_a_second_one_core']:,.0f}", ""),
        (
            "times Where2Act's protocol",
            f"{result['times_where2act']:,.0f}",
            f">= {promised['times_where2act']:,.0f}",
        ),
        (
            "agreement with the reference",
            f"{100 * agreement['all']['agreement']:.2f} %",
            f">= {100 * promised['agreement']:.0f} %",
        ),
        ("kappa", f"{agreement['all']['kappa']:.3f}", f">= {promised['kappa']:.2f}"),
        (
            f"wrong rejects of {rejects['tried']:,}",
            f"{rejects['wrong']}",
            f"{promised['wrong_rejects']:.0f}",
        ),
    ):
        bars.add_row(label, value, target)
    return [rates, bars]


def report(config: LabelSpeedConfig) -> list[Table]:
    """Measures, writes ``label_speed.json`` and gives the tables."""
    return tables_from_result(measure(config))


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("label_speed", LabelSpeedConfig, report, arguments)
