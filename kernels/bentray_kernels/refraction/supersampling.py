"""Supersampling: pixel colours by point sampling, post-refraction or real supersampling (4.3.3)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..compiled import kernel
from .backdrop import Backdrop, Colours, colour_at
from .picture_supersampling import filter_picture

Planes = NDArray[np.int8]
Crossed = NDArray[np.int16]


@kernel
def point_colours(
    backdrop: Backdrop, planes: Planes, places: Floats, weights: Floats, image: Colours
) -> None:
    """One sample a pixel.

    Args:
        backdrop: what is seen.
        planes: (rows, columns) as ``locate`` gives them.
        places: (rows, columns, 2).
        weights: (rows, columns) share of the light that arrives.
        image: (rows, columns, 3), filled.
    """
    rows, columns = planes.shape
    for i in range(rows):
        for j in range(columns):
            _point(backdrop, planes, places, weights, image, i, j)


@kernel(inline="always")
def _point(
    backdrop: Backdrop, planes: Planes, places: Floats, weights: Floats, image: Colours, i: int, j: int
) -> None:
    colour = colour_at(backdrop, planes[i, j], places[i, j, 0], places[i, j, 1])
    for c in range(3):
        image[i, j, c] = np.uint8(colour[c] * weights[i, j] + 0.5)


@kernel
def post_refraction_colours(
    backdrop: Backdrop,
    planes: Planes,
    places: Floats,
    crossed: Crossed,
    weights: Floats,
    degree: int,
    image: Colours,
) -> None:
    """Post-refraction supersampling (PRSS): no more rays, only more samples of the backdrop.

    The places of a pixel and its 8 neighbours show how the object distorts the grid of pixels. Between the
    pixel and them (2·degree + 1)² samples fill the square of the pixel evenly, their places interpolated
    bilinearly; the low-pass is their mean. For degree 1 these are the pixel's own place and the 8
    intermediate ones of the dissertation, a third of the way. A neighbour whose ray met another number of
    interfaces, or ended on another plane, belongs to another piece of the picture: its samples are replaced
    by the pixel's own colour. In patterns only pixels near the edge of a square are sampled; of interpolated
    pictures see ``filter_picture``.

    Args:
        backdrop, planes, places, weights: as for ``point_colours``.
        crossed: (rows, columns) interfaces met by the ray.
        degree: at least 1.
        image: (rows, columns, 3), filled.
    """
    patterns = False
    for plane in range(len(backdrop.tables)):
        patterns |= backdrop.tables[plane, 3] == 0
    if patterns:
        point_colours(backdrop, planes, places, weights, image)
        _filter_patterns(backdrop, planes, places, crossed, weights, degree, image)
    else:
        _colour_beyond(backdrop, planes, places, weights, image)
    for plane in range(len(backdrop.tables)):
        if backdrop.tables[plane, 3]:
            filter_picture(backdrop, plane, planes, places, crossed, weights, degree, image)


@kernel
def _colour_beyond(
    backdrop: Backdrop, planes: Planes, places: Floats, weights: Floats, image: Colours
) -> None:
    """Colours of the pixels that see no plane."""
    rows, columns = planes.shape
    for i in range(rows):
        for j in range(columns):
            if planes[i, j] < 0:
                _point(backdrop, planes, places, weights, image, i, j)


@kernel
def _filter_patterns(
    backdrop: Backdrop,
    planes: Planes,
    places: Floats,
    crossed: Crossed,
    weights: Floats,
    degree: int,
    image: Colours,
) -> None:
    """Supersampling of the pixels that see a pattern of squares."""
    rows, columns = planes.shape
    # Of two rows, in turn.
    pieces, squares = np.empty((2, columns), dtype=np.int32), np.empty((2, columns), dtype=np.int64)
    # Of the four pixels about each corner above and below a row; none beyond the rim.
    same_square = np.ones((2, columns + 1), dtype=np.bool_)
    same_piece = np.zeros((2, columns + 1), dtype=np.bool_)
    share = 1.0 / (2 * degree + 1) ** 2
    _name_pieces(backdrop, planes[0], places[0], crossed[0], pieces[0], squares[0])
    for i in range(rows):
        here, after = i % 2, 1 - i % 2
        if i + 1 < rows:
            _name_pieces(
                backdrop, planes[i + 1], places[i + 1], crossed[i + 1], pieces[after], squares[after]
            )
            _compare(squares[here], squares[after], same_square[after])
            _compare(pieces[here], pieces[after], same_piece[after])
        else:
            same_square[after], same_piece[after] = True, False
        for j in range(columns):
            upper = same_square[here, j] & same_square[here, j + 1]
            lower = same_square[after, j] & same_square[after, j + 1]
            if (upper & lower) or planes[i, j] < 0 or backdrop.tables[planes[i, j], 3]:
                continue
            own = colour_at(backdrop, planes[i, j], places[i, j, 0], places[i, j, 1])
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
                                u, v = _between(
                                    places, i, j, p, q, a / (2 * degree + 1), b / (2 * degree + 1)
                                )
                                colour = colour_at(backdrop, planes[i, j], u, v)
                            red += colour[0]
                            green += colour[1]
                            blue += colour[2]
            scale = share * weights[i, j]
            image[i, j, 0] = np.uint8(red * scale + 0.5)
            image[i, j, 1] = np.uint8(green * scale + 0.5)
            image[i, j, 2] = np.uint8(blue * scale + 0.5)


@kernel(inline="always")
def _name_pieces(
    backdrop: Backdrop,
    planes: Planes,
    places: Floats,
    crossed: Crossed,
    pieces: NDArray[np.int32],
    squares: NDArray[np.int64],
) -> None:
    """Numbers for the pieces of the picture that the pixels of a row belong to, and for their squares."""
    for j in range(len(planes)):
        plane = planes[j]
        piece = 256 * np.int64(crossed[j]) + plane
        pieces[j] = piece
        if plane < 0 or backdrop.tables[plane, 3]:
            squares[j] = -1
        else:
            across = backdrop.repeats[plane] * backdrop.tables[plane, 2]
            below = backdrop.repeats[plane] * backdrop.tables[plane, 1]
            x = np.int64(np.floor((places[j, 0] + 0.5) * across)) & 0x1FFFFF
            y = np.int64(np.floor((places[j, 1] + 0.5) * below)) & 0x1FFFFF
            squares[j] = (piece << 42) ^ (x << 21) ^ y


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
