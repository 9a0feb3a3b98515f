"""Which trained weights come with the package, and where they lie."""

from __future__ import annotations

from pathlib import Path

from artgym.errors import UnknownNameError

#: What `icaf4 train` and `icaf4 train-detector` wrote, with the model card.
WEIGHTS_FOLDER = Path(__file__).parent / "weights"

#: The name of the detector's weights, beside those of the categories.
DETECTOR = "detector"


def weights_path(name: str, folder: Path | None = None) -> Path:
    """The weights of a category, or of ``DETECTOR``, in a folder; None for the shipped ones.

    Raises:
        UnknownNameError: no weights of that name are shipped.
    """
    if folder is not None:
        return folder / f"{name}.safetensors"
    path = WEIGHTS_FOLDER / f"{name}.safetensors"
    if not path.exists():
        raise UnknownNameError("shipped weights", name, [*trained_categories(), DETECTOR])
    return path


def trained_categories() -> tuple[str, ...]:
    """The categories that weights are shipped for."""
    names = sorted(path.stem for path in WEIGHTS_FOLDER.glob("*.safetensors"))
    return tuple(name for name in names if name != DETECTOR)
