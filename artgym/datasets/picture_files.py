"""Shards of pictures: HDF5 files with one group a picture, and folders of them.

``docs/data_format.md`` describes the layout for readers in other languages.
"""

from __future__ import annotations

import math
import os
from abc import abstractmethod
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import h5py
import numpy as np
from numpy.typing import NDArray

from artgym.datasets.lazy import LazySequence
from artgym.datasets.sample import PICTURE_ARRAYS, SAMPLE_ARRAYS, Picture, Sample
from artgym.errors import DamagedFileError, InvalidArgumentError
from artgym.files import (
    DAMAGE_REMEDY,
    Manifest,
    dataset_array,
    get_text,
    hdf5_image,
    opened,
    put_array,
    put_text,
    write_file_whole,
)
from artgym.geometry.grasps import NUM_CANDIDATES

PICTURES_FORMAT = "artgym-pictures"
#: Raised by one with each change that an older reader cannot read.
PICTURES_VERSION = 2

#: gzip level of a picture's arrays, which are many and written once each; those of its samples are
#: smaller, and read again and again.
_LEVEL, _SAMPLE_LEVEL = 1, 0

#: Shapes of arrays; equal letters are equal sizes within one sample, or one picture.
_SHAPES: dict[str, tuple[int | str, ...]] = {
    "rgb": ("H", "W", 3),
    "depth": ("H", "W"),
    "instance_mask": ("H", "W"),
    "part_mask": ("H", "W"),
    "intrinsics": (3, 3),
    "box": (4,),
    "R_level_camera": (3, 3),
    "points_camera": ("M", 3),
    "normals_camera": ("M", 3),
    "colors": ("M", 3),
    "part": ("M",),
    "npcs": ("M", 3),
    "naocs": ("M", 3),
    "affordance": ("M",),
    "grasp_row": ("M",),
    "grasp_bits": ("G", math.ceil(NUM_CANDIDATES / 8)),
    "grasp_points_part": ("G", 3),
    "grasp_normals_part": ("G", 3),
    "grasp_part": ("G",),
    "T_camera_parts": ("K", 4, 4),
    "R_object_canonical": (3, 3),
    "part_centers": ("K", 3),
    "part_scales": ("K",),
    "T_camera_object": (4, 4),
    "T_object_rest_parts": ("K", 4, 4),
    "object_center": (3,),
    "object_scale": (),
    "joint_type": ("K",),
    "joint_axis_camera": ("K", 3),
    "joint_pivot_camera": ("K", 3),
    "open_fraction": ("K",),
}


def _annotated_dtype(annotation: Any) -> np.dtype[Any]:
    """The dtype inside an ``NDArray[...]`` annotation."""
    _, dtype = get_args(annotation)
    return np.dtype(get_args(dtype)[0])


_DTYPES = {
    name: _annotated_dtype(annotation)
    for kind, names in ((Picture, PICTURE_ARRAYS), (Sample, SAMPLE_ARRAYS))
    for name, annotation in get_type_hints(kind).items()
    if name in names
}


def write_pictures(path: str | os.PathLike[str], pictures: Sequence[Picture]) -> None:
    """Writes pictures to one shard.

    Raises:
        InvalidArgumentError: an array has the wrong dtype or shape, or is not finite; the message
            names the picture, the sample and the field.
        FileNotWrittenError: the system refused.
    """

    def put(
        group: h5py.Group, value: Picture | Sample, names: Sequence[str], what: str, level: int
    ) -> None:
        arrays = {name: np.asarray(getattr(value, name)) for name in names}
        if misfit := _misfit(arrays):
            raise InvalidArgumentError(f"{what} cannot be written to {path}: {misfit}.")
        for name, array in arrays.items():
            put_array(group, name, array, level=level)

    def fill(file: h5py.File) -> None:
        counts = np.array([len(picture.samples) for picture in pictures], dtype=np.int32)
        put_array(file, _COUNTS, counts, level=_LEVEL)
        groups = []
        for i, picture in enumerate(pictures):
            group = file.create_group(_picture_name(i))
            put(group, picture, PICTURE_ARRAYS, f"picture {i}", _LEVEL)
            for k, sample in enumerate(picture.samples):
                subgroup = group.create_group(_object_name(k))
                put_text(subgroup, "object_id", sample.object_id)
                what = f"sample {k} of picture {i} ({sample.object_id})"
                put(subgroup, sample, SAMPLE_ARRAYS, what, _SAMPLE_LEVEL)
                groups.append(subgroup)
        put_array(file, _PLACES, _places(groups), level=_LEVEL)
        ids = [sample.object_id.encode() for picture in pictures for sample in picture.samples]
        longest = max(map(len, ids), default=0)
        padded = b"".join(object_id.ljust(longest, b"\0") for object_id in ids)
        rows = np.frombuffer(padded, np.uint8).reshape(len(ids), longest)
        put_array(file, _IDS, rows, level=_LEVEL)

    write_file_whole(path, hdf5_image(PICTURES_FORMAT, fill, PICTURES_VERSION))


def read_pictures(path: str | os.PathLike[str]) -> list[Picture]:
    """Reads all pictures of one shard.

    Raises:
        DamagedFileError: the file is missing, cut short or not what it should be.
        InvalidArgumentError: it was written with another schema version.
    """
    with opened(path, PICTURES_FORMAT, PICTURES_VERSION) as file:
        return [_get_picture(file, i, int(n)) for i, n in enumerate(_object_counts(file))]


#: The root's array of the number of objects in each picture.
_COUNTS = "objects"

#: The root's array of where each sample's arrays lie in the file, see ``_places``; and of the
#: samples' ids, UTF-8 filled up with zeros.
_PLACES, _IDS = "sample_places", "sample_ids"

#: Sizes that the shapes of a sample's arrays are made of.
_SIZES = tuple(
    dict.fromkeys(s for name in SAMPLE_ARRAYS for s in _SHAPES[name] if isinstance(s, str))
)


def _places(groups: Sequence[h5py.Group]) -> NDArray[np.int64]:
    """For each sample, the sizes of ``_SIZES``, then the offset of each array, -1 of an empty one.

    HDF5 takes some 40 microseconds an array to find it; with these a sample is one piece of the
    file.
    """
    places = np.full((len(groups), len(_SIZES) + len(SAMPLE_ARRAYS)), -1, dtype=np.int64)
    for row, group in zip(places, groups, strict=True):
        sizes: dict[str, int] = {}
        for column, name in enumerate(SAMPLE_ARRAYS, start=len(_SIZES)):
            found = h5py.h5d.open(group.id, name.encode())
            for symbol, size in zip(_SHAPES[name], found.shape, strict=True):
                if isinstance(symbol, str):
                    sizes[symbol] = size
            offset = found.get_offset()
            row[column] = -1 if offset is None else offset
        row[: len(_SIZES)] = [sizes[symbol] for symbol in _SIZES]
    return places


def _sample_at(path: Path, object_id: str, place: NDArray[np.int64]) -> Sample:
    """The sample whose arrays lie at a row of ``_places``.

    Raises:
        DamagedFileError: they do not.
    """
    sizes = dict(zip(_SIZES, place[: len(_SIZES)].tolist(), strict=True))
    spans: dict[str, tuple[int, int, tuple[int, ...]]] = {}
    for name, offset in zip(SAMPLE_ARRAYS, place[len(_SIZES) :].tolist(), strict=True):
        shape = tuple(sizes[s] if isinstance(s, str) else s for s in _SHAPES[name])
        spans[name] = offset, math.prod(shape), shape
    stored = [(o, o + n * _DTYPES[name].itemsize) for name, (o, n, _) in spans.items() if n]
    first, last = min(start for start, _ in stored), max(stop for _, stop in stored)
    try:
        with path.open("rb") as file:
            file.seek(first)
            piece = file.read(last - first)
    except (OSError, ValueError, MemoryError) as error:
        raise DamagedFileError(f"{path} cannot be read ({error}). {DAMAGE_REMEDY}") from error
    if min(place[: len(_SIZES)]) < 0 or len(piece) < last - first:
        raise DamagedFileError(f"{path}: {_PLACES!r} leads out of the file. {DAMAGE_REMEDY}")
    arrays = {}
    for name, (offset, count, shape) in spans.items():
        start = offset - first if count else 0
        array = np.frombuffer(piece, _DTYPES[name], count, start).reshape(shape)
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            raise DamagedFileError(f"{path}: {name} holds values that are not finite.")
        # What lies in a file lies at any byte.
        arrays[name] = array.copy()
    return Sample(object_id=object_id, **arrays)


def _picture_name(index: int) -> str:
    return f"{index:06d}"


def _object_name(index: int) -> str:
    return f"object_{index:03d}"


def _misfit(arrays: Mapping[str, NDArray[Any]]) -> str | None:
    """What keeps ``arrays`` from being a sample or a picture, None where nothing does."""
    sizes: dict[str, int] = {}
    for name, array in arrays.items():
        symbols = _SHAPES[name]
        if array.dtype != _DTYPES[name]:
            return f"{name} should be {_DTYPES[name]}, got {array.dtype}"
        # zip is allowed to cut short: the comparison below sees the number of axes.
        for symbol, size in zip(symbols, array.shape, strict=False):
            if isinstance(symbol, str):
                sizes.setdefault(symbol, size)
        expected = tuple(sizes.get(s, s) if isinstance(s, str) else s for s in symbols)
        if array.shape != expected:
            wanted = ", ".join(map(str, expected))
            return f"{name} should have shape ({wanted}), got {array.shape}"
        if array.dtype.kind == "f" and not np.isfinite(array).all():
            return f"{name} holds values that are not finite"
    return None


def _object_counts(file: h5py.File) -> NDArray[np.integer]:
    """How many objects each picture of a shard shows."""
    counts = _arrays(file, [_COUNTS], "the shard")[_COUNTS]
    groups = sum(1 for name in file if name not in (_COUNTS, _PLACES, _IDS))
    if counts.ndim != 1 or counts.dtype.kind != "i" or len(counts) != groups:
        raise DamagedFileError(
            f"{_COUNTS} should be {groups} integers, got {counts.shape} of {counts.dtype}"
        )
    return counts


def _arrays(group: h5py.Group, names: Sequence[str], what: str) -> dict[str, NDArray[Any]]:
    arrays = {}
    for name in names:
        # A soft or external link could lead anywhere.
        if not _is_hard_link(group, name):
            raise DamagedFileError(f"{what} has no array {name!r}")
        arrays[name] = dataset_array(name, h5py.h5d.open(group.id, name.encode()))
    return arrays


def _is_hard_link(group: h5py.Group, name: str) -> bool:
    links, key = group.id.links, name.encode()
    hard = h5py.h5l.TYPE_HARD  # pyright: ignore[reportAttributeAccessIssue]
    return bool(links.exists(key) and links.get_info(key).type == hard)


def _subgroup(group: h5py.Group, name: str) -> h5py.Group:
    if not _is_hard_link(group, name):
        raise DamagedFileError(f"there is no group {name!r} in {group.name!r}")
    found = group[name]
    if not isinstance(found, h5py.Group):
        raise DamagedFileError(f"{name!r} in {group.name!r} is no group")
    return found


def _found_samples(file: h5py.File, count: int) -> tuple[list[str], NDArray[np.int64]]:
    """Ids and ``_places`` of all samples of a shard, ``count`` of them."""
    arrays = _arrays(file, [_PLACES, _IDS], "the shard")
    places, ids = arrays[_PLACES], arrays[_IDS]
    if places.shape != (count, len(_SIZES) + len(SAMPLE_ARRAYS)) or places.dtype != np.int64:
        raise DamagedFileError(f"{_PLACES} is {places.dtype} {places.shape}, for {count} samples")
    if ids.ndim != 2 or len(ids) != count or ids.dtype != np.uint8:
        raise DamagedFileError(f"{_IDS} is {ids.dtype} {ids.shape}, for {count} samples")
    return [row.tobytes().rstrip(b"\0").decode() for row in ids], places


def _get_picture(file: h5py.File, index: int, count: int) -> Picture:
    group = _subgroup(file, _picture_name(index))
    arrays = _arrays(group, PICTURE_ARRAYS, f"picture {index}")
    if misfit := _misfit(arrays):
        raise DamagedFileError(f"picture {index}: {misfit}")
    return Picture(**arrays, samples=tuple(_get_sample(file, index, k) for k in range(count)))


#: What stands in for arrays that shards of before did not have.
_DEFAULTS: dict[str, NDArray[Any]] = {"R_object_canonical": np.eye(3, dtype=np.float32)}


def _get_sample(file: h5py.File, picture: int, index: int) -> Sample:
    group = _subgroup(_subgroup(file, _picture_name(picture)), _object_name(index))
    what = f"sample {index} of picture {picture}"
    is_there = {name: name not in _DEFAULTS or name in group for name in SAMPLE_ARRAYS}
    arrays = _arrays(group, [name for name in SAMPLE_ARRAYS if is_there[name]], what)
    arrays |= {name: _DEFAULTS[name].copy() for name in SAMPLE_ARRAYS if not is_there[name]}
    if misfit := _misfit(arrays):
        raise DamagedFileError(f"{what}: {misfit}")
    return Sample(object_id=get_text(group, "object_id"), **arrays)


T = TypeVar("T")


class _ShardFolder(LazySequence[T]):
    """Pieces of shards; see ``SampleFolder`` for the arguments and errors."""

    def __init__(self, folder: str | os.PathLike[str], *, allow_incomplete: bool = False) -> None:
        self.folder = Path(folder)
        self.manifest = Manifest.read(folder)
        if not (self.manifest.is_complete or allow_incomplete):
            raise InvalidArgumentError(
                f"{folder} holds {len(self.manifest.shards)} of {self.manifest.planned} shards. "
                "Repeat the command that makes it, or pass allow_incomplete=True."
            )
        for shard in self.manifest.shards:
            path = self.folder / shard.name
            size = path.stat().st_size if path.is_file() else None
            if size != shard.bytes:
                found = "it is missing" if size is None else f"it has {size}"
                raise DamagedFileError(
                    f"{path} is damaged: expected {shard.bytes} bytes, {found}. {DAMAGE_REMEDY}"
                )
        self._verified: set[str] = set()
        # Index of the first piece of each shard, and one past the last piece of all.
        self._starts = [0, *accumulate(self._lengths())]

    @abstractmethod
    def _lengths(self) -> list[int]:
        """How many pieces each shard holds."""

    @abstractmethod
    def _get(self, file: h5py.File, index: int, shard: int) -> T:
        """A piece of an open shard, counted in that shard."""

    def __len__(self) -> int:
        """How many there are."""
        return self._starts[-1]

    def _item(self, position: int) -> T:
        shard = bisect_right(self._starts, position) - 1
        with opened(self._verified_path(shard), PICTURES_FORMAT, PICTURES_VERSION) as file:
            return self._get(file, position - self._starts[shard], shard)

    def _verified_path(self, shard: int) -> Path:
        entry = self.manifest.shards[shard]
        path = self.folder / entry.name
        if entry.name not in self._verified:
            if damage := entry.damage(self.folder):
                raise DamagedFileError(f"{path} {damage}. {DAMAGE_REMEDY}")
            self._verified.add(entry.name)
        return path


class PictureFolder(_ShardFolder[Picture]):
    """The pictures of a folder of shards; see ``SampleFolder`` for its arguments and errors."""

    def _lengths(self) -> list[int]:
        return [shard.items for shard in self.manifest.shards]

    def _get(self, file: h5py.File, index: int, shard: int) -> Picture:
        del shard
        return _get_picture(file, index, int(_object_counts(file)[index]))


class SampleFolder(_ShardFolder[Sample]):
    """The samples of a folder of shards: every object of every picture, without the pictures.

    No file stays open between two reads, so that it can be pickled, forked and shared between
    threads. Sizes are checked at once, the checksum of a shard when it is first read.

    Args:
        folder: where ``manifest.json`` lies.
        allow_incomplete: take what is there of a folder whose making has not finished.

    Raises:
        DamagedFileError: the manifest or a shard is missing or damaged.
        InvalidArgumentError: another schema version, or shards are still to be made.
    """

    def _lengths(self) -> list[int]:
        #: Index of the first sample of each picture, a list a shard.
        self._firsts: list[list[int]] = []
        #: Ids and ``_places`` of the samples of a shard, once one of them was read.
        self._found: dict[int, tuple[list[str], NDArray[np.int64]]] = {}
        for shard in range(len(self.manifest.shards)):
            path = self.folder / self.manifest.shards[shard].name
            with opened(path, PICTURES_FORMAT, PICTURES_VERSION) as file:
                self._firsts.append([0, *accumulate(_object_counts(file).tolist())])
        return [firsts[-1] for firsts in self._firsts]

    def _item(self, position: int) -> Sample:
        shard = bisect_right(self._starts, position) - 1
        if shard not in self._found:
            with opened(self._verified_path(shard), PICTURES_FORMAT, PICTURES_VERSION) as file:
                if not _is_hard_link(file, _PLACES):
                    # A shard of an earlier version, which does not say.
                    return self._get(file, position - self._starts[shard], shard)
                self._found[shard] = _found_samples(file, self._firsts[shard][-1])
        ids, places = self._found[shard]
        index = position - self._starts[shard]
        return _sample_at(self._verified_path(shard), ids[index], places[index])

    def _get(self, file: h5py.File, index: int, shard: int) -> Sample:
        firsts = self._firsts[shard]
        picture = bisect_right(firsts, index) - 1
        return _get_sample(file, picture, index - firsts[picture])
