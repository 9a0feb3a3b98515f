"""How fast are pictures made, and training items read from them?

Run ``python -m benchmarks.speed datasets --help``.
"""

from __future__ import annotations

import functools
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.table import Table
from torch.utils.data import DataLoader

from artgym.datasets.generate import generate_artimage
from artgym.datasets.picture_files import SampleFolder
from artgym.datasets.sets import SETS
from artgym.errors import InvalidArgumentError
from artgym.objects import catalog
from benchmarks import record
from benchmarks.command import run
from icaf4_policy.anchors import AnchorConfig, anchors_from_config
from icaf4_policy.dataset import EpochSampler, TrainingItems
from icaf4_policy.targets import DrawConfig, collate_items

#: What is promised, a second.
TARGETS = {"pictures": 8.0, "items": 300.0}

_NUM_POINTS, _BATCH_SIZE = 2048, 8


@dataclass(frozen=True, kw_only=True)
class DatasetSpeedConfig:
    """How fast are pictures made, and training items read from them?

    Attributes:
        category: categories of objects.
        split: whose labelled objects are pictured, 640 x 480.
        labels: folder with {category}/{split}, instead of the shipped labels.
        epochs: through the items, timed from their first batch on; the first reads files.
        workers: processes that make pictures; items come from one.
        out: folder for dataset_speed.json.
    """

    category: tuple[str, ...] = SETS["artimage"]
    split: catalog.Split = "val"
    labels: Path | None = None
    epochs: int = 3
    workers: int = 2
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        if self.epochs < 2 or self.workers < 1:
            raise InvalidArgumentError(
                f"epochs={self.epochs}, workers={self.workers}: expected 2 and 1, or more."
            )


def measure(config: DatasetSpeedConfig) -> dict[str, Any]:
    """Makes pictures of every category and reads them; writes ``dataset_speed.json``."""
    rows = {}
    with tempfile.TemporaryDirectory() as folder:
        for category in config.category:
            place = Path(folder) / category
            began = time.perf_counter()
            manifest = generate_artimage(
                category,
                config.split,
                place,
                label_root=config.labels,
                workers=config.workers,
            )
            seconds = time.perf_counter() - began
            rows[category] = {
                "pictures": manifest.num_items,
                "pictures_a_second": manifest.num_items / seconds,
                "bytes_a_picture": sum(s.bytes for s in manifest.shards) / manifest.num_items,
                "items_a_second": _item_rates(place, category, config.epochs),
            }
    result = {
        **record.provenance("benchmarks.speed"),
        "config": {name: value for name, value in asdict(config).items() if name != "out"},
        "targets": TARGETS,
        "rows": rows,
    }
    record.write_result(config.out / "dataset_speed.json", result)
    return result


def _item_rates(folder: Path, category: str, epochs: int) -> list[float]:
    """Training items a second in each epoch after its first batch, from one worker of a loader."""
    anchors = anchors_from_config(AnchorConfig())
    draw = DrawConfig(num_points=_NUM_POINTS, num_anchors=len(anchors))
    # What is compiled is loaded before the clock starts, once for all workers.
    items, other = (
        TrainingItems(SampleFolder(folder), [category], anchors, draw) for _ in range(2)
    )
    other[0]
    loader = DataLoader(
        items,
        batch_size=_BATCH_SIZE,
        sampler=EpochSampler(len(items)),
        collate_fn=functools.partial(collate_items, config=draw),
        num_workers=1,
        persistent_workers=True,
    )
    rates = []
    for _ in range(epochs):
        batches = iter(loader)
        # By then the worker, whose start takes as long as dozens of items, is there.
        next(batches)
        began = time.perf_counter()
        count = sum(len(batch.part) for batch in batches)
        rates.append(count / (time.perf_counter() - began))
    return rates


def table_from_rows(rows: dict[str, dict[str, Any]]) -> Table:
    """The table for a person to read."""
    table = Table(title="data sets: 640 x 480 pictures made, and training items read, a second")
    for name in ("category", "pictures", "pictures/s", "kB each", "items/s, first epoch", "later"):
        table.add_column(name, justify="left" if name == "category" else "right")
    for category, row in rows.items():
        first, *later = row["items_a_second"]
        table.add_row(
            category,
            f"{row['pictures']:,}",
            f"{row['pictures_a_second']:.1f}",
            f"{row['bytes_a_picture'] / 1000:.0f}",
            f"{first:.0f}",
            f"{sum(later) / len(later):.0f}",
        )
    return table


def report(config: DatasetSpeedConfig) -> list[Table]:
    """Measures, writes ``dataset_speed.json`` and gives the table."""
    return [table_from_rows(measure(config)["rows"])]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("dataset_speed", DatasetSpeedConfig, report, arguments)
