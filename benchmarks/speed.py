"""How fast is it? ``python -m benchmarks.speed env|labels|datasets|poses|perception --help``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence

from artgym.errors import UnknownNameError
from benchmarks import dataset_speed, env_speed, label_speed, perception_speed, pose_speed

#: What can be timed: the functions take the command line that follows the word.
QUESTIONS: Mapping[str, Callable[[Sequence[str]], int]] = {
    "env": env_speed.main,
    "labels": label_speed.main,
    "datasets": dataset_speed.main,
    "perception": perception_speed.main,
    "poses": pose_speed.main,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one of the questions.

    Args:
        arguments: what follows on the command line; by default the process's own.

    Returns:
        The exit status, see ``benchmarks.command.run``; 2 where no question of ours is named.
    """
    arguments = sys.argv[1:] if arguments is None else arguments
    if not arguments or arguments[0] not in QUESTIONS:
        named = arguments[0] if arguments else ""
        print(f"speed: {UnknownNameError('question', named, QUESTIONS)}", file=sys.stderr)
        return 2
    return QUESTIONS[arguments[0]](arguments[1:])


if __name__ == "__main__":
    sys.exit(main())
