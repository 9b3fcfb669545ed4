"""Pictures as PNG: one slice of a reconstruction or a volume, a report, a comparison with the truth."""

from .comparison import comparison_png
from .look import COLORMAPS
from .report import report_png
from .slice import slice_png
from .volume_slice import volume_slice_png

__all__ = ["COLORMAPS", "comparison_png", "report_png", "slice_png", "volume_slice_png"]
