"""Task graph of a candidate model: a reconstruction from the training pairs, and its held-out misfit."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ...arrays import Floats
from ..gauss_newton.linearisation import Rows
from ..reconstruction_graph import Evaluation, ReconstructionGraph, trace_final_rays
from ..scan import Scan

# The functions that trace the rays of a batch of emitters, and that evaluate all of them.
Tasks = tuple[Callable[..., Rows], Callable[..., Floats]]


class CandidateGraph(ReconstructionGraph):
    """A reconstruction from the training pairs that ends with the misfit of the held-out pairs.

    Args:
        scan: of the training pairs.
        index: of the slice.
        held_out: of the held-out pairs, in one part or two.
    """

    def __init__(self, scan: Scan, index: int, *held_out: Scan) -> None:
        self._held_out = held_out
        super().__init__(scan, index)

    def _evaluated(self) -> list[Evaluation]:
        return [
            Evaluation((held, self._index), *tasks, held.problem(self._index).active_emitters)
            for held, tasks in zip(self._held_out, TASKS, strict=False)
        ]

    @property
    def held_out_rms_s(self) -> float:
        """Root mean square misfit of all held-out pairs, s."""
        return self._misfit(TASKS)[0]

    @property
    def held_out_mean_s(self) -> float:
        """Mean absolute misfit of all held-out pairs, s."""
        return self._misfit(TASKS)[1]

    @property
    def first_part_rms_s(self) -> float:
        """Root mean square misfit of the first part, s."""
        return self._misfit(TASKS[:1])[0]

    def _misfit(self, tasks: Sequence[Tasks]) -> tuple[float, float]:
        sums = [self.value_of(evaluate) for _, evaluate in tasks[: len(self._held_out)]]
        count, absolute, squares = np.sum(sums, axis=0)
        return math.sqrt(squares / count), float(absolute / count)


def sum_misfits(_scan: Scan, _index: int, _slowness: Floats, rows: Sequence[Rows]) -> Floats:
    """Task: number of pairs, sum of absolute residuals, s, and of their squares, s²."""
    residual = np.concatenate([row.residual for row in rows])
    return np.array([residual.size, np.abs(residual).sum(), (residual**2).sum()])


def trace_rays_of_views(scan: Scan, index: int, slowness: Floats, batch: int) -> Rows:
    """Task: as ``trace_final_rays``, of the second part."""
    return trace_final_rays(scan, index, slowness, batch)


def sum_misfits_of_views(scan: Scan, index: int, slowness: Floats, rows: Sequence[Rows]) -> Floats:
    """Task: as ``sum_misfits``, of the second part."""
    return sum_misfits(scan, index, slowness, rows)


# Of the first and of the second part; a graph knows its tasks by their functions.
TASKS: tuple[Tasks, Tasks] = ((trace_final_rays, sum_misfits), (trace_rays_of_views, sum_misfits_of_views))
