"""What a network is given of each point beside where it is: colours, normals, or descriptors."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.datasets.sample import Picture, Sample
from artgym.errors import InvalidArgumentError
from icaf4_policy.backbone.classical import DESCRIPTOR_CHANNELS, daisy, fpfh

Array = NDArray[np.floating]

#: Nothing, the colour, the surface's normal in the level frame, both; or a descriptor of the
#: paper's baselines, which takes the place of PointNet++.
Features = Literal["none", "color", "normals", "color_normals", "fpfh", "daisy"]

#: What is given where nothing else is asked for.
DEFAULT_FEATURES: Features = "normals"

#: Channels of each kind of features.
CHANNELS: dict[Features, int] = {
    "none": 0,
    "color": 3,
    "normals": 3,
    "color_normals": 6,
    **DESCRIPTOR_CHANNELS,
}


def has_color(features: Features) -> bool:
    """Whether the first three channels are the colour."""
    return features in ("color", "color_normals")


def has_normals(features: Features) -> bool:
    """Whether the last three channels are the normal."""
    return features in ("normals", "color_normals")


def given_channels(features: Features) -> int:
    """Of what samples and ``Perception.predict`` hold as colours: those, or a descriptor."""
    return CHANNELS[features] if features in DESCRIPTOR_CHANNELS else 3


def require_colors(colors: NDArray[np.uint8], count: int, features: Features) -> None:
    """Whether ``colors`` are what a network is given beside so many points.

    Raises:
        InvalidArgumentError: they have another shape.
    """
    expected = (count, given_channels(features))
    if colors.shape != expected:
        raise InvalidArgumentError(
            f"colors has shape {colors.shape}: expected {expected}, "
            f"{'descriptors' if features in DESCRIPTOR_CHANNELS else 'the colours'} of features "
            f"{features!r}."
        )


def point_inputs(
    colors: NDArray[np.uint8], normals_level: Array | None, features: Features
) -> NDArray[np.uint8]:
    """What the network is given of points of one object.

    Args:
        colors: uint8 (n, 3), or descriptors (n, C) where these are the features.
        normals_level: (n, 3), unit, level frame; None where the features have no normals.
        features: which.

    Returns:
        uint8 (n, C), C of ``CHANNELS``; a normal's coordinates from -1 to 1 in 254 steps.
    """
    is_given = has_color(features) or features in DESCRIPTOR_CHANNELS
    given = [colors] if is_given else []
    if has_normals(features):
        assert normals_level is not None
        given.append(np.rint(127.0 * normals_level + 128.0).astype(np.uint8))
    return np.concatenate(given, axis=1) if given else np.empty((len(colors), 0), np.uint8)


def given_normals(given: NDArray[np.uint8]) -> Array:
    """The unit normals (n, 3) in what a network is given (n, C), of features that have them."""
    normals = given[:, -3:].astype(float) - 128.0
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def described(picture: Picture, sample: Sample, features: Features) -> Sample:
    """A sample whose ``colors`` (M, C) are descriptors; for other features, the sample itself.

    Args:
        picture: the one that the sample is of.
        sample: one object in it.
        features: which.

    Raises:
        MissingDependencyError: a package is missing.
    """
    if features not in DESCRIPTOR_CHANNELS:
        return sample
    found = point_descriptors(
        sample.points_camera, sample.colors, picture.rgb, picture.intrinsics, features
    )
    return replace(sample, colors=found)


def point_descriptors(
    points_camera: ArrayLike,
    colors: ArrayLike,
    rgb: ArrayLike,
    intrinsics: ArrayLike,
    features: Features,
) -> NDArray[np.uint8]:
    """The descriptors of each point of one object; for other features, its colours.

    Args:
        points_camera: (M, 3), metres.
        colors: uint8 (M, 3).
        rgb: uint8 (H, W, 3), the picture that the points are seen in.
        intrinsics: (3, 3), its camera's.
        features: which.

    Returns:
        uint8 (M, C), C of ``given_channels``.

    Raises:
        MissingDependencyError: a package is missing.
    """
    if features == "fpfh":
        return fpfh(points_camera)
    if features == "daisy":
        return daisy(points_camera, rgb, intrinsics)
    return np.asarray(colors, dtype=np.uint8)
