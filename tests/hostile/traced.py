"""Imports every hostile case and writes down what happened: `python -m tests.hostile.traced ...`.

Arguments: the folder for the cases and the JSON file for what was seen. A process of its own, since
an audit hook stays for ever.
"""

from __future__ import annotations

import codecs
import json
import pickle
import sys
import time
from pathlib import Path
from typing import Any

import PIL.Image

from artgym.errors import ArtgymError, AssetError
from tests.hostile.corpus import (
    CASES,
    GOOD_MJCF,
    GOOD_MTL,
    GOOD_OBJ,
    GOOD_URDF,
    ascii_stl,
    dae,
    glb,
    own_files,
    png,
    stl,
    textured_obj,
)
from tests.hostile.loading import load
from tests.hostile.watching import AuditLog, OpenWatch


def warm_up(folder: Path) -> None:
    """Loads sound files of each kind, so that all modules are imported before anybody listens."""
    meshes = {".obj": GOOD_OBJ, ".dae": dae().encode(), ".glb": glb(), ".stl": stl()}
    (folder / "meshes").mkdir(parents=True)
    for suffix, content in meshes.items():
        (folder / "meshes" / f"door{suffix}").write_bytes(content)
        (folder / f"{suffix[1:]}.urdf").write_text(GOOD_URDF.replace("door.obj", f"door{suffix}"))
        load(folder / f"{suffix[1:]}.urdf")
    (folder / "meshes" / "door.stl").write_bytes(ascii_stl())
    load(folder / "stl.urdf")
    (folder / "meshes" / "door.obj").write_bytes(textured_obj())
    (folder / "meshes" / "door.mtl").write_bytes(GOOD_MTL)
    (folder / "meshes" / "paint.png").write_bytes(png())
    load(folder / "obj.urdf")
    (folder / "object.xml").write_text(GOOD_MJCF)
    load(folder / "object.xml")
    own = folder / "own.artgym"
    own.mkdir()
    for name, content in own_files().items():
        (own / name).write_bytes(content)
    load(own)
    # Decoders of pictures and codecs of zip files are imported when first needed.
    PIL.Image.init()
    codecs.lookup("cp437")


def main(root: Path, out: Path) -> None:
    """Loads each case and writes one record for each."""
    warm_up(root / "good")
    paths = {case.name: case.write(root / "cases") for case in CASES}
    log = AuditLog()
    records: dict[str, dict[str, Any]] = {}
    for case in CASES:
        watch = OpenWatch([root / "cases" / case.name / "outside"])
        start, cpu = time.perf_counter(), time.process_time()
        with log.listening() as (opened, events):
            try:
                load(paths[case.name])
                error = None
            except BaseException as raised:
                error = raised
        record: dict[str, Any] = {
            "seconds": time.perf_counter() - start,
            "cpu_seconds": time.process_time() - cpu,
            "opened": opened,
            "events": events,
            "outside": sorted(watch.opened()),
            "outcome": "loaded" if error is None else type(error).__name__,
            "message": str(error),
        }
        watch.close()
        if isinstance(error, AssetError):
            again = pickle.loads(pickle.dumps(error))
            record |= {
                "file": error.file,
                "element": error.element,
                "remedy": error.remedy,
                "survives": isinstance(again, ArtgymError) and str(again) == str(error),
            }
        records[case.name] = record
    out.write_text(json.dumps(records))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
