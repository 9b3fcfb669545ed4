"""Scene of a refractive rendering: a filtered volume with iso-surfaces between layers of refractive index."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Floats
from ..errors import InvalidInput
from ..isosurface.cell_bounds import cell_ranges
from ..isosurface.crossing import ANALYTIC, BRENT, CERTAIN, CERTAIN_BRENT, Search
from ..isosurface.octree import Octree, octree_of
from ..splines.spline import Spline

ROOTS = {"certain": CERTAIN, "brent": BRENT, "analytic": ANALYTIC}
STRUCTURES = ("octree", "dda", "steps")

# The largest coefficient of a field, in size. Cells are bounded in float32, with room for their bends above,
# and below for differences between values.
MIN_PEAK, MAX_PEAK = 1e-30, 1e35


@dataclass(frozen=True)
class Layers:
    """Nested iso-surfaces and the refractive indices between them.

    Attributes:
        isos: ascending iso-values, unit of the volume.
        indices: refractive index below the first, between them, and above the last; one more than ``isos``.
        surroundings: index of the layer around the volume: 0, the one below the first, or in
            water faster than fat the one between fat and tissue.

    Raises:
        InvalidInput: for none, iso-values that do not rise, another number of indices, one not above 0, or
            a layer that there is not.
    """

    isos: tuple[float, ...]
    indices: tuple[float, ...]
    surroundings: int = 0

    def __post_init__(self) -> None:
        rising = all(a < b for a, b in zip(self.isos, self.isos[1:], strict=False))
        if not self.isos or not rising or not all(map(math.isfinite, self.isos)):
            raise InvalidInput("iso", self.isos, "one or more finite, rising iso-values")
        if len(self.indices) != len(self.isos) + 1 or not all(0.0 < n < math.inf for n in self.indices):
            raise InvalidInput("indices", self.indices, f"{len(self.isos) + 1} refractive indices > 0")
        if not 0 <= self.surroundings <= len(self.isos):
            raise InvalidInput("surroundings", self.surroundings, f"a layer, 0 to {len(self.isos)}")


@dataclass(frozen=True)
class Scene:
    """A volume prepared for ray casting.

    Attributes:
        field: the filtered volume.
        octree: over its cells.
        layers: its iso-surfaces.
        origin: (3,) place of node 0, m.
        spacing: (3,) between nodes, m.
        grid: (2, 3) corners of the grid, nodes.
        box: (2, 3) the same of the cells that may hold a surface; ``grid`` if ``open``.
        open: whether the object may reach the faces of the grid, which then cut it.
        top: highest level of the octree with a node that a ray can skip.
        linear: whether the field is trilinear in each cell.
    """

    field: Spline
    octree: Octree
    layers: Layers
    origin: Floats
    spacing: Floats
    grid: Floats
    box: Floats
    open: bool
    top: int
    linear: bool

    @classmethod
    def build(
        cls,
        spline: Spline,
        layers: Layers,
        spacing_m: float | Sequence[float] = 1.0,
        centre_m: Sequence[float] = (0.0, 0.0, 0.0),
        bound: str = "bernstein",
        pause: Callable[[], None] = lambda: None,
    ) -> Scene:
        """Bound the cells and build the octree.

        Args:
            spline: of a volume (nx, ny, nz).
            layers: iso-values within the volume's range, and refractive indices.
            spacing_m: between nodes, one for all axes or one each, m.
            centre_m: where the middle of the volume lies, m.
            bound, pause: as in ``isosurface.cell_ranges``.

        Raises:
            InvalidInput: for a volume not in space or beyond the range of float32, an iso-value that the
                field nowhere has, a spacing that is not above 0, or an unknown bound.
        """
        if len(spline.shape) != 3:
            raise InvalidInput("volume", f"{len(spline.shape)} dimensions", "3 dimensions")
        biggest = float(max(spline.coefficients.max(), -spline.coefficients.min()))
        if not (biggest == 0.0 or MIN_PEAK <= biggest <= MAX_PEAK):
            accepted = f"values up to {MAX_PEAK:g}, the largest at least {MIN_PEAK:g}"
            raise InvalidInput("volume", f"values behind its filter up to {biggest:g} in size", accepted)
        spacing = np.broadcast_to(np.asarray(spacing_m, dtype=np.float64), 3).copy()
        if not ((spacing > 0.0) & np.isfinite(spacing)).all():
            raise InvalidInput("spacing_m", spacing.tolist(), "finite distances > 0 m")
        cells = cell_ranges(spline, layers.isos, bound, pause)
        octree = octree_of(cells, layers.isos)
        for bit, iso in enumerate(layers.isos):
            if not octree.masks[-1] >> bit & 1:
                low, high = range_at_nodes(spline)
                raise InvalidInput("iso", iso, f"between {low:.6g} and {high:.6g}, the volume's range")
        origin = np.asarray(centre_m, dtype=np.float64) - 0.5 * spacing * (np.array(spline.shape) - 1.0)
        edges = [edge for axis in range(3) for edge in _ends(axis)]
        below, above = (-math.inf, *layers.isos, math.inf)[layers.surroundings :][:2]
        cut = any(cells.high[edge].max() >= above or cells.low[edge].min() <= below for edge in edges)
        grid = np.array([[0.0] * 3, cells.low.shape])
        box = grid if cut else octree.occupied()
        linear = spline.filter.name in ("trilinear", "central")
        return cls(spline, octree, layers, origin, spacing, grid, box, cut, octree.highest_empty(), linear)

    def search(self, structure: str = "octree", roots: str = "certain", step: float = 0.1) -> Search:
        """Settings of the search for surfaces.

        Args:
            structure: "octree"; "dda", through all cells; "steps", of fixed length.
            roots: "certain"; "brent"; or "analytic", of trilinear cells. Steps always use Brent's method.
            step: length of the steps, nodes.

        Raises:
            InvalidInput: for another name, or an analytic root of another filter.
        """
        if structure not in STRUCTURES:
            raise InvalidInput("structure", structure, "one of " + ", ".join(STRUCTURES))
        if roots not in ROOTS or (roots == "analytic" and not self.linear):
            accepted = ROOTS if self.linear else [name for name in ROOTS if name != "analytic"]
            raise InvalidInput("roots", roots, "one of " + ", ".join(accepted))
        if not step > 0.0:
            raise InvalidInput("step", step, "a number of nodes > 0")
        top = self.top if structure == "octree" else 0
        certain = CERTAIN_BRENT if self.linear else CERTAIN
        return Search(
            certain if roots == "certain" else ROOTS[roots], top, step if structure == "steps" else 0.0
        )


def _ends(axis: int) -> tuple[tuple[slice | int, ...], tuple[slice | int, ...]]:
    """Slices that select the first and the last layer of cells across an axis."""
    before = (slice(None),) * axis
    return (*before, 0), (*before, -1)


def range_at_nodes(spline: Spline) -> tuple[float, float]:
    """Least and greatest value of (nx, ny, nz) nodes; plane by plane, since volumes may be large."""
    x, y, z = spline.shape
    plane = np.stack(np.meshgrid(np.arange(y), np.arange(z), indexing="ij"), axis=-1).reshape(-1, 2)
    ends = []
    for i in range(x):
        values = spline.value(np.column_stack([np.full(len(plane), i), plane]))
        ends.append((values.min(), values.max()))
    return float(np.min(ends)), float(np.max(ends))
