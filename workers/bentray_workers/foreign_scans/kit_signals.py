"""Signals of KIT 3D USCT: 16-bit floating point, bandpass undersampling and coded excitation.

Source:
    ``USCT_data_convert.m``, ``convertfp16tofloat.m`` and ``ReconstructBandpasssubsampling.m`` of the access
    scripts, github.com/KIT-3DUSCT.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

# Sampling rate of reconstructed traces, Hz, and its ratio to that of undersampled ones.
RATE_HZ = 10e6
UNDERSAMPLING = 3


def decode_float16(coded: NDArray[Any]) -> NDArray[np.float32]:
    """Values of the 16-bit format of KIT, in any shape.

    Bits from the highest: sign (1), exponent (4), fraction (11). The mantissa is the fraction with a hidden
    bit, which is the complement of the sign unless the exponent is 0, in two's complement; exponents 0 and 1
    have the same scale.
    """
    bits = np.asarray(coded).astype(np.int16).view(np.uint16).astype(np.int32)
    negative, exponent, fraction = bits >> 15, (bits >> 11) & 15, bits & 2047
    hidden = np.where(negative == (exponent == 0), 2048, 0)
    mantissa = fraction + hidden - 4096 * negative
    values: NDArray[np.float32] = np.ldexp(mantissa.astype(np.float32), np.maximum(exponent - 1, 0))
    return values


def reconstruct_undersampled(traces: NDArray[Any]) -> Floats:
    """Traces at ``RATE_HZ`` of traces that were sampled at a third of it.

    The pulse is in the second Nyquist zone, from a sixth to a third of ``RATE_HZ``: its spectrum is that of
    the negative frequencies of the recorded samples.

    Args:
        traces: (n, samples).

    Returns:
        (n, 3 samples); an odd number of samples is padded by one.
    """
    if traces.shape[-1] % 2:
        traces = np.pad(traces, ((0, 0), (0, 1)))
    samples = traces.shape[-1]
    recorded = np.fft.fft(traces, axis=-1)
    spectrum = np.zeros((len(traces), UNDERSAMPLING * samples // 2 + 1), dtype=np.complex128)
    spectrum[:, samples // 2 : samples] = UNDERSAMPLING * recorded[:, samples // 2 :]
    return np.fft.irfft(spectrum, UNDERSAMPLING * samples, axis=-1)


def compress(traces: NDArray[Any], excitation: Floats | None) -> Floats:
    """Pulse compression: the phase of the coded excitation is removed, so that pulses are at their arrival.

    Args:
        traces: (n, samples).
        excitation: at the same rate, from the time of emission; None: nothing is removed.
    """
    if excitation is None:
        return np.asarray(traces, dtype=np.float64)
    samples = traces.shape[-1]
    # Padded, since pulses begin before their arrival and must not wrap around.
    length = 2 ** int(np.ceil(np.log2(samples + len(excitation))))
    code = np.fft.rfft(excitation, length)
    size = np.abs(code)
    phase = np.where(size > 0.0, code / np.maximum(size, np.finfo(float).tiny), 1.0)
    return np.fft.irfft(np.fft.rfft(traces, length, axis=-1) * phase.conj(), length, axis=-1)[:, :samples]
