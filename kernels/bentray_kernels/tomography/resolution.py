"""Resolution check: recovery of a checkerboard along the rays of a finished image."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter

from ..arrays import Floats, Ints
from .finite_frequency import blurred
from .gauss_newton.gauss_newton_step import trace_rays as rows_of
from .gauss_newton.linear_problem import Linearised
from .gauss_newton.linearisation import Rows
from .gauss_newton.ray_matrix import back_project, project
from .problem import Problem
from .settings import Settings

# Side of a field of the checkerboard, nodes.
FIELD_NODES = 4

# Least curvature of a node in the data, as a part of the average, at which it is resolved; noise and errors
# of the model hide less.
DAMPING = 0.03

# A field's contrast over that of the surroundings; any value gives the same recovery, for it is linear.
CONTRAST = 0.01


def trace_rays(problem: Problem, settings: Settings, slowness: Floats, emitters: Ints) -> Rows:
    """Rows of some emitters along the rays of the finished image; any split gives the same."""
    return rows_of(problem, settings, slowness, emitters)


def recovery(problem: Problem, parts: Sequence[Rows], width: float = 0.0) -> Floats:
    """Recovery of a checkerboard at each node: 1 in full, 0 not at all.

    A checkerboard with fields of ``FIELD_NODES`` nodes is projected along the rays and reconstructed from
    those times by damped least squares (see Lévêque et al. 1993 for the limits of such a test). The
    answer at a node is the part of the board's contrast that its neighbourhood gets back.

    Args:
        problem: the slice or volume.
        parts: rows of all emitters, in their order.
        width: of the rays, nodes; see ``finite_frequency``.

    Returns:
        Of the region's shape; 0 outside the region.
    """
    shape = problem.region.shape
    crossing = problem.spacing / problem.water_speed
    board = np.where(problem.region, _checkerboard(shape) * CONTRAST * crossing, 0.0)
    passed, rows = np.zeros(board.size), []
    for part in parts:
        times = np.empty(part.residual.size)
        project(part.pointers, part.columns, part.lengths, blurred(board, width).ravel(), times)
        rows.append(replace(part, residual=times))
        back_project(part.pointers, part.columns, part.lengths, np.ones(times.size), passed)
    density = problem.density(passed.reshape(shape))
    bounds = -crossing, crossing
    empty = np.zeros(shape)
    found, _ = Linearised(
        rows, empty, density, problem.region, bounds, DAMPING, "tikhonov", reference=empty, width=width
    ).solve(empty)
    near = gaussian_filter(board * board, FIELD_NODES)
    alike = gaussian_filter(found * board, FIELD_NODES)
    return np.where(problem.region, alike / np.maximum(near, 1e-300), 0.0)


def _checkerboard(shape: tuple[int, ...]) -> Floats:
    """+1 and −1 by turns, in fields of ``FIELD_NODES`` nodes."""
    fields = np.zeros(shape, np.int64)
    for axis, n in enumerate(shape):
        along = np.arange(n) // FIELD_NODES
        fields += along.reshape([-1 if a == axis else 1 for a in range(len(shape))])
    return np.asarray(1.0 - 2.0 * (fields % 2))
