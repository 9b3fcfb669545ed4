"""Task graph of a candidate model: a reconstruction from the training pairs, and its held-out misfit."""

import math
from collections.abc import Sequence

import numpy as np

from ...arrays import Floats
from ..gauss_newton.linearisation import Rows
from ..reconstruction_graph import Evaluation, ReconstructionGraph, trace_final_rays
from ..scan import Scan


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
            Evaluation(
                (held, self._index),
                trace_final_rays,
                sum_misfits,
                held.problem(self._index).active_emitters,
            )
            for held in self._held_out
        ]

    def misfits(self, parts: int | None = None) -> tuple[float, float]:
        """Root mean square and mean absolute misfit of the held-out pairs, s.

        Args:
            parts: how many of the parts, from the first; None: all.
        """
        count, absolute, squares = np.sum([part.value for part in self._evaluations[:parts]], axis=0)
        return math.sqrt(squares / count), float(absolute / count)


def sum_misfits(_scan: Scan, _index: int, _slowness: Floats, rows: Sequence[Rows]) -> Floats:
    """Task: number of pairs, sum of absolute residuals, s, and of their squares, s²."""
    residual = np.concatenate([row.residual for row in rows])
    return np.array([residual.size, np.abs(residual).sum(), (residual**2).sum()])
