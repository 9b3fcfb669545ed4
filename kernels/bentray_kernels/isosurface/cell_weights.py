"""Weights of a filter within one cell: nodes, polynomials, ranges and Bernstein form."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial

from ..arrays import Floats
from ..splines.filters import Filter


@dataclass(frozen=True)
class CellWeights:
    """The weights along one axis over the cell between the nodes i and i + 1.

    B-splines of even order have a knot in the middle of that cell and so two polynomial pieces there; the
    cell stays the one between nodes, and each bound takes both pieces in.

    Attributes:
        first: the nodes acting on the cell are i + first … i + first + nodes − 1.
        margin: how many more on either side reach the closed cell, with weight 0 (section 4.3.2.1).
        powers: (pieces, nodes, degree + 1) coefficients of rising powers of u, 0 ≤ u ≤ 1 within each piece.
    """

    first: int
    margin: int
    powers: Floats

    @property
    def nodes(self) -> int:
        """Nodes that act on a cell along one axis."""
        return int(self.powers.shape[1])

    @property
    def degree(self) -> int:
        """Degree of the pieces."""
        return int(self.powers.shape[2]) - 1

    def control(self, derivative: int = 0) -> Floats:
        """Bernstein coefficients of the pieces or their derivatives, (pieces·(degree + 1), nodes).

        Args:
            derivative: 0, 1 or 2, per node of the grid; the degree falls with it, never below 0.
        """
        rows = []
        for piece in self.powers:
            derived = polynomial.polyder(piece, derivative, axis=1) * float(len(self.powers)) ** derivative
            rows.append(_bernstein(derived.shape[1] - 1) @ derived.T)
        return np.ascontiguousarray(np.vstack(rows))

    def total(self) -> float:
        """The largest sum of absolute weights: 1 where none is negative, 1.25 for Catmull-Rom."""
        # No weight changes its sign within a piece, so the sign in the middle is the sign.
        signs = np.sign(polynomial.polyval(0.5, self.powers.transpose(2, 0, 1)))
        sums = (signs[:, :, None] * self.powers).sum(axis=1)
        return max(1.0, *(float(_extremes(piece, 0.0, 1.0).max()) for piece in sums))

    def ranges(self, divisions: int) -> tuple[Floats, Floats]:
        """Least and greatest weight of each node in each of equal parts of the cell, (divisions, nodes)."""
        low = np.full((divisions, self.nodes), np.inf)
        high = np.full((divisions, self.nodes), -np.inf)
        for k in range(divisions):
            for number, piece in enumerate(self.powers):
                start, stop = np.clip(np.array([k, k + 1]) / divisions * len(self.powers) - number, 0.0, 1.0)
                if start == stop:
                    continue
                for node, weight in enumerate(piece):
                    values = _extremes(weight, start, stop)
                    low[k, node] = min(low[k, node], values.min())
                    high[k, node] = max(high[k, node], values.max())
        # Rounding leaves ±1e-17 where a B-spline is 0; its sign would turn a lower bound into none.
        low[np.abs(low) < 1e-15] = 0.0
        return low, high


def cell_weights(chosen: Filter) -> CellWeights:
    """The weights of a filter's value over a cell."""
    degree = int(np.flatnonzero(np.abs(chosen.value).max(axis=0))[-1])
    whole = chosen.value[:, : degree + 1]
    if chosen.shift == 0.0:
        pieces = whole[None]
    else:
        none = np.zeros((1, degree + 1))
        before_knot, after_knot = _substituted(whole, 0.5, 0.5), _substituted(whole, 0.0, 0.5)
        pieces = np.stack([np.vstack([before_knot, none]), np.vstack([none, after_knot])])
    used = np.flatnonzero(np.abs(pieces).max(axis=(0, 2)))
    nonzero = pieces[:, used[0] : used[-1] + 1]
    return CellWeights(int(used[0]) - chosen.before, 0 if chosen.shift else 1, np.ascontiguousarray(nonzero))


def _substituted(powers: Floats, start: float, width: float) -> Floats:
    """The polynomials of t = start + width·u by rising powers of u."""
    degree = powers.shape[1] - 1
    matrix = np.zeros((degree + 1, degree + 1))
    for p in range(degree + 1):
        for q in range(p + 1):
            matrix[p, q] = math.comb(p, q) * start ** (p - q) * width**q
    return powers @ matrix


def _extremes(weight: Floats, start: float, stop: float) -> Floats:
    """Values at both ends and where the slope is zero between them."""
    flat = np.real(polynomial.polyroots(polynomial.polytrim(polynomial.polyder(weight), 1e-14)))
    points = np.concatenate([[start, stop], flat[(flat > start) & (flat < stop)]])
    return np.asarray(polynomial.polyval(points, weight))


def _bernstein(degree: int) -> Floats:
    """The matrix from rising powers to Bernstein coefficients: b_j = Σ_p C(j, p)/C(n, p) a_p."""
    matrix = [[math.comb(j, p) / math.comb(degree, p) for p in range(degree + 1)] for j in range(degree + 1)]
    return np.array(matrix)
