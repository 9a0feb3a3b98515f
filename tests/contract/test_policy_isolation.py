"""The policy sees observations and nothing else: it runs where there is no simulator."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest
import torch

import artgym  # noqa: F401
from icaf4_policy.backbone.pointnet2 import BackboneConfig
from icaf4_policy.checkpoint import save_model
from icaf4_policy.model import Icaf4, ModelConfig
from icaf4_policy.policy import Icaf4Policy
from tests.contract.isolated_policy import BLOCKED, Blocker, packed, receive, send, unpacked

ROOT = Path(__file__).resolve().parents[2]
SEED, STEPS = 3, 30


@pytest.fixture
def weights(tmp_path):
    torch.manual_seed(0)
    config = ModelConfig(
        categories=("drawer",),
        num_parts=2,
        length_units=(0.25,),
        num_points=512,
        backbone=BackboneConfig(centers=(64, 16), neighbors=8),
    )
    model = Icaf4(config).eval()
    with torch.no_grad():
        # Random, but inclined to see the part and its hinge: else it would never act.
        model.segmentation.mlp.layers[6].bias[1] += 10.0
        model.joint.mlp.layers[6].bias[2] += 10.0
    path = tmp_path / "random.safetensors"
    save_model(path, model, {})
    return path


def test_the_policy_acts_alike_without_a_simulator(weights, render_system):
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    here = Icaf4Policy.load("drawer", weights)
    here.reset(SEED)
    script = Path(__file__).with_name("isolated_policy.py")
    process = subprocess.Popen(
        [sys.executable, str(script), str(weights), str(SEED)],
        cwd=ROOT,
        env={"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "PATH": ""},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    env = gymnasium.make("ArtOpen-v0", categories=("drawer",), obs_mode="rgbd")
    observation, _ = env.reset(seed=SEED)
    actions = []
    for _ in range(STEPS):
        send(process.stdin, packed(observation))
        answer = receive(process.stdout)
        assert answer is not None, "the isolated policy died; see stderr"
        actions.append(np.frombuffer(answer, np.float32))
        np.testing.assert_array_equal(actions[-1], here.act(observation))
        observation, *_ = env.step(actions[-1])
    process.stdin.close()
    assert process.wait(60) == 0
    process.stdout.close()
    env.close()
    torch.set_num_threads(threads)
    # It was no test of standing still.
    assert np.abs(actions).max() > 0.5


def test_observations_survive_the_pipe():
    observation = {"rgb": np.arange(12, dtype=np.uint8).reshape(2, 2, 3), "part": np.int64(1)}
    back = unpacked(packed(observation))
    assert back.keys() == observation.keys()
    for name, value in observation.items():
        np.testing.assert_array_equal(back[name], value)
        assert back[name].dtype == np.asarray(value).dtype


@pytest.mark.parametrize("name", [*BLOCKED, "sapien.render", "artgym.sim.scene"])
def test_the_blocker_blocks(name):
    with pytest.raises(ImportError, match="must not be imported"):
        Blocker().find_spec(name)


@pytest.mark.parametrize("name", ["artgym", "artgym.geometry.camera", "numpy", "artgym.simple"])
def test_the_blocker_lets_others_pass(name):
    assert Blocker().find_spec(name) is None
