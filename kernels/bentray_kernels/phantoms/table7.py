"""The 3-D breast phantom (Li 2008, Table 7): skin, fat, tissue and lesions that vary between slices."""

import numpy as np

from ..arrays import Floats
from ..errors import InvalidInput
from .solids import Dome, Ellipsoid, Solid
from .volume import Part, VolumePhantom

SKIN_MPS, FAT_MPS, TISSUE_MPS, LARGE_MPS, SMALL_MPS = 1650.0, 1375.0, 1475.0, 1560.0, 1530.0

# Table 7 prints attenuation without a unit. It is taken in Np/m, as Table 6 is, at the frequency that section
# 7.1 plans for: 50 Np/m at 7.5 MHz are 0.58 dB/cm/MHz, which is what soft tissue has.
SKIN_NP_M, FAT_NP_M, TISSUE_NP_M, LARGE_NP_M, FAINT_NP_M, SMALL_NP_M = 58.0, 15.0, 50.0, 60.0, 30.0, 70.0
TABLE7_FREQUENCY_HZ = 7.5e6

# Both grids of Table 8 span this square and have cubic voxels.
TABLE7_SIDE_M = 0.2
TABLE7_GRIDS = ((128, 40), (256, 44))

# z runs from the chest wall to the nipple, with 0 in the middle of the slices. The 40 slices of 128² reach
# from 31 mm before it to 31 mm after; the 44 of 256², with voxels half as large, from 17 to 17.
CHEST_M, NIPPLE_M = -0.031, 0.036

SKIN_THICKNESS_M = 0.0025


def table7(coupling_mps: float = 1500.0, nodes: int = 128) -> VolumePhantom:
    """The phantom with the values of Table 7.

    The dissertation shaped its phantom after cryosection images and prints neither shapes nor places; these
    are ours. Skin and fat are blunt domes that narrow towards the nipple and drift sideways; the tissue
    has lobes that turn along z; lesions are 2 to 10 voxels wide, two of the smallest near the centre.

    Args:
        coupling_mps: speed of the medium around the breast, m/s; the dissertation leaves it open.
        nodes: of the grid whose voxels the sizes of the lesions are counted in, along x.

    Returns:
        The phantom, centred on the z axis, in a square of ``TABLE7_SIDE_M``.

    Raises:
        InvalidInput: for fewer than 128 nodes, where lesions would run into each other.
    """
    if nodes < TABLE7_GRIDS[0][0]:
        raise InvalidInput("nodes", nodes, f"at least {TABLE7_GRIDS[0][0]}")
    voxel = TABLE7_SIDE_M / (nodes - 1)

    def dome(thickness: float) -> Dome:
        axes = (0.078 - thickness, 0.073 - thickness)
        return Dome(CHEST_M, NIPPLE_M - thickness, (0.0, 0.0), axes, 2.4, (0.004, -0.003))

    def lesion(
        centre: tuple[float, float, float], voxels: tuple[float, float, float], angle: float = 0.0
    ) -> Solid:
        a, b, h = (0.5 * count * voxel for count in voxels)
        return Ellipsoid(centre, (a, b, h), angle)

    def large(
        centre: tuple[float, float, float], voxels: tuple[float, float, float], attenuation: float
    ) -> Part:
        return Part(lesion(centre, voxels, 0.5), LARGE_MPS, attenuation, "large lesion")

    def small(centre: tuple[float, float, float], voxels: float) -> Part:
        return Part(lesion(centre, (voxels, voxels, voxels)), SMALL_MPS, SMALL_NP_M, "small lesion")

    tissue = Dome(
        CHEST_M,
        0.031,
        (0.003, 0.001),
        (0.056, 0.051),
        2.0,
        (0.004, -0.003),
        waves=((3, 0.06), (5, 0.04), (8, 0.02)),
        twist_rad=0.9,
    )
    return VolumePhantom(
        coupling_mps,
        (
            Part(dome(0.0), SKIN_MPS, SKIN_NP_M, "skin"),
            Part(dome(SKIN_THICKNESS_M), FAT_MPS, FAT_NP_M, "fat"),
            Part(tissue, TISSUE_MPS, TISSUE_NP_M, "tissue"),
            large((-0.022, 0.016, -0.007), (10.0, 7.0, 9.0), LARGE_NP_M),
            large((0.028, -0.015, 0.005), (8.0, 6.0, 7.0), FAINT_NP_M),
            large((0.008, 0.027, -0.012), (6.0, 6.0, 6.0), FAINT_NP_M),
            small((-0.012, -0.024, 0.002), 5.0),
            small((0.034, 0.012, -0.005), 4.0),
            small((0.003, -0.006, 0.011), 3.0),
            small((-0.006, 0.008, 0.0), 2.0),
            small((0.012, 0.004, 0.0), 2.0),
            small((-0.034, -0.006, -0.013), 2.0),
        ),
    )


def table7_slices(nodes: int, slices: int) -> Floats:
    """Slices as far apart as nodes of a square of ``TABLE7_SIDE_M``, centred on 0; (slices,), m."""
    return np.asarray((np.arange(slices) - 0.5 * (slices - 1)) * (TABLE7_SIDE_M / (nodes - 1)))
