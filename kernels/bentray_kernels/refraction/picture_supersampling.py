"""Post-refraction supersampling of interpolated pictures, which refines every pixel (4.3.3)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..compiled import kernel
from .backdrop import Backdrop, Colours
from .texels import STEPS, WHOLE, Texels, packed_colour, unpacked

Planes = NDArray[np.int8]
Crossed = NDArray[np.int16]
States = NDArray[np.uint8]

# Of a corner: the four pixels about it belong to different pieces of the picture; to one; to one, and to the
# same copy of the picture.
APART, TOGETHER, ALONE = 0, 1, 3

# A place is kept as a number of ninths of this part of a step: the weights of the nine samples are ninths.
FINE_BITS = 10
FINE = 1 << FINE_BITS


class Texture(NamedTuple):
    """One interpolated picture for compiled functions."""

    texels: Texels
    start: int
    rows: int
    columns: int
    repeats: float


@kernel
def filter_picture(
    backdrop: Backdrop,
    plane: int,
    planes: Planes,
    places: Floats,
    crossed: Crossed,
    weights: Floats,
    degree: int,
    image: Colours,
) -> None:
    """Post-refraction supersampling of the pixels that see one interpolated picture.

    The samples are those of ``post_refraction_colours``, those of degree 1 at places in whole numbers.

    Args:
        backdrop, planes, places, crossed, weights, degree: as for ``post_refraction_colours``.
        plane: number of the picture's plane.
        image: (rows, columns, 3); only pixels of this plane are written.
    """
    rows, columns = planes.shape
    table = backdrop.tables[plane]
    texture = Texture(backdrop.texels, table[8], table[1], table[2], backdrop.repeats[plane])
    # Of three rows, in turn.
    across, down = np.empty((3, columns), dtype=np.int64), np.empty((3, columns), dtype=np.int64)
    piece = np.empty((3, columns), dtype=np.int32)
    _place(texture, plane, planes[0], places[0], crossed[0], across[0], down[0], piece[0])
    # Of the corners above and below a row.
    state = np.zeros((2, columns + 1), dtype=np.uint8)
    for i in range(rows):
        above, below, after = i % 2, 1 - i % 2, (i + 1) % 3
        if i + 1 < rows:
            _place(
                texture,
                plane,
                planes[i + 1],
                places[i + 1],
                crossed[i + 1],
                across[after],
                down[after],
                piece[after],
            )
            _join(piece[i % 3], piece[after], state[below])
        else:
            state[below] = APART
        for j in range(columns):
            common = state[0, j] & state[0, j + 1] & state[1, j] & state[1, j + 1]
            if degree == 1 and common == ALONE:
                total = _nine(texture, across, down, i, j)
                red, green, blue = unpacked(total)
                scale = weights[i, j] / (9 * WHOLE)
                image[i, j, 0] = np.uint8(red * scale + 0.5)
                image[i, j, 1] = np.uint8(green * scale + 0.5)
                image[i, j, 2] = np.uint8(blue * scale + 0.5)
            elif planes[i, j] == plane:
                _sample_evenly(texture, places, i, j, state[above], state[below], degree, weights, image)


@kernel(inline="always")
def _place(
    texture: Texture,
    plane: int,
    planes: Planes,
    places: Floats,
    crossed: Crossed,
    across: Ints,
    down: Ints,
    piece: NDArray[np.int32],
) -> None:
    """Places of a row in the first copy of the picture, and numbers of its pieces.

    In another copy the number is even, in the first one odd; −1 is no piece.
    """
    ninth = STEPS * FINE / 9.0
    wide, high = texture.columns * ninth, texture.rows * ninth
    for j in range(len(planes)):
        x, y = (places[j, 0] + 0.5) * texture.repeats, (places[j, 1] + 0.5) * texture.repeats
        first = (x >= 0.0) & (x <= 1.0) & (y >= 0.0) & (y <= 1.0)
        across[j] = int(x * wide + 0.5 * ninth) if first else 0
        down[j] = int(y * high + 0.5 * ninth) if first else 0
        piece[j] = 2 * np.int32(crossed[j]) + np.int32(first) if planes[j] == plane else -1


@kernel(inline="always")
def _join(upper: NDArray[np.int32], lower: NDArray[np.int32], state: States) -> None:
    """State of the corners between two rows of pieces."""
    for j in range(1, len(upper)):
        a, b, c, d = upper[j - 1], upper[j], lower[j - 1], lower[j]
        together = (a >> 1 == b >> 1) & (a >> 1 == c >> 1) & (a >> 1 == d >> 1) & (a >= 0)
        state[j] = np.uint8(together) + 2 * np.uint8(together & (a & b & c & d == a | 1))


@kernel(inline="always")
def _nine(texture: Texture, across: Ints, down: Ints, i: int, j: int) -> np.uint64:
    """Sum of the samples of degree 1 among pixels of one piece."""
    own = i % 3
    x, y = across[own, j], down[own, j]
    total = _at(texture, 9 * x, 9 * y)
    for k in range(2):
        # The row above, then the one below.
        p = (i + 2 - k) % 3
        total += _at(texture, 6 * x + 3 * across[p, j], 6 * y + 3 * down[p, j])
        q = j - 1 + 2 * k
        total += _at(texture, 6 * x + 3 * across[own, q], 6 * y + 3 * down[own, q])
        for m in range(2):
            q = j - 1 + 2 * m
            total += _at(
                texture,
                4 * x + 2 * (across[p, j] + across[own, q]) + across[p, q],
                4 * y + 2 * (down[p, j] + down[own, q]) + down[p, q],
            )
    return total


@kernel(inline="always")
def _at(texture: Texture, across: int, down: int) -> np.uint64:
    """Colour at a place in parts of a step."""
    return packed_colour(
        texture.texels, texture.start, texture.columns, across >> FINE_BITS, down >> FINE_BITS
    )


@kernel(inline="always")
def _colour(texture: Texture, u: float, v: float) -> np.uint64:
    x, y = (u + 0.5) * texture.repeats, (v + 0.5) * texture.repeats
    # In steps from the middle of the frame's first texel.
    across = (x - np.floor(x)) * (texture.columns * STEPS) + STEPS / 2
    down = (y - np.floor(y)) * (texture.rows * STEPS) + STEPS / 2
    return packed_colour(texture.texels, texture.start, texture.columns, int(across), int(down))


@kernel(inline="always")
def _sample_evenly(
    texture: Texture,
    places: Floats,
    i: int,
    j: int,
    above: States,
    below: States,
    degree: int,
    weights: Floats,
    image: Colours,
) -> None:
    """Mean of (2·degree + 1)² samples; the pixel's own colour stands in for those of another piece."""
    own = _colour(texture, places[i, j, 0], places[i, j, 1])
    step = 1.0 / (2 * degree + 1)
    red = green = blue = np.int64(0)
    for down in range(2):
        for right in range(2):
            joined = (below[j + right] if down else above[j + right]) != APART
            # Without a neighbour all steps are 0.
            p, q = (i - 1 + 2 * down, j - 1 + 2 * right) if joined else (i, j)
            u, v = places[i, j, 0], places[i, j, 1]
            u_down, v_down = step * (places[p, j, 0] - u), step * (places[p, j, 1] - v)
            u_right, v_right = step * (places[i, q, 0] - u), step * (places[i, q, 1] - v)
            u_both = step * (step * (places[p, q, 0] - u) - u_down - u_right)
            v_both = step * (step * (places[p, q, 1] - v) - v_down - v_right)
            # Samples on a line between two corners go with the one below or to the right.
            for a in range(1 - down, degree + 1):
                total = np.uint64(0) if joined else own * np.uint64(degree + right)
                for b in range(1 - right, degree + 1 if joined else 0):
                    total += _colour(
                        texture,
                        u + a * u_down + b * (u_right + a * u_both),
                        v + a * v_down + b * (v_right + a * v_both),
                    )
                channels = unpacked(total)
                red, green, blue = red + channels[0], green + channels[1], blue + channels[2]
    scale = weights[i, j] * step * step / WHOLE
    image[i, j, 0] = np.uint8(red * scale + 0.5)
    image[i, j, 1] = np.uint8(green * scale + 0.5)
    image[i, j, 2] = np.uint8(blue * scale + 0.5)
