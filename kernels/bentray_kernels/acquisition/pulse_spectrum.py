"""Centre frequency and bandwidth of the pulse, from the spectra of traces."""

from typing import Any, NamedTuple

import numpy as np

from ..arrays import Floats
from ..errors import InvalidInput
from ..requests.limits import FREQUENCY_HZ

# Emissions whose spectra are computed.
EMISSIONS = 8

# Frequencies with less of the largest power contribute noise rather than pulse, and end the band.
WEAK, BAND_EDGE = 0.1, 0.25

# Traces with a lower ratio of the highest sample to the median size hold no pulse. Of noise it is below 8.
STANDS_OUT = 12.0


class PulseSpectrum(NamedTuple):
    """Spectrum of the pulse of a scan.

    Attributes:
        center_frequency_hz: mean of the frequencies, weighted by their power.
        bandwidth_hz: width of the band with a quarter of the largest power, at half the amplitude (-6 dB).
    """

    center_frequency_hz: float
    bandwidth_hz: float

    @property
    def summary(self) -> str:
        """In one line."""
        return (
            f"centre frequency {self.center_frequency_hz:.4g} Hz, bandwidth {self.bandwidth_hz:.2g} Hz: "
            "estimated from the spectra of the traces, since the file has none"
        )


def estimate_spectrum(traces: Any, rate_hz: float) -> PulseSpectrum:
    """The spectrum of the pulse: the median over emissions, of traces that hold a pulse.

    Args:
        traces: (ntx, nrx, nt), of one slice, which may be ``Emissions``.
        rate_hz: sampling rate, Hz.

    Raises:
        InvalidInput: where no trace holds a pulse.
    """
    of_power = np.asarray(np.fft.rfftfreq(traces.shape[-1], 1.0 / rate_hz), dtype=np.float64)
    estimates = []
    for e in range(0, len(traces), max(1, len(traces) // EMISSIONS)):
        power = without_noise(power_of(_with_pulse(np.asarray(traces[e], dtype=np.float64))))
        if power.any():
            band = of_power[power >= BAND_EDGE * power.max()]
            estimates.append((mean_frequency(power, of_power), float(np.ptp(band))))
    if not estimates:
        raise InvalidInput(
            "acquisition@center_frequency_hz",
            "nothing, and no pulse in the traces to estimate it from",
            "the centre frequency of the pulse, Hz",
        )
    centre, width = np.median(estimates, axis=0).tolist()
    FREQUENCY_HZ.check("acquisition@center_frequency_hz", centre)
    return PulseSpectrum(centre, width)


def power_of(emission: Floats) -> Floats:
    """Power of the traces of an emission at each frequency, summed.

    Args:
        emission: (traces, nt), finite.
    """
    if not emission.size:
        return np.zeros(emission.shape[-1] // 2 + 1)
    spectrum = np.fft.rfft(emission - emission.mean(axis=1, keepdims=True), axis=1)
    return np.asarray((np.abs(spectrum) ** 2).sum(axis=0))


def without_noise(power: Floats) -> Floats:
    """Power less its median, which is the level of white noise: most frequencies contain nothing else."""
    return np.maximum(power - np.median(power), 0.0)


def mean_frequency(power: Floats, frequency_hz: Floats) -> float:
    """Mean of the frequencies with at least a part ``WEAK`` of the largest power, weighted by it, Hz."""
    strong = power >= WEAK * power.max()
    return float((frequency_hz * power)[strong].sum() / power[strong].sum())


def _with_pulse(emission: Floats) -> Floats:
    """The traces of an emission that are finite and hold a pulse."""
    finite = emission[np.isfinite(emission).all(axis=1)]
    size = np.abs(finite - np.median(finite, axis=1, keepdims=True))
    return np.asarray(finite[size.max(axis=1, initial=0.0) > STANDS_OUT * np.median(size, axis=1)])
