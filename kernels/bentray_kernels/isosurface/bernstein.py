"""The Bernstein-Bézier form of a cell: the convex hull of its coefficients bounds the values of the cell."""

import math

from ..arrays import Floats
from ..compilation.compiled import kernel

# Only its length is used. That of a tuple is part of the type: loops over it are unrolled, in a kernel for
# each length. That of an array is not.
Length = tuple[int, ...] | Floats


def length(count: int) -> tuple[int, ...]:
    """A tuple of that length."""
    return (0,) * count


@kernel(inline="always")
def contract(
    nodes: Floats,
    x: Floats,
    y: Floats,
    z: Floats,
    across: Length,
    rows: Length,
    first: Floats,
    second: Floats,
    result: Floats,
) -> None:
    """Σ x[a, p]·y[b, q]·z[c, r]·nodes[p, q, r] for all a, b, c.

    Args:
        nodes: (n³,) coefficients of the cell, C order.
        x, y, z: (m, n) Bernstein coefficients of the weights along each axis.
        across: n.
        rows: m.
        first: (m·n²,) scratch.
        second: (m²·n,) scratch.
        result: (m³,), filled, C order.
    """
    n, m = len(across), len(rows)
    for a in range(m):
        for rest in range(n * n):
            total = 0.0
            for p in range(n):
                total += x[a, p] * nodes[p * n * n + rest]
            first[a * n * n + rest] = total
    for a in range(m):
        for b in range(m):
            for r in range(n):
                total = 0.0
                for q in range(n):
                    total += y[b, q] * first[(a * n + q) * n + r]
                second[(a * m + b) * n + r] = total
    for ab in range(m * m):
        for c in range(m):
            total = 0.0
            for r in range(n):
                total += z[c, r] * second[ab * n + r]
            result[ab * m + c] = total


@kernel(inline="always")
def hull(control: Floats) -> tuple[float, float]:
    """Least and greatest Bernstein coefficient."""
    low, high = control[0], control[0]
    for k in range(1, len(control)):
        low, high = min(low, control[k]), max(high, control[k])
    return low, high


@kernel(inline="always")
def bend_bound(
    nodes: Floats,
    slope: Floats,
    bend: Floats,
    across: Length,
    total: float,
    line: Floats,
) -> float:
    """Upper bound of |d²f/ds²| along any line of unit direction within the cell, unit of f per node².

    It is the Frobenius norm of bounds of the Hessian's entries. The axes an entry does not differentiate only
    average, up to the sum of absolute weights.

    Args:
        nodes: (n³,) coefficients, C order.
        slope, bend: (rows, n) Bernstein coefficients of the weights' derivatives.
        across: n.
        total: upper bound of the sum of absolute weights along an axis.
        line: (n,) scratch.
    """
    n = len(across)
    square = n * n
    norm = 0.0
    for axis in range(3):
        # Along an axis, every line of nodes parallel to it.
        step = square if axis == 0 else (n if axis == 1 else 1)
        pure = 0.0
        for other in range(square):
            if axis == 0:
                start = other
            elif axis == 1:
                start = (other // n) * square + other % n
            else:
                start = other * n
            for a in range(len(bend)):
                curved = 0.0
                for p in range(n):
                    curved += bend[a, p] * nodes[start + p * step]
                pure = max(pure, abs(curved))
        norm += (pure * total * total) ** 2
        # Across it, every plane of nodes perpendicular to it.
        row = n if axis == 0 else square
        column = n if axis == 2 else 1
        mixed = 0.0
        for plane in range(n):
            for a in range(len(slope)):
                for q in range(n):
                    sloped = 0.0
                    for p in range(n):
                        sloped += slope[a, p] * nodes[plane * step + p * row + q * column]
                    line[q] = sloped
                for b in range(len(slope)):
                    twisted = 0.0
                    for q in range(n):
                        twisted += slope[b, q] * line[q]
                    mixed = max(mixed, abs(twisted))
        norm += 2.0 * (mixed * total) ** 2
    return math.sqrt(norm)
