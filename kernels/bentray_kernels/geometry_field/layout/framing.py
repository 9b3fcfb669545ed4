"""Rotation and scaling of a flat layout to fill the unit square."""

import numpy as np
from scipy.spatial import ConvexHull

from ...arrays import Floats

# Turns that are tried, of a quarter turn.
TURNS = 90


def in_unit_square(points: Floats) -> Floats:
    """This shape within [0, 1]²: turned to where its smallest upright square is smallest.

    Args:
        points: (vertices, 2), not all on one line.

    Returns:
        (vertices, 2); angles, orientation and ratios of lengths stay.
    """
    hull = points[ConvexHull(points).vertices]
    angles = np.linspace(0.0, 0.5 * np.pi, TURNS, endpoint=False)
    axes = (
        np.stack((np.cos(angles), -np.sin(angles)), axis=-1),
        np.stack((np.sin(angles), np.cos(angles)), axis=-1),
    )
    spans = [np.ptp(hull @ axis.T, axis=0) for axis in axes]
    best = int(np.argmin(np.maximum(*spans)))
    turned = points @ np.column_stack([axis[best] for axis in axes])
    low, high = turned.min(axis=0), turned.max(axis=0)
    # Rounding must not carry a corner out of the square.
    return np.asarray(np.clip((turned - 0.5 * (low + high)) / (high - low).max() + 0.5, 0.0, 1.0))
