"""Sensitivities of travel times at receivers to the slowness, all at once and without rays.

In a settled first-order field the time of a node is a mean of its earlier neighbours' times plus its own
crossing: with p_a = (T − T_a)⁺ along axis a and Σ p_a² = (h·s)²,
δT = Σ w_a·δT_a + h·(√Σp² / Σp)·δs, w_a = p_a / Σp. So what receivers are worth flows back through the
transposed weights, from late nodes to early ones: the adjoint state (Leung & Qian 2006) of the discrete
equation, one triangular solve (Treister & Haber 2016). The flow spreads like the difference's numerical
viscosity: over about the square root of the distance, in nodes, either side of the ray.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import Floats, Ints
from ..compiled import kernel
from ..errors import InvalidInput
from .problem import Medium, PointSource


def adjoint(
    tof: ArrayLike, spacing: float, source: ArrayLike, receivers: ArrayLike, values: ArrayLike
) -> Floats:
    """Σ value · dT(receiver) / d slowness(node) over the receivers.

    Exact for a first-order field (``fsm``, ``fim``, ``fmm`` with ``order=1``) as long as no node changes the
    neighbours that it takes its time from; T(receiver) is multilinear between nodes. For the fields of other
    methods it is the first-order estimate.

    Args:
        tof: (nx, ny[, nz]), s, as ``solve`` gives it.
        spacing: node spacing, m.
        source: (ndim,), m, where ``tof`` was solved from.
        receivers: (k, ndim), m, in the grid; node 0 lies at 0.
        values: (k,), in any unit.

    Returns:
        As ``tof``, m times the unit of the values. With values of 1 the nodes' sum is the length of
        the rays, and weighted by the slowness it is the travel time.

    Raises:
        InvalidInput: naming the argument: shapes, numbers that are not finite, points outside the grid.
    """
    times = np.ascontiguousarray(tof, dtype=np.float64)
    if times.ndim not in (2, 3) or times.size == 0:
        raise InvalidInput("tof", f"shape {times.shape}", "a non-empty 2-D or 3-D array")
    if not np.isfinite(times).all():
        raise InvalidInput("tof", "a time that is not finite", "finite travel times in seconds")
    problem = Medium.checked(np.ones(times.shape), spacing).source(source)
    points = np.asarray(receivers, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != times.ndim:
        raise InvalidInput("receivers", f"shape {points.shape}", f"(receivers, {times.ndim})")
    worth = np.asarray(values, dtype=np.float64)
    if worth.shape != (len(points),) or not np.isfinite(worth).all():
        raise InvalidInput("values", f"shape {worth.shape}", f"({len(points)},), finite")
    flow = _received(problem, points, worth)
    padded = np.pad(times, 1, constant_values=np.inf).ravel()
    seeds, lengths = problem.seeds()
    inside = np.flatnonzero(padded < np.inf)
    latest_first = inside[np.argsort(padded[inside])[::-1]]
    into = _flow_back(latest_first, padded, problem.strides, problem.spacing, flow, seeds)
    # A seed's time is its distance times the mean of its own and the source's slowness.
    into[seeds] += 0.5 * flow[seeds] * lengths
    at_source = 0.5 * float((flow[seeds] * lengths).sum())
    into += at_source * _weights(problem, problem.source[None, :], np.ones(1))
    return problem.interior(into)


def _received(problem: PointSource, points: Floats, values: Floats) -> Floats:
    """Values at points, spread over the nodes of their cells; padded and flat."""
    last = problem.spacing * (np.array(problem.slowness.shape) - 1)
    slack = 1e-9 * problem.spacing
    bad = ~((points >= -slack) & (points <= last + slack)).all(axis=1)
    if bad.any():
        k = int(np.flatnonzero(bad)[0])
        raise InvalidInput(
            "receivers", f"{points[k].tolist()} (number {k})", f"points from 0 to {last.tolist()} m"
        )
    return _weights(problem, np.clip(points, 0.0, last), values)


def _weights(problem: PointSource, points: Floats, values: Floats) -> Floats:
    """Multilinear weights of points in the grid times their values; padded and flat."""
    places = points / problem.spacing
    shape = np.array(problem.slowness.shape)
    low = np.clip(places.astype(np.int64), 0, np.maximum(shape - 2, 0))
    part = places - low
    into = np.zeros(problem.padded_slowness.size)
    strides = np.array(problem.strides)
    for which in np.ndindex((2,) * len(shape)):
        corner = np.array(which)
        weight = np.where(corner == 1, part, 1.0 - part).prod(axis=1)
        np.add.at(into, ((low + 1 + corner) * strides).sum(axis=1), weight * values)
    return into


@kernel
def _flow_back(
    latest_first: Ints, time: Floats, strides: tuple[int, ...], spacing: float, flow: Floats, seeds: Ints
) -> Floats:
    """Let ``flow`` run, in place, from nodes to their earlier neighbours; returns flow times crossing, m."""
    crossed = np.zeros(time.size)
    seed = np.zeros(time.size, np.bool_)
    for node in seeds:
        seed[node] = True
    for node in latest_first:
        if flow[node] == 0.0 or seed[node]:
            continue
        total = square = 0.0
        for stride in strides:
            fall = max(time[node] - min(time[node - stride], time[node + stride]), 0.0)
            total += fall
            square += fall * fall
        if total == 0.0:
            continue
        share = flow[node] / total
        crossed[node] = share * np.sqrt(square) * spacing
        for stride in strides:
            earlier = node - stride if time[node - stride] <= time[node + stride] else node + stride
            fall = time[node] - time[earlier]
            if fall > 0.0:
                flow[earlier] += share * fall
    return crossed
