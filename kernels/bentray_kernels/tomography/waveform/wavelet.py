"""The source wavelet, from what was recorded in water."""

from __future__ import annotations

import numpy as np

from ...arrays import Floats
from ...errors import InvalidInput

# Energy below this part of the strongest frequency's does not determine the source.
NOISE = 1e-3


def fit_wavelet(wavelet: Floats, simulated: Floats, recorded: Floats) -> Floats:
    """The wavelet that makes simulated traces fit recorded ones best, by least squares at each frequency.

    Args:
        wavelet: (nt,), that the simulation was made with.
        simulated: (traces, nt).
        recorded: (traces, nt), at the same places, in the same time.

    Returns:
        (nt,), as ``wavelet``.

    Raises:
        InvalidInput: where nothing was recorded.
    """
    nt = wavelet.size
    if recorded.shape != simulated.shape or not np.isfinite(recorded).all() or not np.any(recorded):
        raise InvalidInput(
            "waveform/water", f"shape {recorded.shape}", f"{simulated.shape}, finite, with a signal"
        )
    model, data = (np.fft.rfft(traces, 2 * nt, axis=1) for traces in (simulated, recorded))
    power = (np.abs(model) ** 2).sum(axis=0)
    filter_ = (np.conj(model) * data).sum(axis=0) / (power + NOISE * power.max())
    return np.asarray(np.fft.irfft(filter_ * np.fft.rfft(wavelet, 2 * nt), 2 * nt)[:nt])
