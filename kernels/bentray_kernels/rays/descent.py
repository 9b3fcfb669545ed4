"""Tracing one ray down the gradient of the travel time; the inner loop of every ray kernel.

Positions are in nodes (metres divided by the spacing) and arrays are flat. The direction is −∇(T²), not
−∇T: near the source T² is a paraboloid, whose gradient is linear and vanishes only at the source, whereas
∇T changes sign there. ``path`` and ``scratch`` come from ``empty_path``.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..compilation.compiled import kernel
from .fan import Fan
from .squared_time_spline import spline_slope

# Length of a step, nodes. Half of it gives the same error on Table 6, 3.7 %, in more time. Halving the steps
# where the direction turns changes the time along a ray by 2 % of its error, even near bone.
STEP = 1.0

# Parts of a step, each with its own midpoint: with longer ones the path would skip nodes.
PARTS = 2

# A ray this near its source, nodes, goes straight to it.
NEAR = 1.0

# How a descent ends: at the source, outside the planes of a block, or without a downhill direction.
ARRIVED, LEFT, CAUGHT = 0, 1, 2

# Longest ray, in sums of the lengths of the grid's edges.
LONGEST = 4


@kernel(inline="always")
def locate(point: Floats, fan: Fan, part: Floats) -> int:
    """Flat index of the lowest node of the point's cell; ``part`` receives the position in the cell."""
    node = 0
    for axis in range(len(fan.shape)):
        low = min(max(int(point[axis]), 0), max(fan.shape[axis] - 2, 0))
        part[axis] = point[axis] - low
        node += low * fan.strides[axis]
    return node


@kernel(inline="always")
def corner(which: int, node: int, fan: Fan, part: Floats) -> tuple[int, float]:
    """Flat index and multilinear weight of one of the cell's 2^ndim corners."""
    weight = 1.0
    for axis in range(len(fan.shape)):
        if (which >> axis) & 1:
            weight *= part[axis]
            if fan.shape[axis] > 1:
                node += fan.strides[axis]
        else:
            weight *= 1.0 - part[axis]
    return node, weight


@kernel(inline="always")
def _direction(point: Floats, fan: Fan, part: Floats, direction: Floats) -> bool:
    """Unit −∇(T²) at a point; returns False where it vanishes."""
    axes = len(fan.shape)
    if fan.spline.size > 0:
        spline_slope(fan.spline, fan.shape, point, direction)
        for axis in range(axes):
            direction[axis] = -direction[axis]
    else:
        node = locate(point, fan, part)
        for axis in range(axes):
            direction[axis] = 0.0
        for which in range(1 << axes):
            neighbour, weight = corner(which, node, fan, part)
            for axis in range(axes):
                direction[axis] -= weight * fan.gradient[neighbour, axis]
    length = 0.0
    for axis in range(axes):
        length += direction[axis] * direction[axis]
    if not length > 0.0:
        return False
    scale = 1.0 / math.sqrt(length)
    for axis in range(axes):
        direction[axis] *= scale
    return True


@kernel(inline="always")
def _distance(a: Floats, b: Floats, axes: int) -> float:
    total = 0.0
    for axis in range(axes):
        total += (a[axis] - b[axis]) ** 2
    return math.sqrt(total)


@kernel
def empty_path(fan: Fan) -> tuple[Floats, Floats]:
    """Memory for one path of the fan, (most points, ndim), and for intermediate values, (3, ndim)."""
    axes = len(fan.shape)
    return np.empty((longest(fan.shape), axes)), np.empty((3, axes))


@kernel
def longest(shape: tuple[int, ...]) -> int:
    """Points of a path at most, in a grid of this shape."""
    return int(LONGEST * sum(shape) / STEP) + 16


@kernel(inline="always")
def trace_ray(fan: Fan, k: int, step: float, path: Floats, scratch: Floats) -> int:
    """Fill ``path`` with points from receiver ``k`` to the source; returns their number.

    Args:
        step: length of the steps of a curved ray, nodes.
    """
    if fan.curved:
        return trace_curved(fan, k, step, path, scratch)
    return trace_straight(fan, k, path)


@kernel(inline="always")
def trace_curved(fan: Fan, k: int, step: float, path: Floats, scratch: Floats) -> int:
    """Like ``trace_ray`` by second-order Runge-Kutta descent along −∇(T²).

    A descent that does not arrive within the memory of ``path`` is caught where the discrete gradient has no
    downhill direction (a shock, a rough model). It is repeated from node to lower node, which always ends:
    a travel time has its only local minimum at the source.
    """
    for axis in range(len(fan.shape)):
        path[0, axis] = fan.receivers[k, axis]
    count, end = descend(fan, step, len(path), path, scratch, -math.inf, math.inf)
    if end != CAUGHT:
        return count
    return descend_nodes(fan, len(path), path, scratch[0], True, -math.inf, math.inf)[0]


@kernel(inline="always")
def descend(
    fan: Fan, step: float, most: int, path: Floats, scratch: Floats, low: float, high: float
) -> tuple[int, int]:
    """Continue a ray from ``path[0]`` by Runge-Kutta steps as long as it stays in some planes of axis 0.

    Args:
        step: as for ``trace_ray``.
        most: points of the path at most.
        low, high: the ray ends with its first point outside [low, high), nodes.

    Returns:
        The number of points, and ``ARRIVED``, ``LEFT``, or ``CAUGHT`` without a direction or more points.
    """
    axes = len(fan.shape)
    part, slope, middle = scratch[0], scratch[1], scratch[2]
    for count in range(1, most - 1):
        here = path[count - 1]
        if _distance(here, fan.source, axes) <= max(NEAR, step):
            for axis in range(axes):
                path[count, axis] = fan.source[axis]
            return count + 1, ARRIVED
        if not _direction(here, fan, part, slope):
            break
        for axis in range(axes):
            middle[axis] = min(max(here[axis] + 0.5 * step * slope[axis], 0.0), fan.shape[axis] - 1.0)
        if not _direction(middle, fan, part, slope):
            break
        for axis in range(axes):
            path[count, axis] = min(max(here[axis] + step * slope[axis], 0.0), fan.shape[axis] - 1.0)
        if not low <= path[count, 0] < high:
            return count + 1, LEFT
    return 0, CAUGHT


@kernel(inline="always")
def descend_nodes(
    fan: Fan, most: int, path: Floats, part: Floats, at_receiver: bool, low: float, high: float
) -> tuple[int, int]:
    """Like ``descend`` from node to lowest neighbour.

    Args:
        at_receiver: whether ``path[0]`` is a receiver; otherwise it is a node.

    Returns:
        The number of points, and ``ARRIVED`` or ``LEFT``.
    """
    axes = len(fan.shape)
    node = locate(path[0], fan, part)
    if at_receiver:
        best = node
        for which in range(1 << axes):
            neighbour, _ = corner(which, node, fan, part)
            if fan.tof[neighbour] < fan.tof[best]:
                best = neighbour
    else:
        # Of a node on the last plane of an axis ``locate`` returns the cell before.
        node = 0
        for axis in range(axes):
            node += int(path[0, axis]) * fan.strides[axis]
        best = _lowest(fan, node, path[0])
    count = 1
    while count < most - 1 and (at_receiver or best != node):
        at_receiver = False
        node = best
        rest = node
        for axis in range(axes):
            path[count, axis] = rest // fan.strides[axis]
            rest = rest % fan.strides[axis]
        count += 1
        if not low <= path[count - 1, 0] < high:
            return count, LEFT
        best = _lowest(fan, node, path[count - 1])
    for axis in range(axes):
        path[count, axis] = fan.source[axis]
    return count + 1, ARRIVED


@kernel(inline="always")
def _lowest(fan: Fan, node: int, place: Floats) -> int:
    """The earliest of a node and its 3^ndim − 1 neighbours."""
    axes = len(fan.shape)
    best = node
    for which in range(3**axes):
        code = which
        neighbour = node
        inside = True
        for axis in range(axes):
            shift = code % 3 - 1
            code //= 3
            i = place[axis] + shift
            if i < 0.0 or i > fan.shape[axis] - 1.0:
                inside = False
            neighbour += shift * fan.strides[axis]
        if inside and fan.tof[neighbour] < fan.tof[best]:
            best = neighbour
    return best


@kernel(inline="always")
def trace_straight(fan: Fan, k: int, path: Floats) -> int:
    """Like ``trace_ray`` in equal steps of at most ``STEP``."""
    axes = len(fan.shape)
    receiver, source = fan.receivers[k], fan.source
    steps = max(1, math.ceil(_distance(receiver, source, axes) / STEP))
    for i in range(steps + 1):
        for axis in range(axes):
            path[i, axis] = receiver[axis] + (source[axis] - receiver[axis]) * (i / steps)
    return steps + 1


@kernel(inline="always")
def list_entries(
    fan: Fan, path: Floats, count: int, parts: int, nodes: Ints, lengths: Floats, scratch: Floats
) -> int:
    """Nodes to which a path contributes, and the lengths; returns the number of entries.

    Each of ``parts`` equal parts of a segment gives its length to the corners of the cell at its midpoint,
    multilinearly, so that Σ lengths·slowness is the midpoint rule for the slowness integral. A node appears
    once for every part near it.
    """
    axes = len(fan.shape)
    part, middle = scratch[0], scratch[1]
    entries = 0
    for k in range(1, count):
        length = _distance(path[k], path[k - 1], axes) / parts
        for q in range(parts):
            along = (q + 0.5) / parts
            for axis in range(axes):
                middle[axis] = path[k - 1, axis] + along * (path[k, axis] - path[k - 1, axis])
            node = locate(middle, fan, part)
            for which in range(1 << axes):
                neighbour, weight = corner(which, node, fan, part)
                if weight != 0.0:
                    nodes[entries] = neighbour
                    lengths[entries] = weight * length
                    entries += 1
    return entries


@kernel(inline="always")
def merge_entries(
    nodes: Ints,
    weights: Floats,
    entries: int,
    total: Floats,
    columns: NDArray[Any],
    lengths: NDArray[Any],
    filled: int,
) -> int:
    """Append the entries of ``list_entries`` to a sparse row, each node once; returns the filled length.

    Args:
        total: zeros, one a node; zeros again afterwards.
        columns, lengths: of the rows so far, of any width, with memory for ``entries`` more.
    """
    start = filled
    for k in range(entries):
        if total[nodes[k]] == 0.0 and weights[k] > 0.0:
            columns[filled] = nodes[k]
            filled += 1
        total[nodes[k]] += weights[k]
    for k in range(start, filled):
        lengths[k] = total[columns[k]]
        total[columns[k]] = 0.0
    return filled
