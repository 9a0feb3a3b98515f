import numpy as np
import pytest
import torch

from artgym.errors import InvalidArgumentError
from icaf4_policy.backbone.point_ops import (
    ball_query,
    farthest_points,
    neighborhoods,
    three_nearest,
)
from icaf4_policy.backbone.set_abstraction import _plain_group_max, group_max
from tests.geometry.test_nearest import float32_squares, odd_clouds


@pytest.fixture
def cloud():
    return np.random.default_rng(0).normal(size=(300, 3)).astype(np.float32)


def squared_distances(a, b):
    return ((a[:, None].astype(float) - b[None]) ** 2).sum(axis=-1)


def test_farthest_points_against_a_plain_loop(cloud):
    chosen = [int(np.argmax(((cloud - cloud.mean(axis=0)) ** 2).sum(axis=1)))]
    while len(chosen) < 40:
        chosen.append(int(squared_distances(cloud, cloud[chosen]).min(axis=1).argmax()))
    np.testing.assert_array_equal(farthest_points(cloud, 40), chosen)


def test_farthest_points_that_are_all_but_equally_far_are_those_of_plain_arithmetic():
    steps = np.random.default_rng(0).integers(-4, 5, (600, 3)).astype(np.float32)
    cloud = steps * np.float32(0.1) + np.float32(0.03)
    nearest, chosen = np.full(600, np.inf, np.float32), []
    found = farthest_points(cloud, 200)
    for _ in range(200):
        chosen.append(int(nearest.argmax()) if chosen else int(found[0]))
        offset = cloud - cloud[chosen[-1]]
        squares = offset[:, 0] ** 2 + offset[:, 1] ** 2 + offset[:, 2] ** 2
        nearest = np.minimum(nearest, squares)
    np.testing.assert_array_equal(found, chosen)


def test_ball_query_against_sorting(cloud):
    centers = cloud[:50]
    found = ball_query(cloud, centers, 0.6, 8)
    squares = squared_distances(centers, cloud)
    for j in range(len(centers)):
        inside = [i for i in np.argsort(squares[j]) if squares[j, i] <= 0.36][:8]
        expected = inside + [inside[0]] * (8 - len(inside))
        assert found[j, 0] == inside[0]
        assert sorted(found[j]) == sorted(expected)


def test_three_nearest_against_sorting(cloud):
    centers = cloud[::7]
    found, weights = three_nearest(cloud, centers)
    np.testing.assert_array_equal(
        found, np.argsort(squared_distances(cloud, centers), axis=1, kind="stable")[:, :3]
    )
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-5)
    assert (np.diff(weights, axis=1) <= 1e-6).all()
    # A point that is a center takes that center's value.
    np.testing.assert_allclose(weights[::7, 0], 1.0, atol=1e-4)


@pytest.mark.parametrize("name", odd_clouds())
def test_neighbors_in_any_cloud_are_those_of_plain_arithmetic(name):
    cloud, centers = odd_clouds()[name]
    squares = float32_squares(centers, cloud)
    order = np.argsort(squares, axis=1, kind="stable")
    for radius, count in ((0.3, 4), (0.7, 32), (1000.0, 3)):
        found = ball_query(cloud, centers, radius, count)
        for j in range(len(centers)):
            inside = [i for i in order[j, :count] if squares[j, i] <= np.float32(radius * radius)]
            inside = inside or [order[j, 0]]
            expected = inside + [inside[0]] * (count - len(inside))
            assert found[j, 0] == inside[0]
            assert sorted(found[j]) == sorted(expected)
    np.testing.assert_array_equal(three_nearest(centers, cloud)[0], order[:, :3])


def test_repeated_points_are_no_trouble():
    cloud = np.zeros((20, 3), np.float32)
    assert farthest_points(cloud, 8).shape == (8,)
    _, weights = three_nearest(cloud, cloud[:4])
    assert np.isfinite(weights).all()


def test_indices_count_through_the_batch(cloud):
    batch = torch.from_numpy(np.stack([cloud, cloud[::-1].copy()]))
    near = neighborhoods(batch, counts=(64, 16), radii=(0.5, 1.0), neighbors=8)
    flat = batch.reshape(-1, 3)
    first, second = flat[near.centers1[0]], flat[near.centers1[1]]
    torch.testing.assert_close(first, second, rtol=0, atol=0)
    assert near.neighbors1[1].min() >= len(cloud)
    assert near.up2.max() < 2 * 16


def test_too_small_a_cloud_is_refused():
    with pytest.raises(InvalidArgumentError, match="points must have shape"):
        neighborhoods(torch.zeros(1, 10, 3), counts=(64, 16), radii=(0.5, 1.0), neighbors=8)


def test_group_max_and_its_gradients_against_plain_operations():
    generator = torch.Generator().manual_seed(0)
    features = torch.randn(300, 16, generator=generator).requires_grad_()
    offsets = torch.randn(50, 16, generator=generator).requires_grad_()
    weight = torch.randn(24, 16, generator=generator).requires_grad_()
    neighbors = torch.randint(0, 300, (50, 8), generator=generator)
    inputs = (features, offsets, weight)
    fast = group_max(*inputs, neighbors)
    plain = _plain_group_max(*inputs, neighbors)
    torch.testing.assert_close(fast, plain)
    direction = torch.randn(fast.shape, generator=generator)
    for a, b in zip(
        torch.autograd.grad(fast, inputs, direction),
        torch.autograd.grad(plain, inputs, direction),
        strict=True,
    ):
        torch.testing.assert_close(a, b, rtol=1e-4, atol=1e-5)


def test_empty_ball_gives_the_nearest_point(cloud):
    center = np.array([[50.0, 0.0, 0.0]], np.float32)
    nearest = squared_distances(center, cloud)[0].argmin()
    np.testing.assert_array_equal(ball_query(cloud, center, 0.1, 4), [[nearest] * 4])
