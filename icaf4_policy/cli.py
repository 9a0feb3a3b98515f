"""The `icaf4` command: train a network, or look at one image with it."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import tyro

from artgym.errors import ArtgymError, MissingDependencyError


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one subcommand.

    Args:
        arguments: what follows `icaf4` on the command line; by default the process's own.

    Returns:
        The exit status: 0 success, 1 failure, 2 a command line that cannot be understood.
    """
    try:
        try:
            from icaf4_policy.commands import COMMANDS
        except ModuleNotFoundError as error:
            raise MissingDependencyError(
                f"icaf4 needs the package {error.name!r}: pip install 'artgym[train]'."
            ) from error
        return tyro.extras.subcommand_cli_from_dict(
            COMMANDS,
            prog="icaf4",
            description=__doc__,
            args=sys.argv[1:] if arguments is None else list(arguments),
        )
    except ArtgymError as error:
        print(f"icaf4: {error}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
