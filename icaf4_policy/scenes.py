"""From a picture of a table to everything about each object on it: detector, then network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree  # pyright: ignore[reportAttributeAccessIssue]

from artgym.datasets.sample import level_from_camera
from artgym.geometry.camera import points_from_depth
from icaf4_policy.detector.inference import Detection, Detector
from icaf4_policy.inference import Perception
from icaf4_policy.prediction import Prediction
from icaf4_policy.shipped import DETECTOR, weights_path
from icaf4_policy.tabletop import HEIGHT_ABOVE_TABLE, MIN_OBJECT_POINTS, fit_table

Array = NDArray[np.floating]
Mask = NDArray[np.bool_]

#: What is nearer to a detection's mask than this share of its larger side may belong to it.
_REACH = 0.06
#: Loose pieces of a mask that are smaller than this share of it are left out.
_CRUMB = 0.05
#: Beside each other in a picture, what is so much nearer or farther is another piece, metres.
_JUMP = 0.05


@dataclass(frozen=True, kw_only=True, eq=False)
class SeenObject:
    """One object of a scene.

    Attributes:
        detection: where it is and what.
        prediction: everything about it.
        part_mask: uint8 (H, W): predicted part + 1, 0 where the object is not.
        affordance: float32 (H, W): probability that a pixel of it can be grasped, 0 elsewhere.
        graspable: bool (H, W): the pixels of it that are called so.
    """

    detection: Detection
    prediction: Prediction
    part_mask: NDArray[np.uint8]
    affordance: NDArray[np.float32]
    graspable: Mask


@dataclass(frozen=True, kw_only=True, eq=False)
class ScenePerception:
    """A detector, and networks for the categories that it finds.

    Attributes:
        detector: finds the objects.
        perceptions: by category; what has none is passed over.
    """

    detector: Detector
    perceptions: Mapping[str, Perception]

    @classmethod
    def load(cls, weights: Path | None = None) -> ScenePerception:
        """The detector and the networks of all categories that it finds.

        Args:
            weights: folder with detector.safetensors and {category}.safetensors; None for the
                shipped ones.

        Raises:
            DamagedFileError: weights are missing or damaged.
        """
        detector = Detector.load(weights_path(DETECTOR, weights))
        return cls(
            detector=detector,
            perceptions={
                category: Perception.load(weights_path(category, weights), category)
                for category in detector.model.config.categories
            },
        )

    def look(
        self,
        rgb: ArrayLike,
        depth: ArrayLike,
        intrinsics: ArrayLike,
        up_camera_hint: ArrayLike | None = None,
        *,
        min_score: float = 0.5,
        rng: np.random.Generator,
    ) -> list[SeenObject]:
        """All objects on a table, the surest first.

        Args:
            rgb: uint8 (H, W, 3).
            depth: (H, W), metres along z, 0 where unknown.
            intrinsics: (3, 3).
            up_camera_hint: rough upward direction in the camera frame, when known.
            min_score: less certain detections are left out.
            rng: for the fits and the choice of points.

        Raises:
            InvalidArgumentError: shapes do not agree, or there is no table.
        """
        rgb, depth = np.asarray(rgb), np.asarray(depth, dtype=float)
        detections = self.detector.detect(rgb, depth, min_score=min_score)
        points_camera = points_from_depth(depth, np.asarray(intrinsics, dtype=float))
        is_seen = np.isfinite(depth) & (depth > 0)
        up_camera, table_camera = fit_table(points_camera[is_seen], rng, up_camera_hint)
        stands_out = (points_camera - table_camera) @ up_camera > HEIGHT_ABOVE_TABLE
        objects = []
        for number, detection in enumerate(detections):
            others = [each.mask for i, each in enumerate(detections) if i != number]
            mask = _outlined(detection.mask, others, is_seen & stands_out, depth)
            if detection.category not in self.perceptions or mask.sum() < MIN_OBJECT_POINTS:
                continue
            perception, points = self.perceptions[detection.category], points_camera[mask]
            prediction = perception.predict(
                points,
                perception.point_features(points, rgb[mask], rgb, intrinsics),
                level_from_camera(up_camera),
                table_camera=table_camera,
                rng=rng,
            )
            objects.append(_spread(detection, prediction, points_camera, mask))
        return objects


def _outlined(mask: Mask, others: Sequence[Mask], stands_out: Mask, depth: Array) -> Mask:
    """A detection's mask (H, W) with the outline that depth gives it.

    The detector draws masks on a coarse grid: it cuts off corners and thin ends, and takes in edges
    of what is in front or behind. What stands out of the table beside a mask, and is in no other,
    belongs to it; loose crumbs do not.
    """
    rows, columns = (np.flatnonzero(mask.any(axis=axis)) for axis in (1, 0))
    if not len(rows):
        return mask
    reach = max(1, round(_REACH * max(np.ptp(rows), np.ptp(columns))))
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    beside = cv2.dilate(mask.astype(np.uint8), disc) > 0
    for other in others:
        beside &= ~other
    outlined = (mask | beside) & stands_out
    piece = _pieces(outlined, depth)
    sizes = np.bincount(piece)
    outlined[outlined] = (sizes > _CRUMB * sizes.sum())[piece]
    return outlined


def _pieces(mask: Mask, depth: Array) -> NDArray[np.integer]:
    """For each pixel of a mask (H, W), row by row, the number of its piece.

    Pixels hang together where they lie side by side at much the same depth (H, W).
    """
    count = int(mask.sum())
    number = np.full(mask.shape, -1)
    number[mask] = np.arange(count)
    pairs = []
    for one, other in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        hang = mask[one] & mask[other] & (np.abs(depth[one] - depth[other]) < _JUMP)
        pairs.append(np.stack([number[one][hang], number[other][hang]]))
    first, second = np.concatenate(pairs, axis=1)
    links = coo_array((np.ones(len(first), dtype=bool), (first, second)), shape=(count, count))
    piece: NDArray[np.integer] = connected_components(links, directed=False)[1]
    return piece


def _spread(
    detection: Detection, prediction: Prediction, points_camera: Array, mask: Mask
) -> SeenObject:
    """What the points that the network saw say of every pixel: the nearest speaks."""
    _, near = cKDTree(prediction.points_camera).query(points_camera[mask])
    part_mask = np.zeros(mask.shape, dtype=np.uint8)
    affordance = np.zeros(mask.shape, dtype=np.float32)
    part_mask[mask] = prediction.part[near] + 1
    affordance[mask] = prediction.affordance[near]
    graspable = np.zeros(mask.shape, dtype=bool)
    graspable[mask] = prediction.graspable[near]
    return SeenObject(
        detection=detection,
        prediction=prediction,
        part_mask=part_mask,
        affordance=affordance,
        graspable=graspable,
    )
