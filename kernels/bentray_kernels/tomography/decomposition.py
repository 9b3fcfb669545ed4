"""Slices or a volume where the settings leave it open: from the heights of the elements."""

from typing import Literal

import numpy as np

from ..arrays import Floats
from .settings import Settings

# Elements whose heights differ by less than this, m, belong to one ring.
SAME_HEIGHT_M = 1e-5

# A ring has at least so many elements, and no gap as wide as this seen from the middle, degrees.
MIN_PER_HEIGHT, MAX_GAP_DEG = 8, 60.0


def distinct_heights(position_m: Floats) -> Floats:
    """Heights of the rings of an array in space, rising, m; each that of the lowest element of its ring.

    Args:
        position_m: (elements, 3), m.
    """
    z = np.sort(position_m[:, 2])
    return np.asarray(z[np.concatenate(([True], np.diff(z) > SAME_HEIGHT_M))])


def automatic_decomposition(position_m: Floats) -> Literal["slices", "volume"]:
    """``volume`` for an array in space that does not consist of rings at several heights, else ``slices``.

    Args:
        position_m: (elements, 2 or 3), m.
    """
    if position_m.shape[1] == 2:
        return "slices"
    heights = distinct_heights(position_m)
    if heights.size == 1:
        return "slices"
    if len(position_m) < MIN_PER_HEIGHT * heights.size:
        return "volume"
    ring = np.searchsorted(heights, position_m[:, 2], side="right") - 1
    x, y = (position_m[:, :2] - 0.5 * (position_m[:, :2].min(axis=0) + position_m[:, :2].max(axis=0))).T
    angle = np.degrees(np.arctan2(y, x))
    gaps = [_widest_gap(angle[ring == k]) for k in range(heights.size)]
    return "slices" if np.median(gaps) < MAX_GAP_DEG else "volume"


def _widest_gap(angle_deg: Floats) -> float:
    """Widest gap between directions, degrees."""
    rising = np.sort(angle_deg)
    return float(np.diff(np.append(rising, rising[0] + 360.0)).max())


def decomposition_of(position_m: Floats, settings: Settings) -> Literal["slices", "volume"]:
    """The decomposition that is used: that of the settings, or that of the array."""
    return settings.decomposition or automatic_decomposition(position_m)
