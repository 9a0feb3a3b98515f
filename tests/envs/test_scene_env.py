"""What is particular to several objects on one table."""

import numpy as np
import pytest

from artgym.envs.scene_env import ArtSceneEnv
from artgym.errors import InvalidArgumentError
from artgym.sim.scene import TABLE_HALF_SIZE, PlacedObject
from artgym.sim.tabletop import CLEARANCE, MAX_EXTENT, footprint


def placed(env):
    """The objects as they stand."""
    return [
        PlacedObject(model=body.model, T_world_object=body.link_poses()[0], q=body.positions())
        for body in env._scene.bodies
    ]


def test_objects_are_few_small_clear_of_one_another_and_on_the_table():
    env = ArtSceneEnv()
    counts = set()
    for seed in range(12):
        _, info = env.reset(seed=seed)
        objects = placed(env)
        assert objects[0].model.object_id == info["object_id"]
        assert 3 <= len(objects) <= 6
        counts.add(len(objects))
        discs = [footprint(each, swept=i == 0) for i, each in enumerate(objects)]
        for i, (middle, radius) in enumerate(discs):
            low, high = objects[i].model.rest_bounds
            assert np.all(high - low <= MAX_EXTENT)
            if i:
                assert np.all(np.abs(middle) + radius <= TABLE_HALF_SIZE[:2])
            for other, its_radius in discs[:i]:
                # Poses come back in single precision.
                gap = np.linalg.norm(middle - other) - radius - its_radius
                assert gap >= CLEARANCE - 1e-5
    assert len(counts) > 1
    env.close()


def test_nothing_moves_by_itself():
    env = ArtSceneEnv()
    env.reset(seed=0)
    before = [body.positions() for body in env._scene.bodies]
    for _ in range(60):
        env.step(np.zeros(7, np.float32))
    for body, q in zip(env._scene.bodies, before, strict=True):
        np.testing.assert_allclose(body.positions(), q, atol=1e-5)
    env.close()


@pytest.mark.parametrize("num_objects", [(0, 3), (4, 2), 3, "many", (3, 99)])
def test_bad_numbers_of_objects(num_objects):
    with pytest.raises(InvalidArgumentError, match="num_objects"):
        ArtSceneEnv(num_objects=num_objects)


def test_objects_too_large_for_a_table():
    env = ArtSceneEnv(categories=("door",))
    with pytest.raises(InvalidArgumentError, match="long, wide and high"):
        env.reset(seed=0)
    env.close()
