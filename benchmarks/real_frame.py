"""One real picture: is the box found, and how far off are the poses of its two parts?

The frame and its labels are ReArt-48's (``benchmarks/data/reart_box2``); nothing here was trained
on real pictures. Run ``python -m benchmarks.real_frame --help``.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from artgym.geometry.camera import project
from artgym.geometry.transforms import apply, transform_from, translation
from benchmarks import record
from benchmarks.command import run

FRAME = Path(__file__).parent / "data" / "reart_box2"

#: The published lid lies flat beside the box when its joint is at zero, here it is closed then:
#: half a turn about the hinge, which runs along y.
_R_REST = np.diag([-1.0, 1.0, -1.0])

#: A detection with a smaller overlap of boxes is of something else.
_LEAST_IOU = 0.5


@dataclass(frozen=True, kw_only=True)
class RealFrameConfig:
    """Is the box in a real picture found, and how far off are the poses of its two parts?

    Attributes:
        weights: folder with detector.safetensors and box.safetensors, instead of the shipped
            weights.
        seed: of the fits and the choice of points.
        out: folder for real_frame.json and real_frame.png.
    """

    weights: Path | None = None
    seed: int = 0
    out: Path = record.RESULTS_FOLDER


def true_boxes() -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """``T_camera_box`` (2, 4, 4) of base and lid, and the bounds (2, 2, 3) of their boxes there."""
    parts = json.loads((FRAME / "labels.json").read_text(encoding="utf-8"))["parts"]
    poses, bounds = [], []
    for part, R_link_box in zip(parts, (np.eye(3), _R_REST), strict=True):
        low, high = np.array(part["low"]), np.array(part["high"])
        T_link_box = translation((low + high) / 2) @ transform_from(R_link_box, np.zeros(3))
        poses.append(np.array(part["T_camera_link"]) @ T_link_box)
        bounds.append(np.stack([low - high, high - low]) / 2)
    return np.stack(poses), np.stack(bounds)


def _true_rectangle(intrinsics: NDArray[np.floating]) -> NDArray[np.floating]:
    """Left, top, right and bottom of the two boxes in the picture, pixels."""
    pixels = []
    for T_camera_box, (low, high) in zip(*true_boxes(), strict=True):
        corners = np.stack(np.meshgrid(*np.stack([low, high], axis=-1)), axis=-1).reshape(-1, 3)
        pixels.append(project(apply(T_camera_box, corners), intrinsics))
    both = np.concatenate(pixels)
    return np.concatenate([both.min(axis=0), both.max(axis=0)])


def _iou(a: NDArray[np.floating], b: NDArray[np.floating]) -> float:
    """Of two rectangles, left, top, right and bottom."""
    size = np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2])
    common = float(np.prod(size.clip(0.0)))
    areas = [float(np.prod(each[2:] - each[:2])) for each in (a, b)]
    return common / (sum(areas) - common)


def pose_rows(prediction: Any) -> list[dict[str, float] | None]:
    """Errors of base and lid; None where the part was not found."""
    from icaf4_policy.metrics import pose_errors

    rows: list[dict[str, float] | None] = []
    for fit, truth in zip(prediction.part_boxes[:2], true_boxes()[0], strict=True):
        if fit is None:
            rows.append(None)
            continue
        rotation, metres = pose_errors(fit.T_camera_box, truth)
        degrees = float(np.degrees(rotation))
        rows.append({"rotation_deg": degrees, "translation_m": float(metres)})
    return rows


def measure(config: RealFrameConfig) -> dict[str, Any]:
    """Looks at the frame in both ways; writes ``real_frame.json`` and ``real_frame.png``.

    Raises:
        DamagedFileError: weights are missing or damaged.
    """
    import torch

    from icaf4_policy import drawing
    from icaf4_policy.detector.evaluation import LOWEST_SCORE
    from icaf4_policy.scenes import ScenePerception

    torch.set_num_threads(1)
    rgb = drawing.read_rgb(FRAME / "color_000000.jpg")
    depth = drawing.read_depth(FRAME / "depth_000000.png", 0.001)
    intrinsics = drawing.read_intrinsics(FRAME / "intrinsics.json")
    scene = ScenePerception.load(config.weights and config.weights.absolute())
    rng = np.random.default_rng(config.seed)
    seen = scene.look(rgb, depth, intrinsics, min_score=LOWEST_SCORE, rng=rng)
    truth = _true_rectangle(intrinsics)
    detections = []
    for each in seen:
        left_top, size = each.detection.box[:2], each.detection.box[2:]
        rectangle = np.concatenate([left_top, left_top + size]).astype(float)
        detections.append(
            {
                "category": each.detection.category,
                "score": each.detection.score,
                "iou": _iou(rectangle, truth),
                "parts": pose_rows(each.prediction) if each.detection.category == "box" else None,
            }
        )
    right = [
        i for i, d in enumerate(detections) if d["category"] == "box" and d["iou"] >= _LEAST_IOU
    ]
    alone, _ = scene.perceptions["box"].perceive(
        rgb, depth, intrinsics, rng=np.random.default_rng(config.seed)
    )
    shown = [seen[right[0]].prediction] if right else [alone]
    drawing.write_image(
        config.out / "real_frame.png", drawing.draw_predictions(rgb, intrinsics, shown, 5)[::2, ::2]
    )
    result = {
        **record.provenance("benchmarks.real_frame"),
        "config": asdict(config),
        "found": bool(right),
        "detections": detections,
        "by_detector": detections[right[0]] if right else None,
        "by_table_plane": {"parts": pose_rows(alone)},
    }
    record.write_result(config.out / "real_frame.json", result)
    return result


def tables_from_result(result: Mapping[str, Any]) -> list[Table]:
    """The tables for a person to read."""
    table = Table(title="a real picture of a pencil box: errors against the labels")
    for name in ("object's points from", "score", "base: deg", "mm", "lid: deg", "mm"):
        table.add_column(name, justify="right")
    rows = (("the detector", "by_detector"), ("all above the table", "by_table_plane"))
    for label, name in rows:
        found = result[name]
        if found is None:
            table.add_row(label, "not found", *["-"] * 4)
            continue
        cells = []
        for part in found["parts"]:
            none = part is None
            cells.append("-" if none else f"{part['rotation_deg']:.1f}")
            cells.append("-" if none else f"{1000 * part['translation_m']:.0f}")
        score = found.get("score")
        table.add_row(label, "" if score is None else f"{score:.2f}", *cells)
    return [table]


def report(config: RealFrameConfig) -> list[Table]:
    """Measures, writes the result and its picture, and gives the table."""
    return tables_from_result(measure(config))


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("real_frame", RealFrameConfig, report, arguments)


if __name__ == "__main__":
    sys.exit(main())
