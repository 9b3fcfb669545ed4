"""Small PNG files: figures in full colour, and contact sheets of renderings in few colours."""

import io
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.font_manager import findfont
from PIL import Image, ImageDraw, ImageFont

from bentray_workers.images.canvas import to_png

# Bytes; the repository takes no file of more than 300,000.
MAX_BYTES = 290_000
SHRINK = 0.9

# Of a contact sheet, pixels.
PANEL, GAP, LINE = 176, 6, 14
INK, PAPER = (25, 25, 25), (255, 255, 255)


def figure_png(figure: Figure) -> bytes:
    """The figure, drawn with fewer pixels where it is too large: resized pictures compress badly."""
    small = in_full_colour(to_png(figure))
    longest = float(max(_size(small)))
    while len(small) > MAX_BYTES:
        longest *= SHRINK
        small = in_full_colour(to_png(figure, round(longest)))
    return small


def in_full_colour(png: bytes) -> bytes:
    """The picture as RGB, compressed as far as PNG can: a palette would falsify colour bars."""
    with Image.open(io.BytesIO(png)) as image:
        buffer = io.BytesIO()
        image.convert("RGB").save(buffer, "png", optimize=True)
    return buffer.getvalue()


def _size(png: bytes) -> tuple[int, int]:
    with Image.open(io.BytesIO(png)) as image:
        return image.size


@dataclass(frozen=True)
class Panel:
    """A picture, (rows, columns, 3) 8-bit RGB, and up to two lines of text under it."""

    name: str
    image: np.ndarray


def sheet(rows: Sequence[tuple[str, Sequence[Panel]]], colours: int = 64) -> bytes:
    """PNG of rows of panels, each row under its title, in so many colours; for renderings alone."""
    # Pillow's own font has no Greek.
    face = findfont("DejaVu Sans")
    font, bold = ImageFont.truetype(face, 10), ImageFont.truetype(face, 12)
    widest = max(len(panels) for _, panels in rows)
    width = GAP + widest * (PANEL + GAP)
    height = len(rows) * (LINE + PANEL + 2 * LINE + 2 * GAP) + GAP
    page = Image.new("RGB", (width, height), PAPER)
    pen = ImageDraw.Draw(page)
    top = GAP
    for title, panels in rows:
        pen.text((GAP, top), title, INK, bold)
        top += LINE + GAP
        for k, panel in enumerate(panels):
            left = GAP + k * (PANEL + GAP)
            page.paste(
                Image.fromarray(panel.image).resize((PANEL, PANEL), Image.Resampling.LANCZOS), (left, top)
            )
            pen.multiline_text((left, top + PANEL + 1), panel.name, INK, font, spacing=1)
        top += PANEL + 2 * LINE + GAP
    buffer = io.BytesIO()
    page.quantize(colours, dither=Image.Dither.NONE).save(buffer, "png", optimize=True)
    return buffer.getvalue()
