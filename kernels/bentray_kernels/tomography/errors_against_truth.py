"""How far a reconstructed image is from the truth: mean errors, correlation and structural similarity."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import binary_erosion, uniform_filter

from ..errors import InvalidInput

# Nodes along a side of the windows of the structural similarity, and its constants (Wang et al., 2004).
WINDOW, K1, K2 = 7, 0.01, 0.03


def mean_absolute_error(
    image: ArrayLike, truth: ArrayLike, region: ArrayLike, value_range: float = 1.0
) -> float:
    """Mean of |image − truth| over a region, as a part of the phantom's range (chapter 6.4).

    Args:
        image, truth: one shape, one unit.
        region: booleans of that shape: where to look.
        value_range: highest minus lowest value of the phantom, in the same unit; 1: the error in this unit.

    Raises:
        InvalidInput: for shapes that differ, an empty region or a range that is not positive.
    """
    _check_range(value_range)
    a, b, where = _checked(image, truth, region)
    return float(np.abs(a[where] - b[where]).mean() / value_range)


def rmse(image: ArrayLike, truth: ArrayLike, region: ArrayLike) -> float:
    """Root mean square of image − truth over a region, in the images' unit; see ``mean_absolute_error``."""
    a, b, where = _checked(image, truth, region)
    return float(np.sqrt(((a[where] - b[where]) ** 2).mean()))


def correlation(image: ArrayLike, truth: ArrayLike, region: ArrayLike) -> float:
    """Pearson's correlation coefficient (PCC) of two images over a region; NaN if one is constant there."""
    a, b, where = _checked(image, truth, region)
    first, second = (one[where] - one[where].mean() for one in (a, b))
    norm = math.sqrt(float(first @ first) * float(second @ second))
    return float(first @ second) / norm if norm > 0.0 else math.nan


def structural_similarity(image: ArrayLike, truth: ArrayLike, region: ArrayLike, value_range: float) -> float:
    """Structural similarity (SSIM), the mean over all windows of 7 × 7 nodes that lie in a region.

    Uniform windows and sample covariances, as the defaults of scikit-image; of a volume windows in its slices
    (z = constant).

    Args:
        image, truth: (nx, ny[, nz]), one unit; anything outside the region.
        region: booleans of that shape.
        value_range: of the truth, highest minus lowest value.

    Returns:
        At most 1, for equal images; NaN if the region holds no window.

    Raises:
        InvalidInput: as ``mean_absolute_error``.

    Source: Wang, Bovik, Sheikh, Simoncelli, IEEE Trans. Image Process. 13(4), 2004, equation 13.
    """
    _check_range(value_range)
    a, b, where = _checked(image, truth, region)
    window = (WINDOW, WINDOW) + (1,) * (where.ndim - 2)
    centres = binary_erosion(where, np.ones(window, np.bool_))
    if not centres.any():
        return math.nan
    # Differences from one value: squares of speeds would lose digits. Nodes outside are in no window.
    offset = float(b[where].mean())
    x, y = (np.where(where, one - offset, 0.0) for one in (a, b))
    mean_x, mean_y = (uniform_filter(one, window) for one in (x, y))
    sample = WINDOW**2 / (WINDOW**2 - 1.0)
    variance_x = sample * (uniform_filter(x * x, window) - mean_x * mean_x)
    variance_y = sample * (uniform_filter(y * y, window) - mean_y * mean_y)
    covariance = sample * (uniform_filter(x * y, window) - mean_x * mean_y)
    mean_x, mean_y = mean_x + offset, mean_y + offset
    c1, c2 = (K1 * value_range) ** 2, (K2 * value_range) ** 2
    similarity = (2.0 * mean_x * mean_y + c1) * (2.0 * covariance + c2)
    similarity /= (mean_x**2 + mean_y**2 + c1) * (variance_x + variance_y + c2)
    return float(similarity[centres].mean())


def _check_range(value_range: float) -> None:
    if not value_range > 0.0:
        raise InvalidInput("value_range", value_range, "a range > 0")


def _checked(
    image: ArrayLike, truth: ArrayLike, region: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
    a, b, where = np.asarray(image, np.float64), np.asarray(truth, np.float64), np.asarray(region, np.bool_)
    if a.shape != b.shape or where.shape != a.shape:
        raise InvalidInput(
            "region", f"shapes {a.shape}, {b.shape}, {where.shape}", "image, truth and region of one shape"
        )
    if not where.any():
        raise InvalidInput("region", "no node", "at least one node")
    return a, b, where
