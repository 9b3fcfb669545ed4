"""Cells of a table that allow linear interpolation: those whose 16 entries agree.

Entries agree when all of them meet the mesh, and at about the same distance.
"""

import numpy as np
from numpy.typing import NDArray

from ...compilation.compiled import kernel
from ...compilation.float32 import real
from .outer_field import OuterField

# Entries agree if their positions differ by at most this many sample distances.
APART = 3.0

# State of the 16 entries: none hits the mesh; all do, and agree; anything else.
NONE, AGREE, MIXED = 0, 1, 2


def agreement(field: OuterField) -> NDArray[np.uint8]:
    """``NONE``, ``AGREE`` or ``MIXED`` for the 16 entries from each one on, (6n², 6n²) uint8.

    The last samples of each face of the cube have no following ones; no lookup uses them.
    """
    agreeing = np.full(field.faces.shape, MIXED, dtype=np.uint8)
    _compare(field, real(APART / field.samples), agreeing)
    return agreeing


@kernel
def _compare(field: OuterField, apart: float, known: NDArray[np.uint8]) -> None:
    n = field.samples
    row = 6 * n
    for entry in range(len(known) - row):
        if entry % n == n - 1:
            continue
        for exit_ in range(len(known) - row):
            if exit_ % n == n - 1:
                continue
            count, low, high = 0, real(2.0), real(-1.0)
            for i in (entry, entry + 1, entry + row, entry + row + 1):
                for j in (exit_, exit_ + 1, exit_ + row, exit_ + row + 1):
                    count += field.faces[i, j] >= 0
                    low, high = min(low, field.fractions[i, j]), max(high, field.fractions[i, j])
            if count == 0:
                known[entry, exit_] = NONE
            elif count == 16 and high - low <= apart:
                known[entry, exit_] = AGREE
