"""Spline and filter interpolation on grids: value and gradient between the nodes."""

from .cubic import coefficients, refined
from .filters import FILTERS, Filter
from .smoothing import noise_of, smoothing_for_noise
from .spline import Spline

__all__ = ["FILTERS", "Filter", "Spline", "coefficients", "noise_of", "refined", "smoothing_for_noise"]
