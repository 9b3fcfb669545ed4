"""Grid and time steps of a band: nodes, step, duration and storage interval of its simulations."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...wave.medium import EDGE_NODES
from ...wave.memory import padded_nodes
from ...wave.points import REACH
from ...wave.stencil import OPTIMISED, longest_step
from .trace_resampling import FALL
from .waveform_settings import Band

# Part of the stable time step that is used, because the absorbing edges reduce the limit.
SAFE = 0.95

# Periods of the upper corner that the filter may spread ahead of the first sample.
LEAD = 2.0


class Extent(NamedTuple):
    """Extent of the simulations of a band.

    Attributes:
        nodes: along each side of the image.
        step_s: time step, s.
        steps: number of time steps.
        lead_s: from the first time step to the first recorded sample, s.
        every: time steps between stored fields.
    """

    nodes: int
    step_s: float
    steps: int
    lead_s: float
    every: int

    @classmethod
    def for_scan(cls, band: Band, reach_m: float, record_s: float, fastest_mps: float) -> Extent:
        """The extent for a scan.

        Args:
            band: the band.
            reach_m: distance of the outermost element from the middle of the array along an axis, m.
            record_s: duration of a trace, s.
            fastest_mps: highest speed of a node, m/s.
        """
        step = SAFE * longest_step(fastest_mps, band.spacing_m, order=OPTIMISED)
        lead = LEAD / band.high_hz
        return cls(
            2 * math.ceil(reach_m / band.spacing_m + REACH) + 1,
            step,
            int((record_s + lead) / step),
            lead,
            # The spectrum of the product of two fields ends at twice the filter's end; sampled at twice that.
            max(1, int(1.0 / (2.2 * (1.0 + FALL) * band.high_hz) / step)),
        )

    @property
    def padded(self) -> int:
        """Nodes of the image with edges and halo."""
        return padded_nodes((self.nodes, self.nodes), EDGE_NODES)
