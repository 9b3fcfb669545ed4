"""Slices or a volume where the settings leave it open: from the heights of the elements."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ..arrays import Floats
from .settings import Settings

# Elements whose heights differ by less than this, m, belong to one ring.
SAME_HEIGHT_M = 1e-5

# Arrays in space with fewer elements at each height, on average, are not stacked rings.
MIN_PER_HEIGHT = 8


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
    heights = distinct_heights(position_m).size
    return "volume" if heights > 1 and len(position_m) < MIN_PER_HEIGHT * heights else "slices"


def with_decomposition(position_m: Floats, settings: Settings) -> Settings:
    """The settings with the decomposition that is used: the given one, or that of the array."""
    if settings.decomposition is not None:
        return settings
    return settings.changed(decomposition=automatic_decomposition(position_m))
