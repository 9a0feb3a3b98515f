"""Objects made from seeds: one file a category, the same seed always the same object."""

import importlib
from collections.abc import Callable

import numpy as np

from artgym.objects.model import ArticulatedObject

#: Makes an object of a category from its id and a generator of random numbers.
Generator = Callable[[str, np.random.Generator], ArticulatedObject]


def generator(category: str) -> Generator:
    """The function ``make_<category>`` of the category's module."""
    module = importlib.import_module(f"{__name__}.{category}")
    return getattr(module, f"make_{category}")
