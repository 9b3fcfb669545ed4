"""Task graph of a candidate model: a reconstruction from the training pairs, and its held-out misfit."""

from __future__ import annotations

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

    @property
    def held_out_rms_s(self) -> float:
        """Root mean square misfit of all held-out pairs, s."""
        return self._misfit(len(self._held_out))[0]

    @property
    def held_out_mean_s(self) -> float:
        """Mean absolute misfit of all held-out pairs, s."""
        return self._misfit(len(self._held_out))[1]

    @property
    def first_part_rms_s(self) -> float:
        """Root mean square misfit of the first part, s."""
        return self._misfit(1)[0]

    def _misfit(self, parts: int) -> tuple[float, float]:
        count, absolute, squares = np.sum([part.value for part in self._evaluations[:parts]], axis=0)
        return math.sqrt(squares / count), float(absolute / count)


def sum_misfits(_scan: Scan, _index: int, _slowness: Floats, rows: Sequence[Rows]) -> Floats:
    """Task: number of pairs, sum of absolute residuals, s, and of their squares, s²."""
    residual = np.concatenate([row.residual for row in rows])
    return np.array([residual.size, np.abs(residual).sum(), (residual**2).sum()])
