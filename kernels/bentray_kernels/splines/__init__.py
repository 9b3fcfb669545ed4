"""Splines through the nodes of a grid."""

from .cubic import coefficients

__all__ = ["coefficients"]
