"""Post-refraction supersampling of interpolated pictures, which refines every pixel (4.3.3)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..compilation.compiled import kernel
from .backdrop import Backdrop, Colours, paint
from .coarse_rays import Hits
from .texels import STEP_BITS, STEPS, WHOLE, Texels, between_texels, reduced, unpacked

Planes = NDArray[np.int8]
Crossed = NDArray[np.int16]
States = NDArray[np.uint8]
Pairs = NDArray[np.uint64]

# Of a corner: the four pixels about it belong to different pieces of the picture; to one; to one, and to the
# same copy of the picture.
APART, TOGETHER, ALONE = 0, 1, 3

# A place between pixels is a pair of numbers in one: the place down, ``PLACE_BITS`` above the place across,
# both in texels with ``PART_BITS`` behind the point. That of a pixel is in ninths of it: the weights of the
# nine samples are ninths.
PLACE_BITS, PART_BITS = 32, 16
PARTS = 1 << PART_BITS
# Most texels along a side of a picture for such places.
MOST_TEXELS = PARTS - 2

TWO, THREE = np.uint64(2), np.uint64(3)
FINE_ACROSS, ACROSS = np.uint64(PART_BITS - STEP_BITS), np.uint64(PART_BITS)
FINE_DOWN, DOWN = np.uint64(PLACE_BITS + PART_BITS - STEP_BITS), np.uint64(PLACE_BITS + PART_BITS)
STEP_MASK, TEXEL_MASK = np.uint64(STEPS - 1), np.uint64(PARTS - 1)


class Texture(NamedTuple):
    """One interpolated picture for compiled functions.

    Attributes:
        texels: from its first on.
        rows, columns: without the frame.
        repeats: as in ``Plane``.
    """

    texels: Texels
    rows: int
    columns: int
    repeats: float


@kernel
def filter_picture(backdrop: Backdrop, plane: int, hits: Hits, degree: int, image: Colours) -> None:
    """Post-refraction supersampling of the pixels that see one interpolated picture.

    The samples are those of ``post_refraction_colours``, those of degree 1 at places in whole numbers.

    Args:
        backdrop, hits, degree: as for ``post_refraction_colours``.
        plane: number of the picture's plane.
        image: (rows, columns, 3); only pixels of this plane are written.
    """
    planes, places, _, crossed, weights = hits
    rows, columns = planes.shape
    table = backdrop.tables[plane]
    texture = Texture(backdrop.texels[table[8] :], table[1], table[2], backdrop.repeats[plane])
    # Of three rows, in turn.
    pairs, piece = np.empty((3, columns), dtype=np.uint64), np.empty((3, columns), dtype=np.int32)
    _place(texture, plane, planes[0], places[0], crossed[0], pairs[0], piece[0])
    # Thirds of the places between a row and the one above it, of the row itself, and towards the one below.
    thirds = np.empty((3, columns), dtype=np.uint64)
    # Of the corners above and below a row.
    state = np.zeros((2, columns + 1), dtype=np.uint8)
    for i in range(rows):
        above, below, before, after = i % 2, 1 - i % 2, (i + 2) % 3, (i + 1) % 3
        if i + 1 < rows:
            _place(texture, plane, planes[i + 1], places[i + 1], crossed[i + 1], pairs[after], piece[after])
            _join(piece[i % 3], piece[after], state[below])
        else:
            state[below] = APART
        if degree == 1:
            _mix(pairs[before], pairs[i % 3], pairs[after], thirds)
        for j in range(columns):
            common = state[0, j] & state[0, j + 1] & state[1, j] & state[1, j + 1]
            if degree == 1 and common == ALONE:
                colour = unpacked(_nine(texture, thirds, np.uint64(j)))
                paint(image, i, j, colour, weights[i, j] / (9 * WHOLE))
            elif planes[i, j] == plane:
                _sample_evenly(texture, hits, i, j, state[above], state[below], degree, image)


@kernel(inline="always")
def _place(
    texture: Texture,
    plane: int,
    planes: Planes,
    places: Floats,
    crossed: Crossed,
    pairs: Pairs,
    piece: NDArray[np.int32],
) -> None:
    """Places of a row in the first copy of the picture, and numbers of its pieces.

    In another copy the number is even, in the first one odd; −1 is no piece. A picture with too many texels
    counts as another copy.
    """
    ninth = PARTS / 9.0
    wide, high = texture.columns * ninth, texture.rows * ninth
    small = max(texture.columns, texture.rows) <= MOST_TEXELS
    for j in range(len(planes)):
        x, y = (places[j, 0] + 0.5) * texture.repeats, (places[j, 1] + 0.5) * texture.repeats
        first = small & (x >= 0.0) & (x <= 1.0) & (y >= 0.0) & (y <= 1.0)
        across = int(x * wide + 0.5 * ninth) if first else 0
        down = int(y * high + 0.5 * ninth) if first else 0
        pairs[j] = np.uint64(down << PLACE_BITS | across)
        piece[j] = 2 * np.int32(crossed[j]) + np.int32(first) if planes[j] == plane else -1


@kernel(inline="always")
def _mix(above: Pairs, own: Pairs, below: Pairs, thirds: Pairs) -> None:
    """Three times the places of a row, and those a third of the way to its neighbours."""
    for j in range(len(own)):
        thirds[0, j] = TWO * own[j] + above[j]
        thirds[1, j] = THREE * own[j]
        thirds[2, j] = TWO * own[j] + below[j]


@kernel(inline="always")
def _join(upper: NDArray[np.int32], lower: NDArray[np.int32], state: States) -> None:
    """State of the corners between two rows of pieces."""
    for j in range(1, len(upper)):
        a, b, c, d = upper[j - 1], upper[j], lower[j - 1], lower[j]
        together = (a >> 1 == b >> 1) & (a >> 1 == c >> 1) & (a >> 1 == d >> 1) & (a >= 0)
        state[j] = np.uint8(together) + 2 * np.uint8(together & (a & b & c & d == a | 1))


@kernel(inline="always")
def _nine(texture: Texture, thirds: Pairs, j: np.uint64) -> np.uint64:
    """Sum of the samples of degree 1 of a pixel among pixels of one piece."""
    stride = np.uint64(texture.columns + 2)
    total = reduced(_at(texture.texels, stride, THREE * thirds[1, j]))
    for k in range(3):
        left = _at(texture.texels, stride, TWO * thirds[k, j] + thirds[k, j - np.uint64(1)])
        right = _at(texture.texels, stride, TWO * thirds[k, j] + thirds[k, j + np.uint64(1)])
        total += reduced(left + right)
    upper = _at(texture.texels, stride, THREE * thirds[0, j])
    return total + reduced(upper + _at(texture.texels, stride, THREE * thirds[2, j]))


@kernel(inline="always")
def _at(texels: Texels, stride: np.uint64, pair: np.uint64) -> np.uint64:
    """Colour at a place."""
    first = (pair >> DOWN) * stride + (pair >> ACROSS & TEXEL_MASK)
    return between_texels(
        texels, first, stride, pair >> FINE_ACROSS & STEP_MASK, pair >> FINE_DOWN & STEP_MASK
    )


@kernel(inline="always")
def _colour(texture: Texture, u: float, v: float) -> np.uint64:
    x, y = (u + 0.5) * texture.repeats, (v + 0.5) * texture.repeats
    # In steps from the middle of the frame's first texel.
    across = np.uint64((x - np.floor(x)) * (texture.columns * STEPS) + STEPS / 2)
    down = np.uint64((y - np.floor(y)) * (texture.rows * STEPS) + STEPS / 2)
    bits, stride = np.uint64(STEP_BITS), np.uint64(texture.columns + 2)
    first = (down >> bits) * stride + (across >> bits)
    return reduced(between_texels(texture.texels, first, stride, across & STEP_MASK, down & STEP_MASK))


@kernel(inline="always")
def _sample_evenly(
    texture: Texture, hits: Hits, i: int, j: int, above: States, below: States, degree: int, image: Colours
) -> None:
    """Mean of (2·degree + 1)² samples; the pixel's own colour stands in for those of another piece."""
    places = hits.where
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
    paint(image, i, j, (red, green, blue), hits.weight[i, j] * step * step / WHOLE)
