"""Sheets: pictures in rows, each with a heading and a legend, in one PNG file."""

from __future__ import annotations

import functools
import io
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont

from artgym.datasets.drawing import Color, draw_line, hand_lines
from artgym.geometry import transforms
from artgym.geometry.camera import project
from artgym.show import colors

Array = NDArray[np.floating]

#: Between panels and around the sheet, pixels.
GAP = 18
_TITLE_SIZE, _HEADING_SIZE, _TEXT_SIZE = 26, 18, 14
_LINE = 20
_HEADING_HEIGHT = 28
_SWATCH = 12
_RAMP_WIDTH = 110
_INK, _FAINT, _SHEET = (25, 25, 30), (95, 95, 105), (255, 255, 255)
#: Ground of a chart.
_PAPER = (246, 246, 246)
#: Lines are drawn so many times larger and averaged.
_OVERSAMPLING = 2


@functools.cache
def _font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    return ImageFont.load_default(size)


@dataclass(frozen=True, kw_only=True)
class Ramp:
    """A legend of ``colors.ramp``: what its two ends stand for."""

    low: str
    high: str


#: A colour, or none, and what it stands for.
Legend = tuple[Color | None, str] | Ramp


@dataclass(frozen=True, kw_only=True, eq=False)
class Panel:
    """A picture on a sheet.

    Attributes:
        heading: stands above it.
        image: uint8 (h, w, 3).
        legend: stands below it.
    """

    heading: str
    image: NDArray[np.uint8]
    legend: Sequence[Legend] = field(default=())


def sheet_png(title: str, text: str, rows: Sequence[Sequence[Panel]]) -> bytes:
    """A PNG file of panels in rows.

    Args:
        title: of the sheet.
        text: what a reader should know, under the title; wrapped.
        rows: panels, side by side.
    """
    width = GAP + max(sum(p.image.shape[1] + GAP for p in row) for row in rows)
    lines = _wrapped(text, width - 2 * GAP, _font(_TEXT_SIZE))
    top = GAP + _TITLE_SIZE + 12 + _LINE * len(lines) + 10
    heights = [
        _HEADING_HEIGHT + max(p.image.shape[0] + _legend_height(p) for p in row) + GAP
        for row in rows
    ]
    sheet = Image.new("RGB", (width, top + sum(heights)), _SHEET)
    draw = ImageDraw.Draw(sheet)
    draw.text((GAP, GAP), title, fill=_INK, font=_font(_TITLE_SIZE))
    for i, line in enumerate(lines):
        y = GAP + _TITLE_SIZE + 12 + _LINE * i
        draw.text((GAP, y), line, fill=_FAINT, font=_font(_TEXT_SIZE))
    for row, height in zip(rows, heights, strict=True):
        left = GAP
        for panel in row:
            draw.text((left, top), panel.heading, fill=_INK, font=_font(_HEADING_SIZE))
            sheet.paste(Image.fromarray(panel.image), (left, top + _HEADING_HEIGHT))
            _draw_legend(draw, panel, left, top + _HEADING_HEIGHT + panel.image.shape[0] + 8)
            left += panel.image.shape[1] + GAP
        top += height
    file = io.BytesIO()
    sheet.save(file, format="PNG", optimize=True)
    return file.getvalue()


def _wrapped(
    text: str, width: float, font: ImageFont.FreeTypeFont | ImageFont.ImageFont
) -> list[str]:
    """The lines of a text, none wider than ``width`` pixels where its words allow it."""
    lines: list[str] = []
    for word in text.split():
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and font.getlength(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines


def _legend_lines(panel: Panel) -> list[list[tuple[Legend, float]]]:
    """Entries of a legend, line by line, each with its place from the left, pixels."""
    width = panel.image.shape[1]
    lines: list[list[tuple[Legend, float]]] = []
    right = np.inf
    for entry in panel.legend:
        pieces: list[Legend] = [entry]
        if not isinstance(entry, Ramp):
            # What is wider than the panel goes on below, without another swatch.
            indent = 0 if entry[0] is None else _SWATCH + 6
            wrapped = _wrapped(entry[1], width - indent, _font(_TEXT_SIZE))
            pieces = [(entry[0] if i == 0 else None, line) for i, line in enumerate(wrapped)]
        for i, piece in enumerate(pieces):
            needed = _entry_width(piece)
            if i or right + needed > width:
                lines.append([])
                right = 0.0 if i == 0 or isinstance(entry, Ramp) or entry[0] is None else 18.0
            lines[-1].append((piece, right))
            right += needed + 16
    return lines


def _entry_width(entry: Legend) -> float:
    font = _font(_TEXT_SIZE)
    if isinstance(entry, Ramp):
        return font.getlength(entry.low) + font.getlength(entry.high) + _RAMP_WIDTH + 12
    return font.getlength(entry[1]) + (0 if entry[0] is None else _SWATCH + 6)


def _legend_height(panel: Panel) -> int:
    lines = len(_legend_lines(panel))
    return 8 + _LINE * lines if lines else 0


def _draw_legend(draw: ImageDraw.ImageDraw, panel: Panel, left: float, top: float) -> None:
    font = _font(_TEXT_SIZE)
    for i, line in enumerate(_legend_lines(panel)):
        y = top + _LINE * i
        for entry, offset in line:
            x = left + offset
            if isinstance(entry, Ramp):
                draw.text((x, y), entry.low, fill=_INK, font=font)
                x += font.getlength(entry.low) + 6
                for step, color in enumerate(colors.ramp(np.linspace(0, 1, _RAMP_WIDTH))):
                    fill = (int(color[0]), int(color[1]), int(color[2]))
                    draw.line((x + step, y + 2, x + step, y + 14), fill=fill)
                draw.text((x + _RAMP_WIDTH + 6, y), entry.high, fill=_INK, font=font)
                continue
            if entry[0] is not None:
                box = (x, y + 2, x + _SWATCH, y + 2 + _SWATCH)
                draw.rectangle(box, fill=entry[0], outline=_FAINT)
                x += _SWATCH + 6
            draw.text((x, y), entry[1], fill=_INK, font=font)


class Overlay:
    """Marks over a picture of things whose places in space are known.

    Args:
        rgb: uint8 (h, w, 3).
        intrinsics: (3, 3) of its camera.
        T_camera_a: (4, 4), from the frame in which places are given.
    """

    def __init__(self, rgb: NDArray[np.uint8], intrinsics: ArrayLike, T_camera_a: ArrayLike):
        self._size = rgb.shape[1], rgb.shape[0]
        large = self._size[0] * _OVERSAMPLING, self._size[1] * _OVERSAMPLING
        self._image = Image.fromarray(rgb).resize(large, Image.Resampling.NEAREST)
        self._draw = ImageDraw.Draw(self._image)
        self._intrinsics = np.diag([_OVERSAMPLING, _OVERSAMPLING, 1.0]) @ np.asarray(intrinsics)
        self._T_camera_a = np.asarray(T_camera_a, dtype=float)

    def image(self) -> NDArray[np.uint8]:
        """The picture with all marks, uint8 (h, w, 3)."""
        return np.asarray(self._image.resize(self._size, Image.Resampling.BOX))

    def line(self, points_a: ArrayLike, color: Color, width: float = 2.0) -> None:
        """A line through points (n, 3), ``width`` pixels thick, with a light rim."""
        points_camera = transforms.apply(self._T_camera_a, points_a)
        for ink, wide in ((_SHEET, width + 1.5), (color, width)):
            pixels = round(wide * _OVERSAMPLING)
            draw_line(self._draw, points_camera, self._intrinsics, ink, pixels)

    def arrow(self, start_a: ArrayLike, end_a: ArrayLike, color: Color, width: float = 3.0) -> None:
        """An arrow between two points (3,)."""
        ends_a = np.stack([np.asarray(start_a, dtype=float), np.asarray(end_a, dtype=float)])
        self.line(ends_a, color, width)
        ends = transforms.apply(self._T_camera_a, ends_a)
        if ends[:, 2].min() <= 0.01:
            return
        start, end = project(ends, self._intrinsics)
        length = float(np.linalg.norm(end - start))
        if length < 1.0:
            return
        along = (end - start) / length * 4.5 * width * _OVERSAMPLING
        across = 0.4 * np.array([-along[1], along[0]])
        head = [end, end - along + across, end - along - across]
        self._draw.polygon([(u, v) for u, v in np.array(head).tolist()], fill=color)

    def frame(self, T_a_frame: ArrayLike, length: float) -> None:
        """The axes of a frame: x red, y green, z blue."""
        T = np.asarray(T_a_frame, dtype=float)
        for i, color in enumerate(colors.AXES):
            self.arrow(T[:3, 3], T[:3, 3] + length * T[:3, i], color, 2.0)

    def hand(self, T_a_grasp: ArrayLike, color: Color) -> None:
        """An open hand at a grasp."""
        for line in hand_lines(T_a_grasp):
            self.line(line, color, 2.0)

    def dots(self, points_a: Array, fills: ArrayLike, radius: float, *, rim: bool = False) -> None:
        """Dots at points (n, 3) in their colours (n, 3), ``radius`` in pixels."""
        points_camera = transforms.apply(self._T_camera_a, points_a)
        shown = points_camera[:, 2] > 0.01
        places = project(points_camera[shown], self._intrinsics)
        r = radius * _OVERSAMPLING
        for (u, v), fill in zip(places.tolist(), np.asarray(fills)[shown].tolist(), strict=True):
            box = (u - r, v - r, u + r, v + r)
            self._draw.ellipse(box, fill=tuple(fill), outline=_INK if rim else None, width=1)

    def rectangle(self, box: ArrayLike, color: Color) -> None:
        """A frame around left, top, width, height, pixels."""
        left, top, width, height = (np.asarray(box, dtype=float) * _OVERSAMPLING).tolist()
        if width > 0 and height > 0:
            corners = (left, top, left + width, top + height)
            self._draw.rectangle(corners, outline=color, width=2 * _OVERSAMPLING)

    def tag(self, place: tuple[float, float], text: str, color: Color) -> None:
        """A short text on a disc at a pixel (u, v)."""
        u, v = (min(max(c, 11.0), s - 11.0) for c, s in zip(place, self._size, strict=True))
        u, v, r = u * _OVERSAMPLING, v * _OVERSAMPLING, 10 * _OVERSAMPLING
        self._draw.ellipse((u - r, v - r, u + r, v + r), fill=color, outline=_SHEET, width=3)
        font = _font(_TEXT_SIZE * _OVERSAMPLING)
        self._draw.text((u, v), text, fill=_SHEET, font=font, anchor="mm")


def faded(rgb: NDArray[np.uint8], share: float = 0.6) -> NDArray[np.uint8]:
    """A picture (h, w, 3) in grey, brightened towards white by a share."""
    grey = rgb.astype(float).mean(axis=-1, keepdims=True)
    return np.broadcast_to(grey + share * (255 - grey), rgb.shape).round().astype(np.uint8)


def blended(rgb: NDArray[np.uint8], tint: ArrayLike, where: ArrayLike) -> NDArray[np.uint8]:
    """A picture (h, w, 3), its grey shades tinted with colours (h, w, 3) where asked (h, w)."""
    base = faded(rgb, 0.25).astype(float)
    mixed = 0.4 * base + 0.6 * np.asarray(tint, dtype=float)
    pale = faded(rgb).astype(float)
    return np.where(np.asarray(where)[..., None], mixed, pale).round().astype(np.uint8)


def bar_chart(
    size: tuple[int, int],
    names: Sequence[str],
    shares: Sequence[float],
    notes: Sequence[str],
    highest: float,
) -> NDArray[np.uint8]:
    """A chart (h, w, 3) of shares in percent.

    Args:
        size: width and height, pixels.
        names: below the bars.
        shares: heights, in [0, 1].
        notes: above the bars.
        highest: the share that fills the chart.
    """
    width, height = size
    image = Image.new("RGB", size, _PAPER)
    draw = ImageDraw.Draw(image)
    font = _font(_TEXT_SIZE)
    bottom, top = height - 28, 30
    step = width / len(shares)
    for i, (name, share, note) in enumerate(zip(names, shares, notes, strict=True)):
        middle = (i + 0.5) * step
        y = bottom - (bottom - top) * share / highest if highest > 0 else bottom
        if y < bottom:
            draw.rectangle((middle - 0.3 * step, y, middle + 0.3 * step, bottom), fill=colors.GRASP)
        draw.text((middle, y - 3), note, fill=_INK, font=font, anchor="mb")
        draw.text((middle, bottom + 6), name, fill=_INK, font=font, anchor="mt")
    draw.line((8, bottom, width - 8, bottom), fill=_INK)
    return np.asarray(image)
