"""From episodes to the numbers of a row: rates, their Wilson interval, means."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

from artgym.errors import InvalidArgumentError
from benchmarks.episodes import EpisodeRecord


def wilson_interval(successes: int, trials: int) -> tuple[float, float]:
    """The Wilson 95 % interval of a rate.

    >>> [round(bound, 3) for bound in wilson_interval(19, 20)]
    [0.764, 0.991]
    """
    interval = binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    return float(interval.low), float(interval.high)


def aggregate(records: Sequence[EpisodeRecord]) -> dict[str, Any]:
    """The numbers of a row, all of them taken at the end of the episodes.

    ``engaged`` and ``gripped`` are means over the episodes in which anything moved.

    Raises:
        InvalidArgumentError: there are no episodes.
    """
    if not records:
        raise InvalidArgumentError("no episodes to aggregate.")
    moved = [r for r in records if r.travel > 0.01]
    return {
        "episodes": len(records),
        "success": _mean([r.success for r in records]),
        "success_interval": wilson_interval(sum(r.success for r in records), len(records)),
        "success_gripped": _mean([r.success_gripped for r in records]),
        "success_gripped_interval": wilson_interval(
            sum(r.success_gripped for r in records), len(records)
        ),
        "success_once": _mean([r.success_once for r in records]),
        "success_at": {
            travel: _mean([r.success_at[travel] for r in records])
            for travel in records[0].success_at
        },
        "success_maniskill": _mean([r.success_maniskill for r in records]),
        "success_where2act": _mean([r.success_where2act for r in records]),
        "travel": _mean([r.travel for r in records]),
        "engaged": _mean([r.engaged for r in moved]),
        "gripped": _mean([r.gripped for r in moved]),
        "unstable": sum(r.unstable for r in records),
        "steps": _mean([r.steps for r in records]),
        "seconds": _mean([r.seconds for r in records]),
    }


def _mean(values: Sequence[float]) -> float:
    """Their mean; NaN of none."""
    return round(float(np.mean(values)), 4) if len(values) else float("nan")
