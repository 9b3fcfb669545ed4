"""The pixels of a PNG, for comparisons."""

import io

import numpy as np
from PIL import Image


def pixels_of(png: bytes) -> np.ndarray:
    """(rows, columns, 3) 8-bit RGB."""
    with Image.open(io.BytesIO(png), formats=["PNG"]) as image:
        return np.asarray(image.convert("RGB"))
