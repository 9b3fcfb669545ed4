"""Analytic signals of the echoes of an emission, without transmitted waves; delay and length of the pulse."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.fft

from ...arrays import Flags, Float32s, Floats
from ...errors import InvalidInput

# Samples of a signal in a period: a linear interpolation of its phase is wrong by 2 % of its size at most.
SAMPLES_A_PERIOD = 16

# A raised cosine from 0 to 1 between these parts of the centre frequency: transmitted waves have slow tails
# without end (in a plane, and where edges of a simulation return long waves), which no mute removes.
STOPPED, PASSED = 0.3, 0.6

# Length of its response, periods.
RESPONSE_PERIODS = 8.0

# The transmitted pulse is compared with that of the water shot so many periods before and after its maximum.
PULSE_PERIODS = 3.0

# The pulse ends where its envelope has fallen to this part of its maximum.
PULSE_END = 0.1

# Width of the taper after the transmitted wave, and of that at the end of the record, periods.
TAPER_PERIODS = 1.0


@dataclass(frozen=True)
class Pulse:
    """The transmitted pulse of a scan.

    Attributes:
        delay_s: from the travel time to the maximum of its envelope, s.
        length_s: from there to its end, s.
    """

    delay_s: float
    length_s: float


def upsampling(rate_hz: float, frequency_hz: float) -> int:
    """Samples of a signal for each one of a trace."""
    return max(1, math.ceil(SAMPLES_A_PERIOD * frequency_hz / rate_hz - 1e-9))


def analytic(traces: Any, factor: int = 1) -> Float32s:
    """Analytic signals of traces, with samples ``factor`` times as dense.

    Args:
        traces: (n, samples), real.
        factor: at least 1.

    Returns:
        (n, 2, factor · samples), real and imaginary parts.
    """
    count, samples = traces.shape
    length = scipy.fft.next_fast_len(samples)
    spectrum = scipy.fft.rfft(np.asarray(traces, dtype=np.float32), length, axis=1)
    # The mean has no phase, and half of the highest frequency belongs to the negative ones.
    spectrum[:, 0] = 0.0
    whole = np.zeros((count, factor * length), dtype=np.complex64)
    whole[:, 1 : spectrum.shape[1]] = 2.0 * factor * spectrum[:, 1:]
    signals = scipy.fft.ifft(whole, axis=1, overwrite_x=True)[:, : factor * samples]
    return np.ascontiguousarray(np.stack((signals.real, signals.imag), axis=1))


def high_pass(traces: Floats, rate_hz: float, frequency_hz: float, later_s: Floats | None = None) -> Floats:
    """Traces without frequencies far below the centre frequency; all others keep their phases.

    Args:
        traces: (n, samples).
        rate_hz: of the samples.
        frequency_hz: centre frequency.
        later_s: (n,), delay of each trace, s; negative: earlier. None: none.
    """
    samples = traces.shape[1]
    more = math.ceil(RESPONSE_PERIODS * rate_hz / frequency_hz)
    length = scipy.fft.next_fast_len(samples + more, real=True)
    spectrum = scipy.fft.rfft(traces, length, axis=1)
    relative = scipy.fft.rfftfreq(length, 1.0 / rate_hz) / frequency_hz
    if later_s is not None:
        spectrum *= np.exp(-2j * np.pi * frequency_hz * later_s[:, None] * relative)
    spectrum *= 0.5 - 0.5 * np.cos(np.pi * np.clip((relative - STOPPED) / (PASSED - STOPPED), 0.0, 1.0))
    return np.asarray(scipy.fft.irfft(spectrum, length, axis=1, overwrite_x=True)[:, :samples])


def envelope(traces: Any) -> Floats:
    """Size of the analytic signals of traces (n, samples)."""
    signals = analytic(traces)
    return np.asarray(np.hypot(signals[:, 0], signals[:, 1]), dtype=np.float64)


def measure_pulse(traces: Iterable[Any], expected_s: Floats, use: Flags, times_s: Floats) -> Pulse:
    """Delay and length of the pulse, medians over pairs of the largest arrival in each trace.

    Args:
        traces: of some emissions, (nrx, samples) each; of the water shot, or through the object.
        expected_s: (emissions, nrx), travel times of the transmitted waves, s.
        use: as ``expected_s``, pairs that are used.
        times_s: (samples,), s.

    Raises:
        InvalidInput: where no pair is used, or all their traces are 0.
    """
    step = times_s[1] - times_s[0]
    delays, lengths = [], []
    for shot, expected, used in zip(traces, expected_s, use, strict=True):
        sizes = envelope(np.asarray(shot, dtype=np.float32)[used])
        for size, arrival in zip(sizes, expected[used], strict=True):
            peak = int(np.argmax(size))
            if size[peak] == 0.0:
                continue
            below = np.flatnonzero(size[peak:] < PULSE_END * size[peak])
            delays.append(times_s[peak] - arrival)
            lengths.append(step * (below[0] if below.size else size.size - peak))
    if not delays:
        raise InvalidInput("waveform/object", "no trace with a pulse", "traces of transmitted waves")
    return Pulse(float(np.median(delays)), float(np.median(lengths)))


def without_water_shot(
    traces: Floats, water: Floats, arrival_s: Floats, window: Floats, times_s: Floats, period_s: float
) -> Floats:
    """Muted traces less what follows the transmitted pulse in the water shot too.

    The shot of each pair is scaled by least squares to the transmitted pulse. Where the difference is not
    weaker after the mute, as with noise alone or a pulse left behind the mute, the trace is kept as it is.

    Args:
        traces: (n, samples), filtered.
        water: as ``traces``, filtered and delayed to the same arrivals.
        arrival_s: (n,), of the maximum of the transmitted pulse, s.
        window: as ``traces``, see ``echo_window``.
        times_s: (samples,), s.
        period_s: of the centre frequency, s.
    """
    near = np.abs(times_s[None, :] - arrival_s[:, None]) <= PULSE_PERIODS * period_s
    product, square = (np.einsum("ij,ij,ij->i", near, record, water) for record in (traces, water))
    scale = np.divide(product, square, out=np.zeros_like(square), where=square > 0.0)
    muted = traces * window
    less = muted - np.maximum(scale, 0.0)[:, None] * water * window
    weaker = np.einsum("ij,ij->i", less, less) < np.einsum("ij,ij->i", muted, muted)
    return np.where(weaker[:, None], less, muted)


def echo_window(transmitted_s: Floats, pulse: Pulse, times_s: Floats, period_s: float) -> Floats:
    """Weight of each sample of traces: 0 until the transmitted pulse is over, then a raised cosine to 1.

    Args:
        transmitted_s: (n,), travel times of the transmitted waves, s.
        pulse: of the scan.
        times_s: (samples,), s.
        period_s: of the centre frequency, s.

    Returns:
        (n, samples); it falls to 0 at the end of the record.
    """
    taper = TAPER_PERIODS * period_s
    over = transmitted_s[:, None] + pulse.delay_s + pulse.length_s
    begun = np.clip((times_s[None, :] - over) / taper, 0.0, 1.0)
    ending = np.clip((times_s[-1] - times_s) / taper, 0.0, 1.0)
    return np.asarray(0.25 * (1.0 - np.cos(np.pi * begun)) * (1.0 - np.cos(np.pi * ending)))
