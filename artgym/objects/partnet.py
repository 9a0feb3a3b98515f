"""Reading folders of PartNet-Mobility, as SAPIEN's site gives them.

Such a folder holds ``mobility.urdf``, the names of its links in ``semantics.txt`` or
``mobility_v2.json``, its category in ``meta.json``, and meshes. Lengths are normalised to about 2
across, z is up, the front faces -x, and q = 0 is not the closed state of every category.
"""

from __future__ import annotations

import itertools
import json
import math
import os
import re
from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, NoReturn, Unpack

from artgym.errors import AssetError
from artgym.objects.assembly import (
    ClosedRule,
    Conversion,
    Imported,
    object_from_model,
    rest_extent,
)
from artgym.objects.asset_folder import AssetFolder
from artgym.objects.urdf import parse_urdf


@dataclass(frozen=True, kw_only=True)
class Family:
    """What is known of a category of PartNet-Mobility.

    Attributes:
        category: the category's name here.
        extent: its objects' largest extent at rest, metres, typically.
        closed_rule: how the closed ends of its joints are found.
    """

    category: str
    extent: float
    closed_rule: ClosedRule = "nearest"


#: By "model_cat" of ``meta.json``.
FAMILIES: Mapping[str, Family] = MappingProxyType(
    {
        "Bottle": Family(category="other", extent=0.22),
        "Box": Family(category="box", extent=0.30, closed_rule="smallest"),
        "Chair": Family(category="other", extent=0.95),
        "CoffeeMachine": Family(category="other", extent=0.35),
        "Dishwasher": Family(category="dishwasher", extent=0.85),
        "Dispenser": Family(category="other", extent=0.22),
        "Display": Family(category="other", extent=0.55),
        "Door": Family(category="door", extent=2.05),
        "Eyeglasses": Family(category="eyeglasses", extent=0.15, closed_rule="smallest"),
        "Faucet": Family(category="faucet", extent=0.30),
        "FoldingChair": Family(category="other", extent=0.85),
        "Globe": Family(category="other", extent=0.40),
        "Kettle": Family(category="other", extent=0.25),
        "KitchenPot": Family(category="other", extent=0.30),
        "Knife": Family(category="cutter", extent=0.16),
        "Lamp": Family(category="other", extent=0.50),
        "Laptop": Family(category="laptop", extent=0.35),
        "Microwave": Family(category="microwave", extent=0.50),
        "Oven": Family(category="oven", extent=0.90),
        "Pliers": Family(category="other", extent=0.18, closed_rule="smallest"),
        "Printer": Family(category="other", extent=0.45),
        "Refrigerator": Family(category="refrigerator", extent=1.70),
        "Safe": Family(category="safe", extent=0.45),
        "Scissors": Family(category="scissors", extent=0.20, closed_rule="smallest"),
        "Stapler": Family(category="stapler", extent=0.16),
        "StorageFurniture": Family(category="cabinet", extent=0.90),
        "Suitcase": Family(category="suitcase", extent=0.65),
        "Table": Family(category="other", extent=1.20),
        "Toaster": Family(category="other", extent=0.30),
        "Toilet": Family(category="toilet", extent=0.75),
        "TrashCan": Family(category="trash_can", extent=0.60),
        "WashingMachine": Family(category="other", extent=0.85),
        "Window": Family(category="other", extent=1.20),
    }
)
_UNKNOWN = Family(category="other", extent=0.40)

#: Radians about z that bring the front of such a model to +x.
FRONT_TURN = math.pi

_LINK = re.compile(r"link_\d{1,4}")
_WORD = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _-]{0,63}")
_DOWNLOAD = "Download the folder again."


@dataclass(frozen=True, kw_only=True)
class Semantics:
    """What a folder says of itself beside its URDF.

    Attributes:
        model_category: "model_cat" of ``meta.json``, "" where there is none.
        links: what each link is called, "door" for instance, by its name in the URDF.
        joints: the kind of its joint, "hinge" or "slider" for instance, by the same names.
    """

    model_category: str
    links: Mapping[str, str]
    joints: Mapping[str, str]


def read_partnet(
    folder: str | os.PathLike[str],
    *,
    extent: float | None = None,
    **conversion: Unpack[Conversion],
) -> Imported:
    """Makes an object of a PartNet-Mobility folder.

    Args:
        folder: the folder.
        extent: the object's largest extent at rest, metres; typical for its category by default.
            Without effect where ``scale`` is given.
        **conversion: as for ``assembly.object_from_model``. By default the front is turned to +x,
            category, scale and closed ends follow from "model_cat", parts are called as the
            folder calls them.

    Raises:
        AssetError: the folder, or a file in it, cannot be used.
        InvalidArgumentError: an argument out of range.
        MissingDependencyError: defusedxml is not installed.
    """
    path = Path(os.fspath(folder))
    semantics = read_semantics(path)
    model = parse_urdf(path / "mobility.urdf")
    notes = list(model.notes)
    family = FAMILIES.get(semantics.model_category)
    if family is None:
        shown = semantics.model_category or "none"
        notes.append(f"model_cat {shown} is not known; category and size are a guess")
        family = _UNKNOWN
    chosen: Conversion = {**conversion}
    chosen.setdefault("turn", FRONT_TURN)
    chosen.setdefault("category", family.category)
    closed_rule = chosen.setdefault("closed_rule", family.closed_rule)
    chosen.setdefault("name", path.name)
    links = {link.name for link in model.links}
    strangers = sorted(set(semantics.links) - links)
    if strangers:
        raise AssetError(
            model.file,
            "lacks links that the files beside it name",
            value=strangers[:8],
            remedy="Download the folder again, or remove semantics.txt and mobility_v2.json.",
        )
    chosen.setdefault("part_names", part_names(semantics.links, taken=links))
    if "scale" not in chosen:
        wanted = family.extent if extent is None else extent
        extents = rest_extent(model, closed=chosen.get("closed"), closed_rule=closed_rule)
        scale = chosen["scale"] = wanted / max(extents)
        notes.append(f"scaled by {scale:.4g} to {wanted:g} m across")
    return object_from_model(replace(model, notes=tuple(notes)), **chosen)


def read_semantics(folder: str | os.PathLike[str]) -> Semantics:
    """Reads the category and the names of the links; files that are absent say nothing.

    Raises:
        AssetError: no such folder, or a file that is there cannot be read.
    """
    root = AssetFolder(folder)
    links: dict[str, str] = {}
    joints: dict[str, str] = {}
    if (root.root / "semantics.txt").exists():
        for link, kind, name in _semantics_lines(root):
            links[link], joints[link] = name, kind
    elif (root.root / "mobility_v2.json").exists():
        for link, kind, name in _mobility_entries(root):
            links[link], joints[link] = name, kind
    category = ""
    if (root.root / "meta.json").exists():
        meta = _json(root, "meta.json")
        value = meta.get("model_cat", "") if isinstance(meta, dict) else None
        if not isinstance(value, str) or (value and not _WORD.fullmatch(value)):
            _refuse(root, "meta.json", "model_cat is no name", "model_cat", value)
        category = value
    return Semantics(model_category=category, links=links, joints=joints)


def part_names(links: Mapping[str, str], taken: Collection[str] = ()) -> dict[str, str]:
    """Different names for parts of which several have the same: "door_1", "door_2".

    Args:
        links: what each link is called.
        taken: names that none of them may get.

    >>> part_names({"link_0": "door", "link_1": "body", "link_2": "door"})
    {'link_0': 'door_1', 'link_1': 'body', 'link_2': 'door_2'}
    """
    count = Counter(links.values())
    used = {*taken, *(name for name in count if count[name] > 1)}
    names = {}
    for link, name in links.items():
        numbered = (f"{name}_{i}" for i in itertools.count(1))
        names[link] = name if name not in used else next(n for n in numbered if n not in used)
        used.add(names[link])
    return names


def _refuse(folder: AssetFolder, name: str, problem: str, element: str, value: object) -> NoReturn:
    raise AssetError(folder.label(name), problem, element=element, value=value, remedy=_DOWNLOAD)


def _text(folder: AssetFolder, name: str) -> str:
    data = folder.read(name, "text")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        _refuse(folder, name, "not UTF-8", "", None)


def _json(folder: AssetFolder, name: str) -> Any:
    try:
        return json.loads(_text(folder, name))
    except (ValueError, RecursionError) as error:
        if isinstance(error, AssetError):
            raise
        _refuse(folder, name, f"JSON that cannot be read: {error}", "", None)


def _semantics_lines(folder: AssetFolder) -> list[tuple[str, str, str]]:
    """Link, kind of joint and name of each line: "link_0 hinge door"."""
    entries = []
    for number, line in enumerate(_text(folder, "semantics.txt").splitlines(), start=1):
        words = line.split()
        if not words:
            continue
        if len(words) != 3 or not _LINK.fullmatch(words[0]) or not _WORD.fullmatch(words[2]):
            _refuse(
                folder,
                "semantics.txt",
                'not of the form "link_0 hinge door"',
                f"line {number}",
                line,
            )
        entries.append((words[0], words[1], words[2]))
    return entries


def _mobility_entries(folder: AssetFolder) -> list[tuple[str, str, str]]:
    """As ``_semantics_lines``, from ``mobility_v2.json``, whose entry n is link n."""
    name = "mobility_v2.json"
    items = _json(folder, name)
    if not isinstance(items, list):
        _refuse(folder, name, "not a list of links", "", type(items).__name__)
    entries = []
    for item in items:
        fields = item if isinstance(item, dict) else {}
        number, kind, label = (fields.get(key) for key in ("id", "joint", "name"))
        if (
            type(number) is not int
            or not 0 <= number < 10_000
            or not isinstance(kind, str)
            or not (isinstance(label, str) and _WORD.fullmatch(label))
        ):
            _refuse(folder, name, "an entry without id, joint and name", f"entry {number}", item)
        entries.append((f"link_{number}", kind, label))
    return entries
