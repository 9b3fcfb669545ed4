"""Continuous cell classification: the exact range of a cell, from its critical points (4.3.2.2)."""

import numpy as np

from ..arrays import Floats
from ..compilation.compiled import kernel
from .bernstein import contract, hull

# Halvings along each axis: the hull approaches a critical value as the square of the width.
HALVINGS = 18

# Relative to the width of the cell's hull; below the resolution of float32, in which ranges are stored.
TOLERANCE = 1e-8

# Of the values: what rounding leaves in a cell where the field is constant.
ROUNDING = 1e-13


@kernel
def exact_range(nodes: Floats, value: Floats, pieces: int) -> tuple[float, float]:
    """Least and greatest value of a cell to 1e-8 of its hull, never short of them.

    The dissertation solves for the stationary points of the cell, its faces and its edges. Here the Bernstein
    form is halved wherever its hull promises more than a value already attained at a corner, which ends at
    the same critical points, for every order, and cannot overlook one.

    Args:
        nodes: (n³,) coefficients, C order.
        value: (pieces·(degree + 1), n) Bernstein coefficients of the weights.
        pieces: polynomial pieces along each axis.
    """
    n, m = value.shape[1], len(value) // pieces
    size = m * m * m
    first, second = np.empty(m * n * n), np.empty(m * m * n)
    stack = np.empty((3 * HALVINGS + 2, size))
    depths = np.empty(len(stack), dtype=np.int64)
    low, high = np.inf, -np.inf
    room = 0.0
    outer_low, outer_high = np.inf, -np.inf
    for piece in range(pieces**3):
        p, q, r = piece // pieces**2, (piece // pieces) % pieces, piece % pieces
        x, y, z = value[p * m : p * m + m], value[q * m : q * m + m], value[r * m : r * m + m]
        contract(nodes, x, y, z, x[0], x[:, 0], first, second, stack[0])
        depths[0] = 0
        top = 1
        while top > 0:
            top -= 1
            control, depth = stack[top], depths[top]
            for corner in range(8):
                at = (m - 1) * ((corner >> 2) * m * m + ((corner >> 1) & 1) * m + (corner & 1))
                low, high = min(low, control[at]), max(high, control[at])
            least, most = hull(control)
            if depth == 0:
                room = TOLERANCE * (most - least) + ROUNDING * max(abs(least), abs(most))
            if depth == 3 * HALVINGS or (least >= low - room and most <= high + room):
                outer_low, outer_high = min(outer_low, least), max(outer_high, most)
                continue
            _halve(control, stack[top + 1], m, depth % 3)
            depths[top] = depths[top + 1] = depth + 1
            top += 2
    return min(low, outer_low), max(high, outer_high)


@kernel(inline="always")
def _halve(control: Floats, upper: Floats, m: int, axis: int) -> None:
    """De Casteljau's algorithm at ½ along an axis: the lower half stays in ``control``."""
    step = m * m if axis == 0 else (m if axis == 1 else 1)
    for line in range(m * m):
        if axis == 0:
            start = line
        elif axis == 1:
            start = (line // m) * m * m + line % m
        else:
            start = line * m
        upper[start + (m - 1) * step] = control[start + (m - 1) * step]
        for level in range(1, m):
            for k in range(m - 1, level - 1, -1):
                control[start + k * step] = 0.5 * (
                    control[start + (k - 1) * step] + control[start + k * step]
                )
            upper[start + (m - 1 - level) * step] = control[start + (m - 1) * step]
