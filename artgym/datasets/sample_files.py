"""Shards of samples: HDF5 files with one group a sample, and folders of them.

``docs/data_format.md`` describes the layout for readers in other languages.
"""

from __future__ import annotations

import math
import operator
import os
from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from itertools import accumulate
from pathlib import Path
from typing import Any, cast, get_args, get_type_hints, overload

import h5py
import numpy as np
from numpy.typing import NDArray

from artgym.datasets.sample import ARRAY_FIELDS, Sample
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

SAMPLES_FORMAT = "artgym-samples"

#: gzip level: samples are many and written once each.
_SAMPLES_LEVEL = 1

#: Shapes of a sample's arrays; equal letters are equal sizes within one sample.
_SAMPLE_SHAPES: dict[str, tuple[int | str, ...]] = {
    "rgb": ("H", "W", 3),
    "depth": ("H", "W"),
    "part_mask": ("H", "W"),
    "intrinsics": (3, 3),
    "R_level_camera": (3, 3),
    "points_camera": ("M", 3),
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


_SAMPLE_DTYPES = {
    name: _annotated_dtype(annotation)
    for name, annotation in get_type_hints(Sample).items()
    if name in ARRAY_FIELDS
}


def write_samples(path: str | os.PathLike[str], samples: Iterable[Sample]) -> None:
    """Writes samples to one shard.

    Raises:
        InvalidArgumentError: an array has the wrong dtype or shape, or is not finite; the message
            names the sample and the field.
        FileNotWrittenError: the system refused.
    """

    def fill(file: h5py.File) -> None:
        for index, sample in enumerate(samples):
            arrays = {name: np.asarray(getattr(sample, name)) for name in ARRAY_FIELDS}
            if misfit := _sample_misfit(arrays):
                raise InvalidArgumentError(
                    f"sample {index} ({sample.object_id}) cannot be written to {path}: {misfit}."
                )
            group = file.create_group(_sample_name(index))
            put_text(group, "object_id", sample.object_id)
            for name, array in arrays.items():
                put_array(group, name, array, level=_SAMPLES_LEVEL)

    write_file_whole(path, hdf5_image(SAMPLES_FORMAT, fill))


def read_samples(path: str | os.PathLike[str]) -> list[Sample]:
    """Reads all samples of one shard.

    Raises:
        DamagedFileError: the file is missing, cut short or not what it should be.
        InvalidArgumentError: it was written with another schema version.
    """
    with opened(path, SAMPLES_FORMAT) as file:
        return [_get_sample(file, index) for index in range(len(file))]


def _sample_name(index: int) -> str:
    return f"{index:06d}"


def _sample_misfit(arrays: Mapping[str, NDArray[Any]]) -> str | None:
    """What keeps ``arrays`` from being a sample, None where nothing does."""
    sizes: dict[str, int] = {}
    for name, symbols in _SAMPLE_SHAPES.items():
        array = arrays[name]
        if array.dtype != _SAMPLE_DTYPES[name]:
            return f"{name} should be {_SAMPLE_DTYPES[name]}, got {array.dtype}"
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


def _get_sample(file: h5py.File, index: int) -> Sample:
    group = cast(h5py.Group, file[_sample_name(index)])
    arrays = {}
    for name in ARRAY_FIELDS:
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise DamagedFileError(f"sample {index} has no array {name!r}")
        arrays[name] = dataset_array(name, cast(h5py.Dataset, group[name]))
    if misfit := _sample_misfit(arrays):
        raise DamagedFileError(f"sample {index}: {misfit}")
    return Sample(object_id=get_text(group, "object_id"), **arrays)


class SampleFolder(Sequence[Sample]):
    """The samples of a folder of shards, each read when asked for.

    No file stays open between two samples, so that it can be pickled, forked and shared between
    threads. Sizes are checked at once, the checksum of a shard when its first sample is read.

    Args:
        folder: where ``manifest.json`` lies.
        allow_incomplete: take what is there of a folder whose making has not finished.

    Raises:
        DamagedFileError: the manifest or a shard is missing or damaged.
        InvalidArgumentError: another schema version, or shards are still to be made.
    """

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
        # Index of the first sample of each shard, and one past the last sample of all.
        self._starts = [0, *accumulate(shard.items for shard in self.manifest.shards)]
        self._verified: set[str] = set()

    def __len__(self) -> int:
        """The number of samples."""
        return self._starts[-1]

    @overload
    def __getitem__(self, index: int) -> Sample: ...
    @overload
    def __getitem__(self, index: slice) -> list[Sample]: ...
    def __getitem__(self, index: int | slice) -> Sample | list[Sample]:
        """One sample, or the list of a slice."""
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        position = operator.index(index)
        if position < 0:
            position += len(self)
        if not 0 <= position < len(self):
            raise IndexError(f"index {index} is outside the {len(self)} samples of {self.folder}")
        number = bisect_right(self._starts, position) - 1
        shard = self.manifest.shards[number]
        path = self.folder / shard.name
        if shard.name not in self._verified:
            if damage := shard.damage(self.folder):
                raise DamagedFileError(f"{path} {damage}. {DAMAGE_REMEDY}")
            self._verified.add(shard.name)
        with opened(path, SAMPLES_FORMAT) as file:
            return _get_sample(file, position - self._starts[number])
