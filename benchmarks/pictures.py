"""What ICAF-4 saw and did: a picture of its first look and a film of the episode."""

from __future__ import annotations

import functools
import importlib.util
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import imageio.v3 as iio
import numpy as np
from numpy.typing import NDArray

from artgym.errors import MissingDependencyError
from artgym.files import write_file_whole
from artgym.geometry.camera import project
from benchmarks.episodes import EpisodeTask, run_episode

if TYPE_CHECKING:
    from icaf4_policy.prediction import Prediction

_FRAMES_A_SECOND = 20
_DRAWN_GRASPS = 10
#: How many times larger than seen, and (width, height) of a panel, pixels.
_ZOOM, _PANEL_SIZE = 3, (480, 360)


@dataclass(frozen=True, kw_only=True)
class PicturesTask:
    """Episodes of a perceiving policy to look at, one a category, and where to put what is seen.

    Attributes:
        episodes: which.
        picture: PNG, a row an episode: the image, parts, affordance, best grasps.
        film: MP4 of the episodes one after the other.
    """

    episodes: tuple[EpisodeTask, ...]
    picture: Path
    film: Path


def require_film_writer() -> None:
    """Checks that films can be written.

    Raises:
        MissingDependencyError: imageio-ffmpeg is not installed.
    """
    if importlib.util.find_spec("imageio_ffmpeg") is None:
        raise MissingDependencyError(
            "a film needs imageio-ffmpeg: pip install 'artgym[video]', or pass --no-pictures"
        )


def take_pictures(task: PicturesTask) -> None:
    """Runs the episodes once more, watched, and writes the picture and the film."""
    looks: dict[EpisodeTask, NDArray[np.uint8]] = {}
    frames: list[NDArray[np.uint8]] = []

    def watch(episode: EpisodeTask, env: Any, policy: Any, observation: Any) -> None:
        if episode not in looks and policy.prediction is not None:
            looks[episode] = _drawn(observation, policy.prediction)
        frames.append(env.render())

    for episode in task.episodes:
        run_episode(episode, render_mode="rgb_array", watch=functools.partial(watch, episode))
    if looks:
        rows = np.concatenate(list(looks.values()))
        write_file_whole(task.picture, iio.imwrite("<bytes>", rows, extension=".png"))
    film = iio.imwrite(
        "<bytes>",
        np.stack(frames),
        extension=".mp4",
        plugin="FFMPEG",
        fps=_FRAMES_A_SECOND,
        # The default would stretch the frames to a multiple of 16.
        macro_block_size=2,
    )
    write_file_whole(task.film, film)


def _drawn(observation: Any, prediction: Prediction) -> NDArray[np.uint8]:
    """The image and the three panels of ``draw_predictions``, enlarged and cut to the object."""
    from icaf4_policy.drawing import draw_predictions

    rgb = observation["rgb"].repeat(_ZOOM, axis=0).repeat(_ZOOM, axis=1)
    intrinsics = observation["intrinsics"].reshape(3, 3) * [[_ZOOM], [_ZOOM], [1.0]]
    drawn = draw_predictions(rgb, intrinsics, [prediction], _DRAWN_GRASPS)
    middle = project(prediction.points_camera.mean(axis=0)[None], intrinsics)[0]
    size = np.minimum(_PANEL_SIZE, rgb.shape[1::-1])
    left, top = np.clip(middle - size / 2, 0, rgb.shape[1::-1] - size).astype(int)
    panels = [rgb, *np.split(drawn, 3, axis=1)]
    return np.concatenate([p[top : top + size[1], left : left + size[0]] for p in panels], axis=1)
