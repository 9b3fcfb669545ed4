"""One ray down the travel time to its source; the inner loop of every ray kernel.

Positions are in nodes (metres divided by the spacing) and arrays are flat, with ``strides`` a tuple of
one entry an axis, so that the compiler unrolls the loops over axes; ``scratch`` is (3, ndim), for the
callee's use. The direction is −∇(T²), not −∇T: near the source T² is a paraboloid, whose gradient is
linear and vanishes at the source alone, where ∇T would jump from one side to the other.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats, Ints
from ..compiled import kernel

# Length of a step, nodes. Half of it gives the same error on Table 6, 3.7 %, in more time, and
# steps halved where the direction turns change the time along a ray by 2 % of its error, past bone too.
STEP = 1.0

# Parts of a step that are read for themselves: longer ones would pass nodes by.
PARTS = 2

# A ray this near its source, nodes, goes straight to it.
ARRIVED = 1.0


@kernel
def squared_gradient(tof: Floats, shape: tuple[int, ...], strides: tuple[int, ...]) -> Floats:
    """∇(T²) at the nodes, (nodes, ndim): central differences, one-sided of second order on the rim."""
    squared = tof * tof
    axes = len(shape)
    gradient = np.zeros((tof.size, axes))
    for node in range(tof.size):
        rest = node
        for axis in range(axes):
            stride = strides[axis]
            n = shape[axis]
            if n == 1:
                continue
            i = rest // stride
            rest = rest % stride
            if n == 2:
                low = node - i * stride
                gradient[node, axis] = squared[low + stride] - squared[low]
            elif i == 0:
                gradient[node, axis] = (
                    -1.5 * squared[node] + 2.0 * squared[node + stride] - 0.5 * squared[node + 2 * stride]
                )
            elif i == n - 1:
                gradient[node, axis] = (
                    1.5 * squared[node] - 2.0 * squared[node - stride] + 0.5 * squared[node - 2 * stride]
                )
            else:
                gradient[node, axis] = 0.5 * (squared[node + stride] - squared[node - stride])
    return gradient


@kernel(inline="always")
def locate(point: Floats, shape: tuple[int, ...], strides: tuple[int, ...], part: Floats) -> int:
    """Flat index of the lowest node of the point's cell; ``part`` receives the place in the cell."""
    node = 0
    for axis in range(len(shape)):
        low = min(max(int(point[axis]), 0), max(shape[axis] - 2, 0))
        part[axis] = point[axis] - low
        node += low * strides[axis]
    return node


@kernel(inline="always")
def corner(
    which: int, node: int, shape: tuple[int, ...], strides: tuple[int, ...], part: Floats
) -> tuple[int, float]:
    """Flat index and multilinear weight of one of the cell's 2^ndim corners."""
    weight = 1.0
    for axis in range(len(shape)):
        if (which >> axis) & 1:
            weight *= part[axis]
            if shape[axis] > 1:
                node += strides[axis]
        else:
            weight *= 1.0 - part[axis]
    return node, weight


@kernel(inline="always")
def _direction(
    point: Floats,
    gradient: Floats,
    shape: tuple[int, ...],
    strides: tuple[int, ...],
    part: Floats,
    direction: Floats,
) -> bool:
    """Unit −∇(T²) at a point; returns False where it vanishes."""
    node = locate(point, shape, strides, part)
    for axis in range(len(shape)):
        direction[axis] = 0.0
    for which in range(1 << len(shape)):
        neighbour, weight = corner(which, node, shape, strides, part)
        for axis in range(len(shape)):
            direction[axis] -= weight * gradient[neighbour, axis]
    length = 0.0
    for axis in range(len(shape)):
        length += direction[axis] * direction[axis]
    if not length > 0.0:
        return False
    scale = 1.0 / math.sqrt(length)
    for axis in range(len(shape)):
        direction[axis] *= scale
    return True


@kernel(inline="always")
def _distance(a: Floats, b: Floats, axes: int) -> float:
    total = 0.0
    for axis in range(axes):
        total += (a[axis] - b[axis]) ** 2
    return math.sqrt(total)


@kernel(inline="always")
def curved_ray(
    receiver: Floats,
    source: Floats,
    tof: Floats,
    gradient: Floats,
    shape: tuple[int, ...],
    strides: tuple[int, ...],
    step: float,
    path: Floats,
    scratch: Floats,
) -> int:
    """Fill ``path`` (room, ndim) from receiver to source by RK2 descent; returns the number of points.

    Steps are ``step`` nodes long.

    A descent that has not arrived when the room is used up has been caught where the discrete gradient
    has no downhill (a shock, a rough model). It is traced anew from node to lower node, which always
    ends, since a travel time has no local minimum but its source.
    """
    axes = len(shape)
    part, slope, middle = scratch[0], scratch[1], scratch[2]
    for axis in range(axes):
        path[0, axis] = receiver[axis]
    room = len(path) - 1
    for count in range(1, room):
        here = path[count - 1]
        if _distance(here, source, axes) <= max(ARRIVED, step):
            for axis in range(axes):
                path[count, axis] = source[axis]
            return count + 1
        if not _direction(here, gradient, shape, strides, part, slope):
            break
        for axis in range(axes):
            middle[axis] = min(max(here[axis] + 0.5 * step * slope[axis], 0.0), shape[axis] - 1.0)
        if not _direction(middle, gradient, shape, strides, part, slope):
            break
        for axis in range(axes):
            path[count, axis] = min(max(here[axis] + step * slope[axis], 0.0), shape[axis] - 1.0)
    return _node_descent(source, tof, shape, strides, path, scratch)


@kernel(inline="always")
def _node_descent(
    source: Floats,
    tof: Floats,
    shape: tuple[int, ...],
    strides: tuple[int, ...],
    path: Floats,
    scratch: Floats,
) -> int:
    """From ``path[0]`` along the lowest neighbours to the source; returns the number of points."""
    axes = len(shape)
    part = scratch[0]
    node = locate(path[0], shape, strides, part)
    best = node
    for which in range(1 << axes):
        neighbour, _ = corner(which, node, shape, strides, part)
        if tof[neighbour] < tof[best]:
            best = neighbour
    count = 1
    neighbours = 3**axes
    while count < len(path) - 1:
        node = best
        rest = node
        for axis in range(axes):
            path[count, axis] = rest // strides[axis]
            rest = rest % strides[axis]
        count += 1
        for which in range(neighbours):
            code = which
            neighbour = node
            inside = True
            for axis in range(axes):
                shift = code % 3 - 1
                code //= 3
                i = path[count - 1, axis] + shift
                if i < 0.0 or i > shape[axis] - 1.0:
                    inside = False
                neighbour += shift * strides[axis]
            if inside and tof[neighbour] < tof[best]:
                best = neighbour
        if best == node:
            break
    for axis in range(axes):
        path[count, axis] = source[axis]
    return count + 1


@kernel(inline="always")
def straight_ray(receiver: Floats, source: Floats, axes: int, path: Floats) -> int:
    """Fill ``path`` with equal steps of at most ``STEP`` to the source; returns the number of points."""
    steps = max(1, math.ceil(_distance(receiver, source, axes) / STEP))
    for k in range(steps + 1):
        for axis in range(axes):
            path[k, axis] = receiver[axis] + (source[axis] - receiver[axis]) * (k / steps)
    return steps + 1


@kernel(inline="always")
def walk(
    path: Floats,
    count: int,
    shape: tuple[int, ...],
    strides: tuple[int, ...],
    parts: int,
    nodes: Ints,
    lengths: Floats,
    scratch: Floats,
) -> int:
    """Nodes that a path weighs on and by how much; returns the number of entries.

    Each of ``parts`` equal parts of a piece gives its length to the corners of the cell at its middle,
    multilinearly, so that Σ lengths·slowness is the midpoint rule for the slowness integral. A node appears
    once for every part near it.
    """
    axes = len(shape)
    part, middle = scratch[0], scratch[1]
    entries = 0
    for k in range(1, count):
        length = _distance(path[k], path[k - 1], axes) / parts
        for q in range(parts):
            along = (q + 0.5) / parts
            for axis in range(axes):
                middle[axis] = path[k - 1, axis] + along * (path[k, axis] - path[k - 1, axis])
            node = locate(middle, shape, strides, part)
            for which in range(1 << axes):
                neighbour, weight = corner(which, node, shape, strides, part)
                if weight != 0.0:
                    nodes[entries] = neighbour
                    lengths[entries] = weight * length
                    entries += 1
    return entries


@kernel(inline="always")
def merge(
    nodes: Ints,
    weights: Floats,
    entries: int,
    total: Floats,
    columns: NDArray[Any],
    lengths: NDArray[Any],
    filled: int,
) -> int:
    """Add what ``walk`` found to a sparse row, each node once; returns how far the row's arrays are filled.

    Args:
        total: zeros, one a node; zeros again afterwards.
        columns, lengths: of the rows so far, integers and reals of any width, with room for ``entries`` more.
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
