"""Products with the rays' sparse matrix; see ``linearisation.Rows``."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..compiled import kernel


@kernel
def project(
    pointers: Ints, columns: NDArray[np.int32], lengths: NDArray[np.float32], image: Floats, into: Floats
) -> None:
    """Write A·image to ``into``."""
    for row in range(len(pointers) - 1):
        total = 0.0
        for k in range(pointers[row], pointers[row + 1]):
            total += lengths[k] * image[columns[k]]
        into[row] = total


@kernel
def back_project(
    pointers: Ints, columns: NDArray[np.int32], lengths: NDArray[np.float32], values: Floats, into: Floats
) -> None:
    """Add Aᵀ·values to ``into``."""
    for row in range(len(pointers) - 1):
        value = values[row]
        for k in range(pointers[row], pointers[row + 1]):
            into[columns[k]] += lengths[k] * value


@kernel
def normal_product(
    pointers: Ints,
    columns: NDArray[np.int32],
    lengths: NDArray[np.float32],
    image: Floats,
    into: Floats,
) -> None:
    """Add Aᵀ·A·image to ``into``, reading each row once."""
    for row in range(len(pointers) - 1):
        total = 0.0
        for k in range(pointers[row], pointers[row + 1]):
            total += lengths[k] * image[columns[k]]
        for k in range(pointers[row], pointers[row + 1]):
            into[columns[k]] += lengths[k] * total
