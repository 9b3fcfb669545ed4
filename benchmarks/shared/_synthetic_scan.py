"""Synthetic ring scans of smooth delays and pulses without a simulation, written to files for workers."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bentray_kernels.acquisition import Dataset, Waveform
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_workers.files.dataset import write_dataset

RADIUS_M, WATER_MPS = 0.08, 1500.0


def made_up_scan(
    path: Path, elements: int, slices: int, emitters: int = 0, pitch_m: float = 0.003, *, losses: bool = False
) -> Path:
    """Delays of 1 µs through the middle, none along the rim, weaker from slice to slice; and losses.

    Args:
        path: of the file.
        elements: of the ring; all receive.
        slices: their number.
        emitters: evenly spaced elements that emit; 0: all.
        pitch_m: distance of slices, m.
        losses: whether amplitudes are recorded too.
    """
    every = np.arange(elements)
    emitting = every[:: elements // emitters] if emitters else every
    angle = every * 2 * np.pi / elements
    chord = np.sin(0.5 * (angle[emitting][:, None] - angle[None, :])) ** 2
    delta = -1e-6 * chord * np.linspace(1.0, 0.5, slices)[:, None, None]
    several = slices > 1
    delta = delta if several else delta[0]
    dataset = Dataset(
        Ring(elements, RADIUS_M).positions(),
        emitting,
        every,
        WATER_MPS,
        delta_tof_s=delta,
        log_ratio_np=-1e5 * delta if losses else None,
        water_attenuation_np_m=0.1 if losses else None,
        slice_z_m=pitch_m * np.arange(slices) if several else None,
    )
    write_dataset(path, dataset)
    return path


def made_up_traces(
    path: Path, elements: int, samples: int, centre_hz: float, *, water: bool = True, real: bool = False
) -> Path:
    """Pulses through water, as object and as water, with noise; 8 samples a cycle.

    Args:
        path: of the file.
        elements: of the ring; all emit and receive.
        samples: of each trace.
        centre_hz: of the pulse.
        water: whether the water alone is recorded too.
        real: stored as float32, not int16.
    """
    ring, every = Ring(elements, 0.05).positions(), np.arange(elements)
    time = np.arange(samples) / (8.0 * centre_hz) - 4.0 / centre_hz
    random = np.random.default_rng(0)
    traces = np.empty((elements, elements, samples), np.float32 if real else np.int16)
    for emitter in every:
        length = np.linalg.norm(ring - ring[emitter], axis=1)[:, None]
        late = centre_hz * (time - length / WATER_MPS)
        pulse = np.exp(-(late**2)) * np.sin(2.0 * np.pi * late)
        traces[emitter] = 1000.0 * pulse + 3.0 * random.standard_normal(pulse.shape)
    dataset = Dataset(
        ring,
        every,
        every,
        WATER_MPS,
        waveform=Waveform(traces, traces if water else None),
        center_frequency_hz=centre_hz,
        sampling_rate_hz=8.0 * centre_hz,
        t0_s=-4.0 / centre_hz,
    )
    write_dataset(path, dataset)
    return path


def made_up_bursts(path: Path, emissions: int, elements: int) -> Path:
    """Traces of 500 kHz bursts after the delays of ``made_up_scan``, without loss or scattering."""
    transmitter, every = np.arange(0, elements, elements // emissions), np.arange(elements)
    position = Ring(elements, RADIUS_M).positions()
    distance = np.linalg.norm(position[transmitter][:, None] - position[None], axis=2)
    rate = 5e6
    time_s = np.arange(int((2 * RADIUS_M / 1500.0 + 2e-5) * rate)) / rate

    def traces(arrival_s: NDArray[np.float64]) -> NDArray[np.int16]:
        after = time_s - arrival_s[..., None] - 4e-6
        burst = np.exp(-((after / 1.5e-6) ** 2)) * np.sin(2 * np.pi * 5e5 * after)
        return np.round(8000.0 * burst).astype(np.int16)

    water_s = distance / 1500.0
    delayed_s = water_s - 1e-6 * (distance / (2 * RADIUS_M)) ** 2
    waveform = Waveform(traces(delayed_s), traces(water_s))
    dataset = Dataset(position, transmitter, every, 1500.0, waveform=waveform, sampling_rate_hz=rate)
    write_dataset(path, dataset)
    return path
