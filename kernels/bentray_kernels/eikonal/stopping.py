"""Which nodes a march must accept before it may stop, where only the times at some points are wanted."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Ints
from ..compiled import kernel
from ..errors import InvalidInput
from .heap import DONE, Nodes
from .problem import ON_NODE, PointSource


def awaited(problem: PointSource, points: ArrayLike | None) -> Ints:
    """The corners of the points' cells and their neighbours along the axes.

    They are what a multilinear time at the points takes, and what a multilinear gradient from central
    differences takes. A point on the face of a cell belongs to the cells on both sides.

    Args:
        problem: the checked problem.
        points: (k, ndim), m; None for none.

    Returns:
        Flat padded indices in no order, some of them twice or in the border; empty without points.

    Raises:
        InvalidInput: naming ``stop_at``, for another shape, or a point that is not in the grid.
    """
    if points is None:
        return np.empty(0, np.int64)
    places = _checked(problem, points) / problem.spacing
    strides = np.array(problem.strides)
    last = np.array(problem.slowness.shape) - 1
    low = np.clip(np.floor(places - ON_NODE).astype(np.int64), 0, last)
    high = np.clip(np.floor(places + ON_NODE).astype(np.int64) + 1, 0, last)
    corners = [
        (np.minimum(low + step, high) + 1) @ strides
        for step in itertools.product(range(3), repeat=len(strides))
    ]
    around = [0, *strides, *-strides]
    return np.concatenate([nodes + step for nodes in corners for step in around])


def _checked(problem: PointSource, points: ArrayLike) -> Floats:
    """The points as an array, refused with the first bad one's place."""
    places = np.asarray(points, dtype=np.float64)
    ndim = problem.slowness.ndim
    if places.ndim != 2 or len(places) == 0 or places.shape[1] != ndim:
        raise InvalidInput("stop_at", f"shape {places.shape}", f"(k, {ndim}) coordinates in metres, k >= 1")
    extent = problem.spacing * (np.array(problem.slowness.shape) - 1)
    slack = ON_NODE * problem.spacing
    # NaN is in no grid.
    outside = ~np.all((places >= -slack) & (places <= extent + slack), axis=1)
    if outside.any():
        k = int(outside.argmax())
        raise InvalidInput(
            "stop_at", f"{places[k].tolist()} at {k}", f"points in the grid, 0 to {extent.tolist()} m"
        )
    return places


@kernel(inline="always")
def passed(nodes: Ints, place: Nodes, count: int) -> int:
    """How many of the awaited nodes, counted from the first on, are accepted; ``count`` were before."""
    while count < nodes.size and place[nodes[count]] == DONE:
        count += 1
    return count
