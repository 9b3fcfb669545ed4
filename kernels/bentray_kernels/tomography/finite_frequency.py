"""Finite-frequency rays: the image that determines the time of a band-limited pulse, and the bending."""

from __future__ import annotations

import math

import numpy as np
from scipy.ndimage import gaussian_filter

from ..arrays import Floats
from .problem import Problem
from .settings import Settings

# Rays of a width bend in an image that is blurred so many times as far. With the truth as the image, times of
# waves (400 kHz, 500 kHz, 1 MHz) were explained best by widths of half a wavelength to one, and bends in what
# two to three wavelengths leave; see benchmarks/results/raw_trace_experiments.md.
BENDS_WIDER = 2.0


def width_in_nodes(problem: Problem, settings: Settings) -> float:
    """Standard deviation of the Gaussian across a ray, nodes; 0 for thin rays."""
    return settings.numerics.ray_width_m / problem.spacing


def ray_slowness(problem: Problem, settings: Settings, slowness: Floats) -> Floats:
    """The image blurred to the width of the rays; integrals along thin lines of it are their times.

    Args:
        slowness: of the region's shape, s/m.
    """
    width = width_in_nodes(problem, settings)
    if width == 0.0:
        return slowness
    water = 1.0 / problem.water_speed
    return water + blurred(slowness - water, width)


def blurred(change: Floats, width: float) -> Floats:
    """A change of an image under the Gaussian; linear and its own adjoint, for beyond the grid there is none.

    Args:
        change: nodes, in any unit.
        width: standard deviation, nodes; 0: the change as it is.
    """
    return np.asarray(gaussian_filter(change, width, mode="constant") if width > 0.0 else change)


def front_smoothing(problem: Problem, settings: Settings) -> float:
    """Standard deviation, nodes, of the Gaussian on the speed of ``ray_slowness`` in which rays bend.

    As the user has it; else what is missing to ``BENDS_WIDER`` widths.
    """
    if settings.numerics.front_smoothing_nodes > 0.0:
        return settings.numerics.front_smoothing_nodes
    return width_in_nodes(problem, settings) * math.sqrt(BENDS_WIDER**2 - 1.0)
