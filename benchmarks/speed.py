"""How fast is it? ``python -m benchmarks.speed env|labels|datasets|poses|perception --help``."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence

from benchmarks import dataset_speed, env_speed, label_speed, perception_speed, pose_speed
from benchmarks.command import run_named

#: What can be timed: the functions take the command line that follows the word.
QUESTIONS: Mapping[str, Callable[[Sequence[str]], int]] = {
    "env": env_speed.main,
    "labels": label_speed.main,
    "datasets": dataset_speed.main,
    "perception": perception_speed.main,
    "poses": pose_speed.main,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Answers one of the questions; see ``benchmarks.command.run_named``."""
    return run_named("speed", "question", QUESTIONS, arguments)


if __name__ == "__main__":
    sys.exit(main())
