"""Arrays of an object's description that compare by what they hold: meshes and pictures."""

from __future__ import annotations

import abc
import hashlib
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

S = TypeVar("S", bound=np.generic)


class _Contents(abc.ABC):
    """Arrays that nobody can write to; equal contents are equal values with equal hashes."""

    @abc.abstractmethod
    def _arrays(self) -> tuple[NDArray[np.generic] | None, ...]:
        """All that is held."""

    @cached_property
    def digest(self) -> str:
        """SHA-256 of shapes, types and bytes."""
        digest = hashlib.sha256()
        for array in self._arrays():
            if array is None:
                digest.update(b"none")
            else:
                digest.update(f"{array.dtype.str} {array.shape} ".encode())
                digest.update(array.data)
        return digest.hexdigest()

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)


def _frozen(array: ArrayLike, dtype: type[S]) -> NDArray[S]:
    copy = np.array(array, dtype=dtype, order="C")
    copy.setflags(write=False)
    return copy


class TriangleMesh(_Contents):
    """Triangles of any form, closed or not.

    Args:
        vertices: (n, 3), metres.
        faces: (m, 3) indices of vertices, counter-clockwise from outside.
        uv: (n, 2) picture coordinates, v upwards, or None.
    """

    def __init__(self, vertices: ArrayLike, faces: ArrayLike, uv: ArrayLike | None = None) -> None:
        self.vertices = _frozen(vertices, np.float64)
        self.faces = _frozen(faces, np.int32)
        self.uv = None if uv is None else _frozen(uv, np.float32)

    def _arrays(self) -> tuple[NDArray[np.generic] | None, ...]:
        return self.vertices, self.faces, self.uv

    def __repr__(self) -> str:
        return f"TriangleMesh({len(self.vertices)} vertices, {len(self.faces)} faces)"


class Image(_Contents):
    """A picture (h, w, 3), uint8 sRGB."""

    def __init__(self, pixels: ArrayLike) -> None:
        self.pixels = _frozen(pixels, np.uint8)

    def _arrays(self) -> tuple[NDArray[np.generic] | None, ...]:
        return (self.pixels,)

    def __repr__(self) -> str:
        return f"Image({self.pixels.shape[1]}x{self.pixels.shape[0]})"
