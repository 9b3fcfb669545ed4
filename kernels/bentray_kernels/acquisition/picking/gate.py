"""Time gate around the arrival of a pulse, and its power spectrum in the band of the pulse."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats
from ...compilation.compiled import kernel
from ...errors import InvalidInput
from ..dataset import Dataset
from .onset import Trace, prepare
from .pulse import BEFORE, measured_pulse

# Half the length of the gate, in standard deviations of the pulse's power over time, and at most in periods.
# The gate is flat over its inner half. A shorter gate blurs the spectrum, which hides part of the loss; a
# longer one includes later paths.
HALF_SPREADS, MAX_PERIODS = 5.0, 4.0

# The band ends where the power of the pulse falls below this fraction of its maximum: two standard deviations
# of a Gaussian spectrum.
BAND_FLOOR = 0.02

# Frequencies in the band.
FREQUENCIES = 24


@dataclass(frozen=True)
class Gate:
    """A time window around the pulse of a scan, and the frequencies of its spectrum.

    Attributes:
        late: delay of the centre of the pulse after its arrival, samples.
        half: half its length, samples.
        frequency_hz: (frequencies,), equally spaced.
        waves: (samples of a segment, frequencies), factors of a Fourier sum.
        noise_correlation: (frequencies, frequencies), correlation of white noise between them.
    """

    late: float
    half: float
    frequency_hz: Floats
    waves: NDArray[np.complex128]
    noise_correlation: Floats

    @classmethod
    def from_dataset(cls, dataset: Dataset) -> Gate:
        """For the pulse measured in water, see ``measured_pulse``.

        Args:
            dataset: of one slice, with water traces, sampling rate and centre frequency.

        Raises:
            InvalidInput: as ``measured_pulse``; for a pulse without a signal.
        """
        rate, period = dataset.rate_hz, dataset.rate_hz / dataset.frequency_hz
        pulse = measured_pulse(dataset)
        power, time = pulse**2, np.arange(float(pulse.size)) - math.ceil(BEFORE * period)
        if not power.any():
            raise InvalidInput("waveform/water", "no signal", "traces that hold the pulse about its arrival")
        late = float(time @ power / power.sum())
        spread = math.sqrt(float((time - late) ** 2 @ power / power.sum()))
        half = min(max(HALF_SPREADS * spread, period), MAX_PERIODS * period)
        power = np.abs(np.fft.rfft(pulse, 16 * pulse.size)) ** 2
        strong = np.flatnonzero(power >= BAND_FLOOR * power.max()) * rate / (16 * pulse.size)
        frequency = np.linspace(strong[0], strong[-1], FREQUENCIES)
        turn = 2.0 * np.pi * frequency / rate
        sample = np.arange(math.ceil(2.0 * half) + 1.0)
        weight = _flat(sample - half, half) ** 2
        apart = (turn[:, None] - turn)[..., None] * (sample - half)
        noise_correlation = (np.cos(apart) * weight).sum(axis=-1) / weight.sum()
        return cls(late, half, frequency, np.exp(-1j * np.outer(sample, turn)), noise_correlation)

    def powers(self, traces: NDArray[Any], arrival: Floats, rounding: float) -> tuple[Floats, Floats]:
        """Power spectra of the pulses of one emission, and noise power, which is assumed to be white.

        Args:
            traces: (nrx, nt).
            arrival: (nrx,), samples; NaN: unknown.
            rounding: see ``picking.onset.prepare``.

        Returns:
            (nrx, frequencies) and (nrx,), in the traces' unit squared; NaN for incomplete pulses.
        """
        pieces = np.empty((len(traces), len(self.waves)))
        noise = np.empty(len(traces))
        _cut(np.ascontiguousarray(traces), arrival + self.late, self.half, rounding, pieces, noise)
        return np.asarray(np.abs(pieces @ self.waves) ** 2), noise


def _flat(late: Floats, half: float) -> Floats:
    """The window (Tukey): 1 in its inner half, with cosine flanks."""
    return np.asarray(np.cos(np.pi * np.clip(np.abs(late) / half - 0.5, 0.0, 0.5)) ** 2)


@kernel
def _cut(traces: Trace, middle: Floats, half: float, rounding: float, pieces: Floats, noise: Floats) -> None:
    x = np.empty(traces.shape[1])
    for r in range(middle.size):
        noise[r] = np.nan
        pieces[r] = np.nan
        if not (middle[r] >= half and middle[r] + half <= x.size - 1):
            continue
        begin = math.ceil(middle[r] - half)
        level = prepare(traces[r], begin, rounding, x)
        if not math.isfinite(level):
            continue
        noise[r] = 0.0
        for k in range(pieces.shape[1]):
            late = abs(begin + k - middle[r]) / half
            height = math.cos(math.pi * min(max(late - 0.5, 0.0), 0.5)) ** 2
            pieces[r, k] = height * x[min(begin + k, x.size - 1)]
            noise[r] += (height * level) ** 2
