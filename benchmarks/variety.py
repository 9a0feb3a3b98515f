"""How much do the objects of a category differ, and do real ones lie within their sizes?

Run ``python -m benchmarks.variety --help``.
"""

from __future__ import annotations

import csv
import sys
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from rich.table import Table
from scipy.spatial import KDTree

from artgym.errors import InvalidArgumentError
from artgym.geometry import transforms
from artgym.objects import catalog
from artgym.objects.meshes import link_triangles
from artgym.objects.model import ArticulatedObject
from benchmarks import record
from benchmarks.command import run
from benchmarks.parallel import results_in_order

Array = NDArray[np.floating]

#: Sizes of real objects, with their source.
REAL_SIZES = Path(__file__).parent / "real_sizes.csv"

#: Two objects nearer to each other than this share of their diagonal are near-duplicates.
NEAR_DUPLICATE = 0.01
#: Points that stand for a surface, and those of them whose distance to another is measured.
_SURFACE_POINTS, _QUERY_POINTS = 16384, 256
#: Objects by joint state at which parts are measured: real ones were scanned in any.
_STATES = (0.0, 0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True, kw_only=True)
class VarietyConfig:
    """How much do the objects of a category differ, and do real ones lie within their sizes?

    Attributes:
        category: categories of objects; all by default.
        objects: how many of each, the catalogue's first.
        workers: processes; the numbers do not depend on it.
        out: folder for variety.json.
    """

    category: tuple[str, ...] = tuple(catalog.CATEGORIES)
    objects: int = 200
    workers: int = 2
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        if self.objects < 2:
            raise InvalidArgumentError(f"objects={self.objects}: expected 2 or more.")
        for category in self.category:
            catalog.all_ids(category, self.objects)


@dataclass(frozen=True)
class _Surface:
    """Samples of a half open object's surface, about the middle of its rest box, without its stand.

    Attributes:
        points: (_SURFACE_POINTS, 3), even by area, metres.
        normals: (_SURFACE_POINTS, 3), unit.
        spacing: mean distance between neighbours, metres.
        diagonal: of the rest box, metres.
    """

    points: Array
    normals: Array
    spacing: float
    diagonal: float

    @classmethod
    def of(cls, obj: ArticulatedObject, rng: np.random.Generator) -> _Surface:
        corners = []
        Ts = obj.link_poses([joint.position(0.5) for joint in obj.joints])
        for T, link in zip(Ts, obj.links, strict=True):
            triangles, piece = link_triangles(link)
            is_stand = np.array([s.role == "stand" for s in link.shapes])
            moved = transforms.apply(T, triangles[~is_stand[piece]].reshape(-1, 3))
            corners.append(moved.reshape(-1, 3, 3))
        a, b, c = np.concatenate(corners).swapaxes(0, 1)
        normals = np.cross(b - a, c - a)
        double_area = np.linalg.norm(normals, axis=1)
        chosen = rng.choice(len(a), _SURFACE_POINTS, p=double_area / double_area.sum())
        u, v = rng.random((2, _SURFACE_POINTS, 1))
        u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
        points = a[chosen] + u * (b - a)[chosen] + v * (c - a)[chosen]
        low, high = obj.body_bounds
        return cls(
            points=points - (low + high) / 2,
            normals=normals[chosen] / double_area[chosen, None],
            spacing=float(np.sqrt(double_area.sum() / 2 / _SURFACE_POINTS)),
            diagonal=float(np.linalg.norm(high - low)),
        )

    def reach(self, tree: KDTree, points: Array) -> float:
        """The distance from this surface that 95 % of points (n, 3) keep within, metres.

        Measured to the planes of the nearest samples (``tree`` holds them): what lies sideways
        within the gaps between samples counts nothing.
        """
        _, nearest = tree.query(points, k=6)
        arm = points[:, None] - self.points[nearest]
        height = np.abs(np.einsum("ijk,ijk->ij", arm, self.normals[nearest]))
        sideways = np.sqrt(np.maximum(np.einsum("ijk,ijk->ij", arm, arm) - height**2, 0.0))
        beyond = np.maximum(sideways - 2 * self.spacing, 0.0)
        return float(np.quantile(np.hypot(height, beyond).min(axis=1), 0.95))


def shape_distances(objects: Sequence[ArticulatedObject]) -> Array:
    """Symmetric Hausdorff distances (n, n) as shares of the larger diagonal; inf from itself.

    Of the distances from points of one surface to the other, 95 % are smaller; both half open,
    about the middles of their rest boxes, at real size.
    """
    surfaces = [_Surface.of(o, np.random.default_rng(i)) for i, o in enumerate(objects)]
    distances = np.full((len(objects), len(objects)), np.inf)
    for i, one in enumerate(surfaces):
        tree = KDTree(one.points)
        for k, other in enumerate(surfaces):
            if k != i:
                reach = one.reach(tree, other.points[:_QUERY_POINTS])
                distances[i, k] = reach / max(one.diagonal, other.diagonal)
    return np.maximum(distances, distances.T)


def _extents(obj: ArticulatedObject, fraction: float) -> dict[str, Array]:
    """Sorted extents (3,) of the whole and of each part, stands apart, metres.

    Parts are measured as they stand at an open fraction of all joints, along the axes of the
    smallest box around the first part: objects on stands may be tilted.
    """
    Ts = obj.link_poses([joint.position(fraction) for joint in obj.joints])
    corners = [
        transforms.apply(
            T, np.concatenate([s.corners_link() for s in link.shapes if s.role != "stand"])
        )
        for T, link in zip(Ts, obj.links, strict=True)
    ]
    T_box_object, _ = trimesh.bounds.oriented_bounds(corners[0])
    corners = [transforms.apply(T_box_object, points) for points in corners]
    extents = {str(part): np.sort(np.ptp(points, axis=0)) for part, points in enumerate(corners)}
    return extents | {"whole": np.sort(np.ptp(np.concatenate(corners), axis=0))}


def real_sizes() -> list[dict[str, Any]]:
    """Real objects: name, category, and sorted extents (3,) by part ("whole", "0", ...)."""
    found: dict[str, dict[str, Any]] = {}
    with REAL_SIZES.open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(line for line in file if not line.startswith("#")):
            real = found.setdefault(
                row["name"], {"name": row["name"], "category": row["category"], "extents": {}}
            )
            sizes = [float(row[axis]) for axis in ("dx", "dy", "dz")]
            real["extents"][row["part"]] = np.sort(sizes)
    return list(found.values())


def _outside(
    real: Mapping[str, Array], ranges: Mapping[str, tuple[Array, Array]]
) -> dict[str, list[float]]:
    """Parts of a real object whose extents no generated object reaches."""
    return {
        part: extents.round(4).tolist()
        for part, extents in real.items()
        if part not in ranges
        or np.any(extents < ranges[part][0])
        or np.any(extents > ranges[part][1])
    }


def category_variety(arguments: tuple[str, int]) -> dict[str, Any]:
    """The numbers of one category."""
    category, count = arguments
    objects = [catalog.load(i) for i in catalog.all_ids(category, count)]
    nearest = shape_distances(objects).min(axis=1)
    extents = np.array([o.body_bounds[1] - o.body_bounds[0] for o in objects])
    ranges: dict[str, list[float]] = {}
    for obj in objects:
        for joint in obj.joints:
            value = abs(joint.range) if joint.type == "prismatic" else np.degrees(abs(joint.range))
            ranges.setdefault(joint.child, []).append(float(value))
    pools: dict[str, list[Array]] = {}
    for obj in objects:
        for fraction in _STATES:
            for part, sizes in _extents(obj, fraction).items():
                pools.setdefault(part, []).append(sizes)
    reach = {part: (np.min(pool, axis=0), np.max(pool, axis=0)) for part, pool in pools.items()}
    reals = [r for r in real_sizes() if r["category"] == category]
    outside = {r["name"]: o for r in reals if (o := _outside(r["extents"], reach))}
    return {
        "objects": count,
        "extents_m": {axis: _spread(column) for axis, column in zip("xyz", extents.T, strict=True)},
        "joint_range": {part: _spread(np.array(values)) for part, values in ranges.items()},
        "family": dict(Counter(str(o.attributes["family"]) for o in objects).most_common()),
        "handle": dict(Counter(str(o.attributes["handle"]) for o in objects).most_common()),
        "parts": dict(Counter(str(o.num_parts - 1) for o in objects).most_common()),
        "nearest_percent": _spread(100 * nearest),
        "near_duplicates": float(np.mean(nearest < NEAR_DUPLICATE)),
        "real": len(reals),
        "real_outside": outside,
    }


def _spread(values: Array) -> list[float]:
    """Smallest, median and largest."""
    return [round(float(v), 4) for v in (values.min(), np.median(values), values.max())]


def measure(config: VarietyConfig) -> dict[str, Any]:
    """Measures all categories; a result for ``record.write_result``."""
    began = time.perf_counter()
    rows = results_in_order(
        category_variety,
        [(category, config.objects) for category in config.category],
        workers=config.workers,
        description="variety",
        unit="category",
    )
    return {
        **record.provenance("benchmarks.variety"),
        "config": asdict(config),
        "near_duplicate_below_percent": 100 * NEAR_DUPLICATE,
        "seconds": round(time.perf_counter() - began, 1),
        "rows": dict(zip(config.category, rows, strict=True)),
    }


def table_from_rows(rows: Mapping[str, Mapping[str, Any]]) -> Table:
    """The table for a person to read."""
    table = Table(title="variety: smallest - largest of each category")
    for name in (
        "category",
        "depth x width x height, m",
        "joint range, deg or m",
        "families",
        "handles",
        "nearest other, median %",
        "near-duplicates, %",
        "real ones within",
    ):
        table.add_column(name)
    for category, row in rows.items():
        real = f"{row['real'] - len(row['real_outside'])} of {row['real']}" if row["real"] else "-"
        table.add_row(
            category,
            " x ".join(f"{low:.2f}-{high:.2f}" for low, _, high in row["extents_m"].values()),
            ", ".join(
                f"{part} {low:.3g}-{high:.3g}"
                for part, (low, _, high) in row["joint_range"].items()
            ),
            _counts(row["family"]),
            _counts(row["handle"]),
            f"{row['nearest_percent'][1]:.1f}",
            f"{100 * row['near_duplicates']:.1f}",
            real,
        )
    return table


def _counts(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items())


def report(config: VarietyConfig) -> list[Table]:
    """Measures, writes ``variety.json`` and gives the table."""
    result = measure(config)
    record.write_result(config.out / "variety.json", result)
    return [table_from_rows(result["rows"])]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("variety", VarietyConfig, report, arguments)


if __name__ == "__main__":
    sys.exit(main())
