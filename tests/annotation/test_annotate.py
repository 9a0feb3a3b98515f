"""Label files: what they hold, and that neither workers nor interruptions change a byte."""

from __future__ import annotations

import dataclasses
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
from artgym.geometry.grasps import NUM_CANDIDATES
from artgym.objects import catalog

ROOT = Path(__file__).resolve().parents[2]
TINY = AnnotationConfig(start_states=1, open_states=1, least_points=2, trials=20, views=2)
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
        count = len(labels.state)
        assert labels.fractions.shape == (2, len(obj.joints))
        assert np.all((labels.fractions[0] >= 0.0) & (labels.fractions[0] <= 0.05))
        assert np.all((labels.fractions[1] >= 0.0) & (labels.fractions[1] <= 1.0))
        assert labels.success.shape == (count, NUM_CANDIDATES)
        for state in (0, 1):
            here = labels.state == state
            assert here.sum() >= TINY.least_points
            assert labels.verdicts[state].sum() == here.sum() * NUM_CANDIDATES
            # Every movable part that is seen has as many points as the others.
            assert np.ptp(np.unique(labels.part[here], return_counts=True)[1]) == 0
            # No more successes than trials that moved the part.
            assert labels.success[here].sum() <= labels.ends[state, 0]
        np.testing.assert_array_equal(labels.ends.sum(axis=1), labels.verdicts[:, 0])
        assert set(labels.part.tolist()) <= set(range(1, obj.num_parts))
        for part in np.unique(labels.part):
            low, high = obj.links[part].bounds()
            points = labels.points_part[labels.part == part]
            assert np.all((points > low - 1e-5) & (points < high + 1e-5))


def test_bits_are_the_outcomes_of_trials(finished):
    outcomes = [
        outcome
        for object_id in labelled_ids("drawer", "val", finished)
        for outcome in tried_again(read_labels(object_id, finished), np.random.default_rng(0), 6)
    ]
    assert {bit for bit, _ in outcomes} == {True, False}
    assert all(bit == again for bit, again in outcomes)


@pytest.mark.parametrize("category", labelled_categories())
def test_shipped_bits_are_the_outcomes_of_trials(category):
    rng = np.random.default_rng(0)
    ids = rng.choice(labelled_ids(category, "test"), 3, replace=False)
    outcomes = [outcome for i in ids for outcome in tried_again(read_labels(str(i)), rng, 12)]
    assert any(bit for bit, _ in outcomes)
    # Another processor's last digits turn about one success in a hundred.
    assert np.mean([bit == again for bit, again in outcomes]) >= 0.9


def tried_again(labels, rng, count):
    """Some bits, half of them successes as far as there are any, and the same tries once more."""
    obj = catalog.load(labels.object_id)
    chosen = [
        rng.permutation(np.argwhere(labels.success == bit))[: count // 2] for bit in (True, False)
    ]
    for row, candidate in np.concatenate(chosen):
        q, poses = labels.tries(obj, row)
        trial = try_grasp(obj, q, int(labels.part[row]), poses[candidate])
        yield bool(labels.success[row, candidate]), trial.success


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
        "config = AnnotationConfig(\n"
        "    start_states=1, open_states=1, least_points=2, trials=20, views=2)\n"
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
    with pytest.raises(InvalidArgumentError, match="least_points"):
        make(finished, config=dataclasses.replace(TINY, least_points=3))
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
