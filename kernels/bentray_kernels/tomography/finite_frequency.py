"""Finite-frequency (fat) rays: blurring of the image for travel times and for the bending of rays."""

import math

import numpy as np
from scipy.ndimage import gaussian_filter

from ..arrays import Floats
from .problem import Problem
from .settings import Settings

# Fat rays bend in an image that is blurred by this multiple of their width. With the true image, travel times
# of waves (400 kHz, 500 kHz, 1 MHz) were explained best by widths of half a wavelength to one, and by bending
# in an image blurred by two to three wavelengths; see benchmarks/results/raw_trace_experiments.md.
BENDS_WIDER = 2.0


def width_in_nodes(problem: Problem, settings: Settings) -> float:
    """Standard deviation of the Gaussian across a ray, nodes; 0 for thin rays."""
    return settings.numerics.ray_width_m / problem.spacing


def ray_slowness(problem: Problem, settings: Settings, slowness: Floats) -> Floats:
    """The image blurred to the width of the rays; its integrals along the rays are their travel times.

    Args:
        slowness: of the region's shape, s/m.
    """
    width = width_in_nodes(problem, settings)
    if width == 0.0:
        return slowness
    water = 1.0 / problem.water_speed
    return water + blurred(slowness - water, width)


def blurred(change: Floats, width: float) -> Floats:
    """A Gaussian filter for changes of an image, which are 0 beyond the grid; linear and self-adjoint.

    Args:
        change: nodes, in any unit.
        width: standard deviation, nodes; 0: no filter.
    """
    return np.asarray(gaussian_filter(change, width, mode="constant") if width > 0.0 else change)


def front_smoothing(problem: Problem, settings: Settings) -> float:
    """Standard deviation, nodes, of the Gaussian on the speed of ``ray_slowness`` in which rays bend.

    Both Gaussians together have ``BENDS_WIDER`` widths.
    """
    return width_in_nodes(problem, settings) * math.sqrt(BENDS_WIDER**2 - 1.0)
