"""Iso-surfaces of filtered volumes: cell classification and ray intersection."""

from .cell_bounds import BOUNDS, CellRanges, cell_ranges

__all__ = ["BOUNDS", "CellRanges", "cell_ranges"]
