"""From an RGB-D image to parts, poses, joints and ranked grasps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray

from artgym.datasets.sample import level_from_camera
from artgym.errors import InvalidArgumentError, UnknownNameError
from artgym.geometry.normals import surface_normals
from artgym.geometry.rotations import geodesic_angle
from icaf4_policy.anchors import anchors_from_config
from icaf4_policy.checkpoint import load_model
from icaf4_policy.cloud import choose_points, level_points
from icaf4_policy.collisions import hand_is_free
from icaf4_policy.faces import REACH, face_directions, has_walls, square_rotations
from icaf4_policy.features import (
    given_normals,
    has_normals,
    point_descriptors,
    point_inputs,
    require_colors,
)
from icaf4_policy.joint_consistency import AxisDirection, ConsistencyConfig, consistent_fits
from icaf4_policy.joint_votes import joint_from_votes
from icaf4_policy.model import Icaf4, Outputs
from icaf4_policy.pose_fitting import PoseFit, fit_pose, fit_turned
from icaf4_policy.prediction import NO_JOINT, Grasps, JointEstimate, PointGrasps, Prediction
from icaf4_policy.proposals import ProposalConfig, diverse
from icaf4_policy.tabletop import MIN_OBJECT_POINTS, ObjectView, segment_object

Array = NDArray[np.floating]

#: A part is found if this many points are on it.
MIN_PART_POINTS = 12


@dataclass(frozen=True, kw_only=True, eq=False)
class _Look:
    """What the network saw and said. N points.

    Attributes:
        outputs: what it said.
        points: (N, 3), camera frame, metres.
        pick: int64 (N,), which of the given points they are.
        normals: (N, 3), unit, camera frame; ``None`` for a network that knows no faces.
        R_level_camera: (3, 3).
    """

    outputs: Outputs
    points: Array
    pick: NDArray[np.int64]
    normals: Array | None
    R_level_camera: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class _Parts:
    """What is found of the parts, as ``Prediction`` has it."""

    part: NDArray[np.int64]
    probability: Array
    npcs: Array
    naocs: Array
    joints: tuple[JointEstimate, ...]
    boxes: tuple[PoseFit | None, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Perception:
    """A trained network, ready to look.

    Attributes:
        model: in evaluation mode.
        category: of the objects to look at, one of those that the network is for.
        proposals: how grasps are ranked.
        consistency: how the boxes are made to agree with the joints, the vertical and the faces
            that are seen; None leaves each part the fit of its own points.
    """

    model: Icaf4
    category: str
    proposals: ProposalConfig = field(default_factory=ProposalConfig)
    consistency: ConsistencyConfig | None = field(default_factory=ConsistencyConfig)

    def __post_init__(self) -> None:
        if self.category not in self.model.config.categories:
            raise UnknownNameError("category", self.category, self.model.config.categories)

    @classmethod
    def load(cls, weights: str | Path, category: str | None = None) -> Perception:
        """Loads trained weights (``.safetensors``, description beside it).

        Args:
            weights: the file.
            category: of the objects to look at; weights for a single one need none.

        Raises:
            DamagedFileError: either file is missing, damaged or does not match.
            InvalidArgumentError: the weights are for several categories, and none was chosen.
            UnknownNameError: they are not for this one.
        """
        model, _ = load_model(Path(weights))
        known = model.config.categories
        if category is None and len(known) > 1:
            raise InvalidArgumentError(
                f"category: {weights} is for {', '.join(known)}; say which is looked at."
            )
        return cls(model=model, category=category or next(iter(known)))

    @property
    def _index(self) -> int:
        """The category as the network is told it."""
        return self.model.config.categories.index(self.category)

    def perceive(
        self,
        rgb: ArrayLike,
        depth: ArrayLike,
        intrinsics: ArrayLike,
        up_camera_hint: ArrayLike | None = None,
        exclude_mask: ArrayLike | None = None,
        *,
        part: int | None = None,
        rng: np.random.Generator,
    ) -> tuple[Prediction, ObjectView]:
        """Finds the object on the table and predicts everything about it.

        Args:
            rgb: uint8 (H, W, 3).
            depth: (H, W), metres along z, 0 where unknown.
            intrinsics: (3, 3).
            up_camera_hint: rough upward direction in the camera frame, when known.
            exclude_mask: bool (H, W), pixels of the robot, when known.
            part: as of ``predict``.
            rng: for the fits and the choice of points.

        Returns:
            The prediction, and the view of the object that it was made from.
        """
        view = segment_object(depth, intrinsics, rgb, up_camera_hint, exclude_mask, rng=rng)
        R_level_camera = level_from_camera(view.up_camera)
        prediction = self.predict(
            view.points_camera,
            self.point_features(view.points_camera, view.colors, rgb, intrinsics),
            R_level_camera,
            table_camera=view.table_camera,
            part=part,
            rng=rng,
        )
        return prediction, view

    def point_features(
        self, points_camera: ArrayLike, colors: ArrayLike, rgb: ArrayLike, intrinsics: ArrayLike
    ) -> NDArray[np.uint8]:
        """What ``predict`` is to be given as colours: they themselves, or descriptors.

        Args:
            points_camera: (M, 3), metres, of the object alone.
            colors: uint8 (M, 3).
            rgb: uint8 (H, W, 3), the picture that they are of.
            intrinsics: (3, 3).

        Returns:
            uint8 (M, C).
        """
        features = self.model.config.features
        return point_descriptors(points_camera, colors, rgb, intrinsics, features)

    @torch.inference_mode()
    def predict(
        self,
        points_camera: ArrayLike,
        colors: ArrayLike,
        R_level_camera: ArrayLike,
        *,
        table_camera: ArrayLike | None = None,
        part: int | None = None,
        rng: np.random.Generator,
    ) -> Prediction:
        """Predicts everything about an object from its points.

        Args:
            points_camera: (M, 3), metres, of the object alone.
            colors: uint8 (M, 3), or descriptors (M, C) for a network that is given those.
            R_level_camera: (3, 3).
            table_camera: (3,), a point of the table, which the hand keeps out of.
            part: index of the part to be moved, when known: grasps are proposed on it alone, it has
                a joint, and if it is the likeliest part of hardly any point, the points likeliest
                to be of it are taken for it.
            rng: for the fits and the choice of points.

        Raises:
            InvalidArgumentError: too few points, one that is not finite, features of another
                network, or a part that the network does not know.
        """
        num_parts = self.model.config.num_parts
        if part is not None and not 1 <= part < num_parts:
            raise InvalidArgumentError(
                f"part={part}: the network knows the movable parts 1 to {num_parts - 1}."
            )
        look = self._look(points_camera, colors, R_level_camera, rng, self.proposals.points, part)
        table = None if table_camera is None else np.asarray(table_camera, dtype=float)
        return self._prediction(look, table, part, rng)

    @torch.inference_mode()
    def point_grasps(
        self,
        points_camera: ArrayLike,
        colors: ArrayLike,
        R_level_camera: ArrayLike,
        *,
        top: int,
        rng: np.random.Generator,
    ) -> PointGrasps:
        """The ``top`` best anchors, refined, at every point; arguments as of ``predict``."""
        look = self._look(points_camera, colors, R_level_camera, rng, self.model.config.num_points)
        outputs = look.outputs
        anchors = anchors_from_config(self.model.config.anchors)
        order = outputs.grasp_points[0].argsort()
        scores, best = outputs.anchors[0, order].sigmoid().topk(min(top, len(anchors)), dim=-1)
        residuals = outputs.residuals[0, order].take_along_dim(best[..., None], dim=1)
        affordance = outputs.affordance[0].softmax(dim=-1)[:, 1].numpy().astype(float)
        R_frame_grasps = anchors.grasps(best.numpy(), residuals.numpy())
        parts = self._find_parts(look, None, rng) if anchors.frame == "part" else None
        return PointGrasps(
            points_camera=look.points,
            point_index=look.pick,
            affordance=affordance,
            graspable=affordance >= self.model.config.graspable_from,
            R_camera_grasp=self._anchor_frames(parts, look.R_level_camera)[:, None]
            @ R_frame_grasps,
            scores=scores.numpy().astype(float),
        )

    def _look(
        self,
        points_camera: ArrayLike,
        colors: ArrayLike,
        R_level_camera: ArrayLike,
        rng: np.random.Generator,
        grasp_points: int,
        part: int | None = None,
    ) -> _Look:
        """Shows a cloud to the network, and asks for grasps at so many points (on a part)."""
        points_camera, colors = np.asarray(points_camera, dtype=float), np.asarray(colors)
        if points_camera.shape[1:] != (3,) or len(points_camera) < MIN_OBJECT_POINTS:
            raise InvalidArgumentError(
                f"points_camera has shape {points_camera.shape}: expected (M, 3) with M at least "
                f"{MIN_OBJECT_POINTS}."
            )
        is_finite = np.isfinite(points_camera).all(axis=1)
        if not is_finite.all():
            row = int(np.argmin(is_finite))
            raise InvalidArgumentError(
                f"points_camera[{row}] is {points_camera[row].tolist()}: leave out points without "
                f"a depth, {np.count_nonzero(~is_finite)} here."
            )
        config = self.model.config
        points_level, center_level = level_points(points_camera, R_level_camera)
        pick = choose_points(len(points_camera), config.num_points, rng)
        require_colors(colors, len(points_camera), config.features)
        normals_level = (
            surface_normals(points_level, pick, -center_level)
            if has_normals(config.features)
            else None
        )
        given = point_inputs(colors[pick], normals_level, config.features)
        outputs = self.model(
            torch.from_numpy(points_level[pick][None].astype(np.float32)),
            torch.from_numpy(given[None].astype(np.float32) / 255.0),
            torch.tensor([self._index]),
            min(grasp_points, config.num_points),
            part=part,
        )
        R_level_camera = np.asarray(R_level_camera, dtype=float)
        normals = None
        if config.face_errors and has_normals(config.features):
            normals = given_normals(given) @ R_level_camera
        elif config.face_errors:
            normals = surface_normals(points_camera, pick, np.zeros(3))
        return _Look(
            outputs=outputs,
            points=points_camera[pick],
            pick=pick,
            normals=normals,
            R_level_camera=R_level_camera,
        )

    def _prediction(
        self, look: _Look, table_camera: Array | None, wanted: int | None, rng: np.random.Generator
    ) -> Prediction:
        outputs, points = look.outputs, look.points
        parts = self._find_parts(look, wanted, rng)
        affordance = outputs.affordance[0].softmax(dim=-1)[:, 1].numpy().astype(float)
        if wanted is None:
            part, worth = parts.part, affordance
        else:
            part = np.full_like(parts.part, wanted)
            worth = affordance * parts.probability[:, wanted]
        return Prediction(
            points_camera=points,
            point_index=look.pick,
            part=parts.part,
            part_probability=parts.probability,
            npcs=parts.npcs,
            naocs=parts.naocs,
            affordance=affordance,
            graspable=affordance >= self.model.config.graspable_from,
            part_boxes=parts.boxes,
            object_boxes=self._boxes(look, parts.naocs, parts.part, parts.joints, rng),
            joints=parts.joints,
            grasps=self._ranked_grasps(
                outputs,
                points,
                part,
                worth,
                self._anchor_frames(parts, look.R_level_camera, wanted),
                look.R_level_camera,
                table_camera,
            ),
            R_level_camera=look.R_level_camera,
        )

    def _find_parts(self, look: _Look, wanted: int | None, rng: np.random.Generator) -> _Parts:
        outputs, points = look.outputs, look.points
        num_parts = self.model.config.num_parts
        probability = outputs.segmentation[0].softmax(dim=-1).numpy().astype(float)
        part = probability.argmax(axis=-1)
        if wanted is not None and (part == wanted).sum() < MIN_PART_POINTS:
            likely = np.argsort(-probability[:, wanted], kind="stable")
            part[likely[:MIN_PART_POINTS]] = wanted
        rows = np.arange(len(points))
        npcs = outputs.npcs[0].numpy()[rows, part].astype(float)
        naocs = outputs.naocs[0].numpy()[rows, part].astype(float)

        joints = []
        type_log = outputs.joint_type[0].log_softmax(dim=-1).numpy()
        axis_camera = outputs.joint_axis[0].numpy() @ look.R_level_camera
        offset_camera = outputs.joint_offset[0].numpy() @ look.R_level_camera
        offset_camera = offset_camera * float(outputs.unit)
        for k in range(num_parts):
            on_part = part == k
            if on_part.sum() < MIN_PART_POINTS:
                joints.append(NO_JOINT)
                continue
            joints.append(
                joint_from_votes(
                    type_log[on_part],
                    axis_camera[on_part],
                    points[on_part] + offset_camera[on_part],
                    points[on_part],
                    probability[on_part, k],
                    moves=k == wanted,
                )
            )
        return _Parts(
            part=part,
            probability=probability,
            npcs=npcs,
            naocs=naocs,
            joints=tuple(joints),
            boxes=self._boxes(look, npcs, part, joints, rng),
        )

    def _anchor_frames(
        self, parts: _Parts | None, R_level_camera: Array, wanted: int | None = None
    ) -> Array:
        """``R_camera_frame`` of the anchors, (N, 3, 3), or (1, 3, 3) for all points alike.

        Where anchors turn with the parts, that is the box of the part that is wanted, or of the
        likeliest part of each point among those that were found.
        """
        if parts is None or self.model.config.anchors.frame == "level":
            return R_level_camera.T[None]
        R_camera_boxes = {
            k: box.T_camera_box[:3, :3]
            for k, box in enumerate(parts.boxes)
            if box is not None and wanted in (None, k)
        }
        likeliest = parts.probability[:, list(R_camera_boxes)].argmax(axis=-1)
        return np.stack(list(R_camera_boxes.values()))[likeliest]

    def _boxes(
        self,
        look: _Look,
        nocs: Array,
        part: NDArray[np.int64],
        joints: Sequence[JointEstimate],
        rng: np.random.Generator,
    ) -> tuple[PoseFit | None, ...]:
        """One box a part, ``None`` where it was not found."""
        places = [np.flatnonzero(part == k) for k in range(len(joints))]
        nocs_of_parts, points_of_parts = [nocs[i] for i in places], [look.points[i] for i in places]
        fits = [
            fit_pose(x, y, rng) if len(x) >= MIN_PART_POINTS else None
            for x, y in zip(nocs_of_parts, points_of_parts, strict=True)
        ]
        if self.consistency is None:
            return tuple(fits)
        if fits[0] is not None and self.consistency.faces:
            fits[0] = self._squared(look, fits[0], nocs_of_parts[0], places[0])
        return consistent_fits(
            fits,
            nocs_of_parts,
            points_of_parts,
            [joint.joint_type for joint in joints],
            [joint.axis_camera for joint in joints],
            self.consistency,
            directions=self._directions(look, fits, places, self.consistency),
        )

    def _squared(self, look: _Look, fit: PoseFit, nocs: Array, place: NDArray[np.int64]) -> PoseFit:
        """The fit of the base, or one along its walls where these are and it is far from them.

        Seen from behind, a cabinet leaves a network in doubt which side is which, and its
        coordinates lie in between; walls do not.
        """
        config = self.model.config
        if look.normals is None or not config.upright:
            return fit
        if not has_walls(config.face_errors[self._index][0]):
            return fit
        rotations = square_rotations(look.normals[place], look.R_level_camera[2])
        if rotations is None or geodesic_angle(rotations, fit.T_camera_box[:3, :3]).min() <= REACH:
            return fit
        squared = [fit_turned(nocs, look.points[place], R) for R in rotations]
        best = max(squared, key=lambda each: each.inlier_share)
        return best if best.inlier_share > 0.0 else fit

    def _directions(
        self,
        look: _Look,
        fits: Sequence[PoseFit | None],
        places: Sequence[NDArray[np.int64]],
        consistency: ConsistencyConfig,
    ) -> list[AxisDirection]:
        """What is seen of the boxes' axes beside the fits: the vertical, and faces across them."""
        directions = []
        if self.model.config.upright:
            up_camera = look.R_level_camera[2]
            directions.append(
                AxisDirection(part=0, axis=2, camera=up_camera, error=consistency.tilt)
            )
        if look.normals is None or not consistency.faces:
            return directions
        errors = self.model.config.face_errors[self._index]
        for k, fit in enumerate(fits):
            if fit is None:
                continue
            cameras, found = face_directions(look.normals[places[k]], fit.T_camera_box[:3, :3])
            for axis, error in enumerate(errors[k]):
                if found[axis] and error is not None and error <= consistency.worst_face:
                    total = float(np.hypot(error, consistency.face_error))
                    directions.append(
                        AxisDirection(part=k, axis=axis, camera=cameras[axis], error=total)
                    )
        return directions

    def _ranked_grasps(
        self,
        outputs: Outputs,
        points: Array,
        part: NDArray[np.int64],
        worth: Array,
        R_camera_frames: Array,
        R_level_camera: Array,
        table_camera: Array | None,
    ) -> Grasps:
        """Scores every (point, anchor) pair and keeps the best that differ and are free.

        ``worth`` (N,) is the probability that a point is one to grasp; ``R_camera_frames`` are of
        ``_anchor_frames``.
        """
        asked = outputs.grasp_points[0].numpy()  # (S,)
        anchors = anchors_from_config(self.model.config.anchors)
        scores = worth[asked, None] * outputs.anchors[0].sigmoid().numpy()  # (S, L)
        # Some tens of candidates for each proposal leave enough after thinning.
        wanted = min(32 * self.proposals.count, scores.size)
        keep = np.argpartition(-scores, wanted - 1, axis=None)[:wanted]
        keep = keep[np.argsort(-scores.flat[keep], kind="stable")]
        row, anchor = np.unravel_index(keep, scores.shape)
        residuals = outputs.residuals[0].numpy()[row, anchor]
        R_camera_frames = np.broadcast_to(R_camera_frames, (len(points), 3, 3))
        R_grasps = R_camera_frames[asked[row]] @ anchors.grasps(anchor, residuals)
        collisions = self.proposals.collisions

        def fits(candidate: int) -> bool:
            return collisions is None or hand_is_free(
                points,
                R_grasps[candidate],
                points[asked[row[candidate]]],
                R_level_camera[2],
                table_camera,
                collisions,
            )

        chosen = diverse(points[asked[row]], R_grasps, self.proposals, fits)
        source = asked[row[chosen]]
        return Grasps(
            points_camera=points[source],
            R_camera_grasp=R_grasps[chosen],
            scores=scores[row[chosen], anchor[chosen]].astype(float),
            parts=part[source],
        )
