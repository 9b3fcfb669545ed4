"""The pulse of a scan, measured in water, and the deconvolution filter for it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InvalidInput
from ..dataset import Dataset, Floats

# Water level of the deconvolution, fraction of the highest power.
WATER_LEVEL = 0.05

# Extent of the pulse before and after the straight time, periods.
BEFORE, AFTER = 4.0, 4.0

# Emissions, evenly spaced, over which the pulse is averaged.
EMISSIONS = 16

# Shortest distance of the pairs used, wavelengths: nearer ones contain cross-talk.
FAR = 10.0


def measured_pulse(dataset: Dataset, arrival_s: Floats | None = None) -> Floats:
    """The pulse in water around its arrival: the median over pairs, each scaled to its peak.

    Args:
        dataset: of one slice, with water traces, sampling rate and centre frequency.
        arrival_s: (ntx, nrx), s, NaN where unknown; None: the straight times.

    Returns:
        (n,), the arrival ``BEFORE`` periods after the first sample.

    Raises:
        InvalidInput: where no water trace contains the whole pulse.
    """
    period, water = dataset.rate_hz / dataset.frequency_hz, dataset.traces.water_traces
    before, length = math.ceil(BEFORE * period), math.ceil((BEFORE + AFTER) * period)
    distance = dataset.distance_m()
    least = min(FAR * dataset.water_speed_mps / dataset.frequency_hz, 0.5 * float(distance.max()))
    if arrival_s is None:
        arrival_s = distance / dataset.water_speed_mps
    pieces: list[Floats] = []
    for e in range(0, len(dataset.tx), max(1, len(dataset.tx) // EMISSIONS)):
        sample = (arrival_s[e] - dataset.t0_s) * dataset.rate_hz
        detected = (distance[e] >= least) & np.isfinite(sample)
        pieces += _pieces(water[e], sample, detected, before, length)
    if not pieces:
        raise InvalidInput(
            "waveform/water", "no pulse whole in any trace", "traces that hold it about its arrival"
        )
    return np.asarray(np.median(pieces, axis=0), dtype=np.float64)


def _pieces(
    traces: NDArray[Any], sample: Floats, detected: NDArray[np.bool_], before: int, length: int
) -> list[Floats]:
    """The pulses of one emission, aligned to a fraction of a sample, peak 1."""
    turn = -2j * np.pi * np.fft.rfftfreq(length)
    pieces = []
    for r in np.flatnonzero(detected):
        begin = math.floor(sample[r]) - before
        if begin < 0 or begin + length > traces.shape[1]:
            continue
        piece = traces[r, begin : begin + length].astype(np.float64)
        if not np.isfinite(piece).all():
            continue
        # Without an offset both ends are near zero, so that the circular shift does not wrap a step.
        piece -= np.median(piece)
        peak = np.abs(piece).max()
        if peak == 0.0:
            continue
        fraction = sample[r] - math.floor(sample[r])
        pieces.append(np.fft.irfft(np.fft.rfft(piece / peak) * np.exp(-turn * fraction), length))
    return pieces


@dataclass(frozen=True)
class Inverse:
    """Deconvolution with a pulse; its largest extremum keeps its position.

    Attributes:
        spectrum: of the filter, at the frequencies of ``length`` samples.
        length: of the padded traces, samples.
        gain: of the standard deviation of white noise.
    """

    spectrum: NDArray[np.complex128]
    length: int
    gain: float

    @classmethod
    def from_dataset(cls, dataset: Dataset) -> Inverse:
        """The filter of a scan: with the recorded wavelet if present, else with ``measured_pulse``.

        W = S* / (|S|² + ε max |S|²), so that the filtered pulse has zero phase and a flat band.

        Raises:
            InvalidInput: as ``measured_pulse``; for a wavelet without a signal.
        """
        pulse = measured_pulse(dataset) if dataset.wavelet is None else dataset.wavelet
        if not np.any(pulse):
            raise InvalidInput("acquisition/wavelet", "zeros", "samples of the pulse")
        length = 2 ** math.ceil(math.log2(dataset.traces.object.shape[-1] + pulse.size))
        power = np.fft.rfft(pulse, length)
        # Time is relative to the largest extremum, whatever the reference of the wavelet.
        power = power * np.exp(2j * np.pi * np.fft.rfftfreq(length) * int(np.argmax(np.abs(pulse))))
        level = WATER_LEVEL * float((np.abs(power) ** 2).max())
        spectrum = np.conj(power) / (np.abs(power) ** 2 + level)
        gain = math.sqrt(float(np.mean(np.abs(spectrum) ** 2)))
        return cls(spectrum, length, gain)

    def __call__(self, traces: NDArray[Any]) -> Floats:
        """Filtered copies, (nrx, nt); a trace with a value that is not finite becomes NaN."""
        whole = traces.astype(np.float64)
        finite = np.isfinite(whole).all(axis=1)
        whole[~finite] = 0.0
        whole -= np.median(whole, axis=1, keepdims=True)
        spectrum = np.fft.rfft(whole, self.length, axis=1) * self.spectrum
        filtered = np.fft.irfft(spectrum, self.length, axis=1)[:, : whole.shape[1]]
        filtered[~finite] = np.nan
        return np.asarray(filtered)
