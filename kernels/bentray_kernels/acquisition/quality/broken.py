"""Unusable single traces: not finite, constant, clipped."""

from collections.abc import Iterator

import numpy as np

from ...arrays import Flags
from ..dataset import Dataset
from .finding import Finding
from .measures import Measures

# Fraction of clipped pairs above which the gain is too high.
MAX_CLIPPED = 0.25


def find_broken(dataset: Dataset, measures: Measures, which: str, reported: Flags) -> Iterator[Finding]:
    """Find traces with samples that are not finite, and constant ones.

    Args:
        dataset: of one slice.
        measures: of its traces.
        which: ``object`` or ``water``.
        reported: (ntx, nrx), pairs already left out by another finding.
    """
    other = (dataset.tx[:, None] != dataset.rx[None, :]) & ~reported
    for check, flags, fault, accepted in (
        ("values", measures.broken, "samples that are not finite", "finite samples"),
        ("constant traces", measures.constant, "a constant value", "a recording"),
    ):
        pairs = flags & other
        if pairs.any():
            count = float(pairs.sum())
            message = f"{which}: {count:.0f} traces with {fault}"
            yield Finding(check, message, accepted, "left out", pairs=pairs, value=count, unit="traces")


def find_clipped(dataset: Dataset, measures: Measures, which: str) -> Iterator[Finding]:
    """Find clipped traces: times are valid, since the onset precedes the peak, amplitudes are not."""
    pairs = measures.clipped & (dataset.tx[:, None] != dataset.rx[None, :])
    if not pairs.any():
        return
    fraction = float(pairs.sum()) / max(int(measures.detected.sum()), 1)
    message = f"{which}: {int(pairs.sum())} traces clipped at their highest or lowest value"
    message += ", the gain is too high" if fraction > MAX_CLIPPED else ""
    # Saturated channels, unless all of them are.
    often = pairs.sum(axis=0) > 0.5 * np.maximum(measures.detected.sum(axis=0), 1)
    saturated = dataset.rx[often] if often.sum() < 0.5 * often.size else dataset.rx[:0]
    yield Finding(
        "clipping",
        message,
        "pulses within the range of the recorder",
        "reported",
        tuple(int(k) for k in saturated),
        "reception" if saturated.size else "",
        pairs=np.asarray(pairs),
        value=fraction,
        unit="of all traces",
    )
