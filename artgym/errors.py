"""Every error that artgym raises on purpose.

Each message says what was expected, what came, and what to do about it.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable


def _cut(text: str, length: int = 120) -> str:
    return text if len(text) <= length else text[: length - 3] + "..."


class ArtgymError(Exception):
    """Base of all errors raised on purpose by this package."""


class InvalidArgumentError(ArtgymError, ValueError):
    """A caller passed a value that cannot be used; the message names the argument."""


class NothingSeenError(InvalidArgumentError):
    """A picture shows no table, or nothing that stands on it: another one may."""


class UnknownNameError(InvalidArgumentError):
    """A name that is not in a table.

    Args:
        kind: what the name should have been ("category", "obs_mode", ...).
        name: what came.
        known: the names that would have worked.
    """

    def __init__(self, kind: str, name: object, known: Iterable[str]) -> None:
        known = sorted(known)
        nearest = difflib.get_close_matches(str(name), known, n=1, cutoff=0.0)
        hint = f" Nearest: {nearest[0]!r}." if nearest else ""
        shown = ", ".join(known[:12]) + (f", ... ({len(known)} in all)" if len(known) > 12 else "")
        super().__init__(f"unknown {kind} {name!r}.{hint} Known: {shown}.")
        self.kind = kind
        self.name = name
        self.nearest = nearest[0] if nearest else None

    def __reduce__(self) -> tuple[object, ...]:
        return (InvalidArgumentError, (str(self),))


class RendererUnavailableError(ArtgymError, RuntimeError):
    """No device can render; state and point-cloud observations still work."""


class DamagedFileError(ArtgymError):
    """A file of ours cannot be read as what it should be; the message names it."""


class AssetError(ArtgymError, ValueError):
    """A file that describes an object cannot be used.

    Args:
        file: the file, as the caller knows it.
        problem: what is wrong, in a few words.
        remedy: what to do about it.
        element: the place in the file: "joint 'hinge' axis", "face 17".
        value: what stands there; long values are cut.
    """

    def __init__(
        self,
        file: object,
        problem: str,
        *,
        remedy: str,
        element: str = "",
        value: object = None,
    ) -> None:
        shown = "" if value is None else f" (got {_cut(repr(value))})"
        place = f"{element}: " if element else ""
        super().__init__(f"{file}: {place}{problem}{shown}. {remedy}")
        self.file = str(file)
        self.problem = problem
        self.element = element
        self.value = value
        self.remedy = remedy

    def __reduce__(self) -> tuple[object, ...]:
        return (_asset_error, (self.file, self.problem, self.remedy, self.element, self.value))


def _asset_error(file: str, problem: str, remedy: str, element: str, value: object) -> AssetError:
    return AssetError(file, problem, remedy=remedy, element=element, value=value)


class FileNotWrittenError(ArtgymError, OSError):
    """The system refused to write a file: disk full, read-only, no such place."""


class MissingDependencyError(ArtgymError, ImportError):
    """A package or system library is missing; the message says how to install it."""


class WorkerError(ArtgymError, RuntimeError):
    """A process that steps environments died, hangs, or met an unexpected error."""


class NotReadyError(ArtgymError, RuntimeError):
    """A call came at the wrong time: before ``reset`` or after ``close``."""
