"""Gather, subtract, rectify, project, maximise: the inner step of a set-abstraction layer.

Written as one operator because its dense intermediates, (centers, neighbours, channels), cost more
time in memory traffic than the arithmetic does, and because the gradient of a maximum touches one
neighbour a channel: a backward pass over the winners alone does 1 / neighbours of the dense work.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

FloatArray = NDArray[np.float32]

#: Gathered rows that are projected at once; their block stays in the processor's cache.
_BLOCK_ROWS = 1024


@numba.njit(cache=True, fastmath=True)
def _gather_rectified(
    features: FloatArray, offsets: FloatArray, neighbors: NDArray[np.int64], rows: FloatArray
) -> None:
    """Writes ``relu(features[neighbors[q, s]] - offsets[q])`` to ``rows`` (q * s, C)."""
    num_centers, num_neighbors = neighbors.shape
    channels = features.shape[1]
    for q in range(num_centers):
        for s in range(num_neighbors):
            j = neighbors[q, s]
            r = q * num_neighbors + s
            for c in range(channels):
                rows[r, c] = max(features[j, c] - offsets[q, c], np.float32(0.0))


@numba.njit(cache=True, fastmath=True)
def _maximum_over_neighbors(
    projected: FloatArray, num_neighbors: int, best: FloatArray, winner: NDArray[np.int32]
) -> None:
    """Maximum of ``projected`` (q * s, O) over s into ``best`` (q, O), its s into ``winner``."""
    num_centers, channels = best.shape
    for q in range(num_centers):
        first = q * num_neighbors
        for o in range(channels):
            best[q, o] = projected[first, o]
            winner[q, o] = 0
        for s in range(1, num_neighbors):
            for o in range(channels):
                value = projected[first + s, o]
                larger = value > best[q, o]
                best[q, o] = value if larger else best[q, o]
                winner[q, o] = s if larger else winner[q, o]


@numba.njit(cache=True, fastmath=True)
def _backward_through_winners(
    gradient: FloatArray,
    features: FloatArray,
    offsets: FloatArray,
    neighbors: NDArray[np.int64],
    winner: NDArray[np.int32],
    weight: FloatArray,
    gradient_features: FloatArray,
    gradient_offsets: FloatArray,
    gradient_weight: FloatArray,
) -> None:
    """Adds the gradients of the three inputs, given that of the maximum (q, O)."""
    num_centers, out_channels = gradient.shape
    channels = features.shape[1]
    for q in range(num_centers):
        for o in range(out_channels):
            g = gradient[q, o]
            if g == 0.0:
                continue
            j = neighbors[q, winner[q, o]]
            for c in range(channels):
                value = features[j, c] - offsets[q, c]
                active = value > 0.0
                gradient_weight[o, c] += g * (value if active else np.float32(0.0))
                flow = g * weight[o, c] if active else np.float32(0.0)
                gradient_features[j, c] += flow
                gradient_offsets[q, c] -= flow


class _GroupMax(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, features: Tensor, offsets: Tensor, weight: Tensor, neighbors: Tensor
    ) -> Tensor:
        f, x, n = features.numpy(), offsets.numpy(), neighbors.numpy()
        num_centers, num_neighbors = n.shape
        best = np.empty((num_centers, len(weight)), np.float32)
        winner = np.empty(best.shape, np.int32)
        centers_a_block = max(1, _BLOCK_ROWS // num_neighbors)
        rows = np.empty((centers_a_block * num_neighbors, f.shape[1]), np.float32)
        projected = torch.empty(len(rows), len(weight))
        weight_t = weight.t()
        for first in range(0, num_centers, centers_a_block):
            block = slice(first, min(first + centers_a_block, num_centers))
            used = (block.stop - first) * num_neighbors
            _gather_rectified(f, x[block], n[block], rows)
            torch.mm(torch.from_numpy(rows[:used]), weight_t, out=projected[:used])
            _maximum_over_neighbors(projected.numpy(), num_neighbors, best[block], winner[block])
        ctx.save_for_backward(features, offsets, weight, neighbors, torch.from_numpy(winner))
        return torch.from_numpy(best)

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, Tensor, Tensor, None]:  # type: ignore[override]
        features, offsets, weight, neighbors, winner = ctx.saved_tensors
        results = torch.zeros_like(features), torch.zeros_like(offsets), torch.zeros_like(weight)
        inputs = gradient.contiguous(), features, offsets, neighbors, winner, weight
        _backward_through_winners(*(t.numpy() for t in (*inputs, *results)))
        return *results, None


def _plain_group_max(
    features: Tensor, offsets: Tensor, weight: Tensor, neighbors: Tensor
) -> Tensor:
    """The same in torch's own operators, for a GPU, to which memory traffic costs little."""
    grouped = torch.relu(features[neighbors] - offsets[:, None])  # (Q, S, C)
    return (grouped @ weight.t()).amax(dim=1)


def group_max(features: Tensor, offsets: Tensor, weight: Tensor, neighbors: Tensor) -> Tensor:
    """``max over s of weight @ relu(features[neighbors[q, s]] - offsets[q])``.

    Args:
        features: float32 (P, C), of the points.
        offsets: float32 (Q, C), of the centers.
        weight: float32 (O, C).
        neighbors: int64 (Q, S), indices into the points.

    Returns:
        (Q, O), differentiable in the first three.
    """
    if features.device.type != "cpu":
        return _plain_group_max(features, offsets, weight, neighbors)
    return _GroupMax.apply(
        features.contiguous(), offsets.contiguous(), weight.contiguous(), neighbors
    )
