"""Rasterisation of a chart: the surface point of each pixel."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import Flags, Floats, Ints
from ...compilation.compiled import kernel
from ...errors import InvalidInput
from ...meshes.mesh import Chart
from ...meshes.topology import topology_of

OUTSIDE, INSIDE, SEAM = 0, 1, 2

# How far from the chart a pixel still gets the nearest point of its boundary, pixels: the diagonal of a cell.
REACH = 1.5


@dataclass(frozen=True)
class Raster:
    """Pixel (i, j) of n² lies at (u, v) = (i, j)/(n − 1).

    Attributes:
        kind: (n, n) ``INSIDE`` the chart; ``OUTSIDE`` of it; ``SEAM``: outside, but so near that it stands
            for the nearest point of the chart's boundary, so that cells of pixels cover the whole chart.
        face: (n, n) the face of the point, −1 outside.
        weights: (n, n, 3) of the face's corners, 0 outside.
        cells: (n − 1, n − 1) whether the chart has part in the cell of pixels (i, j) to (i + 1, j + 1).
    """

    kind: NDArray[np.uint8]
    face: NDArray[np.int32]
    weights: Floats
    cells: Flags

    def sampled(self, values: Floats) -> Floats:
        """Values of the corners, (faces, 3, k), at the pixels: (n, n, k), 0 outside."""
        at = values[np.maximum(self.face, 0)]
        return np.asarray((self.weights[..., np.newaxis] * at).sum(axis=2))


def seam_sides(chart: Chart) -> Ints:
    """The sides, 3·face + corner, along the boundary of a chart: the mesh's, and both sides of cuts."""
    topology = topology_of(chart.mesh.faces)
    alone = topology.edge_sides[topology.on_boundary, 0]
    pairs = topology.edge_sides[~topology.on_boundary]
    ends = chart.uv.reshape(-1, 2), np.roll(chart.uv, -1, axis=1).reshape(-1, 2)
    first, other = pairs.T
    apart = (ends[0][first] != ends[1][other]).any(axis=1) | (ends[1][first] != ends[0][other]).any(axis=1)
    return np.concatenate((alone, pairs[apart].ravel()))


def rasterised(chart: Chart, size: int) -> Raster:
    """The points of a surface at size² pixels.

    Raises:
        InvalidInput: for a size below 8.
    """
    if size < 8:
        raise InvalidInput("size", size, "8 pixels or more")
    kind = np.zeros((size, size), np.uint8)
    face = np.full((size, size), -1, np.int32)
    weights = np.zeros((size, size, 3))
    cells = np.zeros((size - 1, size - 1), bool)
    positions = chart.uv * (size - 1)
    _fill(positions, kind, face, weights)
    _follow(positions, seam_sides(chart), kind, face, weights, cells)
    inside = kind == INSIDE
    cells |= inside[:-1, :-1] | inside[1:, :-1] | inside[:-1, 1:] | inside[1:, 1:]
    return Raster(kind, face, weights, cells)


@kernel
def _fill(places: Floats, kind: NDArray[np.uint8], face: NDArray[np.int32], weights: Floats) -> None:
    size = len(kind)
    for f in range(len(places)):
        ax, ay = places[f, 0, 0], places[f, 0, 1]
        bx, by = places[f, 1, 0], places[f, 1, 1]
        cx, cy = places[f, 2, 0], places[f, 2, 1]
        double = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if double <= 0.0:
            continue
        for i in range(max(int(np.ceil(min(ax, bx, cx))), 0), min(int(max(ax, bx, cx)), size - 1) + 1):
            for j in range(max(int(np.ceil(min(ay, by, cy))), 0), min(int(max(ay, by, cy)), size - 1) + 1):
                first = ((bx - i) * (cy - j) - (by - j) * (cx - i)) / double
                second = ((cx - i) * (ay - j) - (cy - j) * (ax - i)) / double
                third = 1.0 - first - second
                # A pixel on the edge of two faces may be given to either, but must not be lost to rounding.
                if min(first, second, third) >= -1e-12:
                    kind[i, j] = INSIDE
                    face[i, j] = f
                    weights[i, j, 0], weights[i, j, 1], weights[i, j, 2] = first, second, third


@kernel
def _follow(
    places: Floats,
    sides: Ints,
    kind: NDArray[np.uint8],
    face: NDArray[np.int32],
    weights: Floats,
    cells: Flags,
) -> None:
    size = len(kind)
    nearest = np.full((size, size), REACH * REACH)
    for side in sides:
        f, k = side // 3, side % 3
        m = (k + 1) % 3
        ax, ay = places[f, k, 0], places[f, k, 1]
        along_x, along_y = places[f, m, 0] - ax, places[f, m, 1] - ay
        square = along_x * along_x + along_y * along_y
        # Cells are found at steps of a quarter pixel: what lies between is too small to matter.
        steps = int(4.0 * np.sqrt(square)) + 1
        for step in range(steps + 1):
            i = min(max(int(ax + along_x * step / steps), 0), size - 2)
            j = min(max(int(ay + along_y * step / steps), 0), size - 2)
            cells[i, j] = True
        low_i = max(int(np.ceil(min(ax, ax + along_x) - REACH)), 0)
        low_j = max(int(np.ceil(min(ay, ay + along_y) - REACH)), 0)
        for i in range(low_i, min(int(max(ax, ax + along_x) + REACH), size - 1) + 1):
            for j in range(low_j, min(int(max(ay, ay + along_y) + REACH), size - 1) + 1):
                if kind[i, j] == INSIDE:
                    continue
                t = 0.0
                if square > 0.0:
                    t = min(max(((i - ax) * along_x + (j - ay) * along_y) / square, 0.0), 1.0)
                x, y = ax + t * along_x - i, ay + t * along_y - j
                if x * x + y * y < nearest[i, j]:
                    nearest[i, j] = x * x + y * y
                    kind[i, j] = SEAM
                    face[i, j] = f
                    weights[i, j, k], weights[i, j, m], weights[i, j, 3 - k - m] = 1.0 - t, t, 0.0
