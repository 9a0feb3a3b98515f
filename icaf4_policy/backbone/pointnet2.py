"""PointNet++ with single-scale grouping (paper, Section 5.1), arranged to train on one CPU core.

Two departures from the usual arrangement keep the function class and cut the cost several times:
the first layer of each set abstraction is linear in a point's features and in its offset from the
center, so it is applied to the points before they are gathered; and within a ball, batch
normalisation follows the maximum instead of preceding it.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from artgym.errors import InvalidArgumentError
from icaf4_policy.backbone.exact_linear import ExactLinear
from icaf4_policy.backbone.folding import folded, normalized
from icaf4_policy.backbone.point_ops import neighborhoods
from icaf4_policy.backbone.set_abstraction import group_max


@dataclass(frozen=True, kw_only=True)
class BackboneConfig:
    """Sizes of the backbone.

    Attributes:
        centers: centers of the two set abstractions.
        radii: radii of their balls, network units (an object spans about 2).
        neighbors: neighbours in each ball.
        width1: channels before and after the maximum of the first abstraction.
        width2: the same of the second.
        width_global: channels of the descriptor of the whole cloud.
        width_out: features of each point.
    """

    centers: tuple[int, int] = (512, 128)
    radii: tuple[float, float] = (0.3, 0.6)
    neighbors: int = 32
    width1: tuple[int, int] = (32, 64)
    width2: tuple[int, int] = (96, 192)
    width_global: int = 384
    width_out: int = 128

    def __post_init__(self) -> None:
        if not self.centers[0] > self.centers[1] >= 3:
            raise InvalidArgumentError(f"centers={self.centers} must decrease and be at least 3.")
        if min(self.radii) <= 0 or self.neighbors < 1:
            raise InvalidArgumentError(
                f"radii={self.radii} and neighbors={self.neighbors} must be positive."
            )


class SetAbstraction(nn.Module):
    """Features of centers from those of the points in a ball around each.

    ``linear`` is the layer that reads the features: an exact one where they are coordinates.
    """

    def __init__(
        self, in_channels: int, widths: tuple[int, int], linear: type[nn.Linear] = nn.Linear
    ) -> None:
        super().__init__()
        hidden, out_channels = widths
        self.features = linear(in_channels, hidden, bias=False)
        self.norm_features = nn.BatchNorm1d(hidden)
        self.offsets = ExactLinear(3, hidden, bias=False)
        self.project = nn.Linear(hidden, out_channels, bias=False)
        self.norm = nn.BatchNorm1d(out_channels)

    def forward(
        self, features: Tensor, points: Tensor, centers: Tensor, neighbors: Tensor
    ) -> Tensor:
        """(Q, O) from features (P, C), points (P, 3), centers (Q, 3) and neighbors (Q, S)."""
        if self.training:
            lifted = self.norm_features(self.features(features)) + self.offsets(points)
        else:
            weight, bias = folded(self.features, self.norm_features)
            lifted = F.linear(points, self.offsets.weight, bias).addmm_(features, weight.t())
        grouped = group_max(lifted.float(), self.offsets(centers), self.project.weight, neighbors)
        return F.relu(self.norm(grouped))


class FeaturePropagation(nn.Module):
    """Features of points from those of the three nearest centers, and the points' own.

    ``linear`` is the layer that reads the points' own: an exact one where they are coordinates.
    """

    def __init__(
        self,
        center_channels: int,
        point_channels: int,
        widths: tuple[int, int],
        linear: type[nn.Linear] = nn.Linear,
    ) -> None:
        super().__init__()
        self.from_centers = nn.Linear(center_channels, widths[0], bias=False)
        self.from_points = linear(point_channels, widths[0], bias=False)
        self.norm1 = nn.BatchNorm1d(widths[0])
        self.mix = nn.Linear(widths[0], widths[1], bias=False)
        self.norm2 = nn.BatchNorm1d(widths[1])

    def forward(
        self, center_features: Tensor, point_features: Tensor, nearest: Tensor, weights: Tensor
    ) -> Tensor:
        """(P, O) from centers (Q, C), points (P, D), nearest (P, 3) and weights (P, 3)."""
        # Interpolation is linear, so the wide product is taken on the few centers.
        if self.training:
            carried = _interpolated(self.from_centers(center_features), nearest, weights)
            hidden = F.relu(self.norm1(carried + self.from_points(point_features)))
            return F.relu(self.norm2(self.mix(hidden)))
        of_centers, bias = folded(self.from_centers, self.norm1)
        of_points, _ = folded(self.from_points, self.norm1)
        # The weights of the three centers sum to one, and so do their shares of the bias.
        carried = _interpolated(F.linear(center_features, of_centers, bias), nearest, weights)
        hidden = carried.addmm_(point_features, of_points.t()).relu_()
        return F.linear(hidden, *folded(self.mix, self.norm2)).relu_()


def _interpolated(features: Tensor, nearest: Tensor, weights: Tensor) -> Tensor:
    """(P, C): of the features (Q, C) of centers at points, by nearest (P, 3) and weights (P, 3)."""
    return F.embedding_bag(nearest, features.float(), per_sample_weights=weights, mode="sum")


class PointNet2(nn.Module):
    """Features of every point of a cloud.

    Args:
        in_channels: channels of the input features beside xyz.
        config: sizes.
    """

    def __init__(self, in_channels: int, config: BackboneConfig) -> None:
        super().__init__()
        self.config = config
        c1, c2 = config.width1[1], config.width2[1]
        point_channels = 3 + in_channels
        self.abstraction1 = SetAbstraction(point_channels, config.width1, ExactLinear)
        self.abstraction2 = SetAbstraction(c1, config.width2)
        self.whole1 = nn.Linear(c2 + 3, c2, bias=False)
        self.whole_norm1 = nn.BatchNorm1d(c2)
        self.whole2 = nn.Linear(c2, config.width_global, bias=False)
        self.whole_norm2 = nn.BatchNorm1d(config.width_global)
        self.broadcast = nn.Linear(config.width_global, c2, bias=False)
        self.own = nn.Linear(c2, c2, bias=False)
        self.broadcast_norm = nn.BatchNorm1d(c2)
        self.propagation2 = FeaturePropagation(c2, c1, (c2, config.width_out))
        self.propagation1 = FeaturePropagation(
            config.width_out, point_channels, (config.width_out, config.width_out), ExactLinear
        )

    def forward(self, points: Tensor, features: Tensor, *, asked: int | None = None) -> Tensor:
        """Features (B, asked, width_out) of the first points of each cloud; of all by default.

        Args:
            points: (B, N, 3), network units.
            features: (B, N, C), what is given of them.
            asked: how many are asked about.
        """
        batch, num_points, _ = points.shape
        near = neighborhoods(
            points,
            counts=self.config.centers,
            radii=self.config.radii,
            neighbors=self.config.neighbors,
            asked=asked,
        )
        xyz0 = points.reshape(-1, 3)  # (B N, 3)
        xyz1 = xyz0[near.centers1.flatten()]  # (B n1, 3)
        xyz2 = xyz1[near.centers2.flatten()]  # (B n2, 3)
        x0 = torch.cat([xyz0, features.reshape(batch * num_points, -1)], dim=-1)
        x1 = self.abstraction1(x0, xyz0, xyz1, near.neighbors1.flatten(0, 1))  # (B n1, c1)
        x2 = self.abstraction2(x1, xyz1, xyz2, near.neighbors2.flatten(0, 1))  # (B n2, c2)
        whole = F.relu(normalized(self.whole1, self.whole_norm1, torch.cat([x2, xyz2], dim=-1)))
        # Here the maximum comes last: statistics of a few clouds would be too noisy.
        whole = F.relu(normalized(self.whole2, self.whole_norm2, whole))
        whole = whole.view(batch, self.config.centers[1], -1).amax(dim=1)  # (B, g)
        spread = self.broadcast(whole).repeat_interleave(self.config.centers[1], dim=0)
        x2 = F.relu(self.broadcast_norm(self.own(x2) + spread))  # (B n2, c2)
        x1 = self.propagation2(
            x2, x1, near.up2.flatten(0, 1), near.weights_up2.flatten(0, 1)
        )  # (B n1, o)
        x0 = x0.view(batch, num_points, -1)[:, :asked].flatten(0, 1)
        x0 = self.propagation1(x1, x0, near.up1.flatten(0, 1), near.weights_up1.flatten(0, 1))
        return x0.view(batch, near.up1.shape[1], -1)
