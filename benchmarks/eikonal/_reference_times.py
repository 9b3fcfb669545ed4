"""Reference travel times of rough media: the first-order equation itself, and times along grid edges.

Where a medium varies from node to node no grid is fine enough for the exact time, but the discrete
first-order equation has exactly one solution. Whether given times are that solution is checked in NumPy, by
code that no solver shares. Times of second order lie between a part of its solution and about the times along
the edges of the grid.
"""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra


def godunov(tof: np.ndarray, slowness: np.ndarray, spacing: float) -> np.ndarray:
    """The first-order time of every node from its neighbours' times, s (Zhao 2005, equations 2.4 and 2.6).

    Args:
        tof: (nx, ny[, nz]), s.
        slowness: as ``tof``, s/m.
        spacing: of the nodes, m.
    """
    padded = np.pad(tof, 1, constant_values=np.inf)
    inside = (slice(1, -1),) * tof.ndim
    earlier = np.sort(
        [
            np.minimum(np.roll(padded, 1, axis)[inside], np.roll(padded, -1, axis)[inside])
            for axis in range(tof.ndim)
        ],
        axis=0,
    )
    crossing = slowness * spacing
    time = earlier[0] + crossing
    for axes in range(2, tof.ndim + 1):
        finite = np.where(np.isfinite(earlier[:axes]), earlier[:axes], 0.0)
        # About the earliest, so that close times keep their digits.
        off = finite - finite[0]
        total, squares = off.sum(axis=0), (off**2).sum(axis=0)
        root = total**2 - axes * (squares - crossing**2)
        joint = finite[0] + (total + np.sqrt(np.maximum(root, 0.0))) / axes
        time = np.where(time > earlier[axes - 1], joint, time)
    return time


def equation_error(tof: np.ndarray, speed: np.ndarray, source: np.ndarray) -> float:
    """Largest relative difference between a time and that of its neighbours; 0 for the first-order solution.

    Nodes of the source's cell, which have straight times, may be earlier but not later. Spacing 1.

    Args:
        tof: (nx, ny[, nz]), s.
        speed: as ``tof``, nodes/s.
        source: (ndim,), nodes.
    """
    wanted = godunov(tof, 1.0 / speed, 1.0)
    off = np.abs(np.indices(tof.shape) - source.reshape((-1,) + (1,) * tof.ndim))
    near = (off < 1.0).all(axis=0)
    error = np.where(near, np.maximum(tof - wanted, 0.0), np.abs(tof - wanted)) / np.maximum(wanted, 1e-300)
    return float(error.max())


def edge_times(speed: np.ndarray, source: np.ndarray) -> np.ndarray:
    """Shortest times along edges of the grid at the speed of their slower ends, s.

    Within the source's cell times are straight, at its slowest speed.

    Args:
        speed: (nx, ny[, nz]), nodes/s.
        source: (ndim,), nodes.
    """
    number = np.arange(speed.size).reshape(speed.shape)
    crossing = 1.0 / speed
    rows, columns, costs = [], [], []
    for axis in range(speed.ndim):
        low, high = (
            tuple(slice(*ends) if other == axis else slice(None) for other in range(speed.ndim))
            for ends in ((None, -1), (1, None))
        )
        cost = np.maximum(crossing[low], crossing[high]).ravel()
        rows += [number[low].ravel(), number[high].ravel()]
        columns += [number[high].ravel(), number[low].ravel()]
        costs += [cost, cost]
    # The source is one node more, joined to those of its cell.
    off = np.abs(np.indices(speed.shape) - source.reshape((-1,) + (1,) * speed.ndim))
    near = np.flatnonzero((off < 1.0).all(axis=0).ravel())
    first = crossing.ravel()[near].max()
    straight = np.sqrt((off**2).sum(axis=0)).ravel()[near]
    rows.append(np.full(near.size, speed.size))
    columns.append(near)
    costs.append(np.maximum(straight * first, 1e-300))
    begin, end, cost = np.concatenate(rows), np.concatenate(columns), np.concatenate(costs)
    # Straight times are final: nothing leads back into the cell.
    kept = (begin == speed.size) | ~np.isin(end, near)
    graph = coo_array((cost[kept], (begin[kept], end[kept])), shape=(speed.size + 1,) * 2)
    times = dijkstra(graph.tocsr(), indices=speed.size)[:-1]
    return np.asarray(times).reshape(speed.shape)
