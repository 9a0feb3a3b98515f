"""The data released with the paper: one HDF5 file an image, and lists of image ids.

The layout is the authors'; it is only read here. It carries no version and no checksums: damage to
a number that still fits its field cannot be found.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import h5py
import numpy as np
from numpy.typing import DTypeLike, NDArray

from artgym.datasets.lazy import LazySequence
from artgym.datasets.sample import AFFORDANCE_NO, AFFORDANCE_YES, JOINT_NONE, JOINT_REVOLUTE
from artgym.errors import DamagedFileError, InvalidArgumentError, UnknownNameError
from artgym.files import UNREADABLE, dataset_array
from artgym.geometry.rotations import matrix_from_quaternion

#: The authors' lists of images. Their validation images are their test images.
Split = Literal["train", "test"]

#: Shapes of the fields, alternatives side by side; equal letters are equal sizes within one file.
_SHAPES: dict[str, tuple[tuple[int | str, ...], ...]] = {
    "joint_type": (("K",),),
    "urdf_id": ((), (1,)),
    "camcs_per_point": (("M", 3), ("M", 6)),
    "seg_per_point": (("M",),),
    "npcs_per_point": (("M", 3),),
    "naocs_per_point": (("M", 3),),
    "joint_cls_per_point": (("M",),),
    "axis_per_point": (("M", 3),),
    "unitvec_per_point": (("M", 3),),
    "heatmap_per_point": (("M",),),
    "grasp_cls_per_point": (("M",),),
    "quats_per_point": (("M", 4),),
}

#: A point is a pixel of 640 x 480, a part has an 8-bit index: a file that claims more is damaged.
_MOST = {"M": 2**20, "K": 2**8 - 1}
#: HDF5 unpacks a chunk as a whole, however little of it is asked for.
_MAX_CHUNK_BYTES = 2**26
#: A million ids.
_MAX_LIST_BYTES = 2**24

#: How far a quaternion's length may be from 1; beyond, it is no rounding.
_LENGTH_TOLERANCE = 1e-3

_REMEDY = (
    "Unpack or download it again; if that does not help, it is not in the layout that "
    "artgym.datasets.authors reads."
)
_NAME_PATTERN = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,199}")
#: An id, and perhaps the ending of the image or annotation that the authors name instead.
_LINE_PATTERN = re.compile(rf"({_NAME_PATTERN.pattern})(?:\.[A-Za-z0-9]{{1,20}}){{0,4}}")


@dataclass(frozen=True, kw_only=True, eq=False)
class AuthorsSample:
    """One object in one image of the authors' data. M points seen, K parts (base = 0).

    The camera frame is read as OpenCV. A joint has the index of the part it moves; its axis lies
    in the object's normalised coordinates (NAOCS), where the authors' evaluation uses it.

    The authors' grasp frame has columns (forward, left, up = approach). It is that of Where2Act,
    on which their data generation builds: the pose of a Panda hand, whose fingers move along y.
    Their left is therefore read as the closing direction, and (forward, left, up) is this
    package's (x, y = closing direction, z = approach) as it stands. That is a reading of the code;
    the data do not name the closing direction. Half a turn about z is the same grasp.

    Attributes:
        image_id: the file's name without ".h5".
        urdf_id: number of the object.
        points_camera: float32 (M, 3), metres.
        normals_camera: float32 (M, 3), as stored; None where the file has none.
        part: uint8 (M,), part index of each point.
        npcs: float32 (M, 3): the point normalised about its own part's centre.
        naocs: float32 (M, 3): the same about the object's centre, the object in rest state.
        joint: uint8 (M,): the joint each point is near, 0 where there is none.
        joint_axis_naocs: float32 (M, 3): direction of that joint's axis, as stored.
        direction_to_joint_naocs: float32 (M, 3): from the point to that axis, at a right angle, as
            stored; without meaning for prismatic joints.
        joint_nearness: float32 (M,): 1 - distance to that axis / radius. The authors' evaluation
            has 0.2 as radius, in NAOCS units.
        affordance: uint8 (M,): 1 where a grasp succeeded, 0 elsewhere.
        R_camera_grasps: float32 (M, 3, 3): one successful grasp where ``affordance`` is 1; a point
            without a rotation in the file has zeros.
        joint_type: int8 (K,): -1 none (base), 0 prismatic, 1 revolute.
    """

    image_id: str
    urdf_id: int
    points_camera: NDArray[np.float32]
    normals_camera: NDArray[np.float32] | None
    part: NDArray[np.uint8]
    npcs: NDArray[np.float32]
    naocs: NDArray[np.float32]
    joint: NDArray[np.uint8]
    joint_axis_naocs: NDArray[np.float32]
    direction_to_joint_naocs: NDArray[np.float32]
    joint_nearness: NDArray[np.float32]
    affordance: NDArray[np.uint8]
    R_camera_grasps: NDArray[np.float32]
    joint_type: NDArray[np.int8]

    @property
    def num_parts(self) -> int:
        """K, the base included."""
        return len(self.joint_type)


def read_authors_file(path: str | os.PathLike[str]) -> AuthorsSample:
    """Reads one of the authors' files; datasets beyond those of the layout are left alone.

    Raises:
        DamagedFileError: the file is missing, cut short or not what it should be; the message
            names the field and the value.
    """
    path = Path(path)
    with _named_damage(path):
        # The files are only read, so that they need no lock.
        with h5py.File(path, "r", locking=False) as file:
            arrays = _arrays(file)
        joint_type = _whole(arrays, "joint_type", JOINT_NONE, JOINT_REVOLUTE, np.int8)
        if joint_type[0] != JOINT_NONE:
            raise DamagedFileError(
                f"joint_type[0], the base's, should be {JOINT_NONE}, got {joint_type[0]}"
            )
        last_part = len(joint_type) - 1
        points = _floats(arrays, "camcs_per_point")
        affordance = _whole(arrays, "grasp_cls_per_point", AFFORDANCE_NO, AFFORDANCE_YES, np.uint8)
        return AuthorsSample(
            image_id=path.stem,
            urdf_id=int(_whole(arrays, "urdf_id", 0, 2**31 - 1, np.int64).item()),
            points_camera=points[:, :3].copy(),
            normals_camera=points[:, 3:].copy() if points.shape[1] == 6 else None,
            part=_whole(arrays, "seg_per_point", 0, last_part, np.uint8),
            npcs=_floats(arrays, "npcs_per_point"),
            naocs=_floats(arrays, "naocs_per_point"),
            joint=_whole(arrays, "joint_cls_per_point", 0, last_part, np.uint8),
            joint_axis_naocs=_floats(arrays, "axis_per_point"),
            direction_to_joint_naocs=_floats(arrays, "unitvec_per_point"),
            joint_nearness=_floats(arrays, "heatmap_per_point"),
            affordance=affordance,
            R_camera_grasps=_grasp_rotations(_floats(arrays, "quats_per_point"), affordance),
            joint_type=joint_type,
        )


@contextmanager
def _named_damage(path: Path) -> Iterator[None]:
    """Turns whatever goes wrong inside into one error that names ``path``."""
    try:
        # To open a pipe would wait for a writer.
        if not path.is_file():
            raise DamagedFileError("it is not a file" if path.exists() else "it is missing")
        yield
    except UNREADABLE as error:
        raise DamagedFileError(f"{path} cannot be used: {error}. {_REMEDY}") from error


def _arrays(file: h5py.File) -> dict[str, NDArray[Any]]:
    """The arrays of the layout; nothing is read whose shape is wrong."""
    sizes: dict[str, int] = {}
    arrays = {}
    for name, shapes in _SHAPES.items():
        item = None
        if isinstance(file.get(name, getlink=True), h5py.HardLink):
            item = file[name]
        if not isinstance(item, h5py.Dataset) or item.is_virtual:
            raise DamagedFileError(f"{name} is missing, or leads out of the file")
        fitting = [shape for shape in shapes if _fits(item.shape, shape, sizes)]
        if not fitting:
            wanted = " or ".join(_shape_text(shape, sizes) for shape in shapes)
            raise DamagedFileError(f"{name} should have shape {wanted}, got {item.shape}")
        for symbol, size in zip(fitting[0], item.shape, strict=True):
            if isinstance(symbol, str):
                sizes[symbol] = size
        if item.chunks and math.prod(item.chunks) * item.dtype.itemsize > _MAX_CHUNK_BYTES:
            raise DamagedFileError(f"{name} claims chunks of shape {item.chunks}")
        arrays[name] = dataset_array(name, item.id)
    return arrays


def _fits(shape: object, wanted: tuple[int | str, ...], sizes: dict[str, int]) -> bool:
    # A dataset that holds nothing has None for a shape.
    if not isinstance(shape, tuple) or len(shape) != len(wanted):
        return False
    for size, symbol in zip(shape, wanted, strict=True):
        if isinstance(symbol, str) and symbol not in sizes:
            if not 1 <= size <= _MOST[symbol]:
                return False
        elif size != (sizes[symbol] if isinstance(symbol, str) else symbol):
            return False
    return True


def _shape_text(shape: tuple[int | str, ...], sizes: dict[str, int]) -> str:
    """The shape, with what is known of its letters: "(1 <= M <= 1048576, 3)" or "(50, 3)"."""
    texts = []
    for symbol in shape:
        if isinstance(symbol, str):
            texts.append(str(sizes.get(symbol, f"1 <= {symbol} <= {_MOST[symbol]}")))
        else:
            texts.append(str(symbol))
    return f"({', '.join(texts)})"


def _floats(arrays: dict[str, NDArray[Any]], name: str) -> NDArray[np.float32]:
    """A field of finite numbers in single precision."""
    array = arrays[name]
    if array.dtype.kind != "f":
        raise DamagedFileError(f"{name} should be floating point, got {array.dtype}")
    # A signalling NaN is invalid already when it is converted or compared.
    with np.errstate(over="ignore", invalid="ignore"):
        floats = array.astype(np.float32)
    if (misfit := _first(~np.isfinite(floats))) is not None:
        raise DamagedFileError(
            f"{_place(name, misfit)} should be finite in single precision, got {array[misfit]}"
        )
    return floats


def _whole(
    arrays: dict[str, NDArray[Any]], name: str, low: int, high: int, dtype: DTypeLike
) -> NDArray[Any]:
    """A field of whole numbers in [low, high]; the authors' tools may have made floats of them."""
    array = arrays[name]
    with np.errstate(invalid="ignore"):
        fits = (array >= low) & (array <= high) & (array == np.trunc(array))
    if (misfit := _first(~fits)) is not None:
        raise DamagedFileError(
            f"{_place(name, misfit)} should be a whole number in [{low}, {high}], "
            f"got {array[misfit]}"
        )
    return array.astype(dtype)


def _first(mask: NDArray[np.bool_]) -> tuple[int, ...] | None:
    """Index of the first True, None where there is none."""
    found = np.argwhere(mask)
    return tuple(found[0].tolist()) if len(found) else None


def _place(name: str, index: tuple[int, ...]) -> str:
    return f"{name}{list(index)}" if index else name


def _grasp_rotations(
    quaternions_xyzw: NDArray[np.float32], affordance: NDArray[np.uint8]
) -> NDArray[np.float32]:
    """Grasp rotations (M, 3, 3) from the authors' quaternions; see ``AuthorsSample``."""
    lengths = np.linalg.norm(quaternions_xyzw.astype(float), axis=1)
    is_absent = (lengths == 0) & (affordance == AFFORDANCE_NO)
    misfit = _first(~is_absent & (np.abs(lengths - 1.0) > _LENGTH_TOLERANCE))
    if misfit is not None:
        raise DamagedFileError(
            f"{_place('quats_per_point', misfit)} should have length 1, or 0 where "
            f"grasp_cls_per_point is {AFFORDANCE_NO}, got {quaternions_xyzw[misfit].tolist()} "
            f"where it is {affordance[misfit]}"
        )
    quaternions_wxyz = np.roll(quaternions_xyzw, 1, axis=1)
    quaternions_wxyz[is_absent] = [1.0, 0.0, 0.0, 0.0]
    rotations = matrix_from_quaternion(quaternions_wxyz).astype(np.float32)
    rotations[is_absent] = 0.0
    return rotations


class AuthorsFolder(LazySequence[AuthorsSample]):
    """The files of one of the authors' lists, each read when asked for.

    No file stays open between two samples, so that it can be pickled, forked and shared between
    threads. Samples have the list's order; an id that is listed twice counts once.

    Args:
        root: the folder with ``{category}/train.txt`` and ``{category}/test.txt``.
        category: name of a folder in ``root``, "laptop".
        split: which list.
        folder: where the ``{id}.h5`` lie if not in ``{root}/{category}``. The authors' own code
            has them in another root, in ``{category}_new``.

    Raises:
        DamagedFileError: the list or a listed file is missing, or the list cannot be used.
        InvalidArgumentError: ``category`` is no plain name.
        UnknownNameError: there is no such split.
    """

    def __init__(
        self,
        root: str | os.PathLike[str],
        category: str,
        split: Split,
        *,
        folder: str | os.PathLike[str] | None = None,
    ) -> None:
        if not _NAME_PATTERN.fullmatch(category):
            raise InvalidArgumentError(
                f"category {category!r} cannot be used: expected the name of a folder in {root}, "
                "letters, digits, '_' and '-'."
            )
        if split not in get_args(Split):
            raise UnknownNameError("split", split, get_args(Split))
        list_path = Path(root) / category / f"{split}.txt"
        self.folder = Path(root) / category if folder is None else Path(folder)
        self.image_ids = _listed_ids(list_path)
        try:
            present = set(os.listdir(self.folder))
        except OSError as error:
            raise DamagedFileError(
                f"{self.folder} cannot be listed: {error}. Pass folder=..., the folder that holds "
                "the .h5 files."
            ) from error
        absent = [name for name in self.image_ids if f"{name}.h5" not in present]
        if absent:
            raise DamagedFileError(
                f"{self.folder / absent[0]}.h5 is missing; {len(absent)} of the "
                f"{len(self.image_ids)} files listed in {list_path} are. Pass folder=..., the "
                "folder that holds the .h5 files, or unpack the data again."
            )

    def __len__(self) -> int:
        """The number of samples."""
        return len(self.image_ids)

    def _item(self, position: int) -> AuthorsSample:
        return read_authors_file(self.folder / f"{self.image_ids[position]}.h5")


def _listed_ids(path: Path) -> tuple[str, ...]:
    """The ids of a list, one a line; what follows the first dot is dropped, as the authors do."""
    with _named_damage(path):
        if (size := path.stat().st_size) > _MAX_LIST_BYTES:
            raise DamagedFileError(f"it should have {_MAX_LIST_BYTES} bytes at most, got {size}")
        ids: dict[str, None] = {}
        for number, line in enumerate(path.read_text("utf-8").splitlines(), start=1):
            if not (text := line.strip()):
                continue
            if not (found := _LINE_PATTERN.fullmatch(text)):
                raise DamagedFileError(
                    f"line {number} should be an image id of letters, digits, '_' and '-', "
                    f"got {text[:80]!r}"
                )
            ids[found[1]] = None
        if not ids:
            raise DamagedFileError("it lists no image ids")
        return tuple(ids)
