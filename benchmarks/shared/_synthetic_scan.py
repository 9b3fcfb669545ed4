"""A synthetic ring scan of smooth delays without a simulation, written to a file for workers."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from bentray_kernels.acquisition import Dataset, Waveform
from bentray_kernels.acquisition.simulation.ring_scan import Ring
from bentray_workers.files.dataset import write_dataset

RADIUS_M = 0.08


def made_up_scan(
    path: Path, elements: int, slices: int, *, losses: bool = False, pitch_m: float = 0.003
) -> Path:
    """Delays of 1 µs through the middle, none along the rim, weaker from slice to slice; and losses."""
    every = np.arange(elements)
    angle = every * 2 * np.pi / elements
    chord = np.sin(0.5 * (angle[:, None] - angle[None, :])) ** 2
    delta = -1e-6 * chord * np.linspace(1.0, 0.5, slices)[:, None, None]
    several = slices > 1
    delta = delta if several else delta[0]
    dataset = Dataset(
        Ring(elements, RADIUS_M).positions(),
        every,
        every,
        1500.0,
        delta_tof_s=delta,
        log_ratio_np=-1e5 * delta if losses else None,
        water_attenuation_np_m=0.1 if losses else None,
        slice_z_m=pitch_m * np.arange(slices) if several else None,
    )
    write_dataset(path, dataset)
    return path


def made_up_traces(
    path: Path, elements: int, samples: int, *, water: bool = True, centre_hz: float = 1e6, slices: int = 1
) -> Path:
    """Pulses through water and an object that delays and damps them, with noise; 8 samples a cycle."""
    ring, every = Ring(elements, 0.05).positions(), np.arange(elements)
    rate_hz, time = 8.0 * centre_hz, np.arange(samples) / (8.0 * centre_hz) - 4.0 / centre_hz
    random = np.random.default_rng(0)
    traces = {name: np.empty((slices, elements, elements, samples), np.int16) for name in ("object", "water")}
    for place in np.ndindex(slices, elements):
        length = np.linalg.norm(ring - ring[place[1]], axis=1)[:, None]
        for name, array in traces.items():
            chord = (length / 0.1) ** 2 if name == "object" else 0.0
            late = centre_hz * (time - length / 1480.0) + 0.3 * chord
            pulse = np.exp(-(late**2) - 0.3 * chord) * np.sin(2.0 * np.pi * late)
            array[place] = 1000.0 * pulse + 3.0 * random.standard_normal(pulse.shape)
    one = {name: array if slices > 1 else array[0] for name, array in traces.items()}
    dataset = Dataset(
        ring,
        every,
        every,
        1480.0,
        waveform=Waveform(one["object"], one["water"] if water else None),
        center_frequency_hz=centre_hz,
        sampling_rate_hz=rate_hz,
        t0_s=-4.0 / centre_hz,
        slice_z_m=0.003 * np.arange(slices) if slices > 1 else None,
    )
    write_dataset(path, dataset)
    return path
