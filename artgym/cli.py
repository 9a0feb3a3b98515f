"""The `artgym` command: one function a subcommand, its arguments built from the signature."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import tyro

import artgym
from artgym.errors import ArtgymError, InvalidArgumentError, UnknownNameError


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


def objects(*, category: str | None = None, split: str = "train", count: int | None = None) -> int:
    """List the objects of the catalogue, one a line.

    Args:
        category: only this one; by default all.
        split: train, val or test.
        count: the first so many of each category; by default all.
    """
    from artgym.objects import catalog

    for object_id in _catalogue_ids(category, split, count):
        obj = catalog.load(object_id)
        joints = [
            f"{j.child} {abs(j.range):.2f} {'m' if j.type == 'prismatic' else 'rad'}"
            for j in obj.joints
        ]
        kind = [f"{name}={value}" for name, value in sorted(obj.attributes.items())]
        low, high = obj.rest_bounds
        extents = "x".join(f"{extent:.2f}" for extent in high - low)
        print(f"{object_id}  {extents} m  {', '.join(joints)}  {' '.join(kind)}")
    return 0


def check(
    ids: tyro.conf.Positional[tuple[str, ...]] = (),
    *,
    all: bool = False,
    category: str | None = None,
    split: str = "train",
    count: int | None = None,
) -> int:
    """Say whether objects are fit to simulate: one verdict a rule, and why.

    Args:
        ids: objects to check, such as drawer/0012.
        all: check whole categories instead; only broken rules are printed.
        category: with --all, only this one.
        split: with --all, train, val or test.
        count: with --all, the first so many of each category.
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
        catalog.load(object_id)
    failed = 0
    for object_id in tqdm(chosen, desc="check", unit="object", disable=not all):
        found = soundness.check(catalog.load(object_id), judge)
        failed += not found.passed
        for verdict in found.failures if all else found.verdicts:
            tqdm.write(f"{object_id}  {verdict}", file=sys.stdout)
    print(f"{len(chosen) - failed} of {len(chosen)} objects are sound.")
    return 1 if failed else 0


def annotate(
    *,
    category: str,
    split: str = "train",
    count: int = 40,
    out: Path | None = None,
    workers: int = 1,
) -> int:
    """Label which grasps succeed, by trying them. Interrupted, the same command goes on.

    Args:
        category: the category to label.
        split: train, val or test.
        count: the first so many objects of the split.
        out: folder that gets {category}/{split}; by default the labels inside the package.
        workers: processes; any number gives the same bytes.
    """
    from artgym.annotation.annotate import annotate_split, labels_folder

    manifest = annotate_split(category, split, count, root=out, workers=workers)  # type: ignore[arg-type]
    print(f"{len(manifest.shards)} label files in {labels_folder(category, split, out)}")
    return 0


def generate(
    *,
    category: str,
    out: Path,
    split: str = "train",
    labels: Path | None = None,
    views: int = 16,
    camera_size: tuple[int, int] = (320, 240),
    seed: int = 0,
    workers: int = 1,
) -> int:
    """Make labelled RGB-D samples. Interrupted, the same command goes on where it stopped.

    Args:
        category: the category to picture.
        out: folder that gets {category}/{split}, as `icaf4 train` wants it.
        split: train, val or test.
        labels: folder that `artgym annotate` wrote; by default the labels inside the package.
        views: pictures of each labelled joint state.
        camera_size: width and height, pixels.
        seed: of views, lights and placements.
        workers: processes; any number gives the same bytes.
    """
    from artgym.datasets.generate import GenerationConfig, generate_split

    # A wrong name shall be called that, and not a lack of labels.
    _catalogue_ids(category, split, None)
    folder = out / category / split
    manifest = generate_split(
        category,
        split,  # type: ignore[arg-type]
        folder,
        config=GenerationConfig(views=views, camera_size=camera_size, seed=seed),
        label_root=labels,
        workers=workers,
    )
    print(f"{manifest.num_items} samples in {folder}")
    return 0


def _catalogue_ids(category: str | None, split: str, count: int | None) -> list[str]:
    from artgym.objects import catalog

    names = list(catalog.CATEGORIES) if category is None else [category]
    return [i for name in names for i in catalog.object_ids(name, split, count)]  # type: ignore[arg-type]


COMMANDS: dict[str, Callable[..., int]] = {
    "doctor": doctor,
    "objects": objects,
    "check": check,
    "annotate": annotate,
    "generate": generate,
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
