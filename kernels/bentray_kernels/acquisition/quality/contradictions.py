"""Inconsistent travel times: apparent speeds, cycle jumps and outliers, and violations of reciprocity."""

import math
from collections.abc import Iterator

import numpy as np

from ...arrays import Floats
from ..dataset import Dataset
from ..picking.consistency import contradictions
from .finding import Finding

CYCLES, APPARENT = "cycle jumps", "apparent speed"
# A departure counts as a cycle jump within this distance of whole periods.
NEAR_A_CYCLE = 0.25


def find_contradictions(dataset: Dataset, delta: Floats) -> Iterator[Finding]:
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
    for check, pairs, off, fault, accepted in (
        (APPARENT, found.apparent, found.excess_s, "too early or too late for any path", speeds),
        (CYCLES, cycles, departure, "whole periods from their neighbours", allowed),
        ("outliers", others, departure, "far from the median of neighbours", allowed),
        ("reciprocity", found.unreciprocal, departure, "that differ from their reciprocal pair", allowed),
    ):
        if pairs.any():
            sizes = np.abs(off[pairs])
            sizes = sizes[np.isfinite(sizes)]
            yield Finding(
                check,
                f"{int(pairs.sum())} pairs {fault}",
                accepted,
                "left out",
                pairs=np.asarray(pairs),
                value=float(np.median(sizes)) if sizes.size else math.nan,
                unit="s, median",
            )
