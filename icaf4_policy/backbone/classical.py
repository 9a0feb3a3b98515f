"""Descriptors from before networks learnt them, and the backbone that hands them to the heads.

The paper's baselines: each point is described by hand-made features of its surroundings alone, in
space (FPFH) or in the picture (DAISY), and the heads are those of the network.
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix
from torch import Tensor, nn
from torch.nn import functional as F

from artgym.errors import InvalidArgumentError, MissingDependencyError
from artgym.geometry.camera import project
from artgym.geometry.normals import Surroundings, plane_normals

Array = NDArray[np.floating]

Descriptor = Literal["fpfh", "daisy"]

# Open3D has FPFH too, equal to a step of 255 in 999 of 1,000 entries; but it brings a web server, a
# plug-in that pytest cannot load where warnings are errors, and a shared library of the system.
#: FPFH: bins of each of three angles.
_BINS = 11
#: Radius of the ball around a point that it is described by, in sizes of the cloud.
_RADIUS = 0.08
#: Of the points in it, the nearest: so many that a normal is fitted to, and a histogram counts.
_NORMAL_POINTS, _NEIGHBORS = 30, 100
#: Of a longer cloud, this many points are described, and the others as the nearest of them: the
#: histograms of a cloud do not depend on how densely it was sampled beyond that.
_FEATURE_POINTS = 4096

#: DAISY: distance of the outer ring in pixels, rings beside the centre, histograms on each.
_DAISY_RADIUS, _DAISY_RINGS, _DAISY_HISTOGRAMS, _DAISY_ORIENTATIONS = 15, 2, 6, 8
#: Farther from a point's pixel than this many radii no pixel counts: the outer ring's Gaussian has
#: half a radius as its deviation and is cut off at four.
_DAISY_REACH = 3
#: An object of more pixels than these in width or height is shrunk to no more.
_DAISY_PIXELS = 320

#: Numbers in each descriptor.
DESCRIPTOR_CHANNELS: dict[Descriptor, int] = {
    "fpfh": 3 * _BINS,
    "daisy": (_DAISY_RINGS * _DAISY_HISTOGRAMS + 1) * _DAISY_ORIENTATIONS,
}


class PointwiseBackbone(nn.Module):
    """Features of every point from its descriptor alone: where it lies is not looked at.

    Args:
        in_channels: channels of a descriptor.
        width_out: features of each point.
    """

    def __init__(self, in_channels: int, width_out: int) -> None:
        super().__init__()
        self.linear = nn.Linear(in_channels, width_out, bias=False)
        self.norm = nn.BatchNorm1d(width_out)

    def forward(self, points: Tensor, features: Tensor, *, asked: int | None = None) -> Tensor:
        """Features (B, asked, width_out) from descriptors (B, N, C); see ``PointNet2.forward``.

        The points (B, N, 3) are not used.
        """
        del points
        features = features[:, :asked]
        hidden: Tensor = F.relu(self.norm(self.linear(features.flatten(0, 1))))  # (B N, o)
        return hidden.unflatten(0, features.shape[:2])


def _bytes(shares: ArrayLike) -> NDArray[np.uint8]:
    """Numbers of [0, 1] in 255 steps."""
    return np.rint(255.0 * np.clip(shares, 0.0, 1.0)).astype(np.uint8)


def fpfh(points: ArrayLike, viewpoint: ArrayLike = (0.0, 0.0, 0.0)) -> NDArray[np.uint8]:
    """Fast point feature histograms (Rusu, Blodow and Beetz, ICRA 2009) of every point.

    Three angles between the normals of a point and of each neighbour, in a frame that the two of
    them define, are counted in 11 bins each; to a point's own histogram comes the mean of its
    neighbours', weighted by one over the squared distance. Lengths are relative to the cloud's
    size, so that turning, moving and scaling the cloud with the viewpoint changes nothing.

    Args:
        points: (M, 3) of one object, any unit.
        viewpoint: (3,), the side of the surface that normals point to; the camera's origin if the
            points are in its frame.

    Returns:
        uint8 (M, 33): 255 times the share of each bin, the 11 of one angle adding up to 1; zeros
        where a point has no neighbour.

    Raises:
        InvalidArgumentError: there are no points.
    """
    points = np.asarray(points, dtype=float)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points):
        raise InvalidArgumentError(
            f"points has shape {points.shape}: expected (M, 3) with M at least 1."
        )
    # One of the nearest is the point itself.
    near = Surroundings.of(points, _FEATURE_POINTS, _NEIGHBORS + 1, _RADIUS).nearest_first()
    support, index, distance = near.support, near.index, near.distance
    close = slice(0, _NORMAL_POINTS)
    normals = plane_normals(support, index[:, close], near.found[:, close], viewpoint)
    # A point in the same place twice has no direction to itself.
    first, slot = np.nonzero(near.found & (distance > 1e-9 * near.size))  # (n pairs,), ascending
    second, apart = index[first, slot], distance[first, slot]
    bins = _angle_bins(support[first], support[second], normals[first], normals[second])
    cells = first[:, None] * (3 * _BINS) + np.arange(3) * _BINS + bins  # (n pairs, 3)
    counts = np.bincount(cells.ravel(), minlength=len(support) * 3 * _BINS)
    pairs = np.bincount(first, minlength=len(support))
    own = counts.reshape(len(support), -1) / np.maximum(pairs, 1)[:, None]  # (n, 33)
    weights = csr_matrix((apart**-2, (first, second)), shape=(len(support), len(support)))
    spread = np.maximum(np.asarray(weights.sum(axis=1)), np.finfo(float).tiny)  # (n, 1)
    histograms = 0.5 * (own + (weights @ own) / spread)
    if len(points) > len(support):
        histograms = histograms[near.nearest(points)]
    return _bytes(histograms)


def _angle_bins(p: Array, q: Array, n_p: Array, n_q: Array) -> NDArray[np.int64]:
    """Bins (n, 3) of the angles (alpha, phi, theta) of pairs of points (n, 3) with normals (n, 3).

    Of the two, that whose normal is nearer to the line between them is the source. With the line
    d from it, its normal u, v = d x u / |d x u|, w = u x v and the other's normal n: alpha = v . n,
    phi = u . d, theta = atan2(w . n, u . n).
    """
    line = q - p
    line /= np.linalg.norm(line, axis=1, keepdims=True)
    along_p, along_q = np.einsum("ij,ij->i", n_p, line), np.einsum("ij,ij->i", n_q, line)
    swapped = np.abs(along_q) > np.abs(along_p)
    phi = np.where(swapped, -along_q, along_p)
    across = np.where(swapped, -along_p, along_q)  # d . n
    both = np.einsum("ij,ij->i", n_p, n_q)  # u . n
    # v and w come out of products of d, u and n: |d x u| = sine, w = (d - phi u) / sine, and
    # (d x u) . n is the same for either source.
    sine = np.sqrt(np.maximum(1.0 - phi**2, 1e-12))
    alpha = np.einsum("ij,ij->i", np.cross(line, n_p), n_q) / sine
    theta = np.arctan2((across - phi * both) / sine, both)
    shares = np.stack([(alpha + 1.0) / 2.0, (phi + 1.0) / 2.0, theta / (2.0 * np.pi) + 0.5], axis=1)
    return np.clip(np.floor(_BINS * shares).astype(np.int64), 0, _BINS - 1)


def daisy(points_camera: ArrayLike, rgb: ArrayLike, intrinsics: ArrayLike) -> NDArray[np.uint8]:
    """DAISY (Tola, Lepetit and Fua, PAMI 2010) of the grey picture at every point's pixel.

    Histograms of 8 directions of the gradient, at the pixel and on two rings of 6 around it, each
    of unit length. An object of more than 320 pixels is looked at in a picture shrunk by the whole
    number that brings it below.

    Args:
        points_camera: (M, 3) of one object, metres; those outside the picture are taken at its
            border.
        rgb: uint8 (H, W, 3), the picture that they are seen in.
        intrinsics: (3, 3), its camera's.

    Returns:
        uint8 (M, 104): 255 times the entries.

    Raises:
        MissingDependencyError: scikit-image is not installed.
    """
    try:
        from skimage.feature import daisy as dense_daisy
    except ModuleNotFoundError as error:
        raise MissingDependencyError(
            "features 'daisy' need scikit-image: pip install 'artgym[baselines]'."
        ) from error
    rgb = np.asarray(rgb)
    limits = np.array([rgb.shape[1], rgb.shape[0]]) - 1  # of columns, rows
    pixels = np.floor(project(points_camera, intrinsics)).astype(int)  # (M, 2)
    pixels = np.clip(pixels, 0, limits)
    low, extent = pixels.min(axis=0), np.ptp(pixels, axis=0) + 1
    shrink = math.ceil(extent.max() / _DAISY_PIXELS)
    reach = _DAISY_REACH * _DAISY_RADIUS
    # What lies outside the picture repeats its border.
    columns, rows = (
        np.clip(
            low[i] + np.arange(-reach * shrink, (-(-extent[i] // shrink) + reach) * shrink),
            0,
            limits[i],
        )
        for i in range(2)
    )
    cut = rgb[np.ix_(rows, columns)].astype(np.float32) / 255.0
    gray = cut @ np.array([0.299, 0.587, 0.114], dtype=np.float32)
    gray = gray.reshape(len(rows) // shrink, shrink, -1, shrink).mean(axis=(1, 3))
    dense = dense_daisy(
        gray,
        step=1,
        radius=_DAISY_RADIUS,
        rings=_DAISY_RINGS,
        histograms=_DAISY_HISTOGRAMS,
        orientations=_DAISY_ORIENTATIONS,
        normalization="daisy",
    )
    # The first one is a radius from the border of what was cut out.
    column, row = ((pixels - low) // shrink + reach - _DAISY_RADIUS).T
    return _bytes(np.asarray(dense)[row, column])
