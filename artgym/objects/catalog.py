"""Which objects and categories there are: ids, splits, start states.

An id is ``category/number``; the number is the seed, so an id names the same object everywhere.
Ids of objects imported on this machine are ``import/name``.
"""

from __future__ import annotations

import functools
import zlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

import numpy as np

from artgym.categories import CATEGORIES, OTHER, Category, category
from artgym.errors import InvalidArgumentError, UnknownNameError
from artgym.objects import store
from artgym.objects.model import ArticulatedObject
from artgym.objects.procedural import generator

Split = Literal["train", "val", "test"]

#: Numbers of each split; the same for every category, disjoint by construction.
SPLITS: Mapping[str, range] = MappingProxyType(
    {"train": range(0, 1000), "val": range(1000, 1200), "test": range(1200, 1600)}
)
#: All numbers, of whatever split.
ALL_NUMBERS = range(0, 1600)


def category_of(obj: ArticulatedObject) -> Category:
    """An object's category; ``OTHER`` where it is none of the catalogue's."""
    return CATEGORIES.get(obj.category, OTHER)


def categories_with(split: str) -> tuple[str, ...]:
    """Names of the categories that have objects in a split: held-out ones only in "test".

    Raises:
        UnknownNameError: unknown split.
    """
    if split not in SPLITS:
        raise UnknownNameError("split", split, SPLITS)
    return tuple(n for n, c in CATEGORIES.items() if split == "test" or not c.held_out)


def object_ids(category_name: str, split: Split, count: int | None = None) -> tuple[str, ...]:
    """The first ``count`` ids of a split, all of them by default.

    Raises:
        UnknownNameError: unknown category or split.
        InvalidArgumentError: the split has fewer objects than asked for.
    """
    held_out = category(category_name).held_out
    if split not in SPLITS:
        raise UnknownNameError("split", split, SPLITS)
    numbers = SPLITS[split]
    if held_out:
        if split != "test":
            raise InvalidArgumentError(
                f"category {category_name!r} is held out of training: it has no {split!r} split, "
                'only "test"'
            )
        numbers = ALL_NUMBERS
    return _first_ids(category_name, numbers, count, f"{category_name}/{split}")


def all_ids(category_name: str, count: int | None = None) -> tuple[str, ...]:
    """The first ``count`` ids of a category whatever their split, all of them by default.

    Raises:
        UnknownNameError: unknown category.
        InvalidArgumentError: there are fewer.
    """
    category(category_name)
    return _first_ids(category_name, ALL_NUMBERS, count, category_name)


def _first_ids(name: str, numbers: range, count: int | None, described: str) -> tuple[str, ...]:
    if count is not None and not 0 < count <= len(numbers):
        raise InvalidArgumentError(
            f"count={count} objects of {described}: expected 1 to {len(numbers)}"
        )
    return tuple(f"{name}/{n:04d}" for n in numbers[:count])


def split_of(object_id: str) -> Split:
    """The split an object belongs to; imported ones are never trained on."""
    if store.is_imported(object_id):
        return "test"
    name, number = _parse(object_id)
    if category(name).held_out:
        return "test"
    return next(split for split, numbers in SPLITS.items() if number in numbers)  # type: ignore[return-value]


def load(object_id: str) -> ArticulatedObject:
    """The object of an id; immutable, so repeated calls share it.

    Raises:
        UnknownNameError: the id is not in the catalogue; names the nearest.
        DamagedFileError: the files of an imported object cannot be read.
    """
    return store.load(object_id) if store.is_imported(object_id) else _kept(object_id)


@functools.lru_cache(maxsize=256)
def _kept(object_id: str) -> ArticulatedObject:
    return build(object_id)


def build(object_id: str) -> ArticulatedObject:
    """As ``load``, for objects of the catalogue's own categories, and made anew at each call.

    Raises:
        UnknownNameError: as for ``load``.
    """
    category_name, number = _parse(object_id)
    # A category's stream must not follow another's, and Python's own hash changes by process.
    seed = [zlib.crc32(category_name.encode()), number]
    return generator(category_name)(object_id, np.random.default_rng(seed))


def _parse(object_id: str) -> tuple[str, int]:
    """Category and number of an id."""
    name, _, number = str(object_id).partition("/")
    if name not in CATEGORIES:
        raise UnknownNameError("category", name, (*CATEGORIES, store.PREFIX))
    last = max(numbers.stop for numbers in SPLITS.values())
    if not (number.isascii() and number.isdigit() and len(number) == 4 and int(number) < last):
        known = [f"{name}/0000", f"{name}/{last - 1:04d}"]
        if number.isascii() and number.isdigit() and int(number) < last:
            known = [f"{name}/{int(number):04d}"]
        raise UnknownNameError("object id", object_id, known)
    return name, int(number)
