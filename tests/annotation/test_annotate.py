"""Label files: what they hold, and that neither workers nor interruptions change a byte."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from artgym.annotation.annotate import (
    AnnotationConfig,
    annotate_split,
    labelled_categories,
    labelled_ids,
    labels_folder,
    read_labels,
)
from artgym.annotation.trial import try_grasp
from artgym.errors import DamagedFileError, InvalidArgumentError
from artgym.geometry import transforms
from artgym.geometry.grasps import NUM_CANDIDATES, candidates_of_part
from artgym.objects import catalog

ROOT = Path(__file__).resolve().parents[2]
TINY = AnnotationConfig(start_states=1, later_states=1, points=2, views=2)
COUNT = 3


def files(root: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in sorted(labels_folder("drawer", "val", root).iterdir())}


def make(root: Path, count: int = COUNT, workers: int = 1, config: AnnotationConfig = TINY):
    return annotate_split(
        "drawer", "val", count, root=root, config=config, workers=workers, progress=False
    )


@pytest.fixture(scope="module")
def finished(tmp_path_factory) -> Path:
    root = tmp_path_factory.mktemp("labels")
    make(root)
    return root


def test_what_a_label_file_holds(finished):
    assert labelled_ids("drawer", "val", finished) == ["drawer/1000", "drawer/1001", "drawer/1002"]
    for object_id in labelled_ids("drawer", "val", finished):
        labels, obj = read_labels(object_id, finished), catalog.load(object_id)
        assert labels.success.shape == (2, 2, NUM_CANDIDATES)
        start, later = labels.fractions
        assert 0.0 <= start <= 0.05 <= later <= 0.3
        np.testing.assert_array_equal(labels.verdicts.sum(axis=1), 2 * NUM_CANDIDATES)
        np.testing.assert_array_equal(labels.ends.sum(axis=1), labels.verdicts[:, 0])
        # No more successes than trials that moved the part.
        assert np.all(labels.success.sum(axis=(1, 2)) <= labels.ends[:, 0])
        low, high = obj.links[1].bounds()
        assert np.all((labels.points_part > low - 1e-5) & (labels.points_part < high + 1e-5))


def test_bits_are_the_outcomes_of_trials(finished):
    tried = 0
    for object_id in labelled_ids("drawer", "val", finished):
        labels, obj = read_labels(object_id, finished), catalog.load(object_id)
        for state, point, candidate in np.argwhere(labels.success)[:2]:
            q = obj.positions_with(1, labels.fractions[state])
            T_object_grasp = tried_grasp(labels, obj, state, point, candidate)
            assert try_grasp(obj, q, 1, T_object_grasp).success
            tried += 1
    assert tried


@pytest.mark.parametrize("category", ["drawer", "laptop"])
def test_shipped_bits_are_the_outcomes_of_trials(category):
    rng = np.random.default_rng(0)
    held = []
    for object_id in labelled_ids(category, "test")[:5]:
        labels, obj = read_labels(object_id), catalog.load(object_id)
        for state, point, candidate in rng.choice(np.argwhere(labels.success), 6):
            q = obj.positions_with(1, labels.fractions[state])
            T_object_grasp = tried_grasp(labels, obj, state, point, candidate)
            held.append(try_grasp(obj, q, 1, T_object_grasp).success)
    # The points are kept in single precision: a try on the brink may end otherwise.
    assert np.mean(held) >= 0.95


def tried_grasp(labels, obj, state, point, candidate):
    """``T_object_grasp`` of one try, from what the file keeps."""
    T_object_part = obj.link_poses(obj.positions_with(1, labels.fractions[state]))[1]
    R = candidates_of_part(labels.normals_part[state, point], T_object_part[:3, :3])[candidate]
    point_object = transforms.apply(T_object_part, labels.points_part[state, point][None])[0]
    return transforms.transform_from(R, point_object)


def test_two_workers_write_the_same_bytes(finished, tmp_path):
    make(tmp_path, workers=2)
    assert files(tmp_path) == files(finished)


def test_more_objects_later(finished, tmp_path):
    make(tmp_path, count=1)
    first = labels_folder("drawer", "val", tmp_path) / "drawer_1000.h5"
    written = first.stat().st_mtime_ns
    make(tmp_path)
    assert first.stat().st_mtime_ns == written
    assert files(tmp_path) == files(finished)


def test_killed_and_resumed(finished, tmp_path):
    script = (
        "import sys; from pathlib import Path\n"
        "from artgym.annotation.annotate import AnnotationConfig, annotate_split\n"
        "config = AnnotationConfig(start_states=1, later_states=1, points=2, views=2)\n"
        "annotate_split('drawer', 'val', 3, root=Path(sys.argv[1]), config=config)"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", script, str(tmp_path)], cwd=ROOT, stderr=subprocess.DEVNULL
    )
    first = labels_folder("drawer", "val", tmp_path) / "drawer_1000.h5"
    while not first.exists() and process.poll() is None:
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    assert process.wait() == -signal.SIGKILL
    assert not (first.parent / "drawer_1002.h5").exists()
    make(tmp_path)
    assert files(tmp_path) == files(finished)
    assert not [p for p in first.parent.iterdir() if p.name.startswith(".")]


def test_another_configuration_is_refused(finished):
    before = files(finished)
    with pytest.raises(InvalidArgumentError, match="points"):
        make(finished, config=AnnotationConfig(start_states=1, later_states=1, points=3, views=2))
    assert files(finished) == before


def test_an_object_without_labels(tmp_path):
    with pytest.raises(DamagedFileError, match="drawer_0007"):
        read_labels("drawer/0007", tmp_path)
    assert labelled_ids("drawer", "train", tmp_path) == []


def test_shipped_labels_are_read():
    shipped = [i for c in labelled_categories() for i in labelled_ids(c, "train")]
    if not shipped:
        pytest.skip("no labels are shipped with this tree")
    labels = read_labels(shipped[0])
    assert labels.success.any()
    assert os.fspath(labels_folder("drawer", "train")).startswith(os.fspath(ROOT))
