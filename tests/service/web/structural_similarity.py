"""Structural similarity of two pictures."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter

# Wang et al., Image quality assessment: from error visibility to structural similarity, 2004.
SIGMA, CUT, K1, K2, RANGE = 1.5, 3.5, 0.01, 0.03, 255.0
GREY = (0.299, 0.587, 0.114)


def structural_similarity(image: ArrayLike, other: ArrayLike) -> float:
    """Mean SSIM of the grey values of two pictures (rows, columns, 3), 8-bit RGB."""
    a, b = (np.asarray(picture, dtype=np.float64) @ GREY for picture in (image, other))
    mean_a, mean_b = _blurred(a), _blurred(b)
    var_a, var_b = _blurred(a * a) - mean_a**2, _blurred(b * b) - mean_b**2
    both = _blurred(a * b) - mean_a * mean_b
    first, second = (K1 * RANGE) ** 2, (K2 * RANGE) ** 2
    shares = (2.0 * mean_a * mean_b + first) * (2.0 * both + second)
    return float((shares / ((mean_a**2 + mean_b**2 + first) * (var_a + var_b + second))).mean())


def _blurred(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(gaussian_filter(values, SIGMA, truncate=CUT))
