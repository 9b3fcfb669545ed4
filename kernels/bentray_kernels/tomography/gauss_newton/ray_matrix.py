"""Products with the rays' sparse matrix; see ``gauss_newton.linearisation.Rows``.

Indices are unsigned: for signed ones numba tests whether they count from the end, which takes a third longer.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats, Ints
from ...compilation.compiled import kernel

LANES = np.uint64(4)


@kernel
def project(
    pointers: Ints, columns: NDArray[np.int32], lengths: NDArray[np.float32], image: Floats, into: Floats
) -> None:
    """Write A·image to ``into``."""
    for row in range(len(pointers) - 1):
        into[row] = _along(pointers, columns, lengths, image, row)


@kernel
def back_project(
    pointers: Ints, columns: NDArray[np.int32], lengths: NDArray[np.float32], values: Floats, into: Floats
) -> None:
    """Add Aᵀ·values to ``into``."""
    for row in range(len(pointers) - 1):
        _spread(pointers, columns, lengths, values[row], row, into)


@kernel
def normal_product(
    pointers: Ints,
    columns: NDArray[np.int32],
    lengths: NDArray[np.float32],
    weights: Floats,
    image: Floats,
    into: Floats,
) -> None:
    """Add Aᵀ·W·A·image to ``into``, with one weight a row, reading each row once."""
    for row in range(len(pointers) - 1):
        value = weights[row] * _along(pointers, columns, lengths, image, row)
        _spread(pointers, columns, lengths, value, row, into)


@kernel(inline="always")
def _along(
    pointers: Ints, columns: NDArray[np.int32], lengths: NDArray[np.float32], image: Floats, row: int
) -> float:
    """One row times an image."""
    first, last = np.uint64(pointers[row]), np.uint64(pointers[row + 1])
    # Four independent sums: with one, every addition waits for the previous one.
    a = b = c = d = 0.0
    k = first
    for _ in range((last - first) // LANES):
        a += lengths[k] * image[np.uint32(columns[k])]
        b += lengths[k + np.uint64(1)] * image[np.uint32(columns[k + np.uint64(1)])]
        c += lengths[k + np.uint64(2)] * image[np.uint32(columns[k + np.uint64(2)])]
        d += lengths[k + np.uint64(3)] * image[np.uint32(columns[k + np.uint64(3)])]
        k += LANES
    for left in range(k, last):
        a += lengths[left] * image[np.uint32(columns[left])]
    return (a + b) + (c + d)


@kernel(inline="always")
def _spread(
    pointers: Ints,
    columns: NDArray[np.int32],
    lengths: NDArray[np.float32],
    value: float,
    row: int,
    into: Floats,
) -> None:
    """Add a value times one row to ``into``."""
    for k in range(np.uint64(pointers[row]), np.uint64(pointers[row + 1])):
        into[np.uint32(columns[k])] += lengths[k] * value
