"""The Bernstein-Bézier form of a cell: the hull of its coefficients holds every value of the cell."""

from __future__ import annotations

import math

from ..arrays import Floats
from ..compiled import kernel


@kernel(inline="always")
def contract(
    nodes: Floats, x: Floats, y: Floats, z: Floats, first: Floats, second: Floats, result: Floats
) -> int:
    """Σ x[a, p]·y[b, q]·z[c, r]·nodes[p, q, r] for all a, b, c.

    Args:
        nodes: (n³,) coefficients of the cell, C order.
        x, y, z: (rows, n) Bernstein coefficients of the weights along each axis.
        first: scratch, at least rows(x)·n².
        second: scratch, at least rows(x)·rows(y)·n.
        result: (…,), filled from its start, C order.

    Returns:
        How many entries were written.
    """
    n = x.shape[1]
    square = n * n
    for a in range(len(x)):
        for rest in range(square):
            total = 0.0
            for p in range(n):
                total += x[a, p] * nodes[p * square + rest]
            first[a * square + rest] = total
    for a in range(len(x)):
        for b in range(len(y)):
            for r in range(n):
                total = 0.0
                for q in range(n):
                    total += y[b, q] * first[a * square + q * n + r]
                second[(a * len(y) + b) * n + r] = total
    rows = len(x) * len(y)
    for ab in range(rows):
        for c in range(len(z)):
            total = 0.0
            for r in range(n):
                total += z[c, r] * second[ab * n + r]
            result[ab * len(z) + c] = total
    return rows * len(z)


@kernel(inline="always")
def hull(control: Floats, count: int) -> tuple[float, float]:
    """Least and greatest of the first ``count`` Bernstein coefficients."""
    low, high = control[0], control[0]
    for k in range(1, count):
        low, high = min(low, control[k]), max(high, control[k])
    return low, high


@kernel(inline="always")
def bend_bound(
    nodes: Floats,
    slope: Floats,
    bend: Floats,
    total: float,
    line: Floats,
) -> float:
    """Upper bound of |d²f/ds²| along any line of unit direction within the cell, unit of f per node².

    It is the Frobenius norm of bounds of the Hessian's entries. The axes an entry does not differentiate only
    average, up to the sum of absolute weights.

    Args:
        nodes: (n³,) coefficients, C order.
        slope, bend: (rows, n) Bernstein coefficients of the weights' derivatives.
        total: upper bound of the sum of absolute weights along an axis.
        line: (n,) scratch.
    """
    n = bend.shape[1]
    square = n * n
    norm = 0.0
    for axis in range(3):
        # Along an axis, every line of nodes parallel to it.
        step = square if axis == 0 else (n if axis == 1 else 1)
        pure = 0.0
        for across in range(square):
            start = (
                across if axis == 0 else ((across // n) * square + across % n if axis == 1 else across * n)
            )
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
