"""The `artgym` command: one function a subcommand, its arguments built from the signature."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence

import tyro

import artgym
from artgym.errors import ArtgymError, UnknownNameError


# Functions import what they need themselves: `artgym doctor` must answer on a machine where the
# simulator cannot be imported.
def doctor(*, json: bool = False) -> int:
    """Say whether everything is in place here, and what to install if not.

    Args:
        json: print a JSON object instead of text.
    """
    from artgym.doctor import examine, text_from_findings

    findings = examine()
    print(findings.to_json() if json else text_from_findings(findings))
    return 0 if findings.is_healthy() else 1


COMMANDS: dict[str, Callable[..., int]] = {"doctor": doctor}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one subcommand.

    Args:
        arguments: what follows `artgym` on the command line; by default the process's own.

    Returns:
        The exit status: 0 success, 1 failure, 2 a command line that cannot be understood.
    """
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    if arguments == ["--version"]:
        print(f"artgym {artgym.__version__}")
        return 0
    if arguments and not arguments[0].startswith("-") and arguments[0] not in COMMANDS:
        error = UnknownNameError("subcommand", arguments[0], COMMANDS)
        print(f"artgym: {error} See `artgym --help`.", file=sys.stderr)
        return 2
    try:
        return tyro.extras.subcommand_cli_from_dict(
            COMMANDS, prog="artgym", description=artgym.__doc__, args=arguments
        )
    except ArtgymError as error:
        print(f"artgym: {error}", file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
