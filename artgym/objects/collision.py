"""Convex pieces of a triangle mesh: what the simulator collides with.

A mesh falls into its connected solids. A solid that fills its own convex hull is one piece; any
other is decomposed by CoACD (Wei et al., "Approximate Convex Decomposition for 3D Meshes with
Collision-Aware Concavity and Tree Search", 2022). Pieces are kept on disk by the mesh's content.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.util
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components
from scipy.spatial import ConvexHull, KDTree, QhullError

from artgym.errors import (
    AssetError,
    DamagedFileError,
    FileNotWrittenError,
    InvalidArgumentError,
    MissingDependencyError,
)
from artgym.files import read_arrays, write_arrays
from artgym.objects.contents import TriangleMesh
from artgym.objects.model import Convex

Array = NDArray[np.floating]
Faces = NDArray[np.integer]

#: Environment variable that names the folder of what can be computed again.
CACHE_VARIABLE = "ARTGYM_CACHE"
#: Raised by one with each change of the pieces that a mesh gives.
ALGORITHM_VERSION = 1

#: How far pieces should lie from the mesh's surface at most, metres.
GOAL = 0.002
#: A solid whose surface is nowhere deeper below its hull than this, metres, is its hull.
FLAT = 0.001
#: And so is one that fills this share of its hull, if it keeps to ``GOAL``.
FULL = 0.98
#: Most points of a piece and most pieces of a mesh.
MAX_POINTS, MAX_PIECES = 64, 64
#: Least thickness of a piece, metres: what is thinner is thickened.
THICKNESS = 0.001
#: Seconds in which a mesh must be done.
TIME_LIMIT = 240.0

#: Two vertices nearer than this share of the mesh's size are one.
_WELD = 1e-6
#: Points on which surfaces are compared.
_SAMPLES = 6000
#: A piece of more points than allowed is split as long as it would lose more than this, metres.
_MAX_LOSS = 0.0008
#: Points that make less of a difference, metres, are left out; the simulator does not see them.
_NO_LOSS = 0.0001
_MAX_SPLITS = 3
#: CoACD's thresholds: concavity over half the longest side. Below 0.01 it does not end.
_MIN_THRESHOLD, _MAX_THRESHOLD = 0.01, 0.2
#: Coarse first: many meshes need no more.
_THRESHOLD_FACTORS = (3.0, 1.0)
#: Cells along the longest side when a surface with holes is made a solid.
_VOXELS = 80
#: A hole is closed by a flat cap when all caps together have at most this share of the area.
_MAX_CAP = 0.1
#: Larger meshes are always remeshed first.
_MAX_FACES = 60_000
_SEED = 0


def convex_pieces(
    mesh: TriangleMesh, *, name: str = "mesh", time_limit: float = TIME_LIMIT
) -> tuple[Convex, ...]:
    """Convex pieces whose union is the solid that a mesh shows.

    The same mesh gives the same pieces; the second time they come from ``cache_folder()``.

    Args:
        mesh: any triangles: closed or not, in one part or many.
        name: what it is called in messages.
        time_limit: seconds.

    Returns:
        At most ``MAX_PIECES`` pieces of at most ``MAX_POINTS`` points, in the mesh's frame.

    Raises:
        AssetError: there is no solid in it, or it was not done in time.
        MissingDependencyError: the mesh needs a decomposition and coacd is not installed.
    """
    path = _cache_path(mesh)
    pieces = _cached(path)
    if pieces is None:
        try:
            pieces = _decomposed(mesh, name, time.monotonic() + time_limit)
        except QhullError as error:
            said = " ".join(str(error).split())[:80]
            raise AssetError(name, "no hull around it", value=said, remedy=_REMEDY) from None
        # A cache that cannot be written costs time and nothing else.
        with contextlib.suppress(FileNotWrittenError):
            write_arrays(path, {f"{i:04d}": p.corners() for i, p in enumerate(pieces)})
    return pieces


def facing_outwards(mesh: TriangleMesh) -> TriangleMesh:
    """The mesh with the faces of its closed parts seen counter-clockwise from outside.

    Parts that are open stay as they are: what is outside of them only their author knows.
    """
    vertices = np.asarray(mesh.vertices)
    inside_out = np.zeros(len(mesh.faces), dtype=bool)
    for welded, faces, rows in _parts(mesh):
        turned = _oriented(faces)
        if not _is_closed(turned):
            continue
        if _volume(welded, turned) < 0:
            turned = turned[:, ::-1]
        # Of the same three corners, an odd permutation is the other side.
        inside_out[rows] = ~_same_turn(faces, turned)
    if not inside_out.any():
        return mesh
    faces = mesh.faces.copy()
    faces[inside_out] = faces[inside_out][:, ::-1]
    return TriangleMesh(vertices, faces, mesh.uv)


def _same_turn(faces: Faces, others: Faces) -> NDArray[np.bool_]:
    """Whether triangles of the same corners go the same way round."""
    first = (others == faces[:, :1]).argmax(axis=1)
    following = others[np.arange(len(others)), (first + 1) % 3]
    return following == faces[:, 1]


def surface_gap(mesh: TriangleMesh, pieces: Sequence[Convex]) -> float:
    """Largest distance of a mesh's surface from the union of pieces, metres, on sample points.

    Inside the union it is the depth below the surface of one piece: a lower bound.
    """
    solids = _solids(mesh)
    points = np.concatenate([_surface_points(v, f, _SAMPLES) for v, f in solids])
    return _gap(points, [p.corners() for p in pieces])


def cache_folder() -> Path:
    """Where pieces are kept: ``$ARTGYM_CACHE/convex``, by default ``~/.cache/artgym/convex``."""
    given = os.environ.get(CACHE_VARIABLE)
    return (Path(given) if given else Path.home() / ".cache" / "artgym") / "convex"


def _cache_path(mesh: TriangleMesh) -> Path:
    digest = hashlib.sha256()
    digest.update(f"{ALGORITHM_VERSION} {_coacd_version()} ".encode())
    # How the mesh is pictured does not matter.
    digest.update(TriangleMesh(mesh.vertices, mesh.faces).digest.encode())
    return cache_folder() / f"{digest.hexdigest()}.h5"


def _coacd_version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("coacd")
    except PackageNotFoundError:
        return "none"


def _cached(path: Path) -> tuple[Convex, ...] | None:
    """Pieces kept earlier; None where there are none, or none that can be read."""
    if not path.is_file():
        return None
    try:
        arrays, _ = read_arrays(path)
        return tuple(_convex(points) for points in arrays.values()) or None
    except (DamagedFileError, InvalidArgumentError, TypeError, ValueError):
        return None


def _convex(points: Array) -> Convex:
    return Convex(points=tuple((float(x), float(y), float(z)) for x, y, z in points))


# -- the whole mesh ----------------------------------------------------------------------------


def _decomposed(mesh: TriangleMesh, name: str, deadline: float) -> tuple[Convex, ...]:
    solids = _solids(mesh)
    if not solids:
        raise AssetError(
            name,
            "no triangle has an area",
            value=f"{len(mesh.faces)} faces",
            remedy="Export the mesh again.",
        )
    hulls: list[Array] = []
    closed, opened = [], []
    for vertices, faces in solids:
        hull = _own_hull(vertices, faces)
        if hull is not None:
            hulls.append(hull)
            continue
        whole = _capped(vertices, faces) if len(faces) <= _MAX_FACES else None
        if whole is not None:
            closed.append(whole)
        else:
            opened.append((vertices, faces))
    for i, (vertices, faces) in enumerate(closed):
        tries = [(vertices, faces, 0), (vertices, faces, _VOXELS)]
        now = time.monotonic()
        share = (deadline - now) / (len(closed) - i + bool(opened))
        hulls += _best_decomposition(tries, name, now + share)
    if opened:
        # What is open may only together enclose anything.
        hulls += _best_decomposition(_closings(*_joined(opened)), name, deadline)
    hulls = _merged(_without_inner(hulls), MAX_PIECES)
    pieces = [piece for hull in hulls for piece in _few_points(hull, _MAX_SPLITS)]
    return tuple(_convex(points) for points in pieces)


def _solids(mesh: TriangleMesh) -> list[tuple[Array, Faces]]:
    """Connected parts, welded, facing outwards; what is smaller than ``GOAL`` is dust."""
    parts = _parts(mesh)
    if not parts:
        return []
    size = float(np.ptp(np.concatenate([v for v, _, _ in parts]), axis=0).max())
    solids = []
    for vertices, faces, _ in parts:
        # A face that lies there twice, from either side, makes a surface that encloses nothing.
        _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
        faces = _oriented(faces[np.sort(first)])
        if np.ptp(vertices, axis=0).max() > min(GOAL, 0.02 * size):
            if _is_closed(faces) and _volume(vertices, faces) < 0:
                faces = faces[:, ::-1]
            solids.append((vertices, faces))
    return solids


def _parts(mesh: TriangleMesh) -> list[tuple[Array, Faces, NDArray[np.integer]]]:
    """Connected parts without empty faces: vertices, welded; faces; and their rows in the mesh."""
    vertices = np.asarray(mesh.vertices)
    size = float(np.ptp(vertices, axis=0).max(initial=0.0)) if len(vertices) else 0.0
    if size == 0.0:
        return []
    _, first, inverse = np.unique(
        np.round(vertices / (size * _WELD)).astype(np.int64),
        axis=0,
        return_index=True,
        return_inverse=True,
    )
    vertices, faces = vertices[first], inverse.reshape(-1)[mesh.faces]
    distinct = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
    rows = np.flatnonzero(distinct & (2 * _areas(vertices, faces) > (size * _WELD) ** 2))
    if not len(rows):
        return []
    faces = faces[rows]
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]]])
    graph = coo_matrix((np.ones(len(edges)), edges.T), shape=(len(vertices),) * 2)
    of_face = connected_components(graph, directed=False)[1][faces[:, 0]]
    order = np.argsort(of_face, kind="stable")
    parts = []
    for group in np.split(order, np.flatnonzero(np.diff(of_face[order])) + 1):
        used, local = np.unique(faces[group], return_inverse=True)
        parts.append((vertices[used], local.reshape(-1, 3), rows[group]))
    return parts


def _joined(solids: Sequence[tuple[Array, Faces]]) -> tuple[Array, Faces]:
    offsets = np.cumsum([0, *(len(v) for v, _ in solids)])
    return (
        np.concatenate([v for v, _ in solids]),
        np.concatenate([f + offset for (_, f), offset in zip(solids, offsets, strict=False)]),
    )


def _edges(faces: Faces) -> tuple[Faces, NDArray[np.integer]]:
    """Undirected edges (m, 2) and how many faces each is of."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    return np.unique(np.sort(pairs, axis=1), axis=0, return_counts=True)


def _oriented(faces: Faces) -> Faces:
    """A connected surface with its faces turned alike, as far as it has two sides."""
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    owner = np.tile(np.arange(len(faces)), 3)
    order = np.lexsort((directed.max(axis=1), directed.min(axis=1)))
    low_high = np.sort(directed[order], axis=1)
    starts = np.flatnonzero(np.any(np.diff(low_high, axis=0, prepend=-1), axis=1))
    pairs = starts[np.diff(np.append(starts, len(order))) == 2]
    first, second = order[pairs], order[pairs + 1]
    # Two faces may share two edges: the first one tells.
    joints, chosen = np.unique(
        np.sort(np.stack([owner[first], owner[second]], axis=1), axis=1), axis=0, return_index=True
    )
    turned = (directed[first, 0] == directed[second, 0])[chosen]
    weights = np.where(turned, 2.0, 1.0)
    graph = coo_matrix((weights, joints.T), shape=(len(faces),) * 2).tocsr()
    graph = graph + graph.T
    flipped = np.zeros(len(faces), dtype=bool)
    seen = np.zeros(len(faces), dtype=bool)
    for start in range(len(faces)):
        if seen[start]:
            continue
        found, before = breadth_first_order(graph, start)
        seen[found] = True
        for face in found[1:]:
            flipped[face] = flipped[before[face]] ^ (graph[face, before[face]] == 2.0)
    faces = faces.copy()
    faces[flipped] = faces[flipped][:, ::-1]
    return faces


def _is_closed(faces: Faces) -> bool:
    return bool(np.all(_edges(faces)[1] == 2))


def _volume(vertices: Array, faces: Faces) -> float:
    a, b, c = vertices[faces].swapaxes(0, 1)
    return float(np.einsum("ij,ij->", a - vertices[0], np.cross(b - vertices[0], c - vertices[0])))


def _areas(vertices: Array, faces: Faces) -> Array:
    a, b, c = vertices[faces].swapaxes(0, 1)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


def _surface_points(vertices: Array, faces: Faces, count: int) -> Array:
    """All vertices, and about ``count`` points spread evenly over the surface."""
    area = _areas(vertices, faces)
    rng = np.random.default_rng(_SEED)
    # Even spacing along the summed areas, so that no region stays without points.
    steps = (np.arange(count) + rng.random()) / count * area.sum()
    chosen = np.minimum(np.searchsorted(np.cumsum(area), steps), len(faces) - 1)
    u, v = rng.random((2, count, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    a, b, c = vertices[faces[chosen]].swapaxes(0, 1)
    return np.concatenate([vertices, a + u * (b - a) + v * (c - a)])


# -- hulls -------------------------------------------------------------------------------------


def _hull(points: Array) -> ConvexHull:
    return ConvexHull(points)


def _thickened(points: Array) -> Array:
    """The points, or where they are flatter than ``THICKNESS``, copies on both sides of them."""
    _, spread, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    del spread
    for axis in axes:
        height = points @ axis
        if np.ptp(height) < THICKNESS:
            shift = (THICKNESS - np.ptp(height)) / 2 * axis
            points = np.concatenate([points - shift, points + shift])
    return points


def _height(points: Array, hull: ConvexHull) -> Array:
    """Height (n,) of points above a hull's nearest face plane; negative inside."""
    height = np.full(len(points), -np.inf)
    # In blocks, lest a round hull of many faces take all memory.
    for normals, offsets in zip(
        np.array_split(hull.equations[:, :3], len(hull.equations) // 256 + 1),
        np.array_split(hull.equations[:, 3], len(hull.equations) // 256 + 1),
        strict=True,
    ):
        np.maximum(height, (points @ normals.T + offsets).max(axis=1), out=height)
    return height


def _own_hull(vertices: Array, faces: Faces) -> Array | None:
    """The hull's points (n, 3) of a solid that is as good as its hull; None of any other."""
    points = _thickened(vertices)
    try:
        hull = _hull(points)
    except QhullError:
        return None
    surface = _surface_points(vertices, faces, _SAMPLES)
    depth = -float(_height(surface, hull).min())
    if _is_closed(faces) and depth <= GOAL and _volume(vertices, faces) / 6 >= FULL * hull.volume:
        return points[hull.vertices]
    if depth > FLAT:
        return None
    # The surface of a bowl keeps near to the hull too, which has a lid that the bowl has not.
    around = _surface_points(points, hull.simplices, _SAMPLES // 2)
    spacing = np.sqrt(_areas(vertices, faces).sum() / _SAMPLES)
    far = KDTree(surface).query(around)[0].max()
    return points[hull.vertices] if far <= THICKNESS + FLAT + 3 * spacing else None


def _gap(points: Array, hulls: Sequence[Array]) -> float:
    """Largest distance of points from the surface of the union of hulls."""
    height = np.full(len(points), np.inf)
    for hull in hulls:
        np.minimum(height, _height(points, _hull(hull)), out=height)
    return float(np.abs(height).max())


def _without_inner(hulls: list[Array]) -> list[Array]:
    """Hulls that do not lie inside another one."""
    solids = [_hull(points) for points in hulls]
    order = np.argsort([-s.volume for s in solids], kind="stable")
    kept: list[int] = []
    for i in order:
        low, high = hulls[i].min(axis=0), hulls[i].max(axis=0)
        holders = [
            k
            for k in kept
            if np.all(solids[k].min_bound <= low + 1e-6)
            and np.all(high <= solids[k].max_bound + 1e-6)
        ]
        if not any(_height(hulls[i], solids[k]).max() <= 1e-6 for k in holders):
            kept.append(int(i))
    return [hulls[i] for i in sorted(kept)]


def _merged(hulls: list[Array], most: int) -> list[Array]:
    """At most so many hulls: those whose common hull adds the least volume are joined first."""
    pieces = {i: _hull(points) for i, points in enumerate(hulls)}
    cost: dict[tuple[int, int], float] = {}
    while len(pieces) > most:
        keys = sorted(pieces)
        middles = np.array([(pieces[k].min_bound + pieces[k].max_bound) / 2 for k in keys])
        neighbours = np.asarray(KDTree(middles).query(middles, k=min(8, len(keys)))[1])
        pairs = {
            (min(keys[a], keys[b]), max(keys[a], keys[b]))
            for a, row in enumerate(neighbours)
            for b in row
            if a != b
        }
        for i, k in sorted(pairs - cost.keys()):
            both = _hull(np.concatenate([_corners(pieces[i]), _corners(pieces[k])]))
            cost[i, k] = both.volume - pieces[i].volume - pieces[k].volume
        i, k = min(pairs, key=lambda pair: (cost[pair], pair))
        joined = np.concatenate([_corners(pieces.pop(i)), _corners(pieces.pop(k))])
        pieces[max(keys) + 1] = _hull(joined)
    return [_corners(pieces[k]) for k in sorted(pieces)]


def _corners(hull: ConvexHull) -> Array:
    return hull.points[hull.vertices]


def _few_points(points: Array, splits: int) -> Iterator[Array]:
    """The hull of many points as one of few, or as several where one would lose too much."""
    points = points[_hull(points).vertices]
    chosen, loss = _greedy_points(points)
    if loss <= _MAX_LOSS or splits == 0:
        yield chosen
        return
    for half in _halves(points):
        yield from _few_points(half, splits - 1)


def _greedy_points(points: Array) -> tuple[Array, float]:
    """Points of a hull, each the farthest outside the hull of those before it.

    Returns:
        At most ``MAX_POINTS`` points, fewer where they lose nothing; and how far the farthest of
        all others lies outside their hull, metres.
    """
    directions = np.concatenate([np.eye(3), -np.eye(3), [[1, 1, 1], [-1, -1, 1], [-1, 1, -1]]])
    chosen = list(np.unique((points @ directions.T).argmax(axis=0)))
    try:
        _hull(points[chosen])
    except QhullError:
        # The extreme points alone can lie in one plane.
        chosen = list(np.unique([*chosen, *_corners_of_simplex(points)]))
    while True:
        height = _height(points, _hull(points[chosen]))
        farthest = int(height.argmax())
        loss = max(float(height[farthest]), 0.0)
        if len(chosen) == min(MAX_POINTS, len(points)) or loss < _NO_LOSS:
            return points[chosen], loss
        chosen.append(farthest)


def _corners_of_simplex(points: Array) -> list[int]:
    """Indices of four points that do not lie in one plane, if there are such."""
    first = int(points[:, np.ptp(points, axis=0).argmax()].argmin())
    arms = points - points[first]
    second = int(np.linalg.norm(arms, axis=1).argmax())
    areas = np.cross(arms, arms[second])
    third = int(np.linalg.norm(areas, axis=1).argmax())
    return [first, second, third, int(np.abs(arms @ areas[third]).argmax())]


def _halves(points: Array) -> tuple[Array, Array]:
    """A hull's points on either side of the plane across the middle of its longest side."""
    axis = int(np.ptp(points, axis=0).argmax())
    height = points[:, axis] - (points[:, axis].min() + points[:, axis].max()) / 2
    a, b = _edges(_hull(points).simplices)[0].T
    crossing = height[a] * height[b] < 0
    a, b = a[crossing], b[crossing]
    share = (height[a] / (height[a] - height[b]))[:, None]
    cut = points[a] + share * (points[b] - points[a])
    return (
        np.concatenate([points[height <= 0], cut]),
        np.concatenate([points[height >= 0], cut]),
    )


# -- decomposition -----------------------------------------------------------------------------


def _closings(vertices: Array, faces: Faces) -> Iterator[tuple[Array, Faces, int]]:
    """Ways to make a solid of an open surface, the most faithful first.

    Yields:
        Vertices, faces, and with how many cells CoACD is to remesh them, 0 for not at all.
    """
    if len(faces) <= _MAX_FACES // 4:
        shell = _shell(vertices, faces)
        if shell is not None:
            yield *shell, 0
    yield vertices, faces, _VOXELS


def _directed_border(faces: Faces) -> Faces | None:
    """Directed edges (m, 2) of one face only; None unless the surface has two sides."""
    pairs = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    found, count = np.unique(pairs, axis=0, return_counts=True)
    if np.any(count > 1):
        return None
    _, counts = _edges(faces)
    if np.any(counts > 2):
        return None
    present = {(int(a), int(b)) for a, b in found}
    return np.array([(a, b) for a, b in sorted(present) if (b, a) not in present]).reshape(-1, 2)


def _capped(vertices: Array, faces: Faces) -> tuple[Array, Faces] | None:
    """The surface with a fan in each hole; None where the holes are large or have no clear rim."""
    # Where three faces meet at an edge, a hole is easier to close than the edge is to part.
    edges, counts = _edges(faces)
    crowded = {(int(a), int(b)) for a, b in edges[counts > 2]}
    corners = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1), axis=-1)
    if crowded:
        bad = [any((int(a), int(b)) in crowded for a, b in of_face) for of_face in corners]
        faces = faces[~np.array(bad)]
        if not len(faces):
            return None
    border = _directed_border(faces)
    if border is None or not len(border):
        return None if border is None else (vertices, faces)
    following: dict[int, list[int]] = {}
    for a, b in border:
        following.setdefault(int(a), []).append(int(b))
    points, fans = [vertices], []
    while following:
        path = [min(following)]
        while True:
            after = following.get(path[-1])
            if not after:
                return None
            vertex = after.pop(0)
            if not after:
                del following[path[-1]]
            if vertex in path:
                # A rim may touch itself: what has come round is one hole.
                start = path.index(vertex)
                rim = path[start:]
                middle = len(vertices) + len(points) - 1
                points.append(vertices[rim].mean(axis=0)[None])
                fans += [(b, a, middle) for a, b in zip(rim, [*rim[1:], vertex], strict=True)]
                path = path[: start + 1]
                if start == 0:
                    break
            else:
                path.append(vertex)
    all_points, caps = np.concatenate(points), np.array(fans)
    if _areas(all_points, caps).sum() > _MAX_CAP * _areas(vertices, faces).sum():
        return None
    closed = np.concatenate([faces, caps])
    if _volume(all_points, closed) < 0:
        closed = closed[:, ::-1]
    return all_points, closed


def _shell(vertices: Array, faces: Faces) -> tuple[Array, Faces] | None:
    """The surface given a thickness of ``THICKNESS``; None unless it has two sides."""
    border = _directed_border(faces)
    if border is None:
        return None
    a, b, c = vertices[faces].swapaxes(0, 1)
    weighted = np.cross(b - a, c - a)
    normals = np.zeros_like(vertices)
    for corner in faces.T:
        np.add.at(normals, corner, weighted)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    count = len(vertices)
    inner = faces[:, ::-1] + count
    a, b = border.T
    rims = np.concatenate(
        [np.stack([b, a, a + count], axis=1), np.stack([b, a + count, b + count], axis=1)]
    )
    shift = THICKNESS / 2 * normals
    return (
        np.concatenate([vertices + shift, vertices - shift]),
        np.concatenate([faces, inner, rims]),
    )


def _best_decomposition(
    closings: Sequence[tuple[Array, Faces, int]] | Iterator[tuple[Array, Faces, int]],
    name: str,
    deadline: float,
) -> list[Array]:
    """The pieces of the first try that keeps to ``GOAL``, or else of the nearest one."""
    best: tuple[float, list[Array]] | None = None
    surface: Array | None = None
    for vertices, faces, voxels in closings:
        surface = _surface_points(vertices, faces, _SAMPLES) if surface is None else surface
        half = float(np.ptp(vertices, axis=0).max()) / 2
        for factor in _THRESHOLD_FACTORS:
            threshold = np.clip(factor * GOAL / half, _MIN_THRESHOLD, _MAX_THRESHOLD)
            if best is not None and time.monotonic() > deadline - 1.0:
                return best[1]
            try:
                hulls = _coacd_hulls(vertices, faces, float(threshold), voxels, name, deadline)
            except AssetError:
                # A finer try may take too long where a coarser one is at hand.
                if best is None:
                    raise
                return best[1]
            if hulls:
                gap = _gap(surface, hulls)
                if best is None or gap < best[0]:
                    best = gap, hulls
                if gap <= GOAL:
                    return hulls
    if best is None:
        raise AssetError(name, "no convex pieces were found", remedy=_REMEDY)
    return best[1]


_REMEDY = "Simplify or close the mesh, or give the link collision shapes of its own."


def _coacd_hulls(
    vertices: Array, faces: Faces, threshold: float, voxels: int, name: str, deadline: float
) -> list[Array]:
    """Points of CoACD's pieces, from a process that ends in time."""
    if importlib.util.find_spec("coacd") is None:
        raise MissingDependencyError(
            f"{name} is not convex; taking it apart needs coacd: pip install 'artgym[assets]'"
        )
    with tempfile.TemporaryDirectory(prefix="artgym-convex-") as folder:
        source, target = Path(folder) / "mesh.npz", Path(folder) / "pieces.npz"
        np.savez(
            source,
            allow_pickle=False,
            vertices=vertices,
            faces=faces.astype(np.int32),
            threshold=threshold,
            voxels=voxels,
            max_pieces=MAX_PIECES,
            seed=_SEED,
        )
        script = Path(__file__).with_name("decomposition_process.py")
        seconds = max(deadline - time.monotonic(), 0.1)
        try:
            process = subprocess.run(
                # -P: this folder's modules must not stand in for others of the same name.
                [sys.executable, "-P", str(script), str(source), str(target)],
                env={**os.environ, "OMP_NUM_THREADS": "1"},
                stdin=subprocess.DEVNULL,
                capture_output=True,
                timeout=seconds,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise AssetError(
                name,
                "no convex pieces in time",
                value=f"{seconds:.0f} s, {len(faces)} faces",
                remedy=_REMEDY,
            ) from None
        if process.returncode != 0 or not target.is_file():
            said = process.stderr.decode(errors="replace").strip().splitlines()
            raise AssetError(
                name,
                "coacd failed",
                value=said[-1] if said else f"exit status {process.returncode}",
                remedy=_REMEDY,
            )
        with np.load(target, allow_pickle=False) as found:
            pieces = [np.asarray(found[key], dtype=float) for key in sorted(found.files)]
    hulls = []
    for points in pieces:
        if len(points) >= 4 and np.all(np.isfinite(points)):
            with contextlib.suppress(QhullError):
                solid = _hull(_thickened(points))
                hulls.append(_corners(solid))
    return hulls
