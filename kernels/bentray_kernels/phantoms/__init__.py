"""Analytic phantoms, sampled on any grid."""

from .cube_fields import CubeField, eight_bit, in_nodes, sampled
from .detailed_breast import DENSITIES, DETAILED_SIDE_M, LARGE_LESIONS, Anatomy, DetailedBreast
from .ellipses import Ellipse, EllipsePhantom, HalfEllipse
from .fringe_sphere import ONE_HOLE, TWO_HOLES, FringeSphere
from .marschner_lobb import MarschnerLobb
from .solids import Dome, Ellipsoid
from .table6 import TABLE6_SIDE_M, table6, table6_vertical
from .table7 import TABLE7_FREQUENCY_HZ, TABLE7_GRIDS, TABLE7_SIDE_M, table7, table7_slices
from .volume import Part, PhantomSlice, VolumePhantom

__all__ = [
    "DENSITIES",
    "DETAILED_SIDE_M",
    "LARGE_LESIONS",
    "ONE_HOLE",
    "TABLE6_SIDE_M",
    "TABLE7_FREQUENCY_HZ",
    "TABLE7_GRIDS",
    "TABLE7_SIDE_M",
    "TWO_HOLES",
    "Anatomy",
    "CubeField",
    "DetailedBreast",
    "Dome",
    "Ellipse",
    "EllipsePhantom",
    "Ellipsoid",
    "FringeSphere",
    "HalfEllipse",
    "MarschnerLobb",
    "Part",
    "PhantomSlice",
    "VolumePhantom",
    "eight_bit",
    "in_nodes",
    "sampled",
    "table6",
    "table6_vertical",
    "table7",
    "table7_slices",
]
