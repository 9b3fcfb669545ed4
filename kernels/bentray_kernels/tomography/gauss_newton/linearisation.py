"""Linearisation for some emitters: their rays as rows of a sparse matrix, and the residuals."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from ...arrays import Flags, Floats, Ints
from ...compilation.compiled import kernel
from ...eikonal import solve
from ...rays.bending import STRIDE, bend
from ...rays.descent import PARTS, empty_path, list_entries, merge_entries, trace_ray
from ...rays.fan import Fan
from ...rays.newton_step import allocate_bending
from ...splines import coefficients
from ..finite_frequency import front_smoothing, ray_slowness
from ..problem import Problem
from ..settings import Settings
from .ray_matrix import RayMatrix, back_project, project

# Entries of the matrix that are worth a second thread.
MIN_ENTRIES = 200_000

Map = Callable[..., Iterable[Any]]

# A piece of a bent ray is STRIDE nodes long; its parts are as short as those of other rays.
BENT_PARTS = 3


@dataclass(frozen=True)
class Rows:
    """The rays of some emitters, one row each, as a compressed sparse matrix over the nodes.

    Attributes:
        pointers: (rays + 1,), start of each row.
        columns: (entries,), flat node, C order.
        lengths: (entries,), nodes of ray; multiplied by the spacing they are the sensitivities.
        residual: (rays,), s, measured minus predicted travel time.
        counts: (emitters,), number of rays of each emitter, in the order of the rows.
    """

    pointers: Ints
    columns: NDArray[np.int32]
    lengths: NDArray[np.float32]
    residual: Floats
    counts: Ints

    @property
    def matrix(self) -> RayMatrix:
        """A, for compiled code."""
        return RayMatrix(self.pointers, self.columns, self.lengths)

    def between(self, first: int, last: int) -> Rows:
        """The rows ``first`` up to, without, ``last``, as of one emitter; views of these arrays."""
        entries = slice(self.pointers[first], self.pointers[last])
        return Rows(
            self.pointers[first : last + 1] - self.pointers[first],
            self.columns[entries],
            self.lengths[entries],
            self.residual[first:last],
            np.array([last - first]),
        )

    def by_emitter(self) -> Iterator[Rows]:
        """The rows of each emitter by themselves; views of these arrays."""
        ends = np.concatenate(([0], np.cumsum(self.counts)))
        for first, last in itertools.pairwise(ends):
            yield self.between(first, last)

    def chosen(self, rays: Flags) -> Rows:
        """Copies of some rays, by their emitters."""
        entries = np.diff(self.pointers)
        counts = [part.sum() for part in np.split(rays, np.cumsum(self.counts)[:-1])]
        kept = np.repeat(rays, entries)
        ends = np.concatenate(([0], np.cumsum(entries[rays])))
        return Rows(ends, self.columns[kept], self.lengths[kept], self.residual[rays], np.array(counts))

    def project(self, image: Floats) -> Floats:
        """A·image, (rays,): sums along the rays."""
        sums = np.empty(self.residual.size)
        project(self.matrix, image.ravel(), sums)
        return sums

    def back_project(self, values: Floats, into: Floats) -> None:
        """Add Aᵀ·values to ``into``, (nodes,)."""
        back_project(self.matrix, values, into)


def halves(blocks: Sequence[Rows]) -> list[list[Rows]]:
    """The first and the last half of the rays; the same for any split into parts."""
    middle = sum(block.residual.size for block in blocks) // 2
    halved: list[list[Rows]] = [[], []]
    begin = 0
    for block in blocks:
        count = block.residual.size
        cut = min(max(middle - begin, 0), count)
        begin += count
        for half, first, last in zip(halved, (0, cut), (cut, count), strict=True):
            if first < last:
                half.append(block.between(first, last))
    return halved


@contextmanager
def map_halves(blocks: Sequence[Rows]) -> Iterator[Map]:
    """A ``map`` for ``halves``, which computes both at the same time where that is worth a thread.

    An update waits for all emitters, so that the cores that traced their rays would be idle. Sums over the
    halves have the same bits whether one thread or two compute them.
    """
    if sum(block.columns.size for block in blocks) < MIN_ENTRIES:
        yield map
        return
    with ThreadPoolExecutor(2) as pool:
        yield pool.map


def ray_density(problem: Problem, blocks: Sequence[Rows]) -> Floats:
    """Nodes of ray through each node, of the region's shape."""
    density = np.zeros(problem.region.size)
    for block in blocks:
        block.back_project(np.ones(block.residual.size), density)
    return density.reshape(problem.region.shape)


def linearise(problem: Problem, settings: Settings, slowness: Floats, emitters: Ints) -> Rows:
    """Rows of some emitters' rays through an image; any split of the emitters gives the same.

    Curved rays are bent to the stationary path in the cubic spline of the image, and their times are
    integrals of the spline. Times along unbent rays by linear interpolation are wrong where rays graze an
    edge, and a Gauss–Newton step would put this error into the image.

    Rays bend in the image blurred as by ``finite_frequency``; if it is blurred, times are integrals of
    ``ray_slowness`` along those rays.

    Args:
        problem: the slice or volume.
        settings: with the rays and the method of the wave front.
        slowness: of the region's shape, s/m.
        emitters: rows of the problem's data, at least one.
    """

    def residual_of(emitter: int, valid: Ints, distance: Floats, predicted: Floats, _: Floats) -> Floats:
        water = distance / problem.water_speed
        return np.asarray(problem.delta_tof[emitter, valid] + water - predicted)

    return _trace(problem, settings, slowness, emitters, problem.delta_tof, residual_of)


def linearise_losses(problem: Problem, settings: Settings, slowness: Floats, emitters: Ints) -> Rows:
    """Like ``linearise`` for amplitudes: the residual, Np, is the log ratio minus that of water on the ray.

    Raises:
        ValueError: for a problem without amplitudes.
    """
    ratio, water = problem.log_ratio, problem.water_attenuation
    if ratio is None:
        raise ValueError("no amplitudes")

    def residual_of(emitter: int, valid: Ints, distance: Floats, _: Floats, length: Floats) -> Floats:
        return np.asarray(ratio[emitter, valid] + water * (distance - length))

    return _trace(problem, settings, slowness, emitters, ratio, residual_of)


def _trace(
    problem: Problem,
    settings: Settings,
    slowness: Floats,
    emitters: Ints,
    data: Floats,
    residual_of: Callable[[int, Ints, Floats, Floats, Floats], Floats],
) -> Rows:
    """Rows of the pairs that have data.

    Args:
        residual_of: residual from the emitter, the valid receivers, their distances, m, predicted times, s,
            and the lengths of the rays, m.
    """
    slowness, front = ray_slowness(problem, settings, slowness), front_smoothing(problem, settings)
    speed = 1.0 / slowness
    if front > 0.0:
        # A wave averages over its Fresnel zone; a ray follows every edge.
        speed = np.asarray(gaussian_filter(speed, front, mode="nearest"))
    traced, spline = [], np.empty((0,) * slowness.ndim)
    if settings.rays == "curved":
        spline = coefficients(-np.log(speed))
    for emitter in emitters:
        valid = np.flatnonzero(np.isfinite(data[emitter]))
        source = problem.emitters[emitter]
        receivers = problem.receivers_of(int(emitter))[valid]
        distance = np.linalg.norm(receivers - source, axis=1)
        tof = speed
        if settings.rays == "curved":
            tof = solve(speed, problem.spacing, source, settings.ray_eikonal)
        gradient = settings.numerics.ray_gradient
        fan = Fan.checked(tof, problem.spacing, receivers, source, settings.rays, gradient)
        counts, columns, lengths, predicted = _rows(fan, front > 0.0, slowness.ravel(), spline)
        ends = np.concatenate(([0], np.cumsum(counts)))
        length = np.array([lengths[a:b].sum(dtype=np.float64) for a, b in itertools.pairwise(ends)])
        residual = residual_of(
            int(emitter), valid, distance, predicted * problem.spacing, length * problem.spacing
        )
        traced.append((counts, columns, lengths, residual))
    counts, columns, lengths, residual = (np.concatenate(arrays) for arrays in zip(*traced, strict=True))
    rays = np.array([entries[0].size for entries in traced])
    return Rows(np.concatenate(([0], np.cumsum(counts))), columns, lengths, residual, rays)


@kernel
def _rows(
    fan: Fan, smooth: bool, slowness: Floats, spline: Floats
) -> tuple[Ints, NDArray[np.int32], NDArray[np.float32], Floats]:
    """Entries per ray, flat node and nodes of ray of each entry, and predicted times for a spacing of 1."""
    path, scratch = empty_path(fan)
    space = allocate_bending(len(path), fan.shape)
    nodes = np.empty((BENT_PARTS * len(path)) << len(fan.shape), np.int64)
    weights = np.empty(nodes.size)
    total = np.zeros(fan.tof.size)
    rays = len(fan.receivers)
    counts = np.zeros(rays, np.int64)
    predicted = np.zeros(rays)
    capacity = max(16, rays * 4 * sum(fan.shape))
    columns = np.empty(capacity, np.int32)
    lengths = np.empty(capacity, np.float32)
    filled = 0
    for row in range(rays):
        count, parts = trace_ray(fan, row, STRIDE, path, scratch), PARTS
        if fan.curved:
            predicted[row], count = bend(path, count, spline, fan.shape, space)
            parts = BENT_PARTS
        entries = list_entries(fan, path, count, parts, nodes, weights, scratch)
        if smooth or not fan.curved:
            # The spline is not one of the image itself.
            predicted[row] = 0.0
            for k in range(entries):
                predicted[row] += weights[k] * slowness[nodes[k]]
        while filled + entries > capacity:
            columns = np.concatenate((columns, np.empty(capacity, np.int32)))
            lengths = np.concatenate((lengths, np.empty(capacity, np.float32)))
            capacity *= 2
        start = filled
        filled = merge_entries(nodes, weights, entries, total, columns, lengths, filled)
        counts[row] = filled - start
    return counts, columns[:filled].copy(), lengths[:filled].copy(), predicted
