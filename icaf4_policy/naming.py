"""Which is the front of an object that looks the same from behind.

A carton whose flaps are alike is the same after half a turn about the vertical, but for the names:
no picture tells its first flap from the second, nor whether the sides the flaps hang on are its
front and back or its left and right. All these descriptions are true, and a network that is told
now this one, now that one learns what lies between. Told is therefore always the same one, and it
is what predictions are compared with: the first flap and its twin are at the back and the front,
and the front is towards the camera.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from artgym.datasets.sample import JOINT_REVOLUTE, Picture, Sample

Array = NDArray[np.floating]

#: A quarter of a turn about the z axis, and half of one.
_QUARTER_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
_HALF_TURN = _QUARTER_TURN @ _QUARTER_TURN
#: Parts are alike whose boxes and axes differ by less than this share of the object's size.
_ALIKE = 0.01


def half_turn_parts(sample: Sample) -> NDArray[np.int64] | None:
    """The part (K,) that each part comes to lie on by half a turn of the object at rest.

    The turn is about the vertical axis of the base's canonical box. Compared are the parts'
    canonical boxes and joints, not their shapes.

    Returns:
        ``None`` where some part does not come to lie on one like it.
    """
    layout = _Layout.of(sample)
    turned = layout.half_turned()
    movable = range(1, sample.num_parts)
    found = [0]
    for k in movable:
        alike = [j for j in movable if turned.is_like(k, layout, j)]
        if len(alike) != 1:
            return None
        found += alike
    return np.array(found) if len(set(found)) == len(found) > 1 else None


@dataclass(frozen=True, kw_only=True, eq=False)
class _Layout:
    """Boxes and joints of K parts along the canonical axes, metres, the base's centre at 0.

    Attributes:
        centers: (K, 3) of the canonical boxes at rest; scales: (K,).
        types: (K,), codes of ``Sample.joint_type``; axes: (K, 3), unit; pivots: (K, 3).
        size: of the object.
    """

    centers: Array
    scales: Array
    types: NDArray[np.int8]
    axes: Array
    pivots: Array
    size: float

    @classmethod
    def of(cls, sample: Sample) -> _Layout:
        """That of a sample; joints are looked at where they are, as those of the base."""
        R_object_canonical = sample.R_object_canonical.astype(float)
        rests = sample.T_object_rest_parts[:, :3, 3].astype(float)
        centers = sample.part_centers.astype(float) + rests @ R_object_canonical
        T_camera_base = sample.T_camera_parts[0].astype(float)
        R_camera_canonical = T_camera_base[:3, :3] @ R_object_canonical
        pivots = (sample.joint_pivot_camera - T_camera_base[:3, 3]) @ R_camera_canonical
        return cls(
            centers=centers - centers[0],
            scales=sample.part_scales.astype(float),
            types=sample.joint_type,
            axes=sample.joint_axis_camera @ R_camera_canonical,
            pivots=pivots - sample.part_centers[0],
            size=float(sample.object_scale),
        )

    def half_turned(self) -> _Layout:
        """After half a turn about the vertical through the base's centre."""
        turned = {name: getattr(self, name) @ _HALF_TURN for name in ("centers", "axes", "pivots")}
        return replace(self, **turned)

    def is_like(self, k: int, other: _Layout, j: int) -> bool:
        """Whether part k lies where the other's part j does, and moves as that."""
        apart = [
            np.linalg.norm(self.centers[k] - other.centers[j]),
            abs(self.scales[k] - other.scales[j]),
            self.size * np.linalg.norm(self.axes[k] - other.axes[j]),
        ]
        if self.types[k] == JOINT_REVOLUTE:
            across = np.cross(self.pivots[k] - other.pivots[j], other.axes[j])
            apart.append(np.linalg.norm(across))
        return bool(self.types[k] == other.types[j] and max(apart) < _ALIKE * self.size)


def faces_camera(sample: Sample, turn: Array | None = None) -> bool:
    """Whether the front of the base's canonical box, its x side, is towards the camera.

    Args:
        sample: the object as it is seen.
        turn: ``R_canonical_turned`` (3, 3), where the question is of axes turned so.
    """
    R_object_canonical = sample.R_object_canonical.astype(float)
    front = (R_object_canonical if turn is None else R_object_canonical @ turn)[:, 0]
    T_camera_base = sample.T_camera_parts[0].astype(float)
    center = R_object_canonical @ sample.part_centers[0]
    center_camera = T_camera_base[:3, :3] @ center + T_camera_base[:3, 3]
    return bool(T_camera_base[:3, :3] @ front @ center_camera <= 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Naming:
    """What the view makes of a sample's names.

    Attributes:
        turn: ``R_canonical_named`` (3, 3), quarter turns about the z axis.
        parts: (K,), the number that each part gets; applied twice, it changes nothing.
    """

    turn: Array
    parts: NDArray[np.int64]

    @classmethod
    def of(cls, sample: Sample) -> _Naming | None:
        """That of a sample; ``None`` where names stay as they are."""
        twins = half_turn_parts(sample)
        if twins is None:
            return None
        centers = _Layout.of(sample).centers
        pairs = [(k, twin) for k, twin in enumerate(twins) if k < twin]
        across = any(_is_across(centers[k] - centers[twin]) for k, twin in pairs[:1])
        turn = _QUARTER_TURN if across else np.eye(3)
        if not faces_camera(sample, turn):
            turn = turn @ _HALF_TURN
        parts = np.arange(sample.num_parts)
        for k, twin in pairs:
            apart = (centers[k] - centers[twin]) @ turn
            is_first = apart[1] > 0.0 if _is_across(apart) else apart[0] < 0.0
            if not is_first:
                parts[[k, twin]] = twin, k
        if np.array_equal(turn, np.eye(3)) and np.array_equal(parts, np.arange(len(parts))):
            return None
        return cls(turn=turn, parts=parts)

    def coordinates(self, coordinates: NDArray[np.float32]) -> NDArray[np.float32]:
        """Normalised coordinates (n, 3) along the named axes."""
        return ((coordinates - np.float32(0.5)) @ self.turn + 0.5).astype(np.float32)


def _is_across(apart: Array) -> bool:
    """Whether what lies so far apart (3,) does so along y rather than x."""
    return bool(abs(apart[1]) > abs(apart[0]))


def named_from_view(sample: Sample) -> Sample:
    """The sample; of an object that is the same after half a turn, named as the module has it.

    The canonical axes are then turned, and of two parts that are alike the one at the back has the
    lower number, of two at the sides the one at the left; the frames of the object and of its
    parts stay, and so do grasps.
    """
    naming = _Naming.of(sample)
    if naming is None:
        return sample
    parts, turn = naming.parts, naming.turn
    return replace(
        sample,
        part=parts[sample.part].astype(sample.part.dtype),
        npcs=naming.coordinates(sample.npcs),
        naocs=naming.coordinates(sample.naocs),
        grasp_part=parts[sample.grasp_part].astype(sample.grasp_part.dtype),
        R_object_canonical=(sample.R_object_canonical @ turn).astype(np.float32),
        part_centers=(sample.part_centers[parts] @ turn).astype(np.float32),
        object_center=(sample.object_center @ turn).astype(np.float32),
        **{name: getattr(sample, name)[parts] for name in _BY_PART},
    )


#: What a sample has of each part, but for ``part_centers``.
_BY_PART = (
    "T_camera_parts",
    "T_object_rest_parts",
    "part_scales",
    "joint_type",
    "joint_axis_camera",
    "joint_pivot_camera",
    "open_fraction",
)


def picture_named_from_view(picture: Picture) -> Picture:
    """The picture with all of its samples, and the numbers in its mask, so named."""
    part_mask = picture.part_mask.copy()
    for index, sample in enumerate(picture.samples):
        naming = _Naming.of(sample)
        if naming is not None:
            mine = (picture.instance_mask == index + 1) & (picture.part_mask > 0)
            part_mask[mine] = naming.parts[picture.part_mask[mine] - 1] + 1
    samples = tuple(named_from_view(sample) for sample in picture.samples)
    return replace(picture, part_mask=part_mask, samples=samples)
