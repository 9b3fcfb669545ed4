"""Inconsistent travel times: apparent speeds, cycle jumps and outliers, and violations of reciprocity."""

from __future__ import annotations

import math

import numpy as np

from ...arrays import Flags, Floats
from ..dataset import Dataset
from ..picking.consistency import contradictions
from .finding import Finding

CYCLES, APPARENT = "cycle jumps", "apparent speed"
# A departure counts as a cycle jump within this distance of whole periods.
NEAR_A_CYCLE = 0.25


def find_contradictions(dataset: Dataset, delta: Floats) -> list[Finding]:
    """Find impossible apparent speeds, cycle jumps, outliers and violations of reciprocity, each pair in one.

    Args:
        dataset: of one slice.
        delta: (ntx, nrx), s.
    """
    found = contradictions(dataset, delta)
    departure, cycles = found.departure_s, np.zeros_like(found.outlying)
    if dataset.center_frequency_hz is not None:
        count = np.abs(departure[found.outlying]) * dataset.center_frequency_hz
        cycles[found.outlying] = np.abs(count - np.rint(count)) <= NEAR_A_CYCLE
    allowed = f"within {1e9 * found.skip_s:.0f} ns"
    speeds = "{:.0f} to {:.0f} m/s, far beyond those of most pairs".format(*found.speeds_mps)
    others = found.outlying & ~cycles
    return [
        *_left_out(APPARENT, found.apparent, found.excess_s, "too early or too late for any path", speeds),
        *_left_out(CYCLES, cycles, departure, "whole periods from their neighbours", allowed),
        *_left_out("outliers", others, departure, "far from the median of neighbours", allowed),
        *_left_out(
            "reciprocity", found.unreciprocal, departure, "that differ from their reciprocal pair", allowed
        ),
    ]


def _left_out(check: str, pairs: Flags, departure: Floats, fault: str, accepted: str) -> list[Finding]:
    if not pairs.any():
        return []
    off = np.abs(departure[pairs])
    off = off[np.isfinite(off)]
    return [
        Finding(
            check,
            f"{int(pairs.sum())} pairs {fault}",
            accepted,
            "left out",
            pairs=np.asarray(pairs),
            value=float(np.median(off)) if off.size else math.nan,
            unit="s, median",
        )
    ]
