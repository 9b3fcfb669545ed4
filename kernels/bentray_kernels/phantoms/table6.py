"""The 2-D breast phantoms of Li 2008, Table 6: a thick fat layer around tissue with lesions; two slices."""

from .ellipses import Ellipse, EllipsePhantom, HalfEllipse

FAT_MPS, TISSUE_MPS, LARGE_MPS, SMALL_MPS = 1375.0, 1475.0, 1560.0, 1530.0

# Table 6 gives attenuation without a unit; here it is taken as Np/m.
FAT_NP_M, TISSUE_NP_M, LARGE_NP_M, FAINT_NP_M, SMALL_NP_M = 15.0, 50.0, 60.0, 30.0, 70.0

# One pixel of the dissertation's 128² image, on which the sizes of the lesions are stated (2 to 8 pixels).
TABLE6_SIDE_M = 0.2
PIXEL_M = TABLE6_SIDE_M / 127.0


# Where the vertical slice is cut off, at the chest wall, m.
CHEST_M = 0.042


def table6(coupling_mps: float = 1500.0) -> EllipsePhantom:
    """The horizontal slice, after figures 29 and 30, with the values of Table 6.

    The dissertation prints the values and the range of lesion sizes, not the coordinates; those are ours.

    Args:
        coupling_mps: speed of the medium around the breast, m/s. Table 6 leaves it open, and it decides
            how hard the reconstruction is: water faster than the fat makes the fat a shadow.

    Returns:
        The phantom, centred on 0, in a square of ``TABLE6_SIDE_M``.
    """
    return EllipsePhantom(
        coupling_mps,
        (
            Ellipse((0.0, 0.0), (0.082, 0.076), FAT_MPS, FAT_NP_M, "fat"),
            Ellipse((0.003, 0.0), (0.064, 0.058), TISSUE_MPS, TISSUE_NP_M, "tissue"),
            _lesion(-0.025, 0.016, 8, large=True, flat=0.7),
            _lesion(0.030, -0.018, 8, large=True, faint=True, flat=0.75),
            _lesion(0.007, 0.032, 6, large=True, faint=True),
            _lesion(-0.014, -0.025, 5, large=False),
            _lesion(0.035, 0.016, 4, large=False),
            _lesion(0.005, -0.005, 3, large=False),
            _lesion(-0.039, -0.007, 2, large=False),
        ),
    )


def table6_vertical(coupling_mps: float = 1500.0) -> EllipsePhantom:
    """The vertical slice, after the left of figure 29(b): half ellipses that hang from the chest wall.

    The chest itself is left out: above the cut is the coupling medium, as around the phantom.

    Args:
        coupling_mps: as ``table6``.

    Returns:
        The phantom, x across and y up, centred on 0, in a square of ``TABLE6_SIDE_M``.
    """
    return EllipsePhantom(
        coupling_mps,
        (
            HalfEllipse((0.0, CHEST_M), (0.072, 0.094), FAT_MPS, FAT_NP_M, "fat"),
            HalfEllipse((0.0, CHEST_M), (0.056, 0.076), TISSUE_MPS, TISSUE_NP_M, "tissue"),
            _lesion(-0.024, 0.022, 8, large=True, flat=0.7),
            _lesion(0.022, 0.010, 8, large=True, faint=True, flat=0.75),
            _lesion(0.002, 0.030, 6, large=True, faint=True),
            _lesion(-0.012, -0.006, 5, large=False),
            _lesion(0.033, 0.028, 4, large=False),
            _lesion(0.006, -0.018, 3, large=False),
            _lesion(-0.036, 0.030, 2, large=False),
        ),
    )


def _lesion(
    x: float, y: float, pixels: float, *, large: bool, faint: bool = False, flat: float = 1.0
) -> Ellipse:
    """A lesion of so many pixels across at (x, y), m."""
    radius = 0.5 * pixels * PIXEL_M
    speed = LARGE_MPS if large else SMALL_MPS
    attenuation = (FAINT_NP_M if faint else LARGE_NP_M) if large else SMALL_NP_M
    name = "large lesion" if large else "small lesion"
    return Ellipse((x, y), (radius, radius * flat), speed, attenuation, name, 0.5 if flat != 1.0 else 0.0)
