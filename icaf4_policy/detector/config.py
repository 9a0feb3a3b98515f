"""What a detector is, and how it is trained."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

from artgym.datasets.sets import SETS
from artgym.errors import InvalidArgumentError

#: Strides of the pyramid's levels; pictures are padded to whole cells of the coarsest.
STRIDES = (4, 8, 16, 32)


@dataclass(frozen=True, kw_only=True)
class DetectorConfig:
    """What a detector finds and how large it is.

    Attributes:
        categories: what it tells apart, in the order of its outputs.
        input_size: (width, height) that pictures are shrunk to fit, pixels.
        use_depth: whether depth is a fourth channel beside the colours.
        widths: channels of the backbone at strides 4, 8, 16 and 32.
        blocks: residual blocks at each of them.
        pyramid_channels: channels of the feature pyramid and of the mask head.
        box_channels: hidden units of the box head.
        proposals: regions looked at in a picture, after suppression.
        detections: the most objects reported in a picture.
    """

    categories: tuple[str, ...] = SETS["reartmix"]
    input_size: tuple[int, int] = (320, 240)
    use_depth: bool = True
    widths: tuple[int, ...] = (32, 64, 96, 160)
    blocks: tuple[int, ...] = (1, 2, 2, 2)
    pyramid_channels: int = 64
    box_channels: int = 192
    proposals: int = 60
    detections: int = 20

    def __post_init__(self) -> None:
        if not self.categories or len(set(self.categories)) < len(self.categories):
            raise InvalidArgumentError(
                f"categories={self.categories} must be at least one name, each only once."
            )
        if len(self.input_size) != 2 or min(self.input_size) < 2 * STRIDES[-1]:
            raise InvalidArgumentError(
                f"input_size={self.input_size} must be (width, height), each at least "
                f"{2 * STRIDES[-1]} pixels."
            )
        for name in ("widths", "blocks"):
            if len(getattr(self, name)) != len(STRIDES):
                raise InvalidArgumentError(
                    f"{name}={getattr(self, name)} must have {len(STRIDES)} entries, one for each "
                    f"of the strides {STRIDES}."
                )
        sizes = (self.pyramid_channels, self.box_channels, self.proposals, self.detections)
        if min(*self.widths, *self.blocks, *sizes) < 1:
            raise InvalidArgumentError(f"the sizes of {self} must be at least 1.")

    @property
    def channels(self) -> int:
        """Channels of the network's input."""
        return 4 if self.use_depth else 3


@dataclass(frozen=True, kw_only=True)
class AugmentationConfig:
    """How pictures are changed at random.

    Attributes:
        flip: share of pictures that are mirrored left to right.
        zoom: spread of the logarithm of the magnification; depth shrinks with it, as if the
            camera came nearer.
        shift: largest shift, as a share of the picture's sides.
        color_jitter: spread of the changes of brightness, contrast and tint.
    """

    flip: float = 0.5
    zoom: float = 0.2
    shift: float = 0.1
    color_jitter: float = 0.2

    def __post_init__(self) -> None:
        for name in ("flip", "zoom", "shift", "color_jitter"):
            if not 0 <= getattr(self, name) <= 1:
                raise InvalidArgumentError(f"{name}={getattr(self, name)} must be in [0, 1].")


@dataclass(frozen=True, kw_only=True)
class DetectorTrainingConfig:
    """How to train a detector.

    Attributes:
        model: what it finds and how large it is.
        epochs: passes over the training pictures.
        batch_size: pictures a step.
        learning_rate: of AdamW, at its highest; it rises, and falls along half a cosine.
        weight_decay: of AdamW.
        warmup_share: share of the steps that rise, in [0, 1).
        gradient_limit: the norm that gradients are clipped to.
        precision: of the backbone's products while training.
        validate_every: epochs between validations; the last epoch is always validated.
        seed: of the weights, the order of pictures and their changes.
        augmentation: how pictures are changed at random.
    """

    model: DetectorConfig = field(default_factory=DetectorConfig)
    epochs: int = 40
    batch_size: int = 4
    learning_rate: float = 1e-3
    weight_decay: float = 1e-2
    warmup_share: float = 0.03
    gradient_limit: float = 5.0
    precision: Literal["float32", "bfloat16"] = "bfloat16"
    validate_every: int = 2
    seed: int = 0
    augmentation: AugmentationConfig = field(default_factory=AugmentationConfig)

    def __post_init__(self) -> None:
        for name in ("epochs", "batch_size", "validate_every"):
            if getattr(self, name) < 1:
                raise InvalidArgumentError(f"{name}={getattr(self, name)} must be at least 1.")
        for name in ("learning_rate", "gradient_limit"):
            if not 0 < getattr(self, name) < math.inf:
                raise InvalidArgumentError(
                    f"{name}={getattr(self, name)} must be positive and finite."
                )
        if not 0 <= self.warmup_share < 1:
            raise InvalidArgumentError(f"warmup_share={self.warmup_share} must be in [0, 1).")
