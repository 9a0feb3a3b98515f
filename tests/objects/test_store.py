"""Imported objects on disk: kept whole, found by id, never half read."""

from __future__ import annotations

import threading
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest

import artgym  # noqa: F401  registers the environments
from artgym import cli
from artgym.errors import (
    DamagedFileError,
    FileNotWrittenError,
    InvalidArgumentError,
    UnknownNameError,
)
from artgym.objects import catalog, store
from artgym.objects.model import ArticulatedObject


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(store.FOLDER_VARIABLE, str(tmp_path / "objects"))
    return tmp_path / "objects"


@pytest.fixture(scope="module")
def drawer() -> ArticulatedObject:
    return catalog.load("drawer/0003")


def test_there_and_back(drawer):
    assert store.names() == ()
    assert store.save(drawer, "my-drawer_1") == "import/my-drawer_1"
    assert store.ids() == ("import/my-drawer_1",)
    back = catalog.load("import/my-drawer_1")
    assert back == replace(drawer, object_id="import/my-drawer_1")
    assert catalog.load("import/my-drawer_1") is back
    assert catalog.split_of("import/my-drawer_1") == "test"
    store.remove("import/my-drawer_1")
    assert store.names() == ()


def test_an_object_of_the_same_name_is_replaced(drawer, folder):
    store.save(drawer, "thing")
    catalog.load("import/thing")
    store.save(catalog.load("laptop/0001"), "thing")
    assert catalog.load("import/thing").category == "laptop"
    assert [path.name for path in folder.iterdir()] == ["thing"]


@pytest.mark.parametrize("name", ["", "A", "a b", "a/b", "..", "a.b", "ä", "x" * 65])
def test_names(drawer, name):
    with pytest.raises(InvalidArgumentError, match="expected 1 to 64"):
        store.save(drawer, name)


@pytest.mark.parametrize("object_id", ["import/drawr", "import/", "import/../drawer", "import"])
def test_unknown_ids(drawer, object_id):
    store.save(drawer, "drawer")
    for function in (catalog.load, store.remove):
        with pytest.raises(UnknownNameError, match="Nearest: 'import/drawer'"):
            function(object_id)


def test_damage(drawer, folder):
    store.save(drawer, "drawer")
    file = folder / "drawer" / "object.json"
    file.write_text(file.read_text()[:-40])
    with pytest.raises(DamagedFileError, match=r"import/drawer is damaged.*artgym import"):
        catalog.load("import/drawer")
    file.unlink()
    with pytest.raises(DamagedFileError, match="import/drawer"):
        catalog.load("import/drawer")


def test_a_folder_that_cannot_be_written(drawer, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv(store.FOLDER_VARIABLE, str(tmp_path / "file"))
    with pytest.raises(FileNotWrittenError):
        store.save(drawer, "drawer")
    assert store.names() == ()


def test_two_writers_leave_one_whole_object(drawer):
    threads = [threading.Thread(target=store.save, args=(drawer, "drawer")) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert catalog.load("import/drawer").links == drawer.links


@pytest.mark.parametrize("category", ["drawer", "wine cooler"])
def test_episodes(drawer, category):
    store.save(replace(drawer, category=category), "mine")
    env = gymnasium.make("ArtOpen-v0", objects=("import/mine",), obs_mode="pointcloud")
    observation, info = env.reset(seed=0)
    assert info["object_id"] == "import/mine"
    assert env.observation_space.contains(observation)
    assert 0.0 <= info["open_fraction"] <= 0.05
    env.step(np.zeros(7, dtype=np.float32))
    env.close()


def test_rendered(drawer, render_system):
    store.save(drawer, "mine")
    env = gymnasium.make("ArtOpen-v0", objects=("import/mine",), obs_mode="rgbd")
    observation, _ = env.reset(seed=0)
    assert np.ptp(observation["rgb"]) > 50
    env.close()


def test_listed(drawer, capsys):
    store.save(drawer, "mine")
    assert cli.main(["objects", "--category", "import"]) == 0
    assert capsys.readouterr().out.startswith("import/mine")
