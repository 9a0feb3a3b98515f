"""Sequences whose items are read when they are asked for."""

from __future__ import annotations

import operator
from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar, overload

T = TypeVar("T")


class LazySequence(Sequence[T]):
    """A sequence of what lies in a folder; a subclass tells its length and reads one item.

    Attributes:
        folder: where it lies.
    """

    folder: Path

    @abstractmethod
    def _item(self, position: int) -> T:
        """The item at a position, 0 or more and less than the length."""

    @overload
    def __getitem__(self, index: int) -> T: ...
    @overload
    def __getitem__(self, index: slice) -> list[T]: ...
    def __getitem__(self, index: int | slice) -> T | list[T]:
        """One item, or the list of a slice."""
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        position = operator.index(index)
        if position < 0:
            position += len(self)
        if not 0 <= position < len(self):
            raise IndexError(f"index {index} is outside the {len(self)} of {self.folder}")
        return self._item(position)
