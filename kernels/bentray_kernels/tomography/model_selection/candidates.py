"""A chain on part of the pairs that ends with the misfit of those it was not shown."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...arrays import Floats
from ..gauss_newton.gauss_newton_step import look
from ..gauss_newton.linearisation import Rows
from ..task_chains import Chain, Gathering, Scan, cut


class TrialChain(Chain):
    """A chain on the pairs that are shown, which ends with the misfit of those held out.

    Args:
        scan: of the shown pairs.
        index: of the slice.
        held_out: of the held-out pairs.
    """

    def __init__(self, scan: Scan, index: int, held_out: Scan) -> None:
        self._held_out = held_out
        super().__init__(scan, index)

    def _gatherings(self) -> list[Gathering]:
        return [HeldOut(self._held_out, self._index)]

    @property
    def held_out_rms_s(self) -> float:
        """Root mean square misfit of the pairs that were held out, s."""
        return float(self.found(misfit)[0])

    @property
    def held_out_mean_s(self) -> float:
        """Mean size of their misfit, s."""
        return float(self.found(misfit)[1])


class HeldOut(Gathering):
    """The rays of the pairs that were held out."""

    def __init__(self, scan: Scan, index: int) -> None:
        self._scan = scan
        super().__init__(look_held_out, misfit, scan.problem(index).sounding)

    def first(self, scan: Scan, index: int, image: Floats) -> list[Any]:
        return super().first(self._scan, index, image)


def look_held_out(scan: Scan, index: int, slowness: Floats, part: int) -> Rows:
    """Call: the rays of some held-out pairs through the finished image."""
    problem = scan.problem(index)
    return look(problem, scan.stages()[-1], slowness, cut(problem.sounding)[part])


def misfit(_scan: Scan, _index: int, rows: Sequence[Rows]) -> Floats:
    """Call: root mean square and mean size of the residuals, s."""
    residual = np.concatenate([part.residual for part in rows])
    return np.array([math.sqrt(float((residual**2).mean())), float(np.abs(residual).mean())])
