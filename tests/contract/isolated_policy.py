"""Runs the policy where the simulator cannot be imported; a script.

It reads observations as npz bytes from stdin and writes actions as npy bytes to stdout, each
message behind its length. Nothing but arrays comes in, and nothing else goes out.
"""

from __future__ import annotations

import importlib.abc
import io
import struct
import sys
from pathlib import Path
from typing import BinaryIO

import numpy as np

BLOCKED = ("sapien", "mani_skill", "artgym.sim", "artgym.envs", "artgym.objects")


class Blocker(importlib.abc.MetaPathFinder):
    """Makes every import of the simulator and of what knows it fail."""

    def find_spec(self, name, path=None, target=None):
        if any(name == blocked or name.startswith(blocked + ".") for blocked in BLOCKED):
            raise ImportError(f"{name} must not be imported by a policy")


def send(stream: BinaryIO, message: bytes) -> None:
    """Writes one message."""
    stream.write(struct.pack("<q", len(message)) + message)
    stream.flush()


def receive(stream: BinaryIO) -> bytes | None:
    """Reads one message; None at the end of the stream."""
    head = stream.read(8)
    return stream.read(struct.unpack("<q", head)[0]) if len(head) == 8 else None


def packed(observation: dict[str, np.ndarray]) -> bytes:
    """An observation as npz bytes."""
    buffer = io.BytesIO()
    np.savez(buffer, **observation)
    return buffer.getvalue()


def unpacked(message: bytes) -> dict[str, np.ndarray]:
    """The observation of npz bytes."""
    with np.load(io.BytesIO(message), allow_pickle=False) as arrays:
        return dict(arrays)


def main() -> None:
    """Answers each observation with an action until stdin ends."""
    sys.meta_path.insert(0, Blocker())
    import torch

    from icaf4_policy.policy import Icaf4Policy

    torch.set_num_threads(1)
    policy = Icaf4Policy.load("drawer", Path(sys.argv[1]))
    policy.reset(int(sys.argv[2]))
    while (message := receive(sys.stdin.buffer)) is not None:
        action = policy.act(unpacked(message))
        assert action.dtype == np.float32
        send(sys.stdout.buffer, action.tobytes())
    loaded = [name for name in sys.modules if name.startswith(BLOCKED)]
    assert not loaded, loaded


if __name__ == "__main__":
    main()
