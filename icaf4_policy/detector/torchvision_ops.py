"""All that the project takes from torchvision, and its compiled operators where they are missing.

Beside a CPU-only torch, torchvision's compiled library from the package index cannot load, and then
torchvision cannot even be imported. In that case ``nms`` and ``roi_align`` are registered here
first, without compiled code of torchvision's. Nothing else of the project imports torchvision.
"""

from __future__ import annotations

import sys

import numba
import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

_SCHEMAS = (
    "nms(Tensor dets, Tensor scores, float iou_threshold) -> Tensor",
    # Looked up when torchvision is imported, and never called.
    "qnms(Tensor dets, Tensor scores, float iou_threshold, float dets_scale, "
    "int dets_zero_point) -> Tensor",
    "roi_align(Tensor input, Tensor rois, float spatial_scale, SymInt pooled_height, "
    "SymInt pooled_width, int sampling_ratio, bool aligned) -> Tensor",
)


@numba.njit(cache=True)
def _kept_boxes(
    boxes: NDArray[np.floating], order: NDArray[np.int64], iou_threshold: float
) -> NDArray[np.int64]:
    kept = np.empty(len(order), np.int64)
    count = 0
    for i in order:
        x1, y1, x2, y2 = boxes[i]
        area = (x2 - x1) * (y2 - y1)
        overlapped = False
        for k in kept[:count]:
            u1, v1, u2, v2 = boxes[k]
            width, height = min(x2, u2) - max(x1, u1), min(y2, v2) - max(y1, v1)
            if width > 0 and height > 0:
                shared = width * height
                if shared > iou_threshold * (area + (u2 - u1) * (v2 - v1) - shared):
                    overlapped = True
                    break
        if not overlapped:
            kept[count] = i
            count += 1
    return kept[:count]


def nms(boxes: Tensor, scores: Tensor, iou_threshold: float) -> Tensor:
    """Indices of the boxes that no better box overlaps, best first.

    Args:
        boxes: (n, 4), left, top, right, bottom.
        scores: (n,); of equal ones, the first is the better.
        iou_threshold: intersection over union above which boxes overlap.

    Returns:
        int64 (m,).
    """
    order = torch.argsort(scores.detach(), descending=True, stable=True)
    array = boxes.detach().double().cpu().numpy()
    kept = _kept_boxes(array, order.cpu().numpy(), iou_threshold)
    return torch.from_numpy(kept).to(boxes.device)


def roi_align(
    features: Tensor,
    rois: Tensor,
    spatial_scale: float,
    pooled_height: int,
    pooled_width: int,
    sampling_ratio: int,
    aligned: bool,
) -> Tensor:
    """Means of bilinear samples in the bins of each region (Mask R-CNN, section 3).

    The samples of a bin lie on a grid and bilinear weights are products, so that the mean is
    ``rows @ features @ columns.T`` with one small matrix an axis: two matrix products, which are
    fast on a CPU and differentiable in the features. As in torchvision, regions get no gradient.

    Args:
        features: (B, C, H, W).
        rois: (n, 5), index in the batch, then left, top, right, bottom.
        spatial_scale: pixels of the features in one unit of the regions.
        pooled_height: bins from top to bottom.
        pooled_width: bins from left to right.
        sampling_ratio: samples along each side of a bin; below 1, as many as it has pixels.
        aligned: whether coordinate 0 is a pixel's edge, else its centre.

    Returns:
        (n, C, pooled_height, pooled_width).
    """
    batch, channels, height, width = features.shape
    rois = rois.detach()
    left, top, right, bottom = (rois[:, 1:] * spatial_scale - 0.5 * aligned).unbind(dim=1)
    pooled = features.new_zeros(len(rois), channels, pooled_height, pooled_width)
    rows = _pooling_weights(top, bottom - top, pooled_height, height, sampling_ratio, aligned)
    columns = _pooling_weights(left, right - left, pooled_width, width, sampling_ratio, aligned)
    for b in range(batch):
        mine = torch.nonzero(rois[:, 0] == b)[:, 0]
        table = features[b].permute(1, 2, 0).reshape(height, width * channels)
        # (n_b, pooled_height, W, C)
        banded = (rows[mine].flatten(0, 1) @ table).view(-1, pooled_height, width, channels)
        # (n_b, pooled_height, pooled_width, C)
        means = columns[mine, None] @ banded
        pooled = pooled.index_copy(0, mine, means.permute(0, 3, 1, 2))
    return pooled


def _pooling_weights(
    start: Tensor, extent: Tensor, bins: int, length: int, sampling_ratio: int, aligned: bool
) -> Tensor:
    """What each of ``length`` pixels of one axis adds to each bin: (n, bins, length)."""
    if not aligned:
        extent = extent.clamp(min=1.0)
    size = extent / bins
    counts = torch.full_like(size, sampling_ratio) if sampling_ratio > 0 else size.ceil()
    most = max(int(counts.max()), 1) if len(counts) else 1
    sample = torch.arange(most, dtype=start.dtype, device=start.device)
    offset = torch.arange(bins, dtype=start.dtype, device=start.device)[:, None] + (
        (sample + 0.5) / counts.clamp(min=1.0)[:, None, None]
    )
    # (n, bins, most)
    position = start[:, None, None] + offset * size[:, None, None]
    counted = (sample < counts[:, None, None]) & (position >= -1.0) & (position <= length)
    share = counted / counts.clamp(min=1.0)[:, None, None]
    position = position.clamp(0.0, length - 1.0)
    low = position.floor()
    weights = start.new_zeros(len(start), bins, length)
    weights.scatter_add_(2, low.long(), share * (1.0 - (position - low)))
    weights.scatter_add_(2, (low.long() + 1).clamp(max=length - 1), share * (position - low))
    return weights


#: Registrations last as long as this lives; a module that is loaded again keeps it.
_library: torch.library.Library


def _compiled_library_loads() -> bool:
    """Whether torchvision has its operators, without importing the rest of it."""
    from importlib.util import find_spec
    from pathlib import Path

    found = find_spec("torchvision")
    if found is None or found.origin is None:
        raise ModuleNotFoundError("No module named 'torchvision'", name="torchvision")
    try:
        torch.ops.load_library(Path(found.origin).with_name("_C.so"))
    except OSError:
        return False
    return True


def _register() -> None:
    global _library
    if hasattr(torch.ops.torchvision, "nms") or _compiled_library_loads():
        return
    _library = torch.library.Library("torchvision", "DEF")
    for schema in _SCHEMAS:
        _library.define(schema)
    _library.impl("nms", nms, "CompositeExplicitAutograd")
    _library.impl("roi_align", roi_align, "CompositeImplicitAutograd")

    import torchvision.extension
    import torchvision.ops  # noqa: F401

    # torchvision would else refuse, or compile a version of its own.
    for name in ("torchvision.extension", "torchvision.ops.roi_align"):
        sys.modules[name]._has_ops = lambda: True  # pyright: ignore[reportAttributeAccessIssue]


_register()

from torchvision.models.detection import MaskRCNN  # noqa: E402
from torchvision.models.detection.anchor_utils import AnchorGenerator  # noqa: E402
from torchvision.models.detection.faster_rcnn import TwoMLPHead  # noqa: E402
from torchvision.models.detection.image_list import ImageList  # noqa: E402
from torchvision.models.detection.mask_rcnn import MaskRCNNHeads, MaskRCNNPredictor  # noqa: E402
from torchvision.models.detection.roi_heads import paste_masks_in_image  # noqa: E402
from torchvision.ops import FeaturePyramidNetwork, MultiScaleRoIAlign  # noqa: E402

__all__ = [
    "AnchorGenerator",
    "FeaturePyramidNetwork",
    "ImageList",
    "MaskRCNN",
    "MaskRCNNHeads",
    "MaskRCNNPredictor",
    "MultiScaleRoIAlign",
    "TwoMLPHead",
    "nms",
    "paste_masks_in_image",
    "roi_align",
]
