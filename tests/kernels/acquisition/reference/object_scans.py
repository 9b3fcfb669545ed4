"""Scans of a disc: pulses at the straight time through it, with delays and gains of elements."""

from dataclasses import replace

import numpy as np

from bentray_kernels.acquisition import Dataset, Waveform

from ..traces import WATER_MPS, scan

ELEMENTS = 64


def in_disc_m(dataset: Dataset, radius_m: float, centre_m: tuple[float, float] = (0.0, 0.0)) -> np.ndarray:
    """Length of each chord within a disc, (ntx, nrx), m."""
    start = dataset.element_position_m[dataset.tx][:, None] - np.array(centre_m)
    along = dataset.element_position_m[dataset.rx][None] - np.array(centre_m) - start
    length = np.maximum(np.linalg.norm(along, axis=-1), 1e-12)
    offset = np.abs(start[..., 0] * along[..., 1] - start[..., 1] * along[..., 0]) / length
    return np.asarray(2.0 * np.sqrt(np.maximum(radius_m**2 - offset**2, 0.0)))


def disc_delay_s(
    radius_m: float, centre_m: tuple[float, float] = (0.0, 0.0), speed_mps: float = 1420.0
) -> np.ndarray:
    """Object minus water of each pair of a ring around a disc, s."""
    bare = scan(elements=ELEMENTS)
    return np.asarray(in_disc_m(bare, radius_m, centre_m) * (1.0 / speed_mps - 1.0 / WATER_MPS))


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
