"""Imported objects on this machine: a folder each, found by ids such as ``import/my_drawer``.

Every environment asks here whether an id is of an imported object. What reads and writes them is
loaded when it is needed.
"""

from __future__ import annotations

import contextlib
import functools
import os
import re
import secrets
import shutil
from dataclasses import replace
from pathlib import Path

from artgym.errors import (
    AssetError,
    DamagedFileError,
    FileNotWrittenError,
    InvalidArgumentError,
    UnknownNameError,
)
from artgym.objects.model import ArticulatedObject

#: Environment variable that names the folder of imported objects.
FOLDER_VARIABLE = "ARTGYM_OBJECTS"
#: First half of the ids of imported objects, in a category's place.
PREFIX = "import"

_ATTEMPTS = 8
_NAME = re.compile(r"[a-z0-9_-]{1,64}")


def folder() -> Path:
    """Where imported objects lie: ``$ARTGYM_OBJECTS``, by default in the user's data folder."""
    given = os.environ.get(FOLDER_VARIABLE)
    return Path(given) if given else Path.home() / ".local" / "share" / "artgym" / "objects"


def is_imported(object_id: object) -> bool:
    """Whether an id is of the form of an imported object's."""
    return str(object_id).partition("/")[0] == PREFIX


def object_id(name: str) -> str:
    """The id of the object of a name.

    Raises:
        InvalidArgumentError: no name that an object can have.
    """
    if not _NAME.fullmatch(name):
        raise InvalidArgumentError(
            f"name={name!r}: expected 1 to 64 of the characters a-z, 0-9, '_' and '-'"
        )
    return f"{PREFIX}/{name}"


def save(obj: ArticulatedObject, name: str) -> str:
    """Keeps an object; one of the same name is replaced.

    Args:
        obj: the object; its id becomes the new one.
        name: letters a-z, digits, '_' and '-'.

    Returns:
        Its id, ``import/{name}``.

    Raises:
        InvalidArgumentError: no name that an object can have.
        FileNotWrittenError: the system refused.
    """
    new_id = object_id(name)
    target = folder() / name
    # Two files make an object: they get their name together.
    fresh = folder() / f".new-{name}-{secrets.token_hex(4)}"
    old = folder() / f".old-{name}-{secrets.token_hex(4)}"
    from artgym.objects.description import write_description

    try:
        write_description(replace(obj, object_id=new_id), fresh)
        for attempt in range(_ATTEMPTS):
            try:
                with contextlib.suppress(FileNotFoundError):
                    os.replace(target, f"{old}-{attempt}")
                os.replace(fresh, target)
                break
            except OSError:
                # Another process may have put its own there in between.
                if attempt == _ATTEMPTS - 1:
                    raise
    except FileNotWrittenError:
        raise
    except OSError as error:
        raise FileNotWrittenError(
            f"cannot write {target}: {error.strerror or error}. Choose another folder by "
            f"{FOLDER_VARIABLE}, or free some space."
        ) from error
    finally:
        for left in (fresh, *folder().glob(f"{old.name}-*")):
            shutil.rmtree(left, ignore_errors=True)
    return new_id


def load(imported_id: str) -> ArticulatedObject:
    """The object of an id; immutable, so repeated calls share it.

    Raises:
        UnknownNameError: no such object; names the nearest.
        DamagedFileError: its files cannot be read.
    """
    from artgym.objects.description import JSON_NAME

    path = _existing(imported_id) / JSON_NAME
    try:
        status = path.stat()
    except OSError as error:
        raise _damaged(imported_id, f"{path}: {error.strerror}") from None
    return _read(imported_id, path.parent, (status.st_mtime_ns, status.st_size, status.st_ino))


@functools.lru_cache(maxsize=64)
def _read(imported_id: str, path: Path, stamp: tuple[int, int, int]) -> ArticulatedObject:
    """Reads an object; ``stamp`` tells a replaced one from the one read before."""
    from artgym.objects.description import read_description

    del stamp
    try:
        obj = read_description(path)
    except AssetError as error:
        raise _damaged(imported_id, str(error)) from error
    # The folder's name counts: it may have been renamed.
    return replace(obj, object_id=imported_id)


def forget() -> None:
    """Lets go of objects that were read: the next ``load`` reads anew."""
    _read.cache_clear()


def _damaged(imported_id: str, problem: str) -> DamagedFileError:
    return DamagedFileError(
        f"{imported_id} is damaged: {problem} Import it again: `artgym import PATH --name "
        f"{imported_id.removeprefix(PREFIX + '/')}`."
    )


def names() -> tuple[str, ...]:
    """Names of all imported objects, sorted; damaged ones too."""
    try:
        entries = [path.name for path in folder().iterdir() if path.is_dir()]
    except OSError:
        return ()
    return tuple(sorted(name for name in entries if _NAME.fullmatch(name)))


def ids() -> tuple[str, ...]:
    """Ids of all imported objects, sorted; damaged ones too."""
    return tuple(map(object_id, names()))


def remove(imported_id: str) -> None:
    """Takes an imported object away.

    Raises:
        UnknownNameError: no such object; names the nearest.
        FileNotWrittenError: the system refused.
    """
    path = _existing(imported_id)
    try:
        shutil.rmtree(path)
    except OSError as error:
        raise FileNotWrittenError(
            f"cannot remove {path}: {error.strerror or error}. Remove the folder by hand."
        ) from error


def _existing(imported_id: str) -> Path:
    """The folder of an object that is there."""
    known = ids()
    if imported_id not in known:
        raise UnknownNameError("imported object", imported_id, known)
    return folder() / imported_id.removeprefix(f"{PREFIX}/")
