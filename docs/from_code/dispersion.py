"""Table of the numerical dispersion of the wave simulator, by nodes per wavelength."""

from bentray_kernels.wave.stencil import longest_step, phase_error

from .tables import table

POINTS = (2.5, 3.0, 4.0, 4.5, 5.0, 6.0, 7.0, 11.0)
# Column title: order in space, and time step as a fraction of the longest stable one.
COLUMNS = {
    "space only, order 6": (6, 0.0),
    "space only, order 8": (8, 0.0),
    "order 6, half the longest step": (6, 0.5),
    "order 8, half the longest step": (8, 0.5),
    "order 8, the longest step": (8, 1.0),
}


def dispersion() -> str:
    """Phase advance in degrees after ten wavelengths along a grid line."""
    rows = [
        (f"{points:g}", *(f"{ahead(points, *how):+.1f}" for how in COLUMNS.values())) for points in POINTS
    ]
    return table(("nodes per wavelength", *COLUMNS), rows)


def ahead(points: float, order: int, part: float) -> float:
    """Phase advance, degrees.

    Args:
        points: nodes per wavelength.
        order: order in space.
        part: fraction of the longest stable time step; 0: without time discretisation.
    """
    # With nodes 1 m apart and a speed of 1 m/s the Courant number is the time step.
    courant = part * longest_step(1.0, 1.0)
    return 3600.0 * (1.0 - 1.0 / (1.0 + phase_error(points, courant, order=order)))
