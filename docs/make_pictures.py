"""Makes the pictures of what the network sees and of what `artgym show` gives.

Needs a renderer: `python docs/make_pictures.py`, or with names of pictures to make only those.
Objects are test objects; the same command gives the same pictures.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import gymnasium
import imageio.v3 as imageio
import numpy as np

import artgym  # noqa: F401  (registers the environments)
from artgym.annotation.annotate import labelled_ids
from artgym.datasets.frame import CameraFrame
from artgym.datasets.generate import GenerationConfig, generate_reartmix, make_scenes
from artgym.datasets.sets import SETS
from artgym.show.label_view import show_labels
from artgym.show.object_view import show_object
from artgym.show.sample_view import show_sample
from icaf4_policy.drawing import draw_predictions
from icaf4_policy.inference import Perception
from icaf4_policy.scenes import ScenePerception
from icaf4_policy.shipped import trained_categories, weights_path

PICTURES = Path(__file__).parent / "pictures"


def perceived(category: str, seed: int = 0) -> np.ndarray:
    """One look (h, 4 w, 3): the picture, parts, affordance, grasps and joint."""
    env = gymnasium.make(
        "ArtOpen-v0", categories=(category,), split="test", obs_mode="rgbd", camera_size=(240, 180)
    )
    observation, _ = env.reset(seed=seed)
    frame = CameraFrame.from_observation(observation)
    prediction, _ = Perception.load(weights_path(category)).perceive(
        frame.rgb,
        frame.depth,
        frame.intrinsics,
        up_camera_hint=frame.T_world_camera[2, :3],
        rng=np.random.default_rng(seed),
    )
    env.close()
    panels = draw_predictions(frame.rgb, frame.intrinsics, [prediction], num_grasps=8)
    return np.concatenate([frame.rgb, panels], axis=1)


def perceived_png() -> bytes:
    """Looks at all categories that have a network, two in a row."""
    looks = [perceived(name) for name in trained_categories()]
    if len(looks) % 2:
        looks.append(np.zeros_like(looks[0]))
    pairs = [np.concatenate(pair, axis=1) for pair in zip(looks[::2], looks[1::2], strict=True)]
    return imageio.imwrite("<bytes>", np.concatenate(pairs), extension=".png")


def perceived_scene(number: int, ids: tuple[str, ...]) -> np.ndarray:
    """One look (h, 4 w, 3) at a scene through the detector."""
    (picture,) = make_scenes(ids, number, 1, GenerationConfig(camera_size=(360, 270)))
    rng = np.random.default_rng(number)
    seen = ScenePerception.load().look(picture.rgb, picture.depth, picture.intrinsics, rng=rng)
    predictions = [each.prediction for each in seen]
    panels = draw_predictions(picture.rgb, picture.intrinsics, predictions, num_grasps=3)
    return np.concatenate([picture.rgb, panels], axis=1)


def perceived_scenes_png() -> bytes:
    """Looks at the first scenes of test objects."""
    ids = tuple(i for category in SETS["reartmix"] for i in labelled_ids(category, "test"))
    looks = np.concatenate([perceived_scene(number, ids) for number in range(4)])
    return imageio.imwrite("<bytes>", looks, extension=".png")


def sheet(show: Callable[[Path], tuple[Path, Path]]) -> bytes:
    """The sheet that one of the functions behind `artgym show` writes to a folder."""
    with tempfile.TemporaryDirectory() as folder:
        png, _ = show(Path(folder))
        return png.read_bytes()


def shown_sample(folder: Path) -> tuple[Path, Path]:
    """Makes a scene from the labels inside the package and shows it."""
    scenes = folder / "scenes"
    generate_reartmix("test", scenes, 1, categories=("laptop", "drawer"), progress=False)
    return show_sample(scenes, folder)


MADE: dict[str, Callable[[], bytes]] = {
    "perceived": perceived_png,
    "perceived_scenes": perceived_scenes_png,
    "shown_object": lambda: sheet(lambda out: show_object("laptop/1201", out)),
    "shown_labels": lambda: sheet(lambda out: show_labels("laptop/1201", out)),
    "shown_sample": lambda: sheet(shown_sample),
}


def main() -> None:
    """Writes the pictures."""
    PICTURES.mkdir(exist_ok=True)
    for name in sys.argv[1:] or MADE:
        (PICTURES / f"{name}.png").write_bytes(MADE[name]())
        print(f"wrote {name}.png to {PICTURES}")


if __name__ == "__main__":
    main()
