"""Choice of the smoothing parameter λ by the discrepancy principle, and noise estimation."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import dctn
from scipy.optimize import brentq

from ..arrays import Floats, refuse_mask
from ..errors import InvalidInput
from ..requests.rendering_limits import MAX_SMOOTHING
from .prefilter import sampled_bspline, symbols

# Rounding to whole numbers leaves errors that are uniform over one step.
ROUNDING = 1.0 / math.sqrt(12.0)

# A normal distribution's median distance from its mean, in standard deviations.
MEDIAN_DEVIATION = 0.6745

MIN_SMOOTHING = 1e-9


def noise_of(volume: ArrayLike) -> float:
    """Standard deviation of a volume's noise, by the median of its finest differences.

    Second differences along every axis remove a smooth field and keep the noise (Donoho & Johnstone 1994).
    Integers have at least their rounding noise.

    Args:
        volume: (x[, y[, z]]), at least three nodes along each axis, any unit.

    Returns:
        In the volume's unit.

    Raises:
        InvalidInput: for fewer nodes.
    """
    refuse_mask("volume", volume)
    nodes = np.asarray(volume)
    if min(nodes.shape, default=0) < 3:
        raise InvalidInput("volume", f"shape {nodes.shape}", "at least three nodes along each axis")
    finest = nodes.astype(np.float64)
    for axis in range(nodes.ndim):
        finest = np.diff(finest, 2, axis) / math.sqrt(6.0)
    sigma = float(np.median(np.abs(finest))) / MEDIAN_DEVIATION
    return max(sigma, ROUNDING) if np.issubdtype(nodes.dtype, np.integer) else sigma


def smoothing_for_noise(volume: ArrayLike, order: int, sigma: float | None = None) -> float:
    """The λ for which the mean square residual of the smoothing spline equals the noise.

    Morozov's discrepancy principle. The mean is taken over the mirrored volume, in which outer
    nodes count half; there the cosine transform diagonalises the prefilter, so that no spline is computed.

    Args:
        volume: (x[, y[, z]]), finite, at least two nodes along each axis; three without sigma.
        order: of the B-spline, 2 to 6.
        sigma: standard deviation of the noise, in the volume's unit; by ``noise_of`` if unknown.
            For data rounded to whole numbers it is 1/√12.

    Returns:
        λ for ``Spline``: 0 where there is no noise, at most 1e6.

    Raises:
        InvalidInput: for a sigma that is not finite or below 0, another order, fewer nodes, and values that
            are not finite.
    """
    refuse_mask("volume", volume)
    if order not in range(2, 7):
        raise InvalidInput("order", order, "a whole number from 2 to 6")
    nodes = np.asarray(volume, dtype=np.float64)
    if min(nodes.shape, default=0) < 2:
        raise InvalidInput("volume", f"shape {nodes.shape}", "at least two nodes along each axis")
    if not np.isfinite(nodes).all():
        raise InvalidInput("volume", "values that are not finite", "finite values")
    sigma = noise_of(volume) if sigma is None else sigma
    if not 0.0 <= sigma < math.inf:
        raise InvalidInput("sigma", sigma, "a finite number >= 0")
    power = dctn(nodes - nodes.mean(), type=1) ** 2
    for axis, n in enumerate(nodes.shape):
        shares = np.full(n, 2.0)
        shares[0] = shares[-1] = 1.0
        power *= np.expand_dims(shares / (2.0 * n - 2.0) ** 2, [a for a in range(nodes.ndim) if a != axis])

    def excess(log_smoothing: float) -> float:
        passed = _passed(order, math.exp(log_smoothing), nodes.shape)
        return float((power * (1.0 - passed) ** 2).sum()) - sigma**2

    least, most = math.log(MIN_SMOOTHING), math.log(MAX_SMOOTHING)
    if excess(least) >= 0.0:
        return 0.0
    if excess(most) <= 0.0:
        return MAX_SMOOTHING
    return math.exp(brentq(excess, least, most, xtol=1e-6))


def response(symmetric: Floats, frequencies: Floats) -> Floats:
    """Fourier transform of a symmetric kernel on the nodes, its middle at 0; radians per node."""
    reach = len(symmetric) // 2
    offsets = np.arange(-reach, reach + 1)
    return np.asarray(np.cos(np.multiply.outer(frequencies, offsets)) @ symmetric)


def _passed(order: int, smoothing: float, shape: Sequence[int]) -> Floats:
    """Transfer function of the smoothing spline for each cosine of the volume."""
    numerator, denominator = symbols(order, smoothing)
    passed = np.ones(())
    for n in shape:
        frequencies = np.linspace(0.0, math.pi, n)
        along = response(sampled_bspline(order), frequencies) * response(numerator, frequencies)
        passed = np.multiply.outer(passed, along / response(denominator, frequencies))
    return passed
