"""How large the problem of a band is: nodes of its grid, steps of its clock."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...wave.medium import EDGE_NODES
from ...wave.points import REACH
from ...wave.stencil import HALO, longest_step
from .trace_resampling import FALL
from .waveform_settings import Band

# Part of the stable time step that is used, for the absorbing edges shorten it.
SAFE = 0.95

# Times the period of the upper corner that the filter may spread ahead of the first sample.
LEAD = 2.0


class Extent(NamedTuple):
    """Of a problem.

    Attributes:
        nodes: along each side of the image.
        step_s: of the simulator, s.
        steps: of the simulator.
        lead_s: from its beginning to the first recorded sample, s.
        every: time steps from one stored field to the next.
    """

    nodes: int
    step_s: float
    steps: int
    lead_s: float
    every: int

    @classmethod
    def of(cls, band: Band, reach_m: float, record_s: float, fastest_mps: float) -> Extent:
        """Of a scan in a band.

        Args:
            band: the band.
            reach_m: from the middle of the array to its outermost element along an axis, m.
            record_s: from the first recorded sample to the last, s.
            fastest_mps: speed that a node may take at most, m/s.
        """
        step = SAFE * longest_step(fastest_mps, band.spacing_m)
        lead = LEAD / band.high_hz
        return cls(
            2 * math.ceil(reach_m / band.spacing_m + REACH) + 1,
            step,
            int((record_s + lead) / step),
            lead,
            # The product of two fields ends at twice the filter's end; twice that is sampled.
            max(1, int(1.0 / (2.2 * (1.0 + FALL) * band.high_hz) / step)),
        )

    @property
    def padded(self) -> int:
        """Nodes along each side with edges and halo."""
        return self.nodes + 2 * (EDGE_NODES + HALO)
