"""The backbone as it is usually written, with the same weights: what ours is timed against.

PointNet++ in plain torch operations: farthest points one by one, neighbours from a table of all
distances, and every layer of a set abstraction applied after gathering, to each neighbour of each
center. It gives the output of ``icaf4_policy.backbone.pointnet2``, whose layers it uses.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from artgym.errors import InvalidArgumentError
from icaf4_policy.backbone.pointnet2 import FeaturePropagation, PointNet2, SetAbstraction


def plain_features(
    backbone: nn.Module, points: Tensor, features: Tensor, *, first_of_equals: bool = False
) -> Tensor:
    """What ``backbone(points, features)`` gives in evaluation mode: (B, N, width_out).

    Args:
        backbone: a ``PointNet2``.
        points: (B, N, 3), network units.
        features: (B, N, C).
        first_of_equals: of neighbours that are equally far the first counts, as in ours, which
            takes a slower sort; else it may be any.

    Raises:
        InvalidArgumentError: the backbone is another than ``PointNet2``.
    """
    if not isinstance(backbone, PointNet2):
        raise InvalidArgumentError(
            f"backbone is {type(backbone).__name__}, expected PointNet2: take weights of "
            "features='color'."
        )
    return torch.stack(
        [
            _of_cloud(backbone, xyz, own, first_of_equals)
            for xyz, own in zip(points, features, strict=True)
        ]
    )


def _of_cloud(backbone: PointNet2, xyz0: Tensor, features: Tensor, first_of_equals: bool) -> Tensor:
    config = backbone.config
    x0 = torch.cat([xyz0, features], dim=-1)
    xyz1 = xyz0[_farthest_points(xyz0, config.centers[0])]
    xyz2 = xyz1[_farthest_points(xyz1, config.centers[1])]
    near1 = _ball_query(xyz0, xyz1, config.radii[0], config.neighbors, first_of_equals)
    near2 = _ball_query(xyz1, xyz2, config.radii[1], config.neighbors, first_of_equals)
    x1 = _abstracted(backbone.abstraction1, x0, xyz0, xyz1, near1)
    x2 = _abstracted(backbone.abstraction2, x1, xyz1, xyz2, near2)
    whole = F.relu(backbone.whole_norm1(backbone.whole1(torch.cat([x2, xyz2], dim=-1))))
    whole = F.relu(backbone.whole_norm2(backbone.whole2(whole))).amax(dim=0, keepdim=True)
    x2 = F.relu(backbone.broadcast_norm(backbone.own(x2) + backbone.broadcast(whole)))
    x1 = _propagated(backbone.propagation2, x2, x1, xyz2, xyz1, first_of_equals)
    return _propagated(backbone.propagation1, x1, x0, xyz1, xyz0, first_of_equals)


def _farthest_points(points: Tensor, count: int) -> Tensor:
    """Indices (count,), from the point farthest from the centroid on."""
    current = (points - points.mean(dim=0)).square().sum(dim=-1).argmax()
    nearest = torch.full((len(points),), torch.inf)
    chosen = []
    for _ in range(count):
        chosen.append(current)
        nearest = torch.minimum(nearest, (points - points[current]).square().sum(dim=-1))
        current = nearest.argmax()
    return torch.stack(chosen)


def _ball_query(
    points: Tensor, centers: Tensor, radius: float, count: int, first_of_equals: bool
) -> Tensor:
    """Indices (m, count) of the nearest points within ``radius``; the nearest fills up."""
    squares = (centers[:, None] - points[None]).square().sum(dim=-1)  # (m, n)
    distance, found = _nearest(squares, min(count, len(points)), first_of_equals)
    return torch.where(distance <= radius**2, found, found[:, :1])


def _nearest(squares: Tensor, count: int, first_of_equals: bool) -> tuple[Tensor, Tensor]:
    """The least ``count`` of each row (m, n) and their places, (m, count) each."""
    if first_of_equals:
        values, found = squares.sort(dim=-1, stable=True)
        return values[:, :count], found[:, :count]
    values, found = squares.topk(count, dim=-1, largest=False)
    return values, found


def _abstracted(
    layer: SetAbstraction, features: Tensor, points: Tensor, centers: Tensor, neighbors: Tensor
) -> Tensor:
    """Every layer on every neighbour (Q, S, C), then the maximum."""
    gathered = layer.norm_features(layer.features(features[neighbors].flatten(0, 1)))
    offsets = layer.offsets((points[neighbors] - centers[:, None]).flatten(0, 1))
    projected = layer.project(F.relu(gathered + offsets)).unflatten(0, neighbors.shape)
    return F.relu(layer.norm(projected.amax(dim=1)))


def _propagated(
    layer: FeaturePropagation,
    center_features: Tensor,
    features: Tensor,
    centers: Tensor,
    points: Tensor,
    first_of_equals: bool,
) -> Tensor:
    """Interpolation from the three nearest centers, then the layers on every point."""
    squares = (points[:, None] - centers[None]).square().sum(dim=-1)
    distance, nearest = _nearest(squares, 3, first_of_equals)
    weights = 1.0 / (distance + 1e-8)
    weights = weights / weights.sum(dim=-1, keepdim=True)
    carried = (center_features[nearest] * weights[..., None]).sum(dim=1)
    hidden = F.relu(layer.norm1(layer.from_centers(carried) + layer.from_points(features)))
    return F.relu(layer.norm2(layer.mix(hidden)))
