"""What a piece of code touches: Python's own audit events, and files as the kernel sees them."""

from __future__ import annotations

import ctypes
import os
import struct
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

#: Events of Python that an import of an object has no reason to cause.
FORBIDDEN_PREFIXES = (
    "ctypes.",
    "ftplib.",
    "http.",
    "os.chdir",
    "os.chmod",
    "os.exec",
    "os.fork",
    "os.kill",
    "os.link",
    "os.posix_spawn",
    "os.putenv",
    "os.spawn",
    "os.startfile",
    "os.symlink",
    "os.system",
    "pickle.find_class",
    "shutil.",
    "smtplib.",
    "socket.",
    "subprocess.Popen",
    "urllib.Request",
    "webbrowser.",
)

_IN_ACCESS, _IN_OPEN, _IN_NONBLOCK = 0x1, 0x20, 0o4000


class AuditLog:
    """Files opened and other things done by this process's Python code while it is listening.

    A hook cannot be taken away again: make one of these a process.
    """

    def __init__(self) -> None:
        self._opened: list[str] | None = None
        self._events: list[str] = []
        sys.addaudithook(self._hear)

    def _hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self._opened is None:
            return
        if event == "open":
            path = arguments[0]
            if isinstance(path, bytes):
                path = os.fsdecode(path)
            # Numbers are files that are open already.
            if isinstance(path, str):
                self._opened.append(path)
        elif event.startswith(FORBIDDEN_PREFIXES):
            self._events.append(f"{event} {arguments!r:.100}")

    @contextmanager
    def listening(self) -> Iterator[tuple[list[str], list[str]]]:
        """Paths opened, and forbidden events, until the block ends."""
        self._opened, self._events = [], []
        try:
            yield self._opened, self._events
        finally:
            self._opened = None


class OpenWatch:
    """Whether anybody, native code included, opens or reads files below some folders (Linux)."""

    def __init__(self, folders: Iterable[Path]) -> None:
        self._libc = ctypes.CDLL(None, use_errno=True)
        self._descriptor = self._libc.inotify_init1(_IN_NONBLOCK)
        self._folders: dict[int, Path] = {}
        for folder in folders:
            watch = self._libc.inotify_add_watch(
                self._descriptor, os.fsencode(folder), _IN_ACCESS | _IN_OPEN
            )
            if self._descriptor < 0 or watch < 0:
                raise OSError(ctypes.get_errno(), f"cannot watch {folder}")
            self._folders[watch] = folder

    def opened(self) -> set[str]:
        """Files opened since the last call."""
        found = set()
        while True:
            try:
                data = os.read(self._descriptor, 65536)
            except BlockingIOError:
                return found
            at = 0
            while at < len(data):
                watch, _, _, length = struct.unpack_from("iIII", data, at)
                name = data[at + 16 : at + 16 + length].rstrip(b"\0")
                if name:
                    found.add(str(self._folders[watch] / os.fsdecode(name)))
                at += 16 + length

    def close(self) -> None:
        """Ends the watch."""
        os.close(self._descriptor)
