"""Distances between shapes and sizes of real objects, on objects made by hand."""

from dataclasses import replace

import numpy as np
import pytest

from artgym.objects import catalog
from artgym.objects.model import Box
from benchmarks import variety


def stretched(obj, factor):
    """The same with every box longer along y."""

    def longer(shape):
        x, y, z = shape.geometry.half_size
        px, py, pz = shape.position
        return replace(
            shape, geometry=Box(half_size=(x, factor * y, z)), position=(px, factor * py, pz)
        )

    links = tuple(
        replace(link, shapes=tuple(longer(s) for s in link.shapes if isinstance(s.geometry, Box)))
        for link in obj.links
    )
    return replace(obj, links=links)


def test_a_copy_is_a_near_duplicate_and_a_longer_one_is_not():
    obj = stretched(catalog.load("drawer/0004"), 1.0)
    distances = variety.shape_distances([obj, obj, stretched(obj, 1.2)])
    assert np.all(np.isinf(np.diag(distances)))
    np.testing.assert_array_equal(distances, distances.T)
    assert distances[0, 1] < 0.2 * variety.NEAR_DUPLICATE
    assert distances[0, 2] > 2 * variety.NEAR_DUPLICATE


def test_real_sizes_are_read():
    reals = variety.real_sizes()
    assert len(reals) == 48
    assert {r["category"] for r in reals} == {"box", "cutter", "drawer", "scissors", "stapler"}
    box = next(r for r in reals if r["name"] == "box1")
    np.testing.assert_allclose(box["extents"]["1"], [0.0129, 0.0763, 0.2248])
    assert all(np.all(np.diff(e) >= 0) for r in reals for e in r["extents"].values())


@pytest.mark.parametrize(("size", "outside"), [(0.2, []), (0.31, ["0"]), (0.05, ["0"])])
def test_a_real_object_beyond_the_range_is_named(size, outside):
    reach = {"0": (np.full(3, 0.1), np.full(3, 0.3))}
    assert list(variety._outside({"0": np.array([0.2, 0.2, size])}, reach)) == outside


def test_a_part_that_is_never_made_is_outside():
    assert list(variety._outside({"2": np.ones(3)}, {})) == ["2"]


@pytest.mark.parametrize("number", range(4))
def test_tilted_objects_are_measured_along_their_own_axes(number):
    extents = variety._extents(catalog.load(f"cutter/{number:04d}"), 0.0)
    thickness, width, length = extents["0"]
    assert thickness < 0.03
    assert width < 0.045
    assert 0.09 < length < 0.18
