"""Finds a device that can render, and makes RenderSystems on it.

The first picture of a process costs seconds, every later RenderSystem, camera, object or scene
milliseconds. What shares a RenderSystem is seen together, so scenes that are open at the same
time need one each.
"""

from __future__ import annotations

import functools
import json
import sys
import time
from pathlib import Path
from typing import Any, Literal

import sapien

from artgym.errors import RendererUnavailableError
from artgym.sim import vulkan

#: "fast" draws in one pass lamps from afar and light from everywhere, in a third of the time of
#: "shadows", SAPIEN's smallest, which knows all kinds of lamps. Where both can, they agree.
ShaderName = Literal["fast", "shadows"]
_SHADERS: dict[ShaderName, str] = {
    "fast": str(Path(__file__).parent / "shaders"),
    "shadows": "minimal",
}


def use_shader(name: ShaderName) -> None:
    """Chooses how cameras made from now on render, and in what their pictures come.

    Color in bytes, PositionSegmentation in whole millimetres and ``per_scene_id``. Both settings
    are the process's own, and other libraries change them.
    """
    sapien.render.set_camera_shader_dir(_SHADERS[name])
    sapien.render.set_picture_format("Color", "r8g8b8a8unorm")
    sapien.render.set_picture_format("ColorRaw", "r8g8b8a8unorm")
    sapien.render.set_picture_format("PositionSegmentation", "r16g16b16a16sint")


def find_device() -> str:
    """Name of the device that `render_system` renders on.

    Returns:
        A name SAPIEN understands: "cuda", "pci:<address>" or "cpu" (Mesa's lavapipe).

    Raises:
        RendererUnavailableError: no device can render; the message says what to install.
    """
    return _device_and_system()[0]


def render_system() -> sapien.render.RenderSystem:
    """The RenderSystem of this process, made at the first call.

    Scenes on one RenderSystem see each other's objects and lights: it is for scenes of which one
    is closed before the next is built.

    Raises:
        RendererUnavailableError: no device can render; the message says what to install.
    """
    return _device_and_system()[1]


def own_render_system() -> sapien.render.RenderSystem:
    """A new RenderSystem, for what lives beside other scenes: an environment.

    Only the first picture of a process is slow, so it costs milliseconds.

    Raises:
        RendererUnavailableError: no device can render; the message says what to install.
    """
    return sapien.render.RenderSystem(find_device())


@functools.cache
def _device_and_system() -> tuple[str, sapien.render.RenderSystem]:
    found = vulkan.devices()
    problem = vulkan.problem(found, vulkan.missing_libraries())
    if problem is not None:
        raise RendererUnavailableError(
            f"no device here can render: {problem} To mend it: {vulkan.remedy()} "
            "State and point-cloud observations work without it."
        )
    refusals = []
    for name in _candidates(found):
        # A driver may offer a device and still lack what SAPIEN asks of it: only making the
        # RenderSystem tells.
        try:
            return name, sapien.render.RenderSystem(name)
        except RuntimeError as error:
            refusals.append(f"{name}: {error}")
    raise RendererUnavailableError(
        f"SAPIEN refuses every Vulkan device here ({'; '.join(refusals)}). "
        f"To mend it: {vulkan.remedy()} State and point-cloud observations work without it."
    )


def _candidates(found: list[vulkan.VulkanDevice]) -> list[str]:
    """SAPIEN's names of the devices that may render, GPUs first."""
    usable = [device for device in found if device.can_render()]
    gpus = [device for device in usable if device.kind != "cpu"]
    names = ["cuda"] if gpus else []
    names += [f"pci:{gpu.pci}" for gpu in gpus if gpu.pci is not None]
    if len(gpus) < len(usable):
        names.append("cpu")
    return names


def probe() -> dict[str, Any]:
    """Render one small picture of a box and say how it went.

    Returns:
        ``device`` and ``name`` of the renderer and ``first_picture_s``, or ``error``.
    """
    try:
        device, system = _device_and_system()
        start = time.perf_counter()
        scene = sapien.Scene([sapien.physx.PhysxCpuSystem(), system])
        use_shader("fast")
        camera = scene.add_camera("probe", 32, 32, fovy=1.0, near=0.01, far=10.0)
        builder = scene.create_actor_builder()
        builder.add_box_visual(half_size=(0.1, 0.1, 0.1))
        # SAPIEN's cameras look along +x.
        builder.set_initial_pose(sapien.Pose([1.0, 0.0, 0.0]))
        builder.build_static()
        scene.update_render()
        camera.take_picture()
        depth_mm = -int(camera.get_picture("PositionSegmentation")[16, 16, 2])
        scene.clear()
    except (RendererUnavailableError, RuntimeError) as error:
        return {"error": str(error)}
    if not 890 <= depth_mm <= 910:
        return {"error": f"a box 900 mm away is rendered at {depth_mm} mm on {device}."}
    return {
        "device": device,
        "name": _name_of(device, system),
        "first_picture_s": round(time.perf_counter() - start, 2),
    }


def _name_of(device: str, system: sapien.render.RenderSystem) -> str:
    # SAPIEN calls the software renderer "cpu" and nothing more.
    software = [found.name for found in vulkan.devices() if found.kind == "cpu"]
    return software[0] if device == "cpu" and software else system.device.name


def main() -> int:
    """Print `probe` as one line of JSON; exit status 1 if nothing could be rendered."""
    outcome = probe()
    print(json.dumps(outcome))
    return 1 if "error" in outcome else 0


if __name__ == "__main__":
    sys.exit(main())
