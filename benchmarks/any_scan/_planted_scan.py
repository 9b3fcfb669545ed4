"""Faults of a real scan, planted in a simulated or foreign one: gains, dead elements, and time zero."""

from dataclasses import replace

import numpy as np

from bentray_kernels.acquisition import Dataset, Waveform

# Gains of emitters and of receivers, and the emission and the receiver that are dead.
GAINS = (0.7, 1.3)
DEAD_EMISSION, DEAD_RECEPTION = 5, 11

# The recording starts earlier than its file says, s.
LATE_S = 3e-6


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
