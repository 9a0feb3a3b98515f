"""The door for objects made by others: finds out what a path holds and makes an object of it.

What the files leave open is guessed by rules that hold for all objects, and each guess is said.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray

from artgym.errors import AssetError, InvalidArgumentError, UnknownNameError
from artgym.geometry import transforms
from artgym.objects import catalog
from artgym.objects.assembly import (
    MIN_RANGE,
    Conversion,
    End,
    Imported,
    RawModel,
    Solid,
    object_from_model,
    rest_extent,
)
from artgym.objects.asset_folder import AssetFolder, refuse_archive
from artgym.objects.asset_xml import parse_xml
from artgym.objects.collision import facing_outwards
from artgym.objects.description import JSON_NAME, read_description
from artgym.objects.distance import surface_distance
from artgym.objects.meshes import link_triangles
from artgym.objects.mjcf import parse_mjcf
from artgym.objects.model import ArticulatedObject, Joint, Link
from artgym.objects.partnet import read_partnet
from artgym.objects.seen import uncovered_points
from artgym.objects.urdf import parse_urdf
from artgym.objects.urdf_export import matching_description

Array = NDArray[np.floating]

Front = Literal["+x", "-x", "+y", "-y"]
Kind = Literal["URDF", "MJCF", "PartNet-Mobility", "description"]

#: Radians about z that bring such a front to +x.
TURNS: Mapping[Front, float] = MappingProxyType(
    {"+x": 0.0, "-x": np.pi, "+y": -np.pi / 2, "-y": np.pi / 2}
)
#: Words in names of files, models and links, and the category that they tell; the longest counts.
CATEGORY_WORDS: Mapping[str, str] = MappingProxyType(
    {
        "box": "box",
        "carton": "box",
        "cabinet": "cabinet",
        "cupboard": "cabinet",
        "wardrobe": "cabinet",
        "storagefurniture": "cabinet",
        "cutter": "cutter",
        "dishwasher": "dishwasher",
        "door": "door",
        "drawer": "drawer",
        "nightstand": "drawer",
        "dresser": "drawer",
        "eyeglasses": "eyeglasses",
        "glasses": "eyeglasses",
        "faucet": "faucet",
        "laptop": "laptop",
        "notebook": "laptop",
        "microwave": "microwave",
        "oven": "oven",
        "range": "oven",
        "stove": "oven",
        "fridge": "refrigerator",
        "refrigerator": "refrigerator",
        "safe": "safe",
        "scissors": "scissors",
        "stapler": "stapler",
        "suitcase": "suitcase",
        "toilet": "toilet",
        "trashcan": "trash_can",
        "trash": "trash_can",
        "wastebin": "trash_can",
    }
)
#: Categories whose closed state is no smaller than the open one.
_NOT_SMALLEST = ("faucet", catalog.OTHER.name)
#: Share of the box's volume below which another closed end is believed.
_CLEARLY_SMALLER = 0.9
#: Lengths of units that files are written in, metres: millimetres, centimetres, inches.
_UNITS = (0.001, 0.01, 0.0254)
#: What is seen of a movable part may lie so far from what collides, metres, at so small a share
#: of its surface, before it is what collides.
_SEEN_GAP, _SEEN_SHARE = 0.002, 0.005
_SEEN_SAMPLES = 2000
#: A part stands out from the base by this share of the object's diagonal, or does not.
_STANDS_OUT = 0.02
#: Files below a folder are looked for so deep.
_DEPTH = 3
_SUFFIXES = (".urdf", ".xml", ".mjcf")


def import_object(
    path: str | os.PathLike[str],
    *,
    name: str | None = None,
    category: str | None = None,
    scale: float | Literal["auto"] | None = None,
    front: Front | None = None,
    closed: Mapping[str, End] | None = None,
    solid: Solid | None = None,
    density: float | None = None,
) -> Imported:
    """Makes an object of a URDF or MJCF file, a PartNet-Mobility folder, or a folder with one.

    Args:
        path: the file or folder. Files that it names must lie in its folder.
        name: the object's id; the file's name by default.
        category: a category of the catalogue, or "other"; guessed from names by default.
        scale: factor for all lengths; "auto" chooses one where the size is none of the category's.
            By default PartNet-Mobility folders are scaled to a typical size and others left as
            they are.
        front: the axis of the file's root that its front faces; by default the side that parts are
            on, or open to.
        closed: closed end of joints by name, "lower", "upper" or a position.
        solid: what collides, "collision" or "visual" geometry; by default the file's collision
            geometry, unless what is seen of a movable part lies elsewhere.
        density: kg/m^3 that replaces all masses of the file.

    Returns:
        The object and one note for each thing that was assumed or changed.

    Raises:
        AssetError: the path holds no such thing, or a file cannot be used.
        InvalidArgumentError: an argument out of range.
        UnknownNameError: an unknown category, front or joint; names the nearest.
        MissingDependencyError: a package for this kind of file is missing.
    """
    if category is not None and category != catalog.OTHER.name:
        catalog.category(category)
    if front is not None and front not in TURNS:
        raise UnknownNameError("front", front, TURNS)
    if isinstance(scale, str) and scale != "auto":
        raise InvalidArgumentError(f'scale={scale!r}: expected a positive number or "auto"')
    kind, file = find_description(path)
    name = name or _plain_name(file)
    if kind == "description":
        obj = read_description(file)
        return Imported(object=_renamed(obj, name, category), notes=())
    given = Conversion(name=name)
    if closed is not None:
        given["closed"] = closed
    if density is not None:
        given["density"] = density
    model: RawModel | None = None
    convert: Callable[[Conversion], Imported]
    if kind == "PartNet-Mobility":
        convert = _partnet_converter(file)
        if category is not None:
            given["category"] = category
        if isinstance(scale, float | int):
            given["scale"] = float(scale)
        notes: list[str] = []
    else:
        model = parse_urdf(file) if kind == "URDF" else parse_mjcf(file)
        asked = (scale, front, closed, solid, density)
        exact = matching_description(model) if kind == "URDF" and not any(asked) else None
        if exact is not None:
            note = "taken from the exact description beside the URDF"
            return Imported(object=_renamed(exact, name, category), notes=(*model.notes, note))
        convert = _converter(model)
        guessed = category or guess_category(file, model)
        given["category"] = guessed
        notes = [] if category else [_category_note(guessed)]
        given["closed"], note = _closed_ends(model, guessed, closed or {})
        notes += note
        notes += _choose_scale(given, model, scale)
    if front is not None:
        given["turn"] = TURNS[front]
    if solid is not None:
        given["solid"] = solid
    imported = convert(given)
    if front is None and kind != "PartNet-Mobility":
        seen_front = guess_front(imported.object)
        if seen_front is None:
            notes.append("front: not clear from its joints, taken to be +x; give --front")
        elif seen_front != "+x":
            given["turn"] = TURNS[seen_front]
            notes.append(f"front: taken to be {seen_front} of the file, where its parts are")
            imported = convert(given)
    if solid is None:
        imported, note = _with_fitting_solid(imported, given, model)
        notes += note
    renames, note = _catalogue_parts(imported.object)
    obj = _facing_outwards(_with_part_names(imported.object, renames))
    notes += [note, *_size_notes(obj, scale)]
    return Imported(object=obj, notes=(*imported.notes, *filter(None, notes)))


def find_description(path: str | os.PathLike[str]) -> tuple[Kind, Path]:
    """What a path holds, and the file or folder that describes it.

    Raises:
        AssetError: nothing that can be imported, or several things.
    """
    path = Path(path)
    refuse_archive(str(path))
    if path.is_dir():
        if (path / "mobility.urdf").is_file():
            return "PartNet-Mobility", path
        if (path / JSON_NAME).exists():
            return "description", path
        found = [
            file
            for suffix in _SUFFIXES
            for depth in range(_DEPTH)
            for file in sorted(path.glob("*/" * depth + f"*{suffix}"))
            # A link can lead out of the folder, and a pipe can be waited for.
            if file.is_file() and file.resolve().is_relative_to(path.resolve())
        ]
        known: list[tuple[Kind, Path]] = [
            (kind, file) for file in found if (kind := _kind_of(file)) is not None
        ]
        if len(known) != 1:
            raise AssetError(
                path,
                "no URDF or MJCF file in it" if not known else "several descriptions in it",
                value=[file.relative_to(path).as_posix() for _, file in known][:6] or None,
                remedy="Give the path of the file itself.",
            )
        return known[0]
    if path.name == "mobility.urdf":
        return "PartNet-Mobility", path.parent
    if path.name == JSON_NAME:
        return "description", path.parent
    kind = _kind_of(path)
    if kind is None:
        raise AssetError(
            path,
            "neither URDF nor MJCF",
            remedy="Give a .urdf or .xml file, or a folder that holds one.",
        )
    return kind, path


def _kind_of(file: Path) -> Literal["URDF", "MJCF"] | None:
    """What an XML file describes, by its root element; a .urdf is a URDF whatever it holds."""
    if file.suffix.lower() == ".urdf":
        return "URDF"
    if file.suffix.lower() not in _SUFFIXES:
        return None
    folder = AssetFolder(file.parent)
    root = parse_xml(folder.read(file.name, "xml"), str(file)).tag
    return {"robot": "URDF", "mujoco": "MJCF"}.get(root)  # type: ignore[return-value]


def _plain_name(file: Path) -> str:
    """A name for an object, from that of its file or folder."""
    stem = file.name if file.is_dir() else file.stem
    return re.sub(r"[^a-z0-9_-]+", "_", stem.lower()).strip("_")[:64] or "object"


def _renamed(obj: ArticulatedObject, name: str, category: str | None) -> ArticulatedObject:
    return replace(obj, object_id=name, category=category or obj.category)


def _converter(model: RawModel) -> Callable[[Conversion], Imported]:
    return lambda conversion: object_from_model(model, **conversion)


def _partnet_converter(folder: Path) -> Callable[[Conversion], Imported]:
    return lambda conversion: read_partnet(folder, **conversion)


# -- category ----------------------------------------------------------------------------------


def guess_category(file: Path, model: RawModel) -> str:
    """The category that names tell: of the file first, then of the model, of links, of folders."""
    links = " ".join(link.name for link in model.links)
    for text in (file.stem, model.name, links, file.parent.name):
        found = _category_in(text)
        if found is not None:
            return found
    return catalog.OTHER.name


def _category_in(text: str) -> str | None:
    """The category of the longest word in a text.

    >>> _category_in("Franka_slideCabinet")
    'cabinet'
    """
    squeezed = re.sub(r"[^a-z]+", "", text.lower())
    words = re.findall(r"[a-z]+", re.sub(r"([a-z])([A-Z])", r"\1 \2", text).lower())
    found = [
        word
        for word in CATEGORY_WORDS
        # Short words hide in others: "range" in "orange", "box" in "gearbox".
        if word in words or word + "s" in words or (len(word) > 5 and word in squeezed)
    ]
    return CATEGORY_WORDS[max(found, key=len)] if found else None


def _category_note(category: str) -> str:
    if category == catalog.OTHER.name:
        return 'category: no name tells it, taken to be "other"; give --category'
    return f"category: taken to be {category!r}, from names"


# -- closed ends -------------------------------------------------------------------------------


def _closed_ends(
    model: RawModel, category: str, closed: Mapping[str, End]
) -> tuple[dict[str, End], list[str]]:
    """Where joints are closed: at the end, or at q = 0 inside, where the object is smallest.

    Closed furniture, boxes, scissors and laptops fill less space than open ones; so that where
    another end makes the object's box clearly smaller than the end nearest to q = 0, it is closed
    there. Of taps and of what is unknown nothing of the kind holds.
    """
    chosen: dict[str, End] = dict(closed)
    notes: list[str] = []
    if category in _NOT_SMALLEST:
        return chosen, notes

    def volume(ends: Mapping[str, End]) -> float:
        return float(np.prod(np.maximum(rest_extent(model, closed=ends), 1e-6)))

    for joint in model.joints:
        if joint.type == "fixed" or joint.name in closed or joint.upper - joint.lower < MIN_RANGE:
            continue
        candidates: list[End] = ["lower", "upper"]
        if joint.lower < 0.0 < joint.upper:
            candidates.append(0.0)
        try:
            usual = volume(chosen)
            sizes: list[tuple[float, End]] = [
                (volume({**chosen, joint.name: end}), end) for end in candidates
            ]
        except UnknownNameError:
            # A joint that will be dropped, with a link that nobody sees.
            continue
        size = min(filled for filled, _ in sizes)
        end = next(end for filled, end in sizes if filled == size)
        if size < _CLEARLY_SMALLER * usual:
            chosen[joint.name] = cast(End, end)
            shown = "q = 0" if end == 0.0 else f"its {end} limit"
            notes.append(f"{joint.element}: closed taken to be {shown}, where all is smallest")
    return chosen, notes


# -- size --------------------------------------------------------------------------------------


def _choose_scale(
    given: Conversion, model: RawModel, scale: float | Literal["auto"] | None
) -> list[str]:
    """Puts a scale into a conversion; what is to be said of it."""
    if scale is None:
        return []
    if scale != "auto":
        given["scale"] = float(scale)
        return []
    largest = max(rest_extent(model, closed=given.get("closed")))
    factor = plausible_scale(largest, given.get("category", catalog.OTHER.name))
    given["scale"] = factor
    return [] if factor == 1.0 else [f"scaled by {factor:.4g} to {factor * largest:.3g} m across"]


def plausible_scale(largest: float, category: str) -> float:
    """A factor that brings a largest extent, metres, into the category's interval.

    1 where it lies there already; else that of a unit of length, or one that gives the size of
    the category's own objects.
    """
    row = catalog.CATEGORIES.get(category, catalog.OTHER)
    if row is catalog.OTHER:
        typical, smallest = 0.4, row.size[0]
    else:
        low, high = catalog.load(f"{category}/0000").body_bounds
        typical = float((high - low).max())
        smallest = typical / 3
    if smallest <= largest <= row.size[1]:
        return 1.0
    fitting = [unit for unit in _UNITS if smallest <= unit * largest <= row.size[1]]
    if fitting:
        return fitting[0]
    return (
        0.98 * row.size[1] / largest if typical < largest < 2 * row.size[1] else typical / largest
    )


def _size_notes(obj: ArticulatedObject, scale: float | Literal["auto"] | None) -> list[str]:
    row = catalog.category_of(obj)
    low, high = obj.body_bounds
    extents = high - low
    if row.size[0] <= extents.min() and extents.max() <= row.size[1]:
        return []
    size = " x ".join(f"{extent:.3g}" for extent in extents)
    advice = ""
    if scale is None:
        factor = plausible_scale(float(extents.max()), obj.category)
        advice = f"; --scale auto would scale it by {factor:.4g}" if factor != 1.0 else ""
    return [
        f"size: {size} m is not that of category {row.name!r}, {row.size[0]:g} to "
        f"{row.size[1]:g} m{advice}"
    ]


# -- front -------------------------------------------------------------------------------------


def guess_front(obj: ArticulatedObject) -> Front | None:
    """The side that most movable parts are on, or open to; None where they do not agree.

    A door, a drawer's front, a lever or a handle stands out from the base on the front. Of a part
    that stands out nowhere, such as a lid, the front is where it sets out to from its closed
    state; if that is upwards, it lies opposite the hinge.
    """
    directions = {front: _direction(front) for front in get_args(Front)}
    base = _corners(obj.links[0])
    least = _STANDS_OUT * float(np.linalg.norm(obj.rest_bounds[1] - obj.rest_bounds[0]))
    votes = dict.fromkeys(directions, 0.0)
    for part, joint in enumerate(obj.joints, start=1):
        corners = _corners(obj.links[part])
        out = {f: float((corners @ d).max() - (base @ d).max()) for f, d in directions.items()}
        first, second = sorted(directions, key=lambda front: -out[front])[:2]
        if out[first] > least and out[first] > 1.5 * out[second]:
            votes[first] += 1.0
            continue
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
        lever = _lever_side(joint, middle, base)
        if lever is not None:
            for front, direction in directions.items():
                votes[front] += float(lever @ direction > 0.82)
            continue
        start = 0.02 * joint.range + joint.closed
        moved = transforms.apply(joint.motion(start), middle[None])[0] - middle
        if np.hypot(moved[0], moved[1]) < abs(moved[2]) and joint.type == "revolute":
            arm = middle - np.asarray(joint.pivot)
            moved = arm - np.asarray(joint.axis) * (arm @ np.asarray(joint.axis))
        length = float(np.hypot(moved[0], moved[1]))
        if length < 1e-6:
            continue
        for front, direction in directions.items():
            # A turn of less than 35 degrees is still this side.
            if moved @ direction > 0.82 * length:
                votes[front] += 1.0
    best = max(votes, key=lambda front: votes[front])
    return best if votes[best] > sum(votes.values()) / 2 else None


def _lever_side(joint: Joint, middle: Array, base: Array) -> Array | None:
    """Where the axis of a lever or a knob points, away from the base (n, 3); None of a door's."""
    axis = np.asarray(joint.axis)
    if joint.type != "revolute" or abs(axis[2]) > 0.3:
        return None
    along = base @ axis
    offset = float(middle @ axis) - (along.min() + along.max()) / 2
    # Doors and lids lie in the middle of their hinges.
    return np.sign(offset) * axis if abs(offset) > 0.25 * np.ptp(along) else None


def _corners(link: Link) -> Array:
    """Points (n, 3) whose box holds what is seen of a link."""
    return link_triangles(link)[0].reshape(-1, 3)


def _direction(front: Front) -> Array:
    turn = -TURNS[front]
    return np.array([np.cos(turn), np.sin(turn), 0.0])


# -- what collides -----------------------------------------------------------------------------


def _with_fitting_solid(
    imported: Imported, given: Conversion, model: RawModel | None
) -> tuple[Imported, list[str]]:
    """The object with what is seen of movable parts in place of collision geometry elsewhere."""
    shares = {link.name: _misplaced_share(link) for link in imported.object.links[1:]}
    notes = {
        name: f"link {name!r}: {100 * share:.1f} % of what is seen lies more than "
        f"{1000 * _SEEN_GAP:.0f} mm from what collides"
        for name, share in shares.items()
        if share > _SEEN_SHARE
    }
    chosen: list[str] = []
    for name in notes if model is not None else ():
        assert model is not None
        try:
            better = object_from_model(_seen_to_collide(model, [*chosen, name]), **given)
        except AssetError as error:
            notes[name] += f"; what is seen cannot collide: {error}"
            continue
        if better.object.part_names != imported.object.part_names:
            # A link that lost its geometry to this: the part is called after another one now.
            continue
        share = next(_misplaced_share(v) for v in better.object.links if v.name == name)
        if share < shares[name]:
            notes[name] += f"; what is seen collides instead, which leaves {100 * share:.1f} %"
            chosen.append(name)
            imported = better
    return imported, list(notes.values())


def _seen_to_collide(model: RawModel, names: Sequence[str]) -> RawModel:
    """A model in which what is seen of bodies, named by one of their links, is what collides."""
    group = {link.name: {link.name} for link in model.links}
    for joint in model.joints:
        if joint.type == "fixed" or joint.upper - joint.lower < MIN_RANGE:
            joined = group[joint.parent] | group[joint.child]
            for name in joined:
                group[name] = joined
    changed = {member for name in names for member in group[name]}
    links = tuple(
        replace(link, collisions=link.visuals) if link.name in changed else link
        for link in model.links
    )
    return replace(model, links=links)


def _misplaced_share(link: Link) -> float:
    """The share of a link's visible surface that lies off the surface of its shapes."""
    if not link.visuals:
        return 0.0
    points, normals = uncovered_points(link, _SEEN_SAMPLES, np.random.default_rng(0))
    if not len(points):
        return 0.0
    return float(np.mean(surface_distance(link.shapes, points, normals) > _SEEN_GAP))


# -- parts -------------------------------------------------------------------------------------


def _catalogue_parts(obj: ArticulatedObject) -> tuple[dict[str, str], str]:
    """The category's names for an object's parts, where it has such parts; and a note."""
    row = catalog.category_of(obj)
    if row is catalog.OTHER:
        return {}, ""
    kinds = {joint.type for joint in catalog.load(f"{row.name}/0000").joints}
    if len(obj.links) > len(row.parts) or not {j.type for j in obj.joints} <= kinds:
        return {}, f"parts: called as in the file, since they are not those of a {row.name}"
    renames = {
        old: new
        for old, new in zip(obj.part_names, row.parts[: obj.num_parts], strict=True)
        if old != new
    }
    shown = ", ".join(f"{old} is {new!r}" for old, new in renames.items())
    return renames, f"parts: {shown}" if renames else ""


def _with_part_names(obj: ArticulatedObject, renames: Mapping[str, str]) -> ArticulatedObject:
    def name(old: str) -> str:
        return renames.get(old, old)

    return replace(
        obj,
        links=tuple(replace(link, name=name(link.name)) for link in obj.links),
        joints=tuple(
            replace(joint, parent=name(joint.parent), child=name(joint.child))
            for joint in obj.joints
        ),
    )


def _facing_outwards(obj: ArticulatedObject) -> ArticulatedObject:
    """The object with what is seen turned outwards, where files have it inside out."""
    return replace(
        obj,
        links=tuple(
            replace(
                link,
                visuals=tuple(replace(v, mesh=facing_outwards(v.mesh)) for v in link.visuals),
            )
            for link in obj.links
        ),
    )
