"""Analytic fields over the cube from −1 to 1, and volumes sampled from them."""

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..errors import InvalidInput


class CubeField(Protocol):
    """A field with its gradient; the cube's faces lie at −1 and 1 along x, y and z, no unit."""

    def value(self, points: Floats) -> Floats:
        """At points (…, 3): (…,)."""
        ...

    def gradient(self, points: Floats) -> Floats:
        """At points (…, 3): (…, 3), per half edge of the cube."""
        ...


def sampled(field: CubeField, nodes: int) -> Floats:
    """The field at the nodes of a grid whose outer ones lie on the cube's faces.

    Args:
        field: what to sample.
        nodes: n along each axis, at least 2; node k lies at −1 + 2k/(n − 1).

    Returns:
        (n, n, n), axes x, y, z.

    Raises:
        InvalidInput: for fewer nodes.
    """
    if nodes < 2:
        raise InvalidInput("nodes", nodes, "a whole number >= 2")
    along = np.linspace(-1.0, 1.0, nodes)
    slabs = [field.value(np.stack(np.meshgrid(x, along, along, indexing="ij"), axis=-1)) for x in along]
    return np.concatenate(slabs)


def eight_bit(volume: Floats, low: float, high: float) -> NDArray[np.uint8]:
    """The volume in 256 steps: ``low`` becomes 0 and ``high`` 255, what lies between is rounded.

    Raises:
        InvalidInput: unless low < high.
    """
    if not low < high:
        raise InvalidInput("high", high, f"a number above low, {low}")
    return np.rint(np.clip((volume - low) / (high - low), 0.0, 1.0) * 255.0).astype(np.uint8)


def in_nodes(points: Any, nodes: int) -> Floats:
    """Places in the cube as nodes of a grid of so many along each axis; gradients per node are smaller."""
    return np.asarray((np.asarray(points, dtype=np.float64) + 1.0) * (0.5 * (nodes - 1)))
