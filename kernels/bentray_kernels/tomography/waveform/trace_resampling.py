"""Resampling of recorded traces to the simulator: band-pass filter, time steps, numerical dispersion."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...arrays import Floats
from ...wave.stencil import OPTIMISED, numerical_frequency


class Water(NamedTuple):
    """Recorded waves in water: wave number = omega / speed * (1 - lead - bend * frequency^2).

    Attributes:
        speed: m/s.
        lead: relative error of the speed.
        bend: dispersion, s^2; 0 for real water. Simulated scans have the dispersion of their simulator.
    """

    speed: float
    lead: float = 0.0
    bend: float = 0.0


class Clock(NamedTuple):
    """The simulator's samples: time of the first, s, time step, s, and number."""

    begin_s: float
    step_s: float
    steps: int


# Parts of the lower and the upper corner within which the filter falls to zero, as half a cosine. The grid
# resolves frequencies beyond the upper corner worst: with the true image, a fall over half of the corner left
# twice the misfit of one over a quarter.
RISE = 0.5
FALL = 0.25


def band_pass(frequency: Floats, band_hz: tuple[float, float]) -> Floats:
    """Zero-phase band-pass filter: a factor per frequency, 1 inside the band.

    It is 0 below ``RISE`` times the lower corner, whose waves are too long for absorbing edges, and above
    ``1 + FALL`` times the upper.
    """
    low, high = band_hz
    size = np.abs(frequency)
    above = np.clip((size / high - 1.0) / FALL, 0.0, 1.0)
    below = np.clip((1.0 - size / low) / RISE, 0.0, 1.0)
    return np.asarray(0.25 * (1.0 + np.cos(np.pi * above)) * (1.0 + np.cos(np.pi * below)))


def resampler(
    recorded_s: Floats, clock: Clock, band_hz: tuple[float, float], water: Water, spacing: float
) -> NDArray[np.float32]:
    """Matrix that takes a recorded trace to the simulator's samples, (recorded, steps).

    At the frequency omega the scheme has the waves of a fluid at another frequency Omega: traces and wavelet
    whose spectrum at omega is the true one at Omega agree with it. For the error of the time step this holds
    in all media (Koene et al., Geophys. J. Int. 213, 2018). Here the error of the spacing is included, for
    which it holds in water, and nearly in tissue, since the error grows slowly with speed.

    Args:
        recorded_s: (recorded,), times of the recorded samples, equally spaced, s.
        clock: of the simulator.
        band_hz: (lower, upper) corner, see ``band_pass``.
        water: as recorded, see ``waveform.water_phase.fitted``.
        spacing: of the simulator's nodes, m.
    """
    # Twice the length, against wrap-around of the filter.
    simulated = 2.0 * np.pi * np.fft.rfftfreq(2 * clock.steps, clock.step_s)
    number = np.linspace(0.0, np.pi / spacing, 2001)
    numerical = numerical_frequency(number, water.speed, spacing, clock.step_s, OPTIMISED)
    reached = np.interp(simulated, numerical, number)
    frequency = np.linspace(0.0, 2.0 * band_hz[1], 2001)
    recorded = 1.0 - water.lead - water.bend * frequency**2
    true = np.interp(reached, 2.0 * np.pi * frequency * recorded / water.speed, 2.0 * np.pi * frequency)
    apart = recorded_s[1] - recorded_s[0]
    factor = np.where(true * apart < np.pi, band_pass(true / (2.0 * np.pi), band_hz), 0.0)
    used = factor > 0.0
    spectrum = np.zeros((recorded_s.size, simulated.size), dtype=np.complex128)
    spectrum[:, used] = factor[used] * np.exp(-1j * np.outer(recorded_s - clock.begin_s, true[used]))
    spectrum *= apart / clock.step_s
    return np.fft.irfft(spectrum, 2 * clock.steps, axis=1)[:, : clock.steps].astype(np.float32)
