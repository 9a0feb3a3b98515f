"""Puts the kept results into the pages that quote them: `python -m benchmarks.report`.

A page says where with a pair of comments, ``<!-- NAME -->`` and ``<!-- /NAME -->``; what stands
between them is written here from the JSON files of ``benchmarks/results`` and never by hand.
"""

from __future__ import annotations

import json
import statistics
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from artgym.errors import DamagedFileError, InvalidArgumentError
from benchmarks.command import cell
from benchmarks.paper import METHOD_LABELS
from benchmarks.record import RESULTS_FOLDER

ROOT = Path(__file__).parent.parent

#: Pages with blocks to fill.
PAGES = (
    ROOT / "README.md",
    ROOT / "docs" / "environments.md",
    ROOT / "docs" / "labels.md",
    ROOT / "docs" / "objects.md",
    ROOT / "icaf4_policy" / "weights" / "README.md",
)


def _line(cells: Sequence[str]) -> str:
    """A line of a Markdown table."""
    return f"| {' | '.join(cells)} |"


def _head(cells: Sequence[str]) -> list[str]:
    """Its first two lines."""
    return [_line(cells), "|" + "---|" * len(cells)]


def _rate(row: Mapping[str, Any]) -> str:
    """Success with its interval: "98 % (87-100)"."""
    low, high = row["success_interval"]
    return f"{100 * row['success']:.0f} % ({100 * low:.0f}-{100 * high:.0f})"


def success_rate_block(result: Mapping[str, Any]) -> str:
    """A Markdown table of ``success_rate.json``, categories by policies."""
    policies = result["config"]["policy"]
    lines = _head(["success, gripped", *policies])
    for category, rows in result["rows"].items():
        cells = [f"{_rate(rows[p])}, {100 * rows[p]['success_gripped']:.0f} %" for p in policies]
        lines.append(_line([category, *cells]))
    means = [
        [100 * statistics.fmean(row[p][key] for row in result["rows"].values()) for p in policies]
        for key in ("success", "success_gripped")
    ]
    cells = [f"{success:.0f} %, {gripped:.0f} %" for success, gripped in zip(*means, strict=True)]
    lines.append(_line(["mean", *cells]))
    config = result["config"]
    count = config["objects"] * config["episodes"]
    lines += [
        "",
        f"{count} episodes a cell on {config['objects']} {config['split']} objects, none of them "
        "seen in training; Wilson 95 % intervals in brackets.",
    ]
    return "\n".join(lines)


#: Columns of the table of single objects: heading, metric, how it is shown.
_OBJECT_COLUMNS: tuple[tuple[str, str, str], ...] = (
    ("parts, mIoU", "part_miou", "{:.3f}"),
    ("part pose: deg", "part_rotation_deg", "{:.1f}"),
    ("m", "part_translation_m", "{:.4f}"),
    ("% of diameter", "part_translation_percent", "{:.1f}"),
    ("object pose: deg", "object_rotation_deg", "{:.1f}"),
    ("m", "object_translation_m", "{:.4f}"),
    ("joint axis, deg", "joint_axis_deg", "{:.1f}"),
    ("affordance, IoU", "affordance_iou", "{:.3f}"),
    ("mIoU", "affordance_miou", "{:.3f}"),
    ("grasp error, deg", "grasp/network/error_deg", "{:.1f}"),
    ("along the normal", "grasp/normal_grid_roll/error_deg", "{:.1f}"),
    ("any hemisphere pose", "grasp/random_hemisphere/error_deg", "{:.1f}"),
    ("coverage at 15 deg", "grasp/network/coverage@15", "{:.2f}"),
    ("tries that succeed", "label_density_graspable", "{:.3f}"),
    ("best grasp succeeds", "executed", "{:.2f}"),
)


def object_table_block(result: Mapping[str, Any]) -> str:
    """A Markdown table of ``object_table.json``: a category and method a line, the paper's too.

    The paper has no noise in its pictures, and no line beside pictures with noise.
    """
    noisy = result["config"]["depth_noise"]
    heads = [heading for heading, _, _ in _OBJECT_COLUMNS]
    lines = _head(["", *heads])

    def line(name: str, values: Mapping[str, float | None]) -> str:
        cells = []
        for _, key, form in _OBJECT_COLUMNS:
            value = values.get(key)
            cells.append("" if value is None else form.format(value))
        return _line([name, *cells])

    for category, methods in result["metrics"].items():
        for method, values in methods.items():
            name = category if method == "icaf4" else f"{category}, {METHOD_LABELS[method]}"
            lines.append(line(name, values))
            paper = result["paper"].get(method, {}).get(category)
            if paper and not noisy:
                lines.append(line(f"{name}, paper", paper))
    views = ", ".join(f"{count} {category}" for category, count in result["views"].items())
    lines += [
        "",
        f"Views: {views}. "
        + (
            "Depth has the errors of a real sensor."
            if noisy
            else "The paper's figures are of other objects and pictures, and leave the grasp error "
            "undefined: a place to stand, no contest."
        ),
    ]
    return "\n".join(lines)


def scene_table_block(result: Mapping[str, Any]) -> str:
    """A Markdown table of ``scene_table.json``: mean average precision, the paper's beneath."""
    columns = list(result["rows"]["mean"])
    lines = _head(["", *(column.replace("_", " ").replace("@", ", ") for column in columns)])
    for category, row in result["rows"].items():
        cells = [f"{row[column]:.3f}" for column in columns]
        lines.append(_line([category, *cells]))
        paper = result["paper"].get(category)
        if paper:
            cells = [f"{paper[column]:.2f}" if column in paper else "" for column in columns]
            lines.append(_line([f"{category}, paper", *cells]))
    detector = result["detector"]
    lines += [
        "",
        f"{sum(result['objects'].values())} objects in {result['config']['scenes']} scenes. The "
        f"detector alone: mask mAP50 {detector['mask/map50']:.3f}, mAP75 "
        f"{detector['mask/map75']:.3f}; box mAP50 {detector['box/map50']:.3f}. Affordance counts "
        "by the IoU of the points that can be grasped, and by the mean of theirs and that of the "
        "others, as the paper's tables of single objects do; of its scenes it does not say.",
    ]
    return "\n".join(lines)


def objects_block(result: Mapping[str, Any]) -> str:
    """A Markdown table of ``objects.json``, a category a line."""
    lines = [
        "| category | sound | opened by the expert | gripped | zero action "
        "| id to scene, ms: median, largest |",
        "|---|---|---|---|---|---|",
    ]
    for category, row in result["rows"].items():
        lines.append(
            f"| {category} | {row['sound']} of {row['checked']} "
            f"| {_rate(row['expert'])} "
            f"| {100 * row['expert']['success_gripped']:.0f} % "
            f"| {100 * row['zero']['success']:.0f} % "
            f"| {row['build_ms']['median']:.1f}, {row['build_ms']['largest']:.1f} |"
        )
    config = result["config"]
    lines += [
        "",
        f"{config['sound']} objects a category checked; {config['opened']} test objects opened, "
        "one episode each, their movable parts in turn; Wilson 95 % intervals in brackets.",
    ]
    return "\n".join(lines)


def variety_block(result: Mapping[str, Any]) -> str:
    """A Markdown table of ``variety.json``, a category a line."""
    lines = [
        "| category | depth x width x height, m | joint range, deg or m | forms | grips "
        "| near-duplicates | real ones within |",
        "|---|---|---|---|---|---|---|",
    ]
    for category, row in result["rows"].items():
        extents = " x ".join(f"{low:.2f}-{high:.2f}" for low, _, high in row["extents_m"].values())
        low = min(low for low, _, _ in row["joint_range"].values())
        high = max(high for _, _, high in row["joint_range"].values())
        real = f"{row['real'] - len(row['real_outside'])} of {row['real']}" if row["real"] else ""
        lines.append(
            f"| {category} | {extents} | {low:.3g}-{high:.3g} | {', '.join(row['family'])} "
            f"| {', '.join(row['handle'])} | {100 * row['near_duplicates']:.0f} % | {real} |"
        )
    lines += [
        "",
        f"{result['config']['objects']} objects a category, without their stands. A near-duplicate "
        "has another object whose surface, half open, lies within "
        f"{result['near_duplicate_below_percent']:g} % of the diagonal for 95 % of its points. "
        "Real ones are the measured boxes, cutters, drawers, scissors and staplers of "
        "`benchmarks/real_sizes.csv`: every extent of every part within the range made here.",
    ]
    return "\n".join(lines)


def solvability_block(result: Mapping[str, Any]) -> str:
    """A Markdown table of ``solvability.json``, an environment and category a line."""
    rows = result["rows"].values()
    robots = tuple(dict.fromkeys(row["robot"] for row in rows))
    head = "".join(f" {r}: expert | zero action | random |" for r in robots)
    lines = [f"| environment | category |{head}", "|---|---|" + "---|" * (3 * len(robots))]
    for env_id, category in dict.fromkeys((row["env_id"], row["category"]) for row in rows):
        cells = [f"`{env_id}`", category]
        for robot in robots:
            row = result["rows"].get(f"{env_id} {robot} {category}")
            if row is None:
                cells += ["", "", ""]
                continue
            cells.append(_rate(row["expert"]))
            cells += [f"{100 * row[policy]['success']:.0f} %" for policy in ("zero", "random")]
        lines.append(_line(cells))
    lines += [
        "",
        f"{result['config']['objects']} test objects a cell, one episode each, their movable parts "
        "in turn; Wilson 95 % intervals in brackets.",
    ]
    return "\n".join(lines)


def env_speed_block(result: Mapping[str, Any]) -> str:
    """A Markdown table of ``env_speed.json``, a comparison a line."""
    categories = list(result["rows"])
    head = "".join(f" {c}: ours | other | ratio |" for c in categories)
    lines = [f"| ours / other |{head} aim |", "|---|" + "---|" * (3 * len(categories) + 1)]
    for name, comparison in result["comparisons"].items():
        cells = [comparison["label"]]
        for category in categories:
            row = result["rows"][category]["rows"][name]
            cells += [
                f"{row['ours']:.3g} {comparison['unit']}",
                f"{row['other']:.3g} {comparison['unit']}",
                f"{row['ratio']:.2f} (> {row['lower']:.2f})",
            ]
        cells.append("" if comparison["target"] is None else f"{comparison['target']:g}")
        lines.append(_line(cells))
    pairs = result["config"]["pairs"]
    lines += [
        "",
        f"Medians of {pairs} interleaved pairs on one thread; the ratio is other / ours, in "
        "brackets its bootstrap bound: 95 % lie above. Pictures are 320 x 240, rendered on the "
        f"{result['rows'][categories[0]]['renderer'].upper()}.",
    ]
    return "\n".join(lines)


def labels_block(result: Mapping[str, Any]) -> str:
    """A Markdown table of ``labels.json``, a category a line, and success by approach."""
    tilts = [ring["tilt_deg"] for ring in next(iter(result["labels"].values()))["train"]["rings"]]
    lines = [
        "| category | objects | without success | points | tries | in physics | succeed "
        "| points with success | at these, of the tries |"
        + "".join(f" tilt {tilt:.0f} deg |" for tilt in tilts),
        "|---|" + "---|" * (8 + len(tilts)),
    ]
    total: dict[str, int] = dict.fromkeys(("objects", "points", "tries", "trials", "successes"), 0)
    retried = {"tries": 0, "same": 0}
    for category, splits in result["labels"].items():
        rows = list(splits.values())
        retried = {name: retried[name] + sum(r["retried"][name] for r in rows) for name in retried}
        summed = {name: sum(row[name] for row in rows) for name in total}
        total = {name: total[name] + summed[name] for name in total}
        none = sum(row["objects_without_success"] for row in rows)
        cells = [f"{summed['objects']}", f"{none}"]
        cells += [f"{summed[name]:,}" for name in ("points", "tries", "trials", "successes")]

        def mean(value: Callable[[Any], float], rows: list[Any] = rows) -> str:
            weights = [row["points"] for row in rows]
            weighted = sum(w * value(row) for w, row in zip(weights, rows, strict=True))
            return f"{100 * weighted / sum(weights):.1f} %"

        cells.append(mean(lambda row: row["graspable_points"]))
        cells.append(mean(lambda row: row["density_at_graspable_points"]))
        for i in range(len(tilts)):
            cells.append(mean(lambda row, i=i: row["rings"][i]["density"]))
        lines.append(_line([category, *cells]))
    lines += [
        "",
        f"{total['objects']} objects; {total['tries']:,} tries at {total['points']:,} points, of "
        f"which {total['trials']:,} were decided by physics and the others by the filter; "
        f"{total['successes']:,} succeed. Tilt is the angle of the approach from the inward "
        "normal; below it the share of such tries that succeed. Of "
        f"{retried['tries']:,} tries made once more "
        f"({result['hardware']['cpu']}), half of them successes, "
        f"{retried['same']:,} ended the same.",
    ]
    return "\n".join(lines)


def label_speed_block(result: Mapping[str, Any]) -> str:
    """A Markdown table of ``label_speed.json``, a category a line."""
    agreement, rejects = result["agreement"], result["rejects"]
    lines = [
        "| category | verdicts a second, one core | decided by the filter | trials stopped early "
        "| compared with the reference | agreement | kappa |",
        "|---|---|---|---|---|---|---|",
    ]
    rows = [(c, row, agreement["categories"][c]) for c, row in result["categories"].items()]
    for category, row, agreed in [*rows, ("all", result["all"], agreement["all"])]:
        ends = row["ends"]
        early = sum(ends[end] for end in ("blocked", "empty", "lost")) / max(1, sum(ends.values()))
        lines.append(
            f"| {category} | {row['verdicts_a_second_one_core']:,.0f} "
            f"| {100 * row['decided_by_filter']:.1f} % | {100 * early:.0f} % "
            f"| {agreed['compared']:,} | {100 * agreed['agreement']:.2f} % "
            f"| {cell(agreed['kappa'], 3)} |"
        )
    workers = result["config"]["workers"]
    lines += [
        "",
        f"{result['verdicts_a_second']:,.0f} verdicts a second with {workers} processes, "
        f"{result['verdicts_a_second_one_core']:,.0f} with one; "
        f"{result['times_where2act']:,.0f} times Where2Act's protocol re-created "
        "(`benchmarks/where2act_protocol.py`), its pictures left out. Of "
        f"{rejects['tried']:,} poses that the filter rejects physics accepts {rejects['wrong']}.",
    ]
    return "\n".join(lines)


def pose_speed_block(result: Mapping[str, Any]) -> str:
    """A Markdown table of ``pose_speed.json``, a number of parts and a way to fit a line."""
    lines = [
        "| parts | fit | ms: median, 99 of 100 below | rotation error, deg "
        "| translation error, % of diameter | the same on the optimizer's clouds "
        "| times the optimizer's speed |",
        "|---|---|---|---|---|---|---|",
    ]
    for parts, row in [*result["rows"].items(), ("all", result["all"])]:
        for way, label in result["ways"].items():
            here, beside = row[way], row[way]["beside_reference"]
            lines.append(
                f"| {parts} | {label} | {here['ms']['median']:,.2f}, {here['ms']['p99']:,.2f} "
                f"| {here['rotation_deg']:.2f} | {100 * here['translation']:.2f} "
                f"| {beside['rotation_deg']:.2f} deg, {100 * beside['translation']:.2f} % "
                f"| {beside['times']:,.0f} |"
            )
    every = result["all"]
    lines += [
        "",
        f"{every['alone']['clouds']} synthetic clouds of 2,048 points, up to 40 % of the "
        "coordinates anything, the others off as a network's are; "
        f"{every['reference']['clouds']} of them by the optimizer too "
        "(`benchmarks/constrained_fit.py`, after ANCSH), which is told the joint's type. Processor "
        "time of one thread; errors are means, the ratio is the median over clouds.",
    ]
    return "\n".join(lines)


def rays_block(result: Mapping[str, Any]) -> str:
    """A Markdown table of ``rays.json``, an object a line."""
    lines = [
        "| object | depth within "
        f"{result['depth_tolerance_mm']:g} mm, % of pixels | same part, % | clouds a second |",
        "|---|---|---|---|",
    ]
    for object_id, row in result["rows"].items():
        agreement = row["agreement"]
        lines.append(
            f"| {object_id} | {100 * agreement['depth']['mean']:.3f} "
            f"| {100 * agreement['mask']['mean']:.3f} | {row['clouds']['per_second']} |"
        )
    lines += ["", "Clouds of 2,048 points, on one thread, without a graphics driver loaded."]
    return "\n".join(lines)


def rl_baselines_block(result: Mapping[str, Any]) -> str:
    """A Markdown table of ``rl_baselines.json``, a seed a line."""
    lines = ["| | success on unseen objects | gripped | learned in |", "|---|---|---|---|"]
    for name, row in result["rows"].items():
        lines.append(
            f"| {name} | {_rate(row)} "
            f"| {100 * row['success_gripped']:.0f} % | {row['learning_seconds'] / 60:.0f} min |"
        )
    config = result["config"]
    lines += [
        "",
        f"PPO on `{config['env_id']}`, {config['steps']:,} control steps, two cores; scored on "
        f"{config['episodes']} test objects; Wilson 95 % intervals in brackets.",
    ]
    return "\n".join(lines)


def real_frame_block(result: Mapping[str, Any]) -> str:
    """A Markdown table of ``real_frame.json``, a way to find the object a line."""
    lines = [
        "| the object's points from | base: rotation, deg | mm | lid: rotation, deg | mm |",
        "|---|---|---|---|---|",
    ]
    rows = (("the detector", "by_detector"), ("all that stands on the table", "by_table_plane"))
    for label, name in rows:
        cells = [label]
        for part in (result[name] or {"parts": (None, None)})["parts"]:
            cells.append("not found" if part is None else f"{part['rotation_deg']:.1f}")
            cells.append("" if part is None else f"{1000 * part['translation_m']:.0f}")
        lines.append(_line(cells))
    return "\n".join(lines)


def anchor_table_block(result: Mapping[str, Any]) -> str:
    """A Markdown table of ``anchor_table.json``, anchors by categories."""
    categories = result["categories"]
    head = "".join(f" {c}: error, deg | covered | paper, deg |" for c in categories)
    lines = [
        f"| anchors | L | mean, covering, deg |{head}",
        "|---|---|---|" + "---|" * (3 * len(categories)),
    ]
    first = next(iter(categories.values()))
    for name in (*first["rows"], *first["chance"]):
        spacing = result["anchors"].get(name)
        cells = [name.replace("_", " "), "", ""]
        if spacing is not None:
            cells[1:] = [
                f"{spacing['anchors']:,}",
                f"{spacing['mean_deg']:.1f}, {spacing['covering_deg']:.1f}",
            ]
        for category in categories.values():
            row = {**category["rows"], **category["chance"]}[name]
            _, paper = category["paper"].get(name, (None, None))
            cells += [
                cell(row["error_deg"], 1),
                cell(row["coverage@15"], 2),
                "" if paper is None else f"{paper:g}",
            ]
        lines.append(_line(cells))
    affordance = ", ".join(
        f"{c} {cell(row['affordance_miou'], 3)}" for c, row in categories.items()
    )
    judged = sum(row["judged"] for row in categories.values())
    lines += [
        "",
        "Best-match error of the first proposal, and the share of the successful grasps within "
        "15 deg of the first ten, at graspable points that are called so in "
        f"{judged} views of unseen objects. Unlike the paper's, the rows share a trained network: "
        "only their grasp heads were trained, side by side, on its frozen features. Affordance, "
        f"mIoU, is the same in all rows: {affordance}.",
    ]
    return "\n".join(lines)


def network_table_block(result: Mapping[str, Any]) -> str:
    """A Markdown table of ``network_table.json``: the mean over categories, a choice a line."""
    columns = result["columns"]
    lines = _head(["", *(heading for heading, _ in columns.values()), "minutes"])
    for row, values in result["metrics"]["mean"].items():
        cells = [cell(values[name], decimals) for name, (_, decimals) in columns.items()]
        seconds = result["training_seconds"][row]
        minutes = "" if seconds is None else f"{seconds / 60:.0f}"
        lines.append(_line([row.replace("_", " "), *cells, minutes]))
    config = result["config"]
    lines += [
        "",
        f"Means over {', '.join(config['category'])}; {sum(result['views'].values())} views of "
        f"{config['split']} objects. Every row: {config['samples']} views a category, "
        f"{config['epochs']} epochs, and one choice that is not the first row's. Minutes of one "
        "core train all of a row's networks.",
    ]
    return "\n".join(lines)


BLOCKS: Mapping[str, Callable[[Mapping[str, Any]], str]] = {
    "success_rate": success_rate_block,
    "object_table": object_table_block,
    "object_table_noise": object_table_block,
    "scene_table": scene_table_block,
    "real_frame": real_frame_block,
    "objects": objects_block,
    "variety": variety_block,
    "solvability": solvability_block,
    "env_speed": env_speed_block,
    "labels": labels_block,
    "label_speed": label_speed_block,
    "pose_speed": pose_speed_block,
    "anchor_table": anchor_table_block,
    "network_table": network_table_block,
    "rays": rays_block,
    "rl_baselines": rl_baselines_block,
}


#: What makes a result whose module has several.
_COMMANDS = {
    "env_speed": "speed env",
    "label_speed": "speed labels",
    "pose_speed": "speed poses",
    "object_table": "perception table1",
    "object_table_noise": "perception table1 --depth-noise",
    "anchor_table": "perception table2",
    "network_table": "perception networks",
    "scene_table": "perception table3",
}


def filled(page: str, results: Path = RESULTS_FOLDER) -> str:
    """The text of a page with every block written anew.

    Raises:
        InvalidArgumentError: a block is opened and not closed.
        DamagedFileError: the result a block quotes is missing or not JSON.
    """
    for name, block in BLOCKS.items():
        start, end = f"<!-- {name} -->", f"<!-- /{name} -->"
        if start not in page:
            continue
        if end not in page:
            raise InvalidArgumentError(f"{start} is never closed: add {end}.")
        file = results / f"{name}.json"
        try:
            text = block(json.loads(file.read_text(encoding="utf-8")))
        except (OSError, ValueError, KeyError) as error:
            raise DamagedFileError(
                f"{file} cannot be quoted ({type(error).__name__}: {error}); make it again with "
                f"`python -m benchmarks.{_COMMANDS.get(name, name)}`"
            ) from error
        before, _, rest = page.partition(start)
        _, _, after = rest.partition(end)
        page = f"{before}{start}\n{text}\n{end}{after}"
    return page


def main() -> int:
    """Fills every page, and says which changed."""
    for path in PAGES:
        page = path.read_text(encoding="utf-8")
        new = filled(page)
        path.write_text(new, encoding="utf-8")
        print(f"{path.relative_to(ROOT)}: {'unchanged' if new == page else 'written'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
