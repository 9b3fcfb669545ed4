"""White noise of one strength, added to the recorded traces of a scan and of its water shot."""

from dataclasses import replace

import numpy as np

from bentray_kernels.acquisition import Dataset, Waveform


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
