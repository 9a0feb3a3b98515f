"""A linear layer that stays in single precision when the rest is trained in less."""

from __future__ import annotations

import torch
from torch import Tensor, nn


class ExactLinear(nn.Linear):
    """For layers that read coordinates or write predictions: bfloat16 would round metres to mm."""

    def forward(self, input: Tensor) -> Tensor:
        """(..., out_features), float32."""
        with torch.autocast(input.device.type, enabled=False):
            return super().forward(input.float())
