"""Phantoms with an exact description, sampled on any grid."""

from .ellipses import Ellipse, EllipsePhantom
from .table6 import TABLE6_SIDE_M, table6

__all__ = ["TABLE6_SIDE_M", "Ellipse", "EllipsePhantom", "table6"]
