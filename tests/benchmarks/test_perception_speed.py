"""The plain backbone gives what ours gives."""

from __future__ import annotations

import pytest
import torch

from artgym.errors import InvalidArgumentError
from benchmarks.perception_speed import PerceptionSpeedConfig
from benchmarks.plain_pointnet2 import plain_features
from icaf4_policy.backbone.pointnet2 import BackboneConfig, PointNet2


@torch.no_grad()
def test_plain_features_are_those_of_the_backbone():
    torch.manual_seed(0)
    backbone = PointNet2(3, BackboneConfig(centers=(128, 32), neighbors=16))
    points, features = torch.rand(2, 400, 3), torch.rand(2, 400, 3)
    # Running statistics that differ from the start's.
    backbone.train()
    backbone(points, features)
    backbone.eval()
    expected = backbone(points, features)
    torch.testing.assert_close(
        plain_features(backbone, points, features), expected, atol=1e-4, rtol=0
    )
    assert expected.std() > 0.01


@pytest.mark.parametrize("wrong", [{"pairs": 6}, {"clouds": 0}])
def test_wrong_options(wrong):
    with pytest.raises(InvalidArgumentError, match=next(iter(wrong))):
        PerceptionSpeedConfig(**wrong)
