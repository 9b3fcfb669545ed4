"""Inconsistent travel times: cycle jumps and outliers among neighbours, and violations of reciprocity."""

from __future__ import annotations

import math

import numpy as np

from ...arrays import Flags, Floats
from ..dataset import Dataset
from ..picking.consistency import OUTLYING, outliers, unreciprocal
from .finding import Finding

CYCLES = "cycle jumps"
# A departure counts as a cycle jump within this distance of whole periods.
NEAR_A_CYCLE = 0.25

# 90 % of a normal distribution lie within this many standard deviations.
NINETY = 1.645


def find_contradictions(dataset: Dataset, delta: Floats) -> list[Finding]:
    """Find cycle jumps, outliers and violations of reciprocity, each pair in one of them.

    Args:
        dataset: of one slice.
        delta: (ntx, nrx), s.
    """
    period = None if dataset.center_frequency_hz is None else 1.0 / dataset.center_frequency_hz
    _, departure = outliers(dataset, delta, math.inf)
    skip = 0.5 * period if period is not None else _usual(departure)
    outlying, departure = outliers(dataset, delta, skip)
    cycles = np.zeros_like(outlying)
    if period is not None:
        count = np.abs(departure[outlying]) / period
        cycles[outlying] = np.abs(count - np.rint(count)) <= NEAR_A_CYCLE
    # Outliers are not compared with their reciprocal pair.
    differ = unreciprocal(dataset, np.where(outlying, np.nan, delta), skip)
    allowed = f"within {1e9 * skip:.0f} ns"
    return [
        *_left_out(CYCLES, cycles, departure, "whole periods from their neighbours", allowed),
        *_left_out("outliers", outlying & ~cycles, departure, "far from the median of neighbours", allowed),
        *_left_out("reciprocity", differ, departure, "that differ from their reciprocal pair", allowed),
    ]


def _usual(departure: Floats) -> float:
    """Largest accepted departure without a known period, s: four standard deviations, from the 90 % quantile.

    The median departure of rounded times may be 0; the 90 % quantile is not affected by outliers.
    """
    size = np.abs(departure[np.isfinite(departure)])
    return OUTLYING * float(np.percentile(size, 90.0)) / NINETY if size.size else math.inf


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
