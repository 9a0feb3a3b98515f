"""The table of environments that `import artgym` makes known to Gymnasium."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import gymnasium

from artgym.categories import CATEGORIES


@dataclass(frozen=True, kw_only=True)
class EnvironmentEntry:
    """One row of the table.

    Args:
        id: what `gymnasium.make` is given; a change of behaviour means a new version in it.
        entry_point: "module:Class", imported only when an environment is made.
        vector_entry_point: the same for `gymnasium.make_vec`.
        arguments: what the class is given unless the caller says otherwise.
        tags: what a test or a benchmark selects environments by.
    """

    id: str
    entry_point: str
    vector_entry_point: str
    arguments: Mapping[str, Any] = field(default_factory=dict)
    tags: frozenset[str] = frozenset()


def _entry(
    task: str, module: str, word: str = "", tags: tuple[str, ...] = (), **arguments: Any
) -> EnvironmentEntry:
    return EnvironmentEntry(
        id=f"Art{task}{word}-v0",
        entry_point=f"artgym.envs.{module}:Art{task}Env",
        vector_entry_point=f"artgym.envs.vector:make_{task.lower()}",
        arguments=arguments,
        tags=frozenset({task.lower(), *tags}),
    )


ENVIRONMENTS: tuple[EnvironmentEntry, ...] = (
    _entry("Open", "articulated_env", tags=("any-category", "single-object")),
    _entry("Close", "articulated_env", tags=("any-category", "single-object")),
    _entry("Scene", "scene_env", tags=("any-category",)),
    *(
        _entry(
            task,
            "articulated_env",
            category.name.title().replace("_", ""),
            ("one-category", "single-object"),
            categories=(category.name,),
            split="test" if category.held_out else "train",
        )
        for task in ("Open", "Close")
        for category in CATEGORIES.values()
    ),
)


def environment_ids(*tags: str) -> list[str]:
    """Ids of the environments that carry all of the tags.

    >>> environment_ids("any-category")
    ['ArtOpen-v0', 'ArtClose-v0', 'ArtScene-v0']
    """
    return [entry.id for entry in ENVIRONMENTS if entry.tags.issuperset(tags)]


def register_environments() -> None:
    """Make every row known to Gymnasium; rows it already knows are left alone."""
    for entry in ENVIRONMENTS:
        if entry.id not in gymnasium.registry:
            gymnasium.register(
                id=entry.id,
                entry_point=entry.entry_point,
                vector_entry_point=entry.vector_entry_point,
                kwargs=dict(entry.arguments),
            )
