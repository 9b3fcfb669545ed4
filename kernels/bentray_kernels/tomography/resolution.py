"""Resolution check: recovery of a checkerboard along the rays of a finished image."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter

from ..arrays import Floats
from .finite_frequency import blurred
from .gauss_newton.linear_problem import Linearised
from .gauss_newton.linearisation import Rows, ray_density
from .problem import Problem

# Side of a field of the checkerboard, nodes.
FIELD_NODES = 4

# Least curvature of a node in the data, as a part of the average, at which it is resolved; noise and errors
# of the model hide less.
DAMPING = 0.03

# Contrast of a field, relative to water; any value gives the same recovery, which is linear.
CONTRAST = 0.01


def recovery(problem: Problem, blocks: Sequence[Rows], width: float = 0.0) -> Floats:
    """Recovery of a checkerboard at each node: 1 in full, 0 not at all.

    A checkerboard with fields of ``FIELD_NODES`` nodes is projected along the rays and reconstructed from
    those times by damped least squares (see Lévêque et al. 1993 for the limits of such a test). The
    recovery at a node is the part of the board's contrast that is recovered in its neighbourhood.

    Args:
        problem: the slice or volume.
        blocks: rows of all emitters, in their order.
        width: of the rays, nodes; see ``finite_frequency``.

    Returns:
        Of the region's shape; 0 outside the region.
    """
    shape = problem.region.shape
    crossing = problem.spacing / problem.water_speed
    board = np.where(problem.region, checkerboard(shape) * CONTRAST * crossing, 0.0)
    seen = blurred(board, width)
    rows = [replace(block, residual=block.project(seen)) for block in blocks]
    density = problem.mean_in_region(ray_density(problem, blocks))
    bounds = -crossing, crossing
    empty = np.zeros(shape)
    image, _ = Linearised(
        rows, empty, density, problem.region, bounds, DAMPING, "tikhonov", reference=empty, width=width
    ).solve(empty)
    energy = gaussian_filter(board * board, FIELD_NODES)
    correlation = gaussian_filter(image * board, FIELD_NODES)
    return np.where(problem.region, correlation / np.maximum(energy, 1e-300), 0.0)


def checkerboard(shape: tuple[int, ...]) -> Floats:
    """+1 and −1 by turns, in fields of ``FIELD_NODES`` nodes."""
    fields = sum(np.ix_(*(np.arange(n) // FIELD_NODES for n in shape)))
    return np.asarray(1.0 - 2.0 * (fields % 2))
