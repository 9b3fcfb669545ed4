"""Product of the normal matrix of rays with several probes at once: each row of the matrix is read once."""

import numpy as np

from ...arrays import Floats
from ...compilation.compiled import kernel
from ..gauss_newton.ray_matrix import RayMatrix

# Probes of one product; a constant, so that the innermost loops are vectorised.
LANES = 8


@kernel
def normal_products(matrix: RayMatrix, weights: Floats, probes: Floats, into: Floats) -> None:
    """Add Aᵀ·W·A·probe to ``into`` for each probe.

    Args:
        matrix: A.
        weights: (rays,), the diagonal of W.
        probes: (nodes, LANES); into: the same shape.
    """
    pointers, columns, lengths = matrix
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
def back_projections(matrix: RayMatrix, values: Floats, into: Floats) -> None:
    """Add Aᵀ·values to ``into`` for each probe.

    Args:
        matrix: A.
        values: (rays, LANES); into: (nodes, LANES).
    """
    pointers, columns, lengths = matrix
    for row in range(len(pointers) - 1):
        for k in range(np.uint64(pointers[row]), np.uint64(pointers[row + 1])):
            node, length = np.uint32(columns[k]), lengths[k]
            for lane in range(LANES):
                into[node, lane] += length * values[row, lane]
