"""Fit of the phase speed of the water to water shots."""

import numpy as np

from ...arrays import Floats
from ...errors import InvalidInput
from .trace_resampling import Water

# Frequencies below this part of the strongest are left out.
WEAK = 0.05

# Fewest pairs of one emitter for the line of phase over distance.
MIN_PAIRS = 8


def fit_water(
    water: Water, distance: Floats, simulated: Floats, recorded: Floats, time_step_s: float
) -> Water:
    """The water in which simulated traces would have the phases of the recorded ones.

    At each frequency the phase between the two is a straight line over distance, whose slope is the error of
    the wave number. Over frequency this error is fitted by ``lead`` and ``bend`` of ``Water``.

    Args:
        water: assumed by the simulation and the resampling.
        distance: (pairs,), m, of one emitter's receivers, rising.
        simulated, recorded: (pairs, nt), at the same times.
        time_step_s: s.

    Raises:
        InvalidInput: with fewer than ``MIN_PAIRS`` pairs.
    """
    if distance.size < MIN_PAIRS:
        raise InvalidInput(
            "waveform/water", f"{distance.size} pairs", f"{MIN_PAIRS} pairs at least of one emitter"
        )
    padded = 4 * simulated.shape[1]
    frequency = np.fft.rfftfreq(padded, time_step_s)
    model, data = (np.fft.rfft(traces, padded, axis=1) for traces in (simulated, recorded))
    power = (np.abs(model) * np.abs(data)).sum(axis=0)
    used = np.flatnonzero(power > WEAK * power.max())
    across = np.exp(1j * np.angle(data[:, used] * np.conj(model[:, used])))
    # Phase steps between neighbours are small, so that their sum is unwrapped.
    phase = np.cumsum(np.angle(across[1:] * np.conj(across[:-1])), axis=0)
    phase = np.concatenate((np.zeros((1, used.size)), phase))
    apart = distance - distance.mean()
    slope = apart @ (phase - phase.mean(axis=0)) / (apart @ apart)
    scatter = (phase - phase.mean(axis=0) - apart[:, None] * slope).std(axis=0)
    weight = 2.0 * np.pi * frequency[used] / (scatter + 0.01)
    error = slope * water.speed / (2.0 * np.pi * frequency[used])
    columns = np.column_stack((np.ones(used.size), frequency[used] ** 2 * 1e-12))
    lead, bend = np.linalg.lstsq(weight[:, None] * columns, weight * error, rcond=None)[0]
    return Water(water.speed, water.lead + float(lead), water.bend + 1e-12 * float(bend))
