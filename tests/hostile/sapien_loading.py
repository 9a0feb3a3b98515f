"""Loads URDF files with the simulator's own loader: `python -m tests.hostile.sapien_loading FD`.

Says "ready" on the file descriptor FD, reads paths from standard input, one a line, and answers
with one line of JSON each. A process of its own, since what it is given may end it.
"""

from __future__ import annotations

import json
import os
import sys

import numpy as np
import sapien

from artgym.sim import renderer

STEPS = 10


def outcome(path: str) -> dict[str, str]:
    """What becomes of one file: loaded, or how it failed."""
    scene = sapien.Scene([sapien.physx.PhysxCpuSystem(), renderer.render_system()])
    try:
        loader = scene.create_urdf_loader()
        loader.fix_root_link = True
        robot = loader.load(path)
        if robot is None:
            return {"outcome": "nothing", "message": "the loader returned None"}
        for _ in range(STEPS):
            scene.step()
        numbers = [robot.get_qpos(), robot.get_qvel()]
        numbers += [link.entity_pose.p for link in robot.links]
        numbers += [link.entity_pose.q for link in robot.links]
        if not all(np.all(np.isfinite(n)) for n in numbers):
            return {"outcome": "state not finite", "message": ""}
        bare = [link.name for link in robot.links if not link.collision_shapes]
        shapes = f"{len(robot.links)} links, without collision: {bare[:5]}"
        return {"outcome": "loaded", "message": shapes}
    except Exception as error:
        return {"outcome": type(error).__name__, "message": str(error)[:300]}


def main(descriptor: int) -> None:
    """Answers until standard input ends."""
    # The first scene costs seconds.
    renderer.render_system()
    with os.fdopen(descriptor, "w") as answers:
        print("ready", file=answers, flush=True)
        for line in sys.stdin:
            print(json.dumps(outcome(line.rstrip("\n"))), file=answers, flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]))
