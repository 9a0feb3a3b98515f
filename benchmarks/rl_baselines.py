"""Can a policy be learned by trial and error from state observations and the dense reward?

Run ``python -m benchmarks.rl_baselines --help``.
"""

from __future__ import annotations

import functools
import io
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from rich.table import Table
from tqdm import tqdm

import artgym  # noqa: F401  registers the environments
from artgym.errors import InvalidArgumentError
from artgym.files import write_file_whole
from artgym.objects import catalog
from benchmarks import record
from benchmarks.command import require_positive, run
from benchmarks.rates import wilson_interval


@dataclass(frozen=True, kw_only=True)
class RlConfig:
    """Can a policy be learned by trial and error from state observations and the dense reward?

    Attributes:
        env_id: of the environments; trained on the objects of "train", scored on those of "test".
        seeds: one policy is learned for each.
        steps: control steps of all copies together.
        copies: environments that run at a time.
        repeat: control steps for which an action is kept up.
        rollout: actions of each copy between two updates.
        batch, epochs: of an update.
        learning_rate: of Adam, falling to a tenth.
        discount: of rewards to come.
        layers: widths of the policy's and the value's networks.
        episodes: on as many test objects, once each, is a policy scored.
        resume: keep the seeds that ``rl_baselines.json`` holds already.
        workers: processes that step the copies; 0 steps them where the policy learns.
        out: folder for rl_baselines.json and the curves, rl_baselines.png.
    """

    env_id: str = "ArtOpenDrawer-v0"
    seeds: tuple[int, ...] = (0, 1, 2)
    steps: int = 1_200_000
    copies: int = 16
    repeat: int = 2
    rollout: int = 256
    batch: int = 512
    epochs: int = 6
    learning_rate: float = 3e-4
    discount: float = 0.98
    layers: tuple[int, ...] = (256, 256)
    episodes: int = 50
    resume: bool = False
    workers: int = 2
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        require_positive(
            self, "steps", "copies", "repeat", "rollout", "batch", "epochs", "episodes"
        )
        if not self.seeds:
            raise InvalidArgumentError("seeds: expected one or more.")


def train(config: RlConfig, seed: int) -> dict[str, Any]:
    """Learns one policy and scores it."""
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

    from benchmarks.sb3_copies import Sb3Copies

    torch.set_num_threads(1)
    began = time.perf_counter()
    bar = tqdm(total=config.steps, desc=f"PPO, seed {seed}", unit="step", unit_scale=True)
    curve: list[dict[str, float]] = []

    class Watch(BaseCallback):
        """Moves the bar on and keeps what became of the episodes since the last update."""

        def __init__(self) -> None:
            super().__init__()
            self.ended: list[dict[str, Any]] = []

        def _on_step(self) -> bool:
            bar.update(config.copies * config.repeat)
            self.ended += [info for info in self.locals["infos"] if "terminal_observation" in info]
            return True

        def _on_rollout_end(self) -> None:
            if len(self.ended) < config.copies:
                return
            point = {
                "steps": self.num_timesteps * config.repeat,
                "seconds": round(time.perf_counter() - began, 1),
                **{
                    name: round(float(np.mean([info[name] for info in self.ended])), 4)
                    for name in ("success", "success_gripped", "travel")
                },
                "return": round(float(np.mean([i["episode"]["r"] for i in self.ended])), 2),
            }
            curve.append(point)
            bar.set_postfix(success=point["success"])
            self.ended = []

    copies = Sb3Copies(
        config.env_id, config.copies, config.workers, repeat=config.repeat, seed=seed
    )
    envs = VecNormalize(VecMonitor(copies), gamma=config.discount, clip_obs=5.0)
    try:
        model = PPO(
            "MlpPolicy",
            envs,
            n_steps=config.rollout,
            batch_size=config.batch,
            n_epochs=config.epochs,
            learning_rate=lambda left: config.learning_rate * (0.1 + 0.9 * left),
            gamma=config.discount,
            seed=seed,
            device="cpu",
            policy_kwargs={"net_arch": list(config.layers), "log_std_init": -0.5},
        )
        model.learn(config.steps // config.repeat, callback=Watch())
    finally:
        envs.close()
        bar.close()
    learned = round(time.perf_counter() - began, 1)

    def act(observation: Any) -> Any:
        return model.predict(envs.normalize_obs(observation), deterministic=True)[0]

    return {
        **record.provenance("benchmarks.rl_baselines"),
        "learning_seconds": learned,
        "curve": curve,
        **score(config, act),
    }


def score(config: RlConfig, act: Any) -> dict[str, Any]:
    """One episode on each test object."""
    category = gymnasium.spec(config.env_id).kwargs["categories"][0]
    infos = []
    for number, object_id in enumerate(catalog.object_ids(category, "test", config.episodes)):
        env = gymnasium.make(config.env_id, split="test", objects=(object_id,))
        observation, info = env.reset(seed=number)
        over = False
        while not over:
            action = act(observation)
            for _ in range(config.repeat):
                observation, _, terminated, truncated, info = env.step(action)
                over = terminated or truncated
                if over:
                    break
        env.close()
        infos.append(info)
    successes = sum(info["success"] for info in infos)
    return {
        "episodes": len(infos),
        "success": successes / len(infos),
        "success_interval": wilson_interval(successes, len(infos)),
        "success_gripped": float(np.mean([info["success_gripped"] for info in infos])),
        "success_once": float(np.mean([info["success_once"] for info in infos])),
        "travel": float(np.mean([info["travel"] for info in infos])),
        "failed": [info["object_id"] for info in infos if not info["success"]],
    }


def measure(config: RlConfig) -> dict[str, Any]:
    """Learns with every seed, and writes ``rl_baselines.json`` after each.

    With ``resume``, what seeds learned before with the same options is kept.

    Raises:
        DamagedFileError: there is an ``rl_baselines.json`` to resume that cannot be read.
    """
    apart = ("seeds", "resume", "out")
    return record.measure_rows(
        config.out / "rl_baselines.json",
        {name: value for name, value in asdict(config).items() if name not in apart},
        {f"seed {seed}": functools.partial(train, config, seed) for seed in config.seeds},
        resume=config.resume,
    )


def table_from_rows(rows: Mapping[str, Mapping[str, Any]]) -> Table:
    """The table for a person to read."""
    table = Table(title="PPO: success on objects never seen")
    for name in ("", "success, %", "Wilson 95 %", "gripped, %", "learned in, min"):
        table.add_column(name, justify="right")
    for name, row in rows.items():
        low, high = row["success_interval"]
        table.add_row(
            name,
            f"{100 * row['success']:.0f}",
            f"{100 * low:.0f}-{100 * high:.0f}",
            f"{100 * row['success_gripped']:.0f}",
            f"{row['learning_seconds'] / 60:.1f}",
        )
    return table


def draw_curves(rows: Mapping[str, Mapping[str, Any]], path: Path) -> None:
    """Success in training over control steps, a line a seed, as a PNG."""
    import matplotlib.figure

    figure = matplotlib.figure.Figure(figsize=(6, 4), layout="constrained")
    axes = figure.add_subplot()
    for name, row in rows.items():
        points = np.array([[p["steps"], p["success"]] for p in row["curve"]]).reshape(-1, 2)
        # The mean of what lies about a point: a few episodes end between two updates.
        size = max(1, min(9, len(points)))
        means = [
            points[i : i + size].mean(axis=0) for i in range(0, max(0, len(points) - size + 1))
        ]
        at, success = np.array(means).reshape(-1, 2).T
        axes.plot(at / 1e6, 100 * success, label=name)
    axes.set(xlabel="control steps, millions", ylabel="success in training, %", ylim=(0, 100))
    axes.legend()
    axes.grid(alpha=0.3)
    picture = io.BytesIO()
    figure.savefig(picture, format="png", dpi=120)
    write_file_whole(path, picture.getvalue())


def report(config: RlConfig) -> list[Table]:
    """Learns, writes ``rl_baselines.json`` and the curves, and gives the table."""
    rows = measure(config)["rows"]
    draw_curves(rows, config.out / "rl_baselines.png")
    return [table_from_rows(rows)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("rl_baselines", RlConfig, report, arguments)


if __name__ == "__main__":
    sys.exit(main())
