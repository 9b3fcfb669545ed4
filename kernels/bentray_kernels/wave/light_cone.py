"""Nodes that matter at each time step: reached by the source, and still able to reach a receiver in time."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Ints
from ..compilation.compiled import kernel
from .cache_lines import LINE_NODES
from .medium import Medium
from .points import REACH, Points
from .stencil import HALO

# Rows and columns of a tile, and steps of a block, whose nodes share one decision.
TILE, TILE_NODES, BLOCK_STEPS = 8, LINE_NODES, 8

# Speed of the cones relative to the fastest node. Near the limit of stability short waves run ahead: what is
# left out changes a gradient by 1e-6 of it, with 1.1 by 1e-4.
FASTER = 1.2

# The first node and one past the last of each row of tiles in each block of steps, (blocks, rows, 2).
Spans = NDArray[np.int32]


def everywhere(medium: Medium) -> Spans:
    """The spans of all nodes at all times."""
    rows = -(-(medium.keep.shape[0] - 2 * HALO) // TILE)
    return np.tile(np.array([HALO, medium.keep.shape[1] - HALO], np.int32), (1, rows, 1))


def light_cone(medium: Medium, source: Points, detectors: Points, until: Ints) -> Spans:
    """The spans of one emission, of which only the beginning of each trace counts.

    A node matters from the first arrival of the source until its waves come too late for every receiver. What
    is left out changes neither those traces nor the gradient of a misfit of them.

    Args:
        source: one element.
        detectors: the receivers.
        until: (nrx,), number of samples that count of each trace.
    """
    nodes = np.array(medium.keep.shape)
    size = np.array([TILE, TILE_NODES])
    count = -(-(nodes - 2 * HALO) // size)
    middle = HALO + size * np.moveaxis(np.indices(count), 0, -1) + 0.5 * (size - 1)
    # Nodes that a wave crosses in a step; half of a tile and the reach of an element.
    speed = FASTER * float(medium.speed.max()) * medium.time_step_s / medium.spacing
    slack = 0.5 * math.hypot(*size) + math.sqrt(2.0) * REACH + HALO
    begin = (np.linalg.norm(middle - (source.first[0] + (REACH - 0.5)), axis=-1) - slack) / speed
    end = _last_use(middle, detectors.first + (REACH - 0.5), until, slack, speed)
    blocks = BLOCK_STEPS * np.arange(max(1, -(-int(until.max(initial=0)) // BLOCK_STEPS)))[:, None, None]
    active = (begin <= blocks + BLOCK_STEPS) & (end >= blocks)
    reached = active.any(axis=2)
    low = np.where(reached, HALO + TILE_NODES * active.argmax(axis=2), HALO)
    high = np.where(reached, HALO + TILE_NODES * (count[1] - active[:, :, ::-1].argmax(axis=2)), HALO)
    return np.stack((low, np.minimum(high, nodes[1] - HALO)), axis=-1).astype(np.int32)


@kernel
def _last_use(middle: Any, elements: Any, until: Any, slack: float, speed: float) -> Any:
    """The step after which waves of a tile come too late for every receiver."""
    found = np.full(middle.shape[:2], -np.inf)
    for i in range(middle.shape[0]):
        for j in range(middle.shape[1]):
            for r in range(elements.shape[0]):
                if until[r] > 0:
                    x, y = middle[i, j, 0] - elements[r, 0], middle[i, j, 1] - elements[r, 1]
                    found[i, j] = max(found[i, j], until[r] - (math.sqrt(x * x + y * y) - slack) / speed)
    return found
