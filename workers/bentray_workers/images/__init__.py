"""Pictures of reconstructions as PNG: one slice, a report, a comparison of several with the truth."""

from .comparison import comparison_png
from .report import report_png
from .slice import COLORMAPS, slice_png

__all__ = ["COLORMAPS", "comparison_png", "report_png", "slice_png"]
