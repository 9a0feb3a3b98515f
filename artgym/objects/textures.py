"""Patterns of surfaces: grain, weave, stone ..., drawn from a seed, repeating without a seam.

A pattern is a shade (h, w) about 1 that scales a material's colour. Rows run down the picture, as
in an image; patterns with a direction (grain, brushing, boards) have it along the rows: along u.
"""

from __future__ import annotations

import functools
import zlib
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from artgym.errors import UnknownNameError
from artgym.objects.model import Texture, Vector

Array = NDArray[np.floating]

#: Pixels a side of the fine patterns, and of those made of bricks and boards.
SIZE, LARGE_SIZE = 128, 256
#: Shades stay in here, so that a pattern never hides its colour.
LOW, HIGH = 0.45, 1.6

_SRGB_STEPS = 4096


def linear_from_srgb(pixels: NDArray[np.uint8]) -> Array:
    """Linear RGB in [0, 1] of sRGB pixels."""
    v = pixels / 255.0
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


@functools.cache
def _srgb_table() -> NDArray[np.uint8]:
    v = np.arange(_SRGB_STEPS) / (_SRGB_STEPS - 1)
    encoded = np.where(v <= 0.0031308, 12.92 * v, 1.055 * v ** (1 / 2.4) - 0.055)
    return (255.0 * encoded + 0.5).astype(np.uint8)


@functools.lru_cache(maxsize=128)
def texture_pixels(texture: Texture, color: Vector) -> NDArray[np.uint8]:
    """The pattern in shades of a colour, (h, w, 3), sRGB; read-only.

    Args:
        texture: which pattern.
        color: linear RGB in [0, 1], the mean of what comes out unless shades are too bright to
            show.

    Raises:
        UnknownNameError: no such pattern; names the nearest.
    """
    shade = _shade(texture.pattern, texture.seed)
    scale = np.asarray(color, dtype=np.float32) * (_SRGB_STEPS - 1)
    steps = np.minimum(shade[..., None] * scale + 0.5, _SRGB_STEPS - 1).astype(np.uint16)
    pixels = _srgb_table()[steps]
    pixels.setflags(write=False)
    return pixels


@functools.lru_cache(maxsize=128)
def _shade(pattern: str, seed: int) -> NDArray[np.float32]:
    """The pattern's shade (h, w), mean 1."""
    try:
        draw = PATTERNS[pattern]
    except KeyError:
        raise UnknownNameError("pattern", pattern, PATTERNS) from None
    rng = np.random.default_rng([zlib.crc32(pattern.encode()), seed])
    shade = draw(rng).astype(np.float32)
    shade = np.clip(shade / shade.mean(), LOW, HIGH)
    shade.setflags(write=False)
    return shade


# -- pieces of patterns -------------------------------------------------------------------------


def _noise(rng: np.random.Generator, along: float, across: float, size: int = SIZE) -> Array:
    """Smooth noise (size, size) that repeats: mean 0, deviation 1.

    Args:
        rng: draws it.
        along: extent of its blobs along the rows, as a share of the picture.
        across: the same across the rows.
        size: pixels a side.
    """
    white = rng.standard_normal((size, size), dtype=np.float32)
    u = np.fft.rfftfreq(size) * size * along
    v = np.fft.fftfreq(size) * size * across
    spectrum = np.fft.rfft2(white)
    spectrum *= np.exp(-2.0 * v**2)[:, None] * np.exp(-2.0 * u**2)
    spectrum[0, 0] = 0.0
    smooth = np.fft.irfft2(spectrum, (size, size)).astype(np.float32)
    return smooth / np.float32(max(float(smooth.std()), 1e-9))


def _grid(size: int = SIZE) -> tuple[Array, Array]:
    """Coordinates u (1, size) and v (size, 1) of the pixels' middles, in [0, 1)."""
    steps = (np.arange(size) + 0.5) / size
    return steps[None, :], steps[:, None]


def _doubled(fine: Array) -> Array:
    """A pattern repeated twice each way."""
    return np.tile(fine, (2, 2))


def _cells(
    rng: np.random.Generator, rows: int, columns: int, offset: float, joint: float, spread: float
) -> tuple[Array, NDArray[np.intp]]:
    """Bricks, boards or tiles.

    Args:
        rng: draws their shades.
        rows: how many there are from top to bottom; even where an offset is given.
        columns: how many there are in a row.
        offset: by how much every other row is shifted, as a share of a brick.
        joint: half width of the joints, as a share of the picture.
        spread: deviation of the bricks' shades.

    Returns:
        The shades (h, w), 0 in the joints, and the index (h, w) of each pixel's brick.
    """
    steps = (np.arange(LARGE_SIZE) + 0.5) / LARGE_SIZE
    # All pixel rows of a row of bricks are alike: one strip (rows, w) a row, then repeated.
    x = steps * columns + offset * (np.arange(rows) % 2)[:, None]
    column = np.floor(x).astype(np.intp) % columns
    index = np.arange(rows)[:, None] * columns + column
    shades = 1.0 + spread * np.clip(rng.standard_normal(rows * columns), -2, 2)
    strip = shades[index].astype(np.float32)
    strip[np.abs(x - np.round(x)) / columns < joint] = 0.0
    row = np.floor(steps * rows).astype(np.intp)
    pixels = strip[row]
    pixels[np.abs(steps * rows - np.round(steps * rows)) / rows < joint] = 0.0
    return pixels, index[row]


# -- patterns -----------------------------------------------------------------------------------


def _grain(rng: np.random.Generator) -> Array:
    """Wood: rings cut lengthwise, and pores."""
    _, v = _grid()
    rings = int(rng.integers(7, 17))
    warp = rng.uniform(0.25, 0.8) * _noise(rng, 0.5, 0.16)
    phase = 2 * np.pi * (rings * v + warp)
    # Late wood is a narrow dark line at the end of each ring.
    late = (0.5 + 0.5 * np.sin(phase)) ** 2.2
    pores = _noise(rng, 0.18, 0.008)
    return 1.0 - rng.uniform(0.10, 0.24) * late + rng.uniform(0.025, 0.05) * pores


def _fine_grain(rng: np.random.Generator) -> Array:
    """Wood without rings: beech, maple, veneer."""
    streaks = _noise(rng, 0.35, 0.03)
    pores = _noise(rng, 0.10, 0.007)
    return 1.0 + rng.uniform(0.03, 0.06) * streaks + rng.uniform(0.03, 0.055) * pores


def _planks(rng: np.random.Generator) -> Array:
    """Boards side by side, their ends staggered."""
    rows = int(rng.choice((4, 6)))
    shade, index = _cells(rng, rows, int(rng.integers(1, 3)), 0.5, 0.0025, 0.07)
    fibre = _doubled(0.5 * _noise(rng, 0.3, 0.02) + 0.5 * _noise(rng, 0.12, 0.008))
    # Each board has its own piece of the fibre.
    shift = rng.integers(0, LARGE_SIZE, index.max() + 1)
    columns = (np.arange(LARGE_SIZE) + shift[index]) % LARGE_SIZE
    fibre = np.take_along_axis(fibre, columns, axis=1)
    return np.where(shade > 0.0, shade + np.float32(0.06) * fibre, np.float32(0.62))


def _parquet(rng: np.random.Generator) -> Array:
    """Squares of short staves, turned by a right angle in turn."""
    staves, half = int(rng.choice((4, 5))), LARGE_SIZE // 2
    across = np.arange(half) / half * staves
    joint = np.abs(across - np.round(across)) * half / staves < 0.9
    shades = 1.0 + 0.07 * np.clip(rng.standard_normal((4, staves)), -2, 2)
    fibre = 1.0 + 0.05 * _noise(rng, 0.2, 0.012)
    squares = []
    for k in range(4):
        stave = np.where(joint, 0.7, shades[k][np.floor(across).astype(np.intp)])
        square = stave[:, None] * np.roll(fibre, k * half // 4, axis=0)
        squares.append(square.T if k in (1, 2) else square)
    return np.block([squares[:2], squares[2:]])


def _brushed(rng: np.random.Generator) -> Array:
    """Metal brushed along one direction."""
    fine = _noise(rng, 0.5, 0.006)
    return 1.0 + rng.uniform(0.035, 0.065) * fine + 0.02 * _noise(rng, 0.5, 0.05)


def _speckle(rng: np.random.Generator) -> Array:
    """Powder coat, moulded plastic: fine even dots."""
    return 1.0 + rng.uniform(0.03, 0.07) * _noise(rng, 0.008, 0.008)


def _orange_peel(rng: np.random.Generator) -> Array:
    """Thick paint that dried in small waves."""
    return 1.0 + rng.uniform(0.02, 0.04) * _noise(rng, 0.022, 0.022)


def _worn(rng: np.random.Generator) -> Array:
    """Old paint or metal: pale and dark clouds, a few scratches."""
    clouds = _noise(rng, 0.12, 0.12) + 0.5 * _noise(rng, 0.03, 0.03)
    scratches = _noise(rng, 0.16, 0.007)
    return 1.0 + 0.05 * clouds + 0.10 * (scratches > 2.3)


def _granite(rng: np.random.Generator) -> Array:
    """Crystals of three shades."""
    crystals = _noise(rng, 0.016, 0.016)
    clouds = _noise(rng, 0.10, 0.10)
    shade = 1.0 + 0.05 * clouds
    return shade - 0.22 * (crystals > 0.8) + 0.16 * (crystals < -0.8)


def _terrazzo(rng: np.random.Generator) -> Array:
    """Chips of stone in a plain ground."""
    chips, kinds = _noise(rng, 0.035, 0.035), _noise(rng, 0.05, 0.05)
    edge = np.clip((np.abs(chips) - 0.9) * 6, 0.0, 1.0)
    return 1.0 + 0.22 * edge * np.sign(kinds) + 0.02 * _noise(rng, 0.008, 0.008)


def _marble(rng: np.random.Generator) -> Array:
    """Veins through clouds."""
    clouds = _noise(rng, 0.16, 0.12)
    crooked = _noise(rng, 0.05, 0.05)
    wide = np.exp(-(((clouds + 0.4 * crooked) / rng.uniform(0.10, 0.18)) ** 2))
    thin = np.exp(-(((_noise(rng, 0.12, 0.2) + 0.4 * crooked) / 0.07) ** 2))
    depth = rng.uniform(0.16, 0.32)
    return 1.0 - depth * wide - 0.6 * depth * thin + 0.03 * clouds


def _concrete(rng: np.random.Generator) -> Array:
    """Clouds at three scales, and small holes."""
    clouds = 0.5 * _noise(rng, 0.18, 0.18) + 0.4 * _noise(rng, 0.05, 0.05)
    fine = _noise(rng, 0.009, 0.009)
    return 1.0 + 0.06 * clouds + 0.04 * fine - 0.15 * (fine > 2.9)


def _weave(rng: np.random.Generator) -> Array:
    """Plain cloth: threads over and under each other."""
    u, v = _grid()
    threads = int(rng.choice((16, 21, 32)))
    over = (np.floor(u * threads) + np.floor(v * threads)) % 2
    warp = np.abs(np.sin(np.pi * threads * u))
    weft = np.abs(np.sin(np.pi * threads * v))
    depth = rng.uniform(0.12, 0.24)
    threads_ = np.where(over > 0.5, warp, weft)
    # An odd number of threads would break the alternation at the picture's edge.
    if threads % 2:
        threads_ = 0.5 * (warp + weft)
    return 1.0 + depth * (threads_ - 0.6) + 0.04 * _noise(rng, 0.05, 0.01)


def _twill(rng: np.random.Generator) -> Array:
    """Denim: slanting ribs of thread."""
    u, v = _grid()
    ribs = int(rng.integers(14, 26))
    slant = 0.5 + 0.5 * np.sin(2 * np.pi * ribs * (u + v))
    return 1.0 + rng.uniform(0.08, 0.16) * (slant - 0.5) + 0.05 * _noise(rng, 0.01, 0.04)


def _stripes(rng: np.random.Generator) -> Array:
    """Printed cloth: bands of two shades along u."""
    _, v = _grid()
    count = int(rng.integers(2, 6))
    band = (np.floor(v * 2 * count) % 2) * np.ones((1, SIZE))
    return 1.0 - rng.uniform(0.12, 0.3) * band + 0.03 * _noise(rng, 0.012, 0.012)


def _gingham(rng: np.random.Generator) -> Array:
    """Checked cloth: where bands of both directions cross it is darkest."""
    u, v = _grid()
    count = int(rng.integers(3, 7))
    crossing = (np.floor(u * 2 * count) % 2) + (np.floor(v * 2 * count) % 2)
    return 1.0 - rng.uniform(0.08, 0.17) * crossing + 0.03 * _noise(rng, 0.012, 0.012)


def _felt(rng: np.random.Generator) -> Array:
    """Felt or carpet: short fibres at random."""
    fibres = _noise(rng, 0.02, 0.007) + _noise(rng, 0.007, 0.02)
    return 1.0 + rng.uniform(0.03, 0.06) * fibres


def _cardboard(rng: np.random.Generator) -> Array:
    """Corrugated board: faint flutes under paper with fibres."""
    _, v = _grid()
    flutes = np.sin(2 * np.pi * int(rng.integers(18, 34)) * v)
    fibres = _noise(rng, 0.03, 0.008)
    return 1.0 + 0.025 * flutes + 0.035 * fibres + 0.02 * _noise(rng, 0.1, 0.1)


def _leather(rng: np.random.Generator) -> Array:
    """Small cushions between creases."""
    scale = rng.uniform(0.016, 0.028)
    creases = np.minimum(np.abs(_noise(rng, scale, scale)), np.abs(_noise(rng, scale, scale)))
    return 1.0 - rng.uniform(0.14, 0.24) * np.exp(-((creases / 0.16) ** 2))


def _carbon(rng: np.random.Generator) -> Array:
    """Twill of carbon fibre: each tow shines along its length."""
    u, v = _grid()
    tows = int(rng.choice((8, 12, 16)))
    across = (np.floor(u * tows) + np.floor(v * tows)) % 4 < 2
    shine = np.where(across, np.sin(np.pi * tows * u) ** 2, np.sin(np.pi * tows * v) ** 2)
    return 0.75 + 0.5 * shine + 0.05 * _noise(rng, 0.008, 0.03)


def _tiles(rng: np.random.Generator) -> Array:
    """Square ceramic tiles, their joints lighter or darker."""
    count = int(rng.integers(2, 6))
    shade, _ = _cells(rng, count, count, 0.0, 0.006, 0.035)
    shade[shade == 0.0] = rng.choice((0.72, 1.18))
    return shade + np.float32(0.02) * _doubled(_noise(rng, 0.08, 0.08))


def _bricks(rng: np.random.Generator) -> Array:
    """Running bond, the mortar paler."""
    rows = int(rng.choice((4, 6, 8)))
    shade, _ = _cells(rng, rows, rows // 2, 0.5, 0.007, 0.08)
    rough = _doubled(_noise(rng, 0.02, 0.02) + _noise(rng, 0.08, 0.08))
    return np.where(shade > 0.0, shade + np.float32(0.05) * rough, np.float32(1.25))


def _ribs(rng: np.random.Generator) -> Array:
    """Moulded ribs or corrugated sheet along u."""
    _, v = _grid()
    count = int(rng.integers(6, 17))
    return 1.0 + rng.uniform(0.06, 0.13) * np.sin(2 * np.pi * count * v) * np.ones((1, SIZE))


def _perforated(rng: np.random.Generator) -> Array:
    """Round holes in a sheet."""
    u, v = _grid()
    count = int(rng.integers(6, 13))
    x, y = (u * count) % 1.0 - 0.5, (v * count) % 1.0 - 0.5
    return np.where(np.hypot(x, y) < rng.uniform(0.18, 0.28), 0.55, 1.0)


def _wicker(rng: np.random.Generator) -> Array:
    """Canes over and under upright ones."""
    u, v = _grid()
    canes, posts = int(rng.choice((12, 16))), int(rng.choice((4, 6, 8)))
    row = np.floor(v * canes)
    bulge = np.cos(np.pi * (u * posts + row)) ** 2
    cane = np.sin(np.pi * ((v * canes) % 1.0)) ** 0.5
    return 0.62 + 0.32 * bulge * cane + 0.3 * cane + 0.04 * _noise(rng, 0.1, 0.01)


#: How each pattern is drawn from random numbers: a shade (h, w).
PATTERNS: dict[str, Callable[[np.random.Generator], Array]] = {
    "grain": _grain,
    "fine_grain": _fine_grain,
    "planks": _planks,
    "parquet": _parquet,
    "brushed": _brushed,
    "speckle": _speckle,
    "orange_peel": _orange_peel,
    "worn": _worn,
    "granite": _granite,
    "terrazzo": _terrazzo,
    "marble": _marble,
    "concrete": _concrete,
    "weave": _weave,
    "twill": _twill,
    "stripes": _stripes,
    "gingham": _gingham,
    "felt": _felt,
    "cardboard": _cardboard,
    "leather": _leather,
    "carbon": _carbon,
    "tiles": _tiles,
    "bricks": _bricks,
    "ribs": _ribs,
    "perforated": _perforated,
    "wicker": _wicker,
}
