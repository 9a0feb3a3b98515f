"""Makes docs/pictures/catalogue.png: a row a category, six test objects each, some partly open.

Needs a renderer: `python docs/make_contact_sheet.py`. The same command gives the same picture.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from artgym.objects import catalog
from artgym.sim.thumbnail import thumbnail

PICTURE = Path(__file__).parent / "pictures" / "catalogue.png"

COLUMNS = 6
SIZE = (200, 150)
#: Open fractions along a row, in turn.
OPEN_FRACTIONS = (0.0, 0.4)
LABEL_WIDTH = 150


def row(category: str) -> NDArray[np.uint8]:
    """A category's first test objects, (h, w, 3), its name in front."""
    pictures = [_label(category.replace("_", " "))]
    for i, object_id in enumerate(catalog.object_ids(category, "test", COLUMNS)):
        fraction = OPEN_FRACTIONS[i % len(OPEN_FRACTIONS)]
        pictures.append(thumbnail(catalog.load(object_id), SIZE, fraction))
    return np.concatenate(pictures, axis=1)


def _label(text: str) -> NDArray[np.uint8]:
    image = Image.new("RGB", (LABEL_WIDTH, SIZE[1]), "white")
    place = (LABEL_WIDTH - 12, SIZE[1] / 2)
    ImageDraw.Draw(image).text(
        place, text, fill="black", anchor="rm", font=ImageFont.load_default(18)
    )
    return np.asarray(image)


def main() -> None:
    """Writes the sheet."""
    sheet = np.concatenate([row(name) for name in sorted(catalog.CATEGORIES)])
    PICTURE.parent.mkdir(exist_ok=True)
    Image.fromarray(sheet).save(PICTURE, optimize=True)
    print(f"wrote {PICTURE}, {PICTURE.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
