import importlib
import subprocess
import sys

import numpy as np
import pytest
import torch

from icaf4_policy.detector import torchvision_ops
from icaf4_policy.detector.torchvision_ops import nms, roi_align


def slow_nms(boxes, scores, threshold):
    kept = []
    for i in np.argsort(-scores, kind="stable"):
        for k in kept:
            low, high = (
                np.maximum(boxes[i, :2], boxes[k, :2]),
                np.minimum(boxes[i, 2:], boxes[k, 2:]),
            )
            shared = np.prod(np.maximum(high - low, 0.0))
            union = np.prod(boxes[i, 2:] - boxes[i, :2]) + np.prod(boxes[k, 2:] - boxes[k, :2])
            if shared > threshold * (union - shared):
                break
        else:
            kept.append(i)
    return np.array(kept, dtype=int)


@pytest.mark.parametrize("threshold", [0.0, 0.3, 0.7])
def test_nms_keeps_what_a_slow_loop_keeps(threshold):
    rng = np.random.default_rng(0)
    corners = rng.uniform(0, 60, (200, 2))
    boxes = np.concatenate([corners, corners + rng.uniform(0, 40, (200, 2))], axis=1)
    # Equal scores and equal boxes are the traps.
    scores = rng.integers(0, 30, 200) / 30.0
    boxes[150:] = boxes[:50]
    kept = nms(torch.from_numpy(boxes), torch.from_numpy(scores), threshold)
    assert kept.tolist() == slow_nms(boxes, scores, threshold).tolist()


def test_nms_of_nothing_is_nothing():
    assert nms(torch.zeros(0, 4), torch.zeros(0), 0.5).shape == (0,)


def bilinear(image, y, x):
    height, width = image.shape[-2:]
    if y < -1 or y > height or x < -1 or x > width:
        return np.zeros(len(image))
    y, x = np.clip(y, 0, height - 1), np.clip(x, 0, width - 1)
    rows, columns = np.arange(height), np.arange(width)
    hat_y, hat_x = np.maximum(1 - abs(rows - y), 0), np.maximum(1 - abs(columns - x), 0)
    return np.einsum("cyx,y,x->c", image, hat_y, hat_x)


def slow_roi_align(features, rois, scale, height, width, ratio, aligned):
    """One sample at a time, after the definition in the Mask R-CNN paper and torchvision's docs."""
    pooled = np.zeros((len(rois), features.shape[1], height, width))
    for n, (index, *box) in enumerate(rois):
        left, top, right, bottom = np.array(box) * scale - (0.5 if aligned else 0.0)
        tall, wide = bottom - top, right - left
        if not aligned:
            tall, wide = max(tall, 1.0), max(wide, 1.0)
        rows = ratio if ratio > 0 else int(np.ceil(tall / height))
        columns = ratio if ratio > 0 else int(np.ceil(wide / width))
        for i in range(height):
            for j in range(width):
                samples = [
                    bilinear(
                        features[int(index)],
                        top + (i + (a + 0.5) / rows) * tall / height,
                        left + (j + (b + 0.5) / columns) * wide / width,
                    )
                    for a in range(rows)
                    for b in range(columns)
                ]
                pooled[n, :, i, j] = sum(samples) / max(rows * columns, 1)
    return pooled


# Inside, over the edges, empty, far outside, and larger than the picture.
ROIS = torch.tensor(
    [
        [0, 3.2, 4.1, 17.7, 15.3],
        [1, -6.0, -4.0, 9.0, 30.0],
        [1, 5.0, 5.0, 5.0, 5.0],
        [0, 200.0, 200.0, 220.0, 240.0],
        [1, -20.0, -20.0, 80.0, 60.0],
    ],
    dtype=torch.float64,
)


@pytest.mark.parametrize("aligned", [True, False])
@pytest.mark.parametrize("ratio", [-1, 1, 2])
@pytest.mark.parametrize("scale", [1.0, 0.25])
def test_roi_align_is_what_its_definition_says(aligned, ratio, scale):
    features = torch.randn(2, 3, 9, 13, dtype=torch.float64, generator=torch.Generator())
    arguments = (scale, 3, 4, ratio, aligned)
    expected = slow_roi_align(features.numpy(), ROIS.tolist(), *arguments)
    np.testing.assert_allclose(roi_align(features, ROIS, *arguments), expected, atol=1e-12)


def test_roi_align_has_the_right_gradient():
    features = torch.randn(2, 2, 5, 6, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda x: roi_align(x, ROIS, 0.3, 2, 3, 2, False), features)


def test_roi_align_without_regions():
    features = torch.zeros(2, 3, 8, 8, requires_grad=True)
    pooled = roi_align(features, torch.zeros(0, 5), 1.0, 7, 7, 2, False)
    assert pooled.shape == (0, 3, 7, 7)
    pooled.sum().backward()


def test_torchvision_calls_these_operators():
    features, rois = torch.randn(2, 3, 9, 13), ROIS.float()
    theirs = sys.modules["torchvision.ops.roi_align"].roi_align(features, rois, (3, 4), 0.25, 2)
    ours = roi_align(features, rois, 0.25, 3, 4, 2, False)
    # Where torchvision's own are there, they are what is compared with.
    torch.testing.assert_close(theirs, ours, atol=1e-5, rtol=1e-5)
    boxes, scores = rois[:, 1:].contiguous(), torch.rand(len(rois))
    theirs = sys.modules["torchvision.ops.boxes"].nms(boxes, scores, 0.5)
    assert torch.equal(theirs, nms(boxes, scores, 0.5))


def test_loading_the_module_again_changes_nothing():
    importlib.reload(torchvision_ops)
    boxes = torch.tensor([[0.0, 0.0, 2.0, 2.0], [0.0, 0.0, 2.0, 2.1]])
    assert torch.ops.torchvision.nms(boxes, torch.tensor([0.1, 0.9]), 0.5).tolist() == [1]


def test_it_registers_even_after_torchvision_failed_to_import():
    script = (
        "try:\n    import torchvision\nexcept RuntimeError:\n    pass\n"
        "from icaf4_policy.detector import torchvision_ops\n"
        "import torchvision, torch\n"
        "print(torchvision.ops.nms(torch.zeros(0, 4), torch.zeros(0), 0.5).shape)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert "torch.Size([0])" in done.stdout
