"""B-spline prefilter: coefficients of the interpolating or smoothing spline of a grid."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.ndimage import correlate1d

from ..arrays import Floats, refuse_mask
from ..compilation.compiled import kernel
from ..errors import InvalidInput
from ..requests.rendering_limits import MAX_SMOOTHING
from .filters import bspline

# Lines filtered together: whole vectors, and few enough to stay in the first-level cache.
LOCKSTEP = 32


def prefilter(values: ArrayLike, order: int, smoothing: float = 0.0) -> Floats:
    """B-spline coefficients along all axes of a grid with mirrored boundaries.

    Along each axis the spline g of order n with these coefficients minimises, over all splines of that order,
    Σ (f_k − g(k))² + λ ∫ (dᵐg/dxᵐ)² dx with m = ⌊(n + 1)/2⌋, over the infinite mirrored data; for λ = 0 it
    interpolates the nodes. For odd n it is the smoothing spline of Unser, Aldroubi & Eden
    (1993, part II), the minimum over all functions; for n = 2 the penalty is on the slope, for n = 4 on the
    curvature as for n = 3, for n = 6 as for n = 5. Axes are filtered in turn (dissertation, 3.2.3).

    Args:
        values: (x[, y[, z]]), any unit. An axis of one node is not changed.
        order: n, 1 to 6; 1 without smoothing changes nothing.
        smoothing: λ, 0 to 1e6, in nodes to the power 2m − 1.

    Returns:
        The shape of ``values``, C order.

    Raises:
        InvalidInput: for another order or smoothing.
    """
    refuse_mask("values", values)
    if order not in range(1, 7):
        raise InvalidInput("order", order, "a whole number from 1 to 6")
    if not 0.0 <= smoothing <= MAX_SMOOTHING:
        raise InvalidInput("smoothing", smoothing, f"a number from 0 to {MAX_SMOOTHING:g}")
    filtered = np.array(values, dtype=np.float64, order="C")
    numerator, denominator = symbols(int(order), smoothing)
    for axis, n in enumerate(filtered.shape):
        if n == 1 or len(denominator) == 1:
            continue
        if len(numerator) > 1:
            filtered = correlate1d(filtered, numerator, axis, mode="mirror")
        lines = filtered.reshape(math.prod(filtered.shape[:axis]), n, -1)
        # Contiguous lines are also processed together.
        _solve(lines if lines.shape[2] > 1 else lines.transpose(2, 1, 0), *_factors(_band(denominator, n)))
    return filtered


def symbols(order: int, smoothing: float) -> tuple[Floats, Floats]:
    """The prefilter's transfer function, numerator(z) / denominator(z).

    With b the B-spline sampled at the nodes and δ = (−1, 2, −1), the normal equations of the minimum are
    bₙ * (bₙ * c − f) + λ δᵐ * b₂₍ₙ₋ₘ₎₊₁ * c = 0: the m-th derivative is a spline of order n − m, and the
    product of two such B-splines integrates to a sampled one. For odd n, a factor bₙ cancels.

    Returns:
        Two symmetric kernels of odd length, the middle one at z⁰.
    """
    sampled = sampled_bspline(order)
    if smoothing == 0.0:
        return np.ones(1), sampled
    m = (order + 1) // 2
    roughness = np.array([smoothing])
    for _ in range(m):
        roughness = np.convolve(roughness, [-1.0, 2.0, -1.0])
    if order % 2 == 1:
        return np.ones(1), _sum(sampled, roughness)
    roughness = np.convolve(roughness, sampled_bspline(2 * (order - m) + 1))
    return sampled, _sum(np.convolve(sampled, sampled), roughness)


@cache
def sampled_bspline(order: int) -> Floats:
    """The B-spline of that order at the nodes that it reaches, from its left to its right."""
    made = bspline(order)
    at_a_node = made.shift ** np.arange(made.value.shape[1])
    sampled = np.asarray(made.value @ at_a_node)[: 2 * made.before + 1]
    sampled.setflags(write=False)
    return sampled


def _sum(a: Floats, b: Floats) -> Floats:
    """Sum of two symmetric kernels, aligned at their centres."""
    reach = max(len(a), len(b)) // 2
    return np.pad(a, reach - len(a) // 2) + np.pad(b, reach - len(b) // 2)


@kernel
def _band(symmetric: Floats, n: int) -> Floats:
    """Convolving n mirrored nodes, as a matrix; its first and last row are halved, which makes it symmetric.

    Returns:
        (n, reach + 1), the diagonal and the entries to its right.
    """
    reach, period = len(symmetric) // 2, 2 * n - 2
    band = np.zeros((n, reach + 1))
    for i in range(n):
        share = 0.5 if i == 0 or i == n - 1 else 1.0
        for step in range(-reach, reach + 1):
            j = abs(i + step) % period
            j = min(j, period - j)
            if j >= i:
                band[i, j - i] += share * symmetric[reach + step]
    return band


@kernel
def _factors(band: Floats) -> tuple[Floats, Floats]:
    """The matrix as L·D·Lᵀ; it is positive definite, so that no pivoting is needed.

    Away from the boundary the rows of L converge to the recursive filter of Unser et al.; at the boundary
    they contain its exact initial values, also for lines shorter than the filter.

    Returns:
        (n, reach): L to the left of its diagonal, the nearest first; (n,): 1 / D.
    """
    n, reach = band.shape[0], band.shape[1] - 1
    lower, pivots = np.zeros((n, reach)), np.zeros(n)
    for i in range(n):
        for q in range(min(i, reach), 0, -1):
            j = i - q
            entry = band[j, q]
            for p in range(q + 1, min(i, reach) + 1):
                entry -= lower[i, p - 1] * lower[j, p - q - 1] * pivots[i - p]
            lower[i, q - 1] = entry / pivots[j]
        pivots[i] = band[i, 0]
        for q in range(1, min(i, reach) + 1):
            pivots[i] -= lower[i, q - 1] ** 2 * pivots[i - q]
    return lower, 1.0 / pivots


@kernel
def _solve(lines: Floats, lower: Floats, inverse: Floats) -> None:
    """Along the middle axis of (outer, n, inner), in place; several lines in lockstep."""
    outer, n, inner = lines.shape
    reach = lower.shape[1]
    block = np.zeros((n, LOCKSTEP))
    for o in range(outer):
        for first in range(0, inner, LOCKSTEP):
            width = min(LOCKSTEP, inner - first)
            for k in range(n):
                share = 0.5 if k == 0 or k == n - 1 else 1.0
                for x in range(width):
                    block[k, x] = share * lines[o, k, first + x]
            for k in range(n):
                for q in range(min(k, reach)):
                    for x in range(LOCKSTEP):
                        block[k, x] -= lower[k, q] * block[k - 1 - q, x]
            for k in range(n - 1, -1, -1):
                for x in range(LOCKSTEP):
                    block[k, x] *= inverse[k]
                for q in range(min(n - 1 - k, reach)):
                    for x in range(LOCKSTEP):
                        block[k, x] -= lower[k + 1 + q, q] * block[k + 1 + q, x]
            for k in range(n):
                for x in range(width):
                    lines[o, k, first + x] = block[k, x]
