"""Meshes written as Wavefront OBJ, with a material file and a PNG where they carry a picture."""

from __future__ import annotations

import io
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image as PillowImage

from artgym.files import write_file_whole
from artgym.objects.contents import Image, TriangleMesh
from artgym.objects.model import Convex


def file_stem(name: str) -> str:
    """A name for files made from any name: letters, digits, '_' and '-'.

    >>> file_stem("drawer/0012")
    'drawer_0012'
    """
    return re.sub(r"[^A-Za-z0-9-]+", "_", name).strip("_") or "object"


def number_text(*numbers: float) -> str:
    """Numbers between blanks that come back bit-equal."""
    return " ".join(repr(float(number)) for number in numbers)


def convex_mesh(convex: Convex) -> TriangleMesh:
    """The closed surface of a convex piece."""
    return TriangleMesh(convex.corners(), convex.triangles)


def write_obj(path: Path, mesh: TriangleMesh, picture: Image | None = None) -> None:
    """Writes a mesh, metres, to an OBJ file.

    Args:
        path: the file; a picture goes beside it to a .mtl and a .png of the same stem.
        mesh: the triangles.
        picture: what ``mesh.uv`` refers to; only with uv.

    Raises:
        FileNotWrittenError: the system refused.
    """
    lines: list[str] = []
    faces = (np.asarray(mesh.faces, dtype=np.int64) + 1).tolist()
    has_picture = picture is not None and mesh.uv is not None
    if has_picture:
        lines += [f"mtllib {path.stem}.mtl", "usemtl picture"]
    lines += [f"v {number_text(*vertex)}" for vertex in mesh.vertices]
    if mesh.uv is not None:
        lines += [f"vt {number_text(*uv)}" for uv in mesh.uv]
        lines += [f"f {a}/{a} {b}/{b} {c}/{c}" for a, b, c in faces]
    else:
        lines += [f"f {a} {b} {c}" for a, b, c in faces]
    if has_picture:
        assert picture is not None
        write_png(path.with_suffix(".png"), np.asarray(picture.pixels, dtype=np.uint8))
        material = f"newmtl picture\nKd 1.0 1.0 1.0\nmap_Kd {path.stem}.png\n"
        write_file_whole(path.with_suffix(".mtl"), material.encode())
    write_file_whole(path, ("\n".join(lines) + "\n").encode())


def write_png(path: Path, pixels: NDArray[np.uint8]) -> None:
    """Writes a picture (h, w, 3), sRGB.

    Raises:
        FileNotWrittenError: the system refused.
    """
    buffer = io.BytesIO()
    PillowImage.fromarray(pixels).save(buffer, "PNG")
    write_file_whole(path, buffer.getvalue())
