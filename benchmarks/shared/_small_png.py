"""Small PNG files in full colour: a palette would falsify colour bars."""

from __future__ import annotations

import io

from PIL import Image

# Bytes; the repository takes no file of more than 300,000.
MAX_BYTES = 290_000
SHRINK = 0.9


def small_png(png: bytes) -> bytes:
    """The picture as it is, or with fewer pixels where it is too large."""
    with Image.open(io.BytesIO(png)) as image:
        shown = image.convert("RGB")
    while True:
        buffer = io.BytesIO()
        shown.save(buffer, "png", optimize=True)
        if buffer.tell() <= MAX_BYTES:
            return buffer.getvalue()
        size = round(SHRINK * shown.width), round(SHRINK * shown.height)
        shown = shown.resize(size, Image.Resampling.LANCZOS)
