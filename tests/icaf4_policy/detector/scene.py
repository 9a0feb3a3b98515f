"""Coloured boxes on a grey table, seen from above: small pictures with exact boxes and masks."""

from __future__ import annotations

import dataclasses

import numpy as np

from artgym.datasets.sample import Picture
from tests.icaf4_policy.toy import toy_picture

WIDTH, HEIGHT = 160, 120
COLORS = {"mug": (200, 40, 40), "pan": (40, 60, 200)}


def scene(seed: int = 0) -> Picture:
    """A mug in the left half and a pan in the right, of random sizes."""
    rng = np.random.default_rng(seed)
    rgb = rng.integers(110, 140, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    depth = np.full((HEIGHT, WIDTH), 1.0, dtype=np.float32)
    instance_mask = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    samples, sample = [], toy_picture().samples[0]
    for index, (category, color) in enumerate(COLORS.items()):
        width, height = rng.integers(30, 60, 2)
        left = index * WIDTH // 2 + rng.integers(0, WIDTH // 2 - width)
        top = rng.integers(0, HEIGHT - height)
        here = np.s_[top : top + height, left : left + width]
        rgb[here], depth[here], instance_mask[here] = color, 0.9, index + 1
        box = np.array([left, top, width, height], dtype=np.float32)
        samples.append(dataclasses.replace(sample, object_id=f"{category}/{seed:04d}", box=box))
    return dataclasses.replace(
        toy_picture(),
        rgb=rgb,
        depth=depth,
        instance_mask=instance_mask,
        part_mask=np.minimum(instance_mask, 1),
        samples=tuple(samples),
    )
