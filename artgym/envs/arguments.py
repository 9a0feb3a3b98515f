"""Checks of what an environment is made with, reset with and given to do.

Each raises one error that names the argument, what came, and what would do.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from artgym.errors import InvalidArgumentError, UnknownNameError
from artgym.objects import catalog

Array = NDArray[np.floating]

#: Options of ``reset``.
RESET_OPTIONS = ("object_id", "open_fraction")


def require_known(kind: str, name: object, known: object) -> None:
    """Refuses a name that is not one of ``known``, a sequence or a ``Literal``.

    Raises:
        UnknownNameError: names the nearest.
    """
    names: Sequence[str] = get_args(known) or known  # type: ignore[assignment]
    if name not in names:
        raise UnknownNameError(kind, name, names)


def require_between(name: str, value: object, low: float, high: float) -> None:
    """Refuses what is not a whole number from ``low`` to ``high``.

    Raises:
        InvalidArgumentError: says so.
    """
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not (whole and low <= value <= high):
        raise InvalidArgumentError(
            f"{name}={value!r}: expected a whole number from {low:,} to {high:,}"
        )


def require_camera_size(size: Any) -> tuple[int, int]:
    """The size (width, height) of pictures, pixels.

    Raises:
        InvalidArgumentError: it is not two numbers of 16 to 4096.
    """
    try:
        width, height = (int(side) for side in size)
    except (TypeError, ValueError):
        width = height = 0
    if not (16 <= width <= 4096 and 16 <= height <= 4096):
        raise InvalidArgumentError(
            f"camera_size={size!r}: expected (width, height) of 16 to 4096 pixels"
        )
    return width, height


def require_camera_poses(poses: Any) -> Array:
    """Camera poses (n, 4, 4).

    Raises:
        InvalidArgumentError: one is not a rigid transform.
    """
    try:
        Ts = np.asarray(poses, dtype=float).reshape(-1, 4, 4)
    except (TypeError, ValueError):
        Ts = np.full((1, 4, 4), np.nan)
    R = Ts[:, :3, :3]
    rigid = (
        len(Ts) > 0
        and np.all(np.abs(Ts) < 1e3)
        and np.allclose(R @ np.swapaxes(R, 1, 2), np.eye(3), atol=1e-4)
        and np.all(np.linalg.det(R) > 0)
        and np.allclose(Ts[:, 3], [0.0, 0.0, 0.0, 1.0])
    )
    if not rigid:
        raise InvalidArgumentError(
            f"camera_poses={poses!r}: expected T_world_camera, one or more rigid transforms (4, 4) "
            "with OpenCV axes (z looks forward), in metres"
        )
    return Ts


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
    if objects is not None:
        ids = (objects,) if isinstance(objects, str) else tuple(objects)
        for object_id in ids:
            catalog.load(object_id).joint_of(target_part)
    else:
        names = categories
        if names is None:
            every = {n: len(catalog.category(n).parts) for n in catalog.categories_with(split)}
            names = tuple(name for name, parts in every.items() if target_part < parts)
            if not names:
                raise InvalidArgumentError(
                    f"target_part={target_part}: no category has more than "
                    f"{max(every.values()) - 1} movable parts"
                )
        names = (names,) if isinstance(names, str) else tuple(names)
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


def read_options(options: Mapping[str, Any]) -> tuple[str | None, float | None]:
    """Object id and open fraction asked of ``reset``; None where nothing was.

    Raises:
        UnknownNameError: an option that does not exist.
        InvalidArgumentError: an open fraction outside [0, 1].
    """
    for key in options:
        require_known("reset option", key, RESET_OPTIONS)
    asked = options.get("open_fraction")
    try:
        fraction = None if asked is None else float(asked)
    except (TypeError, ValueError):
        fraction = np.nan
    if fraction is not None and not 0.0 <= fraction <= 1.0:
        raise InvalidArgumentError(
            f"options['open_fraction']={asked!r}: expected 0 (closed) to 1 (open)"
        )
    return options.get("object_id"), fraction


def read_action(action: Any, size: int) -> list[float]:
    """An action as ``size`` numbers in [-1, 1]; values beyond are clipped.

    Raises:
        InvalidArgumentError: it has another shape or is not finite.
    """
    try:
        numbers = np.asarray(action, dtype=float)
    except (TypeError, ValueError) as error:
        raise InvalidArgumentError(
            f"action={action!r}: expected {size} numbers in [-1, 1]"
        ) from error
    if numbers.shape != (size,):
        raise InvalidArgumentError(
            f"action of shape {numbers.shape}: expected ({size},), one number in [-1, 1] for each "
            "entry of the action space"
        )
    values: list[float] = numbers.tolist()
    if not all([-np.inf < value < np.inf for value in values]):
        raise InvalidArgumentError(f"action={values}: expected finite numbers in [-1, 1]")
    return [min(1.0, max(-1.0, value)) for value in values]
