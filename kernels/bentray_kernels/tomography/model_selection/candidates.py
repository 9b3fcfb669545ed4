"""Task graph of a candidate model: a reconstruction from the training pairs, and its held-out misfit."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...arrays import Floats
from ..gauss_newton.linearisation import Rows
from ..reconstruction_graph import Evaluation, ReconstructionGraph, trace_final_rays
from ..stage_graphs import Scan


class CandidateGraph(ReconstructionGraph):
    """A reconstruction from the training pairs that ends with the misfit of the held-out pairs.

    Args:
        scan: of the training pairs.
        index: of the slice.
        held_out: of the held-out pairs.
    """

    def __init__(self, scan: Scan, index: int, held_out: Scan) -> None:
        self._held_out = held_out
        super().__init__(scan, index)

    def _evaluated(self) -> list[Evaluation]:
        at, emitters = (self._held_out, self._index), self._held_out.problem(self._index).active_emitters
        return [Evaluation(at, trace_final_rays, misfit, emitters)]

    @property
    def held_out_rms_s(self) -> float:
        """Root mean square misfit of the held-out pairs, s."""
        return float(self.value_of(misfit)[0])

    @property
    def held_out_mean_s(self) -> float:
        """Mean absolute misfit of the held-out pairs, s."""
        return float(self.value_of(misfit)[1])


def misfit(_scan: Scan, _index: int, _slowness: Floats, rows: Sequence[Rows]) -> Floats:
    """Task: root mean square and mean absolute residual, s."""
    residual = np.concatenate([part.residual for part in rows])
    return np.array([math.sqrt(float((residual**2).mean())), float(np.abs(residual).mean())])
