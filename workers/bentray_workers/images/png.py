"""RGB arrays as PNG, and pictures as RGB arrays."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from bentray_kernels.errors import InvalidInput

Colours = NDArray[np.uint8]

# Compresses nearly as well as the highest level, in a fraction of its time.
PACKING = 4


def png_of(image: Colours) -> bytes:
    """A picture (rows, columns, 3), 8-bit RGB, as PNG; the same picture gives the same bytes."""
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(image)).save(buffer, "PNG", compress_level=PACKING)
    return buffer.getvalue()


def read_picture(path: Path) -> Colours:
    """Read a picture file of any format of Pillow, (rows, columns, 3) 8-bit RGB.

    Raises:
        InvalidInput: for an absent file, another format, or a picture beyond the limit of Pillow.
    """
    try:
        with Image.open(path) as image:
            return np.asarray(image.convert("RGB"))
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        found = "no such file" if isinstance(error, FileNotFoundError) else "no picture"
        raise InvalidInput(
            "backdrop", f"{path} ({found})", "checkerboard, picture, or a picture file"
        ) from None
