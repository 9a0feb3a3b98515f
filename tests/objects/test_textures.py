"""Patterns repeat without a seam, keep their colour, and come out the same everywhere."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from artgym.errors import UnknownNameError
from artgym.objects.model import Texture
from artgym.objects.procedural import shapes
from artgym.objects.textures import PATTERNS, linear_from_srgb, texture_pixels

ROOT = Path(__file__).resolve().parents[2]
COLOR = (0.45, 0.3, 0.2)
#: Patterns without bands, cells or veins: no line is sharper than the others.
SMOOTH = (
    "grain", "fine_grain", "brushed", "speckle", "orange_peel", "worn", "granite", "terrazzo",
    "concrete", "twill", "felt", "cardboard", "leather",
)  # fmt: skip


def pixels(pattern: str, seed: int = 3) -> np.ndarray:
    return texture_pixels(Texture(pattern=pattern, seed=seed), COLOR)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_square_picture_of_the_colour(pattern):
    picture = pixels(pattern)
    assert picture.dtype == np.uint8
    assert picture.shape in [(128, 128, 3), (256, 256, 3)]
    mean = linear_from_srgb(picture).mean(axis=(0, 1))
    np.testing.assert_allclose(mean, COLOR, rtol=0.05)
    # The pattern is seen, but does not hide the colour.
    deviation = (linear_from_srgb(picture) / COLOR).mean(axis=-1).std()
    assert 0.01 < deviation < 0.25


@pytest.mark.parametrize("pattern", PATTERNS)
def test_no_seam_where_a_picture_meets_its_repeat(pattern):
    for seed in range(4):
        shade = linear_from_srgb(pixels(pattern, seed)).mean(axis=-1)
        for axis in (0, 1):
            steps = np.abs(np.diff(shade, axis=axis))
            across = np.abs(np.take(shade, 0, axis) - np.take(shade, -1, axis))
            largest = steps.mean(axis=1 - axis).max()
            assert across.mean() <= 1.5 * largest + 1e-3
            if pattern in SMOOTH:
                assert across.mean() <= 1.6 * steps.mean() + 1e-3


@pytest.mark.parametrize("pattern", PATTERNS)
def test_seeds_differ(pattern):
    assert not np.array_equal(pixels(pattern, 1), pixels(pattern, 2))


def test_same_in_a_fresh_process():
    script = (
        "import hashlib, json; from artgym.objects.model import Texture\n"
        "from artgym.objects.textures import PATTERNS, texture_pixels\n"
        f"show = lambda p: texture_pixels(Texture(pattern=p, seed=3), {COLOR})\n"
        "digest = lambda p: hashlib.sha256(show(p).tobytes()).hexdigest()\n"
        "print(json.dumps({p: digest(p) for p in reversed(PATTERNS)}))"
    )
    process = subprocess.run(
        [sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True
    )
    here = {p: hashlib.sha256(pixels(p).tobytes()).hexdigest() for p in PATTERNS}
    assert json.loads(process.stdout) == here


def test_an_unknown_pattern_names_the_nearest():
    with pytest.raises(UnknownNameError, match="brushed"):
        texture_pixels(Texture(pattern="brushd"), COLOR)


def test_materials_have_known_patterns():
    rng = np.random.default_rng(0)
    makers = (
        shapes.wood, shapes.painted, shapes.metal, shapes.plastic, shapes.cardboard,
        shapes.leather, shapes.fabric, shapes.ceramic, shapes.stone, shapes.rubber,
        shapes.dark_glass, shapes.carbon_fiber, shapes.wicker,
    )  # fmt: skip
    for maker in makers:
        for _ in range(40):
            material = maker(rng)
            assert all(0.0 <= c <= 1.0 for c in material.color)
            assert material.texture is None or material.texture.pattern in PATTERNS
            assert shapes.darker(material, 0.5).texture == material.texture


def test_textures_draw_nothing_from_the_stream():
    """The forms of objects follow in the same stream: four, four or five, and five draws."""
    counts = {shapes.wood: {4}, shapes.painted: {4, 5}, shapes.metal: {5}}
    for maker, allowed in counts.items():
        for seed in range(50):
            rng = np.random.default_rng(seed)
            maker(rng)
            after = rng.random()
            plain = np.random.default_rng(seed)
            draws = plain.random(8)
            assert int(np.argmax(draws == after)) in allowed


def test_most_wood_has_grain_and_most_paint_is_plain():
    rng = np.random.default_rng(1)
    grained = [shapes.wood(rng).texture is not None for _ in range(200)]
    patterned = [shapes.painted(rng).texture is not None for _ in range(200)]
    assert np.mean(grained) > 0.7
    assert 0.2 < np.mean(patterned) < 0.6
