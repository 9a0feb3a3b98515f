"""The nearest points, against plain arithmetic."""

import numpy as np
import pytest

from artgym.geometry.nearest import FAR, nearest_within


def odd_clouds():
    """Clouds that a grid of cells could get wrong, and centers in and about them."""
    rng = np.random.default_rng(1)
    around = rng.normal(size=(400, 3))
    clouds = {
        "around": around,
        "plane": around * [1.0, 1.0, 0.0],
        "line": around * [0.0, 1.0, 0.0] + 5.0,
        "point": around * 0.0 - 2.0,
        "lattice": rng.integers(0, 12, (400, 3)) / 12.0,
        "stray": np.vstack([around, [[300.0, -200.0, 100.0]]]),
        "two heaps": np.vstack([0.01 * around, 0.01 * around + 40.0]),
        "few": around[:5],
    }
    beside = np.random.default_rng(2).normal(scale=3.0, size=(40, 3))
    return {
        name: (cloud.astype(np.float32), np.vstack([cloud[::9], beside]).astype(np.float32))
        for name, cloud in clouds.items()
    }


def float32_squares(centers, cloud):
    """Squared distances (m, n) as float32 arithmetic gives them."""
    offset = cloud[None] - centers[:, None]
    return offset[..., 0] ** 2 + offset[..., 1] ** 2 + offset[..., 2] ** 2


@pytest.mark.parametrize("name", odd_clouds())
@pytest.mark.parametrize("radius", [0.05, 0.3, 2.0, FAR])
@pytest.mark.parametrize("count", [1, 4, 33])
def test_the_nearest_of_any_cloud(name, radius, count):
    cloud, centers = odd_clouds()[name]
    squares = float32_squares(centers, cloud)
    order = np.argsort(squares, axis=1, kind="stable")
    index, found, numbers = nearest_within(cloud, centers, radius, count)
    assert index.shape == found.shape == (len(centers), count)
    for j in range(len(centers)):
        reach = np.float32(radius) ** 2
        expected = [i for i in order[j, :count] if squares[j, i] <= reach]
        held = numbers[j]
        assert sorted(index[j, :held]) == sorted(expected)
        np.testing.assert_array_equal(found[j, :held], squares[j, index[j, :held]])
        assert (index[j, held:] == 0).all()
        assert np.isinf(found[j, held:]).all()
