"""How far a reconstructed image is from the truth."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InvalidInput


def mean_absolute_error(image: ArrayLike, truth: ArrayLike, region: ArrayLike, value_range: float) -> float:
    """Mean of |image − truth| over a region, as a part of the phantom's range (chapter 6.4).

    Args:
        image, truth: one shape, one unit.
        region: booleans of that shape: where to look.
        value_range: highest minus lowest value of the phantom, in the same unit.

    Raises:
        InvalidInput: for shapes that differ, an empty region or a range that is not positive.
    """
    if not value_range > 0.0:
        raise InvalidInput("value_range", value_range, "a range > 0")
    return float(np.abs(_difference(image, truth, region)).mean() / value_range)


def rmse(image: ArrayLike, truth: ArrayLike, region: ArrayLike) -> float:
    """Root mean square of image − truth over a region, in the images' unit; see ``mean_absolute_error``."""
    return float(np.sqrt((_difference(image, truth, region) ** 2).mean()))


def _difference(image: ArrayLike, truth: ArrayLike, region: ArrayLike) -> NDArray[np.float64]:
    a, b, where = np.asarray(image, np.float64), np.asarray(truth, np.float64), np.asarray(region, np.bool_)
    if a.shape != b.shape or where.shape != a.shape:
        raise InvalidInput(
            "region", f"shapes {a.shape}, {b.shape}, {where.shape}", "image, truth and region of one shape"
        )
    if not where.any():
        raise InvalidInput("region", "no node", "at least one node")
    return np.asarray(a[where] - b[where])
