"""Calibration of the wavelet and of the phase speed of the water from water shots."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...acquisition.emissions import Emissions
from ...arrays import Floats, Ints
from .misfits import correlation
from .trace_resampling import Water, resampler
from .water_phase import MIN_PAIRS, fit_water
from .waveform_problem import WaveProblem
from .wavelet import fit_wavelet

# Number of water shots from which the wavelet is estimated.
SHOTS = 4

# Degree of the polynomial of the logarithm of the water's amplitude over that of the distance.
LEVEL_DEGREE = 3

# Largest accepted relative error of the water's phase speed; larger fits come from traces without such waves.
FARTHEST = 0.05


@dataclass(frozen=True)
class WaterShots:
    """The scan without the object.

    Attributes:
        traces: (ntx, nrx, nt), as recorded; in memory, or read one emission at a time.
        gain: (ntx, nrx), pressure per count of each trace.
        samples_s: (nt,), times of the samples, s.
        reach_s: (before, after) the arrival in water, the window of the comparison, s.
    """

    traces: NDArray[Any] | Emissions
    gain: Floats
    samples_s: Floats
    reach_s: tuple[float, float]


def with_calibrated_source(problem: WaveProblem, shots: WaterShots) -> WaveProblem:
    """The problem with the wavelet, sampler and water that reproduce its water shots best."""
    band, best = problem.band, _with_wavelet(problem, shots, problem.water)
    shot = int(problem.used[0])
    distance = np.linalg.norm(problem.receivers - problem.emitters[shot], axis=1)
    valid = problem.valid_receivers(shot)
    valid = valid[np.argsort(distance[valid], kind="stable")]
    if valid.size < MIN_PAIRS:
        return best
    model = problem.simulated(problem.in_water(problem.water.speed), shot, valid, best.wavelet)
    recorded = np.asarray(shots.traces[shot][valid] @ best.sampler, dtype=np.float64)
    water = fit_water(problem.water, distance[valid], model, recorded, problem.clock.step_s)
    if max(abs(water.lead + water.bend * f**2) for f in (band.low_hz, band.high_hz)) > FARTHEST:
        return best
    other = _with_wavelet(problem, shots, water)
    return other if other.water_correlation > best.water_correlation else best


def with_normalised_amplitudes(problem: WaveProblem, shots: WaterShots) -> WaveProblem:
    """The problem with gains for which each water shot has its simulated amplitude.

    In water the amplitude is a smooth function of the distance, fitted to a few simulated shots. The
    sensitivities of the elements, which differ from pair to pair, are so divided out of the object traces.
    """
    medium = problem.in_water(problem.water.speed)
    distance = np.linalg.norm(problem.emitters[:, None] - problem.receivers[None], axis=-1)
    apart, size = [], []
    for emitter in calibration_emitters(problem):
        valid = problem.valid_receivers(emitter)
        model = problem.simulated(medium, emitter, valid, problem.wavelet)
        apart.append(distance[emitter][valid])
        size.append(_energy(problem, shots, emitter, valid, model))
    curve = np.polynomial.Polynomial.fit(
        np.log(np.concatenate(apart)), 0.5 * np.log(np.concatenate(size)), LEVEL_DEGREE
    )
    gain = problem.gain.copy()
    weight = problem.weight.copy()
    for emitter in np.concatenate((problem.used, problem.held)).tolist():
        valid = problem.valid_receivers(emitter)
        traces = shots.gain[emitter][valid][:, None] * (shots.traces[emitter][valid] @ problem.sampler)
        energy = _energy(problem, shots, emitter, valid, traces)
        alive = energy > 0.0
        amplitude = np.exp(curve(np.log(distance[emitter][valid])))
        gain[emitter, valid] *= amplitude / np.sqrt(np.where(alive, energy, 1.0))
        weight[emitter, valid] *= alive
    return replace(problem, gain=gain, weight=weight)


def _energy(problem: WaveProblem, shots: WaterShots, emitter: int, valid: Ints, traces: Floats) -> Floats:
    """Energy of each trace in its window, (valid,)."""
    window = problem.window(emitter, valid, shots.reach_s)
    return np.asarray((window * traces.astype(np.float64) ** 2).sum(axis=1))


def calibration_emitters(problem: WaveProblem) -> Ints:
    """The emitters whose water shots are simulated."""
    return problem.used[:: max(1, problem.used.size // SHOTS)][:SHOTS]


def _with_wavelet(problem: WaveProblem, shots: WaterShots, water: Water) -> WaveProblem:
    """The problem with the wavelet that fits best in this water."""
    band, samples = problem.band, shots.samples_s
    sampler = resampler(samples, problem.clock, (band.low_hz, band.high_hz), water, band.spacing_m)
    # An impulse with a margin for the filter on both sides.
    impulse = np.zeros(samples.size)
    ahead = int(-problem.clock.begin_s / (samples[1] - samples[0])) + 1
    impulse[min(samples.size // 2, max(ahead, 0))] = 1.0
    pulse = impulse @ sampler.astype(np.float64)
    medium, readings = problem.in_water(water.speed), []
    for emitter in calibration_emitters(problem):
        valid = problem.valid_receivers(emitter)
        model = problem.simulated(medium, emitter, valid, pulse)
        recorded = shots.gain[emitter][valid][:, None] * (shots.traces[emitter][valid] @ sampler)
        window = problem.window(emitter, valid, shots.reach_s)
        readings.append((model, np.asarray(recorded, dtype=np.float64), window))
    models, data, windows = (np.concatenate(arrays) for arrays in zip(*readings, strict=True))
    wavelet = fit_wavelet(pulse, models, data)
    water_correlation = 1.0 - correlation(_filtered(models, pulse, wavelet), data, windows)[0]
    return replace(
        problem, sampler=sampler, wavelet=wavelet, water=water, water_correlation=water_correlation
    )


def _filtered(traces: Floats, pulse: Floats, wavelet: Floats) -> Floats:
    """Traces simulated with ``pulse``, filtered to those of ``wavelet``."""
    padded = 2 * pulse.size
    old, new = np.fft.rfft(pulse, padded), np.fft.rfft(wavelet, padded)
    strong = np.abs(old) > 1e-4 * np.abs(old).max()
    ratio = np.where(strong, new / np.where(strong, old, 1.0), 0.0)
    return np.asarray(
        np.fft.irfft(np.fft.rfft(traces, padded, axis=1) * ratio, padded, axis=1)[:, : pulse.size]
    )
