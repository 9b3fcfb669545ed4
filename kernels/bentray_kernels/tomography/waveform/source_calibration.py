"""Wavelet and phase speed of the water for a problem, from its water shots."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...acquisition.emissions import Emissions
from ...arrays import Floats, Ints
from ...wave.simulation import simulate
from .misfits import correlation
from .trace_resampling import Water, resampler
from .water_phase import LEAST_PAIRS, fit_water
from .waveform_problem import WaveProblem
from .wavelet import fit_wavelet

# Water shots that the wavelet is read from.
SHOTS = 4

# Degree of the polynomial of the logarithm of the water's amplitude over that of the distance.
LEVEL_DEGREE = 3

# Relative error of the water's phase speed beyond which a fit is not believed: its traces have no such waves.
FARTHEST = 0.05

# What runs calls, in order of its argument: ``map``, or that of a pool of threads.
Mapping = Callable[[Callable[..., Any], Iterable[Any]], Iterable[Any]]


@dataclass(frozen=True)
class WaterShots:
    """The scan without the object.

    Attributes:
        traces: (ntx, nrx, nt), as recorded; in memory, or read an emission at a time.
        gain: (ntx, nrx), pressure per count of each trace.
        samples_s: (nt,), times of the samples, s.
        reach_s: (before, after) the arrival in water that traces are compared within, s.
    """

    traces: NDArray[Any] | Emissions
    gain: Floats
    samples_s: Floats
    reach_s: tuple[float, float]


def with_calibrated_source(problem: WaveProblem, shots: WaterShots, run: Mapping) -> WaveProblem:
    """The problem with the wavelet, the sampler and the water in which its water shots are simulated best."""
    band, best = problem.band, _with_wavelet(problem, shots, problem.water, run)
    shot = int(problem.used[0])
    distance = np.linalg.norm(problem.receivers - problem.emitters[shot], axis=1)
    valid = problem.valid_receivers(shot)
    valid = valid[np.argsort(distance[valid], kind="stable")]
    if valid.size < LEAST_PAIRS:
        return best
    medium = problem.medium(np.full(problem.region.shape, problem.water.speed))
    model = simulate(
        medium, problem.emitters[shot], problem.receivers[valid], best.wavelet, poll=problem.poll
    )
    recorded = np.asarray(shots.traces[shot][valid] @ best.sampler, dtype=np.float64)
    water = fit_water(problem.water, distance[valid], model, recorded, problem.clock.step_s)
    if max(abs(water.lead + water.bend * f**2) for f in (band.low_hz, band.high_hz)) > FARTHEST:
        return best
    other = _with_wavelet(problem, shots, water, run)
    return other if other.water_correlation > best.water_correlation else best


def with_normalised_amplitudes(problem: WaveProblem, shots: WaterShots) -> WaveProblem:
    """The problem with such a gain of each pair that its water shot has the amplitude that is simulated.

    In water that is a smooth function of the distance, drawn through a few simulated shots. What elements
    send and receive more or less of, which depends on the pair, is so divided out of the object traces.
    """
    medium = problem.medium(np.full(problem.region.shape, problem.water.speed))
    distance = np.linalg.norm(problem.emitters[:, None] - problem.receivers[None], axis=-1)
    apart, size = [], []
    for emitter in _calibration_emitters(problem):
        valid = problem.valid_receivers(emitter)
        model = simulate(
            medium, problem.emitters[emitter], problem.receivers[valid], problem.wavelet, poll=problem.poll
        )
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
        wanted = np.exp(curve(np.log(distance[emitter][valid])))
        gain[emitter, valid] *= wanted / np.sqrt(np.where(alive, energy, 1.0))
        weight[emitter, valid] *= alive
    return replace(problem, gain=gain, weight=weight)


def _energy(problem: WaveProblem, shots: WaterShots, emitter: int, valid: Ints, traces: Floats) -> Floats:
    """Of each trace in its window, (valid,)."""
    window = problem.window(emitter, valid, shots.reach_s)
    return np.asarray((window * traces.astype(np.float64) ** 2).sum(axis=1))


def _calibration_emitters(problem: WaveProblem) -> Ints:
    """The emitters whose water shots are simulated."""
    return problem.used[:: max(1, problem.used.size // SHOTS)][:SHOTS]


def _with_wavelet(problem: WaveProblem, shots: WaterShots, water: Water, run: Mapping) -> WaveProblem:
    """With the wavelet that fits in this water."""
    band, samples = problem.band, shots.samples_s
    sampler = resampler(samples, problem.clock, (band.low_hz, band.high_hz), water, band.spacing_m)
    # An impulse where the filter has room on both sides.
    impulse = np.zeros(samples.size)
    ahead = int(-problem.clock.begin_s / (samples[1] - samples[0])) + 1
    impulse[min(samples.size // 2, max(ahead, 0))] = 1.0
    pulse = impulse @ sampler.astype(np.float64)
    medium = problem.medium(np.full(problem.region.shape, water.speed))
    emitters = _calibration_emitters(problem)

    def one(emitter: int) -> tuple[Floats, Floats]:
        valid = problem.valid_receivers(emitter)
        model = simulate(
            medium, problem.emitters[emitter], problem.receivers[valid], pulse, poll=problem.poll
        )
        recorded = shots.gain[emitter][valid][:, None] * (shots.traces[emitter][valid] @ sampler)
        return model, np.asarray(recorded, dtype=np.float64)

    models, data = (np.concatenate(parts) for parts in zip(*run(one, emitters), strict=True))
    wavelet = fit_wavelet(pulse, models, data)
    again = _filtered(models, pulse, wavelet)
    window = np.concatenate(
        [problem.window(emitter, problem.valid_receivers(emitter), shots.reach_s) for emitter in emitters]
    )
    water_correlation = 1.0 - correlation(again, data, window)[0]
    return replace(
        problem, sampler=sampler, wavelet=wavelet, water=water, water_correlation=water_correlation
    )


def _filtered(traces: Floats, pulse: Floats, wavelet: Floats) -> Floats:
    """Traces of one wavelet as those of another: through the filter between the two."""
    padded = 2 * pulse.size
    theirs, ours = np.fft.rfft(pulse, padded), np.fft.rfft(wavelet, padded)
    alive = np.abs(theirs) > 1e-4 * np.abs(theirs).max()
    ratio = np.where(alive, ours / np.where(alive, theirs, 1.0), 0.0)
    return np.asarray(
        np.fft.irfft(np.fft.rfft(traces, padded, axis=1) * ratio, padded, axis=1)[:, : pulse.size]
    )
