"""The paper's tables: ``python -m benchmarks.perception table1|table2|table3 --help``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence

from artgym.errors import UnknownNameError
from benchmarks import anchor_table, object_table, scene_table

#: What can be printed: the functions take the command line that follows the word.
TABLES: Mapping[str, Callable[[Sequence[str]], int]] = {
    "table1": object_table.main,
    "table2": anchor_table.main,
    "table3": scene_table.main,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Measures and prints one of the tables.

    Args:
        arguments: what follows on the command line; by default the process's own.

    Returns:
        The exit status, see ``benchmarks.command.run``; 2 where no table of ours is named.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    if not arguments or arguments[0] not in TABLES:
        named = arguments[0] if arguments else ""
        print(f"perception: {UnknownNameError('table', named, TABLES)}", file=sys.stderr)
        return 2
    return TABLES[arguments[0]](arguments[1:])


if __name__ == "__main__":
    sys.exit(main())
