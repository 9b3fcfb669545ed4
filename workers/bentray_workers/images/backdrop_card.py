"""Test card for the backdrop of refractive rendering: lines, circles, colours and text."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

SIDE = 1024
PAPER, INK, FAINT = (250, 248, 240), (35, 45, 60), (175, 195, 215)
COLOURS = ((200, 50, 45), (235, 150, 30), (235, 210, 60), (60, 150, 80), (45, 110, 185), (110, 70, 150))


@lru_cache(maxsize=1)
def backdrop_card() -> NDArray[np.uint8]:
    """(1024, 1024, 3) 8-bit RGB."""
    card = Image.new("RGB", (SIDE, SIDE), PAPER)
    draw = ImageDraw.Draw(card)
    for position in range(0, SIDE, 32):
        bold = position % 128 == 0
        for line in ((position, 0, position, SIDE), (0, position, SIDE, position)):
            draw.line(line, fill=INK if bold else FAINT, width=3 if bold else 1)
    middle = SIDE // 2
    for radius in range(64, middle, 64):
        box = (middle - radius, middle - radius, middle + radius, middle + radius)
        draw.ellipse(box, outline=INK, width=4)
    for k, colour in enumerate(COLOURS):
        left = 128 + k * 128
        draw.rectangle((left, 128, left + 127, 191), fill=colour)
        draw.rectangle((left, SIDE - 192, left + 127, SIDE - 129), fill=COLOURS[-1 - k])
    for y, words, size in ((416, "BENTRAY", 150), (610, "refraction in graphics and medicine", 46)):
        draw.text((middle, y), words, fill=INK, font=ImageFont.load_default(size), anchor="mm")
    return np.asarray(card)
