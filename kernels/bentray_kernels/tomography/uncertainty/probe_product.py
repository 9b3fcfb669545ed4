"""Product of the normal matrix of rays with several probes at once: each row of the matrix is read once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats, Ints
from ...compilation.compiled import kernel

# Probes of one product; a constant, so that the innermost loops are vectorised.
LANES = 8


@kernel
def normal_products(
    pointers: Ints,
    columns: NDArray[np.int32],
    lengths: NDArray[np.float32],
    weights: Floats,
    probes: Floats,
    into: Floats,
) -> None:
    """Add Aᵀ·W·A·probe to ``into`` for each probe.

    Args:
        pointers, columns, lengths: the matrix A; see ``gauss_newton.linearisation.Rows``.
        weights: (rays,), the diagonal of W.
        probes: (nodes, LANES); into: the same shape.
    """
    sums = np.empty(LANES)
    for row in range(len(pointers) - 1):
        first, last = np.uint64(pointers[row]), np.uint64(pointers[row + 1])
        for lane in range(LANES):
            sums[lane] = 0.0
        for k in range(first, last):
            node, length = np.uint32(columns[k]), lengths[k]
            for lane in range(LANES):
                sums[lane] += length * probes[node, lane]
        for lane in range(LANES):
            sums[lane] *= weights[row]
        for k in range(first, last):
            node, length = np.uint32(columns[k]), lengths[k]
            for lane in range(LANES):
                into[node, lane] += length * sums[lane]


@kernel
def back_projections(
    pointers: Ints,
    columns: NDArray[np.int32],
    lengths: NDArray[np.float32],
    values: Floats,
    into: Floats,
) -> None:
    """Add Aᵀ·values to ``into`` for each probe.

    Args:
        pointers, columns, lengths: as ``normal_products`` takes them.
        values: (rays, LANES); into: (nodes, LANES).
    """
    for row in range(len(pointers) - 1):
        for k in range(np.uint64(pointers[row]), np.uint64(pointers[row + 1])):
            node, length = np.uint32(columns[k]), lengths[k]
            for lane in range(LANES):
                into[node, lane] += length * values[row, lane]
