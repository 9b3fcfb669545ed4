"""Angular coverage of an array: the directions in which paths between its elements cross the image.

An edge is visible in transmission where a path runs along it; edges in the missing directions are blurred
(limited angle).
"""

import math
from typing import NamedTuple

import numpy as np

from ..arrays import Flags, Floats
from .array_hull import check_extent, depth_inside

# Cells along the longest side of the array: for each so many elements and paths; fewest and most cells.
ELEMENTS_PER_CELL, PATHS_PER_CELL, MIN_CELLS, MAX_CELLS, MAX_CELLS_IN_SPACE = 4.0, 100.0, 3, 16, 7

# Directions of edges that are distinguished, in 2-D over half a turn and in 3-D over half a sphere.
DIRECTIONS, NORMALS = 12, 40

# In 3-D a path within this angle of an edge's plane runs along it, degrees.
ALONG_DEG = 10.0

# Cells within this part of the greatest depth from the faces of the hull are not examined.
RIM = 0.15

# Paths that are examined, drawn evenly; with fewer than so many for each cell, none are.
MAX_PATHS, MIN_PATHS = 20_000, 4.0

# Coverage of less than this part of the directions, and gaps of the array wider than this, degrees, and than
# so many usual distances of elements, are limited.
COMPLETE, WIDEST_GAP_DEG, USUAL = 0.85, 45.0, 3.0

# Elements lie on a circle if their distances from its centre differ by less than this part of it.
ROUND = 0.05


class AngularCoverage(NamedTuple):
    """Directions in which paths cross the cells of an image.

    Attributes:
        visible: mean part of the directions of edges along which a path runs, from 0 to 1.
        least: the same in the worst cell.
        missing_deg: 2-D: edges between these angles from the x axis are mostly blurred; None without any.
        turn_deg: 2-D: part of the turn that the elements cover, seen from the middle of the array; None
            without a wide gap.
        limited: whether the coverage is incomplete.
    """

    visible: float
    least: float
    missing_deg: tuple[float, float] | None
    turn_deg: float | None
    limited: bool

    def __str__(self) -> str:
        """A sentence in plain words."""
        if not self.limited:
            return "Paths cross the object in every direction."
        coverage = f"paths run in {100.0 * self.visible:.0f} % of the directions on average"
        if self.turn_deg is not None:
            coverage = f"elements cover {self.turn_deg:.0f}° of 360°, {coverage}"
        edges = "edges parallel to the missing directions"
        if self.missing_deg is not None:
            edges += f", mostly {self.missing_deg[0]:.0f}° to {self.missing_deg[1]:.0f}° from the x axis,"
        return f"Limited angle: {coverage}; {edges} are blurred."


def angular_coverage(position_m: Floats, start_m: Floats, end_m: Floats) -> AngularCoverage | None:
    """Angular coverage inside the hull of an array; None for too few paths.

    Args:
        position_m: (elements, ndim), of the elements, m.
        start_m, end_m: (paths, ndim), ends of the paths, m.

    Raises:
        InvalidInput: as ``array_hull.check_extent``.
    """
    check_extent(position_m)
    ndim = position_m.shape[1]
    # On a surface in space the distance of elements follows from the square root of their number.
    around = len(position_m) if ndim == 2 else 2.0 * math.sqrt(len(position_m))
    most = MAX_CELLS if ndim == 2 else MAX_CELLS_IN_SPACE
    fine = min(around / ELEMENTS_PER_CELL, len(start_m) / PATHS_PER_CELL)
    cells = int(np.clip(fine, MIN_CELLS, most))
    low, size = position_m.min(axis=0), float(np.ptp(position_m, axis=0).max())
    width = size / cells
    shape = tuple(int(n) for n in np.maximum(np.ceil(np.ptp(position_m, axis=0) / width - 1e-9), 1))
    indices = np.stack(np.meshgrid(*map(np.arange, shape), indexing="ij"), axis=-1).reshape(-1, ndim)
    depth = depth_inside(position_m, low + (indices + 0.5) * width)
    inside = depth > RIM * depth.max()
    if depth.max() <= 0.0 or len(start_m) < MIN_PATHS * inside.sum():
        return None
    drawn = slice(None, None, -(-len(start_m) // MAX_PATHS))
    start, end = start_m[drawn], end_m[drawn]
    edges = _edge_normals(ndim)
    crossed = _crossed(start, end, edges, (low, width, shape))[inside]
    visible = crossed.mean(axis=1)
    turn = _turn(position_m) if ndim == 2 else None
    limited = bool(visible.mean() < COMPLETE or turn is not None)
    missing = _missing(crossed.mean(axis=0)) if ndim == 2 else None
    return AngularCoverage(float(visible.mean()), float(visible.min()), missing, turn, limited)


def _edge_normals(ndim: int) -> Floats:
    """Unit normals of the edges that are distinguished, (n, ndim)."""
    if ndim == 2:
        angle = np.pi * (np.arange(DIRECTIONS) + 0.5) / DIRECTIONS
        return np.column_stack((-np.sin(angle), np.cos(angle)))
    # A spiral over half a sphere.
    z = (np.arange(NORMALS) + 0.5) / NORMALS
    turn = np.pi * (1.0 + math.sqrt(5.0)) * np.arange(NORMALS)
    across = np.sqrt(1.0 - z**2)
    return np.column_stack((across * np.cos(turn), across * np.sin(turn), z))


def _crossed(start: Floats, end: Floats, edges: Floats, grid: tuple[Floats, float, tuple[int, ...]]) -> Flags:
    """(cells, edges): whether a path crosses a cell along an edge."""
    low, width, shape = grid
    along = end - start
    direction = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-12)
    limit = math.sin(0.5 * math.pi / DIRECTIONS) if len(low) == 2 else math.sin(math.radians(ALONG_DEG))
    # Twice in each cell.
    fraction = np.linspace(0.0, 1.0, 2 * max(shape) + 1)
    points = start[:, None] + fraction[:, None] * along[:, None]
    node = np.clip(((points - low) / width).astype(np.int64), 0, np.array(shape) - 1)
    cell = np.ravel_multi_index(tuple(np.moveaxis(node, -1, 0)), shape)
    crossed = np.zeros((math.prod(shape), len(edges)), dtype=np.bool_)
    for k, normal in enumerate(edges):
        crossed[cell[np.abs(direction @ normal) <= limit + 1e-9].ravel(), k] = True
    return crossed


def _missing(visible: Floats) -> tuple[float, float] | None:
    """The widest run of directions that fewer than half of the cells have, degrees; None without one."""
    rare = visible < 0.5
    if not rare.any() or rare.all():
        return None
    first = int(np.argmin(rare))
    turned = np.roll(rare, -first)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], turned, [False])).astype(np.int8)))
    runs = edges.reshape(-1, 2)
    begin, end = max(runs.tolist(), key=lambda run: run[1] - run[0])
    step = 180.0 / len(visible)
    low = (begin + first) * step % 180.0
    return low, low + (end - begin) * step


def _turn(position: Floats) -> float | None:
    """Part of the turn that elements cover from the middle, degrees; None without a wide gap."""
    # The circle through the elements (Kåsa), or the middle of their extent.
    x, y = position[:, 0], position[:, 1]
    rows = np.column_stack((2.0 * x, 2.0 * y, np.ones(len(x))))
    fitted = np.linalg.lstsq(rows, x**2 + y**2, rcond=None)[0]
    middle = np.asarray(fitted[:2], dtype=np.float64)
    radius = np.linalg.norm(position - middle, axis=1)
    if np.ptp(radius) > ROUND * radius.mean():
        middle = np.asarray(0.5 * (position.min(axis=0) + position.max(axis=0)), dtype=np.float64)
    angle = np.sort(np.degrees(np.arctan2(*(position - middle).T[::-1])) % 360.0)
    gaps = np.diff(np.append(angle, angle[0] + 360.0))
    usual = float(np.median(gaps))
    wide = gaps > max(WIDEST_GAP_DEG, USUAL * usual)
    return float(360.0 - (gaps[wide] - usual).sum()) if wide.any() else None
