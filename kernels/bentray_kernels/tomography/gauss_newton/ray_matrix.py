"""Products with the rays' sparse matrix; see ``gauss_newton.linearisation.Rows``.

Indices are unsigned: for signed ones numba tests whether they count from the end, which takes a third longer.
"""

from typing import NamedTuple

import numpy as np

from ...arrays import Float32s, Floats, Int32s, Ints
from ...compilation.compiled import kernel

LANES = np.uint64(4)


class RayMatrix(NamedTuple):
    """Rays as rows of a compressed sparse matrix A over the nodes; see ``linearisation.Rows``."""

    pointers: Ints
    columns: Int32s
    lengths: Float32s


@kernel
def project(matrix: RayMatrix, image: Floats, into: Floats) -> None:
    """Write A·image to ``into``."""
    for row in range(len(matrix.pointers) - 1):
        into[row] = _along(matrix, image, row)


@kernel
def back_project(matrix: RayMatrix, values: Floats, into: Floats) -> None:
    """Add Aᵀ·values to ``into``."""
    for row in range(len(matrix.pointers) - 1):
        _spread(matrix, values[row], row, into)


@kernel
def normal_product(matrix: RayMatrix, weights: Floats, image: Floats, into: Floats) -> None:
    """Add Aᵀ·W·A·image to ``into``, with one weight a row, reading each row once."""
    for row in range(len(matrix.pointers) - 1):
        value = weights[row] * _along(matrix, image, row)
        _spread(matrix, value, row, into)


@kernel(inline="always")
def _along(matrix: RayMatrix, image: Floats, row: int) -> float:
    """One row times an image."""
    columns, lengths = matrix.columns, matrix.lengths
    first, last = np.uint64(matrix.pointers[row]), np.uint64(matrix.pointers[row + 1])
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
def _spread(matrix: RayMatrix, value: float, row: int, into: Floats) -> None:
    """Add a value times one row to ``into``."""
    for k in range(np.uint64(matrix.pointers[row]), np.uint64(matrix.pointers[row + 1])):
        into[np.uint32(matrix.columns[k])] += matrix.lengths[k] * value
