"""Times what environments do, each library in a process of its own that is asked over a pipe.

``Stopwatch`` starts such a process and asks it; ``python -m benchmarks.stopwatch SIDE`` is the
process. One that is not asked only waits, so two of them can be asked in turn without disturbing
each other.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import gymnasium
import numpy as np
from numpy.typing import NDArray

from artgym.errors import ArtgymError, MissingDependencyError, RendererUnavailableError
from artgym.threads import ONE_THREAD

Array = NDArray[np.floating]

Side = Literal["ours", "maniskill"]

#: Variables of a timing process: one thread, the software renderer included.
SETTINGS: Mapping[str, str] = {**ONE_THREAD, "LP_NUM_THREADS": "1"}
#: A hand slower than both at the end of a control step may have gone to sleep: m/s and rad/s.
STILL_SPEED, STILL_TURN = 1e-4, 1e-3
#: How far the same scene with the same targets may be from the environment's, metres.
MAX_DEVIATION = 0.02

_ROOT = Path(__file__).resolve().parents[1]


class StillSceneError(ArtgymError, RuntimeError):
    """A scene stood still while it was timed: a sleeping scene steps many times faster."""


class OtherSceneError(ArtgymError, RuntimeError):
    """A scene that should have moved like another did not."""


class StopwatchError(ArtgymError, RuntimeError):
    """The process that was timing failed or died."""


_ERRORS: Mapping[str, type[ArtgymError]] = {
    error.__name__: error
    for error in (
        StillSceneError,
        OtherSceneError,
        MissingDependencyError,
        RendererUnavailableError,
    )
}


def random_actions(seed: int, steps: int) -> NDArray[np.float32]:
    """Actions (steps, 7), even in [-1, 1]."""
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, 7)).astype(np.float32)


def seconds_a_step(
    env: gymnasium.Env[Any, Any],
    actions: NDArray[np.float32],
    seed: int | None,
    *,
    prepare: Callable[[], object] = lambda: None,
    look: Callable[[], object] = lambda: None,
) -> float:
    """Seconds of one step, reward and info included.

    Args:
        env: is reset, and once more wherever an episode ends; that does not count.
        actions: one a step.
        seed: of the first episode.
        prepare: called after each reset; does not count.
        look: called where an episode or the actions end; does not count.
    """
    env.reset(seed=seed)
    prepare()
    seconds = 0.0
    last = len(actions) - 1
    began = time.perf_counter()
    for i, action in enumerate(actions):
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated or i == last:
            seconds += time.perf_counter() - began
            look()
            if i < last:
                env.reset()
                prepare()
            began = time.perf_counter()
    return seconds / len(actions)


def seconds_a_reset(
    env: gymnasium.Env[Any, Any], options: Sequence[dict[str, Any] | None]
) -> float:
    """Seconds of one reset, one reset for each of the options."""
    began = time.perf_counter()
    for each in options:
        env.reset(options=each)
    return (time.perf_counter() - began) / len(options)


# --- Ours ----------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Drive:
    """What the hand was told in one episode, and where it went.

    Attributes:
        object_id: of the episode.
        T_world_object: pose (4, 4) of the object.
        q: joint positions at the start.
        T_world_tcp: tool centre at the start, (4, 4).
        width: of the jaws at the start, metres.
        targets: where the hand is pulled to in each step, and the width of its jaws, metres.
        path: positions (steps, 3) of the tool centre after each step.
    """

    object_id: str
    T_world_object: Array
    q: Array
    T_world_tcp: Array
    width: float
    targets: list[tuple[Any, float]]
    path: list[Array]


class OurTimings:
    """Times ``ArtOpen-v0``, and the bare simulator on its scene."""

    def __init__(self, *, camera_size: tuple[int, int]) -> None:
        self._camera_size = camera_size
        self._made: dict[tuple[str, str], gymnasium.Env[Any, Any]] = {}

    def _env(self, mode: str, object_id: str) -> gymnasium.Env[Any, Any]:
        if (mode, object_id) not in self._made:
            self._made[mode, object_id] = gymnasium.make(
                "ArtOpen-v0",
                objects=(object_id,),
                obs_mode=mode,
                camera_size=tuple(self._camera_size),
            )
        return self._made[mode, object_id]

    def step(
        self, *, mode: str, object_id: str, seed: int, steps: int, awake: bool = False
    ) -> float:
        """Seconds of a control step.

        Args:
            mode: of observation.
            object_id: of the episodes.
            seed: of the first episode and of the actions.
            steps: of control.
            awake: whether the object must not sleep while nothing touches it.

        Raises:
            StillSceneError: something slept that should not.
        """
        env = self._env(mode, object_id)
        inner: Any = env.unwrapped

        def prepare() -> None:
            if awake:
                keep_awake(inner._scene)

        def look() -> None:
            require_awake(inner._scene, object_id, awake)

        return seconds_a_step(env, random_actions(seed, steps), seed, prepare=prepare, look=look)

    def reset(self, *, object_id: str, count: int) -> float:
        """Seconds of a reset that keeps the object."""
        options: list[dict[str, Any] | None] = [{"object_id": object_id}] * count
        return seconds_a_reset(self._env("state", object_id), options)

    def swap(self, *, object_ids: Sequence[str]) -> float:
        """Seconds of a reset to another object; the first is where it starts from."""
        env = self._env("state", object_ids[0])
        env.reset(options={"object_id": object_ids[0]})
        return seconds_a_reset(env, [{"object_id": i} for i in object_ids[1:]])

    def camera(self, *, object_id: str, seed: int) -> dict[str, Any]:
        """The camera that sees the episodes of a seed, as the simulator has it, and its renderer.

        ``pose`` is position and quaternion (7,) with the simulator's axes, ``fov_y`` radians.
        """
        from artgym.geometry.rotations import quaternion_from_matrix
        from artgym.sim.conversion import R_SIMCAM_CAMERA
        from artgym.sim.renderer import find_device

        seen, _ = self._env("rgbd", object_id).reset(seed=seed)
        T = seen["T_world_camera"].reshape(4, 4).astype(float)
        height = seen["rgb"].shape[0]
        turn = quaternion_from_matrix(T[:3, :3] @ R_SIMCAM_CAMERA.T)
        fov_y = 2.0 * np.arctan2(height / 2.0, seen["intrinsics"][4])
        return {
            "pose": [*T[:3, 3].tolist(), *np.asarray(turn).tolist()],
            "fov_y": float(fov_y),
            "size": list(self._camera_size),
            "device": find_device(),
        }

    def bare_step(self, *, object_id: str, seed: int, steps: int, awake: bool) -> float:
        """Seconds of a control step of the simulator alone, on the scenes that ``step`` steps.

        The hand is given the targets that the environment gave it and the simulator steps as often
        as in the environment: nothing is read, rewarded or observed.

        Args:
            object_id: of the episodes.
            seed: of the episodes.
            steps: of control.
            awake: whether the object must not sleep while nothing touches it. Asleep, physics
                takes half the time.

        Raises:
            StillSceneError: something slept that should not, or the hand was at rest.
            OtherSceneError: the hand did not go where it went in the environment.
        """
        drives = self._drives_of(object_id, seed, steps)
        for drive in drives:
            require_same_motion(drive, awake)
        return sum(bare_seconds(drive, awake) for drive in drives) / steps

    def _drives_of(self, object_id: str, seed: int, steps: int) -> list[Drive]:
        """The episodes of ``step`` in terms of the simulator."""
        from artgym.control import MAX_ROTATION, MAX_TRANSLATION, MAX_WIDTH
        from artgym.envs.articulated_env import WORKSPACE_HIGH, WORKSPACE_LOW
        from artgym.geometry import transforms
        from artgym.geometry.hand import T_hand_tcp
        from artgym.geometry.rotations import matrix_from_axis_angle
        from artgym.sim.conversion import pose_from_transform

        T_tcp_hand = transforms.invert(T_hand_tcp)
        env = self._env("state", object_id)
        inner: Any = env.unwrapped
        env.reset(seed=seed)
        drives: list[Drive] = []
        is_over = True
        for action in random_actions(seed, steps).astype(float):
            T = inner.tcp_pose()
            if is_over:
                drives.append(
                    Drive(
                        object_id=inner.object.object_id,
                        T_world_object=inner.T_world_object,
                        q=inner.joint_positions(),
                        T_world_tcp=T.copy(),
                        width=inner.jaw_width(),
                        targets=[],
                        path=[],
                    )
                )
            T[:3, 3] = np.clip(
                T[:3, 3] + MAX_TRANSLATION * action[:3], WORKSPACE_LOW, WORKSPACE_HIGH
            )
            T[:3, :3] = matrix_from_axis_angle(MAX_ROTATION * action[3:6]) @ T[:3, :3]
            width = 0.5 * MAX_WIDTH * (1.0 + float(action[6]))
            drives[-1].targets.append((pose_from_transform(T @ T_tcp_hand), width))
            _, _, terminated, truncated, _ = env.step(action.astype(np.float32))
            drives[-1].path.append(inner.tcp_pose()[:3, 3])
            is_over = terminated or truncated
            if is_over:
                env.reset()
        return drives


@contextmanager
def bare_scene(drive: Drive, awake: bool) -> Iterator[Any]:
    """The scene of an episode, built as the environment builds it.

    Args:
        drive: of the episode.
        awake: whether the simulator may let nothing sleep.
    """
    from artgym.geometry import transforms
    from artgym.geometry.hand import T_hand_tcp
    from artgym.objects import catalog
    from artgym.sim.scene import ManipulationScene

    scene = ManipulationScene(
        catalog.load(drive.object_id),
        drive.T_world_object,
        drive.q,
        T_world_hand=drive.T_world_tcp @ transforms.invert(T_hand_tcp),
        width=drive.width,
    )
    if awake:
        keep_awake(scene)
    try:
        yield scene
    finally:
        scene.close()


def bare_seconds(drive: Drive, awake: bool) -> float:
    """Seconds of an episode's physics: setting targets and stepping, nothing else."""
    from artgym.envs.articulated_env import SUBSTEPS

    with bare_scene(drive, awake) as scene:
        hand, system = scene.hand, scene.sapien_scene.physx_system
        began = time.perf_counter()
        for pose, width in drive.targets:
            hand.pull_to(pose)
            hand.open_jaws(width)
            for _ in range(SUBSTEPS):
                system.step()
        return time.perf_counter() - began


def require_same_motion(drive: Drive, awake: bool) -> None:
    """Goes through an episode as ``bare_seconds`` does, and looks at it after each step.

    Raises:
        StillSceneError: the hand was at rest, or asleep, or the object was and should not.
        OtherSceneError: the hand was not where it was in the environment.
    """
    from artgym.envs.articulated_env import SUBSTEPS
    from artgym.geometry.hand import T_hand_tcp
    from artgym.sim.conversion import transform_from_pose

    with bare_scene(drive, awake) as scene:
        root = scene.hand.links[0]
        for i, ((pose, width), position) in enumerate(zip(drive.targets, drive.path, strict=True)):
            scene.hand.pull_to(pose)
            scene.hand.open_jaws(width)
            for _ in range(SUBSTEPS):
                scene.sapien_scene.physx_system.step()
            require_awake(scene, f"{drive.object_id}, step {i}", awake)
            there = (transform_from_pose(root.entity_pose) @ T_hand_tcp)[:3, 3]
            away = float(np.linalg.norm(there - position))
            if away > MAX_DEVIATION:
                raise OtherSceneError(
                    f"{drive.object_id}, step {i}: the bare scene's hand is {away:.3f} m from the "
                    f"environment's, expected less than {MAX_DEVIATION} m. Does "
                    "benchmarks.stopwatch still give the targets that the environment gives?"
                )


def keep_awake(scene: Any) -> None:
    """Forbids a ``ManipulationScene`` to let anything sleep."""
    for articulation in scene.sapien_scene.get_all_articulations():
        articulation.sleep_threshold = 0.0


def require_awake(scene: Any, where: str, object_too: bool) -> None:
    """Looks whether the hand of a ``ManipulationScene`` moves, and nothing sleeps.

    Args:
        scene: just stepped.
        where: named in the error.
        object_too: whether the object, too, must not sleep.

    Raises:
        StillSceneError: something does.
    """
    links = [*scene.hand.links, *(scene.body.links if object_too else ())]
    asleep = [link.name for link in links if link.sleeping]
    if asleep:
        raise StillSceneError(
            f"{where}: {', '.join(asleep)} asleep, expected a scene that is awake: a sleeping one "
            "is not to be timed."
        )
    root = scene.hand.links[0]
    require_moving(root.linear_velocity, root.angular_velocity, where)


def require_moving(linear: Any, angular: Any, where: str) -> None:
    """Takes a hand's velocities, m/s and rad/s, for a proof that its scene is awake.

    Raises:
        StillSceneError: both are as good as zero.
    """
    speed, turn = float(np.linalg.norm(linear)), float(np.linalg.norm(angular))
    if not (speed >= STILL_SPEED or turn >= STILL_TURN):
        raise StillSceneError(
            f"{where}: the hand moves at {speed:.2g} m/s and {turn:.2g} rad/s, "
            f"expected {STILL_SPEED:g} or {STILL_TURN:g}: a sleeping scene is not to be timed."
        )


# --- ManiSkill -----------------------------------------------------------------------------------

#: Controllers of the twin by the mode that is asked for.
_CONTROL = {
    "state": "pd_ee_delta_pose",
    "joints": "pd_joint_delta_pos",
    "rgbd": "pd_ee_delta_pose",
}


class ManiSkillTimings:
    """Times the twin of ``ArtOpen-v0``.

    Args:
        assets: files that ``twin_asset.write`` wrote, by object id.
    """

    def __init__(self, *, assets: Mapping[str, str]) -> None:
        import benchmarks.maniskill_twin  # noqa: F401 registers the environment
        from benchmarks.twin_asset import TwinAsset

        self._assets = {object_id: TwinAsset.load(file) for object_id, file in assets.items()}
        self._cameras: dict[str, dict[str, Any]] = {}
        self._made: dict[tuple[str, str], gymnasium.Env[Any, Any]] = {}

    def see(self, *, object_id: str, camera: dict[str, Any]) -> None:
        """Says where the camera of mode "rgbd" stands."""
        self._cameras[object_id] = camera

    def _env(self, mode: str, object_id: str) -> gymnasium.Env[Any, Any]:
        if (mode, object_id) not in self._made:
            more: dict[str, Any] = {"obs_mode": "state", "render_backend": "none"}
            if mode == "rgbd":
                camera = self._cameras[object_id]
                device = camera["device"]
                more = {
                    "obs_mode": "rgb+depth",
                    "render_backend": "gpu" if device == "cuda" else device,
                    "camera": (camera["pose"], camera["fov_y"], tuple(camera["size"])),
                }
            self._made[mode, object_id] = gymnasium.make(
                "ArtOpenTwin-v0",
                asset=self._assets[object_id],
                control_mode=_CONTROL[mode],
                **more,
            )
        return self._made[mode, object_id]

    def step(self, *, mode: str, object_id: str, seed: int, steps: int) -> float:
        """Seconds of a control step; ``mode`` is one of ``_CONTROL``.

        Raises:
            StillSceneError: the hand was at rest at the end of an episode.
        """
        env = self._env(mode, object_id)
        inner: Any = env.unwrapped

        def look() -> None:
            speeds = inner.agent.robot.get_qvel()[0].numpy()
            require_moving(speeds[:3], speeds[3:6], f"ManiSkill's {object_id}")

        return seconds_a_step(env, random_actions(seed, steps), seed, look=look)

    def reset(self, *, object_id: str, count: int) -> float:
        """Seconds of a reset that keeps the scene."""
        return seconds_a_reset(self._env("state", object_id), [None] * count)

    def swap(self, *, object_ids: Sequence[str]) -> float:
        """Seconds of a reset that builds the scene anew with another object."""
        env = self._env("state", object_ids[0])
        options: list[dict[str, Any] | None] = [
            {"reconfigure": True, "asset": self._assets[i]} for i in object_ids
        ]
        env.reset(options=options[0])
        seconds = seconds_a_reset(env, options[1:])
        env.reset(options=options[0])
        return seconds


# --- The process that is asked -------------------------------------------------------------------


class Stopwatch:
    """A process with one library in it, that does what it is asked and says how long it took.

    Args:
        side: whose library.
        options: of ``OurTimings`` or ``ManiSkillTimings``.
    """

    def __init__(self, side: Side, **options: Any) -> None:
        self.side = side
        self._process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.stopwatch", side],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=child_environment(),
            # Ctrl-C ends the parent, and the end of its pipe ends this process.
            process_group=0,
        )
        self.ask("start", **options)

    def ask(self, call: str, **arguments: Any) -> Any:
        """What the process answers to a call.

        Raises:
            StopwatchError: it failed, or is no more.
            ArtgymError: an error of ours that it met.
        """
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            print(json.dumps([call, arguments]), file=self._process.stdin, flush=True)
            line = self._process.stdout.readline()
        except OSError:
            line = ""
        if not line:
            raise StopwatchError(
                f"the process that times {self.side} died in {call!r} (exit status "
                f"{self._process.poll()}): see its last words above."
            )
        answer = json.loads(line)
        if "error" in answer:
            error = _ERRORS.get(answer["error"])
            if error is not None:
                raise error(answer["message"])
            raise StopwatchError(f"timing {self.side}, {call!r}:\n{answer['traceback']}")
        return answer["value"]

    def close(self) -> None:
        """Ends the process."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.terminate()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            pipe.close()

    def __enter__(self) -> Stopwatch:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def child_environment() -> dict[str, str]:
    """Environment variables of a timing process: one thread, and this repository's modules."""
    path = os.pathsep.join([str(_ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    return {**os.environ, **SETTINGS, "PYTHONPATH": path}


def _serve(side: str) -> None:
    # What libraries print goes to stderr: stdout carries answers.
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    timings: Any = None
    for line in sys.stdin:
        call, arguments = json.loads(line)
        try:
            if call == "start":
                timings = (OurTimings if side == "ours" else ManiSkillTimings)(**arguments)
                value = None
            else:
                value = getattr(timings, call)(**arguments)
            answer = {"value": value}
        except Exception as error:
            answer = {
                "error": type(error).__name__,
                "message": str(error),
                "traceback": traceback.format_exc(),
            }
        print(json.dumps(answer), file=answers, flush=True)


# --- A process's first reset ---------------------------------------------------------------------

_FIRST_RESET: Mapping[Side, str] = {
    "ours": """
import gymnasium
import artgym
env = gymnasium.make("ArtOpen-v0", objects=(argument,), obs_mode="state")
""",
    "maniskill": """
import gymnasium
import benchmarks.maniskill_twin
from benchmarks.twin_asset import TwinAsset
env = gymnasium.make(
    "ArtOpenTwin-v0",
    asset=TwinAsset.load(argument),
    obs_mode="state",
    control_mode="pd_ee_delta_pose",
    render_backend="none",
)
""",
}
_AROUND = """
import sys
argument = sys.argv[1]
{body}
env.reset(seed=0)
print("ready", flush=True)
from benchmarks.stopwatch import peak_memory_mib
print(peak_memory_mib(), flush=True)
"""


def first_reset(side: Side, argument: str, bytecode: Path) -> tuple[float, float]:
    """From nothing to the first observation, in a new process.

    Args:
        side: whose library.
        argument: object id for ours, file of the ``TwinAsset`` for ManiSkill.
        bytecode: folder where compiled modules are kept, so that only the first call compiles.

    Returns:
        Seconds from the start of the process to the end of the first reset, and peak MiB.

    Raises:
        StopwatchError: the process failed.
    """
    environment = child_environment() | {"PYTHONPYCACHEPREFIX": str(bytecode)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    code = _AROUND.format(body=_FIRST_RESET[side])
    with tempfile.TemporaryFile("w+", encoding="utf-8") as words:
        began = time.perf_counter()
        with subprocess.Popen(
            [sys.executable, "-c", code, argument],
            stdout=subprocess.PIPE,
            stderr=words,
            text=True,
            env=environment,
        ) as process:
            assert process.stdout is not None
            seconds = memory = None
            for line in process.stdout:
                if line.strip() == "ready":
                    seconds = time.perf_counter() - began
                elif seconds is not None:
                    memory = float(line)
        if seconds is None or memory is None:
            words.seek(0)
            raise StopwatchError(f"the first reset of {side} failed:\n{words.read()[-2000:]}")
    return seconds, memory


def peak_memory_mib() -> float:
    """Most memory that this process has held, MiB."""
    status = Path("/proc/self/status")
    if status.exists():
        # Unlike ru_maxrss it does not begin with the size of the parent.
        for line in status.read_text(encoding="utf-8").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1024
    import resource

    unit = 2**20 if sys.platform == "darwin" else 2**10
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


if __name__ == "__main__":
    _serve(sys.argv[1])
