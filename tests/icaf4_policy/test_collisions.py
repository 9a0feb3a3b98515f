import numpy as np
import pytest

from artgym.annotation.filter import FilterConfig, Verdict, judge
from artgym.geometry import transforms
from artgym.geometry.grasps import GRASP_DEPTH, candidate_rotations
from artgym.objects import catalog
from artgym.objects.surface import grid_points
from icaf4_policy.collisions import CollisionConfig, hand_is_free

UP = np.array([0.0, 0.0, 1.0])
DOWNWARD = np.diag([1.0, -1.0, -1.0])


def plate(height, thickness=0.004):
    """Points of an upright plate that stands at y = 0 on a table at z = 0."""
    x, z = np.meshgrid(np.linspace(-0.07, 0.07, 57), np.linspace(0.0, height, 41))
    sides = [np.stack([x, np.full_like(x, y), z], -1) for y in (-thickness / 2, thickness / 2)]
    return np.concatenate(sides).reshape(-1, 3)


def test_a_plate_fits_between_the_fingers():
    height = 0.15
    top = np.array([0.0, 0.0, height])
    assert hand_is_free(plate(height), DOWNWARD, top, UP, np.zeros(3))
    # Deeper, the palm meets the edge; across, the fingers do.
    assert not hand_is_free(plate(height), DOWNWARD, top - [0, 0, 0.05], UP)
    across = DOWNWARD @ np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    assert not hand_is_free(plate(height), across, top, UP)


def test_the_table_is_in_the_way():
    low = np.array([0.0, 0.0, GRASP_DEPTH - 0.007])
    away = plate(0.15) + np.array([1.0, 0.0, 0.0])
    assert not hand_is_free(away, DOWNWARD, low, UP, np.zeros(3))
    assert hand_is_free(away, DOWNWARD, low + 0.003 * UP, UP, np.zeros(3))
    assert hand_is_free(away, DOWNWARD, low, UP)


@pytest.mark.parametrize("seen", [3, 4])
def test_few_points_inside_are_noise(seen):
    # In the middle of a pad of the open hand.
    inside = np.tile([[0.0, 0.0476, 0.09]], (seen, 1))
    config = CollisionConfig(points=4)
    assert hand_is_free(inside, DOWNWARD, np.array([0.0, 0.0, 0.1]), UP, config=config) == (
        seen < 4
    )


@pytest.mark.parametrize("category", ["laptop", "scissors"])
def test_the_filter_of_the_labels_says_the_same_of_the_whole_surface(category):
    obj = catalog.load(f"{category}/0003")
    q = obj.rest_positions
    surface = [
        transforms.apply(T, grid_points(link, FilterConfig().spacing))
        for T, link in zip(obj.link_poses(q), obj.links, strict=True)
    ]
    rng = np.random.default_rng(0)
    points = rng.choice(surface[1], 12)
    normals = np.tile([[0.0, 0.0, 1.0]], (12, 1))
    R = candidate_rotations(normals)
    verdicts = judge(obj, q, 1, points, R)
    everything = np.concatenate(surface)
    config = CollisionConfig(points=1, penetration=FilterConfig().penetration)
    free = [
        [hand_is_free(everything, R_grasp, point, UP, np.zeros(3), config) for R_grasp in row]
        for point, row in zip(points, R, strict=True)
    ]
    np.testing.assert_array_equal(free, verdicts != Verdict.COLLISION)
    assert 0 < np.mean(free) < 1
