"""Dead elements: nearly none of their pairs holds a pulse, or a travel time."""

from __future__ import annotations

import numpy as np

from ...arrays import Flags
from ..dataset import Dataset
from .finding import Finding, Role

# Part of an element's pairs that must have a pulse.
LEAST_HEARD = 0.1

# Where half of the elements are heard in fewer of theirs than this, pulses drown in noise, and silence tells
# nothing.
USUALLY_HEARD = 0.5


def dead(dataset: Dataset, heard: Flags) -> list[Finding]:
    """Elements that do not emit, or do not receive.

    Args:
        dataset: of one slice.
        heard: (ntx, nrx), whether a pair has a pulse or a time.
    """
    other = np.asarray(dataset.tx[:, None] != dataset.rx[None, :])
    findings = []
    roles: tuple[tuple[Role, int], ...] = (("emission", 1), ("reception", 0))
    for role, axis in roles:
        element = dataset.tx if role == "emission" else dataset.rx
        # What the other side's dead elements miss is not this one's fault.
        alive = np.asarray(heard.any(axis=1 - axis))
        asked = other & (alive[None, :] if axis == 1 else alive[:, None])
        part = (heard & asked).sum(axis=axis) / np.maximum(asked.sum(axis=axis), 1)
        at_fault = np.flatnonzero(part < LEAST_HEARD)
        if at_fault.size and np.median(part) >= USUALLY_HEARD:
            pairs = np.zeros_like(heard)
            pairs[(at_fault, slice(None)) if axis == 1 else (slice(None), at_fault)] = True
            findings.append(
                Finding(
                    "dead elements",
                    f"{at_fault.size} without a pulse in {role}",
                    f"a pulse in {100 * LEAST_HEARD:.0f} % of an element's pairs",
                    "left out",
                    tuple(int(k) for k in element[at_fault]),
                    role,
                    pairs,
                    float(part[at_fault].max()),
                    "of its pairs",
                )
            )
    return findings
