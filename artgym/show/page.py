"""A 3D page: layers of points, lines and triangles in one HTML file that needs nothing else.

``page.html`` is the viewer, plain JavaScript and WebGL 2; the scene lies in it as JSON, arrays in
base64, little-endian.
"""

from __future__ import annotations

import base64
import html
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from artgym.datasets.drawing import Color
from artgym.objects.meshes import link_triangles
from artgym.objects.model import ArticulatedObject, Link
from artgym.show import colors
from artgym.show.cast import viewing_direction
from artgym.show.solids import Solid, joined

Array = NDArray[np.floating]

#: Triangles of an object beyond these are left out, so that a page stays below 5 MB.
_MAX_TRIANGLES = 45_000


@dataclass(frozen=True, kw_only=True, eq=False)
class Layer:
    """What one checkbox switches on and off. Lengths are metres.

    Attributes:
        name: stands beside the checkbox.
        kind: how it is drawn.
        positions: (n, 3) in its link's frame; each two are a line where it is of lines.
        colors: uint8 (n, 3).
        triangles: (m, 3) indices of positions, of a mesh.
        size: diameter of points.
        link: the index of the link it moves with; 0 stands still.
        visible: whether it is on at first.
        swatch: a colour beside the name.
    """

    name: str
    kind: Literal["mesh", "lines", "points"]
    positions: Array
    colors: NDArray[np.uint8]
    triangles: NDArray[np.integer] | None = None
    size: float = 0.0
    link: int = 0
    visible: bool = True
    swatch: Color | None = None

    def _content(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "kind": self.kind,
            "positions": _base64(self.positions, "<f4"),
            "colors": _base64(self.colors, "u1"),
            "indices": None if self.triangles is None else _base64(self.triangles, "<u4"),
            "size": self.size,
            "link": self.link,
            "visible": self.visible,
            "swatch": self.swatch,
        }


@dataclass(frozen=True, kw_only=True)
class PageRamp:
    """What the colours of ``colors.ramp`` stand for: a name, and the values of both ends."""

    name: str
    low: str
    high: str

    def _content(self) -> dict[str, Any]:
        steps = colors.ramp(np.linspace(0.0, 1.0, 9)).tolist()
        return {"name": self.name, "low": self.low, "high": self.high, "colors": steps}


@dataclass(frozen=True, kw_only=True, eq=False)
class Page:
    """What a page shows. Lengths are metres, z is up.

    Attributes:
        title: of the page.
        text: what a reader should know.
        layers: in the order of their checkboxes.
        eye: (3,), where the camera is at first.
        target: (3,), what it circles.
        obj: the object whose joints get sliders, if any.
        fractions: (K - 1,) open fraction of each of its movable parts at first.
        ramp: what colours stand for, if they stand for numbers.
    """

    title: str
    text: str
    layers: Sequence[Layer]
    eye: ArrayLike
    target: ArrayLike
    obj: ArticulatedObject | None = None
    fractions: ArrayLike = field(default=())
    ramp: PageRamp | None = None

    def html(self) -> bytes:
        """The file."""
        eye, target = np.asarray(self.eye, dtype=float), np.asarray(self.target, dtype=float)
        content = {
            "title": self.title,
            "text": self.text,
            "layers": [layer._content() for layer in self.layers],
            "joints": self._joints(),
            "eye": eye.tolist(),
            "target": target.tolist(),
            "radius": float(np.linalg.norm(eye - target)),
            "ramp": None if self.ramp is None else self.ramp._content(),
        }
        # A "<" in the data could end the script element that holds it.
        scene = json.dumps(content, allow_nan=False).replace("<", "\\u003c")
        template = (files("artgym.show") / "page.html").read_text(encoding="utf-8")
        before, after = template.split("@SCENE@")
        return (before.replace("@TITLE@", html.escape(self.title)) + scene + after).encode()

    def _joints(self) -> list[dict[str, Any]]:
        if self.obj is None:
            return []
        names = self.obj.part_names
        return [
            {
                "name": joint.child,
                "type": joint.type,
                "parent": names.index(joint.parent),
                "axis": list(joint.axis),
                "pivot": list(joint.pivot),
                "closed": joint.closed,
                "open": joint.open,
                "fraction": float(fraction),
            }
            for joint, fraction in zip(self.obj.joints, np.asarray(self.fractions), strict=True)
        ]


def _base64(array: ArrayLike, dtype: str) -> str:
    return base64.b64encode(np.ascontiguousarray(array, dtype=dtype).tobytes()).decode()


def start_eye(points: Array) -> tuple[Array, Array]:
    """Eye and target (3,) of a camera that sees all points (n, 3) of an object."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2
    return middle + 1.7 * float(np.linalg.norm(high - low)) * viewing_direction(), middle


def solid_layer(name: str, solids: Iterable[tuple[Solid, Color]], **more: Any) -> Layer:
    """A layer of solids in their colours; ``more`` are fields of ``Layer``."""
    colored = list(solids)
    vertices, triangles = joined(solid for solid, _ in colored)
    paint = [color for (points, _), color in colored for _ in points]
    return Layer(
        name=name,
        kind="mesh",
        positions=vertices,
        colors=np.array(paint, dtype=np.uint8).reshape(-1, 3),
        triangles=triangles,
        **more,
    )


def object_layers(obj: ArticulatedObject) -> list[Layer]:
    """A layer a link: what is seen of it, in the colours of its materials.

    Of an object with very many triangles only the largest are kept.
    """
    counts = [len(link_triangles(link)[0]) for link in obj.links]
    share = min(1.0, _MAX_TRIANGLES / sum(counts))
    return [
        _link_layer(link, i, int(share * count))
        for i, (link, count) in enumerate(zip(obj.links, counts, strict=True))
    ]


def _link_layer(link: Link, index: int, most: int) -> Layer:
    triangles, piece = link_triangles(link)
    if len(triangles) > most:
        a, b, c = triangles.swapaxes(0, 1)
        area = np.linalg.norm(np.cross(b - a, c - a), axis=-1)
        kept = np.sort(np.argsort(-area, kind="stable")[:most])
        triangles, piece = triangles[kept], piece[kept]
    paint = colors.piece_colors(link)[np.repeat(piece, 3)]
    # One vertex for all corners with the same place and colour.
    corners = np.concatenate([triangles.reshape(-1, 3), paint], axis=1).astype("<f4")
    unique, inverse = np.unique(corners, axis=0, return_inverse=True)
    return Layer(
        name=link.name,
        kind="mesh",
        positions=unique[:, :3],
        colors=unique[:, 3:].astype(np.uint8),
        triangles=inverse.reshape(-1, 3),
        link=index,
    )
