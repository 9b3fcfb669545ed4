"""Supersampling: pixel colours by point sampling, post-refraction or real supersampling (4.3.3)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Flags, Floats, Ints
from ..compilation.compiled import kernel
from .backdrop import Backdrop, Colours, colour_at, paint
from .coarse_rays import Hits
from .picture_supersampling import filter_picture

Planes = NDArray[np.int8]
Crossed = NDArray[np.int16]

# Bits behind the point of a place in copies of a pattern, in whole numbers.
PLACE_BITS = 32
WITHIN_COPY = (1 << PLACE_BITS) - 1

ONE, TWO = np.uint64(1), np.uint64(2)


class Pattern(NamedTuple):
    """One pattern of squares for compiled functions.

    Attributes:
        start: of its picture in ``Backdrop.pictures``.
        rows, columns: of squares in a copy.
        repeats: as in ``Plane``.
    """

    start: int
    rows: int
    columns: int
    repeats: float


@kernel
def point_colours(backdrop: Backdrop, hits: Hits, image: Colours) -> None:
    """One sample a pixel.

    Args:
        backdrop: what is seen.
        hits: (rows, columns), their weights the share of the light that arrives.
        image: (rows, columns, 3), filled.
    """
    rows, columns = hits.plane.shape
    for i in range(rows):
        for j in range(columns):
            _point(backdrop, hits, image, i, j)


@kernel(inline="always")
def _point(backdrop: Backdrop, hits: Hits, image: Colours, i: int, j: int) -> None:
    colour = colour_at(backdrop, hits.plane[i, j], hits.where[i, j, 0], hits.where[i, j, 1])
    paint(image, i, j, colour, hits.weight[i, j])


@kernel
def post_refraction_colours(backdrop: Backdrop, hits: Hits, degree: int, image: Colours) -> None:
    """Post-refraction supersampling (PRSS): no more rays, only more samples of the backdrop.

    The places of a pixel and its 8 neighbours show how the object distorts the grid of pixels. Between the
    pixel and them (2·degree + 1)² samples fill the square of the pixel evenly, their places interpolated
    bilinearly; the low-pass is their mean. For degree 1 these are the pixel's own place and the 8
    intermediate ones of the dissertation, a third of the way. A neighbour whose ray met another number of
    interfaces, or ended on another plane, belongs to another piece of the picture: its samples are replaced
    by the pixel's own colour. In patterns only pixels near the edge of a square are sampled; of interpolated
    pictures see ``filter_picture``.

    Args:
        backdrop, hits: as for ``point_colours``.
        degree: at least 1.
        image: (rows, columns, 3), filled.
    """
    patterns = False
    for plane in range(len(backdrop.tables)):
        patterns |= backdrop.tables[plane, 3] == 0
    if patterns:
        point_colours(backdrop, hits, image)
        _filter_patterns(backdrop, hits, degree, image)
    else:
        _colour_beyond(backdrop, hits, image)
    for plane in range(len(backdrop.tables)):
        if backdrop.tables[plane, 3]:
            filter_picture(backdrop, plane, hits, degree, image)


@kernel
def _colour_beyond(backdrop: Backdrop, hits: Hits, image: Colours) -> None:
    """Colours of the pixels that see no plane."""
    rows, columns = hits.plane.shape
    for i in range(rows):
        for j in range(columns):
            if hits.plane[i, j] < 0:
                _point(backdrop, hits, image, i, j)


@kernel
def _filter_patterns(backdrop: Backdrop, hits: Hits, degree: int, image: Colours) -> None:
    """Supersampling of the pixels that see a pattern of squares."""
    planes, places, _, crossed, weights = hits
    rows, columns = planes.shape
    # Of two rows, in turn.
    pieces, squares = np.empty((2, columns), dtype=np.int32), np.empty((2, columns), dtype=np.int64)
    # Ninths of places, of three rows in turn: the weights of the nine samples of degree 1 are ninths.
    across, down = np.empty((3, columns), dtype=np.int64), np.empty((3, columns), dtype=np.int64)
    # Thirds of the places between a row and the one above it, of the row itself, and towards the one below.
    thirds = np.empty((2, 3, columns), dtype=np.int64)
    # Of the four pixels about each corner above and below a row; none beyond the rim.
    same_square = np.ones((2, columns + 1), dtype=np.bool_)
    same_piece = np.zeros((2, columns + 1), dtype=np.bool_)
    share = 1.0 / (2 * degree + 1) ** 2
    _name_pieces(backdrop, planes[0], places[0], crossed[0], pieces[0], squares[0], across[0], down[0])
    for i in range(rows):
        here, after = i % 2, 1 - i % 2
        above, own, below = (i + 2) % 3, i % 3, (i + 1) % 3
        if i + 1 < rows:
            _name_pieces(
                backdrop,
                planes[i + 1],
                places[i + 1],
                crossed[i + 1],
                pieces[after],
                squares[after],
                across[below],
                down[below],
            )
            _compare(squares[here], squares[after], same_square[after])
            _compare(pieces[here], pieces[after], same_piece[after])
        else:
            same_square[after], same_piece[after] = True, False
        if degree == 1:
            _mix(across[above], across[own], across[below], thirds[0])
            _mix(down[above], down[own], down[below], thirds[1])
        for j in range(columns):
            upper = same_square[here, j] & same_square[here, j + 1]
            lower = same_square[after, j] & same_square[after, j + 1]
            if (upper & lower) or planes[i, j] < 0 or backdrop.tables[planes[i, j], 3]:
                continue
            joined = same_piece[here, j] & same_piece[here, j + 1]
            if degree == 1 and joined & same_piece[after, j] & same_piece[after, j + 1]:
                colour = _nine(backdrop, planes[i, j], thirds, np.uint64(j))
            else:
                colour = _sample_evenly(backdrop, hits, i, j, same_square, same_piece, degree)
            paint(image, i, j, colour, share * weights[i, j])


@kernel(inline="always")
def _mix(above: Ints, own: Ints, below: Ints, thirds: Ints) -> None:
    """Three times the places of a row, and those a third of the way to its neighbours."""
    for j in range(len(own)):
        thirds[0, j] = 2 * own[j] + above[j]
        thirds[1, j] = 3 * own[j]
        thirds[2, j] = 2 * own[j] + below[j]


@kernel(inline="always")
def _nine(backdrop: Backdrop, plane: int, thirds: Ints, j: np.uint64) -> tuple[float, float, float]:
    """Sum of the samples of degree 1 of a pixel among pixels of one piece."""
    pattern, pictures = _pattern(backdrop, plane), backdrop.pictures
    red = green = blue = 0
    for k in range(3):
        x, y = thirds[0, k, j], thirds[1, k, j]
        for m in range(3):
            q = j + np.uint64(m) - ONE
            at = _square(pattern, 2 * x + thirds[0, k, q], 2 * y + thirds[1, k, q])
            red += pictures[at]
            green += pictures[at + ONE]
            blue += pictures[at + TWO]
    return red, green, blue


@kernel(inline="always")
def _pattern(backdrop: Backdrop, plane: int) -> Pattern:
    table = backdrop.tables[plane]
    return Pattern(table[0], table[1], table[2], backdrop.repeats[plane])


@kernel(inline="always")
def _square(pattern: Pattern, x: int, y: int) -> np.uint64:
    """Where the colour at a place begins in ``Backdrop.pictures``."""
    column = ((x & WITHIN_COPY) * pattern.columns) >> PLACE_BITS
    row = ((y & WITHIN_COPY) * pattern.rows) >> PLACE_BITS
    # Unsigned, as a negative index would be counted from the end.
    return np.uint64(pattern.start + 3 * (row * pattern.columns + column))


@kernel(inline="always")
def _sample_evenly(
    backdrop: Backdrop, hits: Hits, i: int, j: int, same_square: Flags, same_piece: Flags, degree: int
) -> tuple[float, float, float]:
    """Sum of (2·degree + 1)² samples; the pixel's own colour stands in for those of another piece."""
    plane, places = hits.plane[i, j], hits.where
    own = colour_at(backdrop, plane, places[i, j, 0], places[i, j, 1])
    red = green = blue = 0.0
    for down in range(2):
        for right in range(2):
            corner = ((i + down) % 2, j + right)
            other = not same_square[corner] and same_piece[corner]
            # Samples on a line between two corners go with the one below or to the right.
            for a in range(1 - down, degree + 1):
                for b in range(1 - right, degree + 1):
                    colour = own
                    if other and a + b > 0:
                        p, q = i - 1 + 2 * down, j - 1 + 2 * right
                        u, v = _between(places, i, j, p, q, a / (2 * degree + 1), b / (2 * degree + 1))
                        colour = colour_at(backdrop, plane, u, v)
                    red += colour[0]
                    green += colour[1]
                    blue += colour[2]
    return red, green, blue


@kernel(inline="always")
def _name_pieces(
    backdrop: Backdrop,
    planes: Planes,
    places: Floats,
    crossed: Crossed,
    pieces: NDArray[np.int32],
    squares: Ints,
    across: Ints,
    down: Ints,
) -> None:
    """Numbers for the pieces of the picture that the pixels of a row belong to, and for their squares.

    Their places are in copies of the pattern, ninths with ``PLACE_BITS`` behind the point.
    """
    for j in range(len(planes)):
        pieces[j] = 256 * np.int32(crossed[j]) + planes[j]
        squares[j] = -1
    ninth = (1 << PLACE_BITS) / 9.0
    for plane in range(len(backdrop.tables)):
        if backdrop.tables[plane, 3]:
            continue
        pattern = _pattern(backdrop, plane)
        # Without branches, so that it is vectorised.
        for j in range(len(planes)):
            x, y = (places[j, 0] + 0.5) * pattern.repeats, (places[j, 1] + 0.5) * pattern.repeats
            column = np.int64(np.floor(x * pattern.columns)) & 0x1FFFFF
            row = np.int64(np.floor(y * pattern.rows)) & 0x1FFFFF
            square = (np.int64(pieces[j]) << 42) ^ (column << 21) ^ row
            on = planes[j] == plane
            squares[j] = square if on else squares[j]
            across[j] = np.int64(x * ninth) if on else across[j]
            down[j] = np.int64(y * ninth) if on else down[j]


@kernel(inline="always")
def _compare(above: NDArray[np.int64], below: NDArray[np.int64], same: NDArray[np.bool_]) -> None:
    """Which four neighbours have one number; ``same`` has an entry more at either end."""
    for j in range(1, len(above)):
        across = (above[j - 1] == above[j]) & (below[j - 1] == below[j])
        same[j] = across & (above[j] == below[j])


@kernel(inline="always")
def _between(places: Floats, i: int, j: int, p: int, q: int, t: float, w: float) -> tuple[float, float]:
    """The place t of the way from row i to row p and w of the way from column j to column q."""
    own, down, right, both = (1.0 - t) * (1.0 - w), t * (1.0 - w), (1.0 - t) * w, t * w
    return (
        own * places[i, j, 0] + down * places[p, j, 0] + right * places[i, q, 0] + both * places[p, q, 0],
        own * places[i, j, 1] + down * places[p, j, 1] + right * places[i, q, 1] + both * places[p, q, 1],
    )


def averaged(image: Colours, times: int) -> Colours:
    """Means of times × times samples, the low-pass of real supersampling.

    Args:
        image: (times·rows, times·columns, 3).
        times: samples a pixel along each axis.

    Returns:
        (rows, columns, 3).
    """
    rows, columns = image.shape[0] // times, image.shape[1] // times
    samples = image.reshape(rows, times, columns, times, 3)
    return np.asarray(samples.mean(axis=(1, 3)) + 0.5, dtype=np.uint8)
