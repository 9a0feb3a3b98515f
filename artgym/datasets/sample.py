"""What pictures and samples are.

A picture is one RGB-D view of objects on a table; a sample is everything that is known about the
points of one of them that are seen in it. Frames: ``camera`` is OpenCV; ``level`` shares its
origin but has z up and x in the viewing direction projected on the horizontal; ``part`` is the
link's frame; ``object`` is the root link's frame. Grasp columns are (x, y = closing direction,
z = approach).
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.errors import InvalidArgumentError
from artgym.geometry.grasps import NUM_CANDIDATES, candidates_of_part

#: Codes of ``Sample.joint_type``.
JOINT_NONE, JOINT_PRISMATIC, JOINT_REVOLUTE = -1, 0, 1

#: Codes of ``Sample.affordance``.
AFFORDANCE_NO, AFFORDANCE_YES, AFFORDANCE_UNKNOWN = 0, 1, 255


@dataclass(frozen=True, kw_only=True, eq=False)
class Sample:
    """One object in a picture. M points seen, K parts (base = 0), G labelled surface points.

    Attributes:
        object_id: catalogue id, "laptop/0012".
        box: float32 (4,): left, top, width and height of what is seen of it, pixels, as in COCO.
        R_level_camera: float32 (3, 3), from the table's normal.
        points_camera: float32 (M, 3), metres; where the picture's depth is noisy, so are they.
        normals_camera: float16 (M, 3), unit, towards the camera, of planes through the points
            around each: ``geometry.normals.surface_normals``.
        colors: uint8 (M, 3).
        part: uint8 (M,), part index of each point.
        npcs: float32 (M, 3) in [0, 1]: the point normalised in its own part's canonical box.
        naocs: float32 (M, 3) in [0, 1]: the same in the object's box, the object in rest state.
        affordance: uint8 (M,): 1 where some try carried here succeeds, 0 where none of the tries
            at the labelled point did, 255 where nothing is known.
        grasp_row: int32 (M,): the nearest labelled surface point of the same part, an index into
            the four arrays below, -1 where none lies near.
        grasp_bits: uint8 (G, C / 8): for each of the C = ``NUM_CANDIDATES`` tries of
            ``geometry.grasps.candidates_of_part`` whether it succeeds at the point and around it,
            ``np.unpackbits(..., bitorder="little")``.
        grasp_points_part: float32 (G, 3): the labelled points, frame of their part, metres.
        grasp_normals_part: float32 (G, 3): their outward unit normals, same frame.
        grasp_part: uint8 (G,): the part each labelled point lies on.
        T_camera_parts: float32 (K, 4, 4).
        R_object_canonical: float32 (3, 3): the axes of all canonical boxes in the frames of the
            object and its parts, which coincide at rest.
        part_centers: float32 (K, 3) and part_scales: float32 (K,): NPCS is
            ``(R_object_canonical.T @ p - center) / scale + 0.5`` of a point p in its part's frame,
            the scale being the canonical box's diagonal.
        T_camera_object: float32 (4, 4), the root link.
        T_object_rest_parts: float32 (K, 4, 4): part frames in the object's rest state.
        object_center: float32 (3,) and object_scale: float32 (), the same for NAOCS.
        joint_type: int8 (K,): -1 none (base), 0 prismatic, 1 revolute.
        joint_axis_camera: float32 (K, 3), unit, opening direction positive; zeros for the base.
        joint_pivot_camera: float32 (K, 3), metres.
        open_fraction: float32 (K,), in [0, 1].
    """

    object_id: str
    box: NDArray[np.float32]
    R_level_camera: NDArray[np.float32]
    points_camera: NDArray[np.float32]
    normals_camera: NDArray[np.float16]
    colors: NDArray[np.uint8]
    part: NDArray[np.uint8]
    npcs: NDArray[np.float32]
    naocs: NDArray[np.float32]
    affordance: NDArray[np.uint8]
    grasp_row: NDArray[np.int32]
    grasp_bits: NDArray[np.uint8]
    grasp_points_part: NDArray[np.float32]
    grasp_normals_part: NDArray[np.float32]
    grasp_part: NDArray[np.uint8]
    T_camera_parts: NDArray[np.float32]
    R_object_canonical: NDArray[np.float32]
    part_centers: NDArray[np.float32]
    part_scales: NDArray[np.float32]
    T_camera_object: NDArray[np.float32]
    T_object_rest_parts: NDArray[np.float32]
    object_center: NDArray[np.float32]
    object_scale: NDArray[np.float32]
    joint_type: NDArray[np.int8]
    joint_axis_camera: NDArray[np.float32]
    joint_pivot_camera: NDArray[np.float32]
    open_fraction: NDArray[np.float32]

    @property
    def num_parts(self) -> int:
        """K, the base included."""
        return len(self.joint_type)

    def successful_tries(self) -> NDArray[np.bool_]:
        """(G, C): whether each try at each labelled point succeeded."""
        bits = np.unpackbits(self.grasp_bits, axis=1, count=NUM_CANDIDATES, bitorder="little")
        return bits.astype(bool)

    def tried_rotations(self, points: ArrayLike | slice = slice(None)) -> NDArray[np.floating]:
        """(g, C, 3, 3): the rotation of each try at g of the labelled points, object frame.

        Args:
            points: which, (g,) indices; all when left out.
        """
        R_camera_object = self.T_camera_object[:3, :3].astype(float)
        R_object_parts = R_camera_object.T @ self.T_camera_parts[:, :3, :3]
        chosen = points if isinstance(points, slice) else np.asarray(points, dtype=np.int64)
        return candidates_of_part(
            self.grasp_normals_part[chosen], R_object_parts[self.grasp_part[chosen]]
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """One RGB-D view of objects on a table.

    Attributes:
        rgb: uint8 (H, W, 3).
        depth: float32 (H, W), metres along z, 0 where nothing was seen.
        instance_mask: uint8 (H, W): index in ``samples`` + 1, 0 elsewhere.
        part_mask: uint8 (H, W): part index + 1, counted in each object, 0 elsewhere.
        intrinsics: float32 (3, 3).
        samples: the objects seen.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    instance_mask: NDArray[np.uint8]
    part_mask: NDArray[np.uint8]
    intrinsics: NDArray[np.float32]
    samples: tuple[Sample, ...]


#: The array fields of a sample and of a picture, in order: what a file holds of them.
SAMPLE_ARRAYS: tuple[str, ...] = tuple(f.name for f in fields(Sample) if f.name != "object_id")
PICTURE_ARRAYS: tuple[str, ...] = tuple(f.name for f in fields(Picture) if f.name != "samples")


def level_from_camera(up_camera: ArrayLike) -> NDArray[np.float64]:
    """``R_level_camera`` (3, 3) from the table's upward normal (3,) in the camera frame.

    Raises:
        InvalidArgumentError: the camera looks straight up or down, so that level's x is undefined.
    """
    z = np.asarray(up_camera, dtype=float)
    z = z / np.linalg.norm(z)
    x: NDArray[np.float64] = np.array([0.0, 0.0, 1.0]) - z[2] * z
    if np.linalg.norm(x) < 1e-3:
        raise InvalidArgumentError(
            f"up_camera={z.tolist()} is parallel to the viewing direction: the level frame has no "
            "forward axis. Tilt the camera."
        )
    x = x / np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])
