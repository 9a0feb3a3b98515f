"""The table of categories: what the tasks need to know of each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from artgym.errors import UnknownNameError

#: Start interval of categories whose closed part offers nothing to grip.
_AJAR = (0.06, 0.1)


@dataclass(frozen=True, kw_only=True)
class Category:
    """What the tasks need to know of a category.

    Attributes:
        name: the category's name, the first half of its objects' ids.
        parts: part names in order, base first. An object has the first so many of them.
        start_fraction: interval of the open fraction at which an opening episode starts. Up to
            0.05; up to 0.1 where the closed part offers nothing to grip.
        size: smallest and largest plausible extent of an object without its stand, metres.
        held_out: kept out of all training: every object belongs to the test split.
    """

    name: str
    parts: tuple[str, ...]
    size: tuple[float, float]
    start_fraction: tuple[float, float] = (0.0, 0.05)
    held_out: bool = False


def _category(name: str, parts: str, smallest: float, largest: float, **more: Any) -> Category:
    return Category(name=name, parts=tuple(parts.split()), size=(smallest, largest), **more)


#: Every category; four are held out: a side-hinged door, two lids, and something else altogether.
CATEGORIES: Mapping[str, Category] = MappingProxyType(
    {
        c.name: c
        for c in (
            _category("box", "body lid_1 lid_2 lid_3 lid_4", 0.015, 0.50, start_fraction=_AJAR),
            _category("cabinet", "body door_1 door_2", 0.12, 1.10),
            _category("cutter", "body slider", 0.008, 0.26),
            _category("dishwasher", "body door", 0.35, 0.95),
            _category("door", "frame door", 0.05, 2.30),
            _category("drawer", "body drawer_1 drawer_2 drawer_3 drawer_4", 0.06, 0.95),
            _category("eyeglasses", "frame temple_1 temple_2", 0.01, 0.20, start_fraction=_AJAR),
            _category("faucet", "base handle spout", 0.03, 0.50, held_out=True),
            _category("laptop", "base lid", 0.015, 0.45, start_fraction=_AJAR),
            _category("microwave", "body door", 0.20, 0.65),
            _category("oven", "body door", 0.20, 1.00),
            _category("refrigerator", "body door_1 door_2", 0.35, 1.95),
            _category("safe", "body door", 0.15, 0.75, held_out=True),
            _category("scissors", "half_1 half_2", 0.006, 0.25, start_fraction=_AJAR),
            _category("stapler", "base arm", 0.02, 0.25),
            _category("suitcase", "body lid", 0.08, 0.85, held_out=True),
            _category("toilet", "bowl lid", 0.30, 0.95, held_out=True),
            _category("trash_can", "body lid", 0.12, 0.85),
        )
    }
)

#: What is assumed of an imported object of no category here.
OTHER = _category("other", "base part", 0.01, 2.5)


def category(name: str) -> Category:
    """Looks a category up.

    Raises:
        UnknownNameError: no such category; names the nearest.
    """
    try:
        return CATEGORIES[name]
    except KeyError:
        raise UnknownNameError("category", name, CATEGORIES) from None
