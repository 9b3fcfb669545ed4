"""Iso-surfaces of filtered volumes: where they can be, and where a ray meets them."""

from .cell_bounds import BOUNDS, CellRanges, cell_ranges

__all__ = ["BOUNDS", "CellRanges", "cell_ranges"]
