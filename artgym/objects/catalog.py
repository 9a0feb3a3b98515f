"""Which objects and categories there are: ids, splits, start states.

An id is ``category/number``; the number is the seed, so an id names the same object everywhere.
"""

from __future__ import annotations

import functools
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from artgym.errors import InvalidArgumentError, UnknownNameError
from artgym.objects.model import ArticulatedObject
from artgym.objects.procedural import GENERATORS

Split = Literal["train", "val", "test"]

#: Numbers of each split; the same for every category, disjoint by construction.
SPLITS: Mapping[str, range] = MappingProxyType(
    {"train": range(0, 1000), "val": range(1000, 1200), "test": range(1200, 1600)}
)


@dataclass(frozen=True, kw_only=True)
class Category:
    """What the tasks need to know of a category.

    Attributes:
        name: the category's name, the first half of its objects' ids.
        parts: part names in order, base first.
        start_fraction: interval of the open fraction at which an opening episode starts. Up to
            0.05; up to 0.1 where the closed part offers nothing to grip.
        size: smallest and largest plausible extent of an object, metres, for soundness.
    """

    name: str
    parts: tuple[str, ...]
    start_fraction: tuple[float, float]
    size: tuple[float, float]


CATEGORIES: Mapping[str, Category] = MappingProxyType(
    {
        c.name: c
        for c in (
            Category(
                name="drawer",
                parts=("body", "drawer"),
                start_fraction=(0.0, 0.05),
                size=(0.10, 0.60),
            ),
            Category(
                name="laptop",
                parts=("base", "lid"),
                start_fraction=(0.06, 0.1),
                size=(0.015, 0.45),
            ),
        )
    }
)


def category(name: str) -> Category:
    """Looks a category up.

    Raises:
        UnknownNameError: no such category; names the nearest.
    """
    try:
        return CATEGORIES[name]
    except KeyError:
        raise UnknownNameError("category", name, CATEGORIES) from None


def object_ids(category_name: str, split: Split, count: int | None = None) -> tuple[str, ...]:
    """The first ``count`` ids of a split, all of them by default.

    Raises:
        UnknownNameError: unknown category or split.
        InvalidArgumentError: the split has fewer objects than asked for.
    """
    category(category_name)
    if split not in SPLITS:
        raise UnknownNameError("split", split, SPLITS)
    numbers = SPLITS[split]
    if count is not None and not 0 < count <= len(numbers):
        raise InvalidArgumentError(
            f"count={count} objects of {category_name}/{split}: expected 1 to {len(numbers)}"
        )
    return tuple(f"{category_name}/{n:04d}" for n in numbers[:count])


def split_of(object_id: str) -> Split:
    """The split an object belongs to."""
    _, number = _parse(object_id)
    return next(split for split, numbers in SPLITS.items() if number in numbers)  # type: ignore[return-value]


@functools.lru_cache(maxsize=256)
def load(object_id: str) -> ArticulatedObject:
    """The object of an id; immutable, so repeated calls share it.

    Raises:
        UnknownNameError: the id is not in the catalogue; names the nearest.
    """
    category_name, number = _parse(object_id)
    # A category's stream must not follow another's, and Python's own hash changes by process.
    seed = [zlib.crc32(category_name.encode()), number]
    return GENERATORS[category_name](object_id, np.random.default_rng(seed))


def _parse(object_id: str) -> tuple[str, int]:
    """Category and number of an id."""
    name, _, number = str(object_id).partition("/")
    category(name)
    last = max(numbers.stop for numbers in SPLITS.values())
    if not (number.isascii() and number.isdigit() and len(number) == 4 and int(number) < last):
        known = [f"{name}/0000", f"{name}/{last - 1:04d}"]
        if number.isascii() and number.isdigit() and int(number) < last:
            known = [f"{name}/{int(number):04d}"]
        raise UnknownNameError("object id", object_id, known)
    return name, int(number)
