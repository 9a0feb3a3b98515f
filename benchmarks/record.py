"""What a result must carry to be believed: command, commit, versions, hardware; and its file."""

from __future__ import annotations

import json
import math
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import artgym
from artgym.errors import DamagedFileError
from artgym.files import write_file_whole

#: Where results go by default: beside the code, wherever the command is given.
RESULTS_FOLDER = Path(__file__).parent / "results"

_REPOSITORY = Path(__file__).resolve().parents[1]
_PACKAGES = ("numpy", "scipy", "gymnasium", "sapien", "mani_skill", "torch", "numba")
#: A JSON value that fits in so many characters stays on one line.
_LINE_LENGTH = 500


def provenance(module: str) -> dict[str, Any]:
    """How, when and on what a result was made.

    Args:
        module: the module that was run, "benchmarks.success_rate".
    """
    return {
        "command": shlex.join(["python", "-m", module, *map(_without_machine, sys.argv[1:])]),
        "date": datetime.now(UTC).isoformat(timespec="seconds"),
        "git": git_state(),
        "versions": {
            "python": platform.python_version(),
            "artgym": artgym.__version__,
            **{package: _installed_version(package) for package in _PACKAGES},
        },
        "hardware": hardware(),
    }


def _without_machine(argument: str) -> str:
    """An argument whose absolute path, which is of one machine, gives way to its last part."""
    option, equals, value = argument.rpartition("=")
    return option + equals + (Path(value).name if Path(value).is_absolute() else value)


def git_state() -> dict[str, Any] | None:
    """Commit, and whether anything but results differs from it; None outside a git clone."""
    commit = _git("rev-parse", "HEAD")
    if commit is None:
        return None
    results = RESULTS_FOLDER.relative_to(Path(__file__).parents[1]).as_posix()
    changes = _git("status", "--porcelain", "--", ".", f":(exclude){results}")
    return {"commit": commit, "dirty": changes is None or bool(changes)}


def _git(*arguments: str) -> str | None:
    """What git answers about this clone; None where it does not."""
    try:
        process = subprocess.run(
            ["git", "-C", str(_REPOSITORY), *arguments],
            capture_output=True,
            text=True,
            timeout=60,
            check=True,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return process.stdout.strip()


def _installed_version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def hardware() -> dict[str, Any]:
    """CPU model, cores this process may use, and memory in GiB."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    memory = None
    if "SC_PHYS_PAGES" in getattr(os, "sysconf_names", {}):
        memory = round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30, 1)
    return {"cpu": _cpu_model(), "cores": cores, "memory_gib": memory}


def _cpu_model() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, platform.processor() or platform.machine())


def write_result(path: Path, result: dict[str, Any]) -> None:
    """Writes a result as JSON, whole; NaN becomes null, a path text from the repository's root.

    Raises:
        FileNotWrittenError: the system refused.
    """
    write_file_whole(path, (json_text(_json_value(result)) + "\n").encode())


def measure_rows(
    path: Path,
    config: dict[str, Any],
    rows: Mapping[str, Callable[[], dict[str, Any]]],
    *,
    resume: bool,
) -> dict[str, Any]:
    """Measures a result row by row, and writes it after each.

    Args:
        path: of the result.
        config: the options that the rows depend on.
        rows: measures each row, by name.
        resume: whether rows that an earlier run with the same config wrote are kept.

    Returns:
        The result: ``config``, and ``rows`` by name in alphabetical order.

    Raises:
        DamagedFileError: there is a result to resume, and it cannot be read.
        FileNotWrittenError: the system refused.
    """
    measured = _kept_rows(path, config) if resume else {}
    result = {"config": config, "rows": measured}
    for name, measure in rows.items():
        if name not in measured:
            measured[name] = measure()
        result["rows"] = dict(sorted(measured.items()))
        write_result(path, result)
    return result


def _kept_rows(path: Path, config: dict[str, Any]) -> dict[str, Any]:
    """The rows of a result that an earlier run with the same config wrote; else none."""
    if not path.exists():
        return {}
    try:
        before = json.loads(path.read_text(encoding="utf-8"))
        return before["rows"] if before["config"] == _json_value(config) else {}
    except (ValueError, KeyError, TypeError) as error:
        raise DamagedFileError(
            f"{path} is damaged ({error}): remove it, or go without --resume."
        ) from error


def json_text(value: Any, indent: str = "") -> str:
    """JSON with a line for each value short enough to be read on one.

    >>> print(json_text({"a": [1, 2]}))
    {"a": [1, 2]}
    """
    line = json.dumps(value, allow_nan=False)
    if not isinstance(value, dict | list) or not value or len(line) <= _LINE_LENGTH:
        return line
    deeper = indent + "  "
    if isinstance(value, list):
        items = [json_text(item, deeper) for item in value]
        brackets = "[]"
    else:
        items = [f"{json.dumps(name)}: {json_text(item, deeper)}" for name, item in value.items()]
        brackets = "{}"
    inner = ",\n".join(deeper + item for item in items)
    return f"{brackets[0]}\n{inner}\n{indent}{brackets[1]}"


def _json_value(value: Any) -> Any:
    """The same value in types that JSON knows."""
    if isinstance(value, dict):
        return {name: _json_value(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_json_value(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        inside = value.is_relative_to(_REPOSITORY)
        return (value.relative_to(_REPOSITORY) if inside else value).as_posix()
    return value
