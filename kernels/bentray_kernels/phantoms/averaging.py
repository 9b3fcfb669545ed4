"""Cell averages of a plane through solids; cells are supersampled only at boundaries."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation

from ..arrays import Flags, Floats
from .ellipses import SUBSAMPLES, node_positions
from .solids import Solid

# Points along each edge of a cell that has a height: 216 in all place a boundary as finely as 64 in a square.
VOLUME_SUBSAMPLES = 6


def plane_means(
    solids: Sequence[Solid], nodes: int, side_m: float, z: float, height: float, values: Sequence[float]
) -> Floats:
    """Means over the cells round the nodes of a square centred on the z axis.

    Args:
        solids: painted in order.
        nodes: nodes along each side.
        side_m: distance of the first from the last node, m.
        z: of the plane, m.
        height: of the cells, m; 0 averages in the plane alone.
        values: outside the solids, then inside each.

    Returns:
        (nodes, nodes), x first, in the unit of ``values``.

    Raises:
        InvalidInput: for a grid that is not one.
    """
    axis = node_positions(nodes, side_m)
    covers = [_cover(solid, axis, z, height) for solid in solids]
    label = np.zeros((nodes, nodes), np.uint8)
    cut = np.zeros((nodes, nodes), bool)
    for number, (wholly, partly) in enumerate(covers, start=1):
        label[wholly] = number
        cut |= partly
    table = np.asarray(values, dtype=np.float64)
    means = table[label]
    means[cut] = table[_labels(solids, covers, cut, axis, z, height)].mean(axis=1)
    return means


def _cover(solid: Solid, axis: Floats, z: float, height: float) -> tuple[Flags, Flags]:
    """Cells that lie wholly in the solid, and cells that its boundary may pass through."""
    half = 0.5 * (axis[1] - axis[0])
    edges = np.append(axis - half, axis[-1] + half)
    mixed = np.zeros((len(axis), len(axis)), bool)
    every = ~mixed
    for level in (z,) if height == 0.0 else (z - 0.5 * height, z, z + 0.5 * height):
        within = solid.level(edges[:, None], edges[None, :], np.array(level)) <= 1.0
        for corner in (within[:-1, :-1], within[1:, :-1], within[:-1, 1:], within[1:, 1:]):
            mixed |= corner
            every &= corner
    # One cell more all round: a boundary may dip into a cell and leave all its corners on one side.
    partly = binary_dilation(mixed & ~every, np.ones((3, 3), bool))
    return every & ~partly, partly


def _labels(
    solids: Sequence[Solid],
    covers: Sequence[tuple[Flags, Flags]],
    cut: Flags,
    axis: Floats,
    z: float,
    height: float,
) -> NDArray[np.uint8]:
    """Number of the solid on top, from 1, at each point of each cell in ``cut``; (cells, points)."""
    count = SUBSAMPLES if height == 0.0 else VOLUME_SUBSAMPLES
    offsets = (np.arange(count) + 0.5) / count - 0.5
    levels = offsets * height if height > 0.0 else np.zeros(1)
    across = offsets * (axis[1] - axis[0])
    dx, dy, dz = (p.ravel() for p in np.meshgrid(across, across, levels, indexing="ij"))
    label = np.zeros((np.count_nonzero(cut), len(dx)), np.uint8)
    for number, (solid, (wholly, partly)) in enumerate(zip(solids, covers, strict=True), start=1):
        label[wholly[cut]] = number
        i, j = np.nonzero(partly)
        within = solid.level(axis[i][:, None] + dx, axis[j][:, None] + dy, z + dz) <= 1.0
        rows = np.flatnonzero(partly[cut])
        label[rows] = np.where(within, np.uint8(number), label[rows])
    return label
