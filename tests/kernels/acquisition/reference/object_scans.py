"""Scans of a disc: pulses at the straight time through it, with delays and gains of elements."""

from dataclasses import replace
from functools import cache

import numpy as np

from bentray_kernels.acquisition import Dataset, Waveform

from ...straight_scans import chords_m, ring_scan
from ..traces import RADIUS_M, WATER_MPS, scan

ELEMENTS = 64


def disc_delay_s(
    radius_m: float, centre_m: tuple[float, float] = (0.0, 0.0), speed_mps: float = 1420.0
) -> np.ndarray:
    """Object minus water of each pair of a ring around a disc, s."""
    chord = chords_m(ring_scan(ELEMENTS, RADIUS_M), radius_m, centre_m)
    return np.asarray(chord * (1.0 / speed_mps - 1.0 / WATER_MPS))


def with_elements(
    dataset: Dataset, seed: int, delay_s: float, gain: float
) -> tuple[Dataset, np.ndarray, np.ndarray]:
    """Random gains of emitters and receivers on both shots, and a later start of the recording.

    Args:
        dataset: a scan with float32 traces.
        seed: of the gains.
        delay_s: by which the file states the start too late, s.
        gain: largest logarithm of a gain.
    """
    random = np.random.default_rng(seed)
    emission, reception = (random.uniform(-gain, gain, ELEMENTS) for _ in range(2))
    factor = np.exp(emission[:, None] + reception)[..., None].astype(np.float32)
    traces = dataset.waveform
    assert traces is not None
    assert traces.water is not None
    waveform = Waveform(traces.object * factor, traces.water * factor)
    return replace(dataset, waveform=waveform, t0_s=dataset.t0_s + delay_s), emission, reception


def without_water(dataset: Dataset) -> Dataset:
    """The scan without its water shot."""
    assert dataset.waveform is not None
    return replace(dataset, waveform=replace(dataset.waveform, water=None, water_scale=None))


@cache
def half_disc() -> Dataset:
    """A slow disc of half the radius of the ring, in noise."""
    return scan(disc_delay_s(0.5 * RADIUS_M), elements=ELEMENTS, noise=0.02)
