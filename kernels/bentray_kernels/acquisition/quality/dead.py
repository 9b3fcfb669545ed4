"""Dead elements: hardly any of their pairs has a pulse or a travel time."""

from collections.abc import Iterator

import numpy as np

from ...arrays import Flags
from ..dataset import Dataset
from .finding import ROLES, Finding

# Fraction of an element's pairs that must have a pulse.
MIN_DETECTED = 0.1

# If the median element has pulses in a smaller fraction of its pairs, noise hides the pulses and no element
# is reported as dead.
USUALLY_DETECTED = 0.5


def find_dead(dataset: Dataset, detected: Flags) -> Iterator[Finding]:
    """Find elements that do not emit or do not receive.

    Args:
        dataset: of one slice.
        detected: (ntx, nrx), whether a pair has a pulse or a time.
    """
    other = np.asarray(dataset.tx[:, None] != dataset.rx[None, :])
    for role, element, axis in zip(ROLES, (dataset.tx, dataset.rx), (1, 0), strict=True):
        # Pairs with dead elements of the other role are not counted.
        alive = np.asarray(detected.any(axis=1 - axis))
        pairs_counted = other & (alive[None, :] if axis == 1 else alive[:, None])
        fraction = (detected & pairs_counted).sum(axis=axis) / np.maximum(pairs_counted.sum(axis=axis), 1)
        dead = np.flatnonzero(fraction < MIN_DETECTED)
        if dead.size and np.median(fraction) >= USUALLY_DETECTED:
            pairs = np.zeros_like(detected)
            pairs[(dead, slice(None)) if axis == 1 else (slice(None), dead)] = True
            yield Finding(
                "dead elements",
                f"{dead.size} without a pulse in {role}",
                f"a pulse in {100 * MIN_DETECTED:.0f} % of an element's pairs",
                "left out",
                tuple(int(k) for k in element[dead]),
                role,
                pairs,
                float(fraction[dead].max()),
                "of its pairs",
            )
