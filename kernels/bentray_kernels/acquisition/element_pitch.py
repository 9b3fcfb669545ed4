"""The pitch of an array: the distance of neighbouring elements."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from ..arrays import Floats


def element_pitch(position_m: Floats) -> float:
    """Median distance of the elements from their nearest neighbours, m.

    Args:
        position_m: (elements, 2 or 3), m.

    Returns:
        0 for a single element, for positions that are not finite, and where most elements share their place
        with another.
    """
    if len(position_m) < 2 or not np.isfinite(position_m).all():
        return 0.0
    distance, _ = KDTree(position_m).query(position_m, k=2)
    return float(np.median(distance[:, 1]))
