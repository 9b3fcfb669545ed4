"""Dead elements: hardly any of their pairs has a pulse or a travel time."""

from __future__ import annotations

import numpy as np

from ...arrays import Flags
from ..dataset import Dataset
from .finding import Finding, Role

# Fraction of an element's pairs that must have a pulse.
MIN_DETECTED = 0.1

# Where half of the elements are detected in fewer of theirs than this, pulses drown in noise, and silence
# tells nothing.
USUALLY_DETECTED = 0.5


def find_dead(dataset: Dataset, detected: Flags) -> list[Finding]:
    """Find elements that do not emit or do not receive.

    Args:
        dataset: of one slice.
        detected: (ntx, nrx), whether a pair has a pulse or a time.
    """
    other = np.asarray(dataset.tx[:, None] != dataset.rx[None, :])
    findings = []
    roles: tuple[tuple[Role, int], ...] = (("emission", 1), ("reception", 0))
    for role, axis in roles:
        element = dataset.tx if role == "emission" else dataset.rx
        # Pairs with dead elements of the other role are not counted.
        alive = np.asarray(detected.any(axis=1 - axis))
        pairs_counted = other & (alive[None, :] if axis == 1 else alive[:, None])
        part = (detected & pairs_counted).sum(axis=axis) / np.maximum(pairs_counted.sum(axis=axis), 1)
        at_fault = np.flatnonzero(part < MIN_DETECTED)
        if at_fault.size and np.median(part) >= USUALLY_DETECTED:
            pairs = np.zeros_like(detected)
            pairs[(at_fault, slice(None)) if axis == 1 else (slice(None), at_fault)] = True
            findings.append(
                Finding(
                    "dead elements",
                    f"{at_fault.size} without a pulse in {role}",
                    f"a pulse in {100 * MIN_DETECTED:.0f} % of an element's pairs",
                    "left out",
                    tuple(int(k) for k in element[at_fault]),
                    role,
                    pairs,
                    float(part[at_fault].max()),
                    "of its pairs",
                )
            )
    return findings
