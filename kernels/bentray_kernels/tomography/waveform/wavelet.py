"""Estimation of the source wavelet from water shots."""

import numpy as np

from ...arrays import Floats
from ...errors import InvalidInput

# Regularisation: frequencies with less energy than this part of the strongest do not determine the source.
NOISE = 1e-3


def fit_wavelet(wavelet: Floats, simulated: Floats, recorded: Floats) -> Floats:
    """The wavelet with which simulated traces fit recorded ones best, by least squares at each frequency.

    Args:
        wavelet: (nt,), of the simulation.
        simulated: (traces, nt).
        recorded: (traces, nt), at the same positions and times.

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
