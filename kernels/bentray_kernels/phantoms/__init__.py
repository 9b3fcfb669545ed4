"""Phantoms with an exact description, sampled on any grid."""

from .ellipses import Ellipse, EllipsePhantom
from .solids import Dome, Ellipsoid
from .table6 import TABLE6_SIDE_M, table6
from .table7 import TABLE7_FREQUENCY_HZ, TABLE7_GRIDS, TABLE7_SIDE_M, table7, table7_slices
from .volume import Part, PhantomSlice, VolumePhantom

__all__ = [
    "TABLE6_SIDE_M",
    "TABLE7_FREQUENCY_HZ",
    "TABLE7_GRIDS",
    "TABLE7_SIDE_M",
    "Dome",
    "Ellipse",
    "EllipsePhantom",
    "Ellipsoid",
    "Part",
    "PhantomSlice",
    "VolumePhantom",
    "table6",
    "table7",
    "table7_slices",
]
