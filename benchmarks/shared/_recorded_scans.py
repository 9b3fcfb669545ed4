"""Scans as others record them: noise and faults put into simulated ones, and one of another simulator."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from bentray_kernels.acquisition import Dataset, Waveform
from bentray_service.cli.output.terminal import Step
from bentray_workers.files.dataset import read_dataset
from bentray_workers.simulation.simulation_run import simulate
from bentray_workers.simulation.waves import WaveSimulationSettings

# A scan simulated by another solver, not in the repository.
OTHERS = Path(__file__).parents[3] / "shared" / "data" / "ring_wave_a.h5"

# Of a quick run.
SMALL = WaveSimulationSettings(3e5, 0.05, 32, 16, nodes=64)

# Gains of emitters and of receivers, and the emission and the receiver that are dead.
GAINS = (0.7, 1.3)
DEAD_EMISSION, DEAD_RECEPTION = 5, 11

# The recording starts earlier than its file says, s.
LATE_S = 3e-6


def wave_scan(asked: WaveSimulationSettings, progress: Step, what: str = "") -> tuple[str, Dataset]:
    """A simulated scan, named by its frequency; ``what`` is said meanwhile, in place of the name."""
    name = f"simulated {1e-3 * asked.frequency_hz:.0f} kHz"
    return name, simulate(asked, lambda now: progress(now.done, now.total, what or name))


def other_scan() -> Iterator[tuple[str, Dataset]]:
    """The scan of another solver with its name, if it is there."""
    if OTHERS.exists():
        yield "ring_wave_a 400 kHz", read_dataset(OTHERS)


def with_trace_noise(dataset: Dataset, snr: float, peak: float | None = None, seed: int = 0) -> Dataset:
    """A scan with Gaussian noise in all traces.

    Args:
        dataset: with traces of object and water.
        snr: ``peak`` over the standard deviation of the noise; inf adds none.
        peak: of a trace; None: the median peak of the water traces, as in ``WaveSimulationSettings``.
        seed: of the noise.
    """
    traces = dataset.waveform
    assert traces is not None
    assert traces.water is not None
    if peak is None:
        peak = float(np.median(np.abs(traces.water).max(axis=-1)))
    random = np.random.default_rng(seed)
    noisy = (
        (values + peak / snr * random.standard_normal(values.shape)).astype(np.float32)
        for values in (traces.object, traces.water)
    )
    return replace(dataset, waveform=Waveform(*noisy))


def planted(dataset: Dataset, seed: int) -> Dataset:
    """The scan with random gains, a dead emitter, a dead receiver and a wrong time zero in both shots.

    Args:
        dataset: one slice with traces of object and water.
        seed: of gains and noise.
    """
    random = np.random.default_rng(seed)
    emission, reception = (random.uniform(*GAINS, len(index)) for index in (dataset.tx, dataset.rx))
    gain = (emission[:, None] * reception)[..., None]
    traces = dataset.waveform
    assert traces is not None
    assert traces.water is not None

    def changed(recorded: np.ndarray) -> np.ndarray:
        shot = recorded * gain
        # The noise of the recorder remains: that of samples before any arrival.
        noise = 1.4826 * float(np.median(np.abs(recorded[..., : recorded.shape[-1] // 16])))
        for dead in (shot[DEAD_EMISSION], shot[:, DEAD_RECEPTION]):
            dead[...] = noise * random.standard_normal(dead.shape)
        return np.asarray(shot, dtype=np.float32)

    waveform = Waveform(changed(traces.object), changed(traces.water), traces.scale)
    return replace(dataset, waveform=waveform, t0_s=dataset.t0_s + LATE_S)


def without_water_shot(dataset: Dataset) -> Dataset:
    """This scan without its water shot."""
    assert dataset.waveform is not None
    return replace(dataset, waveform=replace(dataset.waveform, water=None, water_scale=None))
