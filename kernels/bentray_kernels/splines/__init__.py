"""Splines through the nodes of a grid."""

from .cubic import coefficients, refined

__all__ = ["coefficients", "refined"]
