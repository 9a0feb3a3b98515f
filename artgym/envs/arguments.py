"""Checks of what an environment is made with, reset with and given to do.

Each raises one error that names the argument, what came, and what would do.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from artgym.errors import InvalidArgumentError, UnknownNameError
from artgym.objects import catalog

Array = NDArray[np.floating]

#: Options of ``reset``.
RESET_OPTIONS = ("object_id", "open_fraction")
#: Most cameras that see a scene.
MAX_CAMERAS = 16
#: No hand, camera or observed point is farther out along an axis, metres.
FARTHEST_PLACE = 10.0


def require_known(kind: str, name: object, known: object) -> None:
    """Refuses a name that is not one of ``known``, a sequence or a ``Literal``.

    Raises:
        UnknownNameError: names the nearest.
    """
    names: Sequence[str] = get_args(known) or known  # type: ignore[assignment]
    if not isinstance(name, str) or name not in names:
        raise UnknownNameError(kind, name, names)


def require_between(name: str, value: Any, low: int, high: int) -> int:
    """A whole number from ``low`` to ``high``.

    Raises:
        InvalidArgumentError: it is anything else.
    """
    if not (is_whole(value) and low <= value <= high):
        raise InvalidArgumentError(
            f"{name}={value!r}: expected a whole number from {low:,} to {high:,}"
        )
    return int(value)


def is_whole(value: object) -> bool:
    """Whether a value is a whole number by type; True and False are not."""
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def require_flag(name: str, value: object) -> bool:
    """True or False.

    Raises:
        InvalidArgumentError: it is anything else.
    """
    if not isinstance(value, bool | np.bool_):
        raise InvalidArgumentError(f"{name}={value!r}: expected True or False")
    return bool(value)


def require_names(name: str, value: Any) -> tuple[str, ...]:
    """Names given one by one, or a single one.

    Raises:
        InvalidArgumentError: it is anything else.
    """
    if isinstance(value, str):
        return (value,)
    # An iterator could be read only once, and not by a copy of the environment.
    if not isinstance(value, Iterable) or isinstance(value, Iterator):
        raise InvalidArgumentError(f"{name}={value!r}: expected a name or a sequence of names")
    names = tuple(value)
    for each in names:
        if not isinstance(each, str):
            raise InvalidArgumentError(f"{name}={value!r}: expected names, but {each!r} is none")
    return names


def require_range(name: str, value: Any, low: int, high: int, meaning: str) -> tuple[int, int]:
    """Two whole numbers from ``low`` to ``high``.

    Args:
        name: of the argument.
        value: what came.
        low: least of either number.
        high: most of either number.
        meaning: what they are, for the error.

    Raises:
        InvalidArgumentError: it is anything else.
    """
    try:
        first, second = value
        if all(is_whole(each) and low <= each <= high for each in (first, second)):
            return int(first), int(second)
    except (TypeError, ValueError):
        pass
    raise InvalidArgumentError(f"{name}={value!r}: expected {meaning} of {low} to {high}")


def plain(value: Any) -> Any:
    """An argument by its value: arrays and lists become tuples that can be compared and kept."""
    if isinstance(value, np.ndarray | np.generic):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return tuple(plain(each) for each in value)
    return value


def require_camera_size(size: Any) -> tuple[int, int]:
    """The size (width, height) of pictures, pixels.

    Raises:
        InvalidArgumentError: it is not two whole numbers of 16 to 4096.
    """
    return require_range("camera_size", size, 16, 4096, "(width, height)")


def require_camera_poses(poses: Any) -> Array:
    """Camera poses (n, 4, 4).

    Raises:
        InvalidArgumentError: one is not a rigid transform or too far out, or they are too many.
    """
    try:
        given = np.asarray(poses)
        numbers = given if given.dtype.kind in "fiu" else np.empty(0)
        Ts = numbers.astype(float).reshape(-1, 4, 4)
    except (TypeError, ValueError):
        Ts = np.empty((0, 4, 4))
    if not _are_rigid(Ts):
        raise InvalidArgumentError(
            f"camera_poses={poses!r}: expected T_world_camera, one or more rigid transforms (4, 4) "
            "with OpenCV axes (z looks forward), in metres"
        )
    if len(Ts) > MAX_CAMERAS:
        raise InvalidArgumentError(
            f"camera_poses: {len(Ts)} of them; expected 1 to {MAX_CAMERAS} cameras"
        )
    if np.abs(Ts[:, :3, 3]).max() > FARTHEST_PLACE:
        raise InvalidArgumentError(
            f"camera_poses={poses!r}: expected cameras within {FARTHEST_PLACE} m along each axis"
        )
    return Ts


def _are_rigid(Ts: Array) -> bool:
    R = Ts[:, :3, :3]
    return bool(
        len(Ts) > 0
        and np.all(np.abs(Ts) < 1e3)
        and np.allclose(R @ np.swapaxes(R, 1, 2), np.eye(3), atol=1e-4)
        and np.all(np.linalg.det(R) > 0)
        and np.allclose(Ts[:, 3], [0.0, 0.0, 0.0, 1.0])
    )


def drawable_ids(
    categories: Sequence[str] | None,
    split: str,
    objects: Sequence[str] | None,
    target_part: int,
) -> tuple[str, ...]:
    """Ids to draw from, each known and, where it is named, with the asked part.

    Raises:
        UnknownNameError: an unknown name.
        InvalidArgumentError: a category or an object has no such part, or nothing is left.
    """
    require_between("target_part", target_part, 1, 99)
    require_known("split", split, catalog.SPLITS)
    if objects is not None:
        ids = require_names("objects", objects)
        for object_id in ids:
            catalog.load(object_id).joint_of(target_part)
    else:
        if categories is None:
            every = {n: len(catalog.category(n).parts) for n in catalog.categories_with(split)}
            names = tuple(name for name, parts in every.items() if target_part < parts)
            if not names:
                raise InvalidArgumentError(
                    f"target_part={target_part}: no category has more than "
                    f"{max(every.values()) - 1} movable parts"
                )
        else:
            names = require_names("categories", categories)
        for name in names:
            parts = catalog.category(name).parts
            if target_part >= len(parts):
                raise InvalidArgumentError(
                    f"target_part={target_part}: category {name!r} has the movable parts "
                    + ", ".join(f"{i} ({part})" for i, part in enumerate(parts) if i)
                )
        ids = tuple(i for name in names for i in catalog.object_ids(name, split))  # type: ignore[arg-type]
    if not ids:
        raise InvalidArgumentError(
            "no objects to draw from: give categories or objects, or leave both out."
        )
    return ids


def most_parts(object_ids: Sequence[str]) -> int:
    """The most parts that objects of these kinds can have, the base included."""
    names = {object_id.partition("/")[0] for object_id in object_ids}
    known = [len(catalog.CATEGORIES[name].parts) for name in names if name in catalog.CATEGORIES]
    others = [i for i in object_ids if i.partition("/")[0] not in catalog.CATEGORIES]
    return max(known + [catalog.load(i).num_parts for i in others])


def read_options(options: Any) -> tuple[str | None, float | None]:
    """Object id and open fraction asked of ``reset``; None where nothing was.

    Raises:
        UnknownNameError: an option that does not exist.
        InvalidArgumentError: no options at all, or a value that is none.
    """
    if not isinstance(options, Mapping):
        raise InvalidArgumentError(
            f"options={options!r}: expected a mapping with " + " or ".join(RESET_OPTIONS)
        )
    for key in options:
        require_known("reset option", key, RESET_OPTIONS)
    object_id: Any = options.get("object_id")
    fraction: Any = options.get("open_fraction")
    if object_id is not None and not isinstance(object_id, str):
        raise InvalidArgumentError(
            f"options['object_id']={object_id!r}: expected the id of an object, as 'laptop/0012'"
        )
    if fraction is not None:
        is_number = is_whole(fraction) or isinstance(fraction, float | np.floating)
        if not (is_number and 0.0 <= fraction <= 1.0):
            raise InvalidArgumentError(
                f"options['open_fraction']={fraction!r}: expected 0 (closed) to 1 (open)"
            )
        fraction = float(fraction)
    return object_id, fraction


def require_seed(seed: Any) -> int | None:
    """A seed for ``reset``; None for none.

    Raises:
        InvalidArgumentError: it is not a whole number of 0 or more.
    """
    if seed is None:
        return None
    if not (is_whole(seed) and seed >= 0):
        raise InvalidArgumentError(f"seed={seed!r}: expected a whole number of 0 or more, or None")
    return int(seed)


def read_action(action: Any, size: int) -> list[float]:
    """An action as ``size`` numbers in [-1, 1]; values beyond are clipped.

    Raises:
        InvalidArgumentError: it has another shape or is not finite.
    """
    try:
        given = np.asarray(action)
    except Exception as error:
        # Whatever an array-like object makes of being asked for its numbers.
        raise InvalidArgumentError(
            f"action={action!r}: expected {size} numbers in [-1, 1]"
        ) from error
    if given.dtype.kind not in "fiub":
        raise InvalidArgumentError(f"action={action!r}: expected {size} numbers in [-1, 1]")
    if given.shape != (size,):
        raise InvalidArgumentError(
            f"action of shape {given.shape}: expected ({size},), one number in [-1, 1] for each "
            "entry of the action space"
        )
    exact = given if given.dtype.char in "fd" else given.astype(float)
    values: list[float] = exact.tolist()
    if min(values) >= -1.0 and max(values) <= 1.0 and math.isfinite(sum(values)):
        return values
    if not all([math.isfinite(value) for value in values]):
        raise InvalidArgumentError(f"action={values}: expected finite numbers in [-1, 1]")
    return [min(1.0, max(-1.0, value)) for value in values]
