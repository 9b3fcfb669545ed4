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
from .water_phase import LEAST_PAIRS, fitted
from .waveform_problem import WaveProblem
from .wavelet import matched

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


def sounded(problem: WaveProblem, shots: WaterShots, run: Mapping) -> WaveProblem:
    """The problem with the wavelet, the sampler and the water in which its water shots are simulated best."""
    band, best = problem.band, _matched(problem, shots, problem.water, run)
    shot = int(problem.used[0])
    distance = np.linalg.norm(problem.receivers - problem.emitters[shot], axis=1)
    heard = problem.heard(shot)
    heard = heard[np.argsort(distance[heard], kind="stable")]
    if heard.size < LEAST_PAIRS:
        return best
    medium = problem.medium(np.full(problem.region.shape, problem.water.speed))
    model = simulate(
        medium, problem.emitters[shot], problem.receivers[heard], best.wavelet, poll=problem.poll
    )
    recorded = np.asarray(shots.traces[shot][heard] @ best.sampler, dtype=np.float64)
    water = fitted(problem.water, distance[heard], model, recorded, problem.clock.step_s)
    if max(abs(water.lead + water.bend * f**2) for f in (band.low_hz, band.high_hz)) > FARTHEST:
        return best
    other = _matched(problem, shots, water, run)
    return other if other.likeness > best.likeness else best


def levelled(problem: WaveProblem, shots: WaterShots) -> WaveProblem:
    """The problem with such a gain of each pair that its water shot has the amplitude that is simulated.

    In water that is a smooth function of the distance, drawn through a few simulated shots. What elements
    send and hear more or less of, which depends on the pair, is so taken off its traces of the object.
    """
    medium = problem.medium(np.full(problem.region.shape, problem.water.speed))
    distance = np.linalg.norm(problem.emitters[:, None] - problem.receivers[None], axis=-1)
    apart, size = [], []
    for emitter in _sounding(problem):
        heard = problem.heard(emitter)
        model = simulate(
            medium, problem.emitters[emitter], problem.receivers[heard], problem.wavelet, poll=problem.poll
        )
        apart.append(distance[emitter][heard])
        size.append(_energy(problem, shots, emitter, heard, model))
    curve = np.polynomial.Polynomial.fit(
        np.log(np.concatenate(apart)), 0.5 * np.log(np.concatenate(size)), LEVEL_DEGREE
    )
    gain = problem.gain.copy()
    weight = problem.weight.copy()
    for emitter in np.concatenate((problem.used, problem.held)).tolist():
        heard = problem.heard(emitter)
        traces = shots.gain[emitter][heard][:, None] * (shots.traces[emitter][heard] @ problem.sampler)
        energy = _energy(problem, shots, emitter, heard, traces)
        alive = energy > 0.0
        wanted = np.exp(curve(np.log(distance[emitter][heard])))
        gain[emitter, heard] *= wanted / np.sqrt(np.where(alive, energy, 1.0))
        weight[emitter, heard] *= alive
    return replace(problem, gain=gain, weight=weight)


def _energy(problem: WaveProblem, shots: WaterShots, emitter: int, heard: Ints, traces: Floats) -> Floats:
    """Of each trace in its window, (heard,)."""
    window = problem.window(emitter, heard, shots.reach_s)
    return np.asarray((window * traces.astype(np.float64) ** 2).sum(axis=1))


def _sounding(problem: WaveProblem) -> Ints:
    """The emitters whose water shots are simulated."""
    return problem.used[:: max(1, problem.used.size // SHOTS)][:SHOTS]


def _matched(problem: WaveProblem, shots: WaterShots, water: Water, run: Mapping) -> WaveProblem:
    """With the wavelet that fits in this water."""
    band, samples = problem.band, shots.samples_s
    sampler = resampler(samples, problem.clock, (band.low_hz, band.high_hz), water, band.spacing_m)
    # An impulse where the filter has room on both sides.
    impulse = np.zeros(samples.size)
    ahead = int(-problem.clock.begin_s / (samples[1] - samples[0])) + 1
    impulse[min(samples.size // 2, max(ahead, 0))] = 1.0
    pulse = impulse @ sampler.astype(np.float64)
    medium = problem.medium(np.full(problem.region.shape, water.speed))
    emitters = _sounding(problem)

    def one(emitter: int) -> tuple[Floats, Floats]:
        heard = problem.heard(emitter)
        model = simulate(
            medium, problem.emitters[emitter], problem.receivers[heard], pulse, poll=problem.poll
        )
        recorded = shots.gain[emitter][heard][:, None] * (shots.traces[emitter][heard] @ sampler)
        return model, np.asarray(recorded, dtype=np.float64)

    models, data = (np.concatenate(parts) for parts in zip(*run(one, emitters), strict=True))
    wavelet = matched(pulse, models, data)
    again = _filtered(models, pulse, wavelet)
    window = np.concatenate(
        [problem.window(emitter, problem.heard(emitter), shots.reach_s) for emitter in emitters]
    )
    likeness = 1.0 - correlation(again, data, window)[0]
    return replace(problem, sampler=sampler, wavelet=wavelet, water=water, likeness=likeness)


def _filtered(traces: Floats, pulse: Floats, wavelet: Floats) -> Floats:
    """Traces of one wavelet as those of another: through the filter between the two."""
    padded = 2 * pulse.size
    theirs, ours = np.fft.rfft(pulse, padded), np.fft.rfft(wavelet, padded)
    alive = np.abs(theirs) > 1e-4 * np.abs(theirs).max()
    ratio = np.where(alive, ours / np.where(alive, theirs, 1.0), 0.0)
    return np.asarray(
        np.fft.irfft(np.fft.rfft(traces, padded, axis=1) * ratio, padded, axis=1)[:, : pulse.size]
    )
