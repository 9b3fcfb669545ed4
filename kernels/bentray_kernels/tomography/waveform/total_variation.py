"""Total variation of an image and its slope: a prior for objects of flat parts with sharp edges."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats

# Speeds that differ by much less than this from node to node, m/s, count little.
FLAT_MPS = 2.0

# What an image is taken to have at least, a node, over ``FLAT_MPS``.
LEAST = 0.01


def variation(image: Floats, flat: float = FLAT_MPS) -> tuple[float, Floats]:
    """Sum of sqrt(|differences|^2 + flat^2) - flat over nodes, and its derivative by every node.

    Args:
        image: (nx, ny).
        flat: differences from node to node that are much smaller count by their square.

    Returns:
        The sum, and (nx, ny).
    """
    along, across = np.diff(image, axis=0)[:, :-1], np.diff(image, axis=1)[:-1]
    size = np.sqrt(along**2 + across**2 + flat**2)
    slope = np.zeros_like(image)
    slope[1:, :-1] += along / size
    slope[:-1, 1:] += across / size
    slope[:-1, :-1] -= (along + across) / size
    return float((size - flat).sum()), slope


def weight(image: Floats, size: float) -> float:
    """The factor that makes the total variation of an image as large as ``size``."""
    return size / max(variation(image)[0], LEAST * FLAT_MPS * image.size)
