"""One trial as Where2Act makes it, re-created from its paper's and its code's description.

Every trial is a process of its own. It loads an object by the simulator's URDF loader, steps at
500 Hz with 20 solver iterations until nothing has moved for 5,000 steps, takes a picture of
448 x 448 pixels, loads a gripper, takes another, and then spends 10,000 steps: to approach, to
wait, to close and wait, to pull and wait, 2,000 each, with a look at all contacts after every step.

``python -m benchmarks.where2act_protocol TASK.json`` is that process; it prints how long it took,
as JSON. What comes of the trial is of no interest here.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from artgym.errors import ArtgymError
from benchmarks.stopwatch import SETTINGS

TIMESTEP, ITERATIONS = 1.0 / 500.0, 20
STILL_STEPS, MOST_STILL_STEPS, STAGE_STEPS = 5000, 20_000, 2000
PICTURE_SIZE = 448


class ProtocolError(ArtgymError, RuntimeError):
    """The process of a trial failed."""


@dataclass(frozen=True, kw_only=True)
class ProtocolTask:
    """One trial.

    Attributes:
        urdf: the object.
        q: its joint positions.
        hand: pose of the hand at the grasp, 4 rows of 4.
        pull: direction of the pull, (3,), and the approach begins opposite to it.
    """

    urdf: str
    q: list[float]
    hand: list[list[float]]
    pull: list[float]


def run_protocol(task: ProtocolTask) -> dict[str, float]:
    """Makes one trial in a process of its own.

    Returns:
        Seconds of ``process``, from its start to its end, and of what it spent them on.

    Raises:
        ProtocolError: the process failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "task.json"
        file.write_text(json.dumps(asdict(task)), encoding="utf-8")
        began = time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-m", "benchmarks.where2act_protocol", str(file)],
            capture_output=True,
            text=True,
            check=False,
            cwd=Path(__file__).resolve().parents[1],
            env={**os.environ, **SETTINGS},
        )
        seconds = time.perf_counter() - began
    if done.returncode:
        raise ProtocolError(f"a trial by Where2Act's protocol failed: {done.stderr[-500:]}")
    return {"process": seconds, **json.loads(done.stdout.splitlines()[-1])}


def _trial(task: ProtocolTask) -> dict[str, float]:
    """The trial itself, in its process."""
    import importlib.util

    import sapien
    from sapien import physx

    clock = time.perf_counter
    seconds: dict[str, float] = {}
    began = clock()
    physx.set_scene_config(gravity=[0, 0, -9.81], bounce_threshold=2.0, enable_pcm=False)  # pyright: ignore[reportArgumentType]
    physx.set_body_config(
        solver_position_iterations=ITERATIONS, solver_velocity_iterations=1, sleep_threshold=0.0
    )
    scene = sapien.Scene([physx.PhysxCpuSystem(), sapien.render.RenderSystem()])
    scene.set_timestep(TIMESTEP)
    scene.set_ambient_light([0.5, 0.5, 0.5])
    scene.add_directional_light([0, 1, -1], [0.5, 0.5, 0.5])
    loader = scene.create_urdf_loader()
    loader.fix_root_link = True
    obj = loader.load(task.urdf)
    for joint in obj.active_joints:
        joint.set_drive_properties(stiffness=0, damping=10)
    obj.set_qpos(np.array(task.q))
    camera = scene.add_camera("camera", PICTURE_SIZE, PICTURE_SIZE, 0.6, 0.01, 10.0)
    camera.set_entity_pose(sapien.Pose([1.5, 0.0, 1.0], [0.26, 0.0, 0.26, -0.93]))
    seconds["load"] = clock() - began

    def step() -> bool:
        scene.step()
        return any(
            float(point.impulse @ point.impulse) > 1e-4
            for contact in scene.get_contacts()
            for point in contact.points
        )

    def picture() -> None:
        scene.update_render()
        camera.take_picture()
        camera.get_picture("Color")
        camera.get_picture("Position")

    began = clock()
    still = waited = 0
    before = obj.get_qpos()
    while still < STILL_STEPS and waited < MOST_STILL_STEPS:
        touched = step()
        now = obj.get_qpos()
        still = still + 1 if np.abs(now - before).max() < 1e-6 and not touched else 0
        before, waited = now, waited + 1
    seconds["still"] = clock() - began

    began = clock()
    picture()
    spec = importlib.util.find_spec("mani_skill")
    assert spec is not None
    assert spec.origin is not None
    panda = Path(spec.origin).parent / "assets" / "robots" / "panda" / "panda_v2_gripper.urdf"
    hand = scene.create_urdf_loader().load(str(panda))
    # A root of six joints: three along the axes, three about them.
    for joint in hand.active_joints:
        joint.set_drive_properties(stiffness=1e3, damping=4e2)
    T = np.array(task.hand)
    pull = np.array(task.pull)
    hand.set_qpos(_root_position(T, -0.05 * pull, len(hand.active_joints), 0.04))
    picture()
    seconds["pictures"] = clock() - began

    began = clock()
    stages = (
        (np.zeros(3), 0.04),
        (np.zeros(3), 0.04),
        (np.zeros(3), 0.0),
        (0.1 * pull, 0.0),
        (0.1 * pull, 0.0),
    )
    for offset, width in stages:
        target = _root_position(T, offset, len(hand.active_joints), width)
        for joint, value in zip(hand.active_joints, target, strict=True):
            joint.set_drive_target(float(value))
        for _ in range(STAGE_STEPS):
            step()
    seconds["interaction"] = clock() - began
    return seconds


def _root_position(
    T_world_hand: np.ndarray, offset: np.ndarray, joints: int, width: float
) -> np.ndarray:
    """Joint positions of the gripper: place, Euler angles, and the fingers' opening."""
    from scipy.spatial.transform import Rotation

    q = np.full(joints, width)
    q[:3] = T_world_hand[:3, 3] + offset
    q[3:6] = Rotation.from_matrix(T_world_hand[:3, :3]).as_euler("XYZ")
    return q


def main(arguments: list[str]) -> None:
    """The process of one trial."""
    content: dict[str, Any] = json.loads(Path(arguments[0]).read_text(encoding="utf-8"))
    print(json.dumps(_trial(ProtocolTask(**content))))


if __name__ == "__main__":
    main(sys.argv[1:])
