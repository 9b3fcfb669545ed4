"""Range of the field within every cell, by a selectable bound."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..compilation.compiled import kernel
from ..errors import InvalidInput
from ..splines.spline import Spline
from .accc import product_ranges, weighted_range
from .bernstein import Length, bend_bound, contract, hull, length
from .bmcc import support_ranges
from .ccc import exact_range
from .cell_weights import cell_weights

BOUNDS = ("bmcc", "accc", "accc-subcells", "bernstein", "ccc")

# Parts of a cell along each axis in "accc-subcells".
DIVISIONS = 2

# Cells along x that are bounded between two pauses.
LAYERS = 4

# float32 keeps 2⁻²⁴ of a number; twice that for the casting and again for the rounding of the field itself.
OUTWARD = 2.0**-22


class CellRanges(NamedTuple):
    """Bounds of every cell, float32, (nx − 1, ny − 1, nz − 1): the cell (i, j, k) lies after that node.

    Attributes:
        low: not above any value in the cell.
        high: not below any value in the cell.
        bend: not below |d²f/ds²| along any line in the cell, per node²; 0 in cells that reach no iso-value.
    """

    low: NDArray[np.float32]
    high: NDArray[np.float32]
    bend: NDArray[np.float32]

    def candidates(self, iso: float) -> int:
        """How many cells may hold the iso-surface."""
        return int(np.count_nonzero((self.low <= iso) & (self.high >= iso)))


def cell_ranges(
    spline: Spline, isos: Sequence[float], bound: str, pause: Callable[[], None] = lambda: None
) -> CellRanges:
    """Bound the field in every cell; no cell that contains an iso-value is missed.

    This holds for fields within the range of float32, in which the bounds are kept; ``Scene.build`` refuses
    others.

    The range of the coefficients ("bmcc") is taken first; cells where it holds an iso-value get a closer
    bound. So the ranges hold for every iso-value, and are close for those named.

    Args:
        spline: (nx, ny, nz) nodes.
        isos: iso-values.
        bound: "bmcc", "accc", "accc-subcells", "bernstein" (the hull of the cell's polynomial) or "ccc" (its
            exact range; slow, kept as the reference).
        pause: called before every few layers of cells; an exception that it raises ends the work.

    Raises:
        InvalidInput: no such bound.
    """
    if bound not in BOUNDS:
        raise InvalidInput("bound", bound, "one of " + ", ".join(BOUNDS))
    weights = cell_weights(spline.filter)
    wide = support_ranges(spline, weights)
    low, high = _outward(wide[0], -1.0), _outward(wide[1], 1.0)
    ranges = CellRanges(low, high, np.zeros_like(low))
    divisions = DIVISIONS if bound == "accc-subcells" else 1
    for x in range(0, len(low), LAYERS):
        pause()
        _refine(
            spline.coefficients[x:],
            spline.pad + weights.first,
            np.asarray(isos, dtype=np.float64),
            BOUNDS.index(bound),
            product_ranges(weights, divisions),
            (weights.control(0), weights.control(1), weights.control(2)),
            len(weights.powers),
            length(weights.nodes),
            length(len(weights.powers) * (weights.degree + 1)),
            weights.total(),
            CellRanges(*(part[x : x + LAYERS] for part in ranges)),
        )
    return ranges


def _outward(values: Floats, sign: float) -> NDArray[np.float32]:
    return (values + sign * OUTWARD * np.abs(values)).astype(np.float32)


@kernel
def _refine(
    coefficients: Floats,
    first: int,
    isos: Floats,
    bound: int,
    products: tuple[Floats, Floats],
    control: tuple[Floats, Floats, Floats],
    pieces: int,
    across: Length,
    rows: Length,
    total: float,
    ranges: CellRanges,
) -> None:
    """Closer ranges, and the bend, of the cells that may hold an iso-value."""
    value, slope, bend = control
    least, most = products
    n, m = len(across), len(rows)
    nodes, line = np.empty(n * n * n), np.empty(n)
    one_axis, two_axes, form = np.empty(m * n * n), np.empty(m * m * n), np.empty(m * m * m)
    for i, j, k in np.ndindex(ranges.low.shape):
        if not _reaches(isos, ranges, i, j, k):
            continue
        at = 0
        for p in range(n):
            for q in range(n):
                for r in range(n):
                    nodes[at] = coefficients[i + first + p, j + first + q, k + first + r]
                    at += 1
        low, high = float(ranges.low[i, j, k]), float(ranges.high[i, j, k])
        if bound == 3:
            contract(nodes, value, value, value, across, rows, one_axis, two_axes, form)
            low, high = hull(form)
        elif bound == 4:
            low, high = exact_range(nodes, value, pieces)
        elif bound > 0:
            low, high = weighted_range(nodes, least, most)
        margin = OUTWARD * max(abs(low), abs(high))
        ranges.low[i, j, k] = max(float(ranges.low[i, j, k]), low - margin)
        ranges.high[i, j, k] = min(float(ranges.high[i, j, k]), high + margin)
        if _reaches(isos, ranges, i, j, k):
            ranges.bend[i, j, k] = bend_bound(nodes, slope, bend, across, total, line) * (1.0 + OUTWARD)


@kernel(inline="always")
def _reaches(isos: Floats, ranges: CellRanges, i: int, j: int, k: int) -> bool:
    """Whether a cell may hold one of the iso-values."""
    reached = False
    for iso in isos:
        reached |= ranges.low[i, j, k] <= iso <= ranges.high[i, j, k]
    return reached
