"""The detector's network: Mask R-CNN on a slim residual backbone, trained from nothing."""

from __future__ import annotations

import itertools
from collections import OrderedDict

import torch
from torch import Tensor, nn
from torch.nn import functional

from icaf4_policy.detector.config import STRIDES, DetectorConfig
from icaf4_policy.detector.torchvision_ops import (
    AnchorGenerator,
    FeaturePyramidNetwork,
    ImageList,
    MaskRCNN,
    MaskRCNNHeads,
    MaskRCNNPredictor,
    MultiScaleRoIAlign,
    TwoMLPHead,
)

#: Of the red, green and blue channels in [0, 1], and of depth in metres.
_MEAN, _SPREAD = (0.5, 0.5, 0.5, 1.0), (0.25, 0.25, 0.25, 0.5)
#: Sides of the anchors of each level, pixels of the network's input, and their height : width.
_ANCHOR_SIDES = ((24,), (44,), (80,), (144,))
_ANCHOR_RATIOS = (0.5, 1.0, 2.0)
#: Regions of at least this side are pooled from the second level, smaller ones from the first, and
#: those of twice the side from the third, pixels of the network's input.
_CANONICAL_SIDE = 112
_POOLED_BOX, _POOLED_MASK = 7, 14


def _convolution(channels_in: int, channels_out: int, stride: int = 1, side: int = 3) -> nn.Module:
    return nn.Sequential(
        nn.Conv2d(channels_in, channels_out, side, stride, padding=side // 2, bias=False),
        nn.BatchNorm2d(channels_out),
    )


class _Residual(nn.Module):
    """Two convolutions beside a shortcut."""

    def __init__(self, channels_in: int, channels_out: int, stride: int) -> None:
        super().__init__()
        self.first = _convolution(channels_in, channels_out, stride)
        self.second = _convolution(channels_out, channels_out)
        same = stride == 1 and channels_in == channels_out
        self.shortcut = (
            nn.Identity() if same else _convolution(channels_in, channels_out, stride, side=1)
        )

    def forward(self, x: Tensor) -> Tensor:
        y = self.second(functional.relu(self.first(x), inplace=True))
        return functional.relu(y + self.shortcut(x), inplace=True)


class _Pyramid(nn.Module):
    """The backbone and its feature pyramid: levels "0" (stride 4) to "3" (stride 32)."""

    def __init__(self, config: DetectorConfig) -> None:
        super().__init__()
        self.out_channels = config.pyramid_channels
        self.stem = nn.Sequential(
            _convolution(config.channels, config.widths[0], stride=2), nn.ReLU(inplace=True)
        )
        stages, width_in = [], config.widths[0]
        for width, count in zip(config.widths, config.blocks, strict=True):
            widths = [width_in, *[width] * count]
            stages.append(
                nn.Sequential(
                    *(
                        _Residual(a, b, stride=2 if i == 0 else 1)
                        for i, (a, b) in enumerate(itertools.pairwise(widths))
                    )
                )
            )
            width_in = width
        self.stages = nn.ModuleList(stages)
        self.top_down = FeaturePyramidNetwork(
            list(config.widths), config.pyramid_channels, norm_layer=nn.BatchNorm2d
        )

    def forward(self, x: Tensor) -> dict[str, Tensor]:
        x = self.stem(x)
        levels: OrderedDict[str, Tensor] = OrderedDict()
        for i, stage in enumerate(self.stages):
            x = stage(x)
            levels[str(i)] = x
        return self.top_down(levels)


class DetectorNetwork(MaskRCNN):
    """Mask R-CNN (He et al., 2017) with a small backbone and few proposals."""

    def __init__(self, config: DetectorConfig) -> None:
        classes, channels = len(config.categories) + 1, config.pyramid_channels
        levels = [str(i) for i in range(len(STRIDES))]
        super().__init__(
            _Pyramid(config),
            num_classes=None,
            rpn_anchor_generator=AnchorGenerator(_ANCHOR_SIDES, (_ANCHOR_RATIOS,) * len(STRIDES)),
            rpn_pre_nms_top_n_train=300,
            rpn_pre_nms_top_n_test=150,
            rpn_post_nms_top_n_train=200,
            rpn_post_nms_top_n_test=config.proposals,
            rpn_batch_size_per_image=128,
            box_roi_pool=_pooler(levels, _POOLED_BOX),
            box_head=TwoMLPHead(channels * _POOLED_BOX**2, config.box_channels),
            box_predictor=_BoxPredictor(config.box_channels, classes),
            box_batch_size_per_image=48,
            box_detections_per_img=config.detections,
            mask_roi_pool=_pooler(levels, _POOLED_MASK),
            mask_head=MaskRCNNHeads(channels, (channels,) * 3, 1, norm_layer=nn.BatchNorm2d),
            mask_predictor=MaskRCNNPredictor(channels, channels, classes),
        )
        self.config = config
        self.mean: Tensor
        self.spread: Tensor
        for name, values in (("mean", _MEAN), ("spread", _SPREAD)):
            shaped = torch.tensor(values[: config.channels])[:, None, None]
            self.register_buffer(name, shaped, persistent=False)

    def forward(
        self, images: Tensor, targets: list[dict[str, Tensor]] | None = None
    ) -> tuple[dict[str, Tensor], list[dict[str, Tensor]]]:
        """One pass over a batch.

        Args:
            images: float32 (B, C, h, w), see ``pictures.network_input``.
            targets: what is there, while training: for each image "boxes", float32 (n, 4), left,
                top, right, bottom; "labels", int64 (n,), index of the category plus one; "masks",
                uint8 (n, h, w).

        Returns:
            The loss terms, while training, and otherwise what is found in each image: "boxes",
            "labels" and "scores", best first, and "masks" (n, 1, 28, 28), probabilities inside
            the boxes.
        """
        height, width = images.shape[-2:]
        right, below = -width % STRIDES[-1], -height % STRIDES[-1]
        padded = functional.pad((images - self.mean) / self.spread, (0, right, 0, below))
        sizes = [(height, width)] * len(images)
        features = self.backbone(padded)
        # Half precision has too few digits for the coordinates from here on.
        with torch.autocast(images.device.type, enabled=False):
            features = {name: level.float() for name, level in features.items()}
            proposals, region_losses = self.rpn(ImageList(padded, sizes), features, targets)
            found, object_losses = self.roi_heads(features, proposals, sizes, targets)
        return {**region_losses, **object_losses}, found


class _BoxPredictor(nn.Module):
    """Category logits (n, classes) and box corrections (n, 4 classes)."""

    def __init__(self, channels: int, classes: int) -> None:
        super().__init__()
        self.category = nn.Linear(channels, classes)
        self.correction = nn.Linear(channels, 4 * classes)

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor]:
        return self.category(x), self.correction(x)


def _pooler(levels: list[str], side: int) -> MultiScaleRoIAlign:
    second = STRIDES[1].bit_length() - 1
    return MultiScaleRoIAlign(
        levels, side, 2, canonical_scale=_CANONICAL_SIDE, canonical_level=second
    )
