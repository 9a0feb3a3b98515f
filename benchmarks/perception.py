"""The paper's tables, and choices: ``python -m benchmarks.perception table1|... --help``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence

from benchmarks import anchor_table, network_table, object_table, scene_table
from benchmarks.command import run_named

#: What can be printed: the functions take the command line that follows the word.
TABLES: Mapping[str, Callable[[Sequence[str]], int]] = {
    "table1": object_table.main,
    "table2": anchor_table.main,
    "table3": scene_table.main,
    "networks": network_table.main,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures and prints one of the tables; see ``benchmarks.command.run_named``."""
    return run_named("perception", "table", TABLES, arguments)


if __name__ == "__main__":
    sys.exit(main())
