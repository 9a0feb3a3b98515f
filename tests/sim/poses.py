"""Places of the hand at objects, for tests of contacts and of grasps."""

from __future__ import annotations

import numpy as np

from artgym.geometry import transforms
from artgym.geometry.grasps import T_GRASP_TCP
from artgym.geometry.hand import T_hand_tcp
from artgym.objects import catalog
from artgym.objects.model import ArticulatedObject

#: Columns (x, closing direction, approach): towards -x, closing upright or across.
CLOSING_UP = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
CLOSING_ACROSS = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])


def drawer_with_lying_bar() -> ArticulatedObject:
    """The first drawer of the catalogue whose handle is a bar that lies."""
    for object_id in catalog.object_ids("drawer", "train"):
        obj = catalog.load(object_id)
        if obj.attributes["handle"] == "bar":
            low, high = bar_bounds(obj)
            if high[1] - low[1] > high[2] - low[2]:
                return obj
    raise AssertionError("no such drawer")


def bar_bounds(obj: ArticulatedObject) -> np.ndarray:
    """Box (2, 3) of the bar: the sixth shape, after the front and the tray."""
    corners = obj.links[1].shapes[5].corners_link()
    return np.stack([corners.min(axis=0), corners.max(axis=0)])


def hand_from_tcp(R_object_tcp: np.ndarray, t_object_tcp: np.ndarray) -> np.ndarray:
    """``T_object_hand`` from the orientation and place of the tool centre."""
    T_object_tcp = transforms.transform_from(R_object_tcp, t_object_tcp)
    return T_object_tcp @ transforms.invert(T_hand_tcp)


def grasp_from_tcp(R_object_tcp: np.ndarray, t_object_tcp: np.ndarray) -> np.ndarray:
    """``T_object_grasp`` from the orientation and place of the tool centre."""
    T_object_tcp = transforms.transform_from(R_object_tcp, t_object_tcp)
    return T_object_tcp @ transforms.invert(T_GRASP_TCP)
