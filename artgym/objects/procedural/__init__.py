"""Objects made from seeds: one file a category, the same seed always the same object."""

from collections.abc import Callable

import numpy as np

from artgym.objects.model import ArticulatedObject
from artgym.objects.procedural import drawer, laptop

#: Makes an object of a category from its id and a generator of random numbers.
Generator = Callable[[str, np.random.Generator], ArticulatedObject]

GENERATORS: dict[str, Generator] = {
    "drawer": drawer.make_drawer,
    "laptop": laptop.make_laptop,
}
