"""Makes the pictures of the README and the docs: `python docs/make_pictures.py`.

Needs a renderer. Objects are test objects; the same command gives the same pictures.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import gymnasium
import imageio.v3 as imageio
import numpy as np

import artgym  # noqa: F401  (registers the environments)
from artgym.datasets.frame import CameraFrame
from artgym.objects import catalog
from artgym.objects.model import Material
from artgym.sim.camera import RenderedCamera, ViewDistribution
from artgym.sim.renderer import render_system
from artgym.sim.scene import ManipulationScene
from artgym.sim.setting import add_lights
from icaf4_policy.drawing import draw_prediction
from icaf4_policy.inference import Perception
from icaf4_policy.policy import shipped_weights

PICTURES = Path(__file__).parent / "pictures"


def contact_sheet(category: str, columns: int = 6, open_fraction: float = 0.35) -> np.ndarray:
    """One row (h, w, 3) of a category's test objects, partly open."""
    rng = np.random.default_rng(0)
    pictures = []
    for object_id in catalog.object_ids(category, "test", columns):
        obj = catalog.load(object_id)
        scene = ManipulationScene(
            obj,
            np.eye(4),
            [joint.position(open_fraction) for joint in obj.joints],
            render_system=render_system(),
            table_material=Material(color=(0.75, 0.74, 0.72), roughness=0.9),
        )
        add_lights(scene.sapien_scene, rng)
        view = replace(ViewDistribution.around(obj), fov_y=(0.5, 0.5)).sample(rng, 240, 180)
        pictures.append(RenderedCamera(scene.sapien_scene, view).take()[0])
        scene.close()
    return np.concatenate(pictures, axis=1)


def perceived(category: str, seed: int = 0) -> np.ndarray:
    """One look (h, 4 w, 3): the picture, parts, affordance, grasps and joint."""
    env = gymnasium.make(
        "ArtOpen-v0", categories=(category,), split="test", obs_mode="rgbd", camera_size=(360, 270)
    )
    observation, _ = env.reset(seed=seed)
    frame = CameraFrame.from_observation(observation)
    prediction, _ = Perception.load(shipped_weights(category)).perceive(
        frame.rgb,
        frame.depth,
        frame.intrinsics,
        up_camera_hint=frame.T_world_camera[2, :3],
        rng=np.random.default_rng(seed),
    )
    env.close()
    panels = draw_prediction(frame.rgb, frame.intrinsics, prediction, num_grasps=8)
    return np.concatenate([frame.rgb, panels], axis=1)


def main() -> None:
    """Writes every picture."""
    PICTURES.mkdir(exist_ok=True)
    categories = sorted(catalog.CATEGORIES)
    sheet = np.concatenate([contact_sheet(name) for name in categories])
    looks = np.concatenate([perceived(name) for name in categories])
    imageio.imwrite(PICTURES / "objects.png", sheet)
    imageio.imwrite(PICTURES / "perceived.png", looks)
    print(f"wrote objects.png and perceived.png to {PICTURES}")


if __name__ == "__main__":
    main()
