"""Rays as wide as the wave: what a band-limited pulse sees of an image, and what bends its ray."""

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


def nodes_wide(problem: Problem, settings: Settings) -> float:
    """Standard deviation of the Gaussian across a ray, nodes; 0 for thin rays."""
    return settings.numerics.ray_width_m / problem.spacing


def seen(problem: Problem, settings: Settings, slowness: Floats) -> Floats:
    """The image as rays of the settings' width see it: integrals along thin lines of this are their times.

    Args:
        slowness: of the region's shape, s/m.
    """
    width = nodes_wide(problem, settings)
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


def bending(problem: Problem, settings: Settings) -> float:
    """Standard deviation, nodes, of the Gaussian on the speed that ``seen`` leaves, for rays to bend in.

    As the user has it; else what is missing to ``BENDS_WIDER`` widths.
    """
    if settings.numerics.front_smoothing_nodes > 0.0:
        return settings.numerics.front_smoothing_nodes
    return nodes_wide(problem, settings) * math.sqrt(BENDS_WIDER**2 - 1.0)
