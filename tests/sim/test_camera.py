"""The renderer's pictures: which body each pixel shows."""

from __future__ import annotations

import numpy as np
import pytest
import sapien

from artgym.errors import InvalidArgumentError
from artgym.geometry.camera import look_at
from artgym.objects import catalog
from artgym.objects.model import Box, Material, Shape
from artgym.sim.camera import RenderedCamera, View
from artgym.sim.masks import BACKGROUND, NOTHING, ROBOT, TABLE, MaskCodes
from artgym.sim.scene import ManipulationScene, visual_body
from benchmarks.rays import Sight

GRAY = Material(color=(0.5, 0.5, 0.5))


@pytest.fixture
def scene(render_system):
    made = sapien.Scene([sapien.physx.PhysxCpuSystem(), render_system])
    yield made
    made.clear()


def add_cube(scene, y):
    """A cube of 0.1 m at a place along y; what stands for it in body maps."""
    entity = sapien.Entity()
    shape = Shape(geometry=Box(half_size=(0.05, 0.05, 0.05)), position=(0, y, 0), material=GRAY)
    component = visual_body((shape,))
    entity.add_component(component)
    scene.add_entity(entity)
    return component


def test_cubes_by_hand(scene):
    left, right, other = (add_cube(scene, y) for y in (-0.15, 0.15, 0.0))
    # From +x with z up, y grows to the right.
    view = View(T_world_camera=look_at([1, 0, 0], [0, 0, 0]), fov_y=0.4, width=80, height=60)
    camera = RenderedCamera(scene, view)
    rgb, depth, body = camera.take_with_bodies([right, left])
    assert body.dtype == np.int32
    assert body.shape == depth.shape == rgb.shape[:2] == (60, 80)
    assert [body[30, u] for u in (17, 40, 63)] == [1, TABLE, 0]
    np.testing.assert_array_equal(body == NOTHING, depth == 0)
    assert body[2, 2] == NOTHING
    # Without bodies, and in another order, the picture is the same.
    for more in ((), (left, right, other)):
        again = camera.take_with_bodies(more)
        np.testing.assert_array_equal(again[0], rgb)
        np.testing.assert_array_equal(again[1], depth)
        np.testing.assert_array_equal(again[2] == NOTHING, body == NOTHING)
    assert len(camera.take()) == 2
    np.testing.assert_array_equal(camera.take()[1], depth)


def test_masks_of_episodes_that_share_a_renderer(render_system):
    """Numbers do not depend on what was built before."""
    masks = []
    for object_id in ("laptop/0001", "drawer/0002", "laptop/0001"):
        sight = Sight.draw(catalog.load(object_id), (160, 120), np.random.default_rng(0))
        scene = ManipulationScene(
            sight.obj, sight.T_world_object, sight.q, T_world_hand=sight.T_world_hand,
            render_system=render_system, table_material=GRAY,
        )  # fmt: skip
        assert scene.hand is not None
        camera = RenderedCamera(scene.sapien_scene, sight.view)
        _, _, body = camera.take_with_bodies([*scene.body.links, *scene.hand.links])
        scene.close()
        masks.append(MaskCodes(num_parts=(sight.obj.num_parts,)).mask_from_bodies(body))
    np.testing.assert_array_equal(masks[0], masks[2])
    assert set(np.unique(masks[0]).tolist()) == {BACKGROUND, 1, 2, ROBOT}
    assert masks[0].dtype == np.uint8


def test_codes_of_several_objects():
    codes = MaskCodes(num_parts=(2, 3))
    bodies = np.array([[NOTHING, TABLE, 0, 1], [2, 4, 5, 15]], dtype=np.int32)
    mask = codes.mask_from_bodies(bodies)
    np.testing.assert_array_equal(mask, [[0, 0, 1, 2], [3, 5, ROBOT, ROBOT]])
    assert mask.dtype == np.uint8
    assert [codes.code(p, o) for o, count in enumerate((2, 3)) for p in range(count)] == [
        1, 2, 3, 4, 5,
    ]  # fmt: skip


def test_more_parts_than_numbers():
    MaskCodes(num_parts=(200, 54))
    with pytest.raises(InvalidArgumentError, match="254"):
        MaskCodes(num_parts=(200, 55))
