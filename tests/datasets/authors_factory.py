"""Files of random content in the layout of the paper's released data, for tests of its reader."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import h5py
import numpy as np


def random_authors_arrays(
    seed: int, *, num_points: int = 50, num_parts: int = 3, normals: bool = True
) -> dict[str, np.ndarray]:
    """The datasets of one file, with the right shapes and no meaning.

    Every third point has no grasp; of these, every other has a zero quaternion.
    """
    rng = np.random.default_rng(seed)
    index = np.arange(num_points)
    quaternions_xyzw = rng.normal(size=(num_points, 4))
    quaternions_xyzw /= np.linalg.norm(quaternions_xyzw, axis=1, keepdims=True)
    quaternions_xyzw[index % 6 == 0] = 0.0

    def directions() -> np.ndarray:
        vectors = rng.normal(size=(num_points, 3))
        return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)

    points = rng.normal(size=(num_points, 3))
    return {
        "camcs_per_point": np.hstack([points, directions()]) if normals else points,
        "seg_per_point": rng.integers(0, num_parts, num_points),
        "npcs_per_point": rng.random((num_points, 3)),
        "naocs_per_point": rng.random((num_points, 3)),
        "joint_cls_per_point": rng.integers(0, num_parts, num_points),
        "axis_per_point": directions(),
        "unitvec_per_point": directions(),
        "heatmap_per_point": rng.random(num_points),
        "quats_per_point": quaternions_xyzw,
        "grasp_cls_per_point": (index % 3 != 0).astype(float),
        "joint_type": np.array([-1, *rng.integers(0, 2, num_parts - 1)], dtype=float),
        "urdf_id": np.array(10040 + seed),
    }


def write_authors_file(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """One file; arrays are gzipped where HDF5 can."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with h5py.File(path, "w") as file:
        for name, array in arrays.items():
            compression = "gzip" if np.ndim(array) else None
            file.create_dataset(name, data=array, compression=compression)


def write_authors_list(path: Path, lines: Iterable[str]) -> None:
    """One list of image ids."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(f"{line}\n" for line in lines))
