"""The `artgym` command: one function a subcommand, its arguments built from the signature."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import tyro

import artgym
from artgym.errors import (
    ArtgymError,
    InvalidArgumentError,
    RendererUnavailableError,
    UnknownNameError,
)

if TYPE_CHECKING:
    from artgym.objects.model import ArticulatedObject


# Functions import what they need themselves: `artgym doctor` must answer on a machine where the
# simulator cannot be imported.
def doctor(*, json: bool = False) -> int:
    """Say whether everything is in place here, and what to install if not.

    Args:
        json: print a JSON object instead of text.
    """
    from artgym.doctor import examine, text_from_findings

    findings = examine()
    print(findings.to_json() if json else text_from_findings(findings))
    return 0 if findings.is_healthy() else 1


def objects(
    *,
    category: str | None = None,
    split: str = "train",
    count: int | None = None,
    pictures: Path | None = None,
) -> int:
    """List the objects of the catalogue, one a line.

    Args:
        category: only this one, or import for what was imported here; by default all categories.
        split: train, val or test.
        count: the first so many of each category; by default all.
        pictures: folder that gets a picture of each.
    """
    from artgym.objects import catalog

    for object_id in _catalogue_ids(category, split, count):
        obj = catalog.load(object_id)
        joints = [
            f"{j.child} {abs(j.range):.2f} {'m' if j.type == 'prismatic' else 'rad'}"
            for j in obj.joints
        ]
        kind = [f"{name}={value}" for name, value in sorted(obj.attributes.items())]
        low, high = obj.body_bounds
        extents = "x".join(f"{extent:.2f}" for extent in high - low)
        print(f"{object_id}  {extents} m  {', '.join(joints)}  {' '.join(kind)}")
        if pictures is not None:
            _take_picture(obj, pictures)
    return 0


def import_(
    path: tyro.conf.Positional[Path],
    *,
    name: str | None = None,
    category: str | None = None,
    scale: float | Literal["auto"] | None = None,
    front: Literal["+x", "-x", "+y", "-y"] | None = None,
    closed: tuple[str, ...] = (),
    solid: Literal["collision", "visual"] | None = None,
    density: float | None = None,
    picture: Path | None = None,
) -> int:
    """Bring an object of your own: check it, and keep it under an id that works everywhere.

    Args:
        path: a URDF or MJCF file, a PartNet-Mobility folder, or a folder that holds one of them.
        name: a-z, 0-9, "_" and "-": the object becomes import/NAME; by default the file's name.
            An imported object of that name is replaced.
        category: a category, or other; by default guessed from names.
        scale: factor for all lengths, or auto: one that gives a size of the category.
        front: the axis of the file that its front faces; by default the side its parts are on.
        closed: closed ends of joints: hinge=upper, slide=lower, or a position: lid=0.1.
        solid: what collides, the file's collision geometry or what is seen; by default collision
            geometry, unless what is seen of a movable part lies elsewhere.
        density: kg/m^3 in place of the file's masses.
        picture: folder for a picture of the object, should it not be sound.
    """
    from artgym.annotation.filter import judge
    from artgym.objects import store
    from artgym.objects.importing import import_object
    from artgym.sim import soundness

    if name is not None:
        store.object_id(name)
    imported = import_object(
        path,
        name=name,
        category=category,
        scale=scale,
        front=front,
        closed=_closed_ends(closed),
        solid=solid,
        density=density,
    )
    obj = imported.object
    for note in imported.notes:
        print(f"note  {note}")
    found = soundness.check(obj, judge)
    for verdict in found.verdicts:
        print(verdict)
    if not found.passed and picture is not None:
        _take_picture(obj, picture)
    object_id = store.save(obj, name or obj.object_id)
    parts = ", ".join(f"{i} {part}" for i, part in enumerate(obj.part_names) if i)
    print(f"{object_id}  {obj.category}, parts {parts}; {store.folder()}")
    if not found.passed:
        print(f"{object_id} is not sound: see what fails above before you train on it.")
    return 0


def _closed_ends(pairs: Sequence[str]) -> dict[str, Any] | None:
    """Closed ends of joints as a reader wants them, from texts such as "hinge=upper"."""
    ends: dict[str, Any] = {}
    for pair in pairs:
        joint, equals, end = pair.rpartition("=")
        if not (joint and equals):
            raise InvalidArgumentError(
                f"--closed {pair!r}: expected JOINT=lower, JOINT=upper or JOINT=POSITION"
            )
        try:
            ends[joint] = float(end)
        except ValueError:
            ends[joint] = end
    return ends or None


def check(
    ids: tyro.conf.Positional[tuple[str, ...]] = (),
    *,
    all: bool = False,
    category: str | None = None,
    split: str = "train",
    count: int | None = None,
    picture: Path | None = None,
) -> int:
    """Say whether objects are fit to simulate: one verdict a rule, and why.

    Args:
        ids: objects to check, such as drawer/0012 or import/NAME; or paths that `artgym import`
            takes, which are read and not kept.
        all: check whole categories instead; only broken rules are printed.
        category: with --all, only this one; import for what was imported here.
        split: with --all, train, val or test.
        count: with --all, the first so many of each category.
        picture: folder for a picture of each object that breaks a rule; none by default.
    """
    from tqdm import tqdm

    from artgym.annotation.filter import judge
    from artgym.objects import catalog
    from artgym.sim import soundness

    if bool(ids) == all:
        raise InvalidArgumentError("give ids of objects (drawer/0012 ...), or else --all.")
    if not all and (category is not None or count is not None):
        raise InvalidArgumentError("--category and --count go with --all, not with ids.")
    chosen = _catalogue_ids(category, split, count) if all else ids
    for object_id in ids:
        # A wrong id is said before any work is done.
        if not _is_path(object_id):
            catalog.load(object_id)
    failed = 0
    for object_id in tqdm(chosen, desc="check", unit="object", disable=not all):
        obj = _object_of(object_id)
        found = soundness.check(obj, judge)
        failed += not found.passed
        for verdict in found.failures if all else found.verdicts:
            tqdm.write(f"{object_id}  {verdict}", file=sys.stdout)
        if picture is not None and not found.passed:
            _take_picture(obj, picture)
    print(f"{len(chosen) - failed} of {len(chosen)} objects are sound.")
    return 1 if failed else 0


def _is_path(source: str) -> bool:
    """Whether a word on the command line is a path rather than an id."""
    from artgym.objects import catalog, store

    is_id = store.is_imported(source) or source.partition("/")[0] in catalog.CATEGORIES
    return not is_id and Path(source).exists()


def _object_of(source: str) -> ArticulatedObject:
    """The object of an id, or of a path that can be imported."""
    from artgym.objects import catalog
    from artgym.objects.importing import import_object

    if not _is_path(source):
        return catalog.load(source)
    imported = import_object(source)
    for note in imported.notes:
        print(f"{source}  note  {note}")
    return imported.object


def _take_picture(obj: ArticulatedObject, folder: Path) -> None:
    """Writes a picture of an object, or says why there is none."""
    import imageio.v3 as imageio

    from artgym.files import write_file_whole
    from artgym.sim.thumbnail import thumbnail

    path = folder / f"{obj.object_id.replace('/', '_')}.png"
    try:
        pixels = thumbnail(obj, size=(480, 360))
    except RendererUnavailableError as error:
        print(f"no picture of {obj.object_id}: {error}")
        return
    write_file_whole(path, imageio.imwrite("<bytes>", pixels, extension=".png"))
    print(f"{obj.object_id}  pictured in {path}")


def annotate(
    *,
    category: str | None = None,
    object: str | None = None,
    split: str = "train",
    count: int = 40,
    out: Path | None = None,
    workers: int = 1,
    backend: Literal["loky", "dask", "ray"] = "loky",
) -> int:
    """Label which grasps succeed, by trying them. Interrupted, the same command goes on.

    Args:
        category: the category to label.
        object: label this one object instead, import/NAME for instance.
        split: train, val or test.
        count: the first so many objects of the split.
        out: folder that gets {category}/{split}; by default the labels inside the package. With
            --object it must be given.
        workers: processes; any number gives the same bytes.
        backend: loky for processes of this machine, or a cluster's dask or ray.
    """
    from artgym.annotation import annotate as labels
    from artgym.files import write_arrays
    from artgym.objects import catalog

    if (category is None) == (object is None):
        raise InvalidArgumentError("give either --category or --object.")
    if object is not None:
        if out is None:
            raise InvalidArgumentError("--object wants --out, the folder for its labels.")
        catalog.load(object)
        folder = labels.labels_folder(object.partition("/")[0], catalog.split_of(object), out)
        path = folder / labels.label_file_name(object)
        write_arrays(path, labels.annotate(object))
        print(path)
        return 0
    assert category is not None
    manifest = labels.annotate_split(
        category,
        split,  # type: ignore[arg-type]
        count,
        root=out,
        workers=workers,
        backend=backend,
    )
    print(f"{len(manifest.shards)} label files in {labels.labels_folder(category, split, out)}")
    return 0


def generate(
    set: tyro.conf.Positional[Literal["artimage", "reartmix"]],
    *,
    out: Path,
    category: tuple[str, ...] = (),
    split: tuple[str, ...] = ("train", "val", "test"),
    labels: Path | None = None,
    objects: int | None = None,
    views: int = 8,
    scenes: tuple[int, int, int] = (640, 64, 96),
    camera_size: tuple[int, int] = (640, 480),
    depth_noise: bool = False,
    label_radius_mm: float = 3.0,
    brink_grasps: bool = False,
    seed: int = 0,
    workers: int = 1,
    backend: Literal["loky", "dask", "ray"] = "loky",
) -> int:
    """Make labelled RGB-D pictures. Interrupted, the same command goes on where it stopped.

    Args:
        set: artimage shows one object a picture, reartmix several on one table.
        out: folder that gets {category}/{split} of artimage, as `icaf4 train` wants it, or {split}
            of reartmix.
        category: categories; by default those of the paper's set.
        split: train, val, test; objects are in one of them.
        labels: folder that `artgym annotate` wrote; by default the labels inside the package.
        objects: of each category and split; those beyond the labelled ones are pictured once a
            joint state, and nothing is known of their grasps. By default the labelled ones.
        views: of artimage, pictures of each labelled joint state.
        scenes: of reartmix, pictures of the train, val and test split.
        camera_size: width and height, pixels.
        depth_noise: give depth the errors of a real sensor.
        label_radius_mm: how far a labelled point speaks for the points around it; farther, more of
            a picture is labelled, and less surely.
        brink_grasps: a part all of whose successes would fail a few millimetres beside is told
            them all the same, instead of its points counting as unknown: for training, where a
            knob that can be gripped in no other way shall not seem useless.
        seed: of views, lights and placements.
        workers: processes; any number gives the same bytes.
        backend: loky for processes of this machine, or a cluster's dask or ray.
    """
    from artgym.datasets import generate as pictures
    from artgym.datasets.sets import SETS

    chosen = category or SETS[set]
    asked = [(name, each) for name in chosen for each in split]
    for name, each in asked:
        # A wrong name shall be called that, and not a lack of labels.
        _catalogue_ids(name, each, None)
    for name, each in asked:
        # What cannot be made is said before an hour was spent on what can.
        pictures.pictured_ids(name, each, objects, labels)  # type: ignore[arg-type]
    config = pictures.GenerationConfig(
        views=views,
        camera_size=camera_size,
        depth_noise=depth_noise,
        label_radius=label_radius_mm / 1000.0,
        brink_grasps=brink_grasps,
        seed=seed,
    )
    counts: dict[str, int] = dict(zip(("train", "val", "test"), scenes, strict=True))
    options: dict[str, Any] = {
        "objects": objects,
        "config": config,
        "label_root": labels,
        "workers": workers,
        "backend": backend,
    }
    for each in split:
        if set == "reartmix":
            manifest = pictures.generate_reartmix(
                each,  # type: ignore[arg-type]
                out / each,
                counts[each],
                categories=chosen,
                **options,
            )
            print(f"{manifest.num_items} pictures in {out / each}")
            continue
        for name in chosen:
            folder = out / name / each
            manifest = pictures.generate_artimage(name, each, folder, **options)  # type: ignore[arg-type]
            print(f"{manifest.num_items} pictures in {folder}")
    return 0


def export(
    source: tyro.conf.Positional[str],
    *,
    out: Path,
    format: Literal["urdf", "mjcf"] = "urdf",
) -> int:
    """Write an object as other simulators read it.

    Args:
        source: an id, such as drawer/0012, or a file or folder that `artgym import` takes.
        out: folder for the file and its meshes.
        format: urdf, with the object's exact description beside it, or mjcf for MuJoCo.
    """
    from artgym.objects import catalog
    from artgym.objects.importing import import_object
    from artgym.objects.mjcf_export import write_mjcf
    from artgym.objects.urdf_export import write_urdf

    obj = import_object(source).object if Path(source).exists() else catalog.load(source)
    print((write_urdf if format == "urdf" else write_mjcf)(obj, out))
    return 0


def show(
    what: tyro.conf.Positional[Literal["object", "labels", "sample"]],
    source: tyro.conf.Positional[str],
    *,
    out: Path,
    labels: Path | None = None,
    state: int | None = None,
    index: int | None = None,
) -> int:
    """Look at something: a PNG sheet, and a 3D page for any browser, in one HTML file each.

    Args:
        what: an object, the grasp labels of an object, or a picture of a set.
        source: the object's id, such as drawer/0012 or import/NAME; of a picture the folder that
            `artgym generate` wrote.
        out: folder for both files.
        labels: of labels, the folder that `artgym annotate` wrote; by default the labels inside
            the package.
        state: of labels, the joint state to show; by default all of them.
        index: of a picture, its place in the set; by default 0.
    """
    from artgym.show.label_view import show_labels
    from artgym.show.object_view import show_object
    from artgym.show.sample_view import show_sample

    options = {"labels": labels, "state": state, "index": index}
    known = {"object": (), "labels": ("labels", "state"), "sample": ("index",)}[what]
    for name, value in options.items():
        if value is not None and name not in known:
            raise InvalidArgumentError(f"--{name} {value} does not go with `artgym show {what}`.")
    if what == "object":
        written = show_object(source, out)
    elif what == "labels":
        written = show_labels(source, out, root=labels, state=state)
    else:
        written = show_sample(Path(source), out, index=index or 0)
    for path in written:
        print(path)
    return 0


def _catalogue_ids(category: str | None, split: str, count: int | None) -> list[str]:
    from artgym.objects import catalog, store

    if category == store.PREFIX:
        return list(store.ids()[:count])
    names = catalog.categories_with(split) if category is None else [category]
    return [i for name in names for i in catalog.object_ids(name, split, count)]  # type: ignore[arg-type]


COMMANDS: dict[str, Callable[..., int]] = {
    "doctor": doctor,
    "objects": objects,
    "import": import_,
    "check": check,
    "annotate": annotate,
    "generate": generate,
    "export": export,
    "show": show,
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one subcommand.

    Args:
        arguments: what follows `artgym` on the command line; by default the process's own.

    Returns:
        The exit status: 0 success, 1 failure, 2 a command line that cannot be understood, 130
        interrupted from the keyboard.
    """
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    if arguments == ["--version"]:
        print(f"artgym {artgym.__version__}")
        return 0
    if arguments and not arguments[0].startswith("-") and arguments[0] not in COMMANDS:
        error = UnknownNameError("subcommand", arguments[0], COMMANDS)
        print(f"artgym: {error} See `artgym --help`.", file=sys.stderr)
        return 2
    try:
        return tyro.extras.subcommand_cli_from_dict(
            COMMANDS, prog="artgym", description=artgym.__doc__, args=arguments
        )
    except ArtgymError as error:
        print(f"artgym: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("artgym: interrupted.", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main())
