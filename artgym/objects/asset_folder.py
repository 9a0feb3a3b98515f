"""Reading the files of somebody else's object, and nothing but these.

A description names meshes, a mesh names materials, materials name pictures: none of these names is
to be trusted. Every file of an import is opened here, inside one folder, below a limit on bytes.
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Hashable, Mapping
from pathlib import Path, PurePosixPath
from types import MappingProxyType
from typing import Literal

from artgym.errors import AssetError

Kind = Literal["xml", "text", "mesh", "picture"]

_MB = 2**20
#: Largest file of each kind, bytes; "text" is what stands beside a description: JSON, MTL.
MAX_BYTES: Mapping[str, int] = MappingProxyType(
    {"xml": 8 * _MB, "text": 8 * _MB, "mesh": 64 * _MB, "picture": 32 * _MB}
)
#: All that is read for one object, bytes.
MAX_TOTAL_BYTES = 256 * _MB
#: Longest name that a file may mention.
_MAX_NAME = 512

_ARCHIVES = (".zip", ".tar", ".gz", ".tgz", ".bz2", ".xz", ".7z", ".rar", ".zae")
_PACKAGE_SCHEMES = ("package", "model")
_SCHEME = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*):/*(.*)", re.DOTALL)
_RELATIVE_FILE = re.compile(r"file:(//)?[^/].*", re.DOTALL | re.IGNORECASE)
_UNPRINTABLE = re.compile(r"[\x00-\x1f\x7f]")


class AssetFolder:
    """A folder that holds all files of an object; nothing outside it is ever opened.

    Symbolic links are followed as long as they end inside the folder.

    Args:
        root: the folder.

    Attributes:
        root: the folder with all links resolved.
        bytes_read: how much has been read so far.
        pixels_decoded: how many pixels pictures have been decoded to so far.
        decoded: what readers made of files, by their own keys: no file is decoded twice.

    Raises:
        AssetError: no such folder, or an archive in place of one.
    """

    def __init__(self, root: str | os.PathLike[str]) -> None:
        text = os.fspath(root)
        refuse_archive(text)
        try:
            self.root = Path(os.path.realpath(text, strict=True))
        except (OSError, ValueError) as error:
            raise AssetError(
                text, f"no such folder: {_reason(error)}", remedy="Check the path."
            ) from None
        if not self.root.is_dir():
            raise AssetError(text, "not a folder", remedy="Give the folder that holds the object.")
        self.bytes_read = 0
        self.pixels_decoded = 0
        self.decoded: dict[Hashable, object] = {}

    def label(self, name: str) -> str:
        """How a file of the folder is called in messages."""
        return str(self.root / name)

    def locate(self, name: str, *, mentioned_in: str = "", element: str = "") -> str:
        """Where a name leads: a path relative to the root, free of links and of "..".

        Args:
            name: as written in a file: relative to that file's folder, or ``package://name/rest``,
                which stands for ``rest`` or ``name/rest`` below the root.
            mentioned_in: the file that mentions it, relative to the root; the root by default.
            element: the place in that file, for messages.

        Raises:
            AssetError: the name leads out of the folder, to nothing, or is no name of a file.
        """
        file = self.label(mentioned_in) if mentioned_in else str(self.root)

        def refusal(problem: str, remedy: str) -> AssetError:
            return AssetError(file, problem, element=element, value=name, remedy=remedy)

        inside = f"Put the file below {self.root} and name it relative to the file that uses it."
        if not name.strip() or len(name) > _MAX_NAME or _UNPRINTABLE.search(name):
            raise refusal("not the name of a file", "Give the name of a file in the folder.")
        refuse_archive(name, file=file, element=element)
        path = name.strip().replace("\\", "/")
        starts = [PurePosixPath(mentioned_in).parent]
        scheme = _SCHEME.fullmatch(path)
        if scheme is not None:
            kind, rest = scheme[1].lower(), scheme[2]
            if kind in _PACKAGE_SCHEMES and "/" in rest:
                package, path = rest.split("/", 1)
                starts = [PurePosixPath(), PurePosixPath(package)]
            elif _RELATIVE_FILE.fullmatch(path):
                path = rest
            else:
                raise refusal("neither a relative path nor package://", inside)
        if path.startswith(("/", "~")):
            raise refusal("a path from outside the folder", inside)
        missing: AssetError | None = None
        for start in starts:
            inner = os.path.normpath(str(start / path))
            if inner == ".." or inner.startswith("../") or os.path.isabs(inner):
                raise refusal("leads out of the folder", inside)
            try:
                real = os.path.realpath(self.root / inner, strict=True)
            except (OSError, ValueError) as error:
                missing = missing or refusal(
                    f"no such file below {self.root}: {_reason(error)}",
                    "Put the file there, or correct its name.",
                )
                continue
            if os.path.commonpath((real, self.root)) != str(self.root):
                raise refusal("a link that leads out of the folder", inside)
            return PurePosixPath(os.path.relpath(real, self.root)).as_posix()
        assert missing is not None
        raise missing

    def read(self, name: str, kind: Kind, *, mentioned_in: str = "", element: str = "") -> bytes:
        """The bytes of a file below the folder.

        Args:
            name: as for ``locate``.
            kind: what it is to be; decides the largest size.
            mentioned_in: as for ``locate``.
            element: as for ``locate``.

        Raises:
            AssetError: as for ``locate``; or no regular file, empty, too large, unreadable.
        """
        inner = self.locate(name, mentioned_in=mentioned_in, element=element)
        file = self.label(inner)
        limit = MAX_BYTES[kind]
        try:
            # Opening a device can have effects, and opening a pipe can wait for ever.
            _check_regular(os.lstat(file), file)
            flags = os.O_RDONLY
            for extra in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY"):
                flags |= getattr(os, extra, 0)
            with open(os.open(file, flags), "rb") as stream:
                status = os.fstat(stream.fileno())
                _check_regular(status, file)
                if status.st_size <= limit:
                    data = stream.read(limit + 1)
                    size = len(data)
                else:
                    data, size = b"", status.st_size
        except OSError as error:
            raise AssetError(
                file, f"cannot be read: {_reason(error)}", remedy="Check its permissions."
            ) from None
        if size > limit:
            raise AssetError(
                file,
                f"larger than {limit // _MB} MB",
                value=f"{size} bytes",
                remedy="Simplify it or split the object.",
            )
        if not data:
            raise AssetError(file, "an empty file", remedy="Copy it again from its source.")
        self.bytes_read += size
        if self.bytes_read > MAX_TOTAL_BYTES:
            raise AssetError(
                self.root,
                f"the object's files exceed {MAX_TOTAL_BYTES // _MB} MB",
                remedy="Simplify its meshes and pictures.",
            )
        return data


def refuse_archive(name: str, *, file: str = "", element: str = "") -> None:
    """Refuses the name of an archive.

    Raises:
        AssetError: the name ends like an archive's.
    """
    if name.lower().endswith(_ARCHIVES):
        raise AssetError(
            file or name,
            "an archive",
            element=element,
            value=name,
            remedy="Unpack it first and give the folder or the description in it.",
        )


def _check_regular(status: os.stat_result, file: str) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise AssetError(file, "not a regular file", remedy="Put a plain file in its place.")


def _reason(error: OSError | ValueError) -> str:
    return getattr(error, "strerror", None) or str(error)
