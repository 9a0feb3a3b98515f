"""What every benchmark's command line does the same: read options, report, end with a status."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

import tyro
from rich.console import Console
from rich.table import Table

from artgym.errors import ArtgymError, InvalidArgumentError, UnknownNameError

#: Columns of printed tables where they are not shown on a terminal.
_WIDTH = 180


class Options(Protocol):
    """Options of any benchmark."""

    @property
    def out(self) -> Path:
        """Folder for ``NAME.json``."""
        ...


C = TypeVar("C", bound=Options)


def require_positive(config: object, *names: str) -> None:
    """Refuses a config with less than one of something; None stands for all of it.

    Raises:
        InvalidArgumentError: names the field and its value.
    """
    for name in names:
        value = getattr(config, name)
        if value is not None and value < 1:
            raise InvalidArgumentError(f"{name}={value}: expected 1 or more.")


def run(
    name: str,
    config_type: type[C],
    report: Callable[[C], Iterable[Table]],
    arguments: Sequence[str] | None,
) -> int:
    """Runs ``python -m benchmarks.NAME`` and prints its tables.

    Args:
        name: of the benchmark's module.
        config_type: dataclass whose fields are the options.
        report: measures, writes ``NAME.json`` to ``out``, and gives the tables; where the options
            have a ``result_name``, it stands for NAME.
        arguments: what follows on the command line; by default the process's own.

    Returns:
        The exit status: 0 success, 1 failure, 130 interrupted. A command line that cannot be
        understood ends the process with 2.
    """
    try:
        config = tyro.cli(config_type, prog=f"benchmarks.{name}", args=arguments)
        tables = report(config)
    except ArtgymError as error:
        print(f"{name}: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(f"{name}: interrupted.", file=sys.stderr)
        return 130
    console = Console(width=None if sys.stdout.isatty() else _WIDTH)
    for table in tables:
        console.print(table)
    print(f"wrote {config.out / getattr(config, 'result_name', name)}.json")
    return 0


def run_named(
    name: str,
    what: str,
    choices: Mapping[str, Callable[[Sequence[str]], int]],
    arguments: Sequence[str] | None,
) -> int:
    """Runs ``python -m benchmarks.NAME WORD ...``, where the word names one of several benchmarks.

    Args:
        name: of the module.
        what: the word is: "question".
        choices: by word, the functions that take the command line after it.
        arguments: what follows on the command line; by default the process's own.

    Returns:
        The exit status, see ``run``; 2 where the word is none of ours.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    if not arguments or arguments[0] not in choices:
        word = arguments[0] if arguments else ""
        print(f"{name}: {UnknownNameError(what, word, choices)}", file=sys.stderr)
        return 2
    return choices[arguments[0]](arguments[1:])


def cell(value: float | None, decimals: int) -> str:
    """A number in a table; a dash where there is none."""
    return "-" if value is None or math.isnan(value) else f"{value:.{decimals}f}"
