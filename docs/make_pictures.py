"""Makes the picture of what the network sees: `python docs/make_pictures.py`.

Needs a renderer. Objects are test objects; the same command gives the same picture.
"""

from __future__ import annotations

from pathlib import Path

import gymnasium
import imageio.v3 as imageio
import numpy as np

import artgym  # noqa: F401  (registers the environments)
from artgym.datasets.frame import CameraFrame
from benchmarks.policies import trained_categories
from icaf4_policy.drawing import draw_prediction
from icaf4_policy.inference import Perception
from icaf4_policy.policy import shipped_weights

PICTURES = Path(__file__).parent / "pictures"


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
    """Writes the picture."""
    PICTURES.mkdir(exist_ok=True)
    looks = np.concatenate([perceived(name) for name in trained_categories()])
    imageio.imwrite(PICTURES / "perceived.png", looks)
    print(f"wrote perceived.png to {PICTURES}")


if __name__ == "__main__":
    main()
