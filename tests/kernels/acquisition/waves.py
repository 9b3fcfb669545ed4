"""A small ring scan by simulated waves: pulses that spread, bend and scatter, as no shifted pulse does."""

from functools import cache

import numpy as np

from bentray_kernels.acquisition import Dataset, Waveform
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_kernels.wave.medium import Medium
from bentray_kernels.wave.simulation import simulate

ELEMENTS, RADIUS_M, WATER_MPS, FREQUENCY_HZ = 32, 0.024, 1500.0, 4e5
# Seven nodes in a wave and 32 steps in a period: the water is as good as free of dispersion.
SPACING_M, HALF, STEP_S, SKIP, STEPS = 5e-4, 52, 7.8125e-8, 4, 640
START_S, NOISE = -2.5 / FREQUENCY_HZ, 0.01


@cache
def wave_scan() -> Dataset:
    """float32 traces of two blobs, one slow and one fast, with noise of a hundredth of the usual pulse."""
    axis = SPACING_M * np.arange(-HALF, HALF + 1)
    x, y = np.meshgrid(axis, axis, indexing="ij")
    water = np.full_like(x, WATER_MPS)
    blobs = water - 50.0 * np.exp(-(((x**2 + (y + 0.003) ** 2) / 0.008**2) ** 2))
    blobs += 60.0 * np.exp(-(((x - 0.003) ** 2 + (y - 0.006) ** 2) / 0.003**2))
    position = Ring(ELEMENTS, RADIUS_M).positions()
    late = (START_S + STEP_S * np.arange(STEPS)) * FREQUENCY_HZ
    pulse = np.exp(-((0.9 * late) ** 2)) * np.sin(2.0 * np.pi * late)
    random = np.random.default_rng(5)

    def traces(speed: np.ndarray) -> np.ndarray:
        medium, at = Medium.from_speed(speed, SPACING_M, STEP_S, edge_nodes=20), position + SPACING_M * HALF
        clean = np.stack([simulate(medium, source, at, pulse)[:, ::SKIP] for source in at])
        usual = float(np.median(np.abs(clean).max(axis=-1)))
        return (clean / usual + NOISE * random.standard_normal(clean.shape)).astype(np.float32)

    every = np.arange(ELEMENTS)
    return Dataset(
        position,
        every,
        every,
        WATER_MPS,
        waveform=Waveform(traces(blobs), traces(water)),
        center_frequency_hz=FREQUENCY_HZ,
        sampling_rate_hz=1.0 / (STEP_S * SKIP),
        t0_s=START_S,
    )
