"""The table of environments that `import artgym` makes known to Gymnasium."""

from __future__ import annotations

from dataclasses import dataclass

import gymnasium


@dataclass(frozen=True, kw_only=True)
class EnvironmentEntry:
    """One row of the table.

    Args:
        id: what `gymnasium.make` is given; a change of behaviour means a new version in it.
        entry_point: "module:Class", imported only when an environment is made.
        horizon: control steps after which an episode is truncated.
        tags: what a test or a benchmark selects environments by.
    """

    id: str
    entry_point: str
    horizon: int
    tags: frozenset[str] = frozenset()


ENVIRONMENTS: tuple[EnvironmentEntry, ...] = (
    EnvironmentEntry(
        id="ArtOpen-v0",
        entry_point="artgym.envs.articulated_env:ArtOpenEnv",
        horizon=300,
        tags=frozenset({"single-object", "open"}),
    ),
)


def environment_ids(tag: str | None = None) -> list[str]:
    """Ids of the environments that carry a tag, or of all of them.

    >>> environment_ids("open")
    ['ArtOpen-v0']
    """
    return [entry.id for entry in ENVIRONMENTS if tag is None or tag in entry.tags]


def register_environments() -> None:
    """Make every row known to Gymnasium; rows it already knows are left alone."""
    for entry in ENVIRONMENTS:
        if entry.id not in gymnasium.registry:
            gymnasium.register(
                id=entry.id, entry_point=entry.entry_point, max_episode_steps=entry.horizon
            )
