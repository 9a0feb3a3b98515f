"""Decomposes one mesh with coacd; run as a process of its own, which can be ended at any time.

``python decomposition_process.py mesh.npz pieces.npz``: it imports nothing of this package, so that
it starts at once.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np


def main(arguments: Sequence[str]) -> int:
    """Reads vertices, faces and settings from one npz file, writes the pieces to another."""
    import coacd

    source, target = arguments
    with np.load(source, allow_pickle=False) as given:
        mesh = coacd.Mesh(given["vertices"], given["faces"])
        threshold, resolution = float(given["threshold"]), int(given["voxels"])
        max_pieces, seed = int(given["max_pieces"]), int(given["seed"])
    coacd.set_log_level("error")
    pieces = coacd.run_coacd(
        mesh,
        threshold=threshold,
        max_convex_hull=max_pieces,
        preprocess_mode="on" if resolution else "off",
        preprocess_resolution=resolution or 50,
        mcts_iterations=60,
        mcts_max_depth=2,
        seed=seed,
    )
    np.savez(
        target, allow_pickle=False, **{f"{i:04d}": points for i, (points, _) in enumerate(pieces)}
    )
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
