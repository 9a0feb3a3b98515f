"""Do rays see what the renderer sees, and how many point clouds do they give in a second?

Run ``python -m benchmarks.rays --help``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from artgym.errors import InvalidArgumentError
from artgym.geometry import transforms
from artgym.geometry.hand import T_hand_tcp
from artgym.geometry.rotations import frame_from_z
from artgym.objects import catalog
from artgym.objects.contents import TriangleMesh
from artgym.objects.meshes import link_triangles
from artgym.objects.model import ArticulatedObject, Link, Visual
from artgym.sim import rays
from artgym.sim.camera import RenderedCamera, View, ViewDistribution
from artgym.sim.masks import ROBOT, MaskCodes
from artgym.sim.renderer import render_system
from artgym.sim.scene import ManipulationScene
from artgym.sim.setting import add_lights, random_placement, random_table
from benchmarks import record
from benchmarks.command import run
from benchmarks.parallel import results_in_order

Array = NDArray[np.floating]

#: Depths agree that differ by no more than this, metres: the renderer cuts off whole millimetres.
DEPTH_TOLERANCE = 1e-3
#: How far the jaws are open, metres.
_JAW_WIDTH = 0.05


@dataclass(frozen=True, kw_only=True)
class RaysConfig:
    """Do rays see what the renderer sees, and how many point clouds do they give in a second?

    Attributes:
        object: ids of what is looked at.
        mesh: those of them that are shown as triangle meshes, as imported objects are.
        views: cameras of each object, the hand before it and its parts half open.
        camera_size: width and height of a picture, pixels.
        num_points: of a cloud.
        clouds: how many of each view are timed; 0 leaves clouds out.
        seed: of the views.
        workers: processes that compare pictures; clouds are always made by one.
        out: folder for rays.json.
    """

    object: tuple[str, ...] = (
        "laptop/0001",
        "drawer/0002",
        "refrigerator/0000",
        "eyeglasses/0001",
        "faucet/0005",
        "toilet/0000",
    )
    mesh: tuple[str, ...] = ("toilet/0000",)
    views: int = 50
    camera_size: tuple[int, int] = (320, 240)
    num_points: int = 2048
    clouds: int = 20
    seed: int = 0
    workers: int = 1
    out: Path = record.RESULTS_FOLDER

    def __post_init__(self) -> None:
        for name, least in (("views", 1), ("num_points", 1), ("clouds", 0)):
            if getattr(self, name) < least:
                raise InvalidArgumentError(
                    f"{name}={getattr(self, name)}: expected {least} or more."
                )
        for object_id in self.object:
            catalog.load(object_id)
        for object_id in self.mesh:
            if object_id not in self.object:
                raise InvalidArgumentError(f"mesh={object_id}: it is not one of {self.object}.")


@dataclass(frozen=True, kw_only=True, eq=False)
class Sight:
    """An object and a hand before a camera.

    Attributes:
        obj: the object.
        T_world_object: pose (4, 4) of its root.
        q: its joint positions (K - 1,), half open.
        T_world_hand: pose (4, 4) of the hand.
        view: the camera.
    """

    obj: ArticulatedObject
    T_world_object: Array
    q: Array
    T_world_hand: Array
    view: View

    @classmethod
    def draw(
        cls, obj: ArticulatedObject, camera_size: tuple[int, int], rng: np.random.Generator
    ) -> Sight:
        """An object as it stands in episodes, the hand somehow between it and the camera."""
        view = ViewDistribution.around(obj).sample(rng, *camera_size)
        middle = obj.body_bounds.mean(axis=0)
        eye, right = view.T_world_camera[:3, 3], view.T_world_camera[:3, 0]
        reach = float(np.linalg.norm(eye - middle))
        place = middle + rng.uniform(0.1, 0.4) * (eye - middle)
        place += rng.uniform(-0.15, 0.15) * reach * right
        approach = rng.normal(size=3)
        turn = frame_from_z(approach / np.linalg.norm(approach), rng.uniform(-np.pi, np.pi))
        T_world_tcp = transforms.transform_from(turn, place)
        return cls(
            obj=obj,
            T_world_object=random_placement(rng),
            q=np.array([joint.position(0.5) for joint in obj.joints]),
            T_world_hand=T_world_tcp @ transforms.invert(T_hand_tcp),
            view=view,
        )

    def bodies(self) -> tuple[list[rays.RayBody], Array]:
        """What rays can meet beside the table, and its poses (b, 4, 4) in the world."""
        bodies = [*(rays.link_body(link) for link in self.obj.links), *rays.hand_bodies()]
        hand = rays.hand_poses(self.T_world_hand, _JAW_WIDTH)
        links = self.T_world_object @ self.obj.link_poses(self.q)
        return bodies, np.concatenate([links, hand])

    def cast(self) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Depth and body map (h, w) by rays."""
        return rays.RayCamera(self.view).take(*self.bodies())

    def rendered(self, rng: np.random.Generator) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
        """Depth and body map (h, w) by the renderer, on a random table.

        Raises:
            RendererUnavailableError: no device here can render.
        """
        scene = ManipulationScene(
            self.obj,
            self.T_world_object,
            self.q,
            T_world_hand=self.T_world_hand,
            width=_JAW_WIDTH,
            render_system=render_system(),
            table_material=random_table(rng),
        )
        add_lights(scene.sapien_scene, rng)
        assert scene.hand is not None
        camera = RenderedCamera(scene.sapien_scene, self.view)
        _, depth, body = camera.take_with_bodies([*scene.body.links, *scene.hand.links])
        scene.close()
        return depth, body


def loaded(object_id: str, *, as_mesh: bool) -> ArticulatedObject:
    """An object of the catalogue, its pieces made one mesh a link if that is asked for."""
    obj = catalog.load(object_id)
    if not as_mesh:
        return obj
    return replace(obj, links=tuple(_as_mesh(link) for link in obj.links))


def _as_mesh(link: Link) -> Link:
    corners = link_triangles(link)[0].reshape(-1, 3)
    mesh = TriangleMesh(corners, np.arange(len(corners)).reshape(-1, 3))
    return replace(link, visuals=(Visual(mesh=mesh, material=link.shapes[0].material),))


def view_agreement(sight: Sight, rng: np.random.Generator) -> dict[str, Any]:
    """Shares of a picture's pixels on which rays and renderer agree, and what is seen in it."""
    depth, body = sight.cast()
    depth_rendered, body_rendered = sight.rendered(rng)
    codes = MaskCodes(num_parts=(sight.obj.num_parts,))
    mask = codes.mask_from_bodies(body)
    difference = depth - depth_rendered
    same = (body == body_rendered) & (np.abs(difference) < 3 * DEPTH_TOLERANCE)
    return {
        "depth": float(np.mean(np.abs(difference) <= DEPTH_TOLERANCE)),
        "mask": float(np.mean(mask == codes.mask_from_bodies(body_rendered))),
        "depth_bias_mm": float(1e3 * np.mean(difference[same & (depth > 0)], dtype=float)),
        "seen": np.unique(mask).tolist(),
    }


def _sights(config: RaysConfig, object_id: str) -> list[tuple[Sight, np.random.Generator]]:
    """The views of one object, and a generator each for what else is random."""
    obj = loaded(object_id, as_mesh=object_id in config.mesh)
    number = config.object.index(object_id)
    rngs = [np.random.default_rng([config.seed, number, i]) for i in range(config.views)]
    return [(Sight.draw(obj, config.camera_size, rng), rng) for rng in rngs]


def object_agreement(arguments: tuple[RaysConfig, str]) -> dict[str, Any]:
    """Agreement over all views of one object."""
    config, object_id = arguments
    views = [view_agreement(sight, rng) for sight, rng in _sights(config, object_id)]
    return {
        **{
            name: {
                "mean": round(float(np.mean([view[name] for view in views])), 6),
                "least": round(min(view[name] for view in views), 6),
            }
            for name in ("depth", "mask")
        },
        "depth_bias_mm": round(float(np.mean([view["depth_bias_mm"] for view in views])), 3),
        "views_with_hand": sum(ROBOT in view["seen"] for view in views),
        "seen": sorted(set().union(*(view["seen"] for view in views))),
    }


def object_clouds(arguments: tuple[RaysConfig, str]) -> dict[str, Any]:
    """Clouds a second over all views of one object: poses in, points out."""
    config, object_id = arguments
    cpu_seconds, seconds, distinct = 0.0, [], []
    for sight, rng in _sights(config, object_id):
        camera = rays.PointCloudCamera(sight.view, config.num_points)
        bodies, poses = sight.bodies()
        points, _ = camera.cloud(bodies, poses, rng)
        distinct.append(len(np.unique(points, axis=0)))
        cpu = time.thread_time()
        times = [time.perf_counter()]
        for _ in range(config.clouds):
            camera.cloud(bodies, poses, rng)
            times.append(time.perf_counter())
        cpu_seconds += time.thread_time() - cpu
        seconds.append(np.diff(times))
    return {
        "bodies": len(bodies),
        "per_second": round(1 / float(np.median(seconds))),
        "per_second_slowest_view": round(1 / float(np.median(seconds, axis=1).max())),
        "per_cpu_second": round(np.size(seconds) / cpu_seconds),
        "distinct_points_least": min(distinct),
        "vulkan_loaded": "libvulkan" in Path("/proc/self/maps").read_text(encoding="utf-8"),
    }


def measure(config: RaysConfig) -> dict[str, Any]:
    """Measures all objects; a result for ``record.write_result``."""
    tasks = [(config, object_id) for object_id in config.object]
    rows: dict[str, dict[str, Any]] = {object_id: {} for object_id in config.object}
    if config.clouds:
        # In a process of their own, with one thread and without a graphics driver.
        clouds = results_in_order(
            object_clouds, tasks, workers=1, description="clouds", unit="object"
        )
        for object_id, row in zip(config.object, clouds, strict=True):
            rows[object_id]["clouds"] = row
    agreement = results_in_order(
        object_agreement, tasks, workers=config.workers, description="pictures", unit="object"
    )
    for object_id, row in zip(config.object, agreement, strict=True):
        rows[object_id]["agreement"] = row
    return {
        **record.provenance("benchmarks.rays"),
        "config": asdict(config),
        "depth_tolerance_mm": 1e3 * DEPTH_TOLERANCE,
        "rows": rows,
    }


def table_from_rows(rows: Mapping[str, Mapping[str, Any]]) -> Table:
    """The table for a person to read."""
    table = Table(title="rays against the renderer: mean (least of all views)")
    for name in (
        "object",
        "depth within 1 mm, %",
        "same part, %",
        "clouds/s",
        "slowest view",
        "per CPU second",
        "Vulkan loaded",
    ):
        table.add_column(name)
    for object_id, row in rows.items():
        clouds = row.get("clouds", {})
        table.add_row(
            object_id,
            *(
                f"{100 * share['mean']:.3f} ({100 * share['least']:.3f})"
                for share in (row["agreement"]["depth"], row["agreement"]["mask"])
            ),
            *(
                str(clouds.get(name, "-"))
                for name in ("per_second", "per_second_slowest_view", "per_cpu_second")
            ),
            str(clouds.get("vulkan_loaded", "-")),
        )
    return table


def report(config: RaysConfig) -> list[Table]:
    """Measures, writes ``rays.json`` and gives the table."""
    result = measure(config)
    record.write_result(config.out / "rays.json", result)
    return [table_from_rows(result["rows"])]


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the benchmark; see ``benchmarks.command.run``."""
    return run("rays", RaysConfig, report, arguments)


if __name__ == "__main__":
    sys.exit(main())
