"""The reflection image from its sums: mean echo, coherence factor, decibels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...arrays import Float32s, Floats
from .delay_and_sum import Sums

# Echoes below this, relative to the strongest one, are noise of any scanner, dB.
FLOOR_DB = -100.0


def envelope_of(sums: Sums, emissions: int) -> Float32s:
    """Envelope of the mean echo at every pixel, |Σ b_e| / Σ w, times the coherence factor.

    The factor is |Σ b_e|² / (n Σ |b_e|²), from 0 for echoes of n emissions
    with random phases (1/n on average) to 1 for equal ones (Mallart & Fink, J. Acoust. Soc. Am. 96, 1994).

    Args:
        sums: over all emissions.
        emissions: n.
    """
    size = np.abs(sums.echo)
    mean = np.divide(size, sums.weight, out=np.zeros_like(size), where=sums.weight > 0.0)
    most = emissions * sums.power
    return np.asarray(mean * np.divide(size**2, most, out=np.zeros_like(size), where=most > 0.0))


def in_decibels(envelopes: Sequence[Float32s]) -> list[Floats]:
    """Envelopes relative to the largest value of all of them, dB, at least ``FLOOR_DB``."""
    largest = max(float(image.max()) for image in envelopes)
    floor = 10.0 ** (FLOOR_DB / 20.0)
    if largest == 0.0:
        return [np.full(image.shape, FLOOR_DB) for image in envelopes]
    return [20.0 * np.log10(np.maximum(image.astype(np.float64) / largest, floor)) for image in envelopes]
