"""Impossible times of a scan, and the share of its pairs that is left out: too many make it unusable."""

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from ..dataset import Dataset
from ..impossible_times import impossible_words, lost_pairs
from .finding import Finding, left_out

IMPOSSIBLE, LEFT_OUT = "impossible times", "pairs left out"


class Pairs(NamedTuple):
    """Numbers of pairs of a slice: those with a time or a trace, and of these those left out by findings."""

    known: int
    left_out: int


def count_left_out(dataset: Dataset, findings: Iterable[Finding]) -> Pairs:
    """Count the pairs that findings leave out.

    Args:
        dataset: of one slice, before any finding is applied.
        findings: of this slice.
    """
    if dataset.picked:
        usable = np.isfinite(dataset.differential_tof())
    else:
        usable = np.asarray(dataset.tx[:, None] != dataset.rx)
        usable = usable if dataset.valid is None else usable & dataset.valid
    return Pairs(int(usable.sum()), int((usable & left_out(findings, usable.shape)).sum()))


def count_usable(dataset: Dataset) -> tuple[int, int]:
    """Numbers of pairs of different elements over all slices, and of those with a valid travel time."""
    pairs = int((dataset.tx[:, None] != dataset.rx[None, :]).sum()) * dataset.slices
    return pairs, int(np.isfinite(dataset.differential_tof()).sum()) if dataset.picked else 0


def find_impossible(counts: Mapping[str, int]) -> list[Finding]:
    """Report the impossible times that a scan came with, which are missing.

    Args:
        counts: by kind, see ``Dataset.impossible_times``.
    """
    if not counts:
        return []
    return [
        Finding(
            IMPOSSIBLE,
            impossible_words(counts),
            "arrivals after the emission, NaN for missing ones",
            "left out",
            value=float(sum(counts.values())),
            unit="times",
        )
    ]


def find_too_few(slices: Iterable[Pairs], impossible: Mapping[str, int], most: float) -> list[Finding]:
    """Refuse a scan of which too many pairs are left out.

    Args:
        slices: of the scan.
        impossible: its impossible times, by kind.
        most: largest share, 0 to 1.
    """
    counted = list(slices)
    lost = lost_pairs(impossible)
    total = sum(pairs.known for pairs in counted) + lost
    out = sum(pairs.left_out for pairs in counted) + lost
    if total == 0 or out <= most * total:
        return []
    return [
        Finding(
            LEFT_OUT,
            f"{out} of {total} pairs, {100.0 * out / total:.0f} %",
            f"at most {100.0 * most:.0f} %; the setting max_left_out (--max-left-out) allows more",
            "refused",
            value=out / total,
            unit="of the pairs",
        )
    ]
