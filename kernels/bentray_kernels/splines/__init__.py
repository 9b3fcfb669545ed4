"""Splines through the nodes of a grid."""

from .cubic import coefficients, refined
from .filters import FILTERS, Filter
from .spline import Spline

__all__ = ["FILTERS", "Filter", "Spline", "coefficients", "refined"]
