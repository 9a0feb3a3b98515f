"""The one way in that is tested, as `artgym import` takes it."""

from __future__ import annotations

from pathlib import Path

from artgym.objects.importing import import_object
from artgym.objects.model import ArticulatedObject


def load(path: Path) -> ArticulatedObject:
    """The object of a file or folder."""
    return import_object(path).object
