"""Splines through the nodes of a grid, and the other filters that read between them."""

from .cubic import coefficients, refined
from .filters import FILTERS, Filter
from .smoothing import noise_of, smoothing_for_noise
from .spline import Spline

__all__ = ["FILTERS", "Filter", "Spline", "coefficients", "noise_of", "refined", "smoothing_for_noise"]
