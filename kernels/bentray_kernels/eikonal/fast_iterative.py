"""The fast iterative method: an active list instead of a heap (Jeong & Whitaker 2008; chapter 7.2.2)."""

import math

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..compilation.compiled import int64, kernel
from .problem import PointSource, Start, Strides, check_tolerance
from .updates import first_order_2d, first_order_3d

OUT = 0
LISTED = 1


def fast_iterative(problem: PointSource, *, tolerance: float = 1e-12) -> Floats:
    """Travel time by updating a list of active nodes until it is empty.

    A node stays on the list while its time falls. When it has converged it is removed, and those of its
    neighbours whose times it lowers are added. The order of updates does not matter, so all nodes of the list
    can be updated at once; ``fim-opencl`` does so.

    Args:
        problem: the checked problem.
        tolerance: a decrease below this fraction of a node's own crossing time counts as converged.

    Returns:
        (nx, ny[, nz]), s; equal to first-order fast marching up to the tolerance.

    Raises:
        InvalidInput: for a negative tolerance.
    """
    check_tolerance(tolerance)
    # The border counts as listed, so that it is never added.
    return problem.interior(
        _iterate(problem.start(), problem.strides, problem.places(OUT, LISTED), tolerance)
    )


@kernel(inline="always")
def _updated(node: int, strides: tuple[int, int, int], crossing: float, time: Floats) -> float:
    """The first-order time of a node from its neighbours as they are, or its own if none is earlier."""
    old = time[node]
    a = min(time[node - strides[0]], time[node + strides[0]])
    b = min(time[node - strides[1]], time[node + strides[1]])
    if strides[2] == 0:
        return first_order_2d(a, b, crossing) if a < old or b < old else old
    c = min(time[node - strides[2]], time[node + strides[2]])
    return first_order_3d(a, b, c, crossing) if a < old or b < old or c < old else old


@kernel
def _iterate(start: Start, strides: Strides, listed: NDArray[np.int32], tolerance: float) -> Floats:
    slowness, spacing, seeds, seed_times = start
    # A constant 0 for the third of two axes lets the compiler drop its code.
    steps = (strides[0], strides[1], strides[2] if len(strides) == 3 else 0)
    time = np.full(slowness.size, math.inf)
    # A node is on the list once, so neither half can overflow.
    active = np.empty(slowness.size, np.int32)
    following = np.empty(slowness.size, np.int32)
    length = seeds.size
    for k in range(length):
        time[seeds[k]] = seed_times[k]
        active[k] = seeds[k]
        listed[seeds[k]] = LISTED
    while length > 0:
        following_length = 0
        for k in range(length):
            node = int64(active[k])
            crossing = spacing * slowness[node]
            old = time[node]
            own = min(old, _updated(node, steps, crossing, time))
            time[node] = own
            if old - own > tolerance * crossing:
                following[following_length] = node
                following_length += 1
                continue
            listed[node] = OUT
            for axis in range(2 if steps[2] == 0 else 3):
                stride = steps[axis]
                for neighbour in (node - stride, node + stride):
                    before = time[neighbour]
                    # An earlier node cannot depend on this one.
                    if listed[neighbour] == LISTED or before <= own:
                        continue
                    crossing = spacing * slowness[neighbour]
                    after = _updated(neighbour, steps, crossing, time)
                    if after < before:
                        time[neighbour] = after
                        if before - after > tolerance * crossing:
                            listed[neighbour] = LISTED
                            following[following_length] = neighbour
                            following_length += 1
        active, following = following, active
        length = following_length
    return time
