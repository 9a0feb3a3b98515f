"""The paper's two sets, by name."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Literal

SetName = Literal["artimage", "reartmix"]

#: The categories of the paper's two sets.
SETS: Mapping[SetName, tuple[str, ...]] = MappingProxyType(
    {
        "artimage": ("laptop", "eyeglasses", "dishwasher", "drawer", "scissors"),
        "reartmix": ("box", "cutter", "drawer", "scissors", "stapler"),
    }
)
