"""The benchmark of rays, from the command line to its file."""

import json
from dataclasses import replace

import numpy as np
import pytest

from artgym.errors import InvalidArgumentError, UnknownNameError
from artgym.geometry import transforms
from artgym.objects import catalog
from benchmarks import rays
from benchmarks.rays import RaysConfig, Sight


def test_a_small_run(render_system, tmp_path, capsys):
    arguments = ["--object", "laptop/0001", "drawer/0004", "--mesh", "drawer/0004", "--views", "2"]
    arguments += ["--clouds", "3", "--num-points", "256", "--camera-size", "160", "120"]
    assert rays.main([*arguments, "--out", str(tmp_path)]) == 0
    assert "laptop/0001" in capsys.readouterr().out
    result = json.loads((tmp_path / "rays.json").read_text())
    assert list(result["rows"]) == ["laptop/0001", "drawer/0004"]
    for row in result["rows"].values():
        clouds, agreement = row["clouds"], row["agreement"]
        assert clouds["vulkan_loaded"] is False
        assert clouds["distinct_points_least"] == 256
        assert 0 < clouds["per_second_slowest_view"] <= clouds["per_second"]
        for name in ("depth", "mask"):
            assert 0.998 < agreement[name]["least"] <= agreement[name]["mean"] <= 1
        assert agreement["seen"] == [0, 1, 2, 255]


def test_clouds_can_be_left_out():
    share = {"mean": 1.0, "least": 0.9}
    row = {"agreement": {"depth": share, "mask": share}}
    assert rays.table_from_rows({"laptop/0001": row}).row_count == 1


def test_a_shifted_picture_is_noticed(render_system, monkeypatch):
    """The camera a millimetre and a half nearer, and pictures no longer agree."""
    sight = Sight.draw(catalog.load("drawer/0002"), (320, 240), np.random.default_rng(0))
    rng = np.random.default_rng(1)
    assert rays.view_agreement(sight, rng)["depth"] > 0.999
    shifted = sight.view.T_world_camera @ transforms.translation([0.0, 0.0, 1.5e-3])
    cast = replace(sight, view=replace(sight.view, T_world_camera=shifted)).cast
    monkeypatch.setattr(Sight, "cast", lambda _: cast())
    assert rays.view_agreement(sight, rng)["depth"] < 0.9


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({"object": ("laptops/0001",)}, UnknownNameError),
        ({"mesh": ("laptop/0002",)}, InvalidArgumentError),
        ({"views": 0}, InvalidArgumentError),
        ({"clouds": -1}, InvalidArgumentError),
    ],
)
def test_wrong_options(changes, error):
    with pytest.raises(error):
        RaysConfig(**changes)
