"""Files that are either whole or absent, and the folders of shards made of them.

Every file is written to a temporary name in its own folder, synced and renamed, so that a killed
process leaves no half file under a final name. Equal content gives equal bytes. A shard is one
HDF5 file in which every byte of content lies under a checksum of HDF5 or of zlib; nothing is
pickled. ``docs/data_format.md`` describes the layout for readers in other languages.
"""

from __future__ import annotations

import errno
import hashlib
import json
import math
import operator
import os
import re
import secrets
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, cast

import h5py
import numpy as np
from numpy.typing import NDArray

from artgym.errors import (
    ArtgymError,
    DamagedFileError,
    FileNotWrittenError,
    InvalidArgumentError,
)

#: Of manifests and files of arrays: raised by one with each change of the layout that an older
#: reader cannot read. Other formats count their own.
SCHEMA_VERSION = 1

ARRAYS_FORMAT = "artgym-arrays"
FOLDER_FORMAT = "artgym-folder"

MANIFEST_NAME = "manifest.json"

#: No array of ours comes near: a file that claims more is damaged or hostile.
MAX_ARRAY_BYTES = 2**31

#: Arrays up to this size lie uncompressed in the object header, under its checksum.
_INLINE_BYTES = 1024
#: gzip level: these files are few and shipped.
_ARRAYS_LEVEL = 9

_TEMPORARY_PREFIX, _TEMPORARY_SUFFIX = ".artgym-", ".tmp"
_NAME_PATTERN = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,199}")
DAMAGE_REMEDY = (
    "Copy it again, or repeat the command that made the folder: it replaces damaged files."
)

#: What may be raised where an HDF5 file is read that is not what it should be.
UNREADABLE = (
    AttributeError,
    DamagedFileError,
    KeyError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
)

# --- Whole files ---------------------------------------------------------------------------------


def write_file_whole(path: str | os.PathLike[str], content: bytes | Callable[[Path], None]) -> None:
    """Writes a file such that ``path`` holds all of it or what was there before.

    Args:
        path: the final name; missing parent folders are made.
        content: the bytes, or a function that writes the file at the temporary path it is given.

    Raises:
        FileNotWrittenError: the system refused; the message names ``path`` and the remedy.
    """
    path = Path(path)
    name = f"{_TEMPORARY_PREFIX}{path.name}.{os.getpid()}-{secrets.token_hex(4)}{_TEMPORARY_SUFFIX}"
    temporary = path.parent / name
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        try:
            if callable(content):
                content(temporary)
            else:
                temporary.write_bytes(content)
            with open(temporary, "rb+") as file:
                os.fsync(file.fileno())
            os.replace(temporary, path)
        finally:
            temporary.unlink(missing_ok=True)
        _sync_folder(path.parent)
    except OSError as error:
        if isinstance(error, ArtgymError):
            raise
        reason = error.strerror or str(error)
        raise FileNotWrittenError(
            f"cannot write {path}: {reason}. {_writing_remedy(error.errno)} "
            "Files already written are unharmed."
        ) from error


def _writing_remedy(code: int | None) -> str:
    match code:
        case errno.ENOSPC | errno.EDQUOT:
            return "Free some space and run the same command again."
        case errno.EACCES | errno.EPERM | errno.EROFS:
            return "Choose a folder that you may write to."
        case errno.ENOTDIR | errno.EEXIST | errno.EISDIR:
            return "Choose another path: a file stands where a folder should be, or the reverse."
        case _:
            return "Check the disk and the path, then run the same command again."


def _sync_folder(folder: Path) -> None:
    """Makes a rename in ``folder`` last through a power cut (Windows has no such call)."""
    if os.name != "posix":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def remove_stale_temporaries(folder: str | os.PathLike[str]) -> None:
    """Removes what killed processes left half written in ``folder``."""
    for path in Path(folder).glob(f"{_TEMPORARY_PREFIX}*{_TEMPORARY_SUFFIX}"):
        path.unlink(missing_ok=True)


def file_sha256(path: str | os.PathLike[str]) -> str:
    """The checksum of a file, in hexadecimal."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


# --- Shards --------------------------------------------------------------------------------------


def write_arrays(
    path: str | os.PathLike[str],
    arrays: Mapping[str, NDArray[Any]],
    attributes: Mapping[str, Any] | None = None,
) -> None:
    """Writes named arrays and JSON attributes to one file.

    Args:
        path: the file.
        arrays: booleans, integers or floats; a slash in a name makes a group ("0012/bits").
        attributes: values that JSON knows.

    Raises:
        InvalidArgumentError: a name, a dtype or an attribute cannot be stored.
        FileNotWrittenError: the system refused.
    """

    def fill(file: h5py.File) -> None:
        put_text(file, "attributes", _json_text("attributes", attributes or {}))
        for name in sorted(arrays):
            array = np.asarray(arrays[name])
            if array.dtype.kind not in "biuf":
                raise InvalidArgumentError(
                    f"array {name!r} for {path} has dtype {array.dtype}: expected booleans, "
                    "integers or floats."
                )
            parts = name.split("/")
            # A name that is taken already is a prefix of this one: "a" beside "a/b".
            if not all(map(_NAME_PATTERN.fullmatch, parts)) or any(
                isinstance(file.get("/".join(parts[:depth])), h5py.Dataset)
                for depth in range(1, len(parts))
            ):
                raise InvalidArgumentError(
                    f"array name {name!r} for {path} cannot be stored: expected letters, digits, "
                    "'.', '_', '-' between slashes, and no other array's name before a slash."
                )
            group = file.require_group("/".join(parts[:-1])) if len(parts) > 1 else file
            put_array(group, parts[-1], array, level=_ARRAYS_LEVEL)

    write_file_whole(path, hdf5_image(ARRAYS_FORMAT, fill))


def read_arrays(path: str | os.PathLike[str]) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Reads what ``write_arrays`` wrote: the arrays, sorted by name, and the attributes.

    Raises:
        DamagedFileError: the file is missing, cut short or not what it should be.
        InvalidArgumentError: it was written with another schema version.
    """
    with opened(path, ARRAYS_FORMAT) as file:
        arrays: dict[str, NDArray[Any]] = {}

        def visit(name: str, item: h5py.Dataset | h5py.Group) -> None:
            if isinstance(item, h5py.Dataset):
                arrays[name] = dataset_array(name, item.id)

        file.visititems(visit)
        return dict(sorted(arrays.items())), json.loads(get_text(file, "attributes"))


def hdf5_image(
    file_format: str, fill: Callable[[h5py.File], None], version: int = SCHEMA_VERSION
) -> bytes:
    """The bytes of an HDF5 file that ``fill`` fills.

    Built in memory, because HDF5 answers a full disk with files that it can no longer close. The
    fixed version bounds keep the bytes the same under later HDF5 releases, and bring checksums of
    the metadata.
    """
    # The name reaches no disk and no byte; HDF5 refuses two open files of one name.
    with h5py.File(
        f"image-{secrets.token_hex(8)}",
        "w",
        driver="core",
        backing_store=False,
        block_size=2**24,
        libver=("v110", "v110"),
        track_times=False,
    ) as file:
        put_text(file, "format", file_format)
        file.attrs["schema_version"] = np.int32(version)
        fill(file)
        file.flush()
        return file.id.get_file_image()


def put_array(group: h5py.Group, name: str, array: NDArray[Any], *, level: int) -> None:
    """Writes an array, gzipped at ``level`` where it is large; equal arrays give equal bytes.

    Level 0 leaves it as it is, in one piece: that is read four times as fast.
    """
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_obj_track_times(False)
    if level and array.nbytes <= _INLINE_BYTES:
        properties.set_layout(h5py.h5d.COMPACT)
    elif level:
        properties.set_chunk(array.shape)
        if array.dtype.itemsize > 1:
            properties.set_shuffle()
        properties.set_deflate(level)
    dataset = h5py.h5d.create(
        group.id,
        name.encode(),
        h5py.h5t.py_create(array.dtype, logical=True),
        h5py.h5s.create_simple(array.shape) if array.ndim else h5py.h5s.create(h5py.h5s.SCALAR),
        properties,
    )
    # HDF5 places a chunk when its dataset is closed: not when Python lets go of it, which a
    # profiler that holds this frame, as each worker of dask has one, puts off.
    with closing(dataset):
        if array.size:
            dataset.write(h5py.h5s.ALL, h5py.h5s.ALL, np.require(array, requirements="C"))


def put_text(item: h5py.Group, name: str, text: str) -> None:
    """Text of fixed length: the variable kind lies in a heap that no checksum covers."""
    encoded = text.encode()
    dtype = h5py.string_dtype("utf-8", max(len(encoded), 1))
    item.attrs.create(name, np.array(encoded, dtype=dtype))


def get_text(item: h5py.Group, name: str) -> str:
    """Reads what ``put_text`` wrote."""
    return bytes(cast(bytes, item.attrs[name])).decode()


@contextmanager
def opened(
    path: str | os.PathLike[str], file_format: str, version: int = SCHEMA_VERSION
) -> Iterator[h5py.File]:
    """One of our HDF5 files; whatever goes wrong inside becomes one error that names it."""
    try:
        # Files never change once they have their name, so that they need no lock; and some network
        # file systems have none to give.
        with h5py.File(path, "r", locking=False) as file:
            if get_text(file, "format") != file_format:
                raise DamagedFileError(f"its format is not {file_format!r}")
            found = int(cast(np.integer, file.attrs["schema_version"]))
            if found != version:
                raise InvalidArgumentError(_version_message(path, found, version))
            yield file
    except InvalidArgumentError:
        raise
    except FileNotFoundError as error:
        raise DamagedFileError(f"{path} is missing. {DAMAGE_REMEDY}") from error
    except UNREADABLE as error:
        raise DamagedFileError(f"{path} is damaged: {error}. {DAMAGE_REMEDY}") from error


def _version_message(path: str | os.PathLike[str], found: object, version: int) -> str:
    return (
        f"{path} has schema version {found}, this artgym reads {version}. Make the data "
        "again with this version, or install the version that made it."
    )


def dataset_array(name: str, item: h5py.h5d.DatasetID) -> NDArray[Any]:
    """An array as it is stored; refuses what is no plain array, or claims to be huge.

    The identifier, and not the ``h5py.Dataset`` around it, whose comfort costs more than reading.
    """
    dtype, properties = item.dtype, item.get_create_plist()
    is_virtual = properties.get_layout() == h5py.h5d.VIRTUAL
    if dtype.kind not in "biuf" or is_virtual or properties.get_external_count():
        raise DamagedFileError(f"{name} is not a plain array of numbers")
    size = math.prod(item.shape) * dtype.itemsize
    if size > MAX_ARRAY_BYTES:
        raise DamagedFileError(f"{name} claims {size} bytes")
    array = np.empty(item.shape, dtype)
    if size:
        item.read(h5py.h5s.ALL, h5py.h5s.ALL, array)
    return array


def _json_text(what: str, value: Mapping[str, Any]) -> str:
    try:
        return json.dumps(value, sort_keys=True, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise InvalidArgumentError(
            f"{what} must hold only what JSON knows (text, finite numbers, lists, dicts): {error}."
        ) from error


# --- Folders -------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class ShardEntry:
    """One finished shard.

    Attributes:
        name: file name within the folder.
        sha256: checksum of the file, hexadecimal.
        bytes: its size.
        items: how many samples, or arrays, it holds.
    """

    name: str
    sha256: str
    bytes: int
    items: int

    def __post_init__(self) -> None:
        require_shard_name(self.name)
        sizes_fit = all(isinstance(size, int) and size >= 0 for size in (self.bytes, self.items))
        if not (sizes_fit and re.fullmatch("[0-9a-f]{64}", self.sha256)):
            raise InvalidArgumentError(
                f"{self} is no shard: expected sizes of 0 or more and 64 hexadecimal digits."
            )

    @classmethod
    def of(cls, path: Path, items: int) -> ShardEntry:
        """The entry of a file that was just written."""
        size = path.stat().st_size
        return cls(name=path.name, sha256=file_sha256(path), bytes=size, items=items)

    def damage(self, folder: Path) -> str | None:
        """What is wrong with the file in ``folder``, None where nothing is."""
        path = folder / self.name
        try:
            size = path.stat().st_size
            if size != self.bytes:
                return f"has {size} bytes, the manifest says {self.bytes}"
            if file_sha256(path) != self.sha256:
                return "has another checksum than the manifest says"
        except FileNotFoundError:
            return "is missing"
        except OSError as error:
            return f"cannot be read ({error.strerror})"
        return None


def require_shard_name(name: str) -> None:
    """Raises InvalidArgumentError unless ``name`` is a plain file name that a shard may have."""
    if not _NAME_PATTERN.fullmatch(name) or name == MANIFEST_NAME:
        raise InvalidArgumentError(
            f"shard name {name!r} cannot be used: expected a file name of letters, digits, '.', "
            f"'_', '-' other than {MANIFEST_NAME!r}."
        )


@dataclass(frozen=True, kw_only=True)
class Manifest:
    """What a folder of shards holds, and how it was made.

    Attributes:
        config: what the generator was given; together with a shard's name it determines the
            shard's content. JSON values.
        planned: how many shards the folder holds when finished.
        shards: the finished ones, by name.
    """

    config: dict[str, Any]
    planned: int
    shards: tuple[ShardEntry, ...] = ()

    def __post_init__(self) -> None:
        # Through JSON and back, so that a tuple equals the list read from the file.
        object.__setattr__(self, "config", json.loads(_json_text("config", self.config)))
        object.__setattr__(self, "shards", tuple(sorted(self.shards, key=lambda s: s.name)))
        names = [shard.name for shard in self.shards]
        if len(set(names)) < len(names) or len(names) > self.planned:
            raise InvalidArgumentError(
                f"manifest lists {len(names)} shards of {self.planned} planned, "
                f"{len(names) - len(set(names))} of them twice."
            )

    @property
    def num_items(self) -> int:
        """Samples, or arrays, in all finished shards."""
        return sum(shard.items for shard in self.shards)

    @property
    def is_complete(self) -> bool:
        """Whether no planned shard is missing."""
        return len(self.shards) == self.planned

    def with_shard(self, shard: ShardEntry) -> Manifest:
        """This manifest with one more finished shard."""
        return replace(self, shards=(*self.shards, shard))

    def write(self, folder: str | os.PathLike[str]) -> None:
        """Writes it to ``folder``."""
        content = {"format": FOLDER_FORMAT, "schema_version": SCHEMA_VERSION, **asdict(self)}
        text = json.dumps(content, indent=1, sort_keys=True, allow_nan=False)
        write_file_whole(Path(folder) / MANIFEST_NAME, f"{text}\n".encode())

    @classmethod
    def read(cls, folder: str | os.PathLike[str]) -> Manifest:
        """Reads the manifest of ``folder``.

        Raises:
            DamagedFileError: it is missing or not a manifest.
            InvalidArgumentError: it was written with another schema version.
        """
        path = Path(folder) / MANIFEST_NAME
        try:
            content = json.loads(path.read_bytes())
            if content["format"] != FOLDER_FORMAT:
                raise DamagedFileError(f"its format is not {FOLDER_FORMAT!r}")
            version = content["schema_version"]
            if version == SCHEMA_VERSION:
                return cls(
                    config=dict(content["config"]),
                    planned=operator.index(content["planned"]),
                    shards=tuple(ShardEntry(**shard) for shard in content["shards"]),
                )
        except FileNotFoundError as error:
            raise DamagedFileError(
                f"{path} is missing: {folder} is not a folder of shards. Name the folder that the "
                "generator wrote."
            ) from error
        except (OSError, KeyError, TypeError, ValueError, RecursionError, ArtgymError) as error:
            raise DamagedFileError(
                f"{path} is damaged: {type(error).__name__}: {error}. Restore it from a copy, or "
                "delete the folder and make it again."
            ) from error
        raise InvalidArgumentError(_version_message(path, version, SCHEMA_VERSION))

    def require_config(self, folder: str | os.PathLike[str], config: Mapping[str, Any]) -> None:
        """Raises InvalidArgumentError unless ``folder``, which holds this, fits ``config``."""
        wanted = json.loads(_json_text("config", config))
        if differences := _differences("config", self.config, wanted):
            shown = "; ".join(differences[:8])
            more = f"; and {len(differences) - 8} more" if len(differences) > 8 else ""
            raise InvalidArgumentError(
                f"{folder} was made with another configuration: {shown}{more}. Give an empty "
                "folder, or repeat the settings the folder was made with."
            )


def _differences(name: str, present: Any, wanted: Any) -> list[str]:
    """One line for each place where two JSON values differ."""
    if isinstance(present, dict) and isinstance(wanted, dict):
        lines = []
        for key in sorted(present.keys() | wanted.keys()):
            if key not in present:
                lines.append(f"{name}.{key} is absent in the folder, {wanted[key]!r} asked")
            elif key not in wanted:
                lines.append(f"{name}.{key} is {present[key]!r} in the folder, absent asked")
            else:
                lines.extend(_differences(f"{name}.{key}", present[key], wanted[key]))
        return lines
    if present == wanted:
        return []
    return [f"{name} is {present!r} in the folder, {wanted!r} asked"]
