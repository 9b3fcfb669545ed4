"""RGB arrays as PNG and PNG as RGB arrays."""

from __future__ import annotations

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Colours = NDArray[np.uint8]

# Packs a picture of squares nearly as well as the highest level, in a fraction of its time.
PACKING = 4


def png_of(image: Colours) -> bytes:
    """A picture (rows, columns, 3), 8-bit RGB, as PNG; the same one gives the same bytes."""
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(image)).save(buffer, "PNG", compress_level=PACKING)
    return buffer.getvalue()


def colours_of(png: bytes) -> Colours:
    """The picture in a PNG of ours, (rows, columns, 3)."""
    with Image.open(io.BytesIO(png), formats=["PNG"]) as image:
        return np.asarray(image.convert("RGB"))
