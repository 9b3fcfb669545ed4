"""The 2-D breast phantom (Li 2008, Table 6): a thick fat layer around tissue with large and small lesions."""

from __future__ import annotations

from .ellipses import Ellipse, EllipsePhantom

FAT_MPS, TISSUE_MPS, LARGE_MPS, SMALL_MPS = 1375.0, 1475.0, 1560.0, 1530.0

# Table 6 gives attenuation without a unit; here it is taken as Np/m.
FAT_NP_M, TISSUE_NP_M, LARGE_NP_M, FAINT_NP_M, SMALL_NP_M = 15.0, 50.0, 60.0, 30.0, 70.0

# One pixel of the dissertation's 128² image, on which the sizes of the lesions are stated (2 to 8 pixels).
TABLE6_SIDE_M = 0.2
PIXEL_M = TABLE6_SIDE_M / 127.0


def table6(coupling_mps: float = 1500.0) -> EllipsePhantom:
    """The phantom with the values of Table 6; shape after figures 29 and 30 (half ellipse, horizontal slice).

    The dissertation prints the values and the range of lesion sizes, not the coordinates; those are ours.

    Args:
        coupling_mps: speed of the medium around the breast, m/s. Table 6 leaves it open, and it decides
            how hard the reconstruction is: water faster than the fat makes the fat a shadow.

    Returns:
        The phantom, centred on 0, in a square of ``TABLE6_SIDE_M``.
    """

    def spot(
        x: float, y: float, pixels: float, *, large: bool, faint: bool = False, flat: float = 1.0
    ) -> Ellipse:
        radius = 0.5 * pixels * PIXEL_M
        speed = LARGE_MPS if large else SMALL_MPS
        attenuation = (FAINT_NP_M if faint else LARGE_NP_M) if large else SMALL_NP_M
        name = "large lesion" if large else "small lesion"
        return Ellipse((x, y), (radius, radius * flat), speed, attenuation, name, 0.5 if flat != 1.0 else 0.0)

    return EllipsePhantom(
        coupling_mps,
        (
            Ellipse((0.0, 0.0), (0.082, 0.076), FAT_MPS, FAT_NP_M, "fat"),
            Ellipse((0.003, 0.0), (0.064, 0.058), TISSUE_MPS, TISSUE_NP_M, "tissue"),
            spot(-0.025, 0.016, 8, large=True, flat=0.7),
            spot(0.030, -0.018, 8, large=True, faint=True, flat=0.75),
            spot(0.007, 0.032, 6, large=True, faint=True),
            spot(-0.014, -0.025, 5, large=False),
            spot(0.035, 0.016, 4, large=False),
            spot(0.005, -0.005, 3, large=False),
            spot(-0.039, -0.007, 2, large=False),
        ),
    )
