"""Rays through one block of a grid: continued from the block before, traced until they leave it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..arrays import Flags, Floats, Ints
from ..compilation.compiled import kernel
from .descent import (
    ARRIVED,
    CAUGHT,
    PARTS,
    STEP,
    descend,
    descend_nodes,
    list_entries,
    longest,
    trace_straight,
)
from .fan import Fan, RayKind, squared_gradient

# Planes that a block needs below its own and above them: a step of one node, half of one to its midpoint, the
# cell there, and central differences at its corners.
BELOW, ABOVE = 2, 3

# Planes by which a curved ray may leave its block before the next one continues it: a ray along a boundary
# crosses it often, and one that is caught there as often as it has points.
GUARD = 4


class BlockPlanes(NamedTuple):
    """Planes of axis 0 of a block, as indices of the whole grid.

    Attributes:
        start, stop: its own.
        low, high: with the planes of its neighbours, [low, high).
        nodes: of the whole grid along axis 0.
    """

    start: int
    stop: int
    low: int
    high: int
    nodes: int

    @classmethod
    def from_range(cls, start: int, stop: int, nodes: int) -> BlockPlanes:
        low, high = max(start - GUARD - BELOW, 0), min(stop + GUARD + ABOVE, nodes)
        return cls(start, stop, low, high, nodes)

    def limits(self, guard: int) -> tuple[float, float]:
        """Places [low, high) along axis 0 where the block traces rays; outside the grid there are none."""
        low = -math.inf if self.start == 0 else float(self.start - guard)
        return low, math.inf if self.stop == self.nodes else float(self.stop + guard)


class WaitingRays(NamedTuple):
    """Rays of one emitter that continue in a block.

    Attributes:
        places: (rays, ndim), where they have arrived, nodes of the whole grid.
        counts: (rays,), points of each ray so far, with this one.
        by_nodes: (rays,), whether the ray goes from node to lowest neighbour, see ``descent``.
    """

    places: Floats
    counts: Ints
    by_nodes: Flags


class RayParts(NamedTuple):
    """Parts of rays in one block, in the order of ``WaitingRays``.

    Attributes:
        points: of all parts one after the other, (points, ndim), nodes; node 0 of axis 0 is plane ``low``.
        starts: (rays + 1,), the first point of each part.
        ends: (rays,), ``ARRIVED``, ``LEFT``, or ``CAUGHT`` without points.
        places: (rays, ndim), the last points, nodes of the whole grid.
        predicted: (rays,), slowness integral along the part, s.
        lengths: (rays,), of the part, nodes.
    """

    points: Floats
    starts: Ints
    ends: Ints
    places: Floats
    predicted: Floats
    lengths: Floats


def trace_block(
    tof: Floats | None,
    slowness: Floats,
    spacing: float,
    planes: BlockPlanes,
    source: Floats,
    rays: WaitingRays,
) -> RayParts:
    """Trace rays in one block, as ``sensitivities`` traces them in the whole grid.

    Args:
        tof: (high − low, ny, nz), s, ``planes.low`` to ``planes.high``; None for straight rays, whose places
            are all at the receivers.
        slowness: as ``tof``, s/m.
        spacing: m.
        planes: of the block.
        source: (ndim,), nodes of the whole grid.
        rays: to continue.
    """
    kind: RayKind = "straight" if tof is None else "curved"
    fan = _fan(slowness.shape, kind)
    offset = float(planes.low)
    if tof is not None:
        corner = np.zeros(source.size)
        corner[0] = offset
        flat = np.ascontiguousarray(tof).ravel()
        gradient = squared_gradient(flat, fan.shape, fan.strides)
        fan = fan._replace(
            receivers=rays.places - corner, source=source - corner, tof=flat, gradient=gradient
        )
    else:
        fan = fan._replace(receivers=rays.places, source=source)
    low, high = planes.limits(0 if tof is None else GUARD)
    most = longest((planes.nodes, *slowness.shape[1:]))
    crossing = slowness.ravel() * spacing
    traced = RayParts(
        *_trace(fan, most, rays.counts, rays.by_nodes, crossing, low - offset, high - offset, offset)
    )
    traced.places[:, 0] += offset
    return traced


def back_project_block(
    shape: tuple[int, ...], points: Floats, starts: Ints, corrections: Floats, sums: Floats, weights: Floats
) -> None:
    """Add Σ c·w (s) and Σ w (nodes of ray) of the parts of rays in a block (chapter 6, equation 1).

    Args:
        shape: of the block with the planes of its neighbours.
        points, starts: of the parts, see ``RayParts``.
        corrections: (rays,), residual over length, s per node; NaN for rays that count nothing.
        sums, weights: of ``shape``, C order; added to.
    """
    _back_project(_fan(shape, "straight"), points, starts, corrections, sums.reshape(-1), weights.reshape(-1))


def _fan(shape: tuple[int, ...], kind: RayKind) -> Fan:
    """A fan without rays and fields."""
    axes = len(shape)
    strides = tuple(int(math.prod(shape[axis + 1 :])) for axis in range(axes))
    none = np.empty((0, axes)), np.zeros(axes), np.empty(0), np.empty((0, axes)), np.empty((0,) * axes)
    return Fan(*none, tuple(shape), strides, kind == "curved")


@kernel
def _trace(
    fan: Fan,
    most: int,
    counts: Ints,
    by_nodes: Flags,
    crossing: Floats,
    low: float,
    high: float,
    offset: float,
) -> tuple[Floats, Ints, Ints, Floats, Floats, Floats]:
    axes = len(fan.shape)
    rays = len(fan.receivers)
    path, scratch = np.empty((most, axes)), np.empty((3, axes))
    nodes = np.empty((PARTS * most) << axes, np.int64)
    weights = np.empty(nodes.size)
    points = np.empty((16 + 4 * rays, axes))
    starts, ends = np.zeros(rays + 1, np.int64), np.zeros(rays, np.int64)
    places = np.zeros((rays, axes))
    predicted, lengths = np.zeros(rays), np.zeros(rays)
    filled = 0
    for r in range(rays):
        if fan.curved:
            room = most - (counts[r] - 1)
            for axis in range(axes):
                path[0, axis] = fan.receivers[r, axis]
            if by_nodes[r]:
                count, end = descend_nodes(fan, room, path, scratch[0], counts[r] == 1, low, high)
            else:
                count, end = descend(fan, STEP, room, path, scratch, low, high)
        else:
            count, end = _straight_part(fan, r, path, low, high, offset), ARRIVED
        ends[r] = end
        if end != CAUGHT and count > 0:
            entries = list_entries(fan, path, count, PARTS, nodes, weights, scratch)
            for k in range(entries):
                predicted[r] += weights[k] * crossing[nodes[k]]
                lengths[r] += weights[k]
            while filled + count > len(points):
                points = np.concatenate((points, np.empty_like(points)))
            points[filled : filled + count] = path[:count]
            filled += count
            places[r] = path[count - 1]
        starts[r + 1] = filled
    return points[:filled].copy(), starts, ends, places, predicted, lengths


@kernel(inline="always")
def _straight_part(fan: Fan, r: int, path: Floats, low: float, high: float, offset: float) -> int:
    """The segments of a straight ray that start in the block; whole rays are compared in the whole grid."""
    count = trace_straight(fan, r, path)
    first, last = count, 0
    for k in range(count - 1):
        # The same comparison in both blocks at a boundary, so that a segment is in exactly one of them.
        if low + offset <= path[k, 0] < high + offset:
            first = min(first, k)
            last = k + 1
    if first == count:
        return 0
    for k in range(first, last + 1):
        for axis in range(len(fan.shape)):
            path[k - first, axis] = path[k, axis] - (offset if axis == 0 else 0.0)
    return last - first + 1


@kernel
def _back_project(
    fan: Fan, points: Floats, starts: Ints, corrections: Floats, sums: Floats, weights: Floats
) -> None:
    longest_part = 1
    for r in range(len(corrections)):
        longest_part = max(longest_part, starts[r + 1] - starts[r])
    nodes = np.empty((PARTS * longest_part) << len(fan.shape), np.int64)
    lengths = np.empty(nodes.size)
    scratch = np.empty((3, len(fan.shape)))
    for r in range(len(corrections)):
        if math.isnan(corrections[r]):
            continue
        path = points[starts[r] : starts[r + 1]]
        entries = list_entries(fan, path, len(path), PARTS, nodes, lengths, scratch)
        for k in range(entries):
            sums[nodes[k]] += corrections[r] * lengths[k]
            weights[nodes[k]] += lengths[k]
