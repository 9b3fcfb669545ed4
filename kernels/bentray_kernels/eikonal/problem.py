"""A point-source Eikonal problem, checked once and padded with a border for the kernels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..arrays import Floats, Ints, refuse_mask
from ..errors import InvalidInput

# A source closer to a node than this, in nodes, is treated as on it.
ON_NODE = 1e-9

Node = tuple[int, ...]

# Nodes around a source with their multilinear weights.
Cell = list[tuple[Node, float]]


class Start(NamedTuple):
    """What marching begins with: a padded grid, and the nodes of the source's cell.

    Attributes:
        slowness: flat, s/m.
        spacing: node spacing, m.
        seeds, times: as of ``PointSource.seeds``.
    """

    slowness: Floats
    spacing: float
    seeds: Ints
    times: Floats


# Flat distance of neighbours along each axis of a padded grid.
Strides = tuple[int, ...]

# Of the time T0 in the source's own slowness: ``squares``, ``limit`` and ``least`` of ``updates.Front``.
Factor = tuple[Floats, float, float]


@dataclass(frozen=True)
class SlownessGrid:
    """A regular grid of slowness, which many sources may share.

    Attributes:
        slowness: (nx, ny[, nz]), s/m, float64, C order.
        spacing: node spacing, m.
    """

    slowness: Floats
    spacing: float

    @classmethod
    def checked(cls, speed: ArrayLike, spacing: float) -> SlownessGrid:
        """The medium for the arguments of ``solve``; an error names the first invalid node.

        Raises:
            InvalidInput: see ``bentray_kernels.eikonal.solve``.
        """
        refuse_mask("speed", speed)
        speeds = np.asarray(speed, dtype=np.float64)
        if speeds.ndim not in (2, 3) or speeds.size == 0:
            raise InvalidInput("speed", f"shape {speeds.shape}", "a non-empty 2-D or 3-D array")
        # NaN fails the first comparison.
        if not (speeds.min() > 0.0 and speeds.max() < math.inf):
            node = tuple(int(i) for i in np.argwhere(~(np.isfinite(speeds) & (speeds > 0.0)))[0])
            raise InvalidInput("speed", f"{speeds[node]:g} at node {node}", "finite speeds > 0 m/s")
        step = float(spacing)
        if not (math.isfinite(step) and step > 0.0):
            raise InvalidInput("spacing", spacing, "a finite node spacing > 0 m")
        return cls(np.ascontiguousarray(1.0 / speeds), step)

    @cached_property
    def padded_slowness(self) -> Floats:
        """Flat slowness with a border of one node, whose value is never used."""
        return np.pad(self.slowness, 1, constant_values=1.0).ravel()

    @cached_property
    def least_slowness(self) -> float:
        """Lowest slowness of all nodes, s/m."""
        return float(self.slowness.min())

    def source(self, position: ArrayLike) -> PointSource:
        """The problem of a source at ``position``, (ndim,), m.

        Raises:
            InvalidInput: for a source that is not in the grid.
        """
        return PointSource(self, placed(position, self.slowness.shape, self.spacing))


@dataclass(frozen=True)
class PointSource:
    """|∇T| = slowness in a medium, T = 0 at ``source``, (ndim,), m, node 0 at 0."""

    medium: SlownessGrid
    source: Floats

    @classmethod
    def checked(cls, speed: ArrayLike, spacing: float, source: ArrayLike | Sequence[float]) -> PointSource:
        """The problem of ``solve``.

        Raises:
            InvalidInput: see ``bentray_kernels.eikonal.solve``.
        """
        return SlownessGrid.checked(speed, spacing).source(source)

    @property
    def slowness(self) -> Floats:
        """(nx, ny[, nz]), s/m."""
        return self.medium.slowness

    @property
    def spacing(self) -> float:
        """Node spacing, m."""
        return self.medium.spacing

    @property
    def padded_slowness(self) -> Floats:
        """Flat slowness with a border of one node, whose value is never used."""
        return self.medium.padded_slowness

    @property
    def padded_shape(self) -> tuple[int, ...]:
        return tuple(n + 2 for n in self.slowness.shape)

    @property
    def strides(self) -> Strides:
        """Flat distance of neighbours along each axis of the padded grid."""
        shape = self.padded_shape
        return tuple(math.prod(shape[axis + 1 :]) for axis in range(len(shape)))

    def places(self, inside: int, border: int) -> NDArray[np.int32]:
        """Flat, padded: one value inside the grid and another on the border, which no front may enter."""
        marks = np.full(self.padded_shape, border, np.int32)
        marks[(slice(1, -1),) * self.slowness.ndim] = inside
        return marks.ravel()

    def interior(self, padded: Floats) -> Floats:
        """The grid without its border, as a fresh C-ordered array."""
        inside = (slice(1, -1),) * self.slowness.ndim
        return np.ascontiguousarray(padded.reshape(self.padded_shape)[inside])

    def factor(self) -> Factor:
        """T0² at every node, padded and flat, s², and the numbers that limit T/T0."""
        squares: Floats = np.zeros(self.padded_shape)
        for axis, n in enumerate(self.padded_shape):
            offset = (np.arange(n) - 1.0) * self.spacing - self.source[axis]
            shape = [1] * len(self.padded_shape)
            shape[axis] = n
            squares += (offset**2).reshape(shape)
        here = self.source_slowness()
        least = self.medium.least_slowness / here
        return np.asarray(squares * here**2).ravel(), 4.0 * (here * self.spacing) ** 2, least

    def source_slowness(self) -> float:
        """Slowness at the source, multilinear between its cell's nodes, s/m."""
        return float(sum(weight * self.slowness[node] for node, weight in self._cell))

    def start(self) -> Start:
        """What compiled marching takes, beside ``strides``: their number must be known to the compiler."""
        return Start(self.padded_slowness, self.spacing, *self.seeds())

    def seeds(self) -> tuple[Ints, Floats]:
        """Nodes of the source's cell: flat padded indices and travel times along straight lines, s.

        A source on a node gives that node alone, at time 0.
        """
        at_nodes = [self.slowness[node] for node, _ in self._cell]
        by_node = straight_times(self._cell, at_nodes, self.spacing, self.source)
        nodes = [
            sum((i + 1) * stride for i, stride in zip(node, self.strides, strict=True)) for node in by_node
        ]
        return np.array(nodes, dtype=np.int64), np.array(list(by_node.values()))

    def surroundings(self, radius: int, contrast: float) -> tuple[Ints, Floats] | None:
        """Like ``seeds``, for the box of nodes up to ``radius`` from the source, all along straight lines.

        None where the slowness in the box varies by more than the factor ``contrast``: there the lines bend.
        """
        nearest = np.rint(self.source / self.spacing).astype(np.int64)
        low = np.maximum(nearest - radius, 0)
        high = np.minimum(nearest + radius + 1, self.slowness.shape)
        box = self.slowness[tuple(slice(a, b) for a, b in zip(low, high, strict=True))]
        if box.max() > contrast * box.min():
            return None
        places = np.indices(box.shape).reshape(box.ndim, -1) + low[:, None]
        distance = np.linalg.norm(places * self.spacing - self.source[:, None], axis=0)
        nodes = ((places + 1) * np.array(self.strides)[:, None]).sum(axis=0)
        return nodes, distance * 0.5 * (self.source_slowness() + box.ravel())

    @cached_property
    def _cell(self) -> Cell:
        return cell_of(self.source, self.slowness.shape, self.spacing)


def check_tolerance(tolerance: float) -> None:
    """Raise ``InvalidInput`` for a negative tolerance."""
    if not tolerance >= 0.0:
        raise InvalidInput("tolerance", tolerance, "a number >= 0")


def placed(position: ArrayLike, shape: tuple[int, ...], spacing: float) -> Floats:
    """A source, (ndim,), m, clipped to the grid within rounding.

    Raises:
        InvalidInput: for a source that is not in the grid.
    """
    refuse_mask("source", position)
    point = np.asarray(position, dtype=np.float64)
    if point.shape != (len(shape),):
        raise InvalidInput("source", f"shape {point.shape}", f"{len(shape)} coordinates in metres")
    extent = spacing * (np.array(shape) - 1)
    slack = ON_NODE * spacing
    if not np.all((point >= -slack) & (point <= extent + slack)):
        raise InvalidInput("source", point.tolist(), f"a point in the grid, 0 to {extent.tolist()} m")
    return np.clip(point, 0.0, extent)


def cell_of(source: Floats, shape: tuple[int, ...], spacing: float) -> Cell:
    """The nodes around a source with their multilinear weights, those of weight 0 left out."""
    corners: list[tuple[Node, float]] = [((), 1.0)]
    for axis, n in enumerate(shape):
        position = float(source[axis]) / spacing
        low = min(int(position), n - 1)
        fraction = position - low
        if fraction < ON_NODE or fraction > 1.0 - ON_NODE or low + 1 >= n:
            ends = [(min(round(position), n - 1), 1.0)]
        else:
            ends = [(low, 1.0 - fraction), (low + 1, fraction)]
        corners = [((*node, i), weight * w) for node, weight in corners for i, w in ends]
    return corners


def straight_times(
    cell: Cell, slowness: Sequence[float], spacing: float, source: Floats
) -> dict[Node, float]:
    """Travel time along straight lines to the nodes of the source's cell, s.

    Args:
        cell: from ``cell_of``.
        slowness: of its nodes, s/m.
    """
    at_source = float(sum(weight * s for (_, weight), s in zip(cell, slowness, strict=True)))
    times = {}
    for (node, _), at_node in zip(cell, slowness, strict=True):
        distance = math.dist([i * spacing for i in node], source)
        times[node] = distance * 0.5 * (at_source + at_node)
    return times
