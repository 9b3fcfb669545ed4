"""The pitch of an array: the distance of neighbouring elements."""

import numpy as np

from ..arrays import Floats

# Elements whose nearest neighbour is searched; the median of so many is that of all.
SEARCHED = 256


def element_pitch(position_m: Floats) -> float:
    """Median distance of the elements from their nearest neighbours, m.

    Args:
        position_m: (elements, 2 or 3), m.

    Returns:
        0 for a single element, for positions that are not finite, and where most elements share their place
        with another.
    """
    count = len(position_m)
    if count < 2 or not np.isfinite(position_m).all():
        return 0.0
    nearest = []
    for k in np.unique(np.linspace(0, count - 1, min(count, SEARCHED)).astype(int)):
        square = ((position_m - position_m[k]) ** 2).sum(axis=1)
        square[k] = np.inf
        nearest.append(square.min())
    return float(np.sqrt(np.median(nearest)))
