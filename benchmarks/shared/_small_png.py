"""Small PNG files in full colour: a palette would falsify colour bars."""

import io

from matplotlib.figure import Figure
from PIL import Image

from bentray_workers.images.canvas import to_png

# Bytes; the repository takes no file of more than 300,000.
MAX_BYTES = 290_000
SHRINK = 0.9


def figure_png(figure: Figure) -> bytes:
    """The figure, drawn with fewer pixels where it is too large: resized pictures compress badly."""
    small = in_full_colour(to_png(figure))
    longest = float(max(_size(small)))
    while len(small) > MAX_BYTES:
        longest *= SHRINK
        small = in_full_colour(to_png(figure, round(longest)))
    return small


def in_full_colour(png: bytes) -> bytes:
    """The picture as RGB, compressed as far as PNG can."""
    with Image.open(io.BytesIO(png)) as image:
        buffer = io.BytesIO()
        image.convert("RGB").save(buffer, "png", optimize=True)
    return buffer.getvalue()


def _size(png: bytes) -> tuple[int, int]:
    with Image.open(io.BytesIO(png)) as image:
        return image.size
